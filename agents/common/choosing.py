"""How an action is chosen from a distribution."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

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
