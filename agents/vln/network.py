"""The follower's network: an LSTM that reads, one that acts and attends to words and views (Anderson et al. 2018, Fried
et al. 2018, Tan et al. 2019).

B agents, A actions of the one that has most (0 is stop), L words, D size of a view's features, h the hidden size.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from embodied.agents.common.rows import Rows
from embodied.agents.common.vocabulary import WordEmbedding
from embodied.agents.hanna.attention import DotAttend
from embodied.agents.vln.config import FollowerSettings
from embodied.assets.records import ROOM_KINDS

SPREAD = 0.15
"""Deviation, as a share of the instruction, with which attention begins around the words for the way ahead."""
COPIES = 8
"""Of the four orientation features beside those of a view."""


@dataclass(frozen=True, eq=False)
class FollowerViews:
    """The views of B agents in one step."""

    views: Tensor
    """(B, 36, D + 4 COPIES) features and directions, relative to where they look, of all views."""
    actions: Tensor
    """(B, A - 1, D + 4 COPIES) the same of what can be gone to."""
    mask: Tensor
    """(B, A) bool, which actions there are."""


@dataclass(frozen=True, eq=False)
class FollowerState(Rows):
    """The instructions of B agents, read, and what they remember of the way."""

    words: Tensor
    """(B, L, h)."""
    mask: Tensor
    """(B, L) bool, which of them are words."""
    hidden: Tensor
    cell: Tensor
    """(B, h) of the LSTM that acts."""
    meant: Tensor
    """(B, h) the words attended to, and the hidden state, as one."""
    taken: Tensor
    """(B, h) the last action as it was seen; zero at first."""


@dataclass(frozen=True, eq=False)
class FollowerOutputs:
    """Outputs of the network in one step."""

    moves: Tensor
    """(B, A) logits, -inf where there is no action."""
    left: Tensor
    """(B,) which share of the way is left, as it guesses."""
    rooms: Tensor
    """(B, A, kinds) logits of the kind of room that it stands in (0) and that it can go to."""
    tokens: Tensor
    """(B, A, h) the actions as they were seen."""


class FollowerNetwork(nn.Module):
    """pi(a | o, d), with a guess of the way that is left and of the rooms that are near."""

    def __init__(self, config: FollowerSettings, words: int, features: int) -> None:
        super().__init__()
        h, size = config.hidden_size, features + 4 * COPIES
        self.embed, self.dropout = WordEmbedding(words, h), nn.Dropout(config.dropout)
        self.read = nn.LSTM(h, h // 2, batch_first=True, bidirectional=True)
        self.begins = nn.Linear(h, 2 * h)
        self.look, self.stand = DotAttend(h, size, h), DotAttend(h, size, h)
        self.enter = nn.Sequential(nn.Linear(size, h), nn.ReLU(), nn.Linear(h, h), nn.LayerNorm(h, eps=1e-6))
        self.act, self.room = nn.LSTMCell(2 * h, h), nn.Linear(h, len(ROOM_KINDS))
        self.query, self.mean = nn.Linear(h, h, bias=False), nn.Linear(2 * h, h)
        self.drawn = nn.Parameter(torch.ones(()))
        self.want, self.stop, self.left = nn.Linear(h, h), nn.Linear(h, 1), nn.Linear(h, 1)

    def begin(self, numbers: Tensor) -> FollowerState:
        """Read (B, L) int64 words; 0 is padding."""
        mask = numbers != 0
        packed = nn.utils.rnn.pack_padded_sequence(
            self.dropout(self.embed(numbers)), mask.sum(1).cpu(), batch_first=True, enforce_sorted=False
        )
        read, (last, _) = self.read(packed)
        words = self.dropout(nn.utils.rnn.pad_packed_sequence(read, batch_first=True)[0])
        hidden, cell = torch.tanh(self.begins(last.transpose(0, 1).flatten(1))).chunk(2, -1)
        return FollowerState(words, mask, hidden, cell, hidden, torch.zeros_like(hidden))

    def forward(self, heard: FollowerState, seen: FollowerViews) -> tuple[FollowerOutputs, FollowerState]:
        """Outputs of one step, and the next state; `taken` is the caller's to fill in."""
        around = self.enter(self.look(heard.meant, seen.views))
        hidden, cell = self.act(self.dropout(torch.cat([heard.taken, around], -1)), (heard.hidden, heard.cell))
        left = self.left(hidden)[:, 0].sigmoid()
        weights = torch.einsum("blh,bh->bl", heard.words, self.query(hidden)) + self.near(heard.mask, left.detach())
        weights = weights.masked_fill(~heard.mask, -torch.inf)
        attended = torch.einsum("bl,blh->bh", weights.softmax(-1), heard.words)
        meant = torch.tanh(self.mean(self.dropout(torch.cat([attended, hidden], -1))))  # (B, h)
        here = self.stand(meant, seen.views)[:, None]
        tokens = self.enter(torch.cat([here, seen.actions], 1))  # (B, A, h)
        scores = torch.einsum("bah,bh->ba", self.dropout(tokens), self.want(meant)) / tokens.shape[-1] ** 0.5
        moves = torch.cat([scores[:, :1] + self.stop(meant), scores[:, 1:]], 1).masked_fill(~seen.mask, -torch.inf)
        outputs = FollowerOutputs(moves, left, self.room(tokens), tokens)
        return outputs, dataclasses.replace(heard, hidden=hidden, cell=cell, meant=meant)

    def near(self, mask: Tensor, left: Tensor) -> Tensor:
        """(B, L) by how much attention is drawn to the words that are as far from the end as the agent is."""
        count = mask.sum(1, keepdim=True)
        done = (torch.arange(mask.shape[1], device=mask.device) + 0.5) / count
        return -self.drawn * ((done - (1 - left[:, None])) / SPREAD) ** 2 / 2
