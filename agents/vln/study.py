"""Tables of VLN as data, and VLN as a learner of the engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.common.session import Note
from embodied.agents.studies.episodes import JUDGES
from embodied.agents.studies.tables import StudyRow, StudyTable
from embodied.agents.vision.sighted_study import TEST_SPLITS, SightedStudy
from embodied.agents.vln.config import MEASURES, FollowerSettings
from embodied.agents.vln.policy import VlnAgent
from embodied.agents.vln.run import train_follower


def _row(label: str, **train: Any) -> StudyRow:
    return StudyRow(label, train, {"played": "learned"})


FOLLOWER, BLIND_FOLLOWER = _row("DAgger"), _row("DAgger, blind", blind=True)
VLN_TABLES: Mapping[str, StudyTable] = {
    "followers": StudyTable(
        "Followers of route instructions",
        (
            FOLLOWER,
            _row("student forcing", forcing="student"),
            _row("teacher forcing", forcing="teacher"),
            BLIND_FOLLOWER,
            _row("DAgger, no instruction", wordless=True),
            *(StudyRow(name, None, {"played": name}) for name in ("random walk", "shortest")),
        ),
        MEASURES,
        TEST_SPLITS,
        ((FOLLOWER, BLIND_FOLLOWER),),
    )
}


@dataclass(frozen=True, kw_only=True)
class VlnStudy(SightedStudy):
    """Followers."""

    config: FollowerSettings

    name, agent_kind, all_tables = "vln", VlnAgent, VLN_TABLES
    makers = ("embodied.agents.vln.run",)
    judges = (*JUDGES, "embodied.agents.vln.policy")

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        train_follower(self.training_data(), self.settings(train, seed), self.evaluation, home, note=note)
        return home / "best.safetensors"
