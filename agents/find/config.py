"""Settings of agents that find things. Free of torch."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.agents.common.settings import AT_LEAST_ONE, NOT_ALL, ImitationSettings, require, require_word

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

    agent: str = "network"
    """'network' learns where to look; 'detector' explores the nearest frontier and goes to what it recognises."""
    sees: str = "all"
    """Ablations of vision: 'all': none; 'map': the network sees black pictures, its map still recognises places;
    'nothing': both see black pictures."""
    hidden_size: int = 128
    """Width of the network."""
    dropout: float = 0.3
    """Dropout rate of features and hidden units."""
    iterations: int = 800
    """Updates of the weights."""
    learning_rate: float = 3e-3
    """Learning rate of Adam."""
    cooldown: float = 0.5
    """The last share of the updates, over which the learning rate falls to zero."""
    validate_every: int = 400
    """Updates between validations."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_word(self, "agent", AGENTS)
        require_word(self, "sees", SEES_WHAT)
        require(self, AT_LEAST_ONE, "hidden_size")
        require(self, NOT_ALL, "dropout")
