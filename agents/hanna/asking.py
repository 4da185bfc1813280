"""Rules that decide when to ask: the learned network, and the heuristics of dissertation 4.2.5."""

from __future__ import annotations

from typing import Protocol

import numpy as np


class AskRule(Protocol):
    def __call__(self, probability: float, time: int, last_ask: int, rng: np.random.Generator) -> bool:
        """Whether to ask now, at a place where it is possible.

        Args:
          probability: of REQUEST according to the help-request network.
          time: steps since the episode began.
          last_ask: time of the last request, -1 before the first.
          rng: the episode's own generator.
        """
        ...


def ask_sampled(probability: float, time: int, last_ask: int, rng: np.random.Generator) -> bool:
    """Ask with the probability the network gives: for training."""
    return bool(rng.random() < probability)


def ask_greedily(probability: float, time: int, last_ask: int, rng: np.random.Generator) -> bool:
    """Ask where the network finds it more likely than not: for evaluation."""
    return probability > 0.5


def ask_never(probability: float, time: int, last_ask: int, rng: np.random.Generator) -> bool:
    """NOASK."""
    return False


def ask_randomly(probability: float, time: int, last_ask: int, rng: np.random.Generator) -> bool:
    """RANDOMASK: with a probability of 0.2, the average ratio of the authors' learned agent."""
    return bool(rng.random() < 0.2)


def ask_every_5(probability: float, time: int, last_ask: int, rng: np.random.Generator) -> bool:
    """ASKEVERY5: as soon as 5 steps have passed since the last request (the first from step 4)."""
    return time - last_ask >= 5


RULES: dict[str, tuple[AskRule, AskRule]] = {
    "learned": (ask_sampled, ask_greedily),
    "never": (ask_never, ask_never),
    "random": (ask_randomly, ask_randomly),
    "every5": (ask_every_5, ask_every_5),
}
"""Name of a help-request policy -> its rule in training and its rule in evaluation."""
