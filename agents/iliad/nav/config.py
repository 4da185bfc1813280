"""Settings of NAV: networks and the simulated teacher (3.2.4.2, C.1.1, Table C.2)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from embodied.agents.common.settings import (
    AT_LEAST_ONE,
    LEARNED_WORDS,
    NOT_ALL,
    NOT_NEGATIVE,
    POSITIVE,
    SHARE,
    WORD_VECTORS,
    require,
    require_word,
)
from embodied.agents.iliad.config import LearnerConfig

TEACHERS = ("learned", "grammar")


@dataclass(frozen=True)
class NavConfig:
    """The defaults are the dissertation's."""

    hidden_size: int = 256
    """Width of all networks."""
    heads: int = 8
    """Attention heads of the describer."""
    dropout: float = 0.0
    """Dropout rate of followers in training."""
    environment_dropout: float = 0.0
    """Share of feature channels hidden from a follower for a whole training episode (Tan et al. 2019)."""
    progress_weight: float = 0.0
    """Weight of a follower's second loss: to guess which share of the way is left (Ma et al. 2019)."""
    room_weight: float = 0.0
    """Weight of a follower's third loss: to name the kinds of the current room and of those ahead."""
    guided: float = 0.0
    """DAgger, and the teacher's executor: share of training steps that the demonstrator takes (Ross et al. 2011)."""
    blind: bool = False
    """Ablation without vision: all features are zero to the student."""
    teacher: str = "learned"
    """Who describes: 'learned', a describer and an executor trained on the data (3.2.4.1), or 'grammar', the templates
    that word the routes of data sets."""
    candidates: int = 5
    """Number of candidate descriptions: the likeliest and sampled ones (Table C.2); the first that leads the executor
    to the end of the walk is given (docs/sources.md, S93, S141)."""
    executor_iterations: int = 20_000
    """Updates of the teacher's executor."""
    describer_iterations: int = 20_000
    """Updates of the teacher's describer."""
    teacher_batch: int = 32
    """Routes per update of the teacher's networks."""
    teacher_rate: float = 1e-4
    """Learning rate of the teacher's networks."""
    more_paths: int = 0
    """Additional paths per training house, each worded three times."""
    word_vectors: str = LEARNED_WORDS
    """Word embeddings: 'learned', or 'minilm', pre-trained vectors in addition."""
    data_seed: int = 0
    """Random seed of the further paths and of the teacher, which all students share."""

    def __post_init__(self) -> None:
        require_word(self, "teacher", TEACHERS)
        require_word(self, "word_vectors", WORD_VECTORS)
        require(self, AT_LEAST_ONE, "hidden_size", "heads", "candidates")
        require(self, AT_LEAST_ONE, "executor_iterations", "describer_iterations", "teacher_batch")
        require(self, NOT_NEGATIVE, "more_paths", "progress_weight", "room_weight")
        require(self, POSITIVE, "teacher_rate")
        require(self, NOT_ALL, "dropout", "environment_dropout")
        require(self, SHARE, "guided")
        if self.hidden_size % self.heads:
            raise ValueError(f"hidden_size {self.hidden_size} must be a multiple of heads {self.heads}")


FOLLOWER = NavConfig(dropout=0.2, environment_dropout=0.3, progress_weight=0.5, room_weight=0.5, guided=0.5)
"""As of VLN's follower (embodied.agents.vln.config)."""
NAV_SCALES: dict[str, NavConfig] = {
    "mini": replace(
        FOLLOWER,
        hidden_size=128,
        heads=4,
        executor_iterations=4_000,
        describer_iterations=6_000,
        teacher_rate=1e-3,
        more_paths=64,
    ),
    "tiny": replace(
        FOLLOWER, hidden_size=64, heads=4, executor_iterations=600, describer_iterations=1_500, teacher_rate=2e-3
    ),
    "paper": NavConfig(),
}
NAV_LEARNER_SCALES: dict[str, LearnerConfig] = {
    "mini": LearnerConfig(iterations=4_000, learning_rate=1e-3, cooldown=0.4, threshold=0.2, validate_every=250),
    "tiny": LearnerConfig(iterations=1_000, learning_rate=2e-3, cooldown=0.3, threshold=0.3, validate_every=50),
    "paper": LearnerConfig(iterations=25_000, learning_rate=1e-4, threshold=0.3),
}
"""'tiny': minutes of one core for a learner; 'mini': an hour; 'paper': Table C.2, for a GPU."""
