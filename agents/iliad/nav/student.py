"""Followers in houses: what they see, and the student and the executor that they make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from agents.hanna.percept import orientation
from agents.hanna.vocabulary import Vocabulary
from agents.iliad.nav.network import Follower, StepSeen
from agents.iliad.nav.world import MOVES, NavWalk, Trip, walk_along, without_loops
from agents.iliad.protocol import ExecutionScores
from agents.imitation.decoding import Choice, drawn_with, likeliest
from agents.vision.bank import FeatureBank
from embodied.action_spaces import PanoramicMoves
from embodied.interface import Place, Pose, Sight

COPIES = 32
"""Of the four orientation features in an action's embedding (Speaker-Follower's and the authors' number)."""
LONGEST_REQUEST = 80
"""Words of a request that are read."""


@dataclass(frozen=True, eq=False)
class NavEyes:
    """Everything that is seen in some houses."""

    places: Mapping[str, Place]
    bank: FeatureBank
    vocabulary: Vocabulary

    def __post_init__(self) -> None:
        object.__setattr__(self, "_moves", PanoramicMoves())

    @property
    def action_size(self) -> int:
        """E."""
        return self.bank.size + 4 * COPIES

    def words(self, requests: Sequence[str]) -> Tensor:
        """(B, longest) int64, padded."""
        rows = torch.from_numpy(np.stack([self.vocabulary.encode(r, LONGEST_REQUEST) for r in requests]))
        return rows[:, : max(1, int((rows != 0).sum(1).max()))]

    def ahead(self, world: str, pose: Pose) -> tuple[Pose, ...]:
        """The poses that the actions after stop lead to."""
        return self._reach(world, pose)[1]

    def see(self, trips: Sequence[Trip], poses: Sequence[Pose], previous: Tensor) -> StepSeen:
        """What agents see at these poses; `previous` (B, E) embeds how each came there."""
        views = self.bank.gather([Sight(t.world, p.node) for t, p in zip(trips, poses, strict=True)])
        embedded = [self._actions(t.world, p, v) for t, p, v in zip(trips, poses, views, strict=True)]
        actions = nn.utils.rnn.pad_sequence(embedded, batch_first=True)
        counts = torch.tensor([len(a) for a in embedded])
        return StepSeen(views, actions, torch.arange(actions.shape[1]) < counts[:, None], previous)

    def _reach(self, world: str, pose: Pose) -> tuple:
        moves: PanoramicMoves = self._moves  # type: ignore[attr-defined]
        return moves.at(self.places[world], pose)

    def _actions(self, world: str, pose: Pose, views: Tensor) -> Tensor:
        """(1 + n, E) embeddings of stopping, which is zero, and of going to each neighbour."""
        candidates, _ = self._reach(world, pose)
        angles = orientation(torch.from_numpy(candidates.bearing), torch.from_numpy(candidates.slope), COPIES)
        rows = torch.cat([views[torch.from_numpy(candidates.view)], angles], -1)
        return torch.cat([rows.new_zeros(1, rows.shape[1]), rows])


class NavStudent:
    """A policy over neighbouring nodes."""

    def __init__(self, follower: Follower, eyes: NavEyes) -> None:
        self.follower, self.eyes = follower, eyes

    def network(self) -> nn.Module:
        return self.follower

    def sample(self, tasks: Sequence[Trip], requests: Sequence[str], *, rng: np.random.Generator) -> list[NavWalk]:
        return self._walk(tasks, requests, drawn_with(rng.random((len(tasks), MOVES))))

    def greedy(self, tasks: Sequence[Trip], requests: Sequence[str]) -> list[NavWalk]:
        return self._walk(tasks, requests, likeliest)

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
        now = self.follower.begin(self.eyes.words(requests))
        logs, entropies, mask = [], [], []
        for t in range(max(map(len, wanted))):
            seen = self.eyes.see(tasks, [k.pose for k in tracks], torch.stack([k.previous for k in tracks]))
            logits, now = self.follower.step(now, seen)
            log = logits.log_softmax(-1).masked_fill(~seen.mask, 0.0)
            there = [t < len(w) for w in wanted]
            chosen = [k.number(w[t]) if x else 0 for k, w, x in zip(tracks, wanted, there)]
            logs.append(log.gather(1, torch.tensor(chosen)[:, None])[:, 0])
            entropies.append(-(log.exp() * log * seen.mask).sum(-1))
            mask.append(torch.tensor(there))
            for row, (track, walk) in enumerate(zip(tracks, executions)):
                if t + 1 < len(walk.nodes):
                    track.go(track.number(walk.nodes[t + 1]), seen.actions[row])
        flags = torch.stack(mask, 1)
        return ExecutionScores(torch.stack(logs, 1) * flags, torch.stack(entropies, 1) * flags, flags)

    @torch.no_grad()
    def _walk(self, tasks: Sequence[Trip], requests: Sequence[str], choose: Choice) -> list[NavWalk]:
        tracks = [Track(self.eyes, task) for task in tasks]
        now = self.follower.begin(self.eyes.words(requests))
        rows = torch.arange(len(tasks))
        for t in range(MOVES):
            seen = self.eyes.see(tasks, [k.pose for k in tracks], torch.stack([k.previous for k in tracks]))
            logits, now = self.follower.step(now, seen)
            for row, (track, number) in enumerate(zip(tracks, choose(logits, rows, t).tolist())):
                if not track.stopped:
                    track.go(number, seen.actions[row])
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
        self._eyes, self._world = eyes, trip.world
        self.pose, self.nodes, self.stopped = trip.start, [trip.start.node], False
        self.previous = torch.zeros(eyes.action_size)

    def number(self, node: int) -> int:
        """The action that leads to `node`, 0 for staying.

        Raises:
          ValueError: `node` is no neighbour.
        """
        if node == self.pose.node:
            return 0
        return 1 + [p.node for p in self._eyes.ahead(self._world, self.pose)].index(node)

    def go(self, number: int, actions: Tensor) -> None:
        """Take an action of `actions` (A, E)."""
        if number == 0:
            self.stopped = True
        else:
            self.pose = self._eyes.ahead(self._world, self.pose)[number - 1]
            self.nodes.append(self.pose.node)
        self.previous = actions[number]
