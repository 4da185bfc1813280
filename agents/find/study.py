"""Finding things with and without sight, as a learner of agents.studies.engine."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents.common.session import Note
from agents.find.config import FinderConfig
from agents.find.run import Finder, finder_identity, load_finder, tasks_in, train_finder
from agents.studies.engine import StudyRow, StudyTable
from agents.studies.episodes import JUDGES, EpisodeStudy
from agents.vision.encoder import load_encoder
from agents.vision.lessons import Lessons
from embodied.datasets.store import SplitData
from embodied.envs.make import environment_maker
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.identity import Identity
from embodied.interface import Agent

SEEING, MAP, BLIND = (
    StudyRow("Seeing"),
    StudyRow("Blind, map sees", {"sees": "map"}),
    StudyRow("Blind", {"sees": "nothing"}),
)
EXPLORER = StudyRow("Frontier and detector", {"agent": "detector"})
TABLES: Mapping[str, StudyTable] = {
    "find": StudyTable(
        "Finding things without help",
        (
            SEEING,
            MAP,
            BLIND,
            EXPLORER,
            *(StudyRow(w.capitalize(), None, {"played": w}) for w in ("random walk", "forward 10")),
        ),
        ("success", "spl", "oracle success", "navigation error", "steps"),
        ("test_unseen",),
        ((SEEING, BLIND), (SEEING, MAP), (SEEING, EXPLORER)),
    )
}


@dataclass(frozen=True, kw_only=True)
class FindStudy(EpisodeStudy):
    """Success of agents that find things in unseen houses."""

    encoder: Path
    config: FinderConfig
    cache: Path
    judged_tasks: int = 50
    """Tasks of each house that agents are judged on."""
    picture_kind: str | None = None

    name = "find"
    makers = ("agents.find.run",)
    judges = (*JUDGES, "agents.find.run")

    def tables(self) -> Mapping[str, StudyTable]:
        return TABLES

    def seeds(self, row: StudyRow) -> Sequence[int]:
        """Who is only compared with learns once."""
        return self.repeats if dataclasses.replace(row, minus=None) in (SEEING, BLIND) else self.repeats[:1]

    def settings(self, train: Mapping[str, Any], seed: int) -> FinderConfig:
        return dataclasses.replace(self.config, seed=seed, **train)

    def trained(self, train: Mapping[str, Any], seed: int, folder: Path) -> Identity:
        return finder_identity(self.lessons(), self.settings(train, seed))

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        train_finder(self.lessons(), self.settings(train, seed), home, self.cache, note=note)
        return home / "best.safetensors"

    def load(self, weights: Path) -> Finder:
        return load_finder(weights)

    def policies(self, agent: Finder | None, judge: Mapping[str, Any], split: str) -> Agent:
        if agent is None:
            return agent_without_learning("find", judge["played"])
        return agent.policy(self.lessons().split(split, limit=1).bank)

    def where(self, agent: Any, judge: Mapping[str, Any], split: str) -> SplitData:
        places = self.judged_in(judge).places(split)
        return SplitData(split, places, tuple(tasks_in(places, self.judged_tasks)), environment_maker("find", places))

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {**super().judged(row, split), "house tasks": self.judged_tasks, "pictures": self.picture_kind}

    def lessons(self) -> Lessons:
        return Lessons(self.judged_in({}), load_encoder(self.encoder), self.picture_kind)

    def about(self) -> str:
        c = self.config
        return (
            f"{super().about()} {self.judged_tasks} tasks of each house. Trained {c.iterations} updates of {c.batch} "
            f"episodes on pictures {self.lessons().pictures('train')}, hidden size {c.hidden_size}."
        )
