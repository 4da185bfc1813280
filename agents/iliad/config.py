"""Settings of the learners of ILIAD, whatever the world (Table C.2)."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.agents.common.settings import AT_LEAST_ONE, NOT_NEGATIVE, POSITIVE, SHARE, require, require_word

STUDENT_LEARNERS = ("adel", "dagger", "binary", "continuous")
"""ADEL (Algorithm 9), DAgger, and REINFORCE with a reward of success or of nearness."""


@dataclass(frozen=True)
class LearnerConfig:
    """The defaults are those of the dissertation for REGEX."""

    learner: str = "adel"
    """Learning algorithm: adel (Algorithm 9), dagger, or REINFORCE with a binary or a continuous reward."""
    iterations: int = 30_000
    """Updates of the weights."""
    batch: int = 32
    """Episodes per update."""
    learning_rate: float = 1e-3
    """Learning rate of Adam; REINFORCE uses a tenth of it, as in the dissertation."""
    mixing: float = 0.5
    """Lambda: the weight of executions from the marginal (Algorithm 9)."""
    anneal_every: int = 0
    """Halve lambda after every so many updates; 0: never (L of Table C.1)."""
    least_mixing: float = 0.1
    """Smallest lambda of annealing."""
    entropy: float = 0.1
    """Weight of the entropy bonus in REINFORCE."""
    clip: float = 5.0
    """Largest gradient norm; the dissertation does not clip (docs/sources.md, S92)."""
    cooldown: float = 0.0
    """Share of the updates at the end over which the learning rate falls linearly to zero."""
    threshold: float = 0.85
    """Sample complexity is the number of training episodes until validation reaches this success (c of Table 3.4)."""
    validate_every: int = 500
    """Updates between validations."""
    checkpoint_minutes: float = 2.0
    """Minutes between checkpoints."""
    seed: int = 0
    """Random seed of training."""

    def __post_init__(self) -> None:
        require_word(self, "learner", STUDENT_LEARNERS)
        require(self, AT_LEAST_ONE, "iterations", "batch", "validate_every")
        require(self, POSITIVE, "learning_rate", "clip", "checkpoint_minutes")
        require(self, SHARE, "mixing", "least_mixing", "cooldown", "threshold")
        require(self, NOT_NEGATIVE, "anneal_every", "entropy")

    @property
    def rate(self) -> float:
        """Adam's learning rate for this learner."""
        return self.learning_rate * (0.1 if self.learner in ("binary", "continuous") else 1.0)


def mixing_at(config: LearnerConfig, update: int) -> float:
    """Lambda at an update: max(least, lambda beta) every L updates (Table C.1), or constant; beta is a half."""
    if not config.anneal_every:
        return config.mixing
    return max(config.least_mixing, config.mixing * 0.5 ** (update // config.anneal_every))
