"""Weights of translators and critics on disk, with the words they know."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from torch import nn

from agents.bandit.config import BanditConfig
from agents.common.tensor_file import load_into
from agents.common.vocabulary import Vocabulary
from agents.common.weights import load_weights, save_weights
from embodied.identity import Identity

REMEDY = "delete it and train it again with `embodied study bandit`"


@dataclass(frozen=True)
class BanditAbout:
    """What stands beside the weights in a file."""

    config: BanditConfig
    source: tuple[str, ...]
    target: tuple[str, ...]
    """The words of the two languages."""


def save_network(
    network: nn.Module, config: BanditConfig, lexicons: tuple[Vocabulary, Vocabulary], path: Path, identity: Identity
) -> None:
    """Write weights, settings, words and what they were trained with, atomically."""
    source, target = (x.words for x in lexicons)
    save_weights(path, "bandit", network.state_dict(), BanditAbout(config, source, target), identity)


def load_network(network: nn.Module, path: Path) -> None:
    """Put what `save_network` wrote into `network`.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    load_into(network, load_weights(path, "bandit", BanditAbout, REMEDY)[0], path)
