"""Settings of agents that find things. Free of torch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from embodied.agents.common.settings import AtLeastOne, ImitationSettings, NotAll, Positive, Share
from embodied.options import Option

SEES_WHAT = ("all", "map", "nothing")
THINGS = (
    *("bed", "dining chair", "potted plant", "sofa", "television", "toilet"),
    *("bathtub", "cooker", "desk", "fridge", "wardrobe", "washing machine"),
)
"""Classes that are looked for: the six categories of Habitat's ObjectNav challenge of 2022 and six more of its kind."""
AGENTS = ("network", "detector")


@dataclass(frozen=True, kw_only=True)
class FinderConfig(ImitationSettings):
    """Of an agent that learns to find things (DAgger), or of the explorer with a detector beside it."""

    agent: Annotated[str, Option(words=AGENTS)] = "network"
    """'network' learns where to look; 'detector' explores the nearest frontier and goes to what it recognises."""
    sees: Annotated[str, Option(words=SEES_WHAT)] = "all"
    """Ablations of vision: 'all': none; 'map': the network sees black pictures, its map still recognises places;
    'nothing': both see black pictures."""
    hidden_size: AtLeastOne = 128
    """Width of the network."""
    dropout: NotAll = 0.3
    """Dropout rate of features and hidden units."""
    iterations: AtLeastOne = 800
    """Updates of the weights."""
    learning_rate: Positive = 3e-3
    """Learning rate of Adam."""
    cooldown: Share = 0.5
    """The last share of the updates, over which the learning rate falls to zero."""
    validate_every: AtLeastOne = 400
    """Updates between validations."""
