"""Tables 4.7 and 4.8, Figures 4.5 and 4.6 as data; HARI as a learner of the engine."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.common.session import Note
from embodied.agents.common.weights import weights_digest
from embodied.agents.hari.config import ExecutionConfig, IntentionConfig
from embodied.agents.hari.networks import INTENTIONS, HariAgent, load_agent, load_executor
from embodied.agents.hari.rules import GREEDY, RANDOM, policies
from embodied.agents.hari.run import (
    TEST,
    VALIDATION_CONDITIONS,
    intention_of,
    rules_of,
    train_execution,
    train_intention,
    validation_means,
)
from embodied.agents.studies.engine import Measured
from embodied.agents.studies.episodes import JUDGES, EpisodeStudy
from embodied.agents.studies.tables import Figure, StudyRow, StudyTable
from embodied.datasets.store import Dataset, SplitData, dataset_of
from embodied.evaluation.tables import Samples
from embodied.interface import Agent, Episode
from embodied.records import identity_of, key_of

ACTIONS = ("CUR", "GOAL", "SUB", "DO")
SUB_RULE = "SUB whenever possible"
RULE_ROWS = ("no assistance", "dense goal", "dense state", "dense goal and state", SUB_RULE, RANDOM)
TIMES = "times"
"""In a row: whether intentions are counted by time."""


def _learned(label: str, played: str = "learned", **train: Any) -> StudyRow:
    return StudyRow(label, train, {"played": played})


HARI_TABLES: Mapping[str, StudyTable] = {
    "4.7": StudyTable(
        "Asking by learning and by rules",
        (
            *(_learned(rule, rule) for rule in RULE_ROWS),
            _learned("learned"),
            _learned(GREEDY, GREEDY),
            _learned("uncooperative", cooperative=False),
            _learned("skyline", perfect=True),
        ),
        ("success",),
        TEST,
        (
            *((_learned("learned"), _learned(rule, rule)) for rule in (RANDOM, SUB_RULE)),
            (_learned(GREEDY, GREEDY), _learned(SUB_RULE, SUB_RULE)),
            (_learned("learned"), _learned("uncooperative", cooperative=False)),
        ),
        pooled=ACTIONS,
    ),
    "4.8": StudyTable(
        "Goals on the stack",
        tuple(_learned(f"stack {n}", stack=n) for n in (1, 2, 3)),
        ("success",),
        VALIDATION_CONDITIONS,
        pooled=ACTIONS,
    ),
    "figure 4.5": StudyTable("Requests by condition", (_learned("learned"),), ACTIONS[:3], VALIDATION_CONDITIONS),
    "figure 4.5b": StudyTable(
        "Intentions by time step",
        (StudyRow("learned", {}, {"played": "learned", TIMES: True}),),
        splits=("val_unseen_env",),
        figure=Figure(tuple(f"{name}_at" for name in INTENTIONS), "time step", "share of running episodes", share=True),
    ),
    "figure 4.6": StudyTable(
        "What costs change",
        tuple(
            StudyRow(f"cost {c:g}, H {h}", {"cost": c, "horizon": h}, {"played": "learned"}, None, c, f"H = {h}")
            for h in (10, 20, 30)
            for c in (0.01, 0.05, 0.1, 0.2, 0.5)
        ),
        ("success", *ACTIONS),
        VALIDATION_CONDITIONS,
        figure=Figure(("success",), "cost of an action", "success (%)", log=True),
    ),
}


@dataclass(frozen=True, kw_only=True)
class HariStudy(EpisodeStudy):
    """Tables 4.7 and 4.8, Figures 4.5 and 4.6."""

    execution: ExecutionConfig
    config: IntentionConfig
    """The policy that all rows begin with."""
    executor: Path | None = None
    """A trained execution policy; None trains one in the study's folder."""
    eval_data: Path | None = None
    """Another data set to judge in: in its unseen houses, and in all its splits if `data` has the same houses and tasks
    to learn from; None: in `data`."""

    name = "hari"
    makers = ("embodied.agents.hari.run",)
    judges = (*JUDGES, "embodied.agents.hari.rules", "embodied.agents.hari.run")

    def tables(self) -> Mapping[str, StudyTable]:
        """The splits out of distribution come beside those of the tests; elsewhere, houses may all be unknown."""
        known = self.judged_in({}).lessons == dataset_of(self.data, "hari").lessons
        ood, tables = self.judged_in({}).ood, {}
        for name, table in HARI_TABLES.items():
            splits = [s for s in table.splits if known or s.endswith("_env")]
            splits += ood if table.splits == TEST else ()
            tables[name] = dataclasses.replace(table, splits=tuple(splits))
        return tables

    def settings(self, train: Mapping[str, Any], seed: int) -> IntentionConfig:
        return dataclasses.replace(self.config, seed=seed, **train)

    def trained(self, train: Mapping[str, Any], seed: int, folder: Path) -> Mapping[str, Any]:
        walking = self._walking(folder)
        begin = weights_digest(walking) if walking.exists() else None
        data = dataset_of(self.data, "hari").digest
        return identity_of(*self.makers, settings=self.settings(train, seed), data=data, begin=begin)

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Train the execution policy that intention policies use."""
        if self.executor is None:
            train_execution(dataset_of(self.data, "hari"), self.execution, self._walking(folder).parent, note=note)

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        executor = load_executor(self._walking(folder))
        train_intention(dataset_of(self.data, "hari"), executor, self.settings(train, seed), home, note=note)
        return home / "best.safetensors"

    def load(self, weights: Path) -> HariAgent:
        return load_agent(weights)

    def policies(self, agent: HariAgent, judge: Mapping[str, Any], split: str) -> Agent:
        played, data = judge["played"], dataset_of(self.data, "hari")
        none = dict.fromkeys(INTENTIONS, 0.0)
        means = validation_means(data, agent, seed=self.eval_seeds[0]) if played == RANDOM else none
        return policies(agent, means)[played]

    def where(self, agent: HariAgent, judge: Mapping[str, Any], split: str) -> SplitData:
        return self.judged_in(judge).split(split, rules=rules_of(agent.config))

    def judged_in(self, judge: Mapping[str, Any]) -> Dataset:
        return dataset_of(self.eval_data or self.data, "hari")

    def about(self) -> str:
        other = self.judged_in({}).digest[:16]
        return super().about() + (f" Judged in the data set {other}." if self.eval_data else "")

    def count(self, episodes: Sequence[Episode], split: SplitData, judge: Mapping[str, Any]) -> Measured:
        if judge.get(TIMES):
            return intentions_by_time(episodes, self.config.horizon)
        return super().count(episodes, split, judge)

    def _walking(self, folder: Path) -> Path:
        """The execution policy that intention policies use."""
        if self.executor is not None:
            return self.executor
        identity = identity_of(settings=self.execution, data=dataset_of(self.data, "hari").digest)
        return folder / f"execution_{key_of(identity)}" / "best.safetensors"


def intentions_by_time(episodes: Sequence[Episode], horizon: int) -> dict[str, Samples]:
    """'cur at 3': the share of the episodes that run at time step 3 that choose CUR; of each intention and step."""
    totals: dict[str, tuple[list[float], list[float]]] = {}
    for episode in episodes:
        chosen = [intention_of(s.action) for s in episode.steps[:horizon]]
        for t in range(horizon):
            for name in INTENTIONS:
                some, all_ = totals.setdefault(f"{name} at {t + 1}", ([], []))
                some.append(float(t < len(chosen) and chosen[t] == name))
                all_.append(float(t < len(chosen)))
    houses = tuple(e.task.world for e in episodes)
    return {name: Samples(tuple(some), houses, tuple(all_)) for name, (some, all_) in totals.items()}
