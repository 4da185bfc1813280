"""VNLA: agents that ask an advisor within a budget."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.agents import options
from embodied.agents.common.settings import SHIPPED_VNLA, EvaluationSettings
from embodied.agents.learner import Learner, Players, PlayersOfSplit, PlaySettings, register_learner
from embodied.agents.vnla.config import VNLA_SCALES, VnlaSettings
from embodied.options import Count, Settings

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset


@dataclass(frozen=True, kw_only=True)
class VnlaTraining(options.SightedRun):
    """An agent that asks an advisor within a budget (VNLA), by imitation, on a VNLA data set with features.

    Trains an agent by imitation to navigate by one view, to ask an advisor within a budget and to follow the advice.
    """

    threads: Count = 2
    config: Annotated[VnlaSettings, Settings(options.TRAINING, VNLA_SCALES)]
    evaluation: Annotated[EvaluationSettings, Settings(options.EVALUATION, EvaluationSettings())]


@dataclass(frozen=True, kw_only=True)
class VnlaStudyOptions(options.EpisodeStudyOptions, options.Encoded):
    """Agents that ask an advisor within a budget."""

    tables: options.Tables
    """Make this table: askers."""
    others: Count | None = None
    """Training seeds of all rows but the learned asker's (default: --seeds)."""
    config: Annotated[VnlaSettings, Settings(options.TRAINING, VNLA_SCALES, skip=("rules",))]
    evaluation: Annotated[EvaluationSettings, Settings(options.EVALUATION, EvaluationSettings())]


def players(file: Path, data: Dataset, how: PlaySettings) -> PlayersOfSplit:
    """The learned asker beside other askers, direct intervention and agents without learning."""
    from embodied.agents.vision.sighted_study import evaluation_data
    from embodied.agents.vnla.study import BLIND, WITHOUT_LEARNING, VnlaAgent

    source, agent = evaluation_data(data, how), VnlaAgent.load(file)

    about = f"rules of play: {agent.config.rules}; trained on pictures {agent.about.pictures}"

    def of_split(split: str) -> Players:
        bank, names = source.split(split).bank, agent.rows()
        under = functools.cache(lambda rules: data.split(split, rules=rules))
        rows = {name: (under(agent.rules_of_row(name)), agent.player(bank, name)) for name in names}
        return Players(rows, (*BLIND, *WITHOUT_LEARNING), about)

    return of_split


register_learner(
    Learner(
        name="vnla",
        train=(VnlaTraining, options.training("embodied.agents.vnla.study:train_agent", "vnla")),
        study=(VnlaStudyOptions, options.study_by("embodied.agents.vnla.study:VnlaStudy")),
        players=players,
        columns=(
            *("success", "strict success", "room success", "navigation error"),
            *("requests", "ask F1", "oracle success", "steps"),
        ),
        shipped=SHIPPED_VNLA,
    )
)
