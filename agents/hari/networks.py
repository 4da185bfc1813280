"""HARI's networks: the execution policy (a Transformer), the intention policy and its critic (LSTMs); appendix E.

The Transformer encodes sequences of unequal length and computes nothing for padding, or that is not read. It is the
same network as torch's `TransformerEncoder(norm_first=True)`, written out because a training step on a CPU costs a
third of what it costs there: linear layers get packed rows, the last layer computes one row of each sequence only, and
dropout draws one byte per number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from embodied.agents.hari.config import ExecutionConfig
from embodied.agents.hari.words import SIZES, Inputs


@dataclass(frozen=True, eq=False)
class Packing:
    """Which rows of a padded batch (B sequences of at most S rows) are real, and where they are in the packed one."""

    present: Tensor
    """(B, S) bool: the rows that are not padding, at least one of each sequence."""
    index: Tensor
    """(N,) int64: index of each of these N rows among all B * S."""

    @classmethod
    def of(cls, present: Tensor) -> Packing:
        """The packing of the rows that are `present`."""
        return cls(present, present.reshape(-1).nonzero()[:, 0])

    def pack(self, padded: Tensor) -> Tensor:
        """(B, S, ...) -> (N, ...)."""
        return padded.reshape(-1, *padded.shape[2:])[self.index]

    def pad(self, packed: Tensor) -> Tensor:
        """(N, h) -> (B, S, h), zeros in the padding."""
        b, s = self.present.shape
        return packed.new_zeros(b * s, packed.shape[1]).index_copy(0, self.index, packed).view(b, s, -1)

    @property
    def first_rows(self) -> Tensor:
        """(B,) int64: index of each sequence's first row among the packed ones."""
        counts = self.present.sum(1)
        return counts.cumsum(0) - counts


class TransformerLayer(nn.Module):
    """Self-attention and a feed-forward network, each with pre-normalisation and a residual connection.

    The names of the modules are those of stored weights.
    """

    def __init__(self, size: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.heads, self.dropout = heads, dropout
        self.before, self.between = nn.LayerNorm(size), nn.LayerNorm(size)  # of attention, of the feed-forward network
        self.query, self.looked_at = nn.Linear(size, size), nn.Linear(size, 2 * size)  # queries; keys and values
        self.merge = nn.Linear(size, size)  # output of attention
        self.widen, self.narrow = nn.Linear(size, 4 * size), nn.Linear(4 * size, size)  # the feed-forward network
        for part in (self.query, self.looked_at):
            nn.init.xavier_uniform_(part.weight)
            nn.init.zeros_(part.bias)
        nn.init.zeros_(self.merge.bias)

    def forward(self, rows: Tensor, packing: Packing, *, first_rows_only: bool = False) -> Tensor:
        """(N, h) -> (N, h), or (B, h) of each sequence's first row."""
        normed = self.before(rows)
        keys, values = (self._split(x) for x in packing.pad(self.looked_at(normed)).chunk(2, -1))  # (B, heads, S, d)
        if first_rows_only:
            rows, normed = rows[packing.first_rows], normed[packing.first_rows]
            queries = self._split(self.query(normed)[:, None])  # (B, heads, 1, d)
        else:
            queries = self._split(packing.pad(self.query(normed)))  # (B, heads, S, d)
        attended = functional.scaled_dot_product_attention(
            queries,
            keys,
            values,
            attn_mask=packing.present[:, None, None, :],
            dropout_p=self.dropout if self.training else 0.0,
        )
        attended = attended.transpose(1, 2).flatten(2)  # (B, 1 or S, h)
        rows = rows + self._drop(self.merge(attended[:, 0] if first_rows_only else packing.pack(attended)))
        return rows + self._drop(self.narrow(self._drop(functional.relu(self.widen(self.between(rows))))))

    def _split(self, x: Tensor) -> Tensor:
        """(B, S, h) -> (B, heads, S, h / heads)."""
        return x.unflatten(-1, (self.heads, -1)).transpose(1, 2)

    def _drop(self, x: Tensor) -> Tensor:
        return fast_dropout(x, self.dropout) if self.training and self.dropout else x


class Transformer(nn.Module):
    """Layers and a last norm."""

    def __init__(self, size: int, layers: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.layers = nn.ModuleList(TransformerLayer(size, heads, dropout) for _ in range(layers))
        self.norm = nn.LayerNorm(size)

    def forward(self, rows: Tensor, packing: Packing, *, first_rows_only: bool = False) -> Tensor:
        """(N, h) -> (N, h), or (B, h) of each sequence's first row."""
        for k, layer in enumerate(self.layers):
            rows = layer(rows, packing, first_rows_only=first_rows_only and k == len(self.layers) - 1)
        return self.norm(rows)


def fast_dropout(x: Tensor, rate: float) -> Tensor:
    """Dropout whose rate is rounded to a 256th: eight numbers per draw, a third of the time of torch's on a CPU."""
    limit = round(256 * rate)
    drawn = torch.empty(-(-x.numel() // 8), dtype=torch.int64, device=x.device).random_(-(2**63), None)
    kept = drawn.view(torch.uint8)[: x.numel()].view(x.shape) >= limit
    return x * kept.to(x.dtype).mul_(256 / (256 - limit))


INTENTIONS = ("cur", "goal", "sub", "do", "done")
"""A-bar of 4.3.3.2, in the order of the intention policy's outputs."""
DEPTHS = 4
"""Stack sizes that `knows_stack` tells apart; larger ones count as the largest."""
SHOWN = 8
"""Probabilities of moves that the intention policy is shown."""


@dataclass(frozen=True, eq=False)
class EncodedDescriptions:
    """B descriptions as the encoder reads them."""

    rows: Tensor
    """(B, M, h)."""
    present: Tensor
    """(B, M) bool: False for padding."""

    def __getitem__(self, which: list[int]) -> EncodedDescriptions:
        """Those of some of the B."""
        return EncodedDescriptions(self.rows[which], self.present[which])

    def upto(self, width: int) -> EncodedDescriptions:
        """The same with no more than `width` rows, where the others are padding."""
        return EncodedDescriptions(self.rows[:, :width], self.present[:, :width])

    @classmethod
    def together(cls, alone: Sequence[Tensor]) -> EncodedDescriptions:
        """B tensors (m, h) of different lengths m, padded to the longest."""
        lengths = torch.tensor([len(r) for r in alone])
        rows = nn.utils.rnn.pad_sequence(list(alone), batch_first=True)
        return cls(rows, torch.arange(rows.shape[1]) < lengths[:, None])


class ExecutionNetwork(nn.Module):
    """pi-hat: (b^s_{t-1}, d^s, d^g) -> b^s_t and a distribution over moves.

    "We adapt the V&L BERT architecture": an encoder reads each description by itself, a decoder
    attends from the previous hidden vector over both. What the text leaves open and is decided
    here (docs/sources.md, S75): moves are scored by the product of b^s_t with the
    embedding of the feature set that an assistant would use for them, so that "go north" and the
    neighbour to the north are near each other from the start.
    """

    def __init__(self, config: ExecutionConfig, names: int) -> None:
        """`names`: how many words it knows."""
        super().__init__()
        h = config.hidden_size
        self.names = nn.Embedding(names, h, padding_idx=0)
        self.others = nn.ModuleList(nn.Embedding(n, h, padding_idx=0) for n in SIZES)
        for table in (self.names, *self.others):
            nn.init.normal_(table.weight, std=h**-0.5)
            with torch.no_grad():
                table.weight[0].zero_()
        self.angles = nn.Linear(4, h, bias=False)
        self.encoder = Transformer(h, config.layers, config.heads, config.dropout)
        self.decoder = Transformer(h, config.layers, config.heads, config.dropout)
        self.roles = nn.Parameter(torch.randn(3, h) * h**-0.5)
        """Which of the three a row is: the belief, of d^s, of d^g."""
        self.shared = nn.Embedding(3, h)
        """True where a row's name, or all of it, stands in the other description, too (docs/sources.md, S80)."""
        nn.init.normal_(self.shared.weight, std=h**-0.5)
        self.first = nn.Parameter(torch.zeros(h))
        """b^s_0."""
        self.query = nn.Linear(h, h)
        self.key = nn.Linear(h, h)
        self.norm = nn.LayerNorm(h)

    def begin(self, batch: int) -> Tensor:
        """(B, h): b^s_0."""
        return self.first.expand(batch, -1)

    def forward(
        self,
        before: Tensor,
        inputs: Inputs,
        state: EncodedDescriptions | None = None,
        goal: EncodedDescriptions | None = None,
    ) -> tuple[Tensor, Tensor]:
        """One step.

        Args:
          before: (B, h) b^s of the move before.
          state: d^s as `encode` made it, where that has been done before; None encodes `inputs.state`.
          goal: d^g likewise; both may be padded further than `inputs`.

        Returns:
          (B, h) b^s_t, and (B, C + 1) log-probabilities of the moves, stopping last; -inf where not allowed.
        """
        device = before.device
        state = state or self.encode(torch.from_numpy(inputs.state).to(device))  # (B, S, h)
        goal = (goal or self.encode(torch.from_numpy(inputs.goal).to(device))).upto(inputs.goal.shape[1])  # (B, G, h)
        state_shared, goal_shared = (
            self.shared(torch.from_numpy(x).to(device)) for x in (inputs.state_shared, inputs.goal_shared)
        )
        state_rows = state.rows + self.roles[1] + state_shared
        goal_rows = goal.rows + self.roles[2] + goal_shared
        rows = torch.cat([(before + self.roles[0])[:, None], state_rows, goal_rows], 1)  # (B, 1 + S + G, h)
        there = torch.ones_like(state.present[:, :1])
        packing = Packing.of(torch.cat([there, state.present, goal.present], 1))
        belief = self.norm(self.decoder(packing.pack(rows), packing, first_rows_only=True))  # (B, h)
        moves, angles, allowed = (torch.from_numpy(x).to(device) for x in (inputs.moves, inputs.angles, inputs.allowed))
        keys = self.key(self.embed(moves) + self.angles(angles))  # (B, C + 1, h)
        scores = torch.einsum("bh,bch->bc", self.query(belief), keys) / math.sqrt(keys.shape[-1])
        return belief, scores.masked_fill(~allowed, -torch.inf).log_softmax(-1)

    def encode(self, rows: Tensor) -> EncodedDescriptions:
        """(B, M, 5) int64 of descriptions, each of one row or more -> what the encoder makes of them."""
        packing = Packing.of(rows[..., 1] != 0)
        return EncodedDescriptions(packing.pad(self.encoder(self.embed(packing.pack(rows)), packing)), packing.present)

    def embed(self, rows: Tensor) -> Tensor:
        """(..., 5) int64 -> (..., h): "sum all the embeddings into a single vector"."""
        parts = [table(rows[..., k + 1]) for k, table in enumerate(self.others)]
        return self.names(rows[..., 0]) + torch.stack(parts).sum(0)


class RecurrentHead(nn.Module):
    """An LSTM over what the execution policy thinks: psi with five outputs, V with one.

    "The input of this model is the execution policy's model outputs, b^s_t and p_t, and the
    embedding of the previously taken action" (appendix E). p_t has as many entries as there are
    moves; here it is the probability of stopping and the `SHOWN` largest of moving, in descending order.
    """

    def __init__(self, belief: int, hidden: int, outputs: int, *, knows_stack: bool) -> None:
        super().__init__()
        self.knows_stack = knows_stack
        self.last = nn.Embedding(1 + len(INTENTIONS), hidden // 4)
        """Of the intention before; 0 at the beginning."""
        extra = DEPTHS if knows_stack else 0
        self.cell = nn.LSTMCell(belief + 1 + SHOWN + hidden // 4 + extra, hidden)
        self.out = nn.Linear(hidden, outputs)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def begin(self, batch: int) -> tuple[Tensor, Tensor]:
        """(B, hidden) twice: nothing has been thought."""
        zero = self.out.weight.new_zeros(batch, self.cell.hidden_size)
        return zero, zero

    def forward(
        self, belief: Tensor, shown: Tensor, last: Tensor, depth: Tensor, memory: tuple[Tensor, Tensor]
    ) -> tuple[Tensor, tuple[Tensor, Tensor]]:
        """One step.

        Args:
          belief: (B, h) b^s_t.
          shown: (B, 1 + SHOWN) p_t, see `shown_probabilities`.
          last: (B,) int64, 0 or 1 + the intention before.
          depth: (B,) int64, goals on the stack, at least 1.
          memory: what this returned before.

        Returns:
          (B, outputs), and the memory.
        """
        parts = [belief, shown, self.last(last)]
        if self.knows_stack:
            parts.append(nn.functional.one_hot((depth - 1).clamp(0, DEPTHS - 1), DEPTHS).to(belief.dtype))
        memory = self.cell(torch.cat(parts, -1), memory)
        return self.out(memory[0]), memory


def shown_probabilities(log_moves: Tensor) -> Tensor:
    """(B, 1 + SHOWN): the probability of stopping, then those of moving from the largest on.

    Args:
      log_moves: (B, C + 1) log-probabilities, stopping last.
    """
    p = log_moves.exp()
    moves = p[:, :-1].sort(-1, descending=True).values[:, :SHOWN]
    return torch.cat([p[:, -1:], nn.functional.pad(moves, (0, SHOWN - moves.shape[1]))], -1)
