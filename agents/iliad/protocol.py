"""The parts of a problem that ILIAD's learners need (Algorithm 3): a world, a teacher, a marginal and a student; and
the loss of one batch of each learner over them: Algorithm 9 (ADEL), DAgger and REINFORCE.

Tasks and executions are the problem's own records; everything is done a batch at a time, because networks are quicker
that way. All learners begin alike: the world gives tasks with requests, an agent carries them out. They differ in what
they hear: a description, a demonstration, or a number.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor, nn

from embodied.agents.common.tensors import Decisions, actor_loss

Tasks = Sequence[Any]
"""Tasks q = (R, s_1, d*)."""
Executions = Sequence[Any]
"""Executions e = (s_1, a_1, .., s_H, a_H)."""
NOTHING = ""
"""The empty description."""


def one_request(task: Any, *, rng: np.random.Generator) -> str:
    """d* ~ Unif(D*): one of the task's requests."""
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


@dataclass(frozen=True, eq=False)
class RequestBatch:
    """One batch: what is to be done, in what words."""

    tasks: Tasks
    requests: Sequence[str]
    rng: np.random.Generator
    """The generator of this batch."""


@dataclass(frozen=True, eq=False)
class IliadLesson:
    """The outcome of one batch."""

    loss: Tensor
    """The loss to descend; a scalar."""
    executions: Executions
    """The agent's executions of the requests."""
    descriptions: Sequence[str | None] = ()
    """The teacher's descriptions of them, where there is one."""
    rewards: Sequence[float] = ()
    """Their rewards, where they are learned from."""


def adel(
    asked: RequestBatch,
    teacher: DescribingTeacher,
    marginal: Marginal,
    explorer: Student,
    student: Student,
    mixing: float,
) -> IliadLesson:
    """Lines 6 to 10 of Algorithm 9; `explorer` is pi_beta, `student` pi_theta, the loss is of both."""
    done = explorer.sample(asked.tasks, asked.requests, rng=asked.rng)  # line 6
    descriptions = teacher.describe(asked.tasks, done, rng=asked.rng)  # line 7
    unlabeled = marginal.draw(asked.tasks, rng=asked.rng)  # line 8
    loss = adel_loss(asked.tasks, done, descriptions, unlabeled, explorer, student, mixing)  # lines 9 and 10
    return IliadLesson(loss, done, descriptions)


def adel_loss(
    tasks: Tasks,
    done: Executions,
    descriptions: Sequence[str | None],
    unlabeled: Executions,
    explorer: Student,
    student: Student,
    mixing: float,
) -> Tensor:
    """-L(theta) - L(beta) of line 9: summed over actions, averaged over the batch.

    An execution that got no description teaches neither policy; the unlabeled one is then learned
    with the empty description, as in the authors' program (docs/sources.md, S94).
    """
    heard = [i for i, d in enumerate(descriptions) if d]
    own_tasks, own = [tasks[i] for i in heard], [done[i] for i in heard]
    texts = [d or NOTHING for d in descriptions]
    own_texts, count = [texts[i] for i in heard], len(texts)
    loss = described_loss(tasks, done, descriptions, student)  # -L(theta)
    if heard and mixing < 1:
        tasks, texts, unlabeled = [*own_tasks, *tasks], [*own_texts, *texts], [*own, *unlabeled]
    if (heard and mixing < 1) or mixing > 0:  # -L(beta), both of its terms at once
        weights = torch.tensor([1 - mixing] * (len(tasks) - count) + [mixing] * count)
        loss = loss - (weights @ explorer.scores(tasks, texts, unlabeled).objective).sum()
    return loss / count


def described_loss(tasks: Tasks, done: Executions, descriptions: Sequence[str | None], student: Student) -> Tensor:
    """-log pi_theta of the executions that were described, summed over actions; 0 where nothing was said."""
    loss = 0 * next(iter(student.network.parameters())).sum()
    heard = [i for i, d in enumerate(descriptions) if d]
    if heard:
        some, executions = [tasks[i] for i in heard], [done[i] for i in heard]
        loss = loss - student.scores(some, [descriptions[i] or NOTHING for i in heard], executions).objective.sum()
    return loss


def dagger(asked: RequestBatch, world: RequestWorld, student: Student) -> IliadLesson:
    """Imitation: the student acts and is shown the best action in every state that it came to."""
    done = student.rollout_for_dagger(asked.tasks, asked.requests, rng=asked.rng)
    shown = [world.demonstrate(q, e) for q, e in zip(asked.tasks, done, strict=True)]
    scores = student.scores(asked.tasks, asked.requests, done, shown)
    return IliadLesson(-scores.objective.sum() / len(asked.tasks), done)


def reinforce(
    asked: RequestBatch,
    reward: Callable[[Any, Any], float],
    student: Student,
    entropy: float,
    before: tuple[float, float] = (0.0, 0),
) -> IliadLesson:
    """REINFORCE against the mean of all rewards so far, those of this batch included.

    Args:
      before: sum and number of the rewards of earlier batches.
    """
    done = student.sample(asked.tasks, asked.requests, rng=asked.rng)
    rewards = [float(reward(q, e)) for q, e in zip(asked.tasks, done, strict=True)]
    mean = (before[0] + sum(rewards)) / (before[1] + len(rewards))
    scores = student.scores(asked.tasks, asked.requests, done)
    return IliadLesson(reinforce_loss(scores, rewards, mean, entropy), done, rewards=rewards)


def reinforce_loss(scores: ExecutionScores, rewards: Sequence[float], baseline: float, entropy: float) -> Tensor:
    """Sum over actions, mean over the batch, of (r - b) NLL - `entropy` H."""
    returns = torch.tensor(list(rewards), dtype=scores.log_probabilities.dtype)
    values = torch.full_like(scores.log_probabilities, baseline)
    rated = Decisions(scores.log_probabilities, values, returns, scores.mask)
    return actor_loss(rated) - entropy * (scores.entropies * scores.mask).sum() / len(returns)
