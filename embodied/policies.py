"""Agents that do not learn: baselines, skylines, and the asking rules that go with them.

Those that need privileged information take `situations` in `act` and say so with
`privileged = True`; the others see Observations only.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from embodied.interface import Action, Move, Observation, Situation, Stop
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


def _teacher_move(s: Situation) -> Move | Stop:
    return shortest_action(s.world.graph, s.pose, s.targets, s.candidate_nodes)


def _random_move(observation: Observation, rng: np.random.Generator) -> Move | Stop:
    allowed = np.flatnonzero(observation.candidates.allowed)
    choice = int(rng.integers(len(allowed) + 1))
    return Stop() if choice == len(allowed) else Move(int(allowed[choice]))
