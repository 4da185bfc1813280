"""HannaAgent: trained networks with all that is needed to act again, and their file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch

from agents.common.choosing import choose_at
from agents.common.shipped import SHIPPED_AGENT
from agents.common.tensor_file import load_into
from agents.common.vocabulary import Vocabulary
from agents.common.weights import check_features, half_precision, load_weights, save_weights
from agents.common.word_vectors import found_on, vocabulary_with
from agents.hanna.asking import RULES, ask_patiently
from agents.hanna.lstm import LstmNetwork
from agents.hanna.network import HannaNetwork
from agents.hanna.policy import HannaPolicy
from agents.hanna.training_config import HannaEvaluation, TrainingConfig
from agents.vision.bank import FeatureBank
from embodied.identity import Identity

NETWORKS: Mapping[str, type[HannaNetwork] | type[LstmNetwork]] = {"hanna": HannaNetwork, "lstm": LstmNetwork}
AS_PUBLISHED = HannaEvaluation()
SHIPPED = SHIPPED_AGENT
"""The agent of this repository; see agents/weights/README.md."""


@dataclass(frozen=True)
class HannaAbout:
    """What stands beside the weights in an agent's file."""

    config: TrainingConfig
    evaluation: HannaEvaluation
    encoder: str
    """Digest of the encoder whose features it learned from."""
    feature_size: int
    words: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class HannaAgent:
    network: HannaNetwork | LstmNetwork
    vocabulary: Vocabulary
    config: TrainingConfig
    encoder_digest: str
    """Of the encoder whose features it learned from; others mean nothing to it."""
    feature_size: int
    evaluation: HannaEvaluation = AS_PUBLISHED
    """How it is judged, if nobody says otherwise."""

    def policy(self, bank: FeatureBank) -> HannaPolicy:
        """The agent acting as it is judged: see HannaEvaluation.

        Raises:
          ValueError: features of another encoder.
        """
        check_features(bank.digest, self.encoder_digest)
        config, judged = self.config, self.evaluation
        learned = ask_patiently(
            judged.ask_threshold,
            first=judged.first_ask_threshold,
            on_route=judged.route_ask_threshold,
            patience=judged.min_moves_between_requests,
        )
        rule = learned if config.ask_rule == "learned" else RULES[config.ask_rule][1]
        return HannaPolicy(
            self.network,
            self.vocabulary,
            bank,
            choose=choose_at(judged.evaluation_temperature),
            ask_rule=rule,
            instruction_length=config.instruction_length,
            turn_to_agent=config.turn_to_agent,
            read_assistance=config.read_assistance,
            revisit_weight=judged.revisit_weight,
            use_goal_image=judged.use_goal_image,
            frontier_discount=judged.frontier_discount,
        )


def new_agent(
    config: TrainingConfig,
    vocabulary: Vocabulary,
    encoder_digest: str,
    feature_size: int,
    evaluation: HannaEvaluation = AS_PUBLISHED,
) -> HannaAgent:
    """An untrained agent; its weights follow from config.seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        network = NETWORKS[config.model](config.network_config(len(vocabulary), feature_size))
        vocabulary = vocabulary_with(vocabulary.words, config.word_vectors)
        found_on(network, vocabulary)
    return HannaAgent(network, vocabulary, config, encoder_digest, feature_size, evaluation)


def save_agent(agent: HannaAgent, path: Path, identity: Identity | None = None) -> None:
    """Write weights in half precision, with settings, vocabulary and what it was trained with, atomically."""
    words = agent.vocabulary.words
    about = HannaAbout(agent.config, agent.evaluation, agent.encoder_digest, agent.feature_size, words)
    save_weights(path, "hanna", half_precision(agent.network), about, identity)


def load_agent(path: Path = SHIPPED) -> HannaAgent:
    """Read what `save_agent` wrote, ready to act.

    Raises:
      FileNotFoundError, OSError.
      ValueError: truncated, changed, or of another format.
    """
    tensors, told = load_weights(path, "hanna", HannaAbout, "train the agent again with `embodied train hanna`")
    agent = new_agent(told.config, Vocabulary(told.words), told.encoder, told.feature_size, told.evaluation)
    load_into(agent.network, tensors, path)
    agent.network.eval()
    return agent


def take_weights(agent: HannaAgent, other: HannaAgent, source: Path) -> None:
    """Copy the weights of `other`, read from `source`, into `agent`.

    Raises:
      ValueError: their networks differ, or the features that they know.
    """
    sizes = [a.config.network_config(len(a.vocabulary), a.feature_size) for a in (agent, other)]
    if [_kind(agent), sizes[0]] != [_kind(other), sizes[1]]:
        raise ValueError(
            f"{source} cannot be begun with: it is a {other.config.model!r} of {sizes[1]} on encoder "
            f"{other.encoder_digest[:12]}, this run a {agent.config.model!r} of {sizes[0]} on encoder "
            f"{agent.encoder_digest[:12]}; give this run its settings"
        )
    agent.network.load_state_dict(other.network.state_dict())


def _kind(agent: HannaAgent) -> tuple[str, str, str]:
    return agent.encoder_digest, agent.config.model, agent.config.word_vectors
