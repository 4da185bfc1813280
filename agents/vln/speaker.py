"""The speaker L0(d | e): it scores descriptions of walks, and so chooses between a follower's walks (Eq 2.19).

The network is NAV's describer; a walk of more than agents.iliad.nav.world.HORIZON nodes is described by its first ones.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from embodied.agents.common.choosing import choose_sampled
from embodied.agents.common.session import Note
from embodied.agents.common.tensor_file import load_into
from embodied.agents.common.vocabulary import Vocabulary, build_vocabulary
from embodied.agents.common.weights import check_features, load_weights, seeded
from embodied.agents.iliad.nav.network import WalkDescriber
from embodied.agents.iliad.nav.student import NavEyes
from embodied.agents.iliad.nav.teacher import encoded_walks
from embodied.agents.iliad.nav.world import HORIZON, Trip, walk_along
from embodied.agents.iliad.stages import TeachingStage
from embodied.agents.iliad.writing import log_likelihood
from embodied.agents.vision.bank import FeatureBank
from embodied.agents.vision.training_data import TrainingData
from embodied.agents.vln.agent import VlnAgent
from embodied.agents.vln.config import SpeakerSettings
from embodied.agents.vln.network import COPIES
from embodied.datasets.store import SplitData
from embodied.evaluation.rollout import play
from embodied.identity import Identity, identity_of
from embodied.interface import Episode, FollowRoute, Place, Task
from embodied.kinds.metrics import without_repeats
from embodied.seeds import stream

LONGEST_INSTRUCTION = 60
"""Words of a description."""
JUDGED = 200
"""Walks that the speaker is judged on between its updates."""
SPEAKER_BATCH = 64


@dataclass(frozen=True)
class SpeakerAbout:
    """Metadata beside the weights in a speaker's file."""

    config: SpeakerSettings
    encoder: str
    """Digest of the encoder whose features it learned from."""
    feature_size: int
    words: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class InstructionSpeaker:
    network: WalkDescriber
    about: SpeakerAbout

    def eyes(self, places: dict[str, Place], bank: FeatureBank) -> NavEyes:
        """The features of some houses.

        Raises:
          ValueError: features of another encoder.
        """
        check_features(bank.digest, self.about.encoder)
        return NavEyes(places, bank, Vocabulary(self.about.words))


def new_speaker(about: SpeakerAbout) -> InstructionSpeaker:
    """An untrained speaker; its weights follow from the seed."""
    c = about.config
    with seeded(int(stream(c.seed, "speaker", "begin").integers(2**31))):
        seen = about.feature_size + 4 * COPIES
        network = WalkDescriber(len(about.words), c.hidden_size, c.heads, seen, HORIZON)
    return InstructionSpeaker(network, about)


def load_speaker(path: Path) -> InstructionSpeaker:
    """
    Raises:
      FileNotFoundError, OSError.
      ValueError: truncated, changed, or of another format.
    """
    tensors, about = load_weights(path, "vln-speaker", SpeakerAbout, "train it again with `embodied train vln speaker`")
    speaker = new_speaker(about)
    load_into(speaker.network, tensors, path)
    speaker.network.eval()
    return speaker


def train_speaker(source: TrainingData, config: SpeakerSettings, folder: Path, *, note: Note = print) -> Path:
    """Train, or go on training, the speaker of a folder by maximum likelihood; returns its file."""
    training, judged = source.split("train"), source.split("val_unseen", limit=JUDGED)
    words = build_vocabulary(t.request for t in training.tasks).words
    speaker = new_speaker(SpeakerAbout(config, source.encoder.digest, source.encoder.size, words))
    eyes = speaker.eyes(dict(training.worlds), training.bank)

    def loss_of(rng: np.random.Generator) -> Tensor:
        chosen = [training.tasks[int(i)] for i in rng.integers(len(training.tasks), size=config.batch)]
        log, written = _scored(speaker, eyes, chosen, [_path(t) for t in chosen])
        return -log.sum() / (written != 0).sum()

    @torch.no_grad()
    def judge() -> dict[str, float]:
        looking = speaker.eyes(dict(judged.worlds), judged.bank)
        log, written = _scored(speaker, looking, judged.tasks, [_path(t) for t in judged.tasks])
        return {"unseen loss": float(-log.sum() / (written != 0).sum())}

    identity = speaker_identity(source, config)
    stage = TeachingStage(
        "vln-speaker", "speaker", folder, config.iterations, config.learning_rate, config.seed, identity, speaker.about
    )
    stage.train(speaker.network, loss_of, judge, note)
    return Path(folder) / "speaker.safetensors"


def speaker_identity(source: TrainingData, config: SpeakerSettings) -> Identity:
    """All that a trained speaker depends on."""
    return identity_of("embodied.agents.vln.speaker", settings=config, **source.identity())


def _path(task: Task) -> tuple[int, ...]:
    assert isinstance(task.goal, FollowRoute), "tasks of VLN follow routes"
    return task.goal.path


def _scored(
    speaker: InstructionSpeaker, eyes: NavEyes, tasks: Sequence[Task], paths: Sequence[Sequence[int]]
) -> tuple[Tensor, Tensor]:
    """(B, W) log L0 of each word of the tasks' requests, given walks along `paths`, and the words."""
    trips = [Trip(t.world, t.start, tuple(p), (t.request,)) for t, p in zip(tasks, paths, strict=True)]
    words = eyes.words([t.request for t in tasks])[:, :LONGEST_INSTRUCTION]
    logits = speaker.network(*encoded_walks(eyes, trips, [walk_along(p) for p in paths]), words)
    return log_likelihood(logits, words), words


@torch.no_grad()
def reranked(
    split: SplitData,
    tasks: Sequence[Task],
    follower: VlnAgent,
    speaker: InstructionSpeaker,
    bank: FeatureBank,
    *,
    candidates: int,
    seed: int,
) -> list[Episode]:
    """Of each task, the one of the follower's walks of which the speaker would most likely say d* (Eq 2.19).

    Args:
      candidates: K, the likeliest walk and K - 1 that are sampled.
    """
    policy = follower.policy(bank)
    sampling = dataclasses.replace(policy, choose=choose_sampled)
    tries = [play(split.make_env, policy, tasks, seed=seed, batch=SPEAKER_BATCH)]
    tries += [
        play(
            split.make_env, sampling, tasks, seed=int(stream(seed, "candidate", k).integers(2**31)), batch=SPEAKER_BATCH
        )
        for k in range(1, candidates)
    ]
    eyes, scores = speaker.eyes(dict(split.worlds), bank), []
    for episodes in tries:
        rows = []
        for i in range(0, len(tasks), SPEAKER_BATCH):
            some = episodes[i : i + SPEAKER_BATCH]
            paths = [without_repeats(e.nodes) for e in some]
            rows.append(_scored(speaker, eyes, tasks[i : i + SPEAKER_BATCH], paths)[0].sum(1))
        scores.append(torch.cat(rows))
    best = torch.stack(scores).argmax(0).tolist()
    return [tries[k][i] for i, k in enumerate(best)]
