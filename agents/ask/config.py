"""Settings of the learned asker. Free of torch."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.agents.common.settings import AT_LEAST_ONE, NOT_NEGATIVE, POSITIVE, require


@dataclass(frozen=True, kw_only=True)
class AskerConfig:
    """How it learns; a few minutes on a core."""

    houses: int = 20
    """Training houses of 90 to 140 square metres."""
    tasks: int = 10
    """Tasks of each house in the first round, which the oracle plays."""
    rounds: int = 2
    """Further rounds, which the learner plays (DAgger)."""
    round_tasks: int = 6
    """Tasks of each house in a further round."""
    hidden_size: int = 64
    """Width of the network's two hidden layers."""
    passes: int = 120
    """Passes over all decisions in each round."""
    learning_rate: float = 3e-3
    """Learning rate of AdamW."""
    weight_decay: float = 1e-3
    """Weight decay of AdamW."""
    seed: int = 0
    """Random seed."""

    def __post_init__(self) -> None:
        require(self, AT_LEAST_ONE, "houses", "tasks", "round_tasks", "hidden_size", "passes")
        require(self, NOT_NEGATIVE, "rounds", "weight_decay")
        require(self, POSITIVE, "learning_rate")


@dataclass(frozen=True, kw_only=True)
class AskEvaluation:
    """The houses in which all agents are evaluated, that nobody learned in."""

    test_houses: int = 8
    """Houses to evaluate in, of 90 to 140 square metres."""
    test_tasks: int = 15
    """Tasks of each house to evaluate on."""
    oracle_tasks: int = 40
    """Tasks in all that the oracle of asking plays, which is slow; spread over the houses."""
    model_tasks: int = 20
    """Tasks in all that a language model plays, spread over the houses."""

    def __post_init__(self) -> None:
        require(self, AT_LEAST_ONE, "test_houses", "test_tasks", "oracle_tasks", "model_tasks")
