"""RatingConfig: settings of learning to navigate from ratings."""

from __future__ import annotations

from dataclasses import dataclass

SCORES = ("success", "nDTW")
"""What a person's stars are simulated from."""


@dataclass(frozen=True)
class RatingConfig:
    """Settings of learning to navigate from ratings."""

    updates: int = 100
    """Updates of the weights."""
    batch: int = 32
    """Episodes per update, each rated once."""
    learning_rate: float = 1e-4
    """Adam's, of the agent; the dissertation's for translators."""
    critic_rate: float = 1e-3
    """Adam's, of the critic, which begins untaught."""
    critic_updates: int = 10
    """First updates, in which the critic learns alone."""
    score: str = "nDTW"
    """What a rating is made from: 'success', or 'nDTW' of the walk against the shortest one."""
    clip: float = 5.0
    """Longest gradient."""
    seed: int = 0
    """Of everything that is drawn."""

    def __post_init__(self) -> None:
        if self.score not in SCORES:
            raise ValueError(f"score must be one of {SCORES}, got {self.score!r}")
        for name in ("updates", "batch"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        for name in ("learning_rate", "critic_rate", "clip"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")
