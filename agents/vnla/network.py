"""The navigation and the asking module of VNLA: an LSTM that reads, one that acts, attention to words; and Looker,
which reads from the panorama of a place, for a request, which way to go and whether to stop, with its lessons.

B agents, L words, h the hidden size, D the length of a view's features. Two heads share the
decoder: navigation (6 actions: WORDS and stop) and asking (2: not to ask, to ask). What asking reads is detached, so
that only its own head learns from its loss.

Looker has labels for all requests in all places of the training houses, as the learner of `find` has: the shortest way,
and which kinds of rooms are near, since the way alone does not teach what a request is about. Differs from the program,
whose decoder is given the features of the one view ahead (docs/sources.md, S190).
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from embodied.action_spaces import WORDS, node_ahead
from embodied.agents.common.tensors import Rows
from embodied.agents.common.vocabulary import Vocabulary
from embodied.agents.find.network import Look
from embodied.agents.find.policy import WORDS as REQUEST
from embodied.agents.find.policy import wanted
from embodied.agents.learners.vnla import VnlaSettings
from embodied.agents.vision.sighted_study import Split
from embodied.assets.records import ROOM_KINDS
from embodied.interface import TURNS, FindObject, Pose, Sight

READ, READING = 2 * TURNS + 1, 3 * TURNS + 2
"""Numbers that are read of a place, and of that as seen from where the agent looks."""
HOUSES, PLACES, REQUESTS = 8, 8, 8
"""Of an update: houses, places of each and requests for each."""
MORE = 4
"""Requests that end in a place, or in a room beside it, are drawn that much more often for it than others."""
ROOMS, NO_ROOM, DOUBT = len(ROOM_KINDS), -1, 0.1
"""Kinds of rooms, none of them, and the chance of one that is too small to matter."""
Lesson = tuple[Tensor, ...]
"""Of a house: features (n, 36, D), words (G, L), how good it is to go forward in each turn or to be there (n, G, 13),
whether one can go forward (n, 12), kinds of the rooms asked for (G,), of the places' (n,), of where each turn leads
(n, 12) or NO_ROOM, and how good each turn is on the way to each kind (n, ROOMS, 12)."""


class Readings(NamedTuple):
    """Logits that are read of N places for G requests each: of the turn in which to go forward and of being there
    (N, G, 13); that one can go forward (N, 12); and of kinds of rooms: asked for (N, G, ROOMS), here (N, ROOMS), where
    each turn ends, and which turn goes on to each (both N, 12, ROOMS)."""

    chosen: Tensor
    ways: Tensor
    asked: Tensor
    here: Tensor
    ends: Tensor
    onward: Tensor


class Looker(Look):
    """Reads the views of a place for a request in words."""

    def __init__(self, words: int, features: int, size: int, dropout: float) -> None:
        super().__init__(features, size, dropout)
        self.words, self.request = nn.Embedding(words, size, padding_idx=0), nn.Linear(size, 2 * size)
        beside = lambda out: nn.Conv1d(size, out, 3, padding=1, padding_mode="circular")
        self.leads, self.ways, self.there = beside(1), beside(1), nn.Linear(2 * size, 1)
        self.asked, self.here = nn.Linear(size, ROOMS), nn.Linear(2 * size, ROOMS)
        self.beside, self.ends, self.onward = beside(size), nn.Linear(size, ROOMS), nn.Linear(size, ROOMS)
        self.trust = nn.Parameter(torch.ones(3))
        """In what is read of rooms: where turns lead, ways to such a room, and being in it."""

    def forward(self, seen: Tensor, requests: Tensor) -> Readings:
        """Read places, by their features (N, 36, D), for requests (N, G, L) int64 words; 0 is padding."""
        look, words = self.look(seen), self.words(requests).sum(2)
        turns = _turns(look)
        scale, shift = self.request(words)[:, :, None].chunk(2, -1)  # (N, G, 1, h)
        meant = torch.relu(look[:, None] * (1 + scale) + shift)
        there = self.there(torch.cat([meant.amax(2), meant.mean(2)], -1))
        leads = self.leads(_turns(meant).flatten(0, 1)).unflatten(0, there.shape[:2])[:, :, 0]
        around = F.dropout(torch.relu(turns + self.beside(turns)), self.dropout, self.training).transpose(1, 2)
        asked, here = self.asked(words), self.here(torch.cat([look.amax(1), look.mean(1)], -1))
        ends, onward = self.ends(around), self.onward(around)
        with torch.no_grad():  # decisions teach no reading
            kind = asked.softmax(-1)
            into, inside = kind @ ends.softmax(-1).transpose(1, 2), kind @ here.softmax(-1)[..., None]
            towards = kind @ onward.log_softmax(1).transpose(1, 2)  # (N, G, 12)
        leads = leads + self.trust[0] * (into + DOUBT).log() + self.trust[1] * towards
        there = there + self.trust[2] * ((inside + DOUBT) / (1 - inside + DOUBT)).log()
        return Readings(torch.cat([leads, there], -1), self.ways(turns)[:, 0], asked, here, ends, onward)

    def read(self, seen: Tensor, requests: Tensor) -> Tensor:
        """(N, READ) probabilities of `forward` for one request each (N, L); it teaches nothing."""
        with torch.no_grad():
            read = self(seen, requests[:, None])
        leads, there = read.chosen[:, 0].split([TURNS, 1], -1)
        return torch.cat([leads.softmax(-1), read.ways.sigmoid(), there.sigmoid()], -1)


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
        kinds = np.array([ROOM_KINDS.index(place.house.room_by_id[r].kind) for r in place.graph.room_of_node])
        known = np.unique(kinds)
        far = np.stack([*left.T, *(distance[:, kinds == k].min(1) for k in known)], 1)  # (n, G + kinds)
        want, ways = np.zeros((*left.shape, TURNS + 1), np.float16), np.zeros((len(left), TURNS), bool)
        end, onward = np.full(ways.shape, NO_ROOM), np.zeros((len(left), ROOMS, TURNS), np.float16)
        for node in range(len(left)):
            ahead = [node_ahead(place.graph, Pose(node, turn)) for turn in range(TURNS)]
            ends = [node if end is None else end for end in ahead]
            ways[node] = [end is not None for end in ahead]
            costs = np.where(ways[node], distance[node, ends] + far[ends].T, np.inf)  # (G + kinds, 12)
            good = np.array([wanted(c) for c in costs])
            want[node, :, :-1], onward[node, known] = np.split(good * (far[node] > 0)[:, None], [left.shape[1]])
            end[node] = np.where(ways[node], kinds[ends], NO_ROOM)
        want[..., -1] = left <= np.array([t.radius for t in asked.values()])
        seen = split.bank.gather([Sight(name, v) for v in range(len(left))])
        words = np.stack([vocabulary.encode(r, REQUEST) for r in asked])
        named = [t.goal.room_kind if isinstance(t.goal, FindObject) else None for t in asked.values()]
        rooms = np.array([ROOM_KINDS.index(k) if k else NO_ROOM for k in named])
        lessons.append((seen, *map(torch.from_numpy, (words, want, ways, rooms, kinds, end, onward))))
    return lessons


def reading_loss(looker: Looker, lessons: Sequence[Lesson], rng: np.random.Generator) -> Tensor:
    """Cross-entropy of what is read of some places with what the teacher does there, and with the rooms around."""
    parts = []
    for k in rng.integers(len(lessons), size=HOUSES):
        seen, words, want, ways, rooms, here, ends, onward = lessons[k]
        places = torch.from_numpy(rng.integers(len(seen), size=PLACES))
        near = (want[places, :, -1] > 0) | (ends[places, :, None] == rooms).any(1)
        edges = (1 + MORE * near.double()).cumsum(1)  # (PLACES, G)
        drawn = torch.from_numpy(rng.random((PLACES, REQUESTS))) * edges[:, -1:]
        requests = torch.searchsorted(edges, drawn, right=True)
        asked = (words[requests], want[places[:, None], requests], rooms[requests])
        parts.append((*asked, *(x[places] for x in (seen, ways, here, ends, onward))))
    heard, want, rooms, seen, ways, here, ends, onward = (torch.cat(x) for x in zip(*parts, strict=True))
    read = looker(seen.float(), heard)
    leads, stop = want.float().split([TURNS, 1], -1)
    led = -((1 - stop) * leads * read.chosen[..., :-1].log_softmax(-1)).sum(-1).mean()
    surely = F.binary_cross_entropy_with_logits
    loss = led + 2 * surely(read.chosen[..., -1:], stop) + surely(read.ways, ways.float())
    kind = functools.partial(F.cross_entropy, ignore_index=NO_ROOM, reduction="none")
    leaves = 1 + 2 * (ends != here[:, None])[ways]  # who leaves a room learns more
    loss = loss + (leaves * kind(read.ends[ways], ends[ways])).mean() + kind(read.here, here).mean()
    right = -(onward.float() * read.onward.log_softmax(1).transpose(1, 2)).sum(-1)  # (N, ROOMS)
    loss = loss + kind(read.asked.flatten(0, 1), rooms.flatten()).mean()
    return loss + right.sum() / (right > 0).sum().clamp(min=1)


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
