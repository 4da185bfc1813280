"""VnlaSettings: how a VNLA agent is trained. Free of torch, so that the command line answers at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from embodied.agents.common.settings import AtLeastOne, ImitationSettings, NotAll, Whole, scales
from embodied.options import Option

RULES = ("indirect", "direct", "direct-mute", "algorithm-6")
"""Rules of play (embodied.envs.vnla)."""


@dataclass(frozen=True, kw_only=True)
class VnlaSettings(ImitationSettings):
    """The defaults are the program's; VNLA_SCALES holds smaller ones."""

    hidden_size: AtLeastOne = 512
    """Width of the LSTMs of encoder and decoder."""
    word_embedding: AtLeastOne = 256
    """Width of an embedded word."""
    navigation_embedding: AtLeastOne = 32
    """Width of an embedded navigation action."""
    ask_embedding: AtLeastOne = 32
    """Width of an embedded decision to ask."""
    budget_embedding: AtLeastOne = 16
    """Width of the embedded number of remaining requests."""
    dropout: NotAll = 0.5
    """Dropout rate in training."""
    iterations: AtLeastOne = 100_000
    """Updates of the weights; the program's direct-mute agents: 70,000."""
    looking: Whole = 10_000
    """How many updates, at the start, only teach to read panoramas."""
    batch: AtLeastOne = 100
    """Episodes per update."""
    blind: bool = False
    """Ablation without vision: all features are zero."""
    rules: Annotated[str, Option(words=RULES)] = "indirect"
    """Rule of play in evaluation. An agent of 'indirect' is trained under 'direct': the advisor's actions replace the
    learner's while what it said is in force, as in the program (docs/sources.md, S112)."""
    validate_every: AtLeastOne = 1000
    """Updates between validations."""


VNLA_SCALES = scales(VnlaSettings, "vnla")
"""'mini': some minutes of one core; 'paper': the program's, for one GPU (docs/sources.md, S113)."""
