"""The teacher's labels of training episodes, as tensors.

The retrospective mode of 4.2.3: the learner acts alone until its episodes end, sampling from its
own policies; then the teacher, who can now see each step's future, labels all steps at once. What
the networks said while acting is kept with its gradients, so each step is computed once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from embodied.agents.common.losses import IGNORE
from embodied.agents.hanna.inputs import action_index
from embodied.agents.hanna.losses import help_loss, navigation_loss
from embodied.agents.hanna.policy import StepScores
from embodied.interface import Episode, Place, Teacher


@dataclass(frozen=True, eq=False)
class Experience:
    """Outputs of the networks in the N steps of a batch of finished episodes, in the order in which they were taken,
    and what the teacher says of them."""

    moves: Tensor
    """(N, A) logits."""
    asks: Tensor
    """(N, 2) logits."""
    reasons: Tensor | None
    """(N, 3) logits."""
    right_moves: Tensor
    """(N,) int64 index of the reference action (0 is stop), IGNORE without one."""
    negatives: Tensor
    """(N, A) bool, past mistakes (4.12)."""
    right_asks: Tensor
    """(N,) int64, IGNORE where nobody could be asked."""
    true_reasons: Tensor
    """(N, 3) float32."""


def labelled(
    episodes: Sequence[Episode], moments: Sequence[StepScores], teacher: Teacher, worlds: Mapping[str, Place]
) -> Experience:
    """Outputs of the networks in some episodes, beside the teacher's labels; A is the most actions of any
    step."""
    labels = [teacher.relabel(e, worlds[e.task.world]) for e in episodes]
    rows = [labels[position][t] for t, m in enumerate(moments) for position in m.positions]
    scores = [m.scores for m in moments]
    most, device = max(s.navigation.shape[1] for s in scores), scores[0].navigation.device
    negatives = np.zeros((len(rows), most), dtype=bool)
    for i, label in enumerate(rows):
        for action in label.negatives:
            negatives[i, action_index(action)] = True
    reasons = [s.reasons for s in scores if s.reasons is not None]
    true_reasons = np.array([r.reasons or (False, False, False) for r in rows], dtype=np.float32)
    return Experience(
        moves=torch.cat([F.pad(s.navigation, (0, most - s.navigation.shape[1]), value=-torch.inf) for s in scores]),
        asks=torch.cat([s.ask for s in scores]),
        reasons=torch.cat(reasons) if reasons else None,
        right_moves=torch.tensor([IGNORE if r.move is None else action_index(r.move) for r in rows], device=device),
        negatives=torch.from_numpy(negatives).to(device),
        right_asks=torch.tensor([IGNORE if r.ask is None else int(r.ask) for r in rows], device=device),
        true_reasons=torch.from_numpy(true_reasons).to(device),
    )


def imitation_loss(x: Experience, alpha: float, episodes: int, floor: float = 0.0) -> tuple[Tensor, Tensor]:
    """Eqs 4.9 and 4.10: navigation and help-request losses, summed over steps, averaged over episodes.

    `floor` as in losses.curiosity.
    """
    navigation = navigation_loss(x.moves, x.right_moves, x.negatives, alpha, floor).sum() / episodes
    asking = help_loss(x.asks, x.right_asks, x.reasons, x.true_reasons).sum() / episodes
    return navigation, asking
