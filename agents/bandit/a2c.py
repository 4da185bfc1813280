"""Advantage actor-critic from one rating per sequence (Eq 3.5 to 3.7): translations and walks alike.

B sequences (sentences, episodes) of up to T decisions (words, moves). One rating comes when a
sequence has ended; every decision of it is credited with the rating less what the critic expected
before the decision.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import torch
from torch import Tensor

from embodied.errors import UnableError


class DivergedError(UnableError):
    """A loss or a gradient is not a number any more; the last checkpoint is intact."""


@dataclass(frozen=True, eq=False)
class Rated:
    """Sequences that were rated, with their gradients."""

    log_probabilities: Tensor
    """(B, T) log pi of each decision that was taken; carries the actor's gradient."""
    values: Tensor
    """(B, T) what the critic expected before it; carries the critic's gradient."""
    ratings: Tensor
    """(B,) what came."""
    mask: Tensor
    """(B, T) bool, False behind the end of a sequence."""


def advantages(rated: Rated) -> Tensor:
    """R - V(y_<t) of Eq 3.5, (B, T), zero behind the end; carries no gradient."""
    return ((rated.ratings[:, None] - rated.values) * rated.mask).detach()


def actor_loss(rated: Rated) -> Tensor:
    """Whose descent is the ascent of Eq 3.5: summed over decisions, averaged over sequences."""
    return -(advantages(rated) * rated.log_probabilities * rated.mask).sum() / len(rated.ratings)


def critic_loss(rated: Rated) -> Tensor:
    """Eq 3.6, halved so that its gradient is Eq 3.7: summed over decisions, averaged over sequences."""
    return 0.5 * ((rated.values - rated.ratings[:, None]) * rated.mask).square().sum() / len(rated.ratings)


def descend(loss: Tensor, optimizer: torch.optim.Optimizer, clip: float, what: str) -> float:
    """One step of `optimizer` down `loss`, the gradient's norm cut to `clip`; returns the norm before.

    Raises:
      DivergedError: the loss or a gradient is not finite; no weight was changed.
    """
    optimizer.zero_grad(set_to_none=True)
    loss.backward()
    norm = torch.nn.utils.clip_grad_norm_(parameters_of(optimizer), clip)
    if not (torch.isfinite(loss) and torch.isfinite(norm)):
        raise DivergedError(
            f"{what}: loss {float(loss.detach()):.3g}, gradient {float(norm):.3g}, not finite; "
            "the last checkpoint is intact, lower the learning rate and begin anew or from it"
        )
    optimizer.step()
    return float(norm)


def parameters_of(optimizer: torch.optim.Optimizer) -> Iterable[torch.nn.Parameter]:
    return [p for group in optimizer.param_groups for p in group["params"]]
