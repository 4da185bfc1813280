"""How HANNA agents are judged: the variants of an agent by name, and what is counted of their episodes.

The playing itself is embodied.evaluation, the same for everybody.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import torch
from torch import nn

from embodied.agents.common.choosing import choose_at
from embodied.agents.hanna.agent import HannaAgent
from embodied.agents.hanna.asking import RULES
from embodied.agents.hanna.inputs import Percept
from embodied.agents.hanna.map_policy import MapPolicy, PerfectInterpretation
from embodied.agents.hanna.network import Scores
from embodied.agents.vision.bank import FeatureBank
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.evaluation.tables import Samples, measured
from embodied.interface import Agent, Ask, Episode, Place
from embodied.teachers.hanna import HannaTeacher

REASONS = ("lost", "uncertain_wrong", "never_asked")
WITHOUT_LEARNING = ("random walk", "forward 10", "shortest", "perfect interpretation")
"""Agents of embodied.evaluation.evaluate that are judged beside the learned one; they need no pictures."""
EVAL_ABLATIONS: Mapping[str, Mapping[str, Any]] = {
    "learned, without search": {"frontier_discount": 0.0},
    "learned, not by image": {"use_goal_image": False},
    "learned, without a trail": {"use_goal_image": False, "revisit_weight": 1.0},
    "learned, likeliest move": {"choose": choose_at(0.0)},
    "learned, likeliest move, without a trail": {
        "choose": choose_at(0.0),
        "use_goal_image": False,
        "revisit_weight": 1.0,
    },
}
"""Changed settings, by name, where an agent is judged more nearly as the text has it, the last wholly so but for when
it asks (docs/sources.md, S36, S161; S162 stays)."""


Judged = Callable[[HannaAgent, FeatureBank], MapPolicy]
"""How an agent acts when it is judged."""


def hanna_policies(agent: HannaAgent, bank: FeatureBank, of: Judged = HannaAgent.policy) -> dict[str, Agent]:
    """Variants of a learned agent by the names of Tables 4.3 to 4.5.

    'no ask', 'random ask' and 'ask every 5' put another rule before the same networks; the
    authors train an agent for each rule (`embodied train hanna --ask-rule ...`; docs/sources.md, S39).
    """
    learned = of(agent, bank)
    return {
        "learned": learned,
        "learned, no ask": learned.changed(ask_rule=RULES["never"][1]),
        "learned, random ask": learned.changed(ask_rule=RULES["random"][1]),
        "learned, ask every 5": learned.changed(ask_rule=RULES["every5"][1]),
        "learned, target image only": learned.changed(read_assistance=False),
        "learned, perfect interpretation": PerfectInterpretation(learned),
    }


def by_the_text(agent: HannaAgent, bank: FeatureBank) -> MapPolicy:
    """The agent as the text judges it: the likeliest move and decision to ask, without rules of ours (docs/sources.md,
    S36, S161, S162)."""
    plain = EVAL_ABLATIONS["learned, likeliest move, without a trail"]
    return agent.policy(bank).changed(**plain, ask_rule=RULES[agent.config.ask_rule][1])


def all_policies(agent: HannaAgent, bank: FeatureBank, of: Judged = HannaAgent.policy) -> dict[str, Agent]:
    """Those of `hanna_policies` and `sight_policies`, and the agent in each way of EVAL_ABLATIONS."""
    learned = of(agent, bank)
    plainer = {name: learned.changed(**changed) for name, changed in EVAL_ABLATIONS.items()}
    return {**hanna_policies(agent, bank, of), **plainer, **sight_policies(agent, bank)}


UNWILLING = 20.0
"""Logit by which stopping is less likely than a move where nothing was learned."""


class Uniform(nn.Module):
    """A network that has learned nothing: all moves are equally likely, and it does not stop by itself."""

    def __init__(self, action_size: int) -> None:
        super().__init__()
        self.action_size = action_size
        self.nothing = nn.Parameter(torch.zeros(0))

    def start(self, batch: int, length: int) -> tuple[Forgetting, Forgetting]:
        return Forgetting(), Forgetting()

    def forward(self, memory: object, percept: Percept) -> tuple[Scores, object]:
        logits = torch.zeros(percept.action_mask.shape).masked_fill(~percept.action_mask, -torch.inf)
        logits[:, 0] = -UNWILLING
        return Scores(logits, torch.zeros(len(logits), 2), None), memory


class Forgetting:
    """The memory of a network that has none."""

    def select(self, rows: torch.Tensor) -> Forgetting:
        return self


def sight_policies(agent: HannaAgent, bank: FeatureBank) -> dict[str, Agent]:
    """Agents that show the worth of sight, by name: the learned agent without it, and its rules with sight but without
    learning.

    'blind' sees black with network and matcher alike; 'rules only' draws moves evenly, stops by the picture alone and
    asks every 5 steps, or every 10.
    """
    learned, blind = agent.policy(bank), agent.policy(bank.blind())
    every5 = RULES["every5"][1]
    nothing: Any = Uniform(learned.policy.network.action_size)
    rules = learned.changed(network=nothing, ask_rule=every5)
    return {
        "blind": blind,
        "blind, not by image": blind.changed(use_goal_image=False),
        "blind, ask every 5": blind.changed(ask_rule=every5),
        "rules only": rules,
        "rules only, ask every 10": rules.changed(ask_rule=lambda p, seen, last, *, rng: seen.time - last >= 10),
        "rules only, blind": rules.changed(bank=blind.policy.bank),
    }


def players(agent: HannaAgent, bank: FeatureBank) -> tuple[dict[str, Agent], list[str]]:
    """All rows that an agent gives, and the names of those of the paper's tables, of the sighted and the unsighted."""
    without = {name: agent_without_learning("hanna", name) for name in WITHOUT_LEARNING}
    return {**without, **all_policies(agent, bank)}, [*without, *hanna_policies(agent, bank), "blind", "rules only"]


def counted(episodes: Sequence[Episode], places: Mapping[str, Place]) -> dict[str, Samples]:
    """The metrics of all tasks, 'request share': of all steps (Figure D.1a), and how well conditions are predicted, per
    episode."""
    graphs = {name: place.graph for name, place in places.items()}
    asked = [(float(sum(isinstance(s.action, Ask) for s in e.steps)), float(len(e.steps))) for e in episodes]
    share = _ratios({"request share": asked}, [e.task.world for e in episodes])
    return {**measured(episodes, graphs), **share, **predictions(episodes, places)}


def predictions(episodes: Sequence[Episode], places: Mapping[str, Place]) -> dict[str, Samples]:
    """Figures D.1(b) and D.2: each condition as predicted (reasons at probability 0.5 and more) against as it was, over
    steps where help could be asked: 'lost accuracy', 'lost precision', 'lost recall', 'lost predicted', 'lost true'."""
    teacher, counts_by_name = HannaTeacher(), dict[str, list[tuple[float, float]]]()
    for e in episodes:
        pairs = [
            (label.reasons, [p >= 0.5 for p in step.action.thought.reasons])
            for step, label in zip(e.steps, teacher.relabel(e, places[e.task.world]), strict=True)
            if label.reasons is not None and step.action.thought is not None and step.action.thought.reasons is not None
        ]
        for i, reason in enumerate(REASONS):
            true, predicted = [t[i] for t, _ in pairs], [s[i] for _, s in pairs]
            both = sum(t and s for t, s in zip(true, predicted, strict=True))
            same = sum(t == s for t, s in zip(true, predicted, strict=True))
            counts = {
                "accuracy": (same, len(pairs)),
                "precision": (both, sum(predicted)),
                "recall": (both, sum(true)),
                "predicted": (sum(predicted), len(pairs)),
                "true": (sum(true), len(pairs)),
            }
            for name, (some, all_) in counts.items():
                counts_by_name.setdefault(f"{reason.replace('_', ' ')} {name}", []).append((float(some), float(all_)))
    return _ratios(counts_by_name, [e.task.world for e in episodes])


def _ratios(counts: Mapping[str, Sequence[tuple[float, float]]], houses: Iterable[str]) -> dict[str, Samples]:
    groups = tuple(houses)
    return {
        name: Samples(tuple(a for a, _ in pairs), groups, tuple(b for _, b in pairs)) for name, pairs in counts.items()
    }
