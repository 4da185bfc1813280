"""Settings of HARI's two learners: Table E.2 of the dissertation, and the smaller ones of two cores."""

from __future__ import annotations

from dataclasses import dataclass

from agents.common.settings import AT_LEAST_ONE, NOT_ALL, NOT_NEGATIVE, POSITIVE, SHARE, ValidatedRunSettings, require


@dataclass(frozen=True, kw_only=True)
class ExecutionConfig(ValidatedRunSettings):
    """The execution policy (appendix E, "operation policy" of Table E.2); the defaults are the table's."""

    hidden_size: int = 256
    """Width of encoder, decoder and belief."""
    layers: int = 2
    """Of the encoder and of the decoder each."""
    heads: int = 8
    """Of the attention."""
    dropout: float = 0.1
    """Share of units that are silent in training, in attention as elsewhere."""
    iterations: int = 100_000
    """Updates of the weights."""
    horizon: int = 15
    """Most steps of a pre-training episode."""
    guided: float = 0.0
    """Share of the updates, the first ones, over which the shortest path takes ever fewer of the steps: DAgger's beta
    falls linearly from 1 to 0 over them (docs/sources.md, S81)."""
    subgoals: float = 0.0
    """Share of the training episodes that have a sub-goal of one to three nodes from the beginning, worded as SUB's
    answer is (docs/sources.md, S144)."""
    standing: float = 0.0
    """Share of the training steps at which it stands still and is told what it is told unasked, as an agent that asks
    does (docs/sources.md, S172)."""
    kept: float = 0.1
    """Share of the object classes that descriptions keep while it stands still (docs/sources.md, S170)."""
    afresh: bool = False
    """Whether its belief begins anew when the goal on top of the stack is another one (docs/sources.md, S145)."""
    clip: float = 1.0
    """Norm to which gradients are cut (docs/sources.md, S76)."""
    cooldown: float = 0.0
    """Share of the updates, the last ones, over which the learning rate falls linearly (docs/sources.md, S79)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self, AT_LEAST_ONE, "hidden_size", "layers", "heads", "horizon")
        require(self, POSITIVE, "clip")
        require(self, NOT_ALL, "dropout", "standing")
        require(self, SHARE, "cooldown", "guided", "subgoals", "kept")
        if self.hidden_size % self.heads:
            raise ValueError(f"hidden_size {self.hidden_size} should be a multiple of heads {self.heads}")


@dataclass(frozen=True, kw_only=True)
class IntentionConfig(ValidatedRunSettings):
    """The intention policy and its critic ("interaction policy" of Table E.2); the defaults are the table's."""

    hidden_size: int = 512
    """Width of the recurrent networks."""
    learning_rate: float = 1e-5
    """Learning rate of Adam."""
    critic_iterations: int = 5_000
    """Updates of the critic alone, before the first of both."""
    iterations: int = 50_000
    """Updates of both."""
    entropy: float = 1e-3
    """Weight of the policy's entropy."""
    clip: float = 1.0
    """Norm to which gradients are cut (docs/sources.md, S76)."""
    knows_stack: bool = True
    """Whether it is told how many goals are on the stack, which it put there itself; the dissertation's is not, and
    blames that for its critic's mistakes (4.3.6; docs/sources.md, S77)."""
    stack: int = 2
    """L, the most goals on the stack."""
    longest: int = 3
    """l_max, the most nodes to a sub-goal."""
    cost: float = 0.01
    """Of each CUR, GOAL, SUB and DO."""
    horizon: int = 30
    """H, the most steps of an episode."""
    cooperative: bool = True
    """False: the assistant answers another question than was asked (Table 4.7)."""
    kept: float = 0.1
    """Share of the object classes that sparse descriptions keep (docs/sources.md, S170)."""
    perfect: bool = False
    """True: sub-goals are reached perfectly, whatever the execution policy would do (the skyline of Table 4.7)."""
    validate_every: int = 250
    """Updates between validations."""
    validation_tasks: int = 300
    """Tasks of each validation, from its three conditions alike."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self, AT_LEAST_ONE, "hidden_size", "stack", "longest", "horizon")
        require(self, POSITIVE, "clip")
        require(self, NOT_NEGATIVE, "critic_iterations", "cost", "entropy")
        require(self, SHARE, "kept")

    @property
    def updates(self) -> int:
        """All updates of a run: those of the critic alone come first."""
        return self.critic_iterations + self.iterations


EXECUTION_SCALES: dict[str, ExecutionConfig] = {
    "mini": ExecutionConfig(
        hidden_size=128,
        heads=4,
        learning_rate=1e-3,
        iterations=3_000,
        guided=0.5,
        cooldown=0.4,
        subgoals=0.5,
        standing=0.3,
        afresh=True,
        validate_every=250,
    ),
    "paper": ExecutionConfig(),
}
"""'mini': about half an hour of one core; 'paper': Table E.2, for a GPU."""
INTENTION_SCALES: dict[str, IntentionConfig] = {
    "mini": IntentionConfig(
        hidden_size=128, learning_rate=1e-3, batch=64, critic_iterations=30, iterations=200, validate_every=50
    ),
    "paper": IntentionConfig(),
}
