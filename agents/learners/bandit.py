"""BANDIT: a translator that learns from ratings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from embodied.agents.bandit.config import BANDIT_SCALES, BanditConfig
from embodied.agents.learner import Learner, register_learner
from embodied.agents.options import TRAINING, Repeated, Scaled, StudyOptions, Tables, study_of
from embodied.options import InputFolder, InputPath, Settings

if TYPE_CHECKING:
    from embodied.agents.studies.engine import StudyLearner


@dataclass(frozen=True, kw_only=True)
class BanditStudyOptions(StudyOptions, Repeated, Scaled):
    """A translator that learns from ratings."""

    tables: Tables
    """Make these tables: 3.2, 3.5 or, with --rater, people."""
    data: InputFolder
    """The corpus, a folder that `embodied corpus` made."""
    rater: InputPath | None = None
    """Learn from ratings like people's, too: rater.json of `embodied dataset from-people`."""
    config: Annotated[BanditConfig, Settings(TRAINING, BANDIT_SCALES)]


def study(args: BanditStudyOptions) -> StudyLearner:
    from embodied.agents.bandit.ratings import Rater
    from embodied.agents.bandit.study import BanditStudy
    from embodied.records import load_json

    rater = load_json(args.rater, Rater) if args.rater else None
    return study_of(BanditStudy, args, rater=rater)


register_learner(Learner(name="bandit", study=(BanditStudyOptions, study)))
