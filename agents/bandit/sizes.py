"""Sizes: how many pairs each split of a corpus gets."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Sizes:
    """The defaults are a thirteenth of the dissertation's (Table 3.1)."""

    supervised: int = 14_000
    """Pairs for supervised pre-training."""
    bandit: int = 12_800
    """Pairs of each set that is rated."""
    dev: int = 1_000
    """Least number of pairs for model selection."""
    test: int = 2_000
    """Least number of pairs for evaluation."""
    overlap: float = 0.95
    """Share of the set bandit_overlap that is in the supervised set (the dissertation: over 95 %)."""

    def __post_init__(self) -> None:
        if min(self.supervised, self.bandit, self.dev, self.test) < 1:
            raise ValueError(f"every split needs at least one pair, got {self}")
        if not 0 <= self.overlap <= 1:
            raise ValueError(f"overlap must be in [0, 1], got {self.overlap}")
