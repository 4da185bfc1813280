"""The effect of one described episode on a student of ILIAD, shown on a copy of it."""

from __future__ import annotations

import copy
from typing import Any

import torch

from embodied.agents.common.session import descend
from embodied.agents.common.weights import seeded

RATE, CLIP = 1e-3, 5.0
"""Of the one update that shows what is learned from a description."""


def learned_from(
    student: Any, task: Any, description: str | None, done: Any
) -> tuple[float, float] | tuple[None, None]:
    """Probability of an execution, given its description, before and after learning from it; None without one.

    The student itself, which may be of any world, stays as it is.
    """
    if not description:
        return None, None
    learner = copy.copy(student)
    network = learner.network = copy.deepcopy(student.network).train()
    optimizer = torch.optim.Adam(network.parameters(), RATE)
    before = _probability(student, task, description, done)
    with seeded(0):  # for dropout
        loss = -learner.scores([task], [description], [done]).log_probabilities.sum()
        descend(loss, optimizer, "shown episode", CLIP)
    return before, _probability(learner, task, description, done)


def lines_of(description: str | None, before: float | None, after: float | None) -> list[str]:
    """The description and its effect, for people to read."""
    if before is None or after is None:
        return ["teacher       (nothing to say)", "learned       nothing"]
    return [
        f"teacher       {description}",
        f"learned       p(what it did | what was said) {before:.4f} -> {after:.4f} by one update",
    ]


def _probability(student: Any, task: Any, description: str, done: Any) -> float:
    with torch.no_grad():
        return float(student.scores([task], [description], [done]).log_probabilities.sum().exp())
