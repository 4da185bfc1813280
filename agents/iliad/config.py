"""Settings of ILIAD's learners, of REGEX and of NAV: networks and simulated teachers (3.2.4, appendix C, Table C.2).
Free of torch, so that the command line answers at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from embodied.agents.common import settings
from embodied.options import Option

STUDENT_LEARNERS = ("adel", "dagger", "binary", "continuous")
"""ADEL (Algorithm 9), DAgger, and REINFORCE with a reward of success or of nearness."""


@dataclass(frozen=True, kw_only=True)
class LearnerConfig(settings.RunSettings):
    """The defaults are those of the dissertation for REGEX."""

    learner: Annotated[str, Option(words=STUDENT_LEARNERS)] = "adel"
    """Learning algorithm: adel (Algorithm 9), dagger, or REINFORCE with a binary or a continuous reward."""
    iterations: settings.AtLeastOne = 30_000
    """Updates of the weights."""
    learning_rate: settings.Positive = 1e-3
    """Learning rate of Adam; REINFORCE uses a tenth of it, as in the dissertation."""
    mixing: settings.Share = 0.5
    """Lambda: the weight of executions from the marginal (Algorithm 9)."""
    anneal_every: settings.Whole = 0
    """Halve lambda after every so many updates; 0: never (L of Table C.1)."""
    least_mixing: settings.Share = 0.1
    """Smallest lambda of annealing."""
    entropy: settings.NotNegative = 0.1
    """Weight of the entropy bonus in REINFORCE."""
    clip: settings.Positive = 5.0
    """Largest gradient norm; the dissertation does not clip (docs/sources.md, S92)."""
    cooldown: settings.Share = 0.0
    """Share of the updates at the end over which the learning rate falls linearly to zero."""
    threshold: settings.Share = 0.85
    """Sample complexity is the number of training episodes until validation reaches this success (c of Table 3.4)."""
    validate_every: settings.AtLeastOne = 500
    """Updates between validations."""
    checkpoint_minutes: settings.Positive = 2.0

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
class TeacherConfig(settings.Checked):
    """Of the simulated teacher of a world; the defaults are the dissertation's for REGEX."""

    hidden_size: settings.AtLeastOne = 512
    """Width of all networks."""
    teacher: Annotated[str, Option(words=TEACHERS)] = "learned"
    """Who describes: 'learned', a describer and an executor trained on the data (3.2.4.1), or 'grammar', the templates
    that word the requests, or the routes of data sets."""
    candidates: settings.AtLeastOne = 10
    """Number of candidate descriptions: the likeliest and sampled ones (Table C.2); in NAV the first that leads the
    executor to the end of the walk is given (docs/sources.md, S93, S141)."""
    executor_iterations: settings.AtLeastOne = 30_000
    """Updates of the teacher's executor."""
    describer_iterations: settings.AtLeastOne = 40_000
    """Updates of the teacher's describer."""
    teacher_batch: settings.AtLeastOne = 256
    """Examples, or routes, per update of the teacher's networks, and in pre-training."""
    teacher_rate: settings.Positive = 1e-3
    """Learning rate of the teacher's networks and of pre-training."""
    data_seed: int = 0
    """Random seed of data, further paths and teacher, which all students share."""


@dataclass(frozen=True)
class RegexConfig(TeacherConfig):
    """The defaults are the dissertation's."""

    items: settings.AtLeastOne = 114_503
    """Training examples, each with three requests."""
    held_out_items: settings.AtLeastOne = 6_429
    """Examples for validation, and for testing, each with one request."""
    vocabulary: Annotated[int, settings.Limit(lambda x: x >= 1000, "at least 1000")] = 8_000
    """Number of made-up words that rules are applied to."""
    examples: settings.AtLeastOne = 5
    """Word pairs per example; a description must fit all of them (J, tau)."""
    word_size: settings.AtLeastOne = 128
    """Width of the embeddings of words of a request."""
    character_size: settings.AtLeastOne = 32
    """Width of the embeddings of letters and of characters of a rule."""
    unlabeled: settings.AtLeastOne = 20_000
    """Number of unlabelled rules, drawn as those of requests are (docs/sources.md, S140)."""
    pretraining_iterations: settings.Whole = 10_000
    """Updates of the student on unlabelled rules before it learns from descriptions; 0: none, as in the text."""


REGEX_SCALES = settings.scales(RegexConfig, "iliad-regex")
LEARNER_SCALES = settings.scales(LearnerConfig, "iliad-regex-student")
"""'tiny': minutes of one core for a learner; 'mini': an hour; 'paper': Table C.2, for a GPU."""


@dataclass(frozen=True)
class NavConfig(TeacherConfig):
    """The defaults are the dissertation's."""

    hidden_size: settings.AtLeastOne = 256
    candidates: settings.AtLeastOne = 5
    executor_iterations: settings.AtLeastOne = 20_000
    describer_iterations: settings.AtLeastOne = 20_000
    teacher_batch: settings.AtLeastOne = 32
    teacher_rate: settings.Positive = 1e-4
    heads: settings.AtLeastOne = 8
    """Attention heads of the describer."""
    dropout: settings.NotAll = 0.0
    """Dropout rate of followers in training."""
    environment_dropout: settings.NotAll = 0.0
    """Share of feature channels hidden from a follower for a whole training episode (Tan et al. 2019)."""
    progress_weight: settings.NotNegative = 0.0
    """Weight of a follower's second loss: to guess which share of the way is left (Ma et al. 2019)."""
    room_weight: settings.NotNegative = 0.0
    """Weight of a follower's third loss: to name the kinds of the current room and of those ahead."""
    guided: settings.Share = 0.0
    """DAgger, and the teacher's executor: share of training steps that the demonstrator takes (Ross et al. 2011)."""
    blind: bool = False
    """Ablation without vision: all features are zero to the student."""
    more_paths: settings.Whole = 0
    """Additional paths per training house, each worded three times."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.hidden_size % self.heads:
            raise ValueError(f"hidden_size {self.hidden_size} must be a multiple of heads {self.heads}")


NAV_SCALES = settings.scales(NavConfig, "iliad-nav")
NAV_LEARNER_SCALES = settings.scales(LearnerConfig, "iliad-nav-student")
"""'tiny': minutes of one core for a learner; 'mini': an hour; 'paper': Table C.2, for a GPU."""
