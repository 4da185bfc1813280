"""VNLA: agents that ask an advisor within a budget; their settings and commands."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.agents import options
from embodied.agents.common import settings
from embodied.agents.learner import Learner, Players, PlayersOfSplit, PlaySettings, register_learner
from embodied.kinds.shipped.vnla import RULES_OF_PLAY
from embodied.options import Count, Option, Settings

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset


@dataclass(frozen=True, kw_only=True)
class VnlaSettings(settings.SightedSettings):
    """The defaults are the program's; VNLA_SCALES holds smaller ones."""

    hidden_size: settings.AtLeastOne = 512
    """Width of the LSTMs of encoder and decoder."""
    word_embedding: settings.AtLeastOne = 256
    """Width of an embedded word."""
    navigation_embedding: settings.AtLeastOne = 32
    """Width of an embedded navigation action."""
    ask_embedding: settings.AtLeastOne = 32
    """Width of an embedded decision to ask."""
    budget_embedding: settings.AtLeastOne = 16
    """Width of the embedded number of remaining requests."""
    dropout: settings.NotAll = 0.5
    iterations: settings.AtLeastOne = 100_000
    """Updates of the weights; the program's direct-mute agents: 70,000."""
    looking: settings.Whole = 10_000
    """How many updates, at the start, only teach to read panoramas."""
    batch: settings.AtLeastOne = 100
    blind: bool = False
    """Ablation without vision: all features are zero."""
    rules: Annotated[str, Option(words=tuple(RULES_OF_PLAY))] = "indirect"
    """Rule of play in evaluation. An agent of 'indirect' is trained under 'direct': the advisor's actions replace the
    learner's while what it said is in force, as in the program (docs/sources.md, S112)."""
    validate_every: settings.AtLeastOne = 1000


VNLA_SCALES = settings.scales(VnlaSettings, "vnla")
"""'mini': some minutes of one core; 'paper': the program's, for one GPU (docs/sources.md, S113)."""


@dataclass(frozen=True, kw_only=True)
class VnlaTraining(options.SightedRun):
    """An agent that asks an advisor within a budget (VNLA), by imitation, on a VNLA data set with features.

    Trains an agent by imitation to navigate by one view, to ask an advisor within a budget and to follow the advice.
    """

    threads: Count = 2
    config: Annotated[VnlaSettings, Settings(options.TRAINING, VNLA_SCALES)]
    evaluation: Annotated[settings.EvaluationSettings, Settings(options.EVALUATION, settings.EvaluationSettings())]


@dataclass(frozen=True, kw_only=True)
class VnlaStudyOptions(options.EpisodeStudyOptions, options.Encoded):
    """Agents that ask an advisor within a budget."""

    tables: options.Tables
    """Make this table: askers."""
    others: Count | None = None
    """Training seeds of all rows but the learned asker's (default: --seeds)."""
    config: Annotated[VnlaSettings, Settings(options.TRAINING, VNLA_SCALES, skip=("rules",))]
    evaluation: Annotated[settings.EvaluationSettings, Settings(options.EVALUATION, settings.EvaluationSettings())]


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
        train=(VnlaTraining, options.training("embodied.agents.vnla.study:VnlaLearner.train", "vnla")),
        study=(VnlaStudyOptions, options.study_by("embodied.agents.vnla.study:VnlaStudy")),
        players=players,
        columns=(
            *("success", "strict success", "room success", "navigation error"),
            *("requests", "ask F1", "oracle success", "steps"),
        ),
        shipped=settings.SHIPPED_VNLA,
    )
)
