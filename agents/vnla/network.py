"""The navigation and the asking module of VNLA: an LSTM that reads, one that acts, attention to words.

B agents, L words, h the hidden size, D the length of a view's features. Two heads share the
decoder: navigation (6 actions: WORDS and stop) and asking (2: not to ask, to ask). What asking reads is detached, so
that only its own head learns from its loss. Where to go is read from the panorama (embodied.agents.vnla.looking).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from embodied.action_spaces import WORDS
from embodied.agents.common.tensors import Rows
from embodied.agents.learners.vnla import VnlaSettings
from embodied.agents.vnla.looking import READING, Looker

ACTIONS = len(WORDS) + 1
"""Navigation actions: those of WORDS in their order, and stop."""
STOP, NO_MOVE = len(WORDS), len(WORDS) + 1
"""Numbers of stopping and of 'no action before this one'."""
DONT, ASK, NO_ASK = 0, 1, 2
"""Numbers of not asking, of asking, and of 'no decision before this one'."""
MOST_LEFT = 9
"""Requests beyond this many that are left are not told apart, as in the program."""


@dataclass(frozen=True, eq=False)
class ReadText(Rows):
    """The text that B agents have before them."""

    words: Tensor
    """(B, L, h)."""
    mask: Tensor
    """(B, L) bool, which of them are words."""

    def put(self, rows: Tensor, other: ReadText) -> ReadText:
        """The texts with those of `rows` (k,), ascending, replaced; as long as the longest of both."""
        if len(rows) == len(self.mask):
            return other
        longest = max(self.mask.shape[1], other.mask.shape[1])
        padded = lambda text: [
            F.pad(x, (0, 0) * (x.dim() - 2) + (0, longest - x.shape[1])) for x in (text.words, text.mask)
        ]
        return ReadText(*(old.index_copy(0, rows, new) for old, new in zip(padded(self), padded(other), strict=True)))


@dataclass(frozen=True, eq=False)
class VnlaPercept(Rows):
    """Inputs of one pass for B agents."""

    reading: Tensor
    """(B, READING) what is read from the panorama for the request."""
    previous_move: Tensor
    """(B,) int64: a navigation action, or NO_MOVE."""
    previous_ask: Tensor
    """(B,) int64: DONT, ASK or NO_ASK."""
    left: Tensor
    """(B,) int64: requests that are left."""
    allowed: Tensor
    """(B, 6) bool: navigation actions that are possible."""


class VnlaNetwork(nn.Module):
    """Reader, decoder and the two heads."""

    def __init__(self, config: VnlaSettings, words: int, feature_size: int) -> None:
        """Args:
        words: vocabulary size; word 0 is padding.
        """
        super().__init__()
        h = config.hidden_size
        self.hidden_size = h
        self.embedding = nn.Embedding(words, config.word_embedding, padding_idx=0)
        self.reader = nn.LSTM(config.word_embedding, h, batch_first=True)
        self.moves = nn.Embedding(ACTIONS + 1, config.navigation_embedding)
        self.asks = nn.Embedding(3, config.ask_embedding)
        self.budgets = nn.Embedding(MOST_LEFT + 1, config.budget_embedding)
        self.looker = Looker(words, feature_size, h, config.dropout)
        self.decoder = nn.LSTMCell(config.navigation_embedding + config.ask_embedding + READING, h)
        self.query, self.attended = nn.Linear(h, h, bias=False), nn.Linear(2 * h, h, bias=False)
        self.navigation = nn.Linear(h, ACTIONS)
        self.glance = nn.Sequential(nn.Linear(READING, h), nn.ReLU(), nn.Linear(h, ACTIONS))
        self.asking = nn.Sequential(
            nn.Linear(2 * h + READING + ACTIONS + config.budget_embedding, h),
            nn.ReLU(),
            nn.Dropout(config.dropout),
            nn.Linear(h, 2),
        )
        self.dropout = nn.Dropout(config.dropout)

    def blank(self, agents: int) -> ReadText:
        """No text yet."""
        words = self.navigation.weight.new_zeros(agents, 0, self.hidden_size)
        return ReadText(words, words.new_zeros(agents, 0, dtype=torch.bool))

    def read(self, tokens: Tensor) -> ReadText:
        """New texts, (B, L) int64 with the last word first and the end last.

        As long as the longest of them: padding comes last and changes nothing before it.
        """
        mask = tokens != 0
        longest = int(mask.sum(1).max())
        mask = mask[:, :longest]
        words, _ = self.reader(self.dropout(self.embedding(tokens[:, :longest])))
        return ReadText(self.dropout(words) * mask[..., None], mask)

    def navigate(self, percept: VnlaPercept, state: Tensor, text: ReadText) -> tuple[Tensor, Tensor, Tensor]:
        """The pass that acts: logits (B, 6), -inf where an action is not possible; the decoder's state after it
        (B, 2, h); and what asking reads of it (B, 2 h).

        The program's attention also remembers how much it attended to each word (docs/sources.md, S192).
        """
        inputs = [self.moves(percept.previous_move), self.asks(percept.previous_ask), percept.reading]
        hidden, cell = self.decoder(self.dropout(torch.cat(inputs, -1)), state.unbind(1))
        output = self.dropout(hidden)
        scores = (text.words @ self.query(output)[..., None])[..., 0]
        weights = scores.masked_fill(~text.mask, -torch.inf).softmax(-1)
        context = (weights[:, None] @ text.words)[:, 0]
        attended = torch.tanh(self.attended(torch.cat([context, output], -1)))
        moves = (self.navigation(attended) + self.glance(percept.reading)).masked_fill(~percept.allowed, -torch.inf)
        return moves, torch.stack([hidden, cell], 1), torch.cat([attended, output], -1)

    def consider(self, percept: VnlaPercept, state: Tensor, text: ReadText) -> tuple[Tensor, Tensor]:
        """The pass that decides whether to ask, of which nothing is kept: probabilities (B, 6) and logits (B, 2).

        No gradient leaves the asking head.
        """
        with torch.no_grad():
            logits, _, known = self.navigate(percept, state, text)
            moves, left = logits.softmax(-1), self.budgets(percept.left.clamp(max=MOST_LEFT))
        return moves, self.asking(torch.cat([known, percept.reading, moves, left], -1))
