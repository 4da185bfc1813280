"""Tensors of all learners: the devices that compute, with how many threads; records of which each row belongs to one
agent, or sentence, of a batch; how an action is chosen from a distribution, and words, characters or actions of a batch
from logits: the likeliest, or sampled; and the losses of imitation, one number per step, and of advantage actor-critic
(Eq 3.5 to 3.7, E.1, E.2).

Translations and walks are rated, intentions cost: B sequences (sentences, episodes) of up to T decisions (words, moves,
intentions). Every decision is credited with its return less what the critic expected before it: one rating of the
whole sequence, or minus the costs that were still to come. HARI's equations are written with costs, where V is minus
the value here and the signs of E.1 and E.2 turn around.
"""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from embodied.errors import UnableError


def check_device(device: str) -> None:
    """Refuse a device that PyTorch cannot use here.

    Raises:
      UnableError: it is none, or there is no GPU.
    """
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as e:
        raise UnableError(f"--device {device} cannot be used here ({str(e).splitlines()[0]}); use --device cpu") from e


def use_threads(threads: int) -> None:
    """Let PyTorch use so many threads on the CPU.

    Raises:
      ValueError: fewer than one.
    """
    if threads < 1:
        raise ValueError(f"--threads should be at least 1, got {threads}")
    torch.set_num_threads(threads)


@dataclasses.dataclass(frozen=True, eq=False)
class Rows:
    """Every field is a tensor whose first dimension is the batch."""

    def select(self, rows: Tensor | slice | list[int]) -> Self:
        """Those of some of the batch, in the order of `rows` (k,)."""
        held = {f.name: getattr(self, f.name)[rows] for f in dataclasses.fields(self)}
        return dataclasses.replace(self, **held)


@dataclass(frozen=True, eq=False)
class Remembered(Rows):
    """Memory that is attended to: B rows of S vectors of size h."""

    values: Tensor
    """(B, S, h)."""
    keys: Tensor
    """(B, S, h), which are compared with what asks."""
    mask: Tensor
    """(B, S) bool, False on padding."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class RunningRows:
    """State that a policy carries between steps. All but `moments` belongs to the k episodes that still run: a tensor
    or a record of tensors has a row for each, a tuple an item, unless it is empty or of such records."""

    positions: tuple[int, ...]
    """Place of each row in the batch."""
    channels: Tensor | None = None
    """(k, D) what each episode sees of every feature channel; None is everything."""
    moments: tuple[Any, ...] = ()
    """Outputs of all steps so far, if the policy keeps it."""

    def keep(self, positions: tuple[int, ...]) -> Self:
        """The memory of the episodes at `positions` only."""
        if positions == self.positions:
            return self
        rows = [self.positions.index(p) for p in positions]
        held = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "moments"}
        return dataclasses.replace(self, **{name: _kept(value, rows) for name, value in held.items()})


def _kept(value: Any, rows: list[int]) -> Any:
    if isinstance(value, Tensor):
        return value[rows]
    if not isinstance(value, tuple):
        return None if value is None else value.select(rows)
    if value and hasattr(value[0], "select"):
        return tuple(v.select(rows) for v in value)
    return tuple(value[r] for r in rows) if value else ()


def padded(rows: Sequence[Sequence[int] | np.ndarray]) -> Tensor:
    """(B, longest, ...) int64 of rows of whole numbers, zeros behind their ends."""
    return torch.nn.utils.rnn.pad_sequence([torch.as_tensor(r, dtype=torch.long) for r in rows], batch_first=True)


def side_by_side(rows: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
    """(B, longest, ...) of tensors of unequal length, zero behind their ends; and (B, longest) bool, what is there."""
    out = torch.nn.utils.rnn.pad_sequence(list(rows), batch_first=True)
    return out, torch.arange(out.shape[1]) < torch.tensor([len(r) for r in rows])[:, None]


def hidden_channels(episodes: int, size: int, share: float, device: Any = None) -> Tensor | None:
    """(episodes, size) factors of feature channels, of which a share is hidden from each; None where none is."""
    return F.dropout(torch.ones(episodes, size, device=device), share) if share else None


Chooser = Callable[[np.ndarray, np.random.Generator], int]


def choose_greedily(probabilities: np.ndarray, rng: np.random.Generator) -> int:
    """Index of the largest probability, the first of equals: for evaluation."""
    return int(probabilities.argmax())


def choose_sampled(probabilities: np.ndarray, rng: np.random.Generator) -> int:
    """Index drawn from the distribution with one uniform number: for training."""
    possible = np.flatnonzero(probabilities)
    edges = np.cumsum(probabilities[possible], dtype=np.float64)
    drawn = int(np.searchsorted(edges, rng.random() * edges[-1], side="right"))
    return int(possible[min(drawn, len(possible) - 1)])


def choose_at(temperature: float) -> Chooser:
    """Draw from the distribution sharpened (below 1) or flattened (above 1) by `temperature`; 0 is the likeliest."""
    if temperature == 0:
        return choose_greedily
    if temperature == 1:
        return choose_sampled
    return lambda probabilities, rng: choose_sampled((probabilities / probabilities.max()) ** (1 / temperature), rng)


Choice = Callable[[Tensor, Tensor, int], Tensor]
"""(logits (k, V), rows (k,) of the batch, step) to chosen numbers (k,)."""


def greedy_choice(logits: Tensor, rows: Tensor, step: int) -> Tensor:
    """The number of the largest logit."""
    return logits.argmax(-1)


def sampled_choice(uniforms: np.ndarray) -> Choice:
    """Sample each number with one of `uniforms` (B, steps) in [0, 1), by inverting the distribution.

    Each row brings its own uniforms, so what is drawn for it does not depend on its batch.
    """
    numbers = torch.from_numpy(uniforms).float()

    def choose(logits: Tensor, rows: Tensor, step: int) -> Tensor:
        edges = logits.softmax(-1).cumsum(-1)
        wanted = numbers[rows, step, None] * edges[:, -1:]
        return torch.searchsorted(edges, wanted, right=True)[:, 0].clamp(max=logits.shape[1] - 1)

    return choose


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
