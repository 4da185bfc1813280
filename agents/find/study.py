"""Finding things with and without sight, as a learner of embodied.agents.studies.engine."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.common.session import Note
from embodied.agents.find.config import FinderConfig
from embodied.agents.find.run import Finder, tasks_in, train_finder
from embodied.agents.studies.episodes import JUDGES
from embodied.agents.studies.tables import StudyRow, StudyTable
from embodied.agents.vision.encoder import load_encoder
from embodied.agents.vision.sighted_study import SightedStudy
from embodied.agents.vision.training_data import TrainingData
from embodied.datasets.store import Dataset, SplitData
from embodied.kinds.shipped.find import FIND
from embodied.kinds.task_kind import EnvInputs

SEEING, MAP, BLIND_FINDER = (
    StudyRow("Seeing"),
    StudyRow("Blind, map sees", {"sees": "map"}),
    StudyRow("Blind", {"sees": "nothing"}),
)
EXPLORER = StudyRow("Frontier and detector", {"agent": "detector"})
FIND_TABLES: Mapping[str, StudyTable] = {
    "find": StudyTable(
        "Finding things without help",
        (
            SEEING,
            MAP,
            BLIND_FINDER,
            EXPLORER,
            *(StudyRow(w.capitalize(), None, {"played": w}) for w in ("random walk", "forward 10")),
        ),
        ("success", "spl", "oracle success", "navigation error", "steps"),
        ("test_unseen",),
        ((SEEING, BLIND_FINDER), (SEEING, MAP), (SEEING, EXPLORER)),
    )
}


@dataclass(frozen=True, kw_only=True)
class FindStudy(SightedStudy):
    """Success of agents that find things in unseen houses."""

    config: FinderConfig
    house_tasks: int = 50
    """Tasks of each house that agents are judged on."""

    name, agent_kind = "find", Finder
    makers = ("embodied.agents.find.run",)
    judges = (*JUDGES, "embodied.agents.find.run")

    def tables(self) -> Mapping[str, StudyTable]:
        return FIND_TABLES

    def seeds(self, row: StudyRow) -> Sequence[int]:
        """Who is only compared with learns once."""
        return self.repeats if dataclasses.replace(row, minus=None) in (SEEING, BLIND_FINDER) else self.repeats[:1]

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        train_finder(self.training_data(), self.settings(train, seed), home, self.cache, note=note)
        return home / "best.safetensors"

    def where(self, agent: Any, judge: Mapping[str, Any], split: str) -> SplitData:
        places = self.judged_in(judge).places(split)
        return SplitData(split, places, tuple(tasks_in(places, self.house_tasks)), FIND.environments(EnvInputs(places)))

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {**super().judged(row, split), "house tasks": self.house_tasks}

    def training_data(self) -> TrainingData:
        """Of any kind: its houses are all that counts."""
        return TrainingData(Dataset(self.data), load_encoder(self.encoder), self.pictures, cache=self.cache)

    def about(self) -> str:
        return f"{super().about()} {self.house_tasks} tasks of each house; hidden size {self.config.hidden_size}."
