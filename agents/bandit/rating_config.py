"""RatingConfig: settings of learning to navigate from ratings."""

from __future__ import annotations

from dataclasses import dataclass

from agents.common.settings import AT_LEAST_ONE, POSITIVE, require, require_word

SCORES = ("success", "nDTW", "SDTW")
"""What a person's stars are simulated from."""
DECISIONS = ("drawn", "usual")
"""How agents decide while they are judged: as while they are rated, or as `embodied evaluate` has it."""


@dataclass(frozen=True)
class RatingConfig:
    """Settings of learning to navigate from ratings."""

    updates: int = 100
    """Updates of the weights."""
    batch: int = 32
    """Episodes per update, each rated once."""
    steps: int = 50
    """Actions of the longest episode that is rated, at most those of its task; imitation cuts episodes off after 20."""
    learning_rate: float = 1e-4
    """Adam's, of the agent; the dissertation's for translators."""
    critic_rate: float = 1e-3
    """Adam's, of the critic, which begins untaught."""
    critic_updates: int = 10
    """First updates, in which the critic learns alone."""
    score: str = "SDTW"
    """What a rating is made from: 'success', 'nDTW' of the walk against the shortest one, which teaches to stand
    still rather than to err (docs/results/bandit.md), or 'SDTW': nDTW where the goal was reached, else nothing."""
    clip: float = 5.0
    """Gradients are clipped to this norm."""
    seed: int = 0
    """Random seed."""

    def __post_init__(self) -> None:
        require_word(self, "score", SCORES)
        require(self, AT_LEAST_ONE, "updates", "batch", "steps")
        require(self, POSITIVE, "learning_rate", "critic_rate", "clip")
