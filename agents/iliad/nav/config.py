"""Settings of NAV: networks and the simulated teacher (3.2.4.2, C.1.1, Table C.2)."""

from __future__ import annotations

from dataclasses import dataclass

from agents.common.settings import LEARNED_WORDS, WORD_VECTORS, require_word
from agents.iliad.config import LearnerConfig

TEACHERS = ("learned", "grammar")
PRAGMATICS = ("program", "text")


@dataclass(frozen=True)
class NavConfig:
    """The defaults are the dissertation's."""

    hidden_size: int = 256
    """Width of all networks."""
    heads: int = 8
    """Attention heads."""
    teacher: str = "learned"
    """Who describes: 'learned', a describer and an executor trained on the data (3.2.4.1), or 'grammar', the templates
    that word the routes of data sets."""
    pragmatics: str = "program"
    """How a candidate description is chosen: by Eq 3.15 and 3.16 ('text'), or the first that leads the executor to the
    end of the walk ('program'; docs/sources.md, S93, S141)."""
    candidates: int = 5
    """Number of candidate descriptions: the likeliest and sampled ones (Table C.2)."""
    executor_iterations: int = 20_000
    """Updates of the teacher's executor."""
    describer_iterations: int = 20_000
    """Updates of the teacher's describer."""
    teacher_batch: int = 32
    """Routes per update of the teacher's networks."""
    teacher_rate: float = 1e-4
    """Learning rate of the teacher's networks."""
    held_out: float = 0.2
    """Share of the paths of training houses held out for validation."""
    more_paths: int = 0
    """Additional paths per training house, each worded three times."""
    word_vectors: str = LEARNED_WORDS
    """What followers know of words: 'learned' alone, or 'minilm', pre-trained vectors besides."""
    data_seed: int = 0
    """Random seed of the held-out paths and of the teacher, which all students share."""

    def __post_init__(self) -> None:
        if self.teacher not in TEACHERS:
            raise ValueError(f"teacher must be one of {TEACHERS}, got {self.teacher!r}")
        require_word(self, "word_vectors", WORD_VECTORS)
        if self.pragmatics not in PRAGMATICS:
            raise ValueError(f"pragmatics must be one of {PRAGMATICS}, got {self.pragmatics!r}")
        for name in ("hidden_size", "heads", "executor_iterations", "describer_iterations", "teacher_batch"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        if self.hidden_size % self.heads:
            raise ValueError(f"hidden_size {self.hidden_size} must be a multiple of heads {self.heads}")
        if self.candidates < 1 or self.more_paths < 0 or not self.teacher_rate > 0 or not 0 < self.held_out < 1:
            raise ValueError(
                f"candidates {self.candidates} must be at least 1, more_paths {self.more_paths} not negative, "
                f"teacher_rate {self.teacher_rate} above 0, "
                f"held_out {self.held_out} between 0 and 1"
            )


NAV_SCALES: dict[str, NavConfig] = {
    "mini": NavConfig(
        hidden_size=128, heads=4, executor_iterations=4_000, describer_iterations=6_000, teacher_rate=5e-4
    ),
    "tiny": NavConfig(hidden_size=64, heads=4, executor_iterations=600, describer_iterations=1_500, teacher_rate=2e-3),
    "paper": NavConfig(),
}
NAV_LEARNER_SCALES: dict[str, LearnerConfig] = {
    "mini": LearnerConfig(iterations=8_000, learning_rate=5e-4, cooldown=0.3, threshold=0.3, validate_every=250),
    "tiny": LearnerConfig(iterations=1_000, learning_rate=2e-3, cooldown=0.3, threshold=0.3, validate_every=50),
    "paper": LearnerConfig(iterations=25_000, learning_rate=1e-4, threshold=0.3),
}
"""'tiny': minutes of one core for a learner; 'mini': an hour; 'paper': Table C.2, for a GPU."""
