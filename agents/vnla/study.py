"""The table of VNLA's first paper (Nguyen et al. 2019, arXiv 1812.04155) as data, and VNLA as a learner of the engine.

Agents are judged with the program's five seeds, from which budgets are drawn. Other askers play with the learned
asker's networks (docs/sources.md, S160).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.common.session import Note
from embodied.agents.studies.episodes import JUDGES
from embodied.agents.studies.tables import StudyRow, StudyTable
from embodied.agents.vision.sighted_study import TEST_SPLITS, SightedStudy
from embodied.agents.vnla.agent import AT_RANDOM, LEARNED, NEVER, TEACHER, VnlaAgent
from embodied.agents.vnla.config import VnlaSettings
from embodied.agents.vnla.run import train_agent
from embodied.datasets.store import SplitData
from embodied.interface import Agent

EVALUATION_SEEDS = (123, 435, 6757, 867, 983)
"""The program's."""
VNLA_MEASURES = ("success", "room success", "navigation error", "requests")


def _row(label: str, played: str = LEARNED, **train: Any) -> StudyRow:
    return StudyRow(label, train, {"played": played})


def _table(title: str, *rows: StudyRow, compared: Sequence[tuple[StudyRow, StudyRow]] = ()) -> StudyTable:
    return StudyTable(title, rows, VNLA_MEASURES, TEST_SPLITS, tuple(compared))


NONE, RANDOM_ASKER, LEARNED_ASKER = _row("none", NEVER), _row("random", AT_RANDOM), _row("learned")
BLIND_NONE, BLIND_ASKER = _row("none, blind", NEVER, blind=True), _row("learned, blind", blind=True)
LISTENER = StudyRow("scripted listener asking as the teacher", None, {"played": "listener, teacher"})
VNLA_TABLES: Mapping[str, StudyTable] = {
    "askers": _table(
        "Who decides when to ask",
        NONE,
        _row("first", "learned, asks first"),
        RANDOM_ASKER,
        _row("teacher", TEACHER),
        LEARNED_ASKER,
        BLIND_NONE,
        BLIND_ASKER,
        StudyRow("scripted listener asking at random", None, {"played": "listener, random"}),
        LISTENER,
        compared=((LEARNED_ASKER, RANDOM_ASKER), (LEARNED_ASKER, BLIND_ASKER), (LEARNED_ASKER, LISTENER)),
    )
}
"""The paper's Table 2."""


@dataclass(frozen=True, kw_only=True)
class VnlaStudy(SightedStudy):
    """Table 2 of VNLA's first paper."""

    config: VnlaSettings
    eval_seeds: tuple[int, ...] = EVALUATION_SEEDS

    name, agent_kind, all_tables = "vnla", VnlaAgent, VNLA_TABLES
    makers = ("embodied.agents.vnla.run",)
    judges = (*JUDGES, "embodied.agents.vnla.agent")

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        train_agent(self.training_data(), self.settings(train, seed), self.evaluation, home, note=note)
        return home / "best.safetensors"

    def policies(self, agent: VnlaAgent | None, judge: Mapping[str, Any], split: str) -> Agent:
        if agent is None:
            return super().policies(agent, judge, split)
        return agent.player(self.training_data().split(split).bank, judge["played"])

    def where(self, agent: VnlaAgent | None, judge: Mapping[str, Any], split: str) -> SplitData:
        if agent is None:
            return super().where(agent, judge, split)
        return self.judged_in(judge).split(split, rules=agent.rules_of_row(judge["played"]))
