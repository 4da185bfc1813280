"""BanditConfig: sizes and hyperparameters of dissertation 3.1.5.2; Sizes: those of a corpus."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.agents.common.settings import AT_LEAST_ONE, POSITIVE, Limit, RunSettings, require


@dataclass(frozen=True, kw_only=True)
class BanditConfig(RunSettings):
    """The defaults are the dissertation's; BANDIT_SCALES holds the smaller settings."""

    hidden_size: int = 500
    """Width of word embeddings and LSTMs of translator and critic."""
    source_words: int = 50_000
    """Vocabulary size of the source language."""
    target_words: int = 50_000
    """Vocabulary size of the target language."""
    longest: int = 50
    """Longest translation, words; corpora leave out longer sentences."""
    batch: int = 64
    """Sentences per update."""
    pretraining_passes: int = 10
    """Epochs of supervised pre-training; the weakly trained reference has one."""
    critic_passes: int = 5
    """Epochs of pre-training the critic on sampled translations."""
    pretraining_rate: float = 1e-3
    """Learning rate of pre-training, of translator and critic."""
    bandit_rate: float = 1e-4
    """Learning rate of learning from ratings, of translator and critic, and of the supervised control."""
    clip: float = 5.0
    """Largest gradient norm, that of the authors' program (docs/sources.md, S73)."""
    checkpoint_minutes: float = 2.0
    """Minutes between checkpoints."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self, AT_LEAST_ONE, "hidden_size", "longest", "pretraining_passes", "critic_passes")
        require(self, POSITIVE, "pretraining_rate", "bandit_rate", "clip")
        least = Limit(lambda x: x >= 4, "at least 4, for padding, unknown words and the end")
        require(self, least, "source_words", "target_words")


@dataclass(frozen=True)
class Sizes:
    """How many pairs each split of a corpus gets; the defaults are a thirteenth of the dissertation's (Table 3.1)."""

    supervised: int = 14_000
    """Pairs for supervised pre-training."""
    bandit: int = 12_800
    """Pairs of each set that is rated."""
    dev: int = 1_000
    """Least number of pairs for model selection."""
    test: int = 2_000
    """Least number of pairs for evaluation."""
    overlap: float = 0.95
    """Share of the set bandit_overlap that is in the supervised set (the dissertation: over 95 %)."""

    def __post_init__(self) -> None:
        if min(self.supervised, self.bandit, self.dev, self.test) < 1:
            raise ValueError(f"every split needs at least one pair, got {self}")
        if not 0 <= self.overlap <= 1:
            raise ValueError(f"overlap must be in [0, 1], got {self.overlap}")


BANDIT_SCALES: dict[str, BanditConfig] = {
    "mini": BanditConfig(
        hidden_size=64,
        source_words=5000,
        target_words=2500,
        pretraining_passes=6,
        critic_passes=2,
        pretraining_rate=3e-3,
        bandit_rate=1e-3,
    ),
    "paper": BanditConfig(),
}
"""'mini': minutes on a core; 'paper': section 3.1.5.2, for a GPU and the
dissertation's corpora."""
