"""Tables of VLN as data, and VLN as a learner of the engine."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from agents.common.session import Note
from agents.common.settings import EvaluationSettings
from agents.studies.engine import Measured, StudyRow, StudyTable
from agents.studies.episodes import JUDGES, EpisodeStudy
from agents.vision.lessons import Lessons
from agents.vision.run import encoder_of
from agents.vln.agent import VlnAgent, load_agent
from agents.vln.config import FollowerSettings, SpeakerSettings
from agents.vln.run import train_follower
from agents.vln.speaker import load_speaker, reranked, speaker_identity, train_speaker
from agents.vln.unheard import unheard
from embodied.datasets.store import Dataset, SplitData, dataset_of
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.evaluation.evaluate import spread
from embodied.interface import Agent
from embodied.records import save_lines

SPLITS = ("test_seen", "test_unseen")
COLUMNS = ("success", "spl", "nDTW", "SDTW", "navigation error")
LEARNED, RERANKED = "learned", "reranked"
CANDIDATES = 10
"""K of Eq 2.19."""


def _row(label: str, played: str = LEARNED, **train: Any) -> StudyRow:
    return StudyRow(label, train, {"played": played})


def _without(name: str) -> StudyRow:
    return StudyRow(name, None, {"played": name})


FOLLOWER, BLIND = _row("DAgger"), _row("DAgger, blind", blind=True)
CHOSEN, SPOKEN = _row("DAgger, reranked", RERANKED), _row("DAgger, back-translation", spoken_share=0.5)
READER = _row("pre-trained word vectors", word_vectors="minilm")
UNHEARD_BY_FOLLOWER, UNHEARD_BY_READER = (
    dataclasses.replace(row, label=f"{row.label}, unheard words", judge={**row.judge, "unheard": True})
    for row in (FOLLOWER, READER)
)
TABLES: Mapping[str, StudyTable] = {
    "followers": StudyTable(
        "Followers of route instructions",
        (
            FOLLOWER,
            _row("student forcing", forcing="student"),
            _row("teacher forcing", forcing="teacher"),
            BLIND,
            _row("DAgger, no instruction", wordless=True),
            _without("random walk"),
            _without("shortest"),
        ),
        COLUMNS,
        SPLITS,
        ((FOLLOWER, BLIND),),
    ),
    "speaker": StudyTable(
        "A speaker that chooses between walks (Eq 2.19) and words further paths",
        (FOLLOWER, CHOSEN, SPOKEN, _row("DAgger, back-translation, reranked", RERANKED, spoken_share=0.5)),
        COLUMNS,
        SPLITS,
        ((CHOSEN, FOLLOWER), (SPOKEN, FOLLOWER)),
    ),
    "words": StudyTable(
        "Instructions in words that were never heard",
        (FOLLOWER, UNHEARD_BY_FOLLOWER, READER, UNHEARD_BY_READER),
        COLUMNS,
        SPLITS[1:],
        ((FOLLOWER, UNHEARD_BY_FOLLOWER), (READER, UNHEARD_BY_READER), (UNHEARD_BY_READER, UNHEARD_BY_FOLLOWER)),
    ),
}


@dataclass(frozen=True, kw_only=True)
class VlnStudy(EpisodeStudy):
    """Followers and the speaker."""

    encoder: Path
    network: str | None = None
    """Torchvision network of `encoder`, or 'random'; None for one of our own encoders."""
    config: FollowerSettings
    """Where the rows start from."""
    speaker: SpeakerSettings
    evaluation: EvaluationSettings
    others: int = 1
    """Training seeds of every row but the first."""
    picture_kind: str | None = None
    """Of the pictures that features come from."""

    name = "vln"
    makers = ("agents.vln.run",)
    judges = (*JUDGES, "agents.vln.speaker")

    def tables(self) -> Mapping[str, StudyTable]:
        other = self.lessons().data.ood
        return {name: dataclasses.replace(t, splits=(*t.splits, *other)) for name, t in TABLES.items()}

    def seeds(self, row: StudyRow) -> Sequence[int]:
        return self.repeats if row.train == {} else self.repeats[: 1 if row.train is None else self.others]

    def settings(self, train: Mapping[str, Any], seed: int) -> FollowerSettings:
        return dataclasses.replace(self.config, seed=seed, **train)

    def depends(self, train: Mapping[str, Any]) -> Mapping[str, object]:
        spoken = train.get("spoken_share", self.config.spoken_share)
        return self.lessons().identity() | ({"speaker": self._speaker()} if spoken else {})

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """The speaker, if a row wants it."""
        if any((r.train or {}).get("spoken_share") or r.judge["played"] == RERANKED for r in rows):
            train_speaker(self.lessons(), self.speaker, folder / "speaker", note=lambda line: note(f"speaker: {line}"))

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        speaker = _file(folder) if train.get("spoken_share") else None
        config = self.settings(train, seed)
        train_follower(self.lessons(), config, self.evaluation, home, speaker=speaker, note=note)
        return home / "best.safetensors"

    def where(self, agent: VlnAgent | None, judge: Mapping[str, Any], split: str) -> SplitData:
        whole = super().where(agent, judge, split)
        if not judge.get("unheard"):
            return whole
        assert agent is not None, "rows with unheard words learn"
        return dataclasses.replace(whole, tasks=[unheard(t, agent.about.words) for t in whole.tasks])

    def load(self, weights: Path) -> VlnAgent:
        return load_agent(weights)

    def policies(self, agent: VlnAgent | None, judge: Mapping[str, Any], split: str) -> Agent:
        if agent is None:
            return agent_without_learning("vln", judge["played"])
        return agent.policy(self.lessons().split(split).bank)

    @torch.inference_mode()
    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Measured:
        if weights is None or row.judge["played"] != RERANKED:
            return super().judge(weights, row, split, seed, folder, keep)
        lessons, speaker, agent = self.lessons(), load_speaker(_file(folder)), load_agent(weights)
        whole, bank = lessons.data.split(split), lessons.split(split).bank
        tasks, found = spread(whole.tasks, self.tasks), []
        for k in self.judging:
            episodes = reranked(whole, tasks, agent, speaker, bank, candidates=CANDIDATES, seed=k)
            save_lines(keep.with_name(f"{keep.name}_{k}.jsonl"), episodes)
            found += episodes
        return self.count(found, whole, row.judge)

    def judged_in(self, judge: Mapping[str, Any]) -> Dataset:
        return self.lessons().data

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        about = {**super().judged(row, split), "pictures": self.lessons().pictures(split)}
        return about | ({"speaker": self._speaker()} if row.judge["played"] == RERANKED else {})

    def lessons(self) -> Lessons:
        """
        Raises:
          DatasetError: a data set of another kind.
        """
        return Lessons(dataset_of(self.data, "vln"), encoder_of(self.encoder, self.network), self.picture_kind)

    def about(self) -> str:
        c, pictures = self.config, self.lessons().pictures("train")
        return f"{super().about()} Trained {c.iterations} updates of {c.batch} episodes on pictures {pictures}."

    def _speaker(self) -> object:
        return speaker_identity(self.lessons(), self.speaker)


def _file(folder: Path) -> Path:
    return folder / "speaker" / "speaker.safetensors"
