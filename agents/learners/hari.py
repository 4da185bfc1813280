"""HARI: agents that learn which question to ask; settings of both learners (Table E.2 of the dissertation, and the
smaller ones of two cores), and commands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from embodied.agents.common import settings
from embodied.agents.common.settings import SHIPPED_HARI
from embodied.agents.learner import Learner, Players, PlayersOfSplit, PlaySettings, register_learner
from embodied.agents.options import TRAINING, Drawn, EpisodeStudyOptions, Recorded, Run, Seeds, Tables, study_of
from embodied.options import InputFolder, InputPath, Settings

if TYPE_CHECKING:
    from embodied.agents.common.session import Note
    from embodied.agents.studies.engine import StudyLearner
    from embodied.datasets.store import Dataset


@dataclass(frozen=True, kw_only=True)
class ExecutionConfig(settings.ValidatedRunSettings):
    """The execution policy (appendix E, "operation policy" of Table E.2); the defaults are the table's."""

    hidden_size: settings.AtLeastOne = 256
    """Width of encoder, decoder and belief."""
    layers: settings.AtLeastOne = 2
    """Layers of the encoder, and of the decoder."""
    heads: settings.AtLeastOne = 8
    """Attention heads."""
    dropout: settings.NotAll = 0.1
    """Dropout rate in training."""
    iterations: settings.AtLeastOne = 100_000
    horizon: settings.AtLeastOne = 15
    """Longest pre-training episode, steps."""
    guided: settings.Share = 0.0
    """Share of the updates at the start over which the expert's share of the steps falls linearly from 1 to 0: DAgger's
    beta (docs/sources.md, S81)."""
    subgoals: settings.Share = 0.0
    """Share of training episodes with a sub-goal of one to three nodes from the start, worded as SUB's answer
    (docs/sources.md, S144)."""
    stay_fraction: settings.NotAll = 0.0
    """Share of training steps at which the agent stands still and gets the description of its place, as an agent that
    asks does (docs/sources.md, S172)."""
    keep_fraction: settings.Share = 0.1
    """Share of object classes that sparse descriptions keep (docs/sources.md, S170)."""
    reset_on_goal_change: bool = False
    """Reset the belief when the goal on top of the stack changes (docs/sources.md, S145)."""
    clip: settings.Positive = 1.0
    """Largest gradient norm (docs/sources.md, S76)."""
    cooldown: settings.Share = 0.0
    """Share of the updates at the end over which the learning rate falls linearly to zero (docs/sources.md, S79)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.hidden_size % self.heads:
            raise ValueError(f"hidden_size {self.hidden_size} should be a multiple of heads {self.heads}")


@dataclass(frozen=True, kw_only=True)
class IntentionConfig(settings.ValidatedRunSettings):
    """The intention policy and its critic ("interaction policy" of Table E.2); the defaults are the table's."""

    hidden_size: settings.AtLeastOne = 512
    """Width of the recurrent networks."""
    learning_rate: settings.Positive = 1e-5
    critic_iterations: settings.Whole = 5_000
    """Updates of the critic alone, before both are trained."""
    iterations: settings.AtLeastOne = 50_000
    """Updates of policy and critic together."""
    entropy: settings.NotNegative = 1e-3
    """Weight of the entropy bonus."""
    clip: settings.Positive = 1.0
    """Largest gradient norm (docs/sources.md, S76)."""
    knows_stack: bool = True
    """Observe how many goals are on the stack; the dissertation's agent does not (4.3.6; docs/sources.md, S77)."""
    stack: settings.AtLeastOne = 2
    """Largest number of goals on the stack (L)."""
    longest: settings.AtLeastOne = 3
    """Longest path to a sub-goal, nodes (l_max)."""
    cost: settings.NotNegative = 0.01
    """Cost of each CUR, GOAL, SUB and DO."""
    horizon: settings.AtLeastOne = 30
    """Longest episode, steps (H)."""
    cooperative: bool = True
    """The assistant answers the question that was asked; False: a different one (Table 4.7)."""
    keep_fraction: settings.Share = 0.1
    """Share of object classes that sparse descriptions keep (docs/sources.md, S170)."""
    perfect: bool = False
    """Reach sub-goals perfectly, whatever the execution policy does (the skyline of Table 4.7)."""
    validate_every: settings.AtLeastOne = 250
    validation_tasks: settings.AtLeastOne = 300
    """Tasks of each validation, a third from each of its conditions."""

    @property
    def updates(self) -> int:
        """All updates of a run: those of the critic alone come first."""
        return self.critic_iterations + self.iterations


EXECUTION_SCALES = settings.scales(ExecutionConfig, "hari-execution")
"""'mini': about half an hour of one core; 'paper': Table E.2, for a GPU."""
INTENTION_SCALES = settings.scales(IntentionConfig, "hari-intention")


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
