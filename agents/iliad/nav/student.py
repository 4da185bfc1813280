"""Followers in houses: what they see, and the student and the executor that they make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from agents.common.decoding import Choice, greedy_choice, sampled_choice
from agents.common.vocabulary import Vocabulary
from agents.hanna.percept import orientation
from agents.iliad.nav.network import Follower, StepSeen
from agents.iliad.nav.world import MOVES, NavWalk, Trip, walk_along, without_loops
from agents.iliad.protocol import ExecutionScores
from agents.vision.bank import FeatureBank
from embodied.action_spaces import PanoramicMoves
from embodied.interface import Place, Pose, Sight

COPIES = 32
"""Of the four orientation features in an action's embedding (Speaker-Follower's and the authors' number)."""
LONGEST_REQUEST = 80
"""Words of a request that are read."""


@dataclass(frozen=True, eq=False)
class Ways:
    """What can be done in a pose: stopping is action 0."""

    poses: tuple[Pose, ...]
    """That the actions after stop lead to."""
    embedded: Tensor
    """(1 + n, E): zero for stopping, what is seen that way and its direction for going to a neighbour."""
    number_of: Mapping[int, int]
    """Node to the action that leads there; the pose's own node to stopping."""


@dataclass(frozen=True, eq=False)
class NavEyes:
    """Everything that is seen in some houses; what a pose offers is computed once."""

    places: Mapping[str, Place]
    bank: FeatureBank
    vocabulary: Vocabulary

    def __post_init__(self) -> None:
        object.__setattr__(self, "_moves", PanoramicMoves())
        object.__setattr__(self, "_ways", {})
        object.__setattr__(self, "_words", {})

    @property
    def action_size(self) -> int:
        """E."""
        return self.bank.size + 4 * COPIES

    def words(self, requests: Sequence[str]) -> Tensor:
        """(B, longest) int64, padded."""
        known: dict[str, Tensor] = self._words  # type: ignore[attr-defined]
        if len(known) > 100_000:
            known.clear()
        for request in requests:
            if request not in known:
                row = torch.from_numpy(self.vocabulary.encode(request, LONGEST_REQUEST))
                known[request] = row[: max(1, int((row != 0).sum()))]
        return nn.utils.rnn.pad_sequence([known[r] for r in requests], batch_first=True)

    def ways(self, world: str, pose: Pose) -> Ways:
        """What can be done there."""
        known: dict[tuple[str, int, int], Ways] = self._ways  # type: ignore[attr-defined]
        key = world, pose.node, pose.turn
        if key not in known:
            known[key] = self._look(world, pose)
        return known[key]

    def see(self, tracks: Sequence[Track]) -> StepSeen:
        """What agents see where they are."""
        views = self.bank.gather([Sight(k.world, k.pose.node) for k in tracks])
        embedded = [k.ways.embedded for k in tracks]
        actions = nn.utils.rnn.pad_sequence(embedded, batch_first=True)
        counts = torch.tensor([len(a) for a in embedded])
        mask = torch.arange(actions.shape[1]) < counts[:, None]
        return StepSeen(views, actions, mask, torch.stack([k.previous for k in tracks]))

    def _look(self, world: str, pose: Pose) -> Ways:
        moves: PanoramicMoves = self._moves  # type: ignore[attr-defined]
        candidates, poses = moves.at(self.places[world], pose)
        (views,) = self.bank.gather([Sight(world, pose.node)])
        angles = orientation(torch.from_numpy(candidates.bearing), torch.from_numpy(candidates.slope), COPIES)
        rows = torch.cat([views[torch.from_numpy(candidates.view)], angles], -1)
        numbers = {pose.node: 0} | {p.node: k for k, p in enumerate(poses, 1)}
        return Ways(poses, torch.cat([rows.new_zeros(1, rows.shape[1]), rows]), numbers)


class NavStudent:
    """A policy over neighbouring nodes."""

    def __init__(self, follower: Follower, eyes: NavEyes) -> None:
        self.network, self.eyes = follower, eyes

    def sample(self, tasks: Sequence[Trip], requests: Sequence[str], *, rng: np.random.Generator) -> list[NavWalk]:
        return self._walk(tasks, requests, sampled_choice(rng.random((len(tasks), MOVES))))

    def greedy(self, tasks: Sequence[Trip], requests: Sequence[str]) -> list[NavWalk]:
        return self._walk(tasks, requests, greedy_choice)

    def scores(
        self,
        tasks: Sequence[Trip],
        requests: Sequence[str],
        executions: Sequence[NavWalk],
        actions: Sequence[NavWalk] | None = None,
    ) -> ExecutionScores:
        """Of the steps of walks, or of the steps that `actions` take in the walks' states."""
        wanted = [w.steps for w in (executions if actions is None else actions)]
        tracks = [Track(self.eyes, task) for task in tasks]
        now = self.network.begin(self.eyes.words(requests))
        logs, entropies, mask = [], [], []
        for t in range(max(map(len, wanted))):
            seen = self.eyes.see(tracks)
            logits, now = self.network.step(now, seen)
            log = logits.log_softmax(-1).masked_fill(~seen.mask, 0.0)
            there = [t < len(w) for w in wanted]
            chosen = [k.number(w[t]) if x else 0 for k, w, x in zip(tracks, wanted, there)]
            logs.append(log.gather(1, torch.tensor(chosen)[:, None])[:, 0])
            entropies.append(-(log.exp() * log * seen.mask).sum(-1))
            mask.append(torch.tensor(there))
            for track, walk in zip(tracks, executions):
                if t + 1 < len(walk.nodes):
                    track.go(track.number(walk.nodes[t + 1]))
        flags = torch.stack(mask, 1)
        return ExecutionScores(torch.stack(logs, 1) * flags, torch.stack(entropies, 1) * flags, flags)

    @torch.no_grad()
    def _walk(self, tasks: Sequence[Trip], requests: Sequence[str], choose: Choice) -> list[NavWalk]:
        tracks = [Track(self.eyes, task) for task in tasks]
        now = self.network.begin(self.eyes.words(requests))
        rows = torch.arange(len(tasks))
        for t in range(MOVES):
            seen = self.eyes.see(tracks)
            logits, now = self.network.step(now, seen)
            for track, number in zip(tracks, choose(logits, rows, t).tolist()):
                if not track.stopped:
                    track.go(number)
            if all(track.stopped for track in tracks):
                break
        return [walk_along(track.nodes) for track in tracks]


class LoopFree(NavStudent):
    """A student whose walks are described and learned without their loops: ADEL's explorer, as in the program."""

    def sample(self, tasks: Sequence[Trip], requests: Sequence[str], *, rng: np.random.Generator) -> list[NavWalk]:
        return [walk_along(without_loops(w.nodes)) for w in super().sample(tasks, requests, rng=rng)]


class Track:
    """Owns where one agent is on its way."""

    def __init__(self, eyes: NavEyes, trip: Trip) -> None:
        self._eyes, self.world = eyes, trip.world
        self.pose, self.nodes, self.stopped = trip.start, [trip.start.node], False
        self.previous = torch.zeros(eyes.action_size)

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
        ways = self.ways
        self.previous = ways.embedded[number]
        if number == 0:
            self.stopped = True
        else:
            self.pose = ways.poses[number - 1]
            self.nodes.append(self.pose.node)
