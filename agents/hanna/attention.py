"""Inputs of HANNA's networks in one step: a Percept of tensors, and the features of dissertation appendix D.1 that need
no learning; and the attention and time modules of appendix D.2, each a small network of its own.

Row k of a view set is the view of the Matterport convention: band k // 12 looks 30 degrees down,
level, 30 degrees up; column k % 12 turns clockwise in steps of 30 degrees.

B is the number of agents in the batch, h the hidden size, n the length of a memory. Every module
treats each agent alone; masks say which memory entries an agent may see, so what an agent computes
does not depend on who else is in the batch.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from embodied.agents.common.tensors import Rows
from embodied.interface import VIEWS, Move, Observation, Open, Stop

SLOTS = VIEWS + 1
"""Static places of the navigation distribution: one per view relative to the agent, and stop (last)."""
COPIES = 32
"""How often each of the four orientation features is repeated."""
DO_NOTHING, REQUEST, START = 0, 1, 2
"""Help-request actions; START stands for 'no step before this one'."""


@dataclass(frozen=True, eq=False)
class Percept(Rows):
    """Inputs of one step for B agents; A is the largest number of navigation actions among them."""

    tokens: Tensor
    """(B, L) int64 current instruction, 0 is padding."""
    new_task: Tensor
    """(B,) bool, the instruction changed in the step before (or this is the first step)."""
    current: Tensor
    """(B, 36, D) features of the current panorama."""
    target: Tensor
    """(B, 36, D) features of the target's panorama, zero where there is no target image."""
    actions: Tensor
    """(B, A, E) embeddings of the navigation actions; 0 is stop, a zero vector."""
    action_mask: Tensor
    """(B, A) bool, which of them exist."""
    action_slots: Tensor
    """(B, A) int64 in 0..36: the view relative to the agent in which the action lies; stop has 36."""
    previous_action: Tensor
    """(B, E) embedding of the last navigation action, zero after stop, after a request and at first."""
    previous_ask: Tensor
    """(B,) int64: DO_NOTHING, REQUEST or START."""


def action_size(feature_size: int) -> int:
    """E, length of a navigation action's embedding (D.1)."""
    return feature_size + 4 * COPIES


def target_similarity(current: Tensor, target: Tensor) -> Tensor:
    """delta_t of D.1: for each current view the cosine of the target view most like it.

    Args:
      current, target: (B, 36, D).

    Returns:
      (B, 36); all ones where the panoramas are equal, zero where the target is missing.
    """
    cosines = F.normalize(current, dim=-1, eps=1e-6) @ F.normalize(target, dim=-1, eps=1e-6).transpose(1, 2)
    return cosines.amax(-1)  # rows of C are current views


def orientation(heading: Tensor, elevation: Tensor, copies: int) -> Tensor:
    """(..., 4 * copies) orientation features [sin dpsi; cos dpsi; sin domega; cos domega] of D.1.

    Each is repeated `copies` times (32 in Speaker-Follower and in the authors' program), so that
    four numbers weigh something beside hundreds of visual features.
    """
    parts = (heading.sin(), heading.cos(), elevation.sin(), elevation.cos())
    return torch.cat([p[..., None].expand(*p.shape, copies) for p in parts], -1)


def slot_distribution(logits: Tensor, slots: Tensor) -> Tensor:
    """P_t^nav on static indices (D.1): probabilities of actions that share a view add up.

    Args:
      logits: (B, A), -inf where there is no action.
      slots: (B, A) int64 in 0..36.

    Returns:
      (B, 37).
    """
    probabilities = logits.softmax(-1)
    return torch.zeros(*logits.shape[:-1], SLOTS, dtype=logits.dtype, device=logits.device).scatter_add(
        -1, slots, probabilities
    )


def candidate_rows(observations: Sequence[Observation]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The actions of k agents, 0 is stop: (k, A) int64 views, (2, k, A) float32 bearings and slopes, (k, A) bool which
    of them are allowed."""
    shape = len(observations), 1 + max(len(o.candidates) for o in observations)
    views, angles, mask = np.zeros(shape, np.int64), np.zeros((2, *shape), np.float32), np.zeros(shape, bool)
    mask[:, 0] = True
    for row, o in enumerate(observations):
        c, some = o.candidates, slice(1, 1 + len(o.candidates))
        views[row, some], angles[0, row, some], angles[1, row, some] = c.view, c.bearing, c.slope
        mask[row, some] = c.allowed
    return views, angles, mask


def action_index(action: Move | Open | Stop) -> int:
    """Place of a navigation action in the networks' scores: stop is 0; opening a door is that of going through it."""
    return 0 if isinstance(action, Stop) else action.candidate + 1


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
        self.embedding = nn.Embedding(words, hidden, padding_idx=0)
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
