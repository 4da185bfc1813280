"""HARI's assistant: describes the state, the goal, or a sub-goal half-way (dissertation 4.3.3, 4.3.5)."""

from __future__ import annotations

import numpy as np

from embodied.assistants.descriptions import Describer
from embodied.interface import Description, Intention, Place, Reply, Situation, Subtask

STACK = 2
"""L, the most goals on the stack (Table E.2)."""
LONGEST_SUBGOAL = 3
"""l_max, nodes (Table E.2)."""


def subgoal(path: tuple[int, ...], longest: int = LONGEST_SUBGOAL) -> int:
    """p_k with k = min(floor(|p| / 2), l_max) on the shortest path p to the goal (4.3.5).

    |p| counts nodes, so next to the goal k = 1 is the goal itself and at the goal k = 0 is here.
    """
    return path[min(len(path) // 2, longest, len(path) - 1)]


def described_subgoal(
    describer: Describer, world: Place, here: int, goal: int, longest: int = LONGEST_SUBGOAL
) -> tuple[tuple[int, ...], Description]:
    """The way to a sub-goal, which it ends at, and its description: dense, or the next action when one step away."""
    path = world.graph.path(here, goal)
    target = subgoal(path, longest)
    way = path[: path.index(target) + 1]
    near = len(way) <= 2
    return way, describer.step(world, here, target) if near else describer.dense(world, target, goal=True)


class HariAssistant:
    """Ever present; SUB is unavailable when the stack is full (4.3.4.2)."""

    def __init__(self, describer: Describer, *, stack: int = STACK, longest: int = LONGEST_SUBGOAL) -> None:
        self._describer, self._stack, self._longest = describer, stack, longest

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        some = (Intention.CUR, Intention.GOAL)
        return (*some, Intention.SUB) if len(situation.extras.goals) < self._stack else some

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        """A dense description, or the next action when asked for a sub-goal one step away.

        Raises:
          ValueError: a question HARI does not know.
        """
        s, say = situation, self._describer
        here, goal = s.pose.node, s.extras.goals[-1]
        if question is Intention.CUR:
            return Reply(description=say.dense(s.world, here), intention=question)
        if question is Intention.GOAL:
            return Reply(description=say.dense(s.world, goal, goal=True), intention=question)
        if question is Intention.SUB:
            way, description = described_subgoal(say, s.world, here, goal, self._longest)
            return Reply(description=description, intention=question, subtask=Subtask("subgoal", way[-1], path=way))
        raise ValueError(f"HARI's assistant answers cur, goal and sub, was asked {question.value!r}")


class Uncooperative:
    """Answers a question drawn from those that could be asked, whatever was asked (Table 4.7)."""

    def __init__(self, assistant: HariAssistant) -> None:
        self._assistant = assistant

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        return self._assistant.intentions(situation)

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        some = self.intentions(situation)
        return self._assistant.answer(situation, some[int(rng.integers(len(some)))], rng=rng)
