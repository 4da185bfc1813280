"""The parts of a problem that ILIAD's learners need (Algorithm 3): a world, a teacher, a marginal and a student; and
the teacher that describes with two networks, whatever the world.

Tasks and executions are the problem's own records; everything is done a batch at a time, because
networks are quicker that way.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
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


class DescribingNetworks(ABC):
    """Eq 3.15 and 3.16: a describer whose words count where an executor carries them out as the execution went.

    Of the candidates that pass, the likeliest is given, as in the authors' program (docs/sources.md, S93).
    """

    longest: int
    """Words of a description."""

    def __init__(self, candidates: int) -> None:
        self.candidates = candidates

    @abstractmethod
    def spoken_of(self, task: Any, execution: Any) -> bool:
        """True where there is anything to say."""

    @abstractmethod
    def near_optimal(self, task: Any, execution: Any) -> bool:
        """perf >= tau of Eq 3.15: people's own words describe it."""

    @abstractmethod
    def candidates_of(
        self, tasks: Tasks, executions: Executions, uniforms: np.ndarray | None = None
    ) -> list[list[str]]:
        """The likeliest description of each execution, or different ones sampled with `uniforms` (B, K, words)."""

    @abstractmethod
    def fits(self, cases: Sequence[tuple[Any, Any, str]]) -> list[bool]:
        """perf(e^d, e) >= tau of Eq 3.16: the executor, told d, does the same."""

    def describe(self, tasks: Tasks, executions: Executions, *, rng: np.random.Generator) -> list[str | None]:
        uniforms = rng.random((len(tasks), self.candidates - 1, self.longest))
        descriptions: list[str | None] = [None] * len(tasks)
        left = []
        for i, (task, execution) in enumerate(zip(tasks, executions, strict=True)):
            if self.spoken_of(task, execution):
                if self.near_optimal(task, execution):
                    descriptions[i] = one_request(task, rng=rng)
                else:
                    left.append(i)
        for sampled in (False, True)[: self.candidates]:
            if not left:
                break
            some, done = [tasks[i] for i in left], [executions[i] for i in left]
            several = self.candidates_of(some, done, uniforms[left] if sampled else None)
            fitting = iter(self.fits([(q, e, d) for q, e, many in zip(some, done, several) for d in many]))
            accepted = [[d for d in many if next(fitting)] for many in several]
            for i, good in zip(left, accepted, strict=True):
                descriptions[i] = (good[0] or None) if good else None
            left = [i for i, good in zip(left, accepted, strict=True) if not good]
        return descriptions
