"""BANDIT: a translator that learns from ratings: sizes and hyperparameters of dissertation 3.1.5.2, sizes of a corpus,
and commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from embodied.agents.common.settings import AtLeastOne, Checked, Limit, Positive, RunSettings, Share, scales
from embodied.agents.learner import Learner, register_learner
from embodied.agents.options import TRAINING, Repeated, Scaled, StudyOptions, Tables, study_of
from embodied.options import InputFolder, InputPath, Settings

if TYPE_CHECKING:
    from embodied.agents.studies.engine import StudyLearner

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
"""'mini': minutes on a core; 'paper': section 3.1.5.2, for a GPU and the dissertation's corpora."""


@dataclass(frozen=True, kw_only=True)
class BanditStudyOptions(StudyOptions, Repeated, Scaled):
    """A translator that learns from ratings."""

    tables: Tables
    """Make these tables: 3.2, 3.5 or, with --rater, people."""
    data: InputFolder
    """The corpus, a folder that `embodied corpus` made."""
    rater: InputPath | None = None
    """Learn from ratings like people's, too: rater.json of `embodied dataset from-people`."""
    config: Annotated[BanditConfig, Settings(TRAINING, BANDIT_SCALES)]


def study(args: BanditStudyOptions) -> StudyLearner:
    from embodied.agents.bandit.ratings import Rater
    from embodied.agents.bandit.study import BanditStudy
    from embodied.records import load_json

    rater = load_json(args.rater, Rater) if args.rater else None
    return study_of(BanditStudy, args, rater=rater)


register_learner(Learner(name="bandit", study=(BanditStudyOptions, study)))
