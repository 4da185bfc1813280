"""Settings of the learned asker. Free of torch."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.agents.common.settings import AtLeastOne, Checked, NotNegative, Positive, Whole


@dataclass(frozen=True, kw_only=True)
class AskerConfig(Checked):
    """How it learns; a few minutes on a core."""

    houses: AtLeastOne = 20
    """Training houses of 90 to 140 square metres."""
    tasks: AtLeastOne = 10
    """Tasks of each house in the first round, which the oracle plays."""
    rounds: Whole = 2
    """Further rounds, which the learner plays (DAgger)."""
    round_tasks: AtLeastOne = 6
    """Tasks of each house in a further round."""
    hidden_size: AtLeastOne = 64
    """Width of the network's two hidden layers."""
    passes: AtLeastOne = 120
    """Passes over all decisions in each round."""
    learning_rate: Positive = 3e-3
    """Learning rate of AdamW."""
    weight_decay: NotNegative = 1e-3
    """Weight decay of AdamW."""
    seed: int = 0
    """Random seed."""


@dataclass(frozen=True, kw_only=True)
class AskEvaluation(Checked):
    """The houses in which all agents are evaluated, that nobody learned in."""

    test_houses: AtLeastOne = 8
    """Houses to evaluate in, of 90 to 140 square metres."""
    test_tasks: AtLeastOne = 15
    """Tasks of each house to evaluate on."""
    oracle_tasks: AtLeastOne = 40
    """Tasks in all that the oracle of asking plays, which is slow; spread over the houses."""
    model_tasks: AtLeastOne = 20
    """Tasks in all that a language model plays, spread over the houses."""
