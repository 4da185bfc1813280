"""Settings of VLN's follower. Free of torch, so that the command line answers at once."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.agents.common.settings import (
    AT_LEAST_ONE,
    NOT_ALL,
    NOT_NEGATIVE,
    SHARE,
    ImitationSettings,
    require,
    require_word,
)

MEASURES = ("success", "spl", "nDTW", "SDTW", "navigation error")
"""Columns of tables."""
FORCING = ("teacher", "student", "dagger")
"""Who acts in an episode of training: the teacher's; the follower's own, sampled; or at first the teacher's,
then more and more its own (Ross et al. 2011). The label is always the teacher's."""


@dataclass(frozen=True, kw_only=True)
class FollowerSettings(ImitationSettings):
    """How a follower is trained."""

    hidden_size: int = 512
    """Width of the networks."""
    dropout: float = 0.2
    """Dropout rate in training."""
    forcing: str = "dagger"
    """Who acts in training: 'teacher', 'student' or 'dagger'."""
    blind: bool = False
    """Ablation without vision: all features are zero."""
    wordless: bool = False
    """Ablation without language: the instruction is empty."""
    progress_weight: float = 0.5
    """Weight of the progress monitor's loss: it predicts which share of the path is left (Ma et al. 2019)."""
    room_weight: float = 0.5
    """Weight of an auxiliary loss: predict the kinds of the current room and of the candidates' rooms."""
    more_paths: int = 0
    """Additional paths per training house, each worded three times."""
    least_teacher: float = 0.0
    """Lowest share of steps taken by the teacher in 'dagger', reached halfway."""
    iterations: int = 20_000
    """Updates of the weights."""
    batch: int = 64
    """Episodes per update."""
    instruction_length: int = 80
    """Longest instruction, words; the rest is cut."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_word(self, "forcing", FORCING)
        require(self, AT_LEAST_ONE, "hidden_size")
        require(self, NOT_ALL, "dropout")
        require(self, NOT_NEGATIVE, "progress_weight", "room_weight")
        require(self, NOT_NEGATIVE, "more_paths")
        require(self, SHARE, "least_teacher")


VLN_SCALES: dict[str, FollowerSettings] = {
    "mini": FollowerSettings(
        hidden_size=128,
        batch=32,
        iterations=4000,
        more_paths=64,
        least_teacher=0.5,
        learning_rate=1e-3,
        cooldown=0.4,
        environment_dropout=0.3,
        instruction_length=60,
        weight_decay=0.0,
        validate_every=500,
    ),
    "paper": FollowerSettings(),
}
"""'mini': ten minutes of one core, and twenty more where paths are not worded yet; 'paper': for one GPU."""
