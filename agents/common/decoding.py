"""How the next word, character or action is chosen from logits: greedily, or sampled with given random numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

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
