"""Table 3.2, Figures 3.4 and 3.5 as data; BANDIT as a learner of the engine.

`pretrain_KEY/seed_N` holds reference models and critics that runs of a seed begin with.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.bandit.config import BanditConfig
from embodied.agents.bandit.corpus import corpus_digest
from embodied.agents.bandit.ratings import Rater
from embodied.agents.bandit.training import RATED, TokenizedCorpora, bandit, load_corpus, pretrain, train_critic
from embodied.agents.common.session import Note
from embodied.agents.common.weights import read_checkpoint
from embodied.agents.studies.engine import Measured, StudyLearner
from embodied.agents.studies.tables import Figure, StudyRow, StudyTable
from embodied.evaluation.tables import Samples
from embodied.records import identity_of, key_of

SENTENCE, HELD_OUT = "per-sentence BLEU", "held-out BLEU"
PASSES = 5
"""Of Figure 3.4."""
SWEEPS: Mapping[str, Sequence[float]] = {
    "granularity": (1, 2, 3, 4, 5, 6, 7, 8, 9, 10),
    "variance": (0.1, 0.2, 0.5, 1, 2, 5),
    "skew": (0.25, 0.5, 0.67, 1.5, 2, 4),
}
"""Figure 3.5's settings; a skew of 1 is the clean rater."""
REFERENCES = {"full": "fully", "weak": "weakly"}


def _row(label: str, learner: str, reference: str = "full", **more: Any) -> StudyRow:
    return StudyRow(label, {"reference": reference, "learner": learner, **more})


def _gain(label: str, learner: str, reference: str = "full", **more: Any) -> StudyRow:
    """A row of differences to the reference model."""
    return dataclasses.replace(_row(label, learner, reference, **more), minus=_row("reference", "reference", reference))


def _sweep() -> tuple[StudyRow, ...]:
    rows = [_gain("clean", "a2c")]
    for name, values in SWEEPS.items():
        for value in values:
            row = _gain(f"{name} {value:g}", "a2c", rater={name: value})
            rows.append(dataclasses.replace(row, x=value, series=name))
    return tuple(rows)


BANDIT_TABLES: Mapping[str, StudyTable] = {
    "3.2": StudyTable(
        "Translation scores and their improvement by one round of ratings",
        tuple(
            row
            for reference, how in REFERENCES.items()
            for row in (
                _row(f"{how} pre-trained, reference", "reference", reference),
                _gain(f"{how} pre-trained, Δ supervised", "supervised", reference),
                _gain(f"{how} pre-trained, Δ NED-A2C", "a2c", reference),
            )
        ),
        (SENTENCE, HELD_OUT),
    ),
    "3.4": StudyTable(
        "NED-A2C for five passes",
        tuple(
            dataclasses.replace(row, judge={"curve": True})
            for row in (_row("NED-A2C", "a2c", passes=PASSES), _row("reference", "reference"))
        ),
        figure=Figure((SENTENCE.replace(" ", "_"),), "pass over the rated sentences", SENTENCE),
    ),
    "3.5": StudyTable(
        "Gain by NED-A2C under imperfect ratings",
        _sweep(),
        (SENTENCE, HELD_OUT),
        figure=Figure((SENTENCE.replace(" ", "_"),), "strength of the perturbation", f"Δ {SENTENCE}", log=True),
    ),
}


@dataclass(frozen=True)
class BanditStudy(StudyLearner):
    """Table 3.2, Figures 3.4 and 3.5."""

    data: Path
    """Corpus."""
    config: BanditConfig
    repeats: tuple[int, ...]
    """Training seeds, each with its own pre-training."""
    threads: int = 1
    rater: Rater | None = None
    """Who rates in the table 'people': the rater that people were found to resemble."""

    name = "bandit"
    judges = ("embodied.agents.bandit.training",)

    def tables(self) -> Mapping[str, StudyTable]:
        if self.rater is None:
            return BANDIT_TABLES
        people = _gain("as people rate", "a2c", rater=dataclasses.asdict(self.rater))
        title = f"Gain by NED-A2C from ratings like people's: {self.rater}"
        return {**BANDIT_TABLES, "people": StudyTable(title, (_gain("clean", "a2c"), people), (SENTENCE, HELD_OUT))}

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
        rater, passes = Rater(**train.get("rater", {})), train.get("passes", 1)
        bandit(m, reference, critic, home, train["learner"], rater=rater, passes=passes, note=note)
        return home / "best.safetensors"

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {"corpus": _corpus(self.data), **row.judge}

    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Measured:
        assert weights is not None, "every row is a run"
        history = read_checkpoint(weights.parent / "checkpoint.pt")["history"]
        if row.judge.get("curve"):
            return {f"{c} at {k + 1}": Samples((h[c],)) for c in (SENTENCE, HELD_OUT) for k, h in enumerate(history)}
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
