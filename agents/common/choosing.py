"""How an action is chosen from a distribution, and words, characters or actions of a batch from logits: the likeliest,
or sampled."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

Chooser = Callable[[np.ndarray, np.random.Generator], int]


def choose_greedily(probabilities: np.ndarray, rng: np.random.Generator) -> int:
    """Index of the largest probability, the first of equals: for evaluation."""
    return int(probabilities.argmax())


def choose_sampled(probabilities: np.ndarray, rng: np.random.Generator) -> int:
    """Index drawn from the distribution with one uniform number: for training."""
    possible = np.flatnonzero(probabilities)
    edges = np.cumsum(probabilities[possible], dtype=np.float64)
    drawn = int(np.searchsorted(edges, rng.random() * edges[-1], side="right"))
    return int(possible[min(drawn, len(possible) - 1)])


def choose_at(temperature: float) -> Chooser:
    """Draw from the distribution sharpened (below 1) or flattened (above 1) by `temperature`; 0 is the likeliest."""
    if temperature == 0:
        return choose_greedily
    if temperature == 1:
        return choose_sampled
    return lambda probabilities, rng: choose_sampled((probabilities / probabilities.max()) ** (1 / temperature), rng)


Choice = Callable[[Tensor, Tensor, int], Tensor]
"""(logits (k, V), rows (k,) of the batch, step) to chosen numbers (k,)."""


def greedy_choice(logits: Tensor, rows: Tensor, step: int) -> Tensor:
    """The number of the largest logit."""
    return logits.argmax(-1)


def sampled_choice(uniforms: np.ndarray) -> Choice:
    """Sample each number with one of `uniforms` (B, steps) in [0, 1), by inverting the distribution.

    Each row brings its own uniforms, so what is drawn for it does not depend on its batch.
    """
    numbers = torch.from_numpy(uniforms).float()

    def choose(logits: Tensor, rows: Tensor, step: int) -> Tensor:
        edges = logits.softmax(-1).cumsum(-1)
        wanted = numbers[rows, step, None] * edges[:, -1:]
        return torch.searchsorted(edges, wanted, right=True)[:, 0].clamp(max=logits.shape[1] - 1)

    return choose
