"""A Transformer over rows of unequal number that computes nothing for padding, and nothing that is not read.

Same network as torch's `TransformerEncoder(norm_first=True)`; written out because a training step
on a CPU costs a third of what it costs there: linear layers see packed rows, the last layer is asked
for one row of each sequence alone, and dropout draws a byte per number.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional


@dataclass(frozen=True, eq=False)
class Packing:
    """Where the rows of B sequences of at most S rows lie when they stand one after another."""

    present: Tensor
    """(B, S) bool: which rows there are, at least one of each sequence."""
    index: Tensor
    """(N,) int64: place of each row that is there among all B * S."""

    @classmethod
    def of(cls, present: Tensor) -> Packing:
        """The packing of the rows that are `present`."""
        return cls(present, present.reshape(-1).nonzero()[:, 0])

    def pack(self, padded: Tensor) -> Tensor:
        """(B, S, ...) -> (N, ...)."""
        return padded.reshape(-1, *padded.shape[2:])[self.index]

    def pad(self, packed: Tensor) -> Tensor:
        """(N, h) -> (B, S, h), zeros where nothing is."""
        b, s = self.present.shape
        return packed.new_zeros(b * s, packed.shape[1]).index_copy(0, self.index, packed).view(b, s, -1)

    @property
    def firsts(self) -> Tensor:
        """(B,) int64: place in the packed rows of each sequence's first."""
        counts = self.present.sum(1)
        return counts.cumsum(0) - counts


class Layer(nn.Module):
    """Attention and two linear layers, each behind a norm and beside a way past it."""

    def __init__(self, size: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.heads, self.dropout = heads, dropout
        self.before, self.between = nn.LayerNorm(size), nn.LayerNorm(size)
        self.query, self.looked_at, self.merge = nn.Linear(size, size), nn.Linear(size, 2 * size), nn.Linear(size, size)
        self.widen, self.narrow = nn.Linear(size, 4 * size), nn.Linear(4 * size, size)
        for part in (self.query, self.looked_at):
            nn.init.xavier_uniform_(part.weight)
            nn.init.zeros_(part.bias)
        nn.init.zeros_(self.merge.bias)

    def forward(self, rows: Tensor, packing: Packing, *, firsts_only: bool = False) -> Tensor:
        """(N, h) -> (N, h), or (B, h): what becomes of each sequence's first row."""
        normed = self.before(rows)
        keys, values = (self._split(x) for x in packing.pad(self.looked_at(normed)).chunk(2, -1))  # (B, heads, S, d)
        if firsts_only:
            rows, normed = rows[packing.firsts], normed[packing.firsts]
            queries = self._split(self.query(normed)[:, None])  # (B, heads, 1, d)
        else:
            queries = self._split(packing.pad(self.query(normed)))  # (B, heads, S, d)
        seen = functional.scaled_dot_product_attention(
            queries,
            keys,
            values,
            attn_mask=packing.present[:, None, None, :],
            dropout_p=self.dropout if self.training else 0.0,
        )
        seen = seen.transpose(1, 2).flatten(2)  # (B, 1 or S, h)
        rows = rows + self._drop(self.merge(seen[:, 0] if firsts_only else packing.pack(seen)))
        return rows + self._drop(self.narrow(self._drop(functional.relu(self.widen(self.between(rows))))))

    def _split(self, x: Tensor) -> Tensor:
        """(B, S, h) -> (B, heads, S, h / heads)."""
        return x.unflatten(-1, (self.heads, -1)).transpose(1, 2)

    def _drop(self, x: Tensor) -> Tensor:
        return silenced(x, self.dropout) if self.training and self.dropout else x


class Transformer(nn.Module):
    """Some layers and a last norm."""

    def __init__(self, size: int, layers: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.layers = nn.ModuleList(Layer(size, heads, dropout) for _ in range(layers))
        self.norm = nn.LayerNorm(size)

    def forward(self, rows: Tensor, packing: Packing, *, firsts_only: bool = False) -> Tensor:
        """(N, h) -> (N, h), or (B, h) of each sequence's first row."""
        for k, layer in enumerate(self.layers):
            rows = layer(rows, packing, firsts_only=firsts_only and k == len(self.layers) - 1)
        return self.norm(rows)


def silenced(x: Tensor, share: float) -> Tensor:
    """Dropout whose share is rounded to a 256th: eight numbers per draw, a third of the time of torch's on a CPU."""
    limit = round(256 * share)
    drawn = torch.empty(-(-x.numel() // 8), dtype=torch.int64, device=x.device).random_(-(2**63), None)
    kept = drawn.view(torch.uint8)[: x.numel()].view(x.shape) >= limit
    return x * kept.to(x.dtype).mul_(256 / (256 - limit))
