"""Settings of ILIAD's learners, of REGEX and of NAV: networks and simulated teachers (3.2.4, appendix C, Table C.2).
Free of torch, so that the command line answers at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

from embodied.agents.common.settings import (
    AT_LEAST_ONE,
    NOT_ALL,
    NOT_NEGATIVE,
    POSITIVE,
    SHARE,
    Limit,
    RunSettings,
    require,
    require_word,
)

STUDENT_LEARNERS = ("adel", "dagger", "binary", "continuous")
"""ADEL (Algorithm 9), DAgger, and REINFORCE with a reward of success or of nearness."""


@dataclass(frozen=True, kw_only=True)
class LearnerConfig(RunSettings):
    """The defaults are those of the dissertation for REGEX."""

    learner: str = "adel"
    """Learning algorithm: adel (Algorithm 9), dagger, or REINFORCE with a binary or a continuous reward."""
    iterations: int = 30_000
    """Updates of the weights."""
    learning_rate: float = 1e-3
    """Learning rate of Adam; REINFORCE uses a tenth of it, as in the dissertation."""
    mixing: float = 0.5
    """Lambda: the weight of executions from the marginal (Algorithm 9)."""
    anneal_every: int = 0
    """Halve lambda after every so many updates; 0: never (L of Table C.1)."""
    least_mixing: float = 0.1
    """Smallest lambda of annealing."""
    entropy: float = 0.1
    """Weight of the entropy bonus in REINFORCE."""
    clip: float = 5.0
    """Largest gradient norm; the dissertation does not clip (docs/sources.md, S92)."""
    cooldown: float = 0.0
    """Share of the updates at the end over which the learning rate falls linearly to zero."""
    threshold: float = 0.85
    """Sample complexity is the number of training episodes until validation reaches this success (c of Table 3.4)."""
    validate_every: int = 500
    """Updates between validations."""
    checkpoint_minutes: float = 2.0

    def __post_init__(self) -> None:
        require_word(self, "learner", STUDENT_LEARNERS)
        super().__post_init__()
        require(self, AT_LEAST_ONE, "iterations", "validate_every")
        require(self, POSITIVE, "learning_rate", "clip")
        require(self, SHARE, "mixing", "least_mixing", "cooldown", "threshold")
        require(self, NOT_NEGATIVE, "anneal_every", "entropy")

    @property
    def rate(self) -> float:
        """Adam's learning rate for this learner."""
        return self.learning_rate * (0.1 if self.learner in ("binary", "continuous") else 1.0)


def mixing_at(config: LearnerConfig, update: int) -> float:
    """Lambda at an update: max(least, lambda beta) every L updates (Table C.1), or constant; beta is a half."""
    if not config.anneal_every:
        return config.mixing
    return max(config.least_mixing, config.mixing * 0.5 ** (update // config.anneal_every))


TEACHERS = ("learned", "grammar")


@dataclass(frozen=True)
class TeacherConfig:
    """Of the simulated teacher of a world; the defaults are the dissertation's for REGEX."""

    hidden_size: int = 512
    """Width of all networks."""
    teacher: str = "learned"
    """Who describes: 'learned', a describer and an executor trained on the data (3.2.4.1), or 'grammar', the templates
    that word the requests, or the routes of data sets."""
    candidates: int = 10
    """Number of candidate descriptions: the likeliest and sampled ones (Table C.2); in NAV the first that leads the
    executor to the end of the walk is given (docs/sources.md, S93, S141)."""
    executor_iterations: int = 30_000
    """Updates of the teacher's executor."""
    describer_iterations: int = 40_000
    """Updates of the teacher's describer."""
    teacher_batch: int = 256
    """Examples, or routes, per update of the teacher's networks, and in pre-training."""
    teacher_rate: float = 1e-3
    """Learning rate of the teacher's networks and of pre-training."""
    data_seed: int = 0
    """Random seed of data, further paths and teacher, which all students share."""

    def __post_init__(self) -> None:
        require_word(self, "teacher", TEACHERS)
        require(self, POSITIVE, "teacher_rate")
        require(self, AT_LEAST_ONE, "hidden_size", "candidates", "teacher_batch")
        require(self, AT_LEAST_ONE, "executor_iterations", "describer_iterations")


@dataclass(frozen=True)
class RegexConfig(TeacherConfig):
    """The defaults are the dissertation's."""

    items: int = 114_503
    """Training examples, each with three requests."""
    held_out_items: int = 6_429
    """Examples for validation, and for testing, each with one request."""
    vocabulary: int = 8_000
    """Number of made-up words that rules are applied to."""
    examples: int = 5
    """Word pairs per example; a description must fit all of them (J, tau)."""
    word_size: int = 128
    """Width of the embeddings of words of a request."""
    character_size: int = 32
    """Width of the embeddings of letters and of characters of a rule."""
    unlabeled: int = 20_000
    """Number of unlabelled rules, drawn as those of requests are (docs/sources.md, S140)."""
    pretraining_iterations: int = 10_000
    """Updates of the student on unlabelled rules before it learns from descriptions; 0: none, as in the text."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self, AT_LEAST_ONE, "items", "held_out_items", "examples", "word_size", "character_size", "unlabeled")
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


@dataclass(frozen=True)
class NavConfig(TeacherConfig):
    """The defaults are the dissertation's."""

    hidden_size: int = 256
    candidates: int = 5
    executor_iterations: int = 20_000
    describer_iterations: int = 20_000
    teacher_batch: int = 32
    teacher_rate: float = 1e-4
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
    more_paths: int = 0
    """Additional paths per training house, each worded three times."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self, AT_LEAST_ONE, "heads")
        require(self, NOT_NEGATIVE, "more_paths", "progress_weight", "room_weight")
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
