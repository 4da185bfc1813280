"""VnlaSettings: how a VNLA agent is trained. Free of torch, so that the command line answers at once."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass

from agents.imitation.settings import (
    AT_LEAST_ONE,
    NOT_ALL,
    NOT_NEGATIVE,
    SHARE,
    ValidatedRunSettings,
    require,
    require_word,
)
from embodied.records import from_json

ASKERS = ("none", "first", "random", "teacher", "learned")
"""Who decides when to ask (docs/sources.md, S51)."""
TRAINED_UNDER: Mapping[str, str] = {
    "indirect": "direct",
    "direct": "direct",
    "direct-mute": "direct-mute",
    "goal-aware": "goal-aware",
    "algorithm-6": "algorithm-6",
}
"""Rule of play that an agent is judged under, to that which it is trained under: in training the advisor's actions
replace the learner's while what it said is in force, as in the program (docs/sources.md, S112)."""
ASK_RULES: Mapping[str, tuple[str, ...]] = {
    "all": ("arrive", "deviate", "uncertain", "unmoved", "remain"),
    "a and e": ("arrive", "deviate"),
    "b to d": ("uncertain", "unmoved", "remain"),
}
"""Rules that the asking teacher goes by, by the names of the paper's ablation."""


@dataclass(frozen=True, kw_only=True)
class VnlaSettings(ValidatedRunSettings):
    """The defaults are the program's; SCALES holds smaller ones."""

    hidden_size: int = 512
    """Width of the encoder's and the decoder's LSTM."""
    word_embedding: int = 256
    """Width of an embedded word."""
    navigation_embedding: int = 32
    """Width of an embedded navigation action."""
    ask_embedding: int = 32
    """Width of an embedded decision to ask."""
    budget_embedding: int = 16
    """Width of an embedded number of requests that are left."""
    coverage: int = 10
    """Width of what is remembered of every word: how much attention it had."""
    dropout: float = 0.5
    """Share of units that are silent in training."""
    iterations: int = 100_000
    """Updates of the weights; the program's direct-mute agents: 70,000."""
    cooldown: float = 0.0
    """The last share of the updates, over which the learning rate falls linearly to zero (docs/sources.md, S113)."""
    weight_decay: float = 5e-4
    """Of Adam."""
    batch: int = 100
    """Episodes per update."""
    training_houses: int = 0
    """Learn from so many of the data set's training houses; 0: from all."""
    instruction_length: int = 50
    """Words of an instruction that are read, the end included."""
    asker: str = "learned"
    """Who decides when to ask, in training and when judged: 'none', 'first', 'random', 'teacher' or 'learned'."""
    ask_rules: str = "all"
    """Rules of the asking teacher: 'all', 'a and e' or 'b to d'."""
    rules: str = "indirect"
    """Rule of play that it is judged under: indirect, direct, direct-mute, goal-aware or algorithm-6."""
    environment_dropout: float = 0.0
    """Share of feature channels hidden for a whole training episode (Tan et al. 2019; docs/sources.md, S113)."""
    evaluation_temperature: float = 0.0
    """How navigation actions are chosen when judged: 0 takes the likeliest, as the program; 1 draws."""
    ask_threshold: float = 0.5
    """When judged, the learned asker asks where asking is more probable than this."""
    evaluation_batch: int = 64
    """Has no influence on results here, only on speed."""
    validate_every: int = 1000
    """Updates between validations."""
    validation_tasks: int = 200
    """Tasks of each validation."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_word(self, "asker", ASKERS)
        require_word(self, "ask_rules", tuple(ASK_RULES))
        require_word(self, "rules", tuple(TRAINED_UNDER))
        require(self, AT_LEAST_ONE, "hidden_size", "word_embedding", "navigation_embedding", "ask_embedding")
        require(self, AT_LEAST_ONE, "budget_embedding", "coverage", "instruction_length", "evaluation_batch")
        require(self, NOT_NEGATIVE, "weight_decay", "evaluation_temperature", "training_houses")
        require(self, NOT_ALL, "dropout", "environment_dropout")
        require(self, SHARE, "cooldown", "ask_threshold")

    def to_json(self) -> str:
        return json.dumps(dataclasses.asdict(self), sort_keys=True)

    @staticmethod
    def from_json(text: str) -> VnlaSettings:
        """Read what `to_json` wrote; unknown fields are refused."""
        return from_json(VnlaSettings, text)


SCALES: dict[str, VnlaSettings] = {
    "mini": VnlaSettings(
        hidden_size=256,
        dropout=0.3,
        iterations=1500,
        learning_rate=7e-4,
        cooldown=0.4,
        batch=64,
        environment_dropout=0.4,
        instruction_length=40,
        validate_every=250,
        validation_tasks=200,
    ),
    "paper": VnlaSettings(),
}
"""'mini': some 20 minutes of one core; 'paper': the program's, for one GPU (docs/sources.md, S113)."""
MAY_CHANGE = (
    "iterations",
    "cooldown",
    "checkpoint_minutes",
    "evaluation_batch",
    "evaluation_temperature",
    "ask_threshold",
)
"""Settings that may differ on resuming without changing what was learned so far."""
