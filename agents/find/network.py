"""Networks of an agent that looks for something: how good its ways are, and whether to stop there.

N places, A ways of the one that has most, D size of a view's features, h hidden size, L words, C classes of things.
"""

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from embodied.interface import TURNS, VIEWS

FACTS = 5
"""Of an option; see embodied.agents.find.policy.facts."""


def _around() -> Tensor:
    """(36, 9) each view and those beside, above and below it."""
    turn, tilt = np.arange(VIEWS) % TURNS, np.arange(VIEWS) // TURNS
    beside = [
        np.clip(tilt + up, 0, VIEWS // TURNS - 1) * TURNS + (turn + aside) % TURNS
        for up in (-1, 0, 1)
        for aside in (-1, 0, 1)
    ]
    return torch.from_numpy(np.stack(beside, 1))


AROUND = _around()


READ = ("visible", "within reach", "leads there")
"""Reading of each view for each class of things: whether one can be seen in it; whether one is there at which to
stop; and whether the way in that view is the shortest to one."""
OTHER = 8
"""Numbers of a view, and of a class, that mean whatever helps."""


class Look(nn.Module):
    """Looks into all views of a place, each with what is around it in mind."""

    def __init__(self, features: int, size: int, dropout: float) -> None:
        super().__init__()
        self.dropout = dropout
        self.scale = nn.LayerNorm(features)
        self.see, self.around = nn.Linear(features, size), nn.Linear(2 * size, size)
        self.join = nn.Linear(size, size)

    def look(self, seen: Tensor) -> Tensor:
        """(N, 36, h) of features (N, 36, D)."""
        x = self.scale(seen) * F.dropout(seen.new_ones(len(seen), 1, seen.shape[-1]), self.dropout, self.training)
        look = torch.relu(self.see(x))
        around = self.around(torch.cat([look.amax(1), look.mean(1)], -1))
        return F.dropout(torch.relu(self.join(look) + around[:, None]), self.dropout, self.training)


class SeekNetwork(Look):
    """Reads every view for every class of things, then judges ways and stopping by what was read for the one wanted.

    The readers have labels for all classes at once; what is made of them is the same for all classes.
    """

    requests: Tensor
    price: nn.Linear
    """FACTS to 1: what an option costs or gains apart from what its place looks like."""

    def __init__(self, features: int, requests: Tensor, size: int, dropout: float) -> None:
        """Args:
        requests: (C, L) int64 words of a request for each class.
        """
        super().__init__(features, size, dropout)
        self.register_buffer("requests", requests)
        classes = len(requests)
        self.readers = nn.Linear(size, len(READ) * classes)
        self.other, self.kinds = nn.Linear(size, OTHER), nn.Embedding(classes, OTHER)
        one = len(READ) + OTHER
        self.way = nn.Sequential(nn.Linear(4 * one + OTHER, 64), nn.ReLU(), nn.Linear(64, 1))
        self.stop = nn.Sequential(nn.Linear(2 * one + OTHER, 64), nn.ReLU(), nn.Linear(64, 1))
        self.trust = nn.Parameter(torch.tensor([1.0, 1.0, 1.0]))
        """In what is read: ways to what is visible, ways that lead there, and stopping at what is within reach."""
        self.price = nn.Linear(FACTS, 1, bias=False)
        self.price.weight.data = torch.tensor([[0.0, -5.0, 0.0, 0.0, 0.0]])  # at first a move costs half a logit

    def read(self, seen: Tensor) -> Tensor:
        """(N, 36, READ, C) logits."""
        return self.readers(self.look(seen)).unflatten(-1, (len(READ), -1))

    def wanted(self, seen: Tensor, request: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """(N, 36, READ) logits for the class that is asked for, zeros for an unknown one; its number; (N, 36, h)."""
        same = (request[:, None] == self.requests[None]).all(-1)  # (N, C)
        kind = same.float().argmax(1)
        look = self.look(seen)
        weight, bias = (x.unflatten(0, (len(READ), -1)) for x in (self.readers.weight, self.readers.bias))
        read = torch.einsum("nvh,knh->nvk", look, weight[:, kind]) + bias[:, kind].T[:, None]
        return read * same.any(1)[:, None, None], kind, look

    def forward(self, seen: Tensor, request: Tensor, views: Tensor) -> tuple[Tensor, Tensor]:
        """Logits of the ways (N, A), and of stopping (N,).

        Args:
          seen: (N, 36, D) features.
          request: (N, L) int64 words; 0 is padding.
          views: (N, A) int64 view of each way.
        """
        read, kind, look = (x.detach() for x in self.wanted(seen, request))  # decisions teach no reading
        views_of = torch.cat([read / 4, self.other(look)], -1)  # (N, 36, one)
        whole = torch.cat([views_of.amax(1), views_of.mean(1), self.kinds(kind)], -1)
        rows = torch.arange(len(seen))[:, None]
        own, near = views_of[rows, views], views_of[rows[..., None], AROUND[views]].amax(2)  # (N, A, one)
        ways = self.way(torch.cat([own, near, whole[:, None].expand(-1, views.shape[1], -1)], -1))[..., 0]
        shown = self.trust[0] * F.logsigmoid(4 * near[..., 0]) + self.trust[1] * F.logsigmoid(4 * own[..., 2])
        return ways + shown, self.stop(whole)[:, 0] + self.trust[2] * read[..., 1].amax(1)


class Explorer(SeekNetwork):
    """Explores the nearest frontier, but goes to what it sees and stops at what is within reach: it learns to see, not
    to act."""

    bar: Tensor

    def __init__(self, features: int, requests: Tensor, size: int, dropout: float) -> None:
        super().__init__(features, requests, size, dropout)
        self.register_buffer("bar", torch.tensor(0.0))  # logit from which on something counts as within reach

    def ruled(self, patience: float, bar: float) -> None:
        """Let a move cost a logit of `patience`, and stop from a logit of `bar` on."""
        self.price.weight.data = torch.tensor([[0.0, -10 * patience, 0.0, 0.0, 0.0]])
        self.bar.fill_(bar)

    def forward(self, seen: Tensor, request: Tensor, views: Tensor) -> tuple[Tensor, Tensor]:
        """As SeekNetwork."""
        read = self.wanted(seen, request)[0]
        near = read[torch.arange(len(seen))[:, None, None], AROUND[views], 0].amax(2)
        visible = read[..., 1].amax(1) > self.bar
        return F.logsigmoid(near), torch.where(visible, 100.0, -100.0)
