"""HannaAgent: trained networks with all that is needed to act again, and their file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch

from agents.common.agent_file import read_agent, refuse_features, write_agent
from agents.common.choosing import choose_at
from agents.common.shipped import SHIPPED_AGENT
from agents.common.tensor_file import put
from agents.common.vocabulary import Vocabulary
from agents.hanna.asking import RULES, ask_patiently
from agents.hanna.lstm import LstmNetwork
from agents.hanna.network import HannaNetwork
from agents.hanna.policy import HannaPolicy
from agents.hanna.training_config import TrainingConfig
from agents.vision.bank import FeatureBank

FORMAT, OLD_FORMAT = "embodied-agent-2", "embodied-agent-1"
"""The older one has no checksum."""
NETWORKS: Mapping[str, type[HannaNetwork] | type[LstmNetwork]] = {"hanna": HannaNetwork, "lstm": LstmNetwork}
SHIPPED = SHIPPED_AGENT
"""The agent of this repository; see agents/weights/README.md."""


@dataclass(frozen=True, eq=False)
class HannaAgent:
    network: HannaNetwork | LstmNetwork
    vocabulary: Vocabulary
    config: TrainingConfig
    encoder_digest: str
    """Of the encoder whose features it learned from; others mean nothing to it."""
    feature_size: int

    def policy(self, bank: FeatureBank) -> HannaPolicy:
        """The agent acting as it is judged: see the evaluation settings of TrainingConfig.

        Raises:
          ValueError: features of another encoder.
        """
        refuse_features(bank.digest, self.encoder_digest)
        config = self.config
        learned = ask_patiently(
            config.ask_threshold,
            first=config.first_ask_threshold,
            on_route=config.route_ask_threshold,
            patience=config.patience,
        )
        rule = learned if config.ask_rule == "learned" else RULES[config.ask_rule][1]
        return HannaPolicy(
            self.network,
            self.vocabulary,
            bank,
            choose=choose_at(config.evaluation_temperature),
            ask_rule=rule,
            instruction_length=config.instruction_length,
            turn_to_agent=config.turn_to_agent,
            read_assistance=config.read_assistance,
            again=config.again,
            by_image=config.by_image,
            search=config.search,
        )


def new_agent(config: TrainingConfig, vocabulary: Vocabulary, encoder_digest: str, feature_size: int) -> HannaAgent:
    """An untrained agent; its weights follow from config.seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        network = NETWORKS[config.model](config.network_config(len(vocabulary), feature_size))
    return HannaAgent(network, vocabulary, config, encoder_digest, feature_size)


def save_agent(agent: HannaAgent, path: Path) -> None:
    """Write weights in half precision, with settings and vocabulary, atomically."""
    write_agent(agent, path, FORMAT)


def load_agent(path: Path = SHIPPED) -> HannaAgent:
    """Read what `save_agent` wrote, ready to act.

    Raises:
      FileNotFoundError, OSError.
      ValueError: truncated, changed, or of another format.
    """
    file = read_agent(path, (FORMAT, OLD_FORMAT), "train the agent again with `embodied train hanna`")
    config = TrainingConfig.from_json(file.config)
    agent = new_agent(config, Vocabulary(file.words), file.encoder, file.feature_size)
    put(agent.network, file.tensors, path)
    agent.network.eval()
    return agent


def take_weights(agent: HannaAgent, other: HannaAgent, source: Path) -> None:
    """Copy the weights of `other`, read from `source`, into `agent`.

    Raises:
      ValueError: their networks differ, or the features that they know.
    """
    sizes = [a.config.network_config(len(a.vocabulary), a.feature_size) for a in (agent, other)]
    if (agent.encoder_digest, agent.config.model, sizes[0]) != (other.encoder_digest, other.config.model, sizes[1]):
        raise ValueError(
            f"{source} cannot be begun with: it is a {other.config.model!r} of {sizes[1]} on encoder "
            f"{other.encoder_digest[:12]}, this run a {agent.config.model!r} of {sizes[0]} on encoder "
            f"{agent.encoder_digest[:12]}; give this run its settings"
        )
    agent.network.load_state_dict(other.network.state_dict())
