"""ANNA: people scattered in the house who know some routes (dissertation 4.2.2, eqs 4.4-4.7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from embodied.interface import Intention, Pose, Reply, Route, Situation, Subtask, Viewpoint

if TYPE_CHECKING:
    from embodied.navigation.graph import NavGraph

ATTENTION = 2.0
"""epsilon_attn, metres (Table D.1)."""
TIE = 1e-6


class AssistantError(ValueError):
    """A question that nobody is there to answer, or a route system that cannot answer."""


class Anna:
    """Answers wherever a route can be entered, with its text and the image of where to leave it.

    The dissertation says that a sub-task is guaranteed to bring the agent closer to a goal; its
    equations do not say so, nor does the authors' program: the best route of the zone may lead
    away. We follow the equations (docs/sources.md, S10). Where zones overlap, the best route of all counts (S9).
    """

    def __init__(
        self, graphs: Mapping[str, NavGraph], routes: Mapping[str, Sequence[Route]], *, split: str = "train_seen"
    ) -> None:
        """
        Args:
          graphs, routes: by world name.
          split: whose wordings are spoken ('train_seen', 'train_unseen', 'val', 'test'). The path is
            chosen among all routes and worded afterwards (docs/sources.md, S12), so every path needs a
            wording in the split.

        Raises:
          AssistantError: a world has routes but none, or not all paths, in the split.
        """
        self.split = split
        self._homes = {name: _Home(graphs[name], routes[name], split, name) for name in sorted(routes)}

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        """Help, inside a zone of attention; it depends on the place only, never on the goal."""
        home = self._homes.get(situation.task.world)
        return (Intention.HELP,) if home and len(home.enterable[situation.pose.node]) else ()

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        """The route xi* (4.4), the departure node (4.6) and the goal node g* (4.7).

        Routes that are equally good (the wordings of one path, above all) are drawn from. The
        authors' program draws in training only and takes the first in evaluation (docs/sources.md, S11).

        Raises:
          AssistantError: asked outside every zone.
        """
        name, node, goals = situation.task.world, situation.pose.node, situation.task.goal_nodes
        home = self._homes.get(name)
        if home is None or not len(home.enterable[node]):
            raise AssistantError(f"nobody pays attention at node {node} of {name!r}; ask where can_ask is not empty")
        best = home.best(node, goals)
        route = best[int(rng.integers(len(best)))] if len(best) > 1 else best[0]
        depart, goal = home.departure(route.path, goals)
        start, path = Pose(route.path[0], route.turn, route.tilt), route.path[: route.path.index(depart) + 1]
        subtask = Subtask(route.id, depart, start=start, goal=goal, path=path)
        return Reply(text=route.instruction, image=Viewpoint(name, depart), subtask=subtask)


class _Home:
    """The routes of one world with what can be computed before anybody asks."""

    def __init__(self, graph: NavGraph, routes: Sequence[Route], split: str, name: str) -> None:
        self.graph, self.routes, self.split = graph, tuple(routes), split
        distance = np.asarray(graph.distance)
        spoken = {r.path for r in routes if r.split == split}
        mute = [r.id for r in routes if r.path not in spoken]
        if mute:
            raise AssistantError(
                f"{len(mute)} routes of {name!r}, e.g. {mute[0]!r}, have no wording in the split {split!r}; "
                "build the routes for this split"
            )
        # (routes, n): distance from the nearest node of a route to every node, for Eq 4.5
        self.closest = np.stack([distance[list(r.path)].min(axis=0) for r in routes]) if routes else np.zeros((0, 0))
        starting: dict[int, list[int]] = {}
        for i, r in enumerate(routes):
            starting.setdefault(r.path[0], []).append(i)
        self.enterable: list[np.ndarray] = []
        for v in range(len(distance)):
            near = [u for u in sorted(int(u) for u in graph.neighbours(v)) if distance[v, u] <= ATTENTION + 1e-9]
            self.enterable.append(np.array([i for u in (v, *near) for i in starting.get(u, [])], dtype=np.int64))
        self._best: dict[tuple[int, tuple[int, ...]], tuple[Route, ...]] = {}

    def best(self, node: int, goals: tuple[int, ...]) -> tuple[Route, ...]:
        """Routes of the zone that come nearest to a goal (4.4, 4.5), in the wordings of the split."""
        key = (node, goals)
        if key not in self._best:
            here = self.enterable[node]
            nearest = self.closest[np.ix_(here, np.array(goals))].min(axis=1)  # Eq 4.5
            winners = here[nearest <= nearest.min() + TIE]  # Eq 4.4
            self._best[key] = tuple(self.routes[i] for i in winners if self.routes[i].split == self.split)
        return self._best[key]

    def departure(self, path: tuple[int, ...], goals: tuple[int, ...]) -> tuple[int, int]:
        """v_depart (4.6), the first along the path of equals, and the goal g* nearest to it (4.7)."""
        table = np.asarray(self.graph.distance)[np.ix_(np.array(path), np.array(goals))]
        depart = int(np.argmin(np.round(table.min(axis=1), 9)))
        return path[depart], goals[int(np.argmin(table[depart]))]
