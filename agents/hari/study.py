"""Tables 4.7 and 4.8, Figures 4.5 and 4.6, and what seeing is worth, as data; HARI as a learner of the engine."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agents.common.session import Note
from agents.common.weights import weights_digest
from agents.hari.agent import Executor, HariAgent, load_agent, load_executor
from agents.hari.config import ExecutionConfig, IntentionConfig
from agents.hari.judging import RANDOM, TEST, policies, validation_means
from agents.hari.networks import INTENTIONS
from agents.hari.rules import RULES, RuleAgent
from agents.hari.run import CONDITIONS, hari_data, rules_of, train_execution, train_intention, with_eyes
from agents.studies.engine import Figure, Measured, StudyRow, StudyTable
from agents.studies.episodes import JUDGES, EpisodeStudy
from embodied.datasets.store import SplitData
from embodied.evaluation.tables import Samples
from embodied.identity import identity_of, key_of
from embodied.interface import Agent, Ask, Episode, Move, Sight

VALIDATION = tuple(f"val_{c}" for c in CONDITIONS)
ACTIONS = ("CUR", "GOAL", "SUB", "DO")
SUB_RULE = "SUB whenever possible"
RULE_ROWS = ("no assistance", "dense goal", "dense state", "dense goal and state", SUB_RULE, RANDOM)
EXECUTION, TIMES = "execution", "times"
"""In a row: what an execution policy alone is trained to know its place by; whether intentions are counted by time."""


def _learned(label: str, played: str = "learned", **train: Any) -> StudyRow:
    return StudyRow(label, train, {"played": played})


def _moves() -> tuple[StudyRow, ...]:
    """What drawing DO's moves instead of taking the likeliest is worth; not in the dissertation."""
    shown = ("no assistance", "dense goal and state", RANDOM, "learned")
    ways: tuple[tuple[str, dict[str, Any]], ...] = (("likeliest moves", {}), ("moves drawn", {"move_temperature": 0.5}))
    return tuple(_learned(f"{played}, {how}", played, **train) for played in shown for how, train in ways)


def _sight(label: str, sees: str, states: str, rule: str = "no assistance", covered: bool = False) -> StudyRow:
    """An execution policy alone: what it learned to know its place by, what it is told unasked, and what it asks."""
    return StudyRow(label, {EXECUTION: sees}, {"played": rule, "states": states, "covered": covered})


def _costs() -> tuple[StudyRow, ...]:
    pairs = [(c, h) for h in (10, 20, 30) for c in (0.01, 0.05, 0.1, 0.2, 0.5)]
    return tuple(
        StudyRow(f"cost {c:g}, H {h}", {"cost": c, "horizon": h}, {"played": "learned"}, None, c, f"H = {h}")
        for c, h in pairs
    )


TABLES: Mapping[str, StudyTable] = {
    "4.7": StudyTable(
        "Asking by learning and by rules",
        (
            *(_learned(rule, rule) for rule in RULE_ROWS),
            _learned("learned"),
            _learned("uncooperative", cooperative=False),
            _learned("skyline", perfect=True),
        ),
        ("success",),
        TEST,
        tuple((_learned("learned"), _learned(rule, rule)) for rule in (RANDOM, SUB_RULE)),
        pooled=ACTIONS,
    ),
    "4.8": StudyTable(
        "Goals on the stack",
        (_learned("stack 1", stack=1), _learned("stack 2"), _learned("stack 3", stack=3)),
        ("success",),
        VALIDATION,
        pooled=ACTIONS,
    ),
    "moves": StudyTable(
        "Moves, likeliest or drawn (no counterpart in the dissertation)", _moves(), ("success",), TEST, pooled=ACTIONS
    ),
    "sight": StudyTable(
        "What seeing is worth (no counterpart in the dissertation)",
        (
            _sight("no assistance, d^s of nothing", "words", "none"),
            _sight("no assistance, d^s of sparse words", "words", "sparse"),
            _sight("no assistance, sight", "features", "none"),
            _sight("no assistance, sight covered", "features", "none", covered=True),
            _sight("no assistance, sight and sparse words", "features", "sparse"),
            _sight("dense goal, d^s of sparse words", "words", "sparse", "dense goal"),
            _sight("dense goal, sight", "features", "none", "dense goal"),
            _sight("dense goal and state", "words", "sparse", "dense goal and state"),
            _sight("dense goal and state, sight beside them", "features", "none", "dense goal and state"),
        ),
        ("success",),
        TEST,
        pooled=("DO",),
    ),
    "figure 4.5": StudyTable("Requests by condition", (_learned("learned"),), ACTIONS[:3], VALIDATION),
    "figure 4.5b": StudyTable(
        "Intentions by time step",
        (StudyRow("learned", {}, {"played": "learned", TIMES: True}),),
        splits=("val_unseen_env",),
        figure=Figure(tuple(f"{name}_at" for name in INTENTIONS), "time step", "share of running episodes"),
    ),
    "figure 4.6": StudyTable(
        "What costs change",
        _costs(),
        ("success", *ACTIONS),
        VALIDATION,
        figure=Figure(("success",), "cost of an action", "success (%)", log=True),
    ),
}


class Covered:
    """Eyes that are shut: a FeatureSource of zeros, the mean of whitened features."""

    def __init__(self, size: int) -> None:
        self.size = size

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32."""
        return np.zeros((36, self.size), dtype=np.float32)


@dataclass(frozen=True, kw_only=True)
class HariStudy(EpisodeStudy):
    """Tables 4.7 and 4.8, Figures 4.5 and 4.6."""

    execution: ExecutionConfig
    intention: IntentionConfig
    """Where the rows start from."""
    executor: Path | None = None
    """A trained execution policy that stands for all of its kind; None trains one in the study's folder."""
    encoder: str = ""
    """Digest of the encoder whose features a policy sees."""
    picture_kind: str | None = None
    """Of the pictures that they come from, as in agents.vision.drawn.pictures_of."""

    name = "hari"
    makers = ("agents.hari.run",)
    judges = (*JUDGES, "agents.hari.judging")

    def tables(self) -> Mapping[str, StudyTable]:
        """The splits out of distribution that there are come beside those of the tests."""
        ood = hari_data(self.data).ood
        extended = lambda t: dataclasses.replace(t, splits=(*t.splits, *ood)) if t.splits == TEST else t
        return {name: extended(table) for name, table in TABLES.items()}

    def settings(self, train: Mapping[str, Any], seed: int) -> ExecutionConfig | IntentionConfig:
        if EXECUTION in train:
            return dataclasses.replace(self.execution, seed=seed, sees=train[EXECUTION])
        return dataclasses.replace(self.intention, seed=seed, **train)

    def trained(self, train: Mapping[str, Any], seed: int, folder: Path) -> Mapping[str, Any]:
        data = hari_data(self.data).digest
        more: dict[str, object] = (
            {"sight": [self.encoder, self.picture_kind]} if train.get(EXECUTION) == "features" else {}
        )
        if EXECUTION not in train or self._given(train):
            walking = self._walking(folder)
            more["begin"] = weights_digest(walking) if walking.exists() else None
        return identity_of(*self.makers, settings=self.settings(train, seed), data=data, **more)

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Train the execution policy that intention policies use."""
        if self.executor is None and any(EXECUTION not in (r.train or {}) for r in rows):
            train_execution(hari_data(self.data), self.execution, self._walking(folder).parent, note=note)

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        data, config = hari_data(self.data), self.settings(train, seed)
        if isinstance(config, IntentionConfig):
            train_intention(data, self._eyes(load_executor(self._walking(folder))), config, home, note=note)
        elif self.executor is not None and self._given(train):
            return self.executor
        else:
            train_execution(data, config, home, encoder=self.encoder, picture_kind=self.picture_kind, note=note)
        return home / "best.safetensors"

    def load(self, weights: Path) -> Executor | HariAgent:
        executor = self._eyes(load_executor(weights))
        try:
            return dataclasses.replace(load_agent(weights), executor=executor)
        except ValueError:  # an execution policy alone
            return executor

    def policies(self, agent: Executor | HariAgent, judge: Mapping[str, Any], split: str) -> Agent:
        if isinstance(agent, HariAgent):
            means = validation_means(
                hari_data(self.data), agent, seed=self.judging[0], tasks=agent.config.validation_tasks
            ) if judge["played"] == RANDOM else {"cur": 0.0, "goal": 0.0, "sub": 0.0, "do": 0.0}  # fmt: skip
            return policies(agent, means)[judge["played"]]
        if judge["covered"] and agent.seeing:
            agent = dataclasses.replace(agent, eyes=Covered(agent.seeing.size))
        return RuleAgent(agent, RULES[judge["played"]])

    def where(self, agent: Executor | HariAgent, judge: Mapping[str, Any], split: str) -> SplitData:
        config = (
            agent.config
            if isinstance(agent, HariAgent)
            else dataclasses.replace(self.intention, states=judge["states"])
        )
        return hari_data(self.data).split(split, hari=rules_of(config))

    def count(self, episodes: Sequence[Episode], split: SplitData, judge: Mapping[str, Any]) -> Measured:
        if judge.get(TIMES):
            return intentions_by_time(episodes, self.intention.horizon)
        return super().count(episodes, split, judge)

    def _given(self, train: Mapping[str, Any]) -> bool:
        """Whether the study was given the execution policy of a row."""
        return self.executor is not None and load_executor(self.executor).config.sees == train.get(EXECUTION)

    def _walking(self, folder: Path) -> Path:
        """The execution policy that intention policies use."""
        if self.executor is not None:
            return self.executor
        mine = identity_of(settings=self.execution, data=hari_data(self.data).digest)
        return folder / f"execution_{key_of(mine)}" / "best.safetensors"

    def _eyes(self, executor: Executor) -> Executor:
        return with_eyes(executor, hari_data(self.data), self.picture_kind)


def intentions_by_time(episodes: Sequence[Episode], horizon: int) -> dict[str, Samples]:
    """'cur at 3': the share of the episodes that run at time step 3 that choose CUR; of each intention and step."""
    found: dict[str, tuple[list[float], list[float]]] = {}
    for episode in episodes:
        chosen = [
            s.action.intention.value if isinstance(s.action, Ask) else "do" if isinstance(s.action, Move) else "done"
            for s in episode.steps[:horizon]
        ]
        for t in range(horizon):
            for name in INTENTIONS:
                some, all_ = found.setdefault(f"{name} at {t + 1}", ([], []))
                some.append(float(t < len(chosen) and chosen[t] == name))
                all_.append(float(t < len(chosen)))
    houses = tuple(e.task.world for e in episodes)
    return {name: Samples(tuple(some), houses, tuple(all_)) for name, (some, all_) in found.items()}
