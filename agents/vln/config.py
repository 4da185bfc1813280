"""Settings of VLN's follower. Free of torch, so that the command line answers at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from embodied.agents.common.settings import AtLeastOne, ImitationSettings, NotAll, NotNegative, Share, Whole, scales
from embodied.options import Option

MEASURES = ("success", "spl", "nDTW", "SDTW", "navigation error")
"""Columns of tables."""
FORCING = ("teacher", "student", "dagger")
"""Who acts in an episode of training: the teacher's; the follower's own, sampled; or at first the teacher's,
then more and more its own (Ross et al. 2011). The label is always the teacher's."""


@dataclass(frozen=True, kw_only=True)
class FollowerSettings(ImitationSettings):
    """How a follower is trained."""

    hidden_size: AtLeastOne = 512
    """Width of the networks."""
    dropout: NotAll = 0.2
    """Dropout rate in training."""
    forcing: Annotated[str, Option(words=FORCING)] = "dagger"
    """Who acts in training: 'teacher', 'student' or 'dagger'."""
    blind: bool = False
    """Ablation without vision: all features are zero."""
    wordless: bool = False
    """Ablation without language: the instruction is empty."""
    progress_weight: NotNegative = 0.5
    """Weight of the progress monitor's loss: it predicts which share of the path is left (Ma et al. 2019)."""
    room_weight: NotNegative = 0.5
    """Weight of an auxiliary loss: predict the kinds of the current room and of the candidates' rooms."""
    more_paths: Whole = 0
    """Additional paths per training house, each worded three times."""
    least_teacher: Share = 0.0
    """Lowest share of steps taken by the teacher in 'dagger', reached halfway."""
    iterations: AtLeastOne = 20_000
    """Updates of the weights."""
    batch: AtLeastOne = 64
    """Episodes per update."""
    instruction_length: AtLeastOne = 80
    """Longest instruction, words; the rest is cut."""


VLN_SCALES = scales(FollowerSettings, "vln")
"""'mini': ten minutes of one core, and twenty more where paths are not worded yet; 'paper': for one GPU."""
