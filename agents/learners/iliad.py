"""ILIAD: students that learn to do what a request says from descriptions of what they did."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from embodied.agents.iliad import config as iliad
from embodied.agents.learner import Learner, register_learner
from embodied.agents.options import Nav, Repeated, ScaledDown, StudyOptions, Tables, Threaded, Timed, study_of
from embodied.options import OutputFolder, Settings

if TYPE_CHECKING:
    from embodied.agents.common.session import Note
    from embodied.agents.iliad.nav.run import NavSetup
    from embodied.agents.iliad.regex.run import RegexSetup
    from embodied.agents.studies.engine import StudyLearner

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

    learner: Annotated[iliad.LearnerConfig, Settings(STUDENT, iliad.LEARNER_SCALES)]
    world: Annotated[iliad.RegexConfig, Settings(WORLD, iliad.REGEX_SCALES)]


@dataclass(frozen=True, kw_only=True)
class NavTraining(IliadTraining, Nav):
    """Follow routes through houses, on a `vln` or `hanna` data set with features."""

    learner: Annotated[iliad.LearnerConfig, Settings(STUDENT, iliad.NAV_LEARNER_SCALES)]
    world: Annotated[iliad.NavConfig, Settings(WORLD, iliad.NAV_SCALES)]


@dataclass(frozen=True, kw_only=True)
class IliadStudyOptions(StudyOptions, Repeated, ScaledDown):
    tables: Tables
    """Make these tables: 3.4, 3.5, C.1 or 'figure 3.7'."""


@dataclass(frozen=True, kw_only=True)
class RegexStudyOptions(IliadStudyOptions):
    """Students that learn to change words from descriptions."""

    config: Annotated[iliad.LearnerConfig, Settings(STUDENT, iliad.LEARNER_SCALES, skip=OF_ROWS)]
    world: Annotated[iliad.RegexConfig, Settings(WORLD, iliad.REGEX_SCALES)]


@dataclass(frozen=True, kw_only=True)
class NavStudyOptions(IliadStudyOptions, Nav):
    """Students that learn to follow routes from descriptions."""

    config: Annotated[iliad.LearnerConfig, Settings(STUDENT, iliad.NAV_LEARNER_SCALES, skip=OF_ROWS)]
    world: Annotated[iliad.NavConfig, Settings(WORLD, iliad.NAV_SCALES, skip=("blind",))]


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
