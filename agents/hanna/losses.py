"""The losses of dissertation 4.2.3: small functions over logits, labels and masks.

N is any number of (episode, step) pairs, A the number of navigation actions. Each function gives
one loss per pair, zero where a label says that the step is not to be learned from.
"""

from __future__ import annotations

import math

import torch.nn.functional as F
from torch import Tensor

from embodied.agents.common.losses import IGNORE, negative_log_likelihood


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
