"""The loss of imitation, one number per step."""

from __future__ import annotations

import torch.nn.functional as F
from torch import Tensor

IGNORE = -100
"""Label of a step that is not learned from."""


def negative_log_likelihood(logits: Tensor, labels: Tensor) -> Tensor:
    """L_NL = -log pi(a* | o), Eq 4.11; L of Eq 4.3.

    Args:
      logits: (N, A), -inf where there is no action.
      labels: (N,) int64, IGNORE where there is none.

    Returns:
      (N,), zero where there is no label.
    """
    return F.cross_entropy(logits, labels, ignore_index=IGNORE, reduction="none")
