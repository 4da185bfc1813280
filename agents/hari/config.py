"""Settings of HARI's two learners: Table E.2 of the dissertation, and the smaller ones of two cores."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass


@dataclass(frozen=True)
class ExecutionConfig:
    """The execution policy (appendix E, "operation policy" of Table E.2); the defaults are the table's."""

    hidden_size: int = 256
    """Width of encoder, decoder and belief."""
    layers: int = 2
    """Of the encoder and of the decoder each."""
    heads: int = 8
    """Of the attention."""
    dropout: float = 0.1
    """Share of units that are silent in training, in attention as elsewhere."""
    learning_rate: float = 1e-4
    """Of Adam."""
    batch: int = 32
    """Episodes per update."""
    iterations: int = 100_000
    """Updates of the weights."""
    horizon: int = 15
    """Most steps of a pre-training episode."""
    guided: float = 0.0
    """Share of the updates, the first ones, over which the shortest path takes ever fewer of the steps: DAgger's beta
    falls linearly from 1 to 0 over them (docs/sources.md, S81)."""
    clip: float = 1.0
    """Norm to which gradients are cut (docs/sources.md, S76)."""
    cooldown: float = 0.0
    """Share of the updates, the last ones, over which the learning rate falls linearly (docs/sources.md, S79)."""
    validate_every: int = 500
    """Updates between validations."""
    validation_tasks: int = 300
    """Tasks of each validation."""
    checkpoint_minutes: float = 3.0
    """How often the run is saved."""
    seed: int = 0
    """Of everything that is drawn."""

    def __post_init__(self) -> None:
        at_least_one(self, "hidden_size", "layers", "heads", "batch", "iterations", "horizon", "validate_every")
        above_zero(self, "learning_rate", "clip", "checkpoint_minutes")
        if self.hidden_size % self.heads:
            raise ValueError(f"hidden_size {self.hidden_size} should be a multiple of heads {self.heads}")
        if not (0 <= self.dropout < 1 and 0 <= self.cooldown <= 1 and 0 <= self.guided <= 1):
            raise ValueError(
                f"dropout {self.dropout} should be in [0, 1), cooldown {self.cooldown} and guided {self.guided} in "
                "[0, 1]"
            )


@dataclass(frozen=True)
class IntentionConfig:
    """The intention policy and its critic ("interaction policy" of Table E.2); the defaults are the table's."""

    hidden_size: int = 512
    """Width of the recurrent networks."""
    learning_rate: float = 1e-5
    """Of Adam."""
    batch: int = 32
    """Episodes per update."""
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
    perfect: bool = False
    """True: sub-goals are reached perfectly, whatever the execution policy would do (the skyline of Table 4.7)."""
    validate_every: int = 250
    """Updates between validations."""
    validation_tasks: int = 300
    """Tasks of each validation, from its three conditions alike."""
    checkpoint_minutes: float = 3.0
    """How often the run is saved."""
    seed: int = 0
    """Of everything that is drawn."""

    def __post_init__(self) -> None:
        at_least_one(self, "hidden_size", "batch", "iterations", "stack", "longest", "horizon", "validate_every")
        above_zero(self, "learning_rate", "clip", "checkpoint_minutes")
        if self.critic_iterations < 0:
            raise ValueError(f"critic_iterations should not be negative, got {self.critic_iterations}")
        if min(self.cost, self.entropy) < 0:
            raise ValueError(f"cost {self.cost} and entropy {self.entropy} should not be negative")

    @property
    def updates(self) -> int:
        """All updates of a run: those of the critic alone come first."""
        return self.critic_iterations + self.iterations


def at_least_one(config: object, *names: str) -> None:
    for name in names:
        if getattr(config, name) < 1:
            raise ValueError(f"{name} should be at least 1, got {getattr(config, name)}")


def above_zero(config: object, *names: str) -> None:
    for name in names:
        if not getattr(config, name) > 0:
            raise ValueError(f"{name} should be positive, got {getattr(config, name)}")


EXECUTION_SCALES: dict[str, ExecutionConfig] = {
    "mini": ExecutionConfig(
        hidden_size=128, heads=4, learning_rate=1e-3, iterations=4_000, guided=0.5, cooldown=0.4, validate_every=250
    ),
    "paper": ExecutionConfig(),
}
"""'mini': about an hour of two cores; 'paper': Table E.2, for a GPU."""
INTENTION_SCALES: dict[str, IntentionConfig] = {
    "mini": IntentionConfig(
        hidden_size=128, learning_rate=5e-4, critic_iterations=150, iterations=1_500, validate_every=150
    ),
    "paper": IntentionConfig(),
}


def as_dict(config: ExecutionConfig | IntentionConfig) -> dict[str, object]:
    """Field to value, as it is written into checkpoints and weights."""
    return dataclasses.asdict(config)
