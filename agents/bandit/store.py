"""Weights of translators and critics on disk, with the words they know."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from torch import nn

from agents.bandit.config import BanditConfig
from agents.bandit.network import Translator
from agents.bandit.words import WordNumbers, lexicon_from_json
from agents.common.tensor_file import load_tensors, put, save_tensors
from embodied.records import from_json, from_plain, parse

if TYPE_CHECKING:
    from agents.bandit.training import NumberedCorpus

FORMATS = ("embodied-bandit-2", "embodied-bandit-1")
"""The newest first; the older one has no checksum."""
REMEDY = "delete it and train it again with `embodied study bandit`"


@dataclass(frozen=True)
class _About:
    """What stands beside the weights in a file, as text."""

    format: str
    config: str
    lexicons: str


def save_weights(network: nn.Module, m: NumberedCorpus, path: Path) -> None:
    """Write weights, settings and words, atomically."""
    about = {
        "format": FORMATS[0],
        "config": m.config.to_json(),
        "lexicons": json.dumps([x.to_json() for x in m.lexicons]),
    }
    save_tensors(Path(path), network.state_dict(), about)


def load_weights(network: nn.Module, path: Path) -> None:
    """Put what `save_weights` wrote into `network`.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    put(network, load_tensors(path, FORMATS, REMEDY)[0], path)


def load_translator(path: Path) -> tuple[Translator, tuple[WordNumbers, WordNumbers], BanditConfig]:
    """A trained translator with its words and settings.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    tensors, about = load_tensors(path, FORMATS, REMEDY)
    told = from_plain(_About, about, str(path))
    config = from_json(BanditConfig, told.config)
    lexicons = parse(told.lexicons, "two lexicons")
    if not isinstance(lexicons, list) or len(lexicons) != 2:
        raise ValueError(f"{path} should hold the words of two languages; {REMEDY}")
    try:
        source, target = map(lexicon_from_json, lexicons)
    except (KeyError, TypeError, AttributeError, ValueError) as e:
        raise ValueError(f"{path} holds words of a language that cannot be read ({e!r}); {REMEDY}") from e
    translator = Translator(len(source), len(target), config.hidden_size)
    put(translator, tensors, path)
    return translator, (source, target), config
