"""What the settings of all learners share, and how settings are checked. Free of torch, so that --help answers at once.

A learner's settings are a frozen record over one of these; a field that stands there again has a default of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Limit:
    """What holds of a number, and that in words: 'must be <words>'."""

    holds: Callable[[float], bool]
    """Of NaN nothing does."""
    words: str


AT_LEAST_ONE = Limit(lambda x: x >= 1, "at least 1")
NOT_NEGATIVE = Limit(lambda x: 0 <= x < math.inf, "at least 0 and finite")
POSITIVE = Limit(lambda x: 0 < x < math.inf, "positive and finite")
SHARE = Limit(lambda x: 0 <= x <= 1, "in [0, 1]")
NOT_ALL = Limit(lambda x: 0 <= x < 1, "in [0, 1)")


def require(settings: object, limit: Limit, *names: str) -> None:
    """Refuse settings of which a field does not hold what it should.

    Raises:
      ValueError: names the field and its value.
    """
    for name in names:
        value = getattr(settings, name)
        if not limit.holds(value):
            raise ValueError(f"{name} must be {limit.words}, got {value}")


def require_word(settings: object, name: str, words: tuple[str, ...]) -> None:
    """Refuse settings of which a field is none of `words`.

    Raises:
      ValueError: names the field, the words and its value.
    """
    value = getattr(settings, name)
    if value not in words:
        raise ValueError(f"{name} must be one of {words}, got {value!r}")


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """Of every run that learns and can be interrupted."""

    batch: int = 32
    """Episodes per update."""
    checkpoint_minutes: float = 3.0
    """How often the run is saved, so that it can go on after an interruption."""
    seed: int = 0
    """Of everything that is drawn."""

    def __post_init__(self) -> None:
        require(self, AT_LEAST_ONE, "batch")
        require(self, POSITIVE, "checkpoint_minutes")


@dataclass(frozen=True, kw_only=True)
class ValidatedRunSettings(RunSettings):
    """Of runs that count updates and keep the weights that do best on tasks put aside."""

    iterations: int
    """Updates of the weights."""
    learning_rate: float = 1e-4
    """Of Adam."""
    validate_every: int = 500
    """Updates between validations."""
    validation_tasks: int = 300
    """Tasks of each validation."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self, AT_LEAST_ONE, "iterations", "validate_every", "validation_tasks")
        require(self, POSITIVE, "learning_rate")
