"""The describer of NAV (Figure C.4), which reads a walk and writes; who follows is agents.vln.network's follower.

B walks, T steps, E size of a view's features and direction, h hidden size.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from embodied.agents.common.choosing import Choice
from embodied.agents.common.vocabulary import END_NUMBER
from embodied.agents.hanna.attention import DotAttend, FeedForward, MultiAttend
from embodied.agents.iliad.writing import AttentiveWriter, Bridge, Remembered, before, write


class WalkDescriber(nn.Module):
    """p(words | walk): one Transformer layer over the steps, read with attention (docs/sources.md, S104)."""

    def __init__(self, words: int, size: int, heads: int, seen: int, horizon: int) -> None:
        super().__init__()
        self.look = DotAttend(seen, seen, size)
        self.enter, self.time = nn.Linear(2 * seen, size), nn.Embedding(horizon, size)
        self.relate, self.feed = MultiAttend(size, heads, 0.0), FeedForward(size, 0.0)
        self.first = Bridge(size)
        self.writer = AttentiveWriter(words, size, size, memories=1)

    def read(self, views: Tensor, actions: Tensor, mask: Tensor) -> tuple[tuple[Tensor, Tensor], list[Remembered]]:
        """(B, T, 36, E) panoramas, (B, T, E) actions taken there, (B, T) which there are: what is written from."""
        b, t = mask.shape
        looked = self.look(actions.flatten(0, 1), views.flatten(0, 1)).view(b, t, -1)
        x = torch.relu(self.enter(torch.cat([actions, looked], -1))) + self.time.weight[:t]
        x = self.feed(self.relate(x, self.relate.key(x), self.relate.value(x), mask))
        mean = (x * mask[..., None]).sum(1) / mask.sum(1, keepdim=True)
        return self.first(mean), [self.writer.remember(0, x, mask)]

    def forward(self, views: Tensor, actions: Tensor, mask: Tensor, written: Tensor) -> Tensor:
        """Logits (B, W, V) before each of the given words (B, W)."""
        return self.writer(before(written, END_NUMBER), *self.read(views, actions, mask))[0]

    @torch.no_grad()
    def write(
        self, views: Tensor, actions: Tensor, mask: Tensor, choose: Choice, longest: int, copies: int = 1
    ) -> Tensor:
        """(copies B, at most `longest`) words; the copies of one description stand one behind the other."""
        return write(self.writer, *self.read(views, actions, mask), choose, longest, END_NUMBER, copies)
