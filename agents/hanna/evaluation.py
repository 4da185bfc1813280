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
BY_THE_TEXT = {"choose": choose_at(0.0), "use_goal_image": False, "revisit_weight": 1.0}
"""Changed settings where an agent is judged as the text has it (docs/sources.md, S36, S161)."""
Judged = Callable[[HannaAgent, FeatureBank], MapPolicy]
"""How an agent acts when it is judged."""


def by_the_text(agent: HannaAgent, bank: FeatureBank) -> MapPolicy:
    """The agent as the text judges it: the likeliest move and decision to ask, without rules of ours (docs/sources.md,
    S36, S161, S162)."""
    return agent.policy(bank).changed(**BY_THE_TEXT, ask_rule=RULES[agent.config.ask_rule][1])


def hanna_policies(agent: HannaAgent, bank: FeatureBank, of: Judged = HannaAgent.policy) -> dict[str, Agent]:
    """Variants of a learned agent by the names of Tables 4.3 to 4.5, and two that show the worth of sight.

    'no ask', 'random ask' and 'ask every 5' put another rule before the same networks; the
    authors train an agent for each rule (`embodied train hanna --ask-rule ...`; docs/sources.md, S39).
    'blind' sees black with network and matcher alike; 'rules only' draws moves evenly, stops by the picture alone and
    asks every 5 steps.
    """
    learned, every5 = of(agent, bank), RULES["every5"][1]
    nothing: Any = Uniform(agent.network.action_size)
    return {
        "learned": learned,
        "learned, no ask": learned.changed(ask_rule=RULES["never"][1]),
        "learned, random ask": learned.changed(ask_rule=RULES["random"][1]),
        "learned, ask every 5": learned.changed(ask_rule=every5),
        "learned, target image only": learned.changed(read_assistance=False),
        "learned, perfect interpretation": PerfectInterpretation(learned),
        "blind": agent.policy(bank.blind()),
        "rules only": agent.policy(bank).changed(network=nothing, ask_rule=every5),
    }


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


def players(agent: HannaAgent, bank: FeatureBank) -> dict[str, Agent]:
    """All rows that an agent gives, beside agents without learning."""
    without = {name: agent_without_learning("hanna", name) for name in WITHOUT_LEARNING}
    return {**without, **hanna_policies(agent, bank)}


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
