"""Settings of HARI's two learners: Table E.2 of the dissertation, and the smaller ones of two cores."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.agents.common import settings


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
    """Updates of the weights."""
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
    """Learning rate of Adam."""
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
    """Updates between validations."""
    validation_tasks: settings.AtLeastOne = 300
    """Tasks of each validation, a third from each of its conditions."""

    @property
    def updates(self) -> int:
        """All updates of a run: those of the critic alone come first."""
        return self.critic_iterations + self.iterations


EXECUTION_SCALES = settings.scales(ExecutionConfig, "hari-execution")
"""'mini': about half an hour of one core; 'paper': Table E.2, for a GPU."""
INTENTION_SCALES = settings.scales(IntentionConfig, "hari-intention")
