"""The navigation and the asking module of VNLA: an LSTM that reads, one that acts, attention with coverage.

B agents, L words, h the hidden size, c the coverage, D the length of a view's features. Two heads share the
decoder: navigation (6 actions: WORDS and stop) and asking (2: not to ask, to ask). What asking reads is detached, so
that only its own head learns from its loss. Where to go is read from the panorama (embodied.agents.vnla.looking).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from embodied.action_spaces import WORDS
from embodied.agents.common.rows import Rows
from embodied.agents.common.word_vectors import WordEmbedding
from embodied.agents.vnla.config import VnlaSettings
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
    """The text that B agents have before them, and how much each word was attended to."""

    words: Tensor
    """(B, L, h)."""
    driving: Tensor
    """(B, L, 3 c) what of each word enters the memory of attention; the same at every step."""
    mask: Tensor
    """(B, L) bool, which of them are words."""
    coverage: Tensor
    """(B, L, c)."""

    def put(self, rows: Tensor, other: ReadText) -> ReadText:
        """The texts with those of `rows` (k,), ascending, replaced; as long as the longest of both."""
        if len(rows) == len(self.mask):
            return other
        longest = max(self.mask.shape[1], other.mask.shape[1])
        padded, new = self._padded(longest), other._padded(longest)
        return padded._each(lambda a, b: a.index_copy(0, rows, b), new)

    def _padded(self, length: int) -> ReadText:
        more = length - self.mask.shape[1]
        return self._each(lambda x, _: F.pad(x, (0, 0) * (x.dim() - 2) + (0, more)), self) if more else self

    def _each(self, change: Callable[[Tensor, Tensor], Tensor], other: ReadText) -> ReadText:
        """A text whose tensors are made of those of this one and of another."""
        return ReadText(
            **{f.name: change(getattr(self, f.name), getattr(other, f.name)) for f in dataclasses.fields(self)}
        )


@dataclass(frozen=True, eq=False)
class DecoderState(Rows):
    """Hidden and cell state of the decoder, (B, h) each."""

    hidden: Tensor
    cell: Tensor

    def where(self, rows: Tensor, other: DecoderState) -> DecoderState:
        """This state where `rows` (B,) is true, else the other."""
        chosen = rows[:, None]
        return DecoderState(self.hidden.where(chosen, other.hidden), self.cell.where(chosen, other.cell))


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


class CoverageAttention(nn.Module):
    """Dot attention over words that remembers, for each, the attention it had (Tu et al. 2016, as in the program).

    What is attended to is a word plus a linear function of its coverage; a GRU cell takes that, the state and the
    weight into the coverage. Products with the words are taken apart from those with the rest, so that what does not
    change from step to step is computed once per text (`driving`) and nothing of size (B, L, h) is made at a step.
    """

    def __init__(self, hidden: int, coverage: int) -> None:
        super().__init__()
        self.hidden = hidden
        self.query = nn.Linear(hidden, hidden, bias=False)
        self.out = nn.Linear(2 * hidden, hidden, bias=False)
        self.remembered = nn.Linear(coverage, hidden)
        self.memory = nn.GRUCell(2 * hidden + 1, coverage)

    def driving(self, words: Tensor) -> Tensor:
        """(B, L, 3 c) what `words` (B, L, h), without coverage, give to the gates of the memory."""
        of_words = self.memory.weight_ih[:, : self.hidden]
        return F.linear(words, of_words, self.memory.bias_ih + of_words @ self.remembered.bias)

    def forward(self, state: Tensor, text: ReadText) -> tuple[Tensor, Tensor, Tensor]:
        """Attend.

        Args:
          state: (B, h).

        Returns:
          The attended state (B, h), the weights (B, L) and the coverage after it (B, L, c).
        """
        query = self.query(state)[..., None]  # (B, h, 1)
        scores = text.words @ query + text.coverage @ (self.remembered.weight.T @ query)  # the bias moves all alike
        weights = scores[..., 0].masked_fill(~text.mask, -torch.inf).softmax(-1)
        context = weights[:, None] @ text.words + self.remembered(weights[:, None] @ text.coverage)  # (B, 1, h)
        attended = torch.tanh(self.out(torch.cat([context[:, 0], state], -1)))
        return attended, weights, self._remember(state, text, weights)

    def _remember(self, state: Tensor, text: ReadText, weights: Tensor) -> Tensor:
        """The coverage (B, L, c) after a step: a GRU cell on [word and its coverage; state; weight]."""
        h, c = self.hidden, text.coverage.shape[-1]
        of_words, of_state, of_weight = self.memory.weight_ih.split([h, h, 1], 1)
        given = text.driving + F.linear(state, of_state)[:, None] + weights[..., None] * of_weight[:, 0]
        both = torch.cat([of_words @ self.remembered.weight, self.memory.weight_hh])  # (6 c, c)
        from_coverage, kept = F.linear(text.coverage, both).split(3 * c, -1)
        given, kept = given + from_coverage, kept + self.memory.bias_hh
        reset, update = torch.sigmoid(given[..., : 2 * c] + kept[..., : 2 * c]).chunk(2, -1)
        new = torch.tanh(given[..., 2 * c :] + reset * kept[..., 2 * c :])
        return torch.lerp(new, text.coverage, update)


class VnlaNetwork(nn.Module):
    """Reader, decoder and the two heads."""

    def __init__(self, config: VnlaSettings, words: int, feature_size: int) -> None:
        """Args:
        words: vocabulary size; word 0 is padding.
        """
        super().__init__()
        h = config.hidden_size
        self.hidden_size, self.coverage = h, config.coverage
        self.embedding = WordEmbedding(words, config.word_embedding)
        self.reader = nn.LSTM(config.word_embedding, h, batch_first=True)
        self.moves = nn.Embedding(ACTIONS + 1, config.navigation_embedding)
        self.asks = nn.Embedding(3, config.ask_embedding)
        self.budgets = nn.Embedding(MOST_LEFT + 1, config.budget_embedding)
        self.looker = Looker(words, feature_size, h, config.dropout)
        self.decoder = nn.LSTMCell(config.navigation_embedding + config.ask_embedding + READING, h)
        self.attention = CoverageAttention(h, config.coverage)
        self.navigation = nn.Linear(h, ACTIONS)
        self.glance = nn.Sequential(nn.Linear(READING, h), nn.ReLU(), nn.Linear(h, ACTIONS))
        self.asking = nn.Sequential(
            nn.Linear(2 * h + READING + ACTIONS + config.budget_embedding, h),
            nn.ReLU(),
            nn.Dropout(config.dropout),
            nn.Linear(h, 2),
        )
        self.dropout = nn.Dropout(config.dropout)

    def start(self, agents: int) -> DecoderState:
        """The decoder's state before the first step: zero, the reader's is not handed on."""
        zero = self.navigation.weight.new_zeros(agents, self.hidden_size)
        return DecoderState(zero, zero)

    def blank(self, agents: int) -> ReadText:
        """No text yet."""
        nothing = lambda width: self.navigation.weight.new_zeros(agents, 0, width)
        mask = torch.zeros(agents, 0, dtype=torch.bool, device=self.navigation.weight.device)
        return ReadText(nothing(self.hidden_size), nothing(3 * self.coverage), mask, nothing(self.coverage))

    def read(self, tokens: Tensor) -> ReadText:
        """New texts, (B, L) int64 with the last word first and the end last; nothing of them was attended to yet.

        As long as the longest of them: padding comes last and changes nothing before it.
        """
        mask = tokens != 0
        longest = int(mask.sum(1).max())
        mask = mask[:, :longest]
        words, _ = self.reader(self.dropout(self.embedding(tokens[:, :longest])))
        words = self.dropout(words) * mask[..., None]
        return ReadText(words, self.attention.driving(words), mask, words.new_zeros(*mask.shape, self.coverage))

    def decode(
        self, percept: VnlaPercept, state: DecoderState, text: ReadText
    ) -> tuple[Tensor, Tensor, DecoderState, Tensor]:
        """One step of the decoder: attended and plain output (B, h), the state and the coverage after it."""
        inputs = [self.moves(percept.previous_move), self.asks(percept.previous_ask), percept.reading]
        hidden, cell = self.decoder(self.dropout(torch.cat(inputs, -1)), (state.hidden, state.cell))
        output = self.dropout(hidden)
        attended, _, coverage = self.attention(output, text)
        return attended, output, DecoderState(hidden, cell), coverage

    def move_logits(self, attended: Tensor, percept: VnlaPercept) -> Tensor:
        """(B, 6), -inf where an action is not possible."""
        return (self.navigation(attended) + self.glance(percept.reading)).masked_fill(~percept.allowed, -torch.inf)

    def navigate(
        self, percept: VnlaPercept, state: DecoderState, text: ReadText
    ) -> tuple[Tensor, DecoderState, ReadText]:
        """The pass that acts: logits (B, 6), and state and text after it."""
        attended, _, state, coverage = self.decode(percept, state, text)
        return self.move_logits(attended, percept), state, dataclasses.replace(text, coverage=coverage)

    def consider(self, percept: VnlaPercept, state: DecoderState, text: ReadText) -> tuple[Tensor, Tensor]:
        """The pass that decides whether to ask, of which nothing is kept: probabilities (B, 6) and logits (B, 2).

        No gradient leaves the asking head.
        """
        with torch.no_grad():
            attended, output, _, _ = self.decode(percept, state, text)
            moves = self.move_logits(attended, percept).softmax(-1)
        left = self.budgets(percept.left.clamp(max=MOST_LEFT)).detach()
        return moves, self.asking(torch.cat([attended, output, percept.reading, moves, left], -1))
