"""NAV as a problem of ILIAD: trips through houses, walks, and shortest paths without requests (3.2.4.2, C.1.1)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from embodied.interface import Place, Pose, Route
from embodied.navigation.graph import NavGraph, count_hops
from embodied.teachers.shortest import next_node

RADIUS = 3.0
"""Metres from the intended end, inclusive."""
HORIZON = 10
"""H, actions of an episode (Table C.2)."""
MOVES = HORIZON - 1
"""Most moves that count: the place that the last action would lead to is never seen (docs/sources.md, S103)."""
FEWEST, MOST = 2, 6
"""Edges of the marginal's paths (C.1.1)."""


@dataclass(frozen=True)
class Trip:
    """A task: D*, and the path e* that its requests tell of."""

    world: str
    start: Pose
    path: tuple[int, ...]
    requests: tuple[str, ...]


@dataclass(frozen=True)
class NavWalk:
    """An execution: where somebody was, and where to go from there."""

    nodes: tuple[int, ...]
    """The places of s_1, s_2, .., at most HORIZON of them."""
    steps: tuple[int, ...]
    """The next node in each state that an action was taken in; the node itself to stop there."""


def walk_along(nodes: Sequence[int]) -> NavWalk:
    """The walk that passes these nodes and stops at the last; longer ones are cut."""
    kept = tuple(nodes[:HORIZON])
    return NavWalk(kept, (*kept[1:], kept[-1])[:MOVES])


def without_loops(nodes: Sequence[int]) -> tuple[int, ...]:
    """Nodes of a walk without what lies between two visits to the same one, as in the authors' program."""
    path: list[int] = []
    for node in nodes:
        if node in path:
            del path[path.index(node) + 1 :]
        else:
            path.append(node)
    return tuple(path)


def share_left(graph: NavGraph, nodes: Sequence[int], end: int) -> float:
    """Which share of the way from the first of `nodes` to `end` is left at the last of them, at most 1."""
    whole, rest = float(graph.distance[nodes[0], end]), float(graph.distance[nodes[-1], end])
    return min(1.0, rest / max(whole, 1e-6))


def trips_of(world: str, routes: Iterable[Route]) -> list[Trip]:
    """Routes of a house, those of one path together: their instructions are its D*."""
    wordings: dict[tuple[Pose, tuple[int, ...]], list[str]] = {}
    for r in routes:
        wordings.setdefault((Pose(r.path[0], r.turn, r.tilt), r.path), []).append(r.instruction)
    return [Trip(world, start, path, tuple(requests)) for (start, path), requests in wordings.items()]


class NavWorld:
    """Houses in which requests are fulfilled."""

    def __init__(self, places: Mapping[str, Place]) -> None:
        self.places = places

    def success(self, task: Trip, execution: NavWalk) -> bool:
        """True where the walk ended within RADIUS of the path's end."""
        return bool(self.graph(task).distance[execution.nodes[-1], task.path[-1]] <= RADIUS + 1e-9)

    def reward(self, task: Trip, execution: NavWalk) -> float:
        """Eq C.2: the share of the way to the goal that was covered; a trip that begins there gives 1 for staying."""
        distance = self.graph(task).distance
        whole, left = distance[task.start.node, task.path[-1]], distance[execution.nodes[-1], task.path[-1]]
        return float((whole - left) / whole) if whole > 0 else float(left == 0)

    def demonstrate(self, task: Trip, execution: NavWalk) -> NavWalk:
        """The next node of the shortest path to the goal, in every state of a walk."""
        graph = self.graph(task)
        return NavWalk(execution.nodes, tuple(next_node(graph, n, task.path[-1:]) for n in execution.nodes[:MOVES]))

    def graph(self, task: Trip) -> NavGraph:
        return self.places[task.world].graph


class NavMarginal:
    """Shortest paths of 2 to 6 edges from where a trip begins, uniform over their ends (C.1.1; docs/sources.md,
    S105)."""

    def __init__(self, places: Mapping[str, Place]) -> None:
        self.places = places
        self._ends: dict[tuple[str, int], np.ndarray] = {}

    def draw(self, tasks: Sequence[Trip], *, rng: np.random.Generator) -> list[NavWalk]:
        walks = []
        for trip in tasks:
            ends = self._reachable(trip)
            end = int(ends[int(rng.integers(len(ends)))])
            walks.append(walk_along(self.places[trip.world].graph.path(trip.start.node, end)))
        return walks

    def _reachable(self, trip: Trip) -> np.ndarray:
        """Ends of paths of the wanted length; of all nodes where a house is too small for them."""
        key = trip.world, trip.start.node
        if key not in self._ends:
            hops = count_hops(self.places[trip.world].graph.next_hop)[trip.start.node]
            near = np.flatnonzero((hops >= FEWEST) & (hops <= MOST))
            self._ends[key] = near if len(near) else np.arange(len(hops))
        return self._ends[key]
