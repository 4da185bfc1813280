"""Who decides when to ask: the learned network, or one of the heuristics of dissertation 4.2.5."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from embodied.interface import Mode, Observation
from embodied.policies import baselines


class HannaAskRule(Protocol):
    def __call__(
        self, probability: float, observation: Observation, last_asked: int, *, rng: np.random.Generator
    ) -> bool:
        """True to ask now, at a place where it is possible.

        Args:
          probability: of REQUEST according to the help-request network.
          observation: what the agent sees.
          last_asked: time of the last request, -1 before any.
        """


def ask_sampled(probability: float, observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
    """Ask with the probability that the network gives: for training."""
    return bool(rng.random() < probability)


def ask_above(threshold: float) -> HannaAskRule:
    """Ask where the network's probability exceeds `threshold`: for evaluation."""
    return lambda probability, observation, last_asked, *, rng: probability > threshold


def ask_patiently(threshold: float, *, first: float, on_route: float, patience: int) -> HannaAskRule:
    """As `ask_above`, but above `first` while nobody has shown where to go, above `on_route` while following one
    person's route, from which the next person may send elsewhere, and, once a route is left, not before `patience`
    moves towards what was shown: who asks again at once is sent back to where it came from."""

    def rule(probability: float, observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
        if observation.target is None:
            return probability > first
        if observation.mode is Mode.SUB:
            return probability > on_route
        return probability > threshold and observation.time_on_task >= patience

    return rule


ask_greedily = ask_above(0.5)
"""Ask where the network finds it more likely than not."""


def heuristic(rule: baselines.AskRule) -> HannaAskRule:
    """A rule that does not listen to the network."""
    return lambda probability, observation, last_asked, *, rng: rule(observation, last_asked, rng=rng)


RULES: dict[str, tuple[HannaAskRule, HannaAskRule]] = {
    "learned": (ask_sampled, ask_greedily),
    "never": (heuristic(baselines.never_ask),) * 2,
    "random": (heuristic(baselines.ask_at_random),) * 2,
    "every5": (heuristic(baselines.ask_every_5),) * 2,
}
"""Name of a help-request policy -> its rule in training and its rule in evaluation."""
