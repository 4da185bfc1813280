"""What the commands of VNLA do: a data set with features becomes lessons, lessons an agent."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Unpack

from agents.common import imitation
from agents.common.session import Progress
from agents.common.settings import EvaluationSettings
from agents.common.vocabulary import Vocabulary, build_vocabulary
from agents.vision.lessons import Lessons
from agents.vnla.agent import VnlaAbout, VnlaAgent
from agents.vnla.config import TRAINED_UNDER, VnlaSettings
from agents.vnla.training import VnlaLearner
from embodied.action_spaces import WORDS
from embodied.assistants.advisor import HELP_STEPS
from embodied.datasets.store import Dataset
from embodied.identity import identity_of
from embodied.language.plain import PlainLanguage


def vocabulary_of(data: Dataset, houses: int | None = None, reword: Callable[[str], str] | None = None) -> Vocabulary:
    """Words of the requests in the training split's first `houses` houses, and of all that the advisor can say."""
    names = data.names("train")[:houses]
    requests = [t.request for t in data.tasks("train") if t.world in names]
    said = [PlainLanguage().subgoal([w] * n + ["stop"]) for w in WORDS for n in range(1, HELP_STEPS + 1)]
    heard = [*requests, *said, *(s.text for s in data.said(names))]
    if reword:  # advice is said before a request
        heard += [f"{s} . {r}" for s, r in zip(itertools.cycle(said), requests)]
    return build_vocabulary(heard, reword=reword)


def train_agent(
    lessons: Lessons,
    config: VnlaSettings,
    evaluation: EvaluationSettings,
    folder: Path,
    **options: Unpack[imitation.Options],
) -> Progress:
    """Train, or go on training, the agent of a run folder; other arguments as in agents.common.imitation.train."""
    houses = config.training_houses or None
    training = lessons.split("train", houses=houses, vnla=TRAINED_UNDER[config.rules], lights=config.lights)
    validation = lessons.split("val_unseen", limit=config.validation_tasks, vnla=config.rules)
    words = vocabulary_of(lessons.data, houses, lessons.rewording(config))
    agent = VnlaAgent.new(lessons.about(VnlaAbout, config, evaluation, words), words.reword)
    agent.network.to(lessons.device)
    identity = identity_of("agents.vnla.run", settings=config, **lessons.identity())
    return imitation.train(VnlaLearner(agent, training), validation, folder, identity, **options)
