"""Settings of REGEX: data, networks and the simulated teacher (3.2.4.3, C.1.2, Table C.2)."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.agents.common.settings import AT_LEAST_ONE, NOT_NEGATIVE, POSITIVE, Limit, require, require_word
from embodied.agents.iliad.config import LearnerConfig

TEACHERS = ("learned", "grammar")


@dataclass(frozen=True)
class RegexConfig:
    """The defaults are the dissertation's."""

    items: int = 114_503
    """Training examples, each with three requests."""
    held_out_items: int = 6_429
    """Examples for validation, and for testing, each with one request."""
    vocabulary: int = 8_000
    """Number of made-up words that rules are applied to."""
    examples: int = 5
    """Word pairs per example; a description must fit all of them (J, tau)."""
    hidden_size: int = 512
    """Width of all recurrent networks."""
    word_size: int = 128
    """Width of the embeddings of words of a request."""
    character_size: int = 32
    """Width of the embeddings of letters and of characters of a rule."""
    teacher: str = "learned"
    """Who describes: 'learned', a describer and an executor trained on the data (3.2.4.1), or 'grammar', the templates
    that word the requests."""
    candidates: int = 10
    """Number of candidate descriptions: the likeliest and sampled ones (Table C.2)."""
    unlabeled: int = 20_000
    """Number of unlabelled rules, drawn as those of requests are (docs/sources.md, S140)."""
    executor_iterations: int = 30_000
    """Updates of the teacher's executor."""
    describer_iterations: int = 40_000
    """Updates of the teacher's describer."""
    pretraining_iterations: int = 10_000
    """Updates of the student on unlabelled rules before it learns from descriptions; 0: none, as in the text."""
    teacher_batch: int = 256
    """Examples per update in training the teacher and in pre-training."""
    teacher_rate: float = 1e-3
    """Learning rate of the teacher and of pre-training."""
    data_seed: int = 0
    """Random seed of data and teacher, which all students share."""

    def __post_init__(self) -> None:
        require_word(self, "teacher", TEACHERS)
        require(self, POSITIVE, "teacher_rate")
        require(self, AT_LEAST_ONE, "items", "held_out_items", "examples", "hidden_size", "word_size")
        require(self, AT_LEAST_ONE, "character_size", "candidates", "unlabeled")
        require(self, AT_LEAST_ONE, "executor_iterations", "describer_iterations", "teacher_batch")
        require(self, NOT_NEGATIVE, "pretraining_iterations")
        require(self, Limit(lambda x: x >= 1000, "at least 1000"), "vocabulary")


REGEX_SCALES: dict[str, RegexConfig] = {
    "mini": RegexConfig(
        items=20_000,
        held_out_items=1_000,
        hidden_size=128,
        word_size=64,
        executor_iterations=4_000,
        describer_iterations=4_000,
        pretraining_iterations=1_500,
        teacher_batch=64,
        teacher_rate=2e-3,
    ),
    "tiny": RegexConfig(
        items=20_000,
        held_out_items=1_000,
        hidden_size=64,
        word_size=48,
        character_size=24,
        executor_iterations=3_000,
        describer_iterations=3_000,
        pretraining_iterations=500,
        teacher_batch=64,
        teacher_rate=4e-3,
    ),
    "paper": RegexConfig(),
}
LEARNER_SCALES: dict[str, LearnerConfig] = {
    "mini": LearnerConfig(iterations=6_000, learning_rate=2e-3, cooldown=0.3, validate_every=250),
    "tiny": LearnerConfig(iterations=2_000, learning_rate=3e-3, cooldown=0.3, validate_every=200),
    "paper": LearnerConfig(),
}
"""'tiny': minutes of one core for a learner; 'mini': an hour; 'paper': Table C.2, for a GPU."""
