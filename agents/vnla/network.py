"""The navigation and the asking module of VNLA: an LSTM that reads, one that acts, attention with coverage.

B agents, L words, h the hidden size, c the coverage, D the length of a view's features. Two heads share the
decoder: navigation (6 actions: WORDS and stop) and asking (2: not to ask, to ask). What asking reads is detached, so
that only its own head learns from its loss.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.vnla.config import VnlaSettings
from embodied.action_spaces import WORDS

ACTIONS = len(WORDS) + 1
"""Navigation actions: those of WORDS in their order, and stop."""
STOP, NO_MOVE = len(WORDS), len(WORDS) + 1
"""Numbers of stopping and of 'no action before this one'."""
DONT, ASK, NO_ASK = 0, 1, 2
"""Numbers of not asking, of asking, and of 'no decision before this one'."""
MOST_LEFT = 9
"""Requests beyond this many that are left are not told apart, as in the program."""


@dataclass(frozen=True, eq=False)
class ReadText:
    """The text that B agents have before them, and how much each word was attended to."""

    words: Tensor
    """(B, L, h)."""
    mask: Tensor
    """(B, L) bool, which of them are words."""
    coverage: Tensor
    """(B, L, c)."""

    def select(self, rows: Tensor) -> ReadText:
        """The texts of some agents, in the order of `rows` (k,)."""
        return ReadText(**{f.name: getattr(self, f.name)[rows] for f in dataclasses.fields(self)})

    def put(self, rows: Tensor, other: ReadText) -> ReadText:
        """The texts with those of `rows` replaced."""
        return ReadText(
            **{
                f.name: getattr(self, f.name).index_copy(0, rows, getattr(other, f.name))
                for f in dataclasses.fields(self)
            }
        )


@dataclass(frozen=True, eq=False)
class DecoderState:
    """Hidden and cell state of the decoder, (B, h) each."""

    hidden: Tensor
    cell: Tensor

    def select(self, rows: Tensor) -> DecoderState:
        return DecoderState(self.hidden[rows], self.cell[rows])

    def put(self, rows: Tensor, other: DecoderState) -> DecoderState:
        return DecoderState(self.hidden.index_copy(0, rows, other.hidden), self.cell.index_copy(0, rows, other.cell))


@dataclass(frozen=True, eq=False)
class VnlaPercept:
    """Inputs of one pass for B agents."""

    view: Tensor
    """(B, D) features of the one view that the agent has."""
    previous_move: Tensor
    """(B,) int64: a navigation action, or NO_MOVE."""
    previous_ask: Tensor
    """(B,) int64: DONT, ASK or NO_ASK."""
    left: Tensor
    """(B,) int64: requests that are left."""
    allowed: Tensor
    """(B, 6) bool: navigation actions that are possible."""


class CoverageAttention(nn.Module):
    """Dot attention over words that remembers, for each, the attention it had (Tu et al. 2016, as in the program)."""

    def __init__(self, hidden: int, coverage: int) -> None:
        super().__init__()
        self.query = nn.Linear(hidden, hidden, bias=False)
        self.out = nn.Linear(2 * hidden, hidden, bias=False)
        self.remembered = nn.Linear(coverage, hidden)
        self.memory = nn.GRUCell(2 * hidden + 1, coverage)

    def forward(self, state: Tensor, text: ReadText) -> tuple[Tensor, Tensor, Tensor]:
        """Attend.

        Args:
          state: (B, h).

        Returns:
          The attended state (B, h), the weights (B, L) and the coverage after it (B, L, c).
        """
        words = text.words + self.remembered(text.coverage)  # (B, L, h)
        scores = torch.einsum("bh,blh->bl", self.query(state), words)
        weights = scores.masked_fill(~text.mask, -torch.inf).softmax(-1)
        context = torch.einsum("bl,blh->bh", weights, words)
        seen = torch.cat([words, state[:, None].expand_as(words), weights[..., None]], -1)  # (B, L, 2h + 1)
        coverage = self.memory(seen.flatten(0, 1), text.coverage.flatten(0, 1)).view_as(text.coverage)
        return torch.tanh(self.out(torch.cat([context, state], -1))), weights, coverage


class VnlaNetwork(nn.Module):
    """Reader, decoder and the two heads."""

    def __init__(self, config: VnlaSettings, words: int, feature_size: int) -> None:
        """Args:
        words: vocabulary size; word 0 is padding.
        """
        super().__init__()
        h = config.hidden_size
        self.hidden_size, self.coverage = h, config.coverage
        self.embedding = nn.Embedding(words, config.word_embedding, padding_idx=0)
        self.reader = nn.LSTM(config.word_embedding, h, batch_first=True)
        self.moves = nn.Embedding(ACTIONS + 1, config.navigation_embedding)
        self.asks = nn.Embedding(3, config.ask_embedding)
        self.budgets = nn.Embedding(MOST_LEFT + 1, config.budget_embedding)
        self.decoder = nn.LSTMCell(config.navigation_embedding + config.ask_embedding + feature_size, h)
        self.attention = CoverageAttention(h, config.coverage)
        self.navigation = nn.Linear(h, ACTIONS)
        self.asking = nn.Sequential(
            nn.Linear(2 * h + feature_size + ACTIONS + config.budget_embedding, h),
            nn.ReLU(),
            nn.Dropout(config.dropout),
            nn.Linear(h, 2),
        )
        self.dropout = nn.Dropout(config.dropout)

    def start(self, agents: int) -> DecoderState:
        """The decoder's state before the first step: zero, the reader's is not handed on."""
        zero = self.navigation.weight.new_zeros(agents, self.hidden_size)
        return DecoderState(zero, zero)

    def blank(self, agents: int, length: int) -> ReadText:
        """No text yet."""
        zero = self.navigation.weight.new_zeros(agents, length, self.hidden_size)
        return ReadText(zero, zero[..., 0] > 0, zero[..., :1].expand(-1, -1, self.coverage))

    def read(self, tokens: Tensor) -> ReadText:
        """New texts, (B, L) int64 with the last word first and the end last; nothing of them was attended to yet."""
        mask = tokens != 0
        longest = int(mask.sum(1).max())  # padding comes last and changes nothing before it
        words, _ = self.reader(self.dropout(self.embedding(tokens[:, :longest])))
        words = F.pad(self.dropout(words), (0, 0, 0, tokens.shape[1] - longest)) * mask[..., None]
        return ReadText(words, mask, words.new_zeros(*tokens.shape, self.coverage))

    def decode(
        self, percept: VnlaPercept, state: DecoderState, text: ReadText
    ) -> tuple[Tensor, Tensor, DecoderState, Tensor]:
        """One step of the decoder: attended and plain output (B, h), the state and the coverage after it."""
        inputs = [self.moves(percept.previous_move), self.asks(percept.previous_ask), percept.view]
        hidden, cell = self.decoder(self.dropout(torch.cat(inputs, -1)), (state.hidden, state.cell))
        output = self.dropout(hidden)
        attended, _, coverage = self.attention(output, text)
        return attended, output, DecoderState(hidden, cell), coverage

    def move_logits(self, attended: Tensor, allowed: Tensor) -> Tensor:
        """(B, 6), -inf where an action is not possible."""
        return self.navigation(attended).masked_fill(~allowed, -torch.inf)

    def navigate(
        self, percept: VnlaPercept, state: DecoderState, text: ReadText
    ) -> tuple[Tensor, DecoderState, ReadText]:
        """The pass that acts: logits (B, 6), and state and text after it."""
        attended, _, state, coverage = self.decode(percept, state, text)
        return self.move_logits(attended, percept.allowed), state, dataclasses.replace(text, coverage=coverage)

    def consider(self, percept: VnlaPercept, state: DecoderState, text: ReadText) -> tuple[Tensor, Tensor]:
        """The pass that decides whether to ask, of which nothing is kept: probabilities (B, 6) and logits (B, 2).

        No gradient leaves the asking head.
        """
        with torch.no_grad():
            attended, output, _, _ = self.decode(percept, state, text)
            moves = self.move_logits(attended, percept.allowed).softmax(-1)
        left = self.budgets(percept.left.clamp(max=MOST_LEFT)).detach()
        return moves, self.asking(torch.cat([attended, output, percept.view, moves, left], -1))
