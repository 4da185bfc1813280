"""Learned HANNA agents to be judged beside those without learning, and why their episodes fail.

The judging itself is embodied.evaluation.evaluate.evaluate, the same for everybody.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import nn

from agents.common.choosing import choose_at
from agents.hanna.agent import HannaAgent
from agents.hanna.asking import RULES, HannaAskRule, ask_above, ask_every, ask_with
from agents.hanna.config import HannaSizes
from agents.hanna.network import Scores
from agents.hanna.percept import Percept, slot_distribution
from agents.hanna.policy import PerfectInterpretation
from agents.vision.bank import FeatureBank
from embodied.interface import Agent, Ask, Episode, Mode, Place, Stop
from embodied.navigation.graph import nearest
from embodied.teachers.hanna import HannaTeacher, segments

REASONS = ("lost", "uncertain_wrong", "never_asked")


def hanna_policies(agent: HannaAgent, bank: FeatureBank) -> dict[str, Agent]:
    """Variants of a learned agent by the names of Tables 4.3 to 4.5.

    'no ask', 'random ask' and 'ask every 5' put another rule before the same networks; the
    authors train an agent for each rule (`embodied train hanna --ask-rule ...`; docs/sources.md, S39).
    """
    learned = agent.policy(bank)
    return {
        "learned": learned,
        "learned, no ask": dataclasses.replace(learned, ask_rule=RULES["never"][1]),
        "learned, random ask": dataclasses.replace(learned, ask_rule=RULES["random"][1]),
        "learned, ask every 5": dataclasses.replace(learned, ask_rule=RULES["every5"][1]),
        "learned, target image only": dataclasses.replace(learned, read_assistance=False, _encoded={}),
        "learned, perfect interpretation": PerfectInterpretation(learned),
    }


PRICED: Mapping[str, Mapping[str, HannaAskRule]] = {
    "learned": {f"learned, above {x:g}": ask_above(x) for x in (0.9, 0.75, 0.5, 0.35, 0.2, 0.1)},
    "every k steps": {f"learned, every {k}": ask_every(k) for k in (20, 12, 8, 5, 3, 2)},
    "at random": {f"learned, with {p:g}": ask_with(p) for p in (0.03, 0.06, 0.12, 0.2, 0.35, 0.6)},
}
"""Rules of asking put before one pair of networks, from few requests to many, by kind of rule."""


def priced_policies(agent: HannaAgent, bank: FeatureBank) -> dict[str, Agent]:
    """A learned agent that asks by each rule of PRICED."""
    learned = agent.policy(bank)
    rules = {name: rule for kind in PRICED.values() for name, rule in kind.items()}
    return {name: dataclasses.replace(learned, ask_rule=rule) for name, rule in rules.items()}


PLAINER: Mapping[str, Mapping[str, Any]] = {
    "learned, without search": {"search": 0.0},
    "learned, not by image": {"by_image": False},
    "learned, without a trail": {"by_image": False, "again": 1.0},
    "learned, likeliest move": {"choose": choose_at(0.0)},
    "learned, likeliest move, without a trail": {"choose": choose_at(0.0), "by_image": False, "again": 1.0},
}
"""What differs, by name, where an agent is judged more nearly as the text has it, the last wholly so but for when it
asks (docs/sources.md, S36, S161; S162 stays)."""


def plainer_policies(agent: HannaAgent, bank: FeatureBank) -> dict[str, Agent]:
    """A learned agent judged in each way of PLAINER."""
    learned = agent.policy(bank)
    return {name: dataclasses.replace(learned, **changed) for name, changed in PLAINER.items()}


UNWILLING = 20.0
"""Logit by which stopping is less likely than a move where nothing was learned."""


class Uniform(nn.Module):
    """A network that has learned nothing: all moves are equally likely, and it does not stop by itself."""

    def __init__(self, config: HannaSizes) -> None:
        super().__init__()
        self.config = config
        self.nothing = nn.Parameter(torch.zeros(0))

    def start(self, batch: int, length: int) -> tuple[Forgetting, Forgetting]:
        return Forgetting(), Forgetting()

    def forward(self, memory: object, percept: Percept) -> tuple[Scores, object]:
        logits = torch.zeros(percept.action_mask.shape).masked_fill(~percept.action_mask, -torch.inf)
        logits[:, 0] = -UNWILLING
        slots = slot_distribution(logits, percept.action_slots)
        return Scores(logits, slots, torch.zeros(len(logits), 2), None), memory


class Forgetting:
    """The memory of a network that has none."""

    def select(self, rows: torch.Tensor) -> Forgetting:
        return self


def sight_policies(agent: HannaAgent, bank: FeatureBank) -> dict[str, Agent]:
    """What sight is worth, by name: the learned agent without it, and its rules with sight but without learning.

    'blind' sees black with network and matcher alike; 'rules only' draws moves evenly, stops by the picture alone and
    asks every 5 steps, or every 10.
    """
    learned, blind = agent.policy(bank), agent.policy(bank.blind())
    every5 = RULES["every5"][1]
    rules = dataclasses.replace(learned, network=Uniform(learned.network.config), ask_rule=every5)
    return {
        "blind": blind,
        "blind, not by image": dataclasses.replace(blind, by_image=False),
        "blind, ask every 5": dataclasses.replace(blind, ask_rule=every5),
        "rules only": rules,
        "rules only, ask every 10": dataclasses.replace(rules, ask_rule=ask_every(10)),
        "rules only, blind": dataclasses.replace(rules, bank=blind.bank),
    }


@dataclass(frozen=True)
class Failures:
    """How unsuccessful episodes failed, as shares of all episodes."""

    ran_out: float
    """The horizon cut them short."""
    stopped_elsewhere: float
    """They stopped in the main task away from every goal."""
    passed_goal: float
    """They were at a goal at some time and did not stop there (part of the two above)."""
    never_asked: float
    """They never asked (part of the first two)."""
    departed_wrong: float
    """Share of sub-tasks left more than 2 m from their target."""


def failures(episodes: Sequence[Episode], worlds: Mapping[str, Place]) -> Failures:
    """Why episodes failed."""
    out = {"limit": 0, "stop": 0, "passed": 0, "silent": 0}
    left, wrong = 0, 0
    for e in episodes:
        graph = worlds[e.task.world].graph
        near = [graph.distance[v, nearest(graph, v, e.task.goal_nodes)] <= e.task.radius + 1e-9 for v in e.nodes]
        if not near[-1]:
            out["limit" if e.ended == "limit" else "stop"] += 1
            out["passed"] += any(near)
            out["silent"] += e.requests == 0
        for piece in segments(e.steps):
            if piece[0].mode is Mode.SUB and isinstance(piece[-1].action, Stop):
                left += 1
                wrong += graph.distance[piece[-1].pose.node, piece[0].targets[0]] > 2.0 + 1e-9
    n = max(1, len(episodes))
    return Failures(out["limit"] / n, out["stop"] / n, out["passed"] / n, out["silent"] / n, wrong / max(1, left))


@dataclass(frozen=True)
class Prediction:
    """How well one condition is predicted (Figure D.2), over steps where help could be asked."""

    reason: str
    accuracy: float
    precision: float
    recall: float
    true_share: float
    predicted_share: float
    steps: int

    @property
    def f1(self) -> float:
        both = self.precision + self.recall
        return 2 * self.precision * self.recall / both if both else 0.0


def predictions(episodes: Sequence[Episode], worlds: Mapping[str, Place]) -> tuple[Prediction, ...]:
    """Figures D.1(b) and D.2: predicted against true conditions, reasons at probability 0.5 and more."""
    truth, said = [], []
    teacher = HannaTeacher()
    for e in episodes:
        for step, label in zip(e.steps, teacher.relabel(e, worlds[e.task.world]), strict=True):
            thought = step.action.thought
            if label.reasons is not None and thought is not None and thought.reasons is not None:
                truth.append(label.reasons)
                said.append([p >= 0.5 for p in thought.reasons])
    if not truth:
        return ()
    t, s = np.array(truth, dtype=bool), np.array(said, dtype=bool)
    share = lambda hit, of: float(hit[of].mean()) if of.any() else float("nan")
    return tuple(
        Prediction(
            name,
            float((t[:, i] == s[:, i]).mean()),
            share(t[:, i], s[:, i]),
            share(s[:, i], t[:, i]),
            float(t[:, i].mean()),
            float(s[:, i].mean()),
            len(t),
        )
        for i, name in enumerate(REASONS)
    )


def request_share(episodes: Sequence[Episode]) -> float:
    """Share of all steps at which help was asked for (Figure D.1a)."""
    kinds = [type(s.action) for e in episodes for s in e.steps]
    return kinds.count(Ask) / max(1, len(kinds))
