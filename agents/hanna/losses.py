"""The teacher's labels of training episodes as tensors, and the losses of dissertation 4.2.3.

The retrospective mode of 4.2.3: the learner acts alone until its episodes end, sampling from its
own policies; then the teacher, who can now see each step's future, labels all steps at once. What
the networks said while acting is kept with its gradients, so each step is computed once.

N is any number of (episode, step) pairs, A the number of navigation actions. Each loss is one number per pair, zero
where a label says that the step is not to be learned from.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from embodied.agents.common.losses import IGNORE, negative_log_likelihood
from embodied.agents.hanna.inputs import action_index
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

    `floor` as in `curiosity`.
    """
    navigation = navigation_loss(x.moves, x.right_moves, x.negatives, alpha, floor).sum() / episodes
    asking = help_loss(x.asks, x.right_asks, x.reasons, x.true_reasons).sum() / episodes
    return navigation, asking


def curiosity(logits: Tensor, labels: Tensor, negatives: Tensor, floor: float = 0.0) -> Tensor:
    """Mean log-likelihood of the mistakes made before in this situation: second term of Eq 4.13.

    Args:
      logits: (N, A).
      labels: (N,) int64.
      negatives: (N, A) bool, the set A^main-otimes of Eq 4.12.
      floor: a mistake less likely than this is not pushed down any further; 0 is the equation as
        printed, which has no lower bound: at learning rates above the authors' it runs away.

    Returns:
      (N,), zero where there are no mistakes.
    """
    log_p = logits.log_softmax(-1)
    if floor > 0:
        log_p = log_p.clamp(min=math.log(floor))
    log_p = log_p.masked_fill(~negatives, 0.0)
    mean = log_p.sum(-1) / negatives.sum(-1).clamp(min=1)
    return mean * (labels != IGNORE)


def navigation_loss(logits: Tensor, labels: Tensor, negatives: Tensor, alpha: float, floor: float = 0.0) -> Tensor:
    """L_main of Eq 4.13, (N,); `floor` as in `curiosity`."""
    loss = negative_log_likelihood(logits, labels)
    return loss + alpha * curiosity(logits, labels, negatives, floor) if alpha else loss


def reason_loss(logits: Tensor, reasons: Tensor, labels: Tensor) -> Tensor:
    """Binary logistic loss of the three conditions, second term of Eq 4.14.

    Args:
      logits, reasons: (N, 3); reasons are 0 or 1.
      labels: (N,) int64 of asking; IGNORE silences the reasons as well.

    Returns:
      (N,).
    """
    each = F.binary_cross_entropy_with_logits(logits, reasons, reduction="none")
    return each.mean(-1) * (labels != IGNORE)


def help_loss(ask: Tensor, labels: Tensor, reason_logits: Tensor | None, reasons: Tensor) -> Tensor:
    """L_ask of Eq 4.14, (N,); without reason logits its first term only.

    Args:
      ask: (N, 2) logits of DO_NOTHING and REQUEST.
      labels: (N,) int64, IGNORE outside the zones of attention.
      reason_logits: (N, 3) or None.
      reasons: (N, 3) float, 0 or 1.
    """
    loss = negative_log_likelihood(ask, labels)
    return loss if reason_logits is None else loss + reason_loss(reason_logits, reasons, labels)
