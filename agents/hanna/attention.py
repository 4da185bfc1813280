"""The attention and time modules of dissertation appendix D.2, each a small network of its own.

B is the number of agents in the batch, h the hidden size, n the length of a memory. Every module
treats each agent alone; masks say which memory entries an agent may see, so what an agent computes
does not depend on who else is in the batch.
"""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from embodied.agents.common.vocabulary import WordEmbedding

SIMILARITY_THRESHOLD = 0.9
"""A past situation counts as nearly identical above this cosine (Eq D.3)."""


class MultiAttend(nn.Module):
    """MULTIATTEND(q, K, V): multi-headed attention, residual connection, layer normalisation."""

    def __init__(self, hidden: int, heads: int, dropout: float) -> None:
        super().__init__()
        if hidden % heads:
            raise ValueError(f"hidden size {hidden} is not a multiple of {heads} heads; choose another number of heads")
        self.heads = heads
        self.query = nn.Linear(hidden, hidden)
        self.key = nn.Linear(hidden, hidden)
        self.value = nn.Linear(hidden, hidden)
        self.out = nn.Linear(hidden, hidden)
        self.norm = nn.LayerNorm(hidden, eps=1e-6)
        self.dropout = nn.Dropout(dropout)

    def forward(self, query: Tensor, keys: Tensor, values: Tensor, mask: Tensor) -> Tensor:
        """Attend and add.

        Args:
          query: (B, h), or (B, m, h) for m queries.
          keys, values: (B, n, h), already through `self.key` and `self.value`, so that a memory
            that grows by one entry a step is projected once and not at every later step.
          mask: (B, n) bool, True where the agent may look; at least one True in each row.

        Returns:
          As `query`.
        """
        b, n, h = keys.shape
        q = query if query.dim() == 3 else query[:, None]  # (B, m, h)
        m, d = q.shape[1], h // self.heads
        q_heads = self.query(q).view(b, m, self.heads, d).transpose(1, 2)  # (B, heads, m, d)
        k_heads = keys.view(b, n, self.heads, d).transpose(1, 2)  # (B, heads, n, d)
        v_heads = values.view(b, n, self.heads, d).transpose(1, 2)  # (B, heads, n, d)
        seen = F.scaled_dot_product_attention(q_heads, k_heads, v_heads, mask[:, None, None])  # (B, heads, m, d)
        seen = seen.transpose(1, 2).reshape(b, m, h)
        out = self.norm(q + self.dropout(self.out(seen)))
        return out if query.dim() == 3 else out[:, 0]


class FeedForward(nn.Module):
    """FFN(x): one ReLU layer four times as wide, residual connection, layer normalisation."""

    def __init__(self, hidden: int, dropout: float) -> None:
        super().__init__()
        self.wide = nn.Linear(hidden, 4 * hidden)
        self.narrow = nn.Linear(4 * hidden, hidden)
        self.norm = nn.LayerNorm(hidden, eps=1e-6)
        self.dropout = nn.Dropout(dropout)

    def forward(self, x: Tensor) -> Tensor:
        """(..., h) -> (..., h)."""
        return self.norm(x + self.dropout(self.narrow(F.relu(self.wide(x)))))


class DotAttend(nn.Module):
    """DOTATTEND(q, M): dot-product attention of Luong et al. (2015) over raw feature rows."""

    def __init__(self, query_size: int, row_size: int, hidden: int) -> None:
        super().__init__()
        self.query = nn.Linear(query_size, hidden)
        self.row = nn.Linear(row_size, hidden, bias=False)

    def forward(self, query: Tensor, rows: Tensor) -> Tensor:
        """Weighted sum of `rows`.

        The score of row r is (W_q q + b) . (W_r r). It is computed as (W_r^T (W_q q + b)) . r,
        which is the same number without projecting 36 rows per agent.

        Args:
          query: (B, q).
          rows: (B, n, D).

        Returns:
          (B, D).
        """
        query_in_rows = self.query(query) @ self.row.weight  # (B, D)
        weights = torch.einsum("bd,bnd->bn", query_in_rows, rows).softmax(-1)
        return torch.einsum("bn,bnd->bd", weights, rows)


class SelfAttend(nn.Module):
    """SELFATTEND(q, K, V): MULTIATTEND over an agent's own past, to which (q, output) is appended."""

    def __init__(self, hidden: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.attend = MultiAttend(hidden, heads, dropout)

    def empty(self, batch: int, like: Tensor) -> tuple[Tensor, Tensor]:
        """Projected keys and values (B, 1, h) of the zero vectors q_0 and h_0 that open a memory."""
        zero = like.new_zeros(batch, 1, self.attend.key.in_features)
        return self.attend.key(zero), self.attend.value(zero)

    def forward(self, query: Tensor, keys: Tensor, values: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        """One step.

        Args:
          query: (B, h).
          keys, values: (B, n, h) memory, already projected.
          mask: (B, n) bool, entries the agent may see.

        Returns:
          output (B, h) and the memory's next keys (B, n+1, h); values follow from `append_value`,
          because what an intra-task memory stores is not this output but the final state (D.16).
        """
        output = self.attend(query, keys, values, mask)
        return output, torch.cat([keys, self.attend.key(query)[:, None]], 1)

    def append_value(self, values: Tensor, state: Tensor) -> Tensor:
        """(B, n, h) projected values with `state` (B, h) as the newest entry."""
        return torch.cat([values, self.attend.value(state)[:, None]], 1)


def sim_attend(query: Tensor, keys: Tensor, values: Tensor, mask: Tensor) -> Tensor:
    """SIMATTEND(q, K, V), Eqs D.3 and D.4: weighted average of values whose keys equal the query, nearly.

    Weights are divided by the sum of the kept similarities, as in the text under D.4 and in the authors' program; the
    sum over all entries, as D.3 is printed, can be zero or negative (docs/sources.md, S26).

    Args:
      query: (B, h).
      keys, values: (B, n, h), not projected.
      mask: (B, n) bool, entries that may be considered.

    Returns:
      (B, h); zero where no key is similar enough.
    """
    similarity = F.cosine_similarity(query[:, None], keys, dim=-1, eps=1e-8).masked_fill(~mask, 0.0)  # (B, n) D.4
    kept = similarity * (similarity > SIMILARITY_THRESHOLD)
    weights = kept / (kept.sum(-1, keepdim=True) + 1e-8)  # D.3
    return torch.einsum("bn,bnh->bh", weights, values)


class IncTime(nn.Module):
    """INCTIME(x) = LAYERNORM(x + RELU(LINEAR(x))), Eq D.1; a linear shortcut where sizes differ (D.2)."""

    def __init__(self, size: int, hidden: int) -> None:
        super().__init__()
        self.step = nn.Linear(size, hidden)
        self.shortcut = nn.Identity() if size == hidden else nn.Linear(size, hidden)
        self.norm = nn.LayerNorm(hidden, eps=1e-6)

    def forward(self, x: Tensor) -> Tensor:
        """(B, size) -> (B, h)."""
        return self.norm(self.shortcut(x) + F.relu(self.step(x)))


class TextEncoder(nn.Module):
    """TRANSENCODER(l), Eq D.5: word embeddings, sinusoid positions, one Transformer layer."""

    def __init__(self, words: int, hidden: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.hidden = hidden
        self.embedding = WordEmbedding(words, hidden)
        nn.init.normal_(self.embedding.weight, std=hidden**-0.5)
        self.attend = MultiAttend(hidden, heads, dropout)
        self.feed = FeedForward(hidden, dropout)
        self.dropout = nn.Dropout(dropout)

    def forward(self, tokens: Tensor) -> Tensor:
        """Text memory of each instruction.

        Args:
          tokens: (B, L) int64; 0 is padding and comes last. Each row holds at least one word.

        Returns:
          (B, L, h); rows at padding hold numbers nobody looks at.
        """
        words = self.embedding(tokens) * math.sqrt(self.hidden)  # (B, L, h)
        x = self.dropout(words + sinusoid(tokens.shape[1], self.hidden, words))
        x = self.attend(x, self.attend.key(x), self.attend.value(x), tokens != 0)
        return self.feed(x)


def sinusoid(length: int, size: int, like: Tensor) -> Tensor:
    """(length, size) position encoding of Vaswani et al. (2017), section 3.5."""
    position = torch.arange(length, dtype=like.dtype, device=like.device)[:, None]
    rate = torch.exp(torch.arange(0, size, 2, dtype=like.dtype, device=like.device) * (-math.log(10000.0) / size))
    angle = position * rate  # (length, size / 2)
    return torch.stack([angle.sin(), angle.cos()], -1).reshape(length, size)
