"""What the commands of imitation learning do: a data set with features becomes a split, a split an agent."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Unpack

from agents.common import imitation
from agents.common.session import Progress
from agents.common.vocabulary import Vocabulary, build_vocabulary
from agents.common.weights import weights_digest
from agents.common.word_vectors import LEARNED_WORDS
from agents.hanna.agent import HannaAbout, HannaAgent, take_weights
from agents.hanna.training import HannaLearner
from agents.hanna.training_config import HannaEvaluation, TrainingConfig
from agents.vision.lessons import Lessons
from embodied.datasets.store import Dataset
from embodied.identity import identity_of
from embodied.novelty import FAMILIAR
from embodied.teachers.hanna import HannaTeacher


def vocabulary_of(data: Dataset, houses: int | None = None, reword: Callable[[str], str] | None = None) -> Vocabulary:
    """Words of the training split's first `houses` houses: requests and the routes that training hears."""
    names = data.names("train")[:houses]
    routes = [r.instruction for n in names for r in data.routes(n) if r.split == "train_seen"]
    return build_vocabulary([*(t.request for t in data.tasks("train") if t.world in names), *routes], 2, reword)


def train_agent(
    lessons: Lessons,
    config: TrainingConfig,
    evaluation: HannaEvaluation,
    folder: Path,
    *,
    begin: Path | None = None,
    **options: Unpack[imitation.Options],
) -> Progress:
    """Train, or go on training, the agent of a run folder; other arguments as in agents.common.imitation.train.

    Args:
      begin: a trained agent whose weights and words a new run begins with.

    Raises:
      ValueError: `begin` has networks of other sizes, learned from another encoder, or knows no varied words.
    """
    houses = config.training_houses or None
    lessons = lessons.said_by(FAMILIAR) if config.speakers == FAMILIAR else lessons
    training = lessons.split("train", houses=houses, lights=config.lights)
    validation = lessons.split("val_unseen", limit=config.validation_tasks)
    other = None if begin is None else HannaAgent.load(begin)
    if other and config.varied_words and not other.config.varied_words and config.word_vectors == LEARNED_WORDS:
        raise ValueError(f"{begin} knows none of the varied words; add --word-vectors minilm, or leave --begin out")
    reword, begun = lessons.rewording(config), dict[str, str]()
    words = other.vocabulary if other else vocabulary_of(lessons.data, houses, reword)
    agent = HannaAgent.new(lessons.about(HannaAbout, config, evaluation, words), reword)
    if other is not None and begin is not None:
        take_weights(agent, other, begin)  # a checkpoint in `folder` replaces them
        begun["begin"] = weights_digest(begin)
    agent.network.to(lessons.device)
    identity = identity_of("agents.hanna.run", settings=config, **lessons.identity(), **begun)
    return imitation.train(HannaLearner(agent, training, HannaTeacher()), validation, folder, identity, **options)
