"""VLN: agents that follow route instructions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.agents import options
from embodied.agents.common.settings import SHIPPED_VLN, EvaluationSettings
from embodied.agents.learner import Learner, Players, PlayersOfSplit, PlaySettings, register_learner
from embodied.agents.vln.config import MEASURES, VLN_SCALES, FollowerSettings
from embodied.options import Count, Settings

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset


@dataclass(frozen=True, kw_only=True)
class FollowerTraining(options.SightedRun):
    """An agent that follows route instructions, on a VLN or HANNA data set with features (imitation)."""

    config: Annotated[FollowerSettings, Settings(options.TRAINING, VLN_SCALES)]
    evaluation: Annotated[
        EvaluationSettings, Settings(options.EVALUATION, EvaluationSettings(), skip=("ask_threshold",))
    ]


@dataclass(frozen=True, kw_only=True)
class VlnStudyOptions(options.EpisodeStudyOptions, options.Encoded):
    """Agents that follow route instructions."""

    tables: options.Tables
    """Make this table: followers."""
    others: Count = 1
    """Training seeds of all rows but the first."""
    config: Annotated[FollowerSettings, Settings(options.TRAINING, VLN_SCALES, skip=("forcing", "blind", "wordless"))]
    evaluation: Annotated[
        EvaluationSettings, Settings(options.EVALUATION, EvaluationSettings(), skip=("ask_threshold",))
    ]


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
            {"follower": (FollowerTraining, options.training("embodied.agents.vln.study:train_follower", "vln"))},
        ),
        study=(VlnStudyOptions, options.study_by("embodied.agents.vln.study:VlnStudy")),
        players=players,
        columns=MEASURES,
        shipped=SHIPPED_VLN,
    )
)
