"""The tables of VNLA's first paper (Nguyen et al. 2019, arXiv 1812.04155) as data, and VNLA as a learner of the engine.

Agents are judged with the program's five seeds, from which budgets are drawn. Who asks as its teacher does is the
learned asker's agent: they are trained alike (docs/sources.md, S160).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents.common.session import Note
from agents.common.settings import EvaluationSettings
from agents.studies.engine import StudyRow, StudyTable
from agents.studies.episodes import JUDGES, EpisodeStudy
from agents.vision.lessons import Lessons
from agents.vision.run import encoder_of
from agents.vnla.agent import VnlaAgent, load_agent
from agents.vnla.config import VnlaSettings
from agents.vnla.judging import DIRECT, LEARNED, TEACHER, player, rules_of_row
from agents.vnla.run import train_agent
from embodied.datasets.store import Dataset, SplitData, dataset_of
from embodied.interface import Agent

EVALUATION_SEEDS = (123, 435, 6757, 867, 983)
"""The program's."""
SPLITS = ("test_seen", "test_unseen")
COLUMNS = ("success", "room success", "navigation error", "requests")
ROOMS = "rooms"
"""In a row: whether the requests name rooms that it learns from (train) or is judged by (judge)."""


def _row(label: str, played: str = LEARNED, rooms: bool = True, **train: Any) -> StudyRow:
    return StudyRow(label, train, {"played": played, ROOMS: rooms})


def _table(title: str, *rows: StudyRow) -> StudyTable:
    return StudyTable(title, rows, COLUMNS, SPLITS)


PROGRAM, ALGORITHM_6 = _row("program's rules, learned"), _row("Algorithm 6, learned", rules="algorithm-6")
TABLES: Mapping[str, StudyTable] = {
    "askers": _table(
        "Who decides when to ask",
        _row("none", asker="none"),
        _row("first", asker="first"),
        _row("random", asker="random"),
        _row("teacher", TEACHER),
        _row("learned"),
    ),
    "interventions": _table(
        "Direct and indirect intervention",
        _row("direct, not in words", rules="direct-mute"),
        _row("direct, in words", DIRECT),
        _row("indirect"),
    ),
    "rooms": StudyTable(
        "Requests that name no room",
        (
            StudyRow(
                "random, trained without rooms", {"asker": "random", ROOMS: False}, {"played": LEARNED, ROOMS: False}
            ),
            StudyRow("learned, trained without rooms", {ROOMS: False}, {"played": LEARNED, ROOMS: False}),
            StudyRow("learned, trained with rooms", {}, {"played": LEARNED, ROOMS: False}),
        ),
        COLUMNS,
        SPLITS,
    ),
    "algorithm-6": StudyTable(
        "Algorithm 6 as printed beside the program's rules of play (docs/sources.md, S43)",
        (
            _row("program's rules, asks at random", asker="random"),
            PROGRAM,
            _row("Algorithm 6, asks at random", asker="random", rules="algorithm-6"),
            ALGORITHM_6,
        ),
        (*COLUMNS, "steps"),
        SPLITS,
        ((ALGORITHM_6, PROGRAM),),
    ),
    "rules": _table(
        "Rules of the asking teacher",
        _row("a and e", ask_rules="a and e"),
        _row("b to d", ask_rules="b to d"),
        _row("all"),
    ),
}
"""The paper's Tables 2, 3, 4 and 7, and the dissertation's own algorithm, which nobody has printed results of."""


@dataclass(frozen=True, kw_only=True)
class VnlaStudy(EpisodeStudy):
    """Tables 2, 3, 4 and 7 of VNLA's first paper."""

    encoder: Path
    network: str | None = None
    """Torchvision network of `encoder`, or 'random'; None for one of our own encoders."""
    config: VnlaSettings
    """Where the rows start from."""
    evaluation: EvaluationSettings
    without_rooms: Path | None = None
    """A data set whose requests name no room, for the table 'rooms'."""
    others: int = 3
    """Agents of every row but that of the learned asker."""
    picture_kind: str | None = None
    """Of the pictures that features come from."""
    judging: tuple[int, ...] = EVALUATION_SEEDS

    name = "vnla"
    makers = ("agents.vnla.run",)
    judges = (*JUDGES, "agents.vnla.judging")

    def tables(self) -> Mapping[str, StudyTable]:
        """The splits out of distribution that there are come beside the others."""
        splits = (*SPLITS, *dataset_of(self.data, "vnla").ood)
        return {name: dataclasses.replace(table, splits=splits) for name, table in TABLES.items()}

    def seeds(self, row: StudyRow) -> Sequence[int]:
        return self.repeats if not row.train else self.repeats[: self.others]

    def settings(self, train: Mapping[str, Any], seed: int) -> VnlaSettings:
        return dataclasses.replace(self.config, seed=seed, **{k: v for k, v in train.items() if k != ROOMS})

    def depends(self, train: Mapping[str, Any]) -> Mapping[str, object]:
        lessons = self.lessons(train.get(ROOMS, True))
        return {"data": lessons.data.digest, "encoder": lessons.encoder.digest, "pictures": lessons.pictures("train")}

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Data sets that are missing are told before anything is trained."""
        for row in rows:
            for rooms in ((row.train or {}).get(ROOMS, True), row.judge[ROOMS]):
                self.lessons(rooms)

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        train_agent(self.lessons(train.get(ROOMS, True)), self.settings(train, seed), self.evaluation, home, note=note)
        return home / "best.safetensors"

    def load(self, weights: Path) -> VnlaAgent:
        return dataclasses.replace(load_agent(weights), evaluation=self.evaluation)

    def policies(self, agent: VnlaAgent, judge: Mapping[str, Any], split: str) -> Agent:
        return player(agent, self.lessons(judge[ROOMS]).split(split).bank, judge["played"])

    def judged_in(self, judge: Mapping[str, Any]) -> Dataset:
        return self.lessons(judge[ROOMS]).data

    def where(self, agent: VnlaAgent, judge: Mapping[str, Any], split: str) -> SplitData:
        return self.judged_in(judge).split(split, vnla=rules_of_row(agent, judge["played"]))

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        pictures = self.lessons(row.judge[ROOMS]).pictures(split)
        return {**super().judged(row, split), "evaluation": self.evaluation, "pictures": pictures}

    def lessons(self, rooms: bool) -> Lessons:
        """What agents of one of the two kinds of requests learn from.

        Raises:
          ValueError: requests without rooms are wanted and there are none, or the data set names (no) rooms.
        """
        folder = self.data if rooms else self.without_rooms
        if folder is None:
            raise ValueError(
                "the table 'rooms' needs requests that name no room: `embodied dataset vnla --no-rooms --out DIR2`, "
                "features for it, and --without-rooms DIR2"
            )
        data = dataset_of(folder, "vnla")
        if data.config.rooms != rooms:
            raise ValueError(
                f"the requests of {folder} {'name no' if rooms else 'name'} rooms; name the other data set"
            )
        return Lessons(data, encoder_of(self.encoder, self.network), self.picture_kind)

    def about(self) -> str:
        c, pictures = self.config, self.lessons(True).pictures("train")
        return f"{super().about()} Trained {c.iterations} updates of {c.batch} episodes on pictures {pictures}."
