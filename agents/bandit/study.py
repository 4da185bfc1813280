"""BANDIT as a learner of the studies' engine.

`pretrain_KEY/seed_N` holds reference models and critics that runs of a seed begin with.
"""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.bandit.corpus import corpus_digest
from embodied.agents.bandit.ratings import Rater
from embodied.agents.bandit.training import RATED, TokenizedCorpora, bandit, load_corpus, pretrain, train_critic
from embodied.agents.common.session import Note
from embodied.agents.common.weights import read_checkpoint
from embodied.agents.learners.bandit import BanditConfig
from embodied.agents.studies.engine import Measured, StudyLearner
from embodied.agents.studies.tables import StudyRow, StudyTable, study_tables
from embodied.evaluation.tables import Samples
from embodied.records import identity_of, key_of

SENTENCE, HELD_OUT = "per-sentence BLEU", "held-out BLEU"


@dataclass(frozen=True)
class BanditStudy(StudyLearner):
    """Table 3.2 and Figure 3.5."""

    data: Path
    """Corpus."""
    config: BanditConfig
    repeats: tuple[int, ...]
    """Training seeds, each with its own pre-training."""
    threads: int = 1
    rater: Rater | None = None
    """Who rates in the table 'people': the rater that people were found to resemble."""

    name = "bandit"

    def tables(self) -> Mapping[str, StudyTable]:
        tables = study_tables("bandit")
        if self.rater is None:
            return tables
        clean = tables["3.5"].rows[0]
        people = StudyRow(
            "as people rate", {**(clean.train or {}), "rater": dataclasses.asdict(self.rater)}, {}, clean.minus
        )
        title = f"Gain by NED-A2C from ratings like people's: {self.rater}"
        return {**tables, "people": StudyTable(title, (clean, people), (SENTENCE, HELD_OUT))}

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """A corpus that cannot be read is refused."""
        self._corpus_of(self.repeats[0])

    def prepare_seed(self, rows: Sequence[StudyRow], seed: int, folder: Path, note: Note) -> None:
        m, home = self._corpus_of(seed), self._begun(seed, folder)
        pretrain(m, home / "pretrain", note=note)
        for reference in dict.fromkeys(row.train["reference"] for row in rows if row.train):
            train_critic(m, home / "pretrain" / f"{reference}.safetensors", home / reference, note=note)

    def trained(self, train: Mapping[str, Any], seed: int, folder: Path) -> Mapping[str, Any]:
        config = dataclasses.replace(self.config, seed=seed)
        return identity_of("embodied.agents.bandit.training", settings=config, corpus=_corpus(self.data), run=train)

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        begun, m = self._begun(seed, folder), self._corpus_of(seed)
        reference = begun / "pretrain" / f"{train['reference']}.safetensors"
        critic = begun / train["reference"] / "critic.safetensors"
        bandit(m, reference, critic, home, train["learner"], rater=Rater(**train.get("rater", {})), note=note)
        return home / "best.safetensors"

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {"corpus": _corpus(self.data), **row.judge}

    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Measured:
        assert weights is not None, "every row is a run"
        history = read_checkpoint(weights.parent / "checkpoint.pt")["history"]
        return {c: Samples((history[0][c],)) for c in (SENTENCE, HELD_OUT)}

    def about(self) -> str:
        c, seeds = self.config, ", ".join(map(str, self.repeats))
        return (
            f"Hidden size {c.hidden_size}, {c.source_words:,} and {c.target_words:,} words, "
            f"{c.pretraining_passes} passes of pre-training at {c.pretraining_rate:g}, {c.critic_passes} of the "
            f"critic, learning rate {c.bandit_rate:g} with ratings. Seeds {seeds}, each with its own pre-training; "
            "differences are taken seed by seed."
        )

    def _corpus_of(self, seed: int) -> TokenizedCorpora:
        return _corpus_of(self.data, dataclasses.replace(self.config, seed=seed))

    def _begun(self, seed: int, folder: Path) -> Path:
        """The folder of the references and critics of a seed."""
        key = key_of(identity_of(settings=self.config, corpus=_corpus(self.data)))
        return folder / f"pretrain_{key}" / f"seed_{seed}"


_corpus_of = functools.lru_cache(maxsize=8)(load_corpus)
"""Corpora in numbers of the seeds at hand: reading one takes as long as many updates."""


@functools.lru_cache(maxsize=8)
def _corpus(folder: Path) -> str:
    return corpus_digest(folder, ("supervised", "dev", "test", RATED))
