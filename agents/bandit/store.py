"""Weights of translators and critics on disk, with the words they know."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from torch import nn

from agents.bandit.config import BanditConfig
from agents.bandit.network import Translator
from agents.bandit.words import WordNumbers, lexicon_from_json
from agents.common.tensor_file import put
from agents.common.weights import load_weights, save_weights
from embodied.identity import Identity
from embodied.records import parse

if TYPE_CHECKING:
    from agents.bandit.training import NumberedCorpus

REMEDY = "delete it and train it again with `embodied study bandit`"


@dataclass(frozen=True)
class BanditAbout:
    """What stands beside the weights in a file."""

    config: BanditConfig
    lexicons: tuple[str, str]
    """Words of the two languages, as JSON."""


def save_network(network: nn.Module, m: NumberedCorpus, path: Path, identity: Identity) -> None:
    """Write weights, settings, words and what they were trained with, atomically."""
    source, target = (json.dumps(x.to_json()) for x in m.lexicons)
    save_weights(path, "bandit", network.state_dict(), BanditAbout(m.config, (source, target)), identity)


def load_network(network: nn.Module, path: Path) -> None:
    """Put what `save_network` wrote into `network`.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    put(network, load_weights(path, "bandit", BanditAbout, REMEDY)[0], path)


def load_translator(path: Path) -> tuple[Translator, tuple[WordNumbers, WordNumbers], BanditConfig]:
    """A trained translator with its words and settings.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    tensors, told = load_weights(path, "bandit", BanditAbout, REMEDY)
    try:
        source, target = (lexicon_from_json(_object(text)) for text in told.lexicons)
    except (KeyError, TypeError, AttributeError, ValueError) as e:
        raise ValueError(f"{path} holds words of a language that cannot be read ({e!r}); {REMEDY}") from e
    translator = Translator(len(source), len(target), told.config.hidden_size)
    put(translator, tensors, path)
    return translator, (source, target), told.config


def _object(text: str) -> dict[str, Any]:
    value = parse(text, "words")
    if not isinstance(value, dict):
        raise ValueError(f"expected an object, got {text[:60]!r}")
    return value
