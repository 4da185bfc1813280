"""Training before a NAV student learns: of the teacher's executor and describer; and followers on disk."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from torch import Tensor, nn

from embodied.agents.common.choosing import greedy_choice
from embodied.agents.common.session import Note
from embodied.agents.common.tensor_file import load_into
from embodied.agents.common.weights import load_weights, save_weights, seeded
from embodied.agents.common.word_vectors import use_vectors, vocabulary_with
from embodied.agents.iliad.nav.config import NavConfig
from embodied.agents.iliad.nav.data import NavData
from embodied.agents.iliad.nav.network import WalkDescriber
from embodied.agents.iliad.nav.student import NavEyes, NavStudent
from embodied.agents.iliad.nav.teacher import LONGEST_DESCRIPTION, arrives, encoded_walks, texts_of
from embodied.agents.iliad.nav.world import HORIZON, NavWorld, Trip, walk_along
from embodied.agents.iliad.stages import TeachingStage
from embodied.agents.iliad.training import success_rate
from embodied.agents.iliad.writing import log_likelihood
from embodied.agents.vln.config import FollowerSettings
from embodied.agents.vln.network import FollowerNetwork
from embodied.identity import Identity, identity_of
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
        chosen, requests = _batch(trips, config.teacher_batch, rng)
        done = executor.rollout_for_dagger(chosen, requests, rng=rng)
        shown = [world.demonstrate(q, e) for q, e in zip(chosen, done, strict=True)]
        return -executor.scores(chosen, requests, done, shown).objective.sum() / len(chosen)

    judge = lambda: {"success": success_rate(world, executor, _sample(data))}
    stage = _stage("executor", folder, config.executor_iterations, config, data)
    stage.train(executor.network, loss_of, judge, note)
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
        chosen, requests = _batch(trips, config.teacher_batch, rng)
        wanted = eyes.words(requests)[:, :LONGEST_DESCRIPTION]
        logits = describer(*encoded_walks(eyes, chosen, [walk_along(t.path) for t in chosen]), wanted)
        return -log_likelihood(logits, wanted).sum() / len(wanted)

    judge = lambda: {"followed": followed(world, describer, executor, _sample(data))}
    stage = _stage("describer", folder, config.describer_iterations, config, data)
    return stage.train(describer, loss_of, judge, note)


def followed(world: NavWorld, describer: WalkDescriber, executor: NavStudent, trips: Sequence[Trip]) -> float:
    """Share of paths whose likeliest description leads the executor to their end."""
    walks = [walk_along(t.path) for t in trips]
    numbers = describer.write(*encoded_walks(executor.eyes, trips, walks), greedy_choice, LONGEST_DESCRIPTION)
    done = executor.greedy(trips, texts_of(executor.eyes.vocabulary, numbers))
    return float(np.mean([arrives(world, t, e.nodes, t.path) for t, e in zip(trips, done, strict=True)]))


def save_walker(path: Path, network: nn.Module, config: NavConfig, eyes: NavEyes, identity: Identity) -> None:
    """Write weights, settings, words, whose features they want and what they were trained with, atomically."""
    save_weights(path, "nav", network.state_dict(), _about(config, eyes), identity)


def load_follower(path: Path, eyes: NavEyes) -> NavStudent:
    """A follower that `save_walker` wrote, with its settings and the words that it knows.

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


def config_of(path: Path) -> NavConfig:
    """The settings of a follower on disk.

    Raises:
      FileNotFoundError, ValueError: as load_follower.
    """
    return load_weights(path, "nav", NavAbout, NAV_REMEDY)[1].config


def _about(config: NavConfig, eyes: NavEyes) -> NavAbout:
    return NavAbout(config, eyes.vocabulary.words, eyes.bank.digest)


def _stage(name: str, folder: Path, updates: int, config: NavConfig, data: NavData) -> TeachingStage:
    students = {"teacher", "candidates", "executor_iterations", "describer_iterations", "blind", "varied_words"}
    settings = {k: v for k, v in dataclasses.asdict(config).items() if k not in students}
    parts = {"stage": name, "updates": updates, "seed": config.data_seed, "settings": settings, "data": data.digest}
    identity, rate = identity_of("embodied.agents.iliad.nav.stages", **parts), config.teacher_rate
    about = _about(config, data.eyes)
    return TeachingStage("nav", name, Path(folder), updates, rate, config.data_seed, identity, about)


def _batch(trips: Sequence[Trip], count: int, rng: np.random.Generator) -> tuple[list[Trip], list[str]]:
    """Random trips, each with one of its requests."""
    chosen = [trips[int(i)] for i in rng.integers(len(trips), size=count)]
    return chosen, [t.requests[int(rng.integers(len(t.requests)))] for t in chosen]


def _sample(data: NavData) -> Sequence[Trip]:
    return data.splits["validation"][:: max(1, len(data.splits["validation"]) // JUDGED)]
