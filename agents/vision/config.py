"""VisionConfig: how the encoder is trained. Free of torch, so that the command line answers at once."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class VisionConfig:
    """How the encoder is trained."""

    network: str = "compact"
    """'compact' or one of 'resnet18' to 'resnet152' (resnet.ARCHITECTURES)."""
    training_houses: int = 0
    """Learn from so many of the data set's training houses; 0: from all."""
    epochs: int = 6
    """Times that every strip is seen."""
    batch: int = 8
    """Strips per update."""
    learning_rate: float = 2e-3
    """Highest rate of a one-cycle schedule."""
    weight_decay: float = 1e-2
    """Of AdamW."""
    least_views: int = 50
    """A class is learned if it is visible in at least this many training views."""
    seed: int = 0
    """Of everything that is drawn."""
