"""What the commands of imitation learning do: a data set with features becomes a split, a split an agent."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import torch

from agents.common.lessons import Lessons
from agents.common.parallel import join_launcher, one_voice
from agents.common.session import Progress
from agents.common.vocabulary import Vocabulary, build_vocabulary
from agents.hanna.agent import load_agent, new_agent, take_weights
from agents.hanna.training import train
from agents.hanna.training_config import TrainingConfig
from agents.vision.run import encoder_of
from embodied.datasets.store import Dataset, dataset_of
from embodied.interface import Episode
from embodied.teachers.hanna import HannaTeacher

Note = Callable[[str], None]


def vocabulary_of(data: Dataset, houses: int | None = None) -> Vocabulary:
    """Words of the training split's first `houses` houses: requests and the routes that training hears."""
    names = data.names("train")[:houses]
    routes = [r.instruction for n in names for r in data.routes(n) if r.split == "train_seen"]
    return build_vocabulary([*(t.request for t in data.tasks("train") if t.world in names), *routes], least=2)


def run_train_hanna(
    args: argparse.Namespace,
    config: TrainingConfig,
    note: Note = print,
    on_validation: Callable[[int, Sequence[Episode]], None] | None = None,
) -> int:
    """Train an agent on a data set's training houses, validating on its unseen validation houses."""
    torch.set_num_threads(args.threads)
    train_agent(
        Lessons(dataset_of(args.data, "hanna"), encoder_of(args), args.quality, join_launcher(args.device)),
        config,
        args.out,
        minutes=args.minutes,
        begin=args.begin,
        note=note,
        on_validation=on_validation,
    )
    return 0


def train_agent(
    lessons: Lessons,
    config: TrainingConfig,
    folder: Path,
    *,
    minutes: float | None = None,
    begin: Path | None = None,
    note: Note = print,
    on_validation: Callable[[int, Sequence[Episode]], None] | None = None,
) -> Progress:
    """Train, or go on training, the agent of a run folder; other arguments as in agents.hanna.training.train.

    Args:
      begin: a trained agent whose weights and words a new run begins with.

    Raises:
      ValueError: `begin` has networks of other sizes, or learned from another encoder.
    """
    houses, note = config.training_houses or None, one_voice(note)
    data, encoder = lessons.data, lessons.encoder
    training = lessons.split("train", houses=houses, lights=config.lights)
    validation = lessons.split("val_unseen", limit=config.validation_tasks)
    other = None if begin is None else load_agent(begin)
    agent = new_agent(config, other.vocabulary if other else vocabulary_of(data, houses), encoder.speaks, encoder.size)
    if other is not None and begin is not None:
        take_weights(agent, other, begin)  # a checkpoint in `folder` replaces them
        note(f"new runs begin with the weights of {begin}")
    agent.network.to(lessons.device)
    parameters = sum(p.numel() for p in agent.network.parameters())
    count = len({t.world for t in training.tasks})
    note(f"{len(training.tasks)} tasks in {count} houses, {len(agent.vocabulary)} words, {parameters:,} parameters")
    return train(
        agent, training, validation, HannaTeacher(), folder, minutes=minutes, note=note, on_validation=on_validation
    )
