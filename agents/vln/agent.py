"""VlnAgent: a trained follower with all that is needed to act again, and its file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import torch

from agents.common.choosing import choose_at
from agents.common.settings import EvaluationSettings
from agents.common.tensor_file import load_into
from agents.common.vocabulary import Vocabulary
from agents.common.weights import check_features, half_precision, load_weights, save_weights
from agents.common.word_vectors import found_on, vocabulary_with
from agents.vision.bank import FeatureBank
from agents.vln.config import FollowerSettings
from agents.vln.network import FollowerNetwork
from agents.vln.policy import VlnPolicy
from embodied.identity import Identity


@dataclass(frozen=True)
class VlnAbout:
    """What stands beside the weights in an agent's file."""

    config: FollowerSettings
    evaluation: EvaluationSettings
    encoder: str
    """Digest of the encoder whose features it learned from."""
    feature_size: int
    words: tuple[str, ...]
    pictures: str
    """How the pictures were drawn that it learned from: 'fast_256', 'unlit_192'."""


@dataclass(frozen=True, eq=False)
class VlnAgent:
    network: FollowerNetwork
    vocabulary: Vocabulary
    about: VlnAbout

    def policy(self, bank: FeatureBank) -> VlnPolicy:
        """The follower as it is judged.

        Raises:
          ValueError: features of another encoder.
        """
        check_features(bank.digest, self.about.encoder)
        config = self.about.config
        return VlnPolicy(
            self.network,
            self.vocabulary,
            bank.blind() if config.blind else bank,
            choose=choose_at(self.about.evaluation.evaluation_temperature),
            instruction_length=config.instruction_length,
            wordless=config.wordless,
        )


def new_agent(about: VlnAbout) -> VlnAgent:
    """An untrained agent; its weights follow from the seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(about.config.seed)
        network = FollowerNetwork(about.config, len(about.words), about.feature_size)
        vocabulary = vocabulary_with(about.words, about.config.word_vectors)
        found_on(network, vocabulary)
    return VlnAgent(network, vocabulary, about)


def save_agent(agent: VlnAgent, path: Path, identity: Identity | None = None) -> None:
    """Write weights in half precision, with settings, words and what it was trained with, atomically."""
    save_weights(path, "vln", half_precision(agent.network), agent.about, identity)


def load_agent(path: Path) -> VlnAgent:
    """Read what `save_agent` wrote, ready to act.

    Raises:
      FileNotFoundError, OSError.
      ValueError: truncated, changed, or of another format.
    """
    tensors, about = load_weights(path, "vln", VlnAbout, "train the agent again with `embodied train vln follower`")
    agent = new_agent(about)
    load_into(agent.network, tensors, path)
    agent.network.eval()
    return agent
