"""Followers in houses: what they see, and the student and the executor that they make; and the data of NAV: paths of a
data set `vln` or `hanna` with their wordings (3.2.4.2, C.1.1; docs/sources.md, S142)."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from embodied.action_spaces import PanoramicMoves
from embodied.agents.common.tensors import IGNORE, Choice, greedy_choice, negative_log_likelihood, sampled_choice
from embodied.agents.common.vocabulary import Vocabulary
from embodied.agents.hanna.attention import orientation
from embodied.agents.iliad.nav.world import MOVES, NavWalk, Trip, share_left, walk_along, without_loops
from embodied.agents.iliad.protocol import ExecutionScores
from embodied.agents.learners.iliad import NavConfig
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vln.policy import COPIES, FollowerNetwork, FollowerOutputs, FollowerViews
from embodied.assets.cache import digest
from embodied.assets.records import ROOM_KINDS
from embodied.datasets.store import Dataset
from embodied.geometry import wrap
from embodied.interface import TURNS, VIEW_PITCHES, VIEW_YAWS, Place, Pose, Sight
from embodied.teachers.shortest import next_node

LONGEST_REQUEST = 80
"""Words of a request that are read."""


@dataclass(frozen=True, eq=False)
class Ways:
    """The actions that are possible in a pose: stopping is action 0."""

    poses: tuple[Pose, ...]
    """That the actions after stop lead to."""
    towards: Tensor
    """(n, E) what is seen that way and its direction, for going to a neighbour."""
    rooms: Tensor
    """(1 + n,) int64 kinds of the rooms that actions end in."""
    number_of: Mapping[int, int]
    """Node to the action that leads there; the pose's own node to stopping."""


class NavEyes:
    """Everything that is seen in some houses; what a pose offers is computed once."""

    def __init__(self, places: Mapping[str, Place], bank: FeatureBank, vocabulary: Vocabulary) -> None:
        self.places, self.bank, self.vocabulary = places, bank, vocabulary
        turned = np.arange(TURNS)[:, None] * (2 * np.pi / TURNS)
        yaws = torch.from_numpy(wrap(VIEW_YAWS - turned)).float()
        pitches = torch.from_numpy(VIEW_PITCHES).float().expand_as(yaws)
        self._directions = orientation(yaws, pitches, COPIES)  # (turns, 36, 4 COPIES)
        self._moves, self._ways = PanoramicMoves(), dict[tuple[str, int, int], Ways]()

    def blind(self) -> NavEyes:
        """In the same houses, seeing nothing."""
        return NavEyes(self.places, self.bank.blind(), self.vocabulary)

    @property
    def size(self) -> int:
        """E: features of a view, and its direction."""
        return self.bank.size + 4 * COPIES

    def words(self, requests: Sequence[str]) -> Tensor:
        """(B, longest) int64, padded."""
        return torch.from_numpy(self.vocabulary.batch(requests, LONGEST_REQUEST))

    def ways(self, world: str, pose: Pose) -> Ways:
        """The actions that are possible there."""
        key = world, pose.node, pose.turn
        if key not in self._ways:
            self._ways[key] = self._look(world, pose)
        return self._ways[key]

    def see(self, tracks: Sequence[Track], channels: Tensor | None = None) -> FollowerViews:
        """The views of agents where they are.

        Args:
          channels: (B, D) what each of them sees of every feature channel.
        """
        views = self.bank.gather([Sight(k.world, k.pose.node) for k in tracks])
        views = torch.cat([views, self._directions[[k.pose.turn for k in tracks]]], -1)
        towards = [k.ways.towards for k in tracks]
        actions = nn.utils.rnn.pad_sequence(towards, batch_first=True)
        counts = torch.tensor([1 + len(a) for a in towards])
        mask = torch.arange(1 + actions.shape[1]) < counts[:, None]
        if channels is not None:
            shown = F.pad(channels, (0, 4 * COPIES), value=1.0)[:, None]
            views, actions = views * shown, actions * shown
        return FollowerViews(views, actions, mask)

    def _look(self, world: str, pose: Pose) -> Ways:
        place = self.places[world]
        candidates, poses = self._moves.at(place, pose)
        (views,) = self.bank.gather([Sight(world, pose.node)])
        angles = orientation(torch.from_numpy(candidates.bearing), torch.from_numpy(candidates.slope), COPIES)
        kind = lambda node: place.house.room_by_id[str(place.graph.room_of_node[node])].kind
        rooms = torch.tensor([ROOM_KINDS.index(kind(n)) for n in (pose.node, *(p.node for p in poses))])
        numbers = {pose.node: 0} | {p.node: k for k, p in enumerate(poses, 1)}
        return Ways(poses, torch.cat([views[torch.from_numpy(candidates.view)], angles], -1), rooms, numbers)


class NavStudent:
    """A policy over neighbouring nodes."""

    def __init__(self, network: FollowerNetwork, eyes: NavEyes, config: NavConfig) -> None:
        self.network, self.eyes, self.config = network, eyes, config

    def sample(self, tasks: Sequence[Trip], requests: Sequence[str], *, rng: np.random.Generator) -> list[NavWalk]:
        return self._walk(tasks, requests, sampled_choice(rng.random((len(tasks), MOVES))))

    def greedy(self, tasks: Sequence[Trip], requests: Sequence[str]) -> list[NavWalk]:
        return self._walk(tasks, requests, greedy_choice)

    def rollout_for_dagger(
        self, tasks: Sequence[Trip], requests: Sequence[str], *, rng: np.random.Generator
    ) -> list[NavWalk]:
        """Sampled, but `guided` of the steps lead along shortest paths."""
        choose = sampled_choice(rng.random((len(tasks), MOVES)))
        return self._walk(tasks, requests, choose, rng.random((len(tasks), MOVES)) < self.config.guided)

    def scores(
        self,
        tasks: Sequence[Trip],
        requests: Sequence[str],
        executions: Sequence[NavWalk],
        actions: Sequence[NavWalk] | None = None,
    ) -> ExecutionScores:
        """Of the steps of walks, or of the steps that `actions` take in the walks' states; with dropout where a
        gradient is wanted."""
        wanted = executions if actions is None else actions
        ends = [e.nodes[-1] if actions is None else q.path[-1] for q, e in zip(tasks, executions, strict=True)]
        tracks, learning = [Track(self.eyes, task) for task in tasks], torch.is_grad_enabled()
        self.network.train(learning)
        channels = F.dropout(torch.ones(len(tasks), self.eyes.bank.size), self.config.environment_dropout, learning)
        heard, rows = self.network.begin(self.eyes.words(requests)), list(range(len(tasks)))
        scores_of_steps: list[tuple[Tensor, Tensor, Tensor]] = []  # of the steps of all who still act
        where: list[tuple[int, int]] = []  # row and step of each
        for t in range(max(len(w.steps) for w in wanted)):
            going = [k for k, i in enumerate(rows) if t < len(wanted[i].steps)]
            if len(going) < len(rows):
                heard, rows = heard.select(torch.tensor(going)), [rows[k] for k in going]
            now = [tracks[i] for i in rows]
            seen = self.eyes.see(now, channels[rows] if learning else None)
            outputs, heard = self.network(heard, seen)
            log = outputs.moves.log_softmax(-1).masked_fill(~seen.mask, 0.0)
            right = torch.tensor([k.number(wanted[i].steps[t]) for k, i in zip(now, rows)])
            entropy = -(log.exp() * log * seen.mask).sum(-1)
            auxiliary_loss = self._auxiliary_loss(outputs, now, [ends[i] for i in rows])
            scores_of_steps.append((log.gather(1, right[:, None])[:, 0], entropy, auxiliary_loss))
            where += [(i, t) for i in rows]
            taken = [k.number(executions[i].steps[t]) for k, i in zip(now, rows)]
            heard = dataclasses.replace(heard, taken=outputs.tokens[torch.arange(len(rows)), torch.tensor(taken)])
            for track, number in zip(now, taken):
                track.go(number)
        at, steps = tuple(torch.tensor(where).T), max(t for _, t in where) + 1
        spread = lambda parts: torch.zeros(len(tasks), steps).index_put(at, torch.cat(parts))
        log_probabilities, entropies, auxiliary_loss = map(spread, zip(*scores_of_steps))
        mask = torch.zeros(len(tasks), steps, dtype=torch.bool).index_put(at, torch.tensor(True))
        return ExecutionScores(log_probabilities, entropies, mask, auxiliary_loss)

    def _auxiliary_loss(self, outputs: FollowerOutputs, tracks: Sequence[Track], ends: Sequence[int]) -> Tensor:
        """(k,) losses of the guesses which share of the way to `ends` is left, and what kinds of rooms are near."""
        c = self.config
        left = [share_left(self.eyes.places[k.world].graph, k.nodes, end) for k, end in zip(tracks, ends)]
        lost = c.progress_weight * (outputs.left - torch.tensor(left)) ** 2
        if c.room_weight:
            rooms = nn.utils.rnn.pad_sequence([k.ways.rooms for k in tracks], batch_first=True, padding_value=IGNORE)
            each = negative_log_likelihood(outputs.rooms.flatten(0, 1), rooms.flatten()).view(rooms.shape)
            lost = lost + c.room_weight * each.sum(1) / (rooms != IGNORE).sum(1)
        return lost

    @torch.no_grad()
    def _walk(
        self, tasks: Sequence[Trip], requests: Sequence[str], choose: Choice, guided: np.ndarray | None = None
    ) -> list[NavWalk]:
        """
        Args:
          guided: (B, MOVES) bool, the steps that lead along the shortest path.
        """
        tracks, rows = [Track(self.eyes, task) for task in tasks], list(range(len(tasks)))
        self.network.eval()
        heard = self.network.begin(self.eyes.words(requests))
        for t in range(MOVES):
            now = [tracks[i] for i in rows]
            outputs, heard = self.network(heard, self.eyes.see(now))
            numbers = choose(outputs.moves, torch.tensor(rows), t).tolist()
            if guided is not None:
                numbers = [self._shown(tasks[i], k) if guided[i, t] else n for n, k, i in zip(numbers, now, rows)]
            heard = dataclasses.replace(heard, taken=outputs.tokens[torch.arange(len(rows)), torch.tensor(numbers)])
            for track, number in zip(now, numbers):
                track.go(number)
            going = [k for k, n in enumerate(numbers) if n != 0]
            if not going:
                break
            heard, rows = heard.select(torch.tensor(going)), [rows[k] for k in going]
        return [walk_along(track.nodes) for track in tracks]

    def _shown(self, trip: Trip, track: Track) -> int:
        graph = self.eyes.places[trip.world].graph
        return track.number(next_node(graph, track.pose.node, trip.path[-1:]))


class LoopFree(NavStudent):
    """A student whose walks are described and learned without their loops: ADEL's explorer, as in the program."""

    def sample(self, tasks: Sequence[Trip], requests: Sequence[str], *, rng: np.random.Generator) -> list[NavWalk]:
        return [walk_along(without_loops(w.nodes)) for w in super().sample(tasks, requests, rng=rng)]


class Track:
    """Owns where one agent is on its way."""

    def __init__(self, eyes: NavEyes, trip: Trip) -> None:
        self._eyes, self.world = eyes, trip.world
        self.pose, self.nodes = trip.start, [trip.start.node]

    @property
    def ways(self) -> Ways:
        return self._eyes.ways(self.world, self.pose)

    def number(self, node: int) -> int:
        """The action that leads to `node`, 0 for staying.

        Raises:
          KeyError: `node` is no neighbour.
        """
        return self.ways.number_of[node]

    def go(self, number: int) -> None:
        """Take an action."""
        if number:
            self.pose = self.ways.poses[number - 1]
            self.nodes.append(self.pose.node)


NAV_SPLITS = {"train": "train", "validation": "val_unseen", "test": "test_unseen"}
"""NAV's splits and the data set's: other houses in each."""


@dataclass(frozen=True, eq=False)
class NavData:
    """All that worlds and teachers are made of."""

    source: Dataset
    eyes: NavEyes
    splits: Mapping[str, Sequence[Trip]]
    """'train': paths with all of their wordings. 'validation' and 'test': paths of other houses; each wording is a trip
    of its own."""
    pictures: str
    """How what is seen was drawn: 'fast_256', 'unlit_192', or several of them."""

    @property
    def digest(self) -> str:
        """Names the content: the data set, its paths, and who looks at which pictures."""
        trips = {part: [(t.world, t.path, t.requests) for t in many] for part, many in self.splits.items()}
        return digest([self.source.digest, trips, self.eyes.bank.digest, self.pictures])
