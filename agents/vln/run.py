"""What the commands of VLN do: a data set with features becomes lessons, lessons a follower."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Unpack

from agents.common import imitation
from agents.common.more_paths import more_routes
from agents.common.session import Progress
from agents.common.settings import EvaluationSettings
from agents.common.vocabulary import build_vocabulary
from agents.common.weights import weights_digest
from agents.vision.lessons import Lessons, Split
from agents.vln.agent import VlnAbout, VlnAgent
from agents.vln.config import FollowerSettings
from agents.vln.speaker import load_speaker, spoken_tasks
from agents.vln.training import VlnLearner
from embodied.identity import identity_of
from embodied.interface import Task
from embodied.novelty import FAMILIAR
from embodied.tasks.vln import vln_task


def train_follower(
    lessons: Lessons,
    config: FollowerSettings,
    evaluation: EvaluationSettings,
    folder: Path,
    *,
    speaker: Path | None = None,
    **options: Unpack[imitation.Options],
) -> Progress:
    """Train, or go on training, the follower of a run folder; other arguments as in agents.common.imitation.train.

    Args:
      speaker: whose words it learns from besides, in spoken_share of the episodes.

    Raises:
      ValueError: spoken_share without a speaker.
    """
    heard = lessons.said_by(FAMILIAR) if config.speakers == FAMILIAR else lessons
    training = heard.split("train", houses=config.training_houses or None, lights=config.lights)
    validation = heard.split("val_unseen", limit=config.validation_tasks)
    if config.more_paths:
        training = dataclasses.replace(training, tasks=[*training.tasks, *more_tasks(lessons, training, config)])
    if config.spoken_share:
        training = dataclasses.replace(training, tasks=mixed(training, config, speaker))
    words = build_vocabulary((t.request for t in training.tasks), reword=lessons.rewording(config))
    agent = VlnAgent.new(lessons.about(VlnAbout, config, evaluation, words), words.reword)
    agent.network.to(lessons.device)
    spoken = {"speaker": weights_digest(speaker)} if speaker and config.spoken_share else {}
    identity = identity_of("agents.vln.run", settings=config, **lessons.identity(), **spoken)
    return imitation.train(VlnLearner(agent, training), validation, folder, identity, **options)


def more_tasks(lessons: Lessons, training: Split, config: FollowerSettings) -> list[Task]:
    """Tasks of further paths through the training houses; the same for all training seeds."""
    novelty = FAMILIAR if config.speakers == FAMILIAR else None
    more = lambda name: more_routes(lessons.data, name, config.more_paths, seed=0, cache=lessons.cache, novelty=novelty)
    routes = {name: more(name) for name in training.worlds}
    return [vln_task(name, route) for name, many in routes.items() for route in many]


def mixed(training: Split, config: FollowerSettings, speaker: Path | None) -> list[Task]:
    """The tasks with so many that a speaker worded that these are spoken_share of all."""
    if speaker is None or config.spoken_share >= 1:
        raise ValueError(
            f"spoken_share {config.spoken_share} wants --speaker, a file of `embodied train vln speaker`, and to be "
            "below 1"
        )
    spoken = spoken_tasks(load_speaker(speaker), training, config.environment_dropout, seed=config.seed)
    times = config.spoken_share / (1 - config.spoken_share) * len(training.tasks) / len(spoken)
    return [*training.tasks, *spoken * int(times), *spoken[: round(times % 1 * len(spoken))]]
