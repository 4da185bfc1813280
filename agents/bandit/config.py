"""BanditConfig: sizes and hyperparameters of dissertation 3.1.5.2; Sizes: those of a corpus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from embodied.agents.common.settings import AtLeastOne, Checked, Limit, Positive, RunSettings, Share, scales

VocabularySize = Annotated[int, Limit(lambda x: x >= 4, "at least 4, for padding, unknown words and the end")]


@dataclass(frozen=True, kw_only=True)
class BanditConfig(RunSettings):
    """The defaults are the dissertation's; BANDIT_SCALES holds the smaller settings."""

    hidden_size: AtLeastOne = 500
    """Width of word embeddings and LSTMs of translator and critic."""
    source_words: VocabularySize = 50_000
    """Vocabulary size of the source language."""
    target_words: VocabularySize = 50_000
    """Vocabulary size of the target language."""
    longest: AtLeastOne = 50
    """Longest translation, words; corpora leave out longer sentences."""
    batch: AtLeastOne = 64
    """Sentences per update."""
    pretraining_passes: AtLeastOne = 10
    """Epochs of supervised pre-training; the weakly trained reference has one."""
    critic_passes: AtLeastOne = 5
    """Epochs of pre-training the critic on sampled translations."""
    pretraining_rate: Positive = 1e-3
    """Learning rate of pre-training, of translator and critic."""
    bandit_rate: Positive = 1e-4
    """Learning rate of learning from ratings, of translator and critic, and of the supervised control."""
    clip: Positive = 5.0
    """Largest gradient norm, that of the authors' program (docs/sources.md, S73)."""
    checkpoint_minutes: Positive = 2.0
    """Minutes between checkpoints."""


@dataclass(frozen=True)
class Sizes(Checked):
    """How many pairs each split of a corpus gets; the defaults are a thirteenth of the dissertation's (Table 3.1)."""

    supervised: AtLeastOne = 14_000
    """Pairs for supervised pre-training."""
    bandit: AtLeastOne = 12_800
    """Pairs of each set that is rated."""
    dev: AtLeastOne = 1_000
    """Least number of pairs for model selection."""
    test: AtLeastOne = 2_000
    """Least number of pairs for evaluation."""
    overlap: Share = 0.95
    """Share of the set bandit_overlap that is in the supervised set (the dissertation: over 95 %)."""


BANDIT_SCALES = scales(BanditConfig, "bandit")
"""'mini': minutes on a core; 'paper': section 3.1.5.2, for a GPU and the
dissertation's corpora."""
