"""Looker: reads from the panorama of a place, for a request, which way to go and whether to stop; and its lessons.

It has labels for all requests in all places of the training houses, as the learner of `find` has. Differs from the
program, whose decoder is given the features of the one view ahead (docs/sources.md, S190).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from embodied.action_spaces import node_ahead
from embodied.agents.common.vocabulary import Vocabulary, WordEmbedding
from embodied.agents.find.network import Look
from embodied.agents.find.policy import WORDS, wanted
from embodied.agents.vision.sighted_study import Split
from embodied.interface import TURNS, Pose, Sight

READ, READING = 2 * TURNS + 1, 3 * TURNS + 2
"""Numbers that are read of a place, and of that as seen from where the agent looks."""
HOUSES, PLACES, REQUESTS = 8, 8, 8
"""Of an update: houses, places of each and requests for each."""
MORE = 4
"""Requests that end in a place are drawn that much more often for it than others."""
Lesson = tuple[Tensor, ...]
"""Of a house: features (n, 36, D), words (G, L), how good it is to go forward in each turn or to be there (n, G, 13),
and whether one can go forward (n, 12)."""


class Looker(Look):
    """Reads the views of a place for a request in words."""

    def __init__(self, words: int, features: int, size: int, dropout: float) -> None:
        super().__init__(features, size, dropout)
        self.words, self.request = WordEmbedding(words, size), nn.Linear(size, 2 * size)
        beside = lambda: nn.Conv1d(size, 1, 3, padding=1, padding_mode="circular")
        self.leads, self.ways, self.there = beside(), beside(), nn.Linear(2 * size, 1)

    def forward(self, seen: Tensor, requests: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (N, G, 13) of the turn in which to go forward and, last, of being there; and (N, 12) that one can.

        Args:
          seen: (N, 36, D) features.
          requests: (N, G, L) int64 words; 0 is padding.
        """
        look = self.look(seen)
        scale, shift = self.request(self.words(requests).sum(2))[:, :, None].chunk(2, -1)  # (N, G, 1, h)
        meant = torch.relu(look[:, None] * (1 + scale) + shift)
        there = self.there(torch.cat([meant.amax(2), meant.mean(2)], -1))
        leads = self.leads(_turns(meant).flatten(0, 1)).unflatten(0, there.shape[:2])[:, :, 0]
        return torch.cat([leads, there], -1), self.ways(_turns(look))[:, 0]

    def read(self, seen: Tensor, requests: Tensor) -> Tensor:
        """(N, READ) probabilities of `forward` for one request each (N, L); it teaches nothing."""
        with torch.no_grad():
            chosen, ways = self(seen, requests[:, None])
        leads, there = chosen[:, 0].split([TURNS, 1], -1)
        return torch.cat([leads.softmax(-1), ways.sigmoid(), there.sigmoid()], -1)


def turned(read: Tensor, turns: Tensor, came: Tensor, ahead: Tensor) -> Tensor:
    """(N, READING) what was read (N, READ), as seen from where the agent looks, turns (N,) int64; the turn in which
    it would go back, came (N,) int64 or below 0, and whether it can go forward, ahead (N,) bool."""
    back = F.one_hot(came.clamp(min=0), TURNS) * (came >= 0)[:, None]
    of_turns = torch.stack([*read[:, :-1].split(TURNS, -1), back], 1)  # (N, 3, 12)
    index = (turns[:, None] + torch.arange(TURNS, device=turns.device)) % TURNS
    rolled = of_turns.gather(2, index[:, None].expand_as(of_turns)).flatten(1)
    return torch.cat([rolled, read[:, -1:], ahead[:, None]], 1)


def _turns(views: Tensor) -> Tensor:
    """(..., h, 12) the most of all tilts, of views (..., 36, h)."""
    return views.unflatten(-2, (-1, TURNS)).amax(-3).transpose(-1, -2)


def lessons_of(split: Split, vocabulary: Vocabulary) -> list[Lesson]:
    """The lesson of each house of a split, with the G requests of its tasks and its n places."""
    lessons = []
    for name, tasks in itertools.groupby(sorted(split.tasks, key=lambda t: t.world), lambda t: t.world):
        asked, place = {t.request: t for t in tasks}, split.worlds[name]
        distance = np.asarray(place.graph.distance)
        left = np.stack([distance[:, list(t.goal_nodes)].min(1) for t in asked.values()], 1)  # (n, G)
        there = left <= np.array([t.radius for t in asked.values()])
        want, ways = np.zeros((*left.shape, TURNS + 1), np.float16), np.zeros((len(left), TURNS), bool)
        for node in range(len(left)):
            ahead = [node_ahead(place.graph, Pose(node, turn)) for turn in range(TURNS)]
            ends = [node if end is None else end for end in ahead]
            ways[node] = [end is not None for end in ahead]
            costs = np.where(ways[node], distance[node, ends] + left[ends].T, np.inf)  # (G, 12)
            want[node, :, :-1] = [wanted(c) for c in costs]
        want[..., -1] = there
        seen = split.bank.gather([Sight(name, v) for v in range(len(left))])
        words = np.stack([vocabulary.encode(r, WORDS) for r in asked])
        lessons.append((seen, *map(torch.from_numpy, (words, want, ways))))
    return lessons


def reading_loss(looker: Looker, lessons: Sequence[Lesson], rng: np.random.Generator) -> Tensor:
    """Cross-entropy of what is read of some places with what the teacher does there, and of where ways begin."""
    parts = []
    for k in rng.integers(len(lessons), size=HOUSES):
        seen, words, want, ways = lessons[k]
        places = torch.from_numpy(rng.integers(len(seen), size=PLACES))
        edges = (1 + MORE * want[places, :, -1].double()).cumsum(1)  # (PLACES, G)
        drawn = torch.from_numpy(rng.random((PLACES, REQUESTS))) * edges[:, -1:]
        requests = torch.searchsorted(edges, drawn, right=True)
        parts.append((seen[places], words[requests], want[places[:, None], requests], ways[places]))
    seen, heard, want, ways = (torch.cat(x) for x in zip(*parts, strict=True))
    chosen, there = looker(seen.float(), heard)
    onward, stop = want.float().split([TURNS, 1], -1)
    led = -((1 - stop) * onward * chosen[..., :-1].log_softmax(-1)).sum(-1).mean()
    surely = F.binary_cross_entropy_with_logits
    return led + 2 * surely(chosen[..., -1:], stop) + surely(there, ways.float())
