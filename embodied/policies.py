"""Agents that do not learn: baselines, skylines, and the asking rules that go with them.

Those that need privileged information take `situations` in `act` and say so with
`privileged = True`; the others see Observations only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from embodied.interface import Action, Ask, Intention, Mode, Move, Observation, Policy, Sight, Situation, Stop
from embodied.teachers.shortest import shortest_action

Observations = Sequence[Observation | None]
Actions = list[Action | None]


class RandomWalk:
    """Uniform over the candidates and stop at every step (originals 3.8); never asks."""

    privileged = False

    def act(
        self, observations: Observations, memory: object | None, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[Actions, object]:
        return [None if o is None else _random_move(o, rng) for o, rng in zip(observations, rngs)], ()


class Forward10:
    """The candidate nearest the middle of the view for ten steps, then stop (originals 3.8)."""

    privileged = False

    def act(
        self, observations: Observations, memory: object | None, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[Actions, object]:
        return [None if o is None else self._one(o) for o in observations], ()

    def _one(self, observation: Observation) -> Action:
        return Move(0) if observation.time < 10 and len(observation.candidates) else Stop()


class Shortest:
    """The skyline: the navigation teacher acts; never asks."""

    privileged = True

    def act(
        self, observations: Observations, memory: object | None, *,
        rngs: Sequence[np.random.Generator], situations: Sequence[Situation | None],
    ) -> tuple[Actions, object]:
        return [None if s is None else _teacher_move(s) for s in situations], ()


class AskRule(Protocol):
    """Whether to ask now; called only where help can be asked for."""

    def __call__(self, observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
        """`last_asked` is the time of the last request, -1 before any."""
        ...


def never_ask(observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
    """NOASK."""
    return False


def ask_at_random(observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
    """RANDOMASK: with probability 0.2, the average of the authors' learned agent (4.2.5)."""
    return bool(rng.random() < 0.2)


def ask_every_5(observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
    """ASKEVERY5: as soon as five steps have passed since the last request (originals 3.8)."""
    return observation.time - last_asked >= 5


def ask_first(observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
    """VNLA's 'first': at every step while the budget lasts (originals 4.6)."""
    return True


class Asking:
    """A navigation policy with an asking rule in front of it."""

    def __init__(self, navigation: Policy, rule: AskRule) -> None:
        self.navigation, self.rule = navigation, rule
        self.privileged = getattr(navigation, "privileged", False)

    def act(
        self, observations: Observations, memory: object | None, *,
        rngs: Sequence[np.random.Generator], **situations: Sequence[Situation | None],
    ) -> tuple[Actions, object]:
        last, inner = memory or ([-1] * len(observations), None)
        actions, inner = self.navigation.act(observations, inner, rngs=rngs, **situations)
        for i, o in enumerate(observations):
            if o is not None and o.can_ask and self.rule(o, last[i], rng=rngs[i]):
                actions[i], last[i] = Ask(o.can_ask[0]), o.time
        return actions, (last, inner)


@dataclass
class _Trail:
    """What an Explorer remembers of one episode."""

    visited: dict[Sight, int] = field(default_factory=dict)
    asked: set[tuple[Sight, Sight | None]] = field(default_factory=set)


class PerfectInterpreter:
    """The skyline 'perfect assistance interpretation' for an agent without learning.

    On a route the teacher acts, so every instruction is understood (4.2.5). On the main task the
    agent has no skill but its memory: it goes to the least visited neighbour, asks whenever it
    meets somebody it has not asked about the same target, and stops once it is as near a goal as
    the task demands (it recognises the object). The authors' row has a trained navigator there.
    """

    privileged = True

    def act(
        self, observations: Observations, memory: object | None, *,
        rngs: Sequence[np.random.Generator], situations: Sequence[Situation | None],
    ) -> tuple[Actions, object]:
        trails = memory or [_Trail() for _ in observations]
        actions = [
            None if o is None else self._one(o, s, trail, rng)
            for o, s, trail, rng in zip(observations, situations, trails, rngs, strict=True)
        ]
        return actions, trails

    def _one(self, o: Observation, s: Situation, trail: _Trail, rng: np.random.Generator) -> Action:
        trail.visited[o.sight] = trail.visited.get(o.sight, 0) + 1
        if o.mode is Mode.SUB:
            return _teacher_move(s)
        distance = s.world.graph.distance
        if min(distance[s.pose.node, g] for g in s.task.goal_nodes) <= s.task.radius:
            return Stop()
        here = (o.sight, None)
        if Intention.HELP in o.can_ask and here not in trail.asked:
            trail.asked.add(here)
            return Ask()
        visits = np.array([trail.visited.get(Sight(s.task.world, v), 0) for v in s.candidate_nodes])
        fewest = np.flatnonzero(visits == visits.min())
        return Move(int(rng.choice(fewest)))


def _teacher_move(s: Situation) -> Move | Stop:
    return shortest_action(s.world.graph, s.pose, s.targets, s.candidate_nodes)


def _random_move(observation: Observation, rng: np.random.Generator) -> Move | Stop:
    allowed = np.flatnonzero(observation.candidates.allowed)
    choice = int(rng.integers(len(allowed) + 1))
    return Stop() if choice == len(allowed) else Move(int(allowed[choice]))
