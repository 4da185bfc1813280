"""HARI's intention environment: a goal stack, descriptions, and a cost for everything (4.3.4).

The five intentions are our three actions: CUR, GOAL and SUB are `Ask`, DO is `Move` (towards the
execution policy's choice) and DONE is `Stop`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from embodied import interface
from embodied.action_spaces import Moves
from embodied.assistants.descriptions import FREQUENT_SHARE, Describer, features_in_words
from embodied.envs.base import HelpEnv, required

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class Costs:
    """Operation costs gamma_a (4.3.6); the task error is counted in graph edges."""

    cur: float = 0.01
    goal: float = 0.01
    sub: float = 0.01
    do: float = 0.01

    def __post_init__(self) -> None:
        if not all(0 <= c < float("inf") for c in (self.cur, self.goal, self.sub, self.do)):
            raise ValueError(f"costs should be numbers from 0 on, got {self}")

    @classmethod
    def alike(cls, cost: float) -> Costs:
        """The same for all four."""
        return cls(cost, cost, cost, cost)

    def of(self, action: interface.Action) -> float:
        """Cost of an action that does not end the episode; DONE on a sub-goal is free (4.3.4.4)."""
        if isinstance(action, interface.Move):
            return self.do
        return getattr(self, action.intention.value) if isinstance(action, interface.Ask) else 0.0


@dataclass(frozen=True)
class HariRules:
    """Rules of play that may be varied; the defaults are Table E.2."""

    costs: Costs = Costs()
    stack: int = 2
    """L, the most goals on the stack."""
    longest: int = 3
    """l_max, the most nodes to a sub-goal."""
    cooperative: bool = True
    """False: the assistant answers a question drawn from those that could be asked (Table 4.7)."""
    horizon: int | None = None
    """H, the most steps of an episode; None: what its task says (30 in Table E.2)."""
    kept: float = FREQUENT_SHARE
    """Share of the object classes, the commonest ones, that sparse descriptions keep (docs/sources.md, S170)."""

    def __post_init__(self) -> None:
        if min(self.stack, self.longest, self.horizon or 1) < 1:
            raise ValueError(
                f"stack {self.stack}, longest {self.longest} and horizon {self.horizon} should be at least 1"
            )
        if not 0 < self.kept <= 1:
            raise ValueError(f"kept should be a share above 0 and at most 1, got {self.kept}")


AS_PRINTED = HariRules()


@dataclass(frozen=True)
class HariExtras(interface.Extras):
    """Observation of the agent besides what all kinds see: descriptions that it perceives or was told."""

    state_description: interface.Description
    """d^s."""
    goal_descriptions: tuple[interface.Description, ...]
    """The stack G^d, top last."""

    def lines(self, turn: int) -> tuple[str, ...]:
        here = (f"here: {features_in_words(self.state_description, turn)}",) if self.state_description else ()
        return (*here, f"where to go: {features_in_words(self.goal_descriptions[-1], turn)}")


@dataclass(frozen=True)
class HariTruth:
    """Knowledge of the assistant besides the situation."""

    goals: tuple[int, ...]
    """The goal nodes on the stack, top last."""


@dataclass(frozen=True, slots=True)
class StackedGoal:
    node: int
    description: interface.Description
    patience: int
    """Time steps left on it before it is dropped; unused for the main goal."""


class HariEnv(HelpEnv):
    """E-bar of 4.3.4.1. Decisions where the text is open:

    a sub-goal held for more than 3 times its shortest distance (in time steps) is popped by itself
    and at no cost (docs/sources.md, S53); reaching the horizon without DONE pays the task error of the start
    (docs/sources.md, S54); sub-goals are described densely (docs/sources.md, S58).
    """

    def __init__(
        self,
        worlds: Mapping[str, interface.Place],
        assistant: interface.Assistant,
        describer: Describer,
        *,
        costs: Costs = Costs(),
        moves: Moves | None = None,
    ) -> None:
        super().__init__(worlds, assistant, moves)
        self._describer, self._costs = describer, costs

    def task_error(self, node: int, goal: int) -> float:
        """c(s, a_done): edges on the shortest path from node to goal (4.3.6; docs/sources.md, S61)."""
        return float(self.world.graph.hops[node, goal])

    def _begin(self) -> None:
        goal = self.task.goal_nodes[0]
        self._goals = [StackedGoal(goal, self._describer.sparse(self.world, goal, goal=True), 0)]  # G_1
        self._state = self._describer.sparse(self.world, self.pose.node)

    def _replied(self, reply: interface.Reply) -> None:
        """T_G and p_desp of 4.3.4.2 and 4.3.4.3."""
        description = required(reply.description, "description in the reply")
        self._tick()
        if reply.intention is interface.Intention.CUR:
            self._state = description
        elif reply.intention is interface.Intention.GOAL:
            top = self._goals[-1]
            self._goals[-1] = StackedGoal(top.node, description, top.patience)
        else:
            self.subtask = required(reply.subtask, "sub-task in the reply")
            target = self.subtask.target
            patience = 3 * max(1, int(self.task_error(self.pose.node, target)))
            self._goals.append(StackedGoal(target, description, patience))
        self._on_top()

    def _moved(self) -> None:
        self._state = self._describer.sparse(self.world, self.pose.node)
        self._tick()
        self._on_top()

    def _stopped(self) -> None:
        if len(self._goals) == 1:
            self.ended = "stop"
            return
        self._goals.pop()
        self._on_top()

    def _tick(self) -> None:
        """A time step was spent on the goal on top."""
        top = self._goals[-1]
        self._goals[-1] = dataclasses.replace(top, patience=top.patience - 1)

    def _on_top(self) -> None:
        """g_t is the top of the stack; sub-goals that were held too long are not."""
        while len(self._goals) > 1 and self._goals[-1].patience <= 0:
            self._goals.pop()
        deep = len(self._goals) > 1
        self.targets = (self._goals[-1].node,) if deep else self.task.goal_nodes
        self.mode = interface.Mode.SUB if deep else interface.Mode.MAIN
        if not deep:
            self.subtask = None

    def _cost(self, action: interface.Action) -> float:
        if isinstance(action, interface.Stop) and len(self._goals) == 1:
            return self.task_error(self.pose.node, self._goals[0].node)
        return self._costs.of(action)

    def step(self, action: interface.Action) -> interface.Observation | None:
        observation = super().step(action)
        if self.ended == "limit":
            error = self.task_error(self.task.start.node, self.task.goal_nodes[0])
            self._steps[-1] = dataclasses.replace(self.last_step, cost=self.last_step.cost + error)
        return observation

    def reward(self, success: float) -> float:
        return -self.last_step.cost

    def potential(self) -> float:
        """Edges to the goal of the moment; 0 after the end (4.20)."""
        return 0.0 if self.ended else self.task_error(self.pose.node, self.targets[0])

    def _truth(self) -> HariTruth:
        return HariTruth(tuple(g.node for g in self._goals))

    def _extras(self) -> HariExtras:
        return HariExtras(self._state, tuple(g.description for g in self._goals))


def shaped_costs(episode: interface.Episode, hops: np.ndarray) -> list[float]:
    """c-tilde_t = c_t + Phi(s_{t+1}, g_{t+1}) - Phi(s_t, g_t), with Phi = 0 after the end (4.20).

    Args:
      hops: (n, n) edges on the shortest paths (NavGraph.hops).

    They sum to the costs minus Phi(s_1, g_1) (4.21), whatever was done.
    """
    potential = [float(hops[s.pose.node, s.targets[0]]) for s in episode.steps] + [0.0]
    return [s.cost + potential[t + 1] - potential[t] for t, s in enumerate(episode.steps)]
