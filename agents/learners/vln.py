"""VLN: agents that follow route instructions; their settings and commands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.agents import options
from embodied.agents.common import settings
from embodied.agents.learner import Learner, Players, PlayersOfSplit, PlaySettings, register_learner
from embodied.options import Count, Option, Settings

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset

MEASURES = ("success", "spl", "nDTW", "SDTW", "navigation error")
"""Columns of tables."""
FORCING = ("teacher", "student", "dagger")
"""Who acts in an episode of training: the teacher's; the follower's own, sampled; or at first the teacher's,
then more and more its own (Ross et al. 2011). The label is always the teacher's."""


@dataclass(frozen=True, kw_only=True)
class FollowerSettings(settings.SightedSettings):
    """How a follower is trained."""

    hidden_size: settings.AtLeastOne = 512
    dropout: settings.NotAll = 0.2
    forcing: Annotated[str, Option(words=FORCING)] = "dagger"
    """Who acts in training: 'teacher', 'student' or 'dagger'."""
    blind: bool = False
    """Ablation without vision: all features are zero."""
    wordless: bool = False
    """Ablation without language: the instruction is empty."""
    progress_weight: settings.NotNegative = 0.5
    """Weight of the progress monitor's loss: it predicts which share of the path is left (Ma et al. 2019)."""
    room_weight: settings.NotNegative = 0.5
    """Weight of an auxiliary loss: predict the kinds of the current room and of the candidates' rooms."""
    more_paths: settings.Whole = 0
    """Additional paths per training house, each worded three times."""
    least_teacher: settings.Share = 0.0
    """Lowest share of steps taken by the teacher in 'dagger', reached halfway."""
    iterations: settings.AtLeastOne = 20_000
    batch: settings.AtLeastOne = 64
    instruction_length: settings.AtLeastOne = 80
    """Longest instruction, words; the rest is cut."""


JUDGING = Settings(options.EVALUATION, settings.EvaluationSettings(), skip=("ask_threshold",))
VLN_SCALES = settings.scales(FollowerSettings, "vln")
"""'mini': ten minutes of one core, and twenty more where paths are not worded yet; 'paper': for one GPU."""


@dataclass(frozen=True, kw_only=True)
class FollowerTraining(options.SightedRun):
    """An agent that follows route instructions, on a VLN or HANNA data set with features (imitation)."""

    config: Annotated[FollowerSettings, Settings(options.TRAINING, VLN_SCALES)]
    evaluation: Annotated[settings.EvaluationSettings, JUDGING]


@dataclass(frozen=True, kw_only=True)
class VlnStudyOptions(options.EpisodeStudyOptions, options.Encoded):
    """Agents that follow route instructions."""

    tables: options.Tables
    """Make this table: followers."""
    others: Count = 1
    """Training seeds of all rows but the first."""
    config: Annotated[FollowerSettings, Settings(options.TRAINING, VLN_SCALES, skip=("forcing", "blind", "wordless"))]
    evaluation: Annotated[settings.EvaluationSettings, JUDGING]


def players(file: Path, data: Dataset, how: PlaySettings) -> PlayersOfSplit:
    """The follower beside agents without learning."""
    from embodied.agents.vision.sighted_study import evaluation_data
    from embodied.agents.vln.policy import VlnAgent
    from embodied.kinds.task_kind import PLAIN_AGENTS

    source, agent = evaluation_data(data, how), VlnAgent.load(file)

    def of_split(split: str) -> Players:
        whole, bank = data.split(split), source.split(split).bank
        agents = {"learned": agent.policy(bank), "learned, blind": agent.policy(bank.blind())}
        rows = {name: (whole, one) for name, one in [*agents.items(), *((n, m()) for n, m in PLAIN_AGENTS.items())]}
        return Players(rows, PLAIN_AGENTS, f"trained on pictures {agent.about.pictures}")

    return of_split


register_learner(
    Learner(
        name="vln",
        train=(
            "Agents that follow route instructions.",
            {"follower": (FollowerTraining, options.training("embodied.agents.vln.study:VlnLearner.train", "vln"))},
        ),
        study=(VlnStudyOptions, options.study_by("embodied.agents.vln.study:VlnStudy")),
        players=players,
        columns=MEASURES,
        shipped=settings.SHIPPED_VLN,
    )
)
