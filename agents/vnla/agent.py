"""VnlaAgent: a trained network with all that is needed to act again, and its file."""

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
from agents.vnla.config import ASK_RULES, VnlaSettings
from agents.vnla.network import VnlaNetwork
from agents.vnla.policy import SupervisedVnla, VnlaPolicy
from embodied.identity import Identity
from embodied.interface import Agent
from embodied.teachers.vnla import AskRules

LIKELIEST = EvaluationSettings()


@dataclass(frozen=True)
class VnlaAbout:
    """What stands beside the weights in an agent's file."""

    config: VnlaSettings
    evaluation: EvaluationSettings
    encoder: str
    """Digest of the encoder whose features it learned from."""
    feature_size: int
    words: tuple[str, ...]
    pictures: str


@dataclass(frozen=True, eq=False)
class VnlaAgent:
    network: VnlaNetwork
    vocabulary: Vocabulary
    config: VnlaSettings
    encoder_digest: str
    """Of the encoder whose features it learned from; others mean nothing to it."""
    feature_size: int
    pictures: str = ""
    """How the pictures were drawn that it learned from: 'fast_256', 'unlit_192'."""
    evaluation: EvaluationSettings = LIKELIEST
    """How it is judged, if nobody says otherwise."""

    def policy(self, bank: FeatureBank, asker: str | None = None) -> VnlaPolicy:
        """The networks acting as they are judged.

        Args:
          asker: another than that of its training.

        Raises:
          ValueError: features of another encoder.
        """
        check_features(bank.digest, self.encoder_digest)
        config = self.config
        return VnlaPolicy(
            self.network,
            self.vocabulary,
            bank,
            asker=asker or config.asker,
            ask_threshold=self.evaluation.ask_threshold,
            choose=choose_at(self.evaluation.evaluation_temperature),
            instruction_length=config.instruction_length,
        )

    def player(self, bank: FeatureBank, asker: str | None = None) -> Agent:
        """The agent as it is judged: shown the situations only where its asker needs them."""
        policy = self.policy(bank, asker)
        return SupervisedVnla(policy, rules_of(self.config)) if policy.asker in ("random", "teacher") else policy


def rules_of(config: VnlaSettings) -> AskRules:
    """What its asking teacher goes by."""
    return AskRules(only=ASK_RULES[config.ask_rules])


def new_agent(
    config: VnlaSettings,
    vocabulary: Vocabulary,
    encoder_digest: str,
    feature_size: int,
    pictures: str = "",
    evaluation: EvaluationSettings = LIKELIEST,
) -> VnlaAgent:
    """An untrained agent; its weights follow from config.seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        network = VnlaNetwork(config, len(vocabulary), feature_size)
        vocabulary = vocabulary_with(vocabulary.words, config.word_vectors)
        found_on(network, vocabulary)
    return VnlaAgent(network, vocabulary, config, encoder_digest, feature_size, pictures, evaluation)


def save_agent(agent: VnlaAgent, path: Path, identity: Identity | None = None) -> None:
    """Write weights in half precision, with settings, words and what it was trained with, atomically."""
    words = agent.vocabulary.words
    about = VnlaAbout(agent.config, agent.evaluation, agent.encoder_digest, agent.feature_size, words, agent.pictures)
    save_weights(path, "vnla", half_precision(agent.network), about, identity)


def load_agent(path: Path) -> VnlaAgent:
    """Read what `save_agent` wrote, ready to act.

    Raises:
      FileNotFoundError, OSError.
      ValueError: truncated, changed, or of another format.
    """
    tensors, told = load_weights(path, "vnla", VnlaAbout, "train the agent again with `embodied train vnla`")
    words = Vocabulary(told.words)
    agent = new_agent(told.config, words, told.encoder, told.feature_size, told.pictures, told.evaluation)
    load_into(agent.network, tensors, path)
    agent.network.eval()
    return agent
