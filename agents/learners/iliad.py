"""ILIAD: students that learn to do what a request says from descriptions of what they did. Settings of learners, of
REGEX and of NAV, networks and simulated teachers (3.2.4, appendix C, Table C.2); and commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from embodied.agents.common import settings
from embodied.agents.learner import Learner, register_learner
from embodied.agents.options import Nav, Repeated, ScaledDown, StudyOptions, Tables, Threaded, Timed, study_of
from embodied.options import Option, OutputFolder, Settings

if TYPE_CHECKING:
    from embodied.agents.common.session import Note
    from embodied.agents.iliad.nav.run import NavSetup
    from embodied.agents.iliad.regex.run import RegexSetup
    from embodied.agents.studies.engine import StudyLearner

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


STUDENT, WORLD = "settings of the student's training", "settings of data and teacher"
OF_ROWS = ("learner", "mixing", "anneal_every")
"""Settings that the rows of ILIAD's tables decide."""


@dataclass(frozen=True, kw_only=True)
class IliadTraining(Timed, Threaded, ScaledDown):
    out: OutputFolder
    """Folder for data, teacher and students; rerun the command to resume."""


@dataclass(frozen=True, kw_only=True)
class RegexTraining(IliadTraining):
    """Change words as a request says, by regular expressions."""

    learner: Annotated[LearnerConfig, Settings(STUDENT, LEARNER_SCALES)]
    world: Annotated[RegexConfig, Settings(WORLD, REGEX_SCALES)]


@dataclass(frozen=True, kw_only=True)
class NavTraining(IliadTraining, Nav):
    """Follow routes through houses, on a `vln` or `hanna` data set with features."""

    learner: Annotated[LearnerConfig, Settings(STUDENT, NAV_LEARNER_SCALES)]
    world: Annotated[NavConfig, Settings(WORLD, NAV_SCALES)]


@dataclass(frozen=True, kw_only=True)
class IliadStudyOptions(StudyOptions, Repeated, ScaledDown):
    tables: Tables
    """Make these tables: 3.4, 3.5, C.1 or 'figure 3.7'."""


@dataclass(frozen=True, kw_only=True)
class RegexStudyOptions(IliadStudyOptions):
    """Students that learn to change words from descriptions."""

    config: Annotated[LearnerConfig, Settings(STUDENT, LEARNER_SCALES, skip=OF_ROWS)]
    world: Annotated[RegexConfig, Settings(WORLD, REGEX_SCALES)]


@dataclass(frozen=True, kw_only=True)
class NavStudyOptions(IliadStudyOptions, Nav):
    """Students that learn to follow routes from descriptions."""

    config: Annotated[LearnerConfig, Settings(STUDENT, NAV_LEARNER_SCALES, skip=OF_ROWS)]
    world: Annotated[NavConfig, Settings(WORLD, NAV_SCALES, skip=("blind",))]


def regex_setup(args: RegexTraining | RegexStudyOptions) -> RegexSetup:
    from embodied.agents.iliad.regex.run import RegexSetup

    return RegexSetup(args.world)


def nav_setup(args: NavTraining | NavStudyOptions) -> NavSetup:
    from embodied.agents.iliad.nav.run import NavSetup
    from embodied.agents.vision.encoder import load_encoder

    return NavSetup(args.world, args.data, load_encoder(args.encoder).digest, args.pictures, args.cache)


def train(setup_of: Callable[..., Any], args: Any, *, note: Note) -> None:
    """Make data and teacher in --out, and a student of them."""
    from embodied.agents.iliad.training import train

    learner, shared = args.learner, args.out / "shared"
    problem = setup_of(args).prepare(shared, note).problem(learner.seed, shared / f"seed_{learner.seed}", note)
    home = args.out / f"{learner.learner}_{learner.mixing:g}" / f"seed_{learner.seed}"
    train(problem, learner, home, minutes=args.minutes, note=note)


def study(setup_of: Callable[..., Any], args: Any) -> StudyLearner:
    from embodied.agents.iliad.study import IliadStudy

    return study_of(IliadStudy, args, setup=setup_of(args))


register_learner(
    Learner(
        name="iliad",
        train=(
            "A student that learns to do what a request says from descriptions (ADEL), demonstrations or rewards.",
            {"regex": (RegexTraining, partial(train, regex_setup)), "nav": (NavTraining, partial(train, nav_setup))},
        ),
        study=(
            "Students that learn from descriptions of what they did.",
            {
                "regex": (RegexStudyOptions, partial(study, regex_setup)),
                "nav": (NavStudyOptions, partial(study, nav_setup)),
            },
        ),
    )
)
