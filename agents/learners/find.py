"""Agents that find things without help, with sight and without: their settings, and `embodied study find`."""

from dataclasses import dataclass
from typing import Annotated

from embodied.agents.common.settings import AtLeastOne, ImitationSettings, Positive, Share
from embodied.agents.learner import Learner, register_learner
from embodied.agents.options import TRAINING, Encoded, Repeated, StudyOptions, WithData, study_by
from embodied.options import Count, Option, Settings

SEES_WHAT = ("all", "map", "nothing")
THINGS = (
    *("bed", "dining chair", "potted plant", "sofa", "television", "toilet"),
    *("bathtub", "cooker", "desk", "fridge", "wardrobe", "washing machine"),
)
"""Classes that are looked for: the six categories of Habitat's ObjectNav challenge of 2022 and six more of its kind."""
AGENTS = ("network", "detector")


@dataclass(frozen=True, kw_only=True)
class FinderConfig(ImitationSettings):
    """Of an agent that learns to find things (DAgger), or of the explorer with a detector beside it."""

    agent: Annotated[str, Option(words=AGENTS)] = "network"
    """'network' learns where to look; 'detector' explores the nearest frontier and goes to what it recognises."""
    sees: Annotated[str, Option(words=SEES_WHAT)] = "all"
    """Ablations of vision: 'all': none; 'map': the network sees black pictures, its map still recognises places;
    'nothing': both see black pictures."""
    hidden_size: AtLeastOne = 128
    iterations: AtLeastOne = 800
    learning_rate: Positive = 3e-3
    cooldown: Share = 0.5
    validate_every: AtLeastOne = 400


@dataclass(frozen=True, kw_only=True)
class FindStudyOptions(StudyOptions, Repeated, WithData, Encoded):
    """Agents that find things without help, with sight and without."""

    house_tasks: Count = 50
    """Evaluate on at most N tasks of each unseen house."""
    config: Annotated[FinderConfig, Settings(TRAINING, FinderConfig(), skip=("instruction_length",))]


register_learner(Learner(name="find", study=(FindStudyOptions, study_by("embodied.agents.find.study:FindStudy"))))
