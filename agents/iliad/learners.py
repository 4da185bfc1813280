"""Algorithm 9 (ADEL), DAgger and REINFORCE, one update each, over the protocol of a problem.

All three begin alike: the world gives tasks with requests, an agent carries them out. They differ in
what they hear: a description, a demonstration, or a number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic

import numpy as np
import torch
from torch import Tensor

from agents.common.actor_critic import Decisions, actor_loss
from agents.common.session import descend
from agents.iliad.protocol import NOTHING, DescribingTeacher, E, ExecutionScores, Marginal, Q, RequestWorld, Student


@dataclass(frozen=True, eq=False)
class IliadLesson(Generic[Q, E]):
    """What came of one update."""

    loss: float
    executions: Sequence[E]
    """What the agent did for the requests."""
    descriptions: Sequence[str | None] = ()
    """What the teacher said of it, where there is one."""


def adel(
    tasks: Sequence[Q],
    requests: Sequence[str],
    teacher: DescribingTeacher[Q, E],
    marginal: Marginal[Q, E],
    explorer: Student[Q, E],
    student: Student[Q, E],
    optimizer: torch.optim.Optimizer,
    mixing: float,
    clip: float,
    *,
    rng: np.random.Generator,
) -> IliadLesson[Q, E]:
    """Lines 6 to 11 of Algorithm 9; `explorer` is pi_beta, `student` pi_theta, `optimizer` has the weights of both."""
    done = explorer.sample(tasks, requests, rng=rng)  # line 6
    said = teacher.describe(tasks, done, rng=rng)  # line 7
    unlabeled = marginal.draw(tasks, rng=rng)  # line 8
    loss = adel_loss(tasks, done, said, unlabeled, explorer, student, mixing)  # lines 9 and 10
    descend(loss, optimizer, "ADEL", clip)  # line 11
    return IliadLesson(float(loss.detach()), done, said)


def adel_loss(
    tasks: Sequence[Q],
    done: Sequence[E],
    said: Sequence[str | None],
    unlabeled: Sequence[E],
    explorer: Student[Q, E],
    student: Student[Q, E],
    mixing: float,
) -> Tensor:
    """-L(theta) - L(beta) of line 9: summed over actions, averaged over the batch.

    An execution that got no description teaches neither policy; the unlabeled one is then learned
    with the empty description, as in the authors' program (docs/sources.md, S94).
    """
    heard = [i for i, d in enumerate(said) if d]
    own_tasks, own = [tasks[i] for i in heard], [done[i] for i in heard]
    descriptions = [d or NOTHING for d in said]
    own_descriptions = [descriptions[i] for i in heard]
    loss = described_loss(tasks, done, said, student)  # -L(theta)
    if heard and mixing < 1:
        tasks, descriptions, unlabeled = [*own_tasks, *tasks], [*own_descriptions, *descriptions], [*own, *unlabeled]
    if (heard and mixing < 1) or mixing > 0:  # -L(beta), both of its terms at once
        weights = torch.tensor([1 - mixing] * (len(tasks) - len(said)) + [mixing] * len(said))
        loss = loss - (weights @ explorer.scores(tasks, descriptions, unlabeled).log_probabilities).sum()
    return loss / len(said)


def described_loss(tasks: Sequence[Q], done: Sequence[E], said: Sequence[str | None], student: Student[Q, E]) -> Tensor:
    """-log pi_theta of the executions that were described, summed over actions; 0 where nothing was said."""
    loss = 0 * next(iter(student.network().parameters())).sum()
    heard = [i for i, d in enumerate(said) if d]
    if heard:
        some, executions = [tasks[i] for i in heard], [done[i] for i in heard]
        loss = loss - student.scores(some, [said[i] or NOTHING for i in heard], executions).log_probabilities.sum()
    return loss


def mixture(
    tasks: Sequence[Q],
    requests: Sequence[str],
    teacher: DescribingTeacher[Q, E],
    marginal: Marginal[Q, E],
    student: Student[Q, E],
    optimizer: torch.optim.Optimizer,
    mixing: float,
    clip: float,
    *,
    rng: np.random.Generator,
) -> IliadLesson[Q, E]:
    """Algorithm 5: the execution of each task comes from the mixture of Eq 3.14, and the student learns what was said.

    With `mixing` 1 this is Algorithm 4, with 0 Algorithm 8 whose epochs are one batch long. What was said is learned
    from once, as it comes, not gathered in a buffer (docs/sources.md, S176).
    """
    own, unlabeled = student.sample(tasks, requests, rng=rng), marginal.draw(tasks, rng=rng)
    done = [u if rng.random() < mixing else o for u, o in zip(unlabeled, own, strict=True)]
    said = teacher.describe(tasks, done, rng=rng)
    loss = described_loss(tasks, done, said, student) / len(tasks)
    descend(loss, optimizer, "mixture", clip)
    return IliadLesson(float(loss.detach()), done, said)


def dagger(
    tasks: Sequence[Q],
    requests: Sequence[str],
    world: RequestWorld[Q, E],
    student: Student[Q, E],
    optimizer: torch.optim.Optimizer,
    clip: float,
) -> IliadLesson[Q, E]:
    """Imitation: the student acts greedily and is shown the best action in every state that it came to."""
    done = student.greedy(tasks, requests)
    shown = [world.demonstrate(q, e) for q, e in zip(tasks, done, strict=True)]
    loss = -student.scores(tasks, requests, done, shown).log_probabilities.sum() / len(tasks)
    descend(loss, optimizer, "DAgger", clip)
    return IliadLesson(float(loss.detach()), done)


def reinforce(
    tasks: Sequence[Q],
    requests: Sequence[str],
    rewards_of: RewardsOf[Q, E],
    mean: RunningMean,
    student: Student[Q, E],
    optimizer: torch.optim.Optimizer,
    entropy: float,
    clip: float,
    *,
    rng: np.random.Generator,
) -> IliadLesson[Q, E]:
    """REINFORCE against the mean of all rewards so far, those of this batch included."""
    done = student.sample(tasks, requests, rng=rng)
    rewards = rewards_of(tasks, done)
    mean.add(rewards)
    loss = reinforce_loss(student.scores(tasks, requests, done), rewards, mean.value, entropy)
    descend(loss, optimizer, "REINFORCE", clip)
    return IliadLesson(float(loss.detach()), done)


def reinforce_loss(scores: ExecutionScores, rewards: Sequence[float], baseline: float, entropy: float) -> Tensor:
    """Sum over actions, mean over the batch, of (r - b) NLL - `entropy` H."""
    returns = torch.tensor(list(rewards), dtype=scores.log_probabilities.dtype)
    values = torch.full_like(scores.log_probabilities, baseline)
    rated = Decisions(scores.log_probabilities, values, returns, scores.mask)
    return actor_loss(rated) - entropy * (scores.entropies * scores.mask).sum() / len(returns)


class RewardsOf(Generic[Q, E]):
    """A reward of a world: success, or nearness."""

    def __init__(self, world: RequestWorld[Q, E], binary: bool) -> None:
        self._of = (lambda q, e: float(world.success(q, e))) if binary else world.reward

    def __call__(self, tasks: Sequence[Q], executions: Sequence[E]) -> list[float]:
        return [self._of(q, e) for q, e in zip(tasks, executions, strict=True)]


@dataclass
class RunningMean:
    """The mean of all numbers so far."""

    total: float = 0.0
    count: int = 0

    @property
    def value(self) -> float:
        return self.total / max(1, self.count)

    def add(self, numbers: Sequence[float]) -> None:
        self.total += float(sum(numbers))
        self.count += len(numbers)
