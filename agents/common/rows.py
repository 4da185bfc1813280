"""Records of tensors of which each row belongs to one agent, or sentence, of a batch."""

from __future__ import annotations

import dataclasses
from typing import Any, Self

import torch
import torch.nn.functional as F
from torch import Tensor


@dataclasses.dataclass(frozen=True, eq=False)
class Rows:
    """Every field is a tensor whose first dimension is the batch."""

    def select(self, rows: Tensor | slice | list[int]) -> Self:
        """Those of some of the batch, in the order of `rows` (k,)."""
        held = {f.name: getattr(self, f.name)[rows] for f in dataclasses.fields(self)}
        return dataclasses.replace(self, **held)


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


def hidden_channels(episodes: int, size: int, share: float, device: Any = None) -> Tensor | None:
    """(episodes, size) factors of feature channels, of which a share is hidden from each; None where none is."""
    return F.dropout(torch.ones(episodes, size, device=device), share) if share else None
