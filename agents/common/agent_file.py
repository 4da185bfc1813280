"""Agents by imitation on disk: weights in half precision, settings, words, and whose features they learned from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from torch import Tensor, nn

from agents.common.tensor_file import load_tensors, save_tensors
from embodied.records import from_plain, parse


class JsonSettings(Protocol):
    def to_json(self) -> str: ...


class KnownWords(Protocol):
    @property
    def words(self) -> tuple[str, ...]: ...


class TrainedAgent(Protocol):
    """What an agent's file holds of it."""

    @property
    def network(self) -> nn.Module: ...
    @property
    def vocabulary(self) -> KnownWords: ...
    @property
    def config(self) -> JsonSettings: ...
    @property
    def encoder_digest(self) -> str: ...
    @property
    def feature_size(self) -> int: ...


@dataclass(frozen=True)
class AgentSettings:
    """What stands beside the weights in an agent's file, as text."""

    format: str
    config: str
    """JsonSettings as JSON."""
    encoder: str
    """Digest of the encoder whose features it learned from."""
    feature_size: str
    vocabulary: str
    """KnownWords as a JSON list."""
    pictures: str = ""
    """How the pictures were drawn that the features come from; '' where that was not written down."""


@dataclass(frozen=True, eq=False)
class AgentFile:
    """An agent's file as it was read."""

    tensors: dict[str, Tensor]
    """Of the network, float32."""
    config: str
    encoder: str
    feature_size: int
    words: tuple[str, ...]
    pictures: str


def write_agent(agent: TrainedAgent, path: Path, kind: str, pictures: str = "") -> None:
    """Write `agent`, atomically.

    Args:
      kind: name and version of the format.
    """
    settings = {
        "format": kind,
        "config": agent.config.to_json(),
        "encoder": agent.encoder_digest,
        "feature_size": str(agent.feature_size),
        "vocabulary": json.dumps(agent.vocabulary.words),
    }
    if pictures:
        settings["pictures"] = pictures
    save_tensors(Path(path), {k: v.detach().half() for k, v in agent.network.state_dict().items()}, settings)


def read_agent(path: Path, kinds: Sequence[str], remedy: str) -> AgentFile:
    """What `write_agent` wrote; arguments as of tensor_file.load_tensors.

    Raises:
      FileNotFoundError, OSError.
      ValueError: truncated, changed, or of another format.
    """
    tensors, about = load_tensors(path, kinds, remedy)
    settings = from_plain(AgentSettings, about, str(path))
    words = parse(settings.vocabulary, "a vocabulary")
    if not isinstance(words, list) or not all(isinstance(w, str) for w in words) or not settings.feature_size.isdigit():
        raise ValueError(f"{path}: its vocabulary should be a list of words and its feature size a number")
    weights = {k: v.float() for k, v in tensors.items()}
    size = int(settings.feature_size)
    return AgentFile(weights, settings.config, settings.encoder, size, tuple(words), settings.pictures)


def refuse_features(found: str, learned_from: str) -> None:
    """Raises ValueError where features come from another encoder than the one that an agent learned from."""
    if found != learned_from:
        raise ValueError(
            f"the features come from encoder {found[:12]}, the agent learned from {learned_from[:12]}; "
            "make features with its encoder (`embodied features DATASET --encoder FILE`) or train a new agent"
        )
