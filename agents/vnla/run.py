"""What the commands of VNLA do: a data set with features becomes lessons, lessons an agent."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agents.common import imitation
from agents.common.parallel import rank_zero
from agents.common.session import Note, Progress
from agents.common.settings import EvaluationSettings
from agents.common.vocabulary import Vocabulary, build_vocabulary
from agents.vision.lessons import Lessons
from agents.vnla.agent import new_agent
from agents.vnla.config import TRAINED_UNDER, VnlaSettings
from agents.vnla.training import VnlaLearner
from embodied.action_spaces import WORDS
from embodied.assistants.advisor import HELP_STEPS
from embodied.datasets.store import Dataset
from embodied.identity import identity_of
from embodied.language.plain import PlainLanguage


def vocabulary_of(data: Dataset, houses: int | None = None) -> Vocabulary:
    """Words of the requests in the training split's first `houses` houses, and of all that the advisor can say."""
    names = data.names("train")[:houses]
    requests = [t.request for t in data.tasks("train") if t.world in names]
    said = [PlainLanguage().subgoal([w] * n + ["stop"]) for w in WORDS for n in range(1, HELP_STEPS + 1)]
    return build_vocabulary([*requests, *said, *(s.text for s in data.said(names))])


def train_agent(
    lessons: Lessons,
    config: VnlaSettings,
    evaluation: EvaluationSettings,
    folder: Path,
    *,
    minutes: float | None = None,
    note: Note = print,
    on_validation: imitation.OnValidation | None = None,
) -> Progress:
    """Train, or go on training, the agent of a run folder; other arguments as in agents.common.imitation.train."""
    houses, note = config.training_houses or None, rank_zero(note)
    training = lessons.split("train", houses=houses, vnla=TRAINED_UNDER[config.rules], lights=config.lights)
    validation = lessons.split("val_unseen", limit=config.validation_tasks, vnla=config.rules)
    words, encoder = vocabulary_of(lessons.data, houses), lessons.encoder
    agent = new_agent(config, words, encoder.feature_space, encoder.size, lessons.pictures("train"), evaluation)
    agent.network.to(lessons.device)
    size = sum(p.numel() for p in agent.network.parameters())
    count = len({t.world for t in training.tasks})
    note(
        f"{len(training.tasks)} tasks in {count} houses, {len(words)} words, {size:,} parameters, "
        f"pictures: {agent.pictures}"
    )
    identity, watch = training_identity(lessons, config), on_validation
    learner = VnlaLearner(agent, training)
    return imitation.train(learner, validation, folder, identity, minutes=minutes, note=note, on_validation=watch)


def training_identity(lessons: Lessons, config: VnlaSettings) -> dict[str, Any]:
    """All that a trained agent depends on."""
    return identity_of("agents.vnla.run", settings=config, **lessons.identity())
