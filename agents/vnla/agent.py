"""VnlaAgent: a trained network with all that is needed to act again, and its file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import torch

from agents.common.agent_file import read_agent, refuse_features, write_agent
from agents.common.choosing import choose_at
from agents.common.tensor_file import put
from agents.common.vocabulary import Vocabulary
from agents.vision.bank import FeatureBank
from agents.vnla.config import ASK_RULES, VnlaSettings
from agents.vnla.network import VnlaNetwork
from agents.vnla.policy import SupervisedVnla, VnlaPolicy
from embodied.interface import Agent
from embodied.teachers.vnla import AskRules

FORMAT = "embodied-vnla-1"


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

    def policy(self, bank: FeatureBank, asker: str | None = None) -> VnlaPolicy:
        """The networks acting as they are judged.

        Args:
          asker: another than that of its training.

        Raises:
          ValueError: features of another encoder.
        """
        refuse_features(bank.digest, self.encoder_digest)
        config = self.config
        return VnlaPolicy(
            self.network,
            self.vocabulary,
            bank,
            asker=asker or config.asker,
            ask_threshold=config.ask_threshold,
            choose=choose_at(config.evaluation_temperature),
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
    config: VnlaSettings, vocabulary: Vocabulary, encoder_digest: str, feature_size: int, pictures: str = ""
) -> VnlaAgent:
    """An untrained agent; its weights follow from config.seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        network = VnlaNetwork(config, len(vocabulary), feature_size)
    return VnlaAgent(network, vocabulary, config, encoder_digest, feature_size, pictures)


def save_agent(agent: VnlaAgent, path: Path) -> None:
    """Write weights in half precision, with settings, words and what it looked at, atomically."""
    write_agent(agent, path, FORMAT, agent.pictures)


def load_agent(path: Path) -> VnlaAgent:
    """Read what `save_agent` wrote, ready to act.

    Raises:
      FileNotFoundError, OSError.
      ValueError: truncated, changed, or of another format.
    """
    file = read_agent(path, (FORMAT,), "train the agent again with `embodied train vnla`")
    config, words = VnlaSettings.from_json(file.config), Vocabulary(file.words)
    agent = new_agent(config, words, file.encoder, file.feature_size, file.pictures)
    put(agent.network, file.tensors, path)
    agent.network.eval()
    return agent
