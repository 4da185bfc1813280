"""Records of tensors of which each row belongs to one agent, or sentence, of a batch."""

from __future__ import annotations

import dataclasses
from typing import Self

from torch import Tensor


@dataclasses.dataclass(frozen=True, eq=False)
class Rows:
    """Every field is a tensor whose first dimension is the batch."""

    def select(self, rows: Tensor | slice) -> Self:
        """Those of some of the batch, in the order of `rows` (k,)."""
        held = {f.name: getattr(self, f.name)[rows] for f in dataclasses.fields(self)}
        return dataclasses.replace(self, **held)
