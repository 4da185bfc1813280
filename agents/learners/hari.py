"""HARI: agents that learn which question to ask, in two phases."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from embodied.agents.common.settings import SHIPPED_HARI
from embodied.agents.hari.config import EXECUTION_SCALES, INTENTION_SCALES, ExecutionConfig, IntentionConfig
from embodied.agents.learner import Learner, Players, PlayersOfSplit, PlaySettings, register_learner
from embodied.agents.options import TRAINING, Drawn, EpisodeStudyOptions, Recorded, Run, Seeds, Tables, study_of
from embodied.options import InputFolder, InputPath, Settings

if TYPE_CHECKING:
    from embodied.agents.common.session import Note
    from embodied.agents.studies.engine import StudyLearner
    from embodied.datasets.store import Dataset


@dataclass(frozen=True, kw_only=True)
class ExecutionTraining(Run):
    """First phase: to understand descriptions and to navigate by them (DAgger)."""

    init_from: InputPath | None = None
    """Initialise with the weights of this execution policy."""
    config: Annotated[ExecutionConfig, Settings(TRAINING, EXECUTION_SCALES)]


@dataclass(frozen=True, kw_only=True)
class IntentionTraining(Recorded, Run, Drawn):
    """Second phase: which question to ask when (actor-critic)."""

    execution: InputPath
    """A trained execution policy (best.safetensors)."""
    config: Annotated[IntentionConfig, Settings(TRAINING, INTENTION_SCALES)]


@dataclass(frozen=True, kw_only=True)
class HariStudyOptions(EpisodeStudyOptions):
    """Agents that learn which question to ask."""

    tables: Tables
    """Make these tables: 4.7, 4.8, 'figure 4.5', 'figure 4.5b' or 'figure 4.6'."""
    execution: InputPath | None = None
    """A trained execution policy (default: trained in --out first)."""
    eval_data: InputFolder | None = None
    """Evaluate in another data set: in all its splits if it differs from --data in --evaluation-tasks only, else in its
    unseen houses (default: in --data)."""
    eval_seeds: Seeds = 3
    """Evaluate with N random seeds, from --seed on."""
    config: Annotated[IntentionConfig, Settings(TRAINING, INTENTION_SCALES, skip=("cooperative", "perfect"))]


def execution(args: ExecutionTraining, *, note: Note) -> None:
    from embodied.agents.hari.run import train_execution
    from embodied.datasets.store import dataset_of

    data = dataset_of(args.data, "hari")
    train_execution(data, args.config, args.out, init_from=args.init_from, minutes=args.minutes, note=note)


def intention(args: IntentionTraining, **session: Any) -> None:
    from embodied.agents.hari.networks import load_executor
    from embodied.agents.hari.run import train_intention
    from embodied.datasets.store import dataset_of

    data, executor = dataset_of(args.data, "hari"), load_executor(args.execution)
    train_intention(data, executor, args.config, args.out, minutes=args.minutes, **session)


def study(args: HariStudyOptions) -> StudyLearner:
    from embodied.agents.hari.study import HariStudy

    first = args.config.seed
    more = {"execution": EXECUTION_SCALES[args.scale], "executor": args.execution}
    return study_of(HariStudy, args, eval_seeds=tuple(range(first, first + args.eval_seeds)), **more)


def players(file: Path, data: Dataset, how: PlaySettings) -> PlayersOfSplit:
    """Rows of Table 4.7 for one agent, in the environment that it was trained for."""
    from embodied.agents.hari.networks import load_agent
    from embodied.agents.hari.run import rules_of, validation_means
    from embodied.agents.hari.study import policies

    agent = load_agent(file)
    rows = policies(agent, validation_means(data, agent, seed=how.seed))

    def of_split(split: str) -> Players:
        whole = data.split(split, rules=rules_of(agent.config))
        return Players({name: (whole, policy) for name, policy in rows.items()}, rows)

    return of_split


register_learner(
    Learner(
        name="hari",
        train=(
            "The agent that learns which question to ask, in two phases.",
            {"execution": (ExecutionTraining, execution), "intention": (IntentionTraining, intention)},
        ),
        study=(HariStudyOptions, study),
        players=players,
        columns=("success", "CUR", "GOAL", "SUB", "DO", "requests", "ask F1", "navigation error"),
        shipped=SHIPPED_HARI,
    )
)
