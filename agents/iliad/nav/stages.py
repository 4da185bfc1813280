"""Training before a NAV student learns: of the teacher's executor and describer; and followers on disk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from embodied.agents.common.choosing import greedy_choice
from embodied.agents.common.session import Note
from embodied.agents.common.tensor_file import load_into
from embodied.agents.common.weights import load_weights, seeded
from embodied.agents.common.word_vectors import use_vectors, vocabulary_with
from embodied.agents.iliad.nav.config import NavConfig
from embodied.agents.iliad.nav.data import NavData
from embodied.agents.iliad.nav.network import WalkDescriber
from embodied.agents.iliad.nav.student import NavEyes, NavStudent
from embodied.agents.iliad.nav.teacher import LONGEST_DESCRIPTION, arrives, encoded_walks, texts_of
from embodied.agents.iliad.nav.world import HORIZON, NavWorld, Trip, walk_along
from embodied.agents.iliad.stages import asked, drawn, teach
from embodied.agents.iliad.training import success_rate
from embodied.agents.iliad.writing import likelihood_loss
from embodied.agents.vln.config import FollowerSettings
from embodied.agents.vln.network import FollowerNetwork
from embodied.seeds import stream

NAV_REMEDY = "train it again with `embodied train iliad nav`"
JUDGED = 128
"""Trips that a stage is judged on between its updates."""


@dataclass(frozen=True)
class NavAbout:
    """Metadata beside the weights in a file."""

    config: NavConfig
    words: tuple[str, ...]
    """Of requests."""
    encoder: str
    """Digest of the encoder whose features it wants."""


def new_follower(config: NavConfig, eyes: NavEyes, seed: int, name: str) -> FollowerNetwork:
    """An untrained follower, which is VLN's; its weights follow from seed and name."""
    c = FollowerSettings(hidden_size=config.hidden_size, dropout=config.dropout)
    with seeded(_beginning(seed, name)):
        network = FollowerNetwork(c, len(eyes.vocabulary), eyes.bank.size)
        use_vectors(network, eyes.vocabulary)
        return network


def _beginning(seed: int, name: str) -> int:
    """Names the first weights of a network."""
    return int(stream(seed, "nav", "begin", name).integers(2**31))


def teach_executor(data: NavData, config: NavConfig, folder: Path, *, note: Note) -> NavStudent:
    """pi_T (3.2.4.1): imitation, walking where it would itself and shown the shortest path from there."""
    eyes, world = data.eyes, NavWorld(data.eyes.places)
    executor = NavStudent(new_follower(config, eyes, config.data_seed, "executor"), eyes, config)
    trips = data.splits["train"]

    def loss_of(rng: np.random.Generator) -> Tensor:
        chosen = drawn(trips, config.teacher_batch, rng)
        requests = asked(chosen, rng)
        done = executor.rollout_for_dagger(chosen, requests, rng=rng)
        shown = [world.demonstrate(q, e) for q, e in zip(chosen, done, strict=True)]
        return -executor.scores(chosen, requests, done, shown).objective.sum() / len(chosen)

    judge = lambda: {"success": success_rate(world, executor, _sample(data))}
    how = _settings(folder, config.executor_iterations, config, data)
    teach(executor.network, "executor", loss_of, judge, note=note, **how)
    return executor


def teach_describer(
    data: NavData, config: NavConfig, executor: NavStudent, folder: Path, *, note: Note
) -> WalkDescriber:
    """P~_T(d | e) (3.2.4.1): the walk along a path to one of its requests; judged by who follows what it says."""
    eyes, world = data.eyes, NavWorld(data.eyes.places)
    with seeded(_beginning(config.data_seed, "describer")):
        describer = WalkDescriber(len(eyes.vocabulary), config.hidden_size, config.heads, eyes.size, HORIZON)
    trips = data.splits["train"]

    def loss_of(rng: np.random.Generator) -> Tensor:
        chosen = drawn(trips, config.teacher_batch, rng)
        wanted = eyes.words(asked(chosen, rng))[:, :LONGEST_DESCRIPTION]
        logits = describer(*encoded_walks(eyes, chosen, [walk_along(t.path) for t in chosen]), wanted)
        return likelihood_loss(logits, wanted)

    judge = lambda: {"followed": followed(world, describer, executor, _sample(data))}
    how = _settings(folder, config.describer_iterations, config, data)
    return teach(describer, "describer", loss_of, judge, note=note, **how)


def followed(world: NavWorld, describer: WalkDescriber, executor: NavStudent, trips: Sequence[Trip]) -> float:
    """Share of paths whose likeliest description leads the executor to their end."""
    walks = [walk_along(t.path) for t in trips]
    numbers = describer.write(*encoded_walks(executor.eyes, trips, walks), greedy_choice, LONGEST_DESCRIPTION)
    done = executor.greedy(trips, texts_of(executor.eyes.vocabulary, numbers))
    return float(np.mean([arrives(world, t, e.nodes, t.path) for t, e in zip(trips, done, strict=True)]))


def load_follower(path: Path, eyes: NavEyes) -> NavStudent:
    """A follower as training saved it, with its settings and the words that it knows.

    Args:
      eyes: what is seen; its words are replaced.

    Raises:
      FileNotFoundError, ValueError: missing, damaged, of another format, or taught with features of another encoder.
    """
    tensors, about = load_weights(path, "nav", NavAbout, NAV_REMEDY)
    if about.encoder != eyes.bank.digest:
        raise ValueError(
            f"{path} was taught with features of encoder {about.encoder[:12]}, these are of {eyes.bank.digest[:12]}; "
            "name it by --encoder"
        )
    c = about.config
    own = NavEyes(eyes.places, eyes.bank, vocabulary_with(about.words, c.word_vectors))
    follower = new_follower(c, own, 0, "loaded")
    load_into(follower, tensors, path)
    return NavStudent(follower.eval(), own.blind() if c.blind else own, c)


def about_follower(config: NavConfig, eyes: NavEyes) -> NavAbout:
    """Metadata of a follower with these eyes."""
    return NavAbout(config, eyes.vocabulary.words, eyes.bank.digest)


def _settings(folder: Path, updates: int, config: NavConfig, data: NavData) -> dict[str, Any]:
    """How a network of the teacher is taught, and what it depends on."""
    students = {"teacher", "candidates", "executor_iterations", "describer_iterations", "blind"}
    settings = {k: v for k, v in vars(config).items() if k not in students}
    how = {"world": "nav", "folder": folder, "updates": updates, "rate": config.teacher_rate, "seed": config.data_seed}
    return {**how, "about": about_follower(config, data.eyes), "settings": settings, "data": data.digest}


def _sample(data: NavData) -> Sequence[Trip]:
    return data.splits["validation"][:: max(1, len(data.splits["validation"]) // JUDGED)]
