"""Weights of translators and critics on disk, with the words they know."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import safetensors
import safetensors.torch
from torch import nn

from agents.bandit.config import BanditConfig
from agents.bandit.network import Translator
from agents.bandit.words import Lexicon, lexicon_from_json
from agents.tensor_file import read_weights
from assets.cache import atomic_path

if TYPE_CHECKING:
    from agents.bandit.training import Material

FORMAT = "embodied-bandit-1"


def save_weights(network: nn.Module, m: Material, path: Path) -> None:
    """Write weights, settings and words, atomically."""
    about = {"format": FORMAT, "config": m.config.to_json(), "lexicons": json.dumps([x.to_json() for x in m.lexicons])}
    tensors = {k: v.detach().contiguous() for k, v in network.state_dict().items()}
    with atomic_path(Path(path)) as temporary:
        safetensors.torch.save_file(tensors, temporary, metadata=about)


def load_weights(network: nn.Module, path: Path) -> None:
    """Put what `save_weights` wrote into `network`.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    network.load_state_dict(read_weights(Path(path)))


def load_translator(path: Path) -> tuple[Translator, tuple[Lexicon, Lexicon], BanditConfig]:
    """A trained translator with its words and settings.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    tensors = read_weights(Path(path))
    with safetensors.safe_open(path, "pt") as f:
        about = f.metadata() or {}
    if about.get("format") != FORMAT:
        raise ValueError(f"{path}: format {about.get('format')!r}, this version reads {FORMAT!r}; train it again")
    config = BanditConfig(**json.loads(about["config"]))
    source, target = (lexicon_from_json(body) for body in json.loads(about["lexicons"]))
    translator = Translator(len(source), len(target), config.hidden_size)
    translator.load_state_dict(tensors)
    return translator, (source, target), config
