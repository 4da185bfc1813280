"""Agents that find things without help, with sight and without: `embodied study find`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from embodied.agents.find.config import FinderConfig
from embodied.agents.learner import Learner, register_learner
from embodied.agents.options import TRAINING, Encoded, Repeated, StudyOptions, WithData, study_by
from embodied.options import Count, Settings


@dataclass(frozen=True, kw_only=True)
class FindStudyOptions(StudyOptions, Repeated, WithData, Encoded):
    """Agents that find things without help, with sight and without."""

    house_tasks: Count = 50
    """Evaluate on at most N tasks of each unseen house."""
    config: Annotated[FinderConfig, Settings(TRAINING, FinderConfig(), skip=("instruction_length",))]


register_learner(Learner(name="find", study=(FindStudyOptions, study_by("embodied.agents.find.study:FindStudy"))))
