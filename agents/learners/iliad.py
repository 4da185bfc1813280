"""ILIAD: students that learn to do what a request says from descriptions of what they did."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from embodied.agents.iliad.config import LearnerConfig, folder_name
from embodied.agents.iliad.nav.config import NAV_LEARNER_SCALES, NAV_SCALES, NavConfig
from embodied.agents.iliad.regex.config import LEARNER_SCALES, REGEX_SCALES, RegexConfig, students_of
from embodied.agents.iliad.show import ShowOptions, show
from embodied.agents.learner import Learner, register_learner
from embodied.agents.options import SMALL_SCALE, Nav, Repeated, StudyOptions, Tables, Threaded, Timed, study_of
from embodied.options import InputFolder, InputPath, OutputFolder, Settings

if TYPE_CHECKING:
    from embodied.agents.common.session import Note
    from embodied.agents.studies.engine import StudyLearner

STUDENT, WORLD = "settings of the student's training", "settings of data and teacher"
OF_ROWS = ("learner", "mixing", "anneal_every")
"""Settings that the rows of ILIAD's tables decide."""


@dataclass(frozen=True, kw_only=True)
class IliadTraining(Timed, Threaded):
    out: OutputFolder
    """Folder for data, teacher and students; rerun the command to resume."""
    scale: Annotated[str, SMALL_SCALE] = "mini"
    """The settings to start from."""


@dataclass(frozen=True, kw_only=True)
class RegexFiles:
    words: InputPath | None = None
    """REGEX: a file with one word per line (default: made-up words)."""
    templates: InputPath | None = None
    """REGEX: a JSON file with your own requests: rule -> texts with BEFORE and AFTER (default: the grammar's)."""


@dataclass(frozen=True, kw_only=True)
class RegexTraining(IliadTraining, RegexFiles):
    """Change words as a request says, by regular expressions."""

    learner: Annotated[LearnerConfig, Settings(STUDENT, LEARNER_SCALES)]
    world: Annotated[RegexConfig, Settings(WORLD, REGEX_SCALES)]


@dataclass(frozen=True, kw_only=True)
class NavTraining(IliadTraining, Nav):
    """Follow routes through houses, on a `vln` or `hanna` data set with features."""

    data: InputFolder
    learner: Annotated[LearnerConfig, Settings(STUDENT, NAV_LEARNER_SCALES)]
    world: Annotated[NavConfig, Settings(WORLD, NAV_SCALES)]


@dataclass(frozen=True, kw_only=True)
class IliadStudyOptions(StudyOptions, Repeated):
    tables: Tables
    """Make these tables: 3.4, 3.5, C.1, 'figure 3.7' or algorithms; in NAV also words and speakers."""
    scale: Annotated[str, SMALL_SCALE] = "mini"
    """The settings to start from."""


@dataclass(frozen=True, kw_only=True)
class RegexStudyOptions(IliadStudyOptions, RegexFiles):
    """Students that learn to change words from descriptions."""

    config: Annotated[LearnerConfig, Settings(STUDENT, LEARNER_SCALES, skip=OF_ROWS)]
    world: Annotated[RegexConfig, Settings(WORLD, REGEX_SCALES)]


@dataclass(frozen=True, kw_only=True)
class NavStudyOptions(IliadStudyOptions, Nav):
    """Students that learn to follow routes from descriptions."""

    data: InputFolder
    config: Annotated[LearnerConfig, Settings(STUDENT, NAV_LEARNER_SCALES, skip=OF_ROWS)]
    world: Annotated[NavConfig, Settings(WORLD, NAV_SCALES, skip=("blind",))]


def regex(args: RegexTraining, *, note: Note) -> None:
    from embodied.agents.iliad.regex.run import learn, prepare

    world, learner = args.world, args.learner
    grounds = prepare(world, args.out / "shared", words=args.words, templates=args.templates, note=note)
    home = args.out / "students" / students_of(world) / f"seed_{learner.seed}"
    learn(grounds, learner, home / folder_name(learner), home / "pretraining", minutes=args.minutes, note=note)


def nav(args: NavTraining, *, note: Note) -> None:
    from embodied.agents.iliad.nav.run import NavSource, learn, prepare

    world, learner = args.world, args.learner
    source = NavSource(args.data, args.encoder_digest(), args.pictures, args.cache)
    grounds = prepare(world, source, args.out / "shared", note=note)
    home = args.out / "students" / world.teacher / f"seed_{learner.seed}" / folder_name(learner)
    learn(grounds, learner, home, minutes=args.minutes, note=note)


def regex_study(args: RegexStudyOptions) -> StudyLearner:
    from embodied.agents.iliad.study import IliadStudy, RegexStudyWorld

    return study_of(IliadStudy, args, world=RegexStudyWorld(args.world, args.words, args.templates))


def nav_study(args: NavStudyOptions) -> StudyLearner:
    from embodied.agents.iliad.nav.run import NavSource
    from embodied.agents.iliad.study import IliadStudy, NavStudyWorld

    source = NavSource(args.data, args.encoder_digest(), args.pictures, args.cache)
    return study_of(IliadStudy, args, world=NavStudyWorld(args.world, source))


register_learner(
    Learner(
        name="iliad",
        train=(
            "A student that learns to do what a request says from descriptions (ADEL), demonstrations or rewards.",
            {"regex": (RegexTraining, regex), "nav": (NavTraining, nav)},
        ),
        study=(
            "Students that learn from descriptions of what they did.",
            {"regex": (RegexStudyOptions, regex_study), "nav": (NavStudyOptions, nav_study)},
        ),
        show=(ShowOptions, show),
    )
)
