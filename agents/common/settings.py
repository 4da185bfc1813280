"""Settings that all learners share, checks of settings, and paths of the weights that ship with this repository.
Free of torch, so that --help answers at once.

A learner's settings are a frozen record over one of these; a field that stands there again has a default of its own.
agents/weights/README.md says how the weights were made.
"""

from __future__ import annotations

import dataclasses
import math
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from embodied.assets.json_file import read_toml
from embodied.options import Option

C = typing.TypeVar("C")


@dataclass(frozen=True, eq=False)  # annotations are hashed
class Limit:
    """A condition on a number, as metadata of its annotation, and that in words: 'must be <words>'."""

    holds: Callable[[float], bool]
    """Of NaN nothing does."""
    words: str


AtLeastOne = Annotated[int, Limit(lambda x: x >= 1, "at least 1")]
NOT_NEGATIVE = Limit(lambda x: 0 <= x < math.inf, "at least 0 and finite")
Whole = Annotated[int, NOT_NEGATIVE]
NotNegative = Annotated[float, NOT_NEGATIVE]
Positive = Annotated[float, Limit(lambda x: 0 < x < math.inf, "positive and finite")]
Share = Annotated[float, Limit(lambda x: 0 <= x <= 1, "in [0, 1]")]
NotAll = Annotated[float, Limit(lambda x: 0 <= x < 1, "in [0, 1)")]


@dataclass(frozen=True)
class Checked:
    """Settings whose annotations say what they may be: a Limit, or the words of an Option."""

    def __post_init__(self) -> None:
        """
        Raises:
          ValueError: a field does not hold what it should; names it and its value.
        """
        hints = typing.get_type_hints(type(self), include_extras=True)
        for name in (f.name for f in dataclasses.fields(self)):
            value = getattr(self, name)
            for how in getattr(hints[name], "__metadata__", ()):
                if isinstance(how, Limit) and not how.holds(value):
                    raise ValueError(f"{name} must be {how.words}, got {value}")
                if isinstance(how, Option) and how.words and value not in how.words:
                    raise ValueError(f"{name} must be one of {tuple(how.words)}, got {value!r}")


@dataclass(frozen=True, kw_only=True)
class RunSettings(Checked):
    """Of every run that learns and can be interrupted."""

    batch: AtLeastOne = 32
    """Episodes per update."""
    checkpoint_minutes: Positive = 3.0
    """Minutes between checkpoints, from which an interrupted run resumes."""
    seed: int = 0
    """Random seed."""


@dataclass(frozen=True, kw_only=True)
class ValidatedRunSettings(RunSettings):
    """Of runs that count updates and keep the weights that do best on tasks put aside."""

    iterations: AtLeastOne
    """Updates of the weights."""
    learning_rate: Positive = 1e-4
    """Learning rate of Adam."""
    validate_every: AtLeastOne = 500
    """Updates between validations."""
    validation_tasks: AtLeastOne = 300
    """Tasks of each validation."""


@dataclass(frozen=True, kw_only=True)
class ImitationSettings(ValidatedRunSettings):
    """Of agents that look at features, imitate a teacher, and learn when to ask."""

    cooldown: Share = 0.0
    """Share of the updates at the end over which the learning rate falls to zero (docs/sources.md, S32, S113)."""
    weight_decay: NotNegative = 5e-4
    """Weight decay, as in the authors' programs; the text does not mention it (docs/sources.md, S28)."""
    training_houses: Whole = 0
    """Train in this many of the data set's training houses; 0: in all."""
    environment_dropout: NotAll = 0.0
    """Share of feature channels hidden for a whole training episode (Tan et al. 2019; docs/sources.md, S35, S113)."""
    instruction_length: AtLeastOne = 50
    """Longest instruction, words."""
    validation_tasks: AtLeastOne = 200
    hidden_size: AtLeastOne = 256
    """Width of the networks."""
    dropout: NotAll = 0.3
    """Dropout rate in training, of features and hidden units."""


@dataclass(frozen=True, kw_only=True)
class SightedSettings(ImitationSettings):
    """Of agents that learn in a data set of tasks, as SightedLearner trains them."""

    start: str = ""
    """Weights of such an agent to start from, with its words: a file, or 'shipped'."""
    closed_doors: Share = 0.0
    """Close each door with this probability at the start of every training task; moves open doors and go through."""


def scales(kind: type[C], name: str) -> Mapping[str, C]:
    """Settings by --scale, as scales.toml beside this file has them under a name; the defaults are the paper's."""
    changes = {"paper": {}, **read_toml(Path(__file__).with_name("scales.toml"))[name]}
    return {scale: kind(**changed) for scale, changed in changes.items()}


@dataclass(frozen=True, kw_only=True)
class EvaluationSettings(Checked):
    """How an agent that learns by imitation is evaluated, in validations too."""

    evaluation_temperature: NotNegative = 0.0
    """Sampling temperature of navigation actions in evaluation: 0 is greedy decoding, 1 samples from the distribution.
    A weak agent that decodes greedily walks in circles (docs/sources.md, S36)."""
    ask_threshold: Share = 0.5
    """In evaluation, the learned rule asks where its probability of asking exceeds this."""


WEIGHTS = Path(__file__).resolve().parent.parent / "weights"
SHIPPED_ENCODER, SHIPPED_AGENT = WEIGHTS / "encoder.safetensors", WEIGHTS / "hanna_mini.safetensors"
SHIPPED_DETECTOR = WEIGHTS / "detector.safetensors"
"""Of the shipped encoder."""
SHIPPED_HARI = WEIGHTS / "hari_mini.safetensors"
SHIPPED_VNLA, SHIPPED_VLN = WEIGHTS / "vnla_mini.safetensors", WEIGHTS / "vln_mini.safetensors"
SHIPPED_STUDENT = WEIGHTS / "iliad_regex_tiny.safetensors"
SHIPPED_WALKER = WEIGHTS / "iliad_nav_mini.safetensors"
