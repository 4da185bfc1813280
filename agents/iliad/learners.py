"""Algorithm 9 (ADEL), DAgger and REINFORCE: the loss of one batch each, over the protocol of a problem.

All three begin alike: the world gives tasks with requests, an agent carries them out. They differ in
what they hear: a description, a demonstration, or a number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from embodied.agents.common.losses import Decisions, actor_loss
from embodied.agents.iliad.protocol import (
    NOTHING,
    DescribingTeacher,
    Executions,
    ExecutionScores,
    Marginal,
    RequestWorld,
    Student,
    Tasks,
)


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
