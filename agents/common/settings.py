"""Settings that all learners share, checks of settings, and paths of the weights that ship with this repository.
Free of torch, so that --help answers at once.

A learner's settings are a frozen record over one of these; a field that stands there again has a default of its own.
agents/weights/README.md says how the weights were made.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Limit:
    """A condition on a number, and that in words: 'must be <words>'."""

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
    """Minutes between checkpoints, from which an interrupted run resumes."""
    seed: int = 0
    """Random seed."""

    def __post_init__(self) -> None:
        require(self, AT_LEAST_ONE, "batch")
        require(self, POSITIVE, "checkpoint_minutes")


@dataclass(frozen=True, kw_only=True)
class ValidatedRunSettings(RunSettings):
    """Of runs that count updates and keep the weights that do best on tasks put aside."""

    iterations: int
    """Updates of the weights."""
    learning_rate: float = 1e-4
    """Learning rate of Adam."""
    validate_every: int = 500
    """Updates between validations."""
    validation_tasks: int = 300
    """Tasks of each validation."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self, AT_LEAST_ONE, "iterations", "validate_every", "validation_tasks")
        require(self, POSITIVE, "learning_rate")


@dataclass(frozen=True, kw_only=True)
class ImitationSettings(ValidatedRunSettings):
    """Of agents that look at features, imitate a teacher, and learn when to ask."""

    cooldown: float = 0.0
    """Share of the updates at the end over which the learning rate falls to zero (docs/sources.md, S32, S113)."""
    weight_decay: float = 5e-4
    """Weight decay, as in the authors' programs; the text does not mention it (docs/sources.md, S28)."""
    training_houses: int = 0
    """Train in this many of the data set's training houses; 0: in all."""
    environment_dropout: float = 0.0
    """Share of feature channels hidden for a whole training episode (Tan et al. 2019; docs/sources.md, S35, S113)."""
    instruction_length: int = 50
    """Longest instruction, words."""
    validation_tasks: int = 200
    """Tasks of each validation."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self, AT_LEAST_ONE, "instruction_length")
        require(self, NOT_NEGATIVE, "weight_decay", "training_houses")
        require(self, NOT_ALL, "environment_dropout")
        require(self, SHARE, "cooldown")


MAY_CHANGE = ("iterations", "cooldown", "checkpoint_minutes")
"""Of the settings of a run, those that may differ on resuming without changing what was learned so far."""


@dataclass(frozen=True, kw_only=True)
class EvaluationSettings:
    """How an agent that learns by imitation is evaluated, in validations too."""

    evaluation_temperature: float = 0.0
    """Sampling temperature of navigation actions in evaluation: 0 is greedy decoding, 1 samples from the distribution.
    A weak agent that decodes greedily walks in circles (docs/sources.md, S36)."""
    ask_threshold: float = 0.5
    """In evaluation, the learned rule asks where its probability of asking exceeds this."""

    def __post_init__(self) -> None:
        require(self, NOT_NEGATIVE, "evaluation_temperature")
        require(self, SHARE, "ask_threshold")


WEIGHTS = Path(__file__).resolve().parent.parent / "weights"
SHIPPED_ENCODER, SHIPPED_AGENT = WEIGHTS / "encoder.safetensors", WEIGHTS / "hanna_mini.safetensors"
SHIPPED_DETECTOR = WEIGHTS / "detector.safetensors"
"""Of the shipped encoder."""
SHIPPED_HARI = WEIGHTS / "hari_mini.safetensors"
SHIPPED_VNLA, SHIPPED_VLN = WEIGHTS / "vnla_mini.safetensors", WEIGHTS / "vln_mini.safetensors"
SHIPPED_STUDENT = WEIGHTS / "iliad_regex_tiny.safetensors"
SHIPPED_WALKER = WEIGHTS / "iliad_nav_mini.safetensors"
