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
    """Longest rated episode, steps; at most its task's."""
    learning_rate: float = 1e-4
    """Learning rate of the agent."""
    critic_rate: float = 1e-3
    """Learning rate of the critic, which starts untrained."""
    critic_updates: int = 10
    """Updates at the start in which only the critic learns."""
    score: str = "SDTW"
    """What ratings are simulated from: 'success', 'nDTW' of the path, which teaches agents to stand still
    (docs/results/bandit.md), or 'SDTW': nDTW where the goal was reached, else 0."""
    clip: float = 5.0
    """Largest gradient norm."""
    seed: int = 0
    """Random seed."""

    def __post_init__(self) -> None:
        require_word(self, "score", SCORES)
        require(self, AT_LEAST_ONE, "updates", "batch", "steps")
        require(self, POSITIVE, "learning_rate", "critic_rate", "clip")
