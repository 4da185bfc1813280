"""The networks of NAV (Figure C.4): a follower reads a request and chooses nodes, a describer reads a walk and writes.

B agents, A actions of the one that has most, D size of a view's features, E of an action's
embedding, L words, T steps, h hidden size.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from agents.common.decoding import Choice
from agents.hanna.attention import DotAttend, FeedForward, MultiAttend, SelfAttend, TextEncoder
from agents.iliad.writing import Bridge, Remembered, Writer, before, write

WORD_END = 2
"""Of a request's words (agents.common.vocabulary)."""


@dataclass(frozen=True, eq=False)
class StepSeen:
    """What B agents see in one step."""

    views: Tensor
    """(B, 36, D) features of the panorama."""
    actions: Tensor
    """(B, A, E) embeddings of the actions; 0 is stop, a zero vector."""
    mask: Tensor
    """(B, A) bool, which of them exist."""
    previous: Tensor
    """(B, E) embedding of the last action, zero at first."""


@dataclass(frozen=True, eq=False)
class Following:
    """What a follower carries from step to step."""

    text: Tensor
    keys: Tensor
    values: Tensor
    """(B, L, h) the request, read, and as keys and values."""
    heard: Tensor
    """(B, L) bool, False on padding."""
    hidden: Tensor
    """(B, h)."""
    past_keys: Tensor
    past_values: Tensor
    """(B, t + 1, h) of the steps so far."""
    time: int


class Follower(nn.Module):
    """pi(a | o, d): self-attention over the steps so far, attention over the request, a score for each action."""

    def __init__(self, words: int, size: int, heads: int, features: int, action: int, horizon: int) -> None:
        super().__init__()
        self.read = TextEncoder(words, size, heads, 0.0)
        self.listen, self.recall = MultiAttend(size, heads, 0.0), SelfAttend(size, heads, 0.0)
        self.look = DotAttend(size, features, size)
        self.enter, self.time = nn.Linear(action + features, size), nn.Embedding(horizon, size)
        self.feed, self.first = FeedForward(size, 0.0), nn.Linear(size, size)
        self.want, self.offer, self.score = nn.Linear(size, size), nn.Linear(action, size), nn.Linear(size, 1)

    def begin(self, request: Tensor) -> Following:
        """Read (B, L) int64 words; 0 is padding."""
        text, heard = self.read(request), request != 0
        mean = (text * heard[..., None]).sum(1) / heard.sum(1, keepdim=True)
        keys, values = self.listen.key(text), self.listen.value(text)
        return Following(
            text, keys, values, heard, torch.tanh(self.first(mean)), *self.recall.empty(len(text), text), 0
        )

    def step(self, now: Following, seen: StepSeen) -> tuple[Tensor, Following]:
        """Logits (B, A), -inf where there is no action, and what is carried on."""
        entered = self.enter(torch.cat([seen.previous, self.look(now.hidden, seen.views)], -1))
        query = torch.relu(entered) + self.time.weight[now.time] + now.hidden
        everything = query.new_ones(now.past_keys.shape[:2], dtype=torch.bool)
        recalled, past_keys = self.recall(query, now.past_keys, now.past_values, everything)
        hidden = self.feed(self.listen(recalled, now.keys, now.values, now.heard))
        wanted = torch.tanh(self.want(hidden))[:, None] * torch.tanh(self.offer(seen.actions))
        logits = self.score(wanted)[..., 0].masked_fill(~seen.mask, -torch.inf)
        past_values = self.recall.append_value(now.past_values, hidden)
        carried = Following(now.text, now.keys, now.values, now.heard, hidden, past_keys, past_values, now.time + 1)
        return logits, carried


class WalkDescriber(nn.Module):
    """p(words | walk): one Transformer layer over the steps, read with attention (docs/sources.md, S104)."""

    def __init__(self, words: int, size: int, heads: int, features: int, action: int, horizon: int) -> None:
        super().__init__()
        self.look = DotAttend(action, features, size)
        self.enter, self.time = nn.Linear(action + features, size), nn.Embedding(horizon, size)
        self.relate, self.feed = MultiAttend(size, heads, 0.0), FeedForward(size, 0.0)
        self.first = Bridge(size)
        self.writer = Writer(words, size, size, memories=1)

    def read(self, views: Tensor, actions: Tensor, mask: Tensor) -> tuple[tuple[Tensor, Tensor], list[Remembered]]:
        """(B, T, 36, D) panoramas, (B, T, E) actions taken there, (B, T) which there are: what is written from."""
        b, t = mask.shape
        looked = self.look(actions.flatten(0, 1), views.flatten(0, 1)).view(b, t, -1)
        x = torch.relu(self.enter(torch.cat([actions, looked], -1))) + self.time.weight[:t]
        x = self.feed(self.relate(x, self.relate.key(x), self.relate.value(x), mask))
        mean = (x * mask[..., None]).sum(1) / mask.sum(1, keepdim=True)
        return self.first(mean), [self.writer.remember(0, x, mask)]

    def forward(self, views: Tensor, actions: Tensor, mask: Tensor, written: Tensor) -> Tensor:
        """Logits (B, W, V) before each of the given words (B, W)."""
        state, memories = self.read(views, actions, mask)
        return self.writer(before(written, WORD_END), state, memories)[0]

    @torch.no_grad()
    def write(
        self, views: Tensor, actions: Tensor, mask: Tensor, choose: Choice, longest: int, copies: int = 1
    ) -> Tensor:
        """(copies B, at most `longest`) words; the copies of one description stand one behind the other."""
        (hidden, cell), memories = self.read(views, actions, mask)
        if copies > 1:
            rows = torch.arange(len(mask)).repeat_interleave(copies)
            hidden, cell, memories = hidden[:, rows], cell[:, rows], [m.select(rows) for m in memories]
        return write(self.writer, (hidden, cell), memories, choose, longest, WORD_END)
