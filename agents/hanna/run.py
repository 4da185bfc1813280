"""What the commands of imitation learning do: a data set with features becomes a split, a split an agent."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agents.common import imitation
from agents.common.parallel import rank_zero
from agents.common.session import Note, Progress
from agents.common.vocabulary import Vocabulary, build_vocabulary
from agents.common.weights import weights_digest
from agents.hanna.agent import load_agent, new_agent, take_weights
from agents.hanna.training import HannaLearner
from agents.hanna.training_config import HannaEvaluation, TrainingConfig
from agents.vision.lessons import Lessons
from embodied.datasets.store import Dataset
from embodied.identity import identity_of
from embodied.teachers.hanna import HannaTeacher


def vocabulary_of(data: Dataset, houses: int | None = None) -> Vocabulary:
    """Words of the training split's first `houses` houses: requests and the routes that training hears."""
    names = data.names("train")[:houses]
    routes = [r.instruction for n in names for r in data.routes(n) if r.split == "train_seen"]
    return build_vocabulary([*(t.request for t in data.tasks("train") if t.world in names), *routes], least=2)


def train_agent(
    lessons: Lessons,
    config: TrainingConfig,
    evaluation: HannaEvaluation,
    folder: Path,
    *,
    minutes: float | None = None,
    begin: Path | None = None,
    note: Note = print,
    on_validation: imitation.OnValidation | None = None,
) -> Progress:
    """Train, or go on training, the agent of a run folder; other arguments as in agents.common.imitation.train.

    Args:
      begin: a trained agent whose weights and words a new run begins with.

    Raises:
      ValueError: `begin` has networks of other sizes, or learned from another encoder.
    """
    houses, note = config.training_houses or None, rank_zero(note)
    data, encoder = lessons.data, lessons.encoder
    training = lessons.split("train", houses=houses, lights=config.lights)
    validation = lessons.split("val_unseen", limit=config.validation_tasks)
    other = None if begin is None else load_agent(begin)
    words = other.vocabulary if other else vocabulary_of(data, houses)
    agent = new_agent(config, words, encoder.feature_space, encoder.size, evaluation)
    if other is not None and begin is not None:
        take_weights(agent, other, begin)  # a checkpoint in `folder` replaces them
        note(f"new runs begin with the weights of {begin}")
    agent.network.to(lessons.device)
    parameters = sum(p.numel() for p in agent.network.parameters())
    count = len({t.world for t in training.tasks})
    note(f"{len(training.tasks)} tasks in {count} houses, {len(agent.vocabulary)} words, {parameters:,} parameters")
    identity = training_identity(lessons, config, begin)
    learner, watch = HannaLearner(agent, training, HannaTeacher()), on_validation
    return imitation.train(learner, validation, folder, identity, minutes=minutes, note=note, on_validation=watch)


def training_identity(lessons: Lessons, config: TrainingConfig, begin: Path | None = None) -> dict[str, Any]:
    """All that a trained agent depends on; `begin` as of train_agent."""
    begun = {} if begin is None else {"begin": weights_digest(begin)}
    return identity_of("agents.hanna.run", settings=config, **lessons.identity(), **begun)
