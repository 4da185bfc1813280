"""The parts of a problem that ILIAD's learners need (Algorithm 3): a world, a teacher, a marginal and a student.

Tasks and executions are the problem's own records; everything is done a batch at a time, because
networks are quicker that way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from torch import Tensor, nn

Tasks = Sequence[Any]
"""Tasks q = (R, s_1, d*)."""
Executions = Sequence[Any]
"""Executions e = (s_1, a_1, .., s_H, a_H)."""
NOTHING = ""
"""The empty description."""


def one_request(task: Any, *, rng: np.random.Generator) -> str:
    """Unif(D*)."""
    return task.requests[int(rng.integers(len(task.requests)))]


@dataclass(frozen=True, eq=False)
class ExecutionScores:
    """A policy's scores of B executions of at most T actions; zero behind the end of each."""

    log_probabilities: Tensor
    """(B, T) log pi(a_t | s_t, d); carries the gradient."""
    entropies: Tensor
    """(B, T) of pi(. | s_t, d), nats; carries the gradient."""
    mask: Tensor
    """(B, T) bool, False behind the end."""
    auxiliary_loss: Tensor | None = None
    """(B, T) losses of what is learned besides, weighted; carries the gradient."""

    @property
    def objective(self) -> Tensor:
        """(B, T), what imitation makes larger."""
        return self.log_probabilities if self.auxiliary_loss is None else self.log_probabilities - self.auxiliary_loss


class RequestWorld(Protocol):
    """The world in which requests are fulfilled. Only imitation asks for `demonstrate`, only REINFORCE for `reward`."""

    def request(self, task: Any, *, rng: np.random.Generator) -> str:
        """d*: one of the task's requests."""

    def success(self, task: Any, execution: Any) -> bool:
        """True where the task is fulfilled."""

    def reward(self, task: Any, execution: Any) -> float:
        """Nearness to the goal, at most 1 (C.1, C.2)."""

    def demonstrate(self, task: Any, execution: Any) -> Any:
        """The best actions in the states of an execution, one for each, the last one stopping."""


class DescribingTeacher(Protocol):
    """P_T(d | e)."""

    def describe(self, tasks: Tasks, executions: Executions, *, rng: np.random.Generator) -> list[str | None]:
        """A description of what was done; None where the teacher has nothing to say."""


class Marginal(Protocol):
    """P_omega(e | s_1), which knows nothing of requests."""

    def draw(self, tasks: Tasks, *, rng: np.random.Generator) -> list[Any]:
        """An execution that begins where each task begins."""


class Student(Protocol):
    """pi(a | s, d)."""

    def sample(self, tasks: Tasks, requests: Sequence[str], *, rng: np.random.Generator) -> list[Any]:
        """e ~ P_pi(. | s_1, d)."""

    def greedy(self, tasks: Tasks, requests: Sequence[str]) -> list[Any]:
        """The likeliest action in every state."""

    def rollout_for_dagger(self, tasks: Tasks, requests: Sequence[str], *, rng: np.random.Generator) -> list[Any]:
        """Executions that visit the states in which it will be shown better actions."""

    def scores(
        self, tasks: Tasks, requests: Sequence[str], executions: Executions, actions: Executions | None = None
    ) -> ExecutionScores:
        """Of the actions of executions, or of other `actions` in their states."""

    @property
    def network(self) -> nn.Module:
        """The network that is trained."""
