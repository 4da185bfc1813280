"""Agents that see features and learn by imitation: what stands beside the weights, and their file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

from torch import nn

from embodied.agents.common.settings import EvaluationSettings, ImitationSettings
from embodied.agents.common.vocabulary import Vocabulary, use_vectors, vocabulary_with
from embodied.agents.common.weights import half_precision, load_into, load_weights, save_weights, seeded
from embodied.records import Identity


@dataclass(frozen=True, kw_only=True)
class About:
    """Metadata beside the weights in an agent's file; learners name the types of their settings."""

    config: ImitationSettings
    evaluation: EvaluationSettings = EvaluationSettings()
    """How it is judged, if nobody says otherwise."""
    encoder: str
    """Digest of the encoder whose features it learned from; others mean nothing to it."""
    feature_size: int
    words: tuple[str, ...]
    pictures: str = ""
    """How the pictures were drawn that it learned from: 'fast_256', 'unlit_192'."""


@dataclass(frozen=True, eq=False)
class SightedAgent:
    """A network with all that is needed to act again. A learner says `kind`, `about`, `network_of` and `policy`."""

    about: Any
    network: Any
    vocabulary: Vocabulary

    kind: ClassVar[str]
    """Of its file."""
    about_kind: ClassVar[type[About]]

    @staticmethod
    def network_of(about: Any) -> nn.Module:
        """With random weights."""
        raise NotImplementedError

    def policy(self, bank: Any) -> Any:
        """The agent as it is judged, with features that it sees.

        Raises:
          ValueError: features of another encoder.
        """
        raise NotImplementedError

    @property
    def config(self) -> Any:
        return self.about.config

    @classmethod
    def new(cls, about: About) -> Self:
        """An untrained agent; its weights follow from the seed."""
        with seeded(about.config.seed):
            network, vocabulary = cls.network_of(about), vocabulary_with(about.words, about.config.word_vectors)
            use_vectors(network, vocabulary)
            return cls(about, network, vocabulary)

    def save(self, path: Path, identity: Identity | None = None) -> None:
        """Write weights in half precision, with settings, words and what it was trained with, atomically."""
        save_weights(path, self.kind, half_precision(self.network), self.about, identity)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read what `save` wrote, ready to act.

        Raises:
          FileNotFoundError, OSError.
          ValueError: truncated, changed, or of another format.
        """
        tensors, about = load_weights(path, cls.kind, cls.about_kind, "train the agent again with `embodied train`")
        agent = cls.new(about)
        load_into(agent.network, tensors, path)
        agent.network.eval()
        return agent
