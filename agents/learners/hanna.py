"""HANNA: agents that ask people for help and follow their routes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.agents import options
from embodied.agents.common.settings import SHIPPED_AGENT
from embodied.agents.hanna.training_config import EVALUATIONS, HANNA_SCALES, HannaEvaluation, TrainingConfig
from embodied.agents.learner import Learner, Players, PlayersOfSplit, PlaySettings, register_learner
from embodied.options import Count, Settings

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset


@dataclass(frozen=True, kw_only=True)
class HannaTraining(options.SightedRun):
    """An agent that asks people for help (HANNA), by imitation, on a HANNA data set with features.

    Trains an agent by imitation to navigate, to ask for help and to follow it, on data of `embodied features`.
    """

    threads: Count = 2
    config: Annotated[TrainingConfig, Settings(options.TRAINING, HANNA_SCALES)]
    evaluation: Annotated[HannaEvaluation, Settings(options.EVALUATION, EVALUATIONS)]


@dataclass(frozen=True, kw_only=True)
class HannaStudyOptions(options.EpisodeStudyOptions, options.Encoded, options.WithDevice):
    """Agents that ask people for help and follow their routes."""

    tables: options.Tables
    """Make these tables: 4.3, 4.4, 4.5, 4.6 or D.2."""
    seeds: options.Seeds = 1
    config: Annotated[TrainingConfig, Settings(options.TRAINING, HANNA_SCALES, skip=("training_houses",))]
    evaluation: Annotated[HannaEvaluation, Settings(options.EVALUATION, EVALUATIONS)]


def players(file: Path, data: Dataset, how: PlaySettings) -> PlayersOfSplit:
    """Tables 4.3 to 4.5."""
    from embodied.agents.hanna.agent import WITHOUT_LEARNING, HannaAgent, players
    from embodied.agents.vision.sighted_study import evaluation_data

    source, agent = evaluation_data(data, how), HannaAgent.load(file)

    def of_split(split: str) -> Players:
        whole, policies = data.split(split, rules=how.rules), players(agent, source.split(split).bank)
        return Players({name: (whole, policy) for name, policy in policies.items()}, WITHOUT_LEARNING)

    return of_split


register_learner(
    Learner(
        name="hanna",
        train=(HannaTraining, options.training("embodied.agents.hanna.agent:HannaLearner.train", "hanna")),
        study=(HannaStudyOptions, options.study_by("embodied.agents.hanna.study:HannaStudy")),
        players=players,
        columns=(
            *("success", "strict success", "spl", "navigation error", "requests"),
            *("ask F1", "oracle success", "mistake repeat", "request repeat"),
        ),
        shipped=SHIPPED_AGENT,
    )
)
