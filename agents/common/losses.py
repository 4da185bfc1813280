"""The losses of imitation, one number per step, and of advantage actor-critic (Eq 3.5 to 3.7, E.1, E.2).

Translations and walks are rated, intentions cost: B sequences (sentences, episodes) of up to T decisions (words, moves,
intentions). Every decision is credited with its return less what the critic expected before it: one rating of the
whole sequence, or minus the costs that were still to come. HARI's equations are written with costs, where V is minus
the value here and the signs of E.1 and E.2 turn around.
"""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True, eq=False)
class Decisions:
    """Sequences with what came of them, and with their gradients."""

    log_probabilities: Tensor
    """(B, T) log pi of each decision that was taken; carries the actor's gradient."""
    values: Tensor
    """(B, T) what the critic expected before it; carries the critic's gradient."""
    returns: Tensor
    """(B, T) what came after it, itself included; or (B,) one rating that all decisions share."""
    mask: Tensor
    """(B, T) bool, False behind the end of a sequence."""


def advantages(rated: Decisions) -> Tensor:
    """R - V(y_<t) of Eq 3.5, (B, T), zero behind the end; carries no gradient."""
    return ((_returns(rated) - rated.values) * rated.mask).detach()


def actor_loss(rated: Decisions) -> Tensor:
    """The loss whose descent is the ascent of Eq 3.5: summed over decisions, averaged over sequences."""
    return -(advantages(rated) * rated.log_probabilities * rated.mask).sum() / len(rated.returns)


def critic_loss(rated: Decisions) -> Tensor:
    """Eq 3.6, halved so that its gradient is Eq 3.7: summed over decisions, averaged over sequences."""
    return 0.5 * ((rated.values - _returns(rated)) * rated.mask).square().sum() / len(rated.returns)


def costs_to_go(costs: Tensor, mask: Tensor) -> Tensor:
    """(B, T) C_t, the sum of the costs from t on (E.1); undiscounted.

    Args:
      costs: (B, T), those behind the end are not counted.
      mask: (B, T) bool, False behind the end.
    """
    return (costs * mask).flip(1).cumsum(1).flip(1)


def _returns(rated: Decisions) -> Tensor:
    return rated.returns if rated.returns.dim() == 2 else rated.returns[:, None]
