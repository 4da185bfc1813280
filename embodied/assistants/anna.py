"""ANNA: people scattered in the house who know some routes (dissertation 4.2.2, eqs 4.4-4.7)."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from embodied.assets.catalogue import load_catalogue
from embodied.house.shapes import room_at
from embodied.interface import Intention, Place, Pose, Reply, Route, Situation, Subtask, Viewpoint
from embodied.people.day import Day, day_of, lived_in
from embodied.people.strolls import in_sight
from embodied.seeds import stream

if TYPE_CHECKING:
    from embodied.navigation.graph import NavGraph

ATTENTION = 2.0
"""epsilon_attn, metres (Table D.1)."""
TIE = 1e-6
HOURS, DAY = (7.0, 22.0), 24 * 60
"""Of the day, between which tasks begin where people live; minutes of a day."""


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
        return (Intention.HELP,) if len(self.known(situation)) else ()

    def known(self, situation: Situation) -> np.ndarray:
        """Numbers of the routes that somebody at hand can tell."""
        home = self._homes.get(situation.task.world)
        return home.enterable[situation.pose.node] if home else np.zeros(0, np.int64)

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        """The route xi* (4.4), the departure node (4.6) and the goal node g* (4.7).

        Routes that are equally good (the wordings of one path, above all) are drawn from. The
        authors' program draws in training only and takes the first in evaluation (docs/sources.md, S11).

        Raises:
          AssistantError: asked outside every zone.
        """
        name, node, goals = situation.task.world, situation.pose.node, situation.task.goal_nodes
        known = tuple(self.known(situation).tolist())
        if not known:
            raise AssistantError(f"nobody pays attention at node {node} of {name!r}; ask where can_ask is not empty")
        home = self._homes[name]
        best = home.best(known, goals)
        route = best[int(rng.integers(len(best)))] if len(best) > 1 else best[0]
        depart, goal = home.departure(route.path, goals)
        start, path = Pose(route.path[0], route.turn, route.tilt), route.path[: route.path.index(depart) + 1]
        subtask = Subtask(route.id, depart, start=start, goal=goal, path=path)
        return Reply(text=route.instruction, image=Viewpoint(name, depart), subtask=subtask)


class Residents(Anna):
    """ANNA's people where their day has them: routes are told in the rooms that somebody who is awake is in.

    A task begins at an hour between HOURS, drawn for it; a step takes a minute of the day.
    """

    def __init__(self, places: Mapping[str, Place], routes: Mapping[str, Sequence[Route]], **split: str) -> None:
        """As `Anna`, with the houses."""
        super().__init__({name: p.graph for name, p in places.items()}, routes, **split)
        self._places, self._catalogue = places, functools.cache(load_catalogue)
        self._day = functools.cache(self._lived)
        self._manned = functools.lru_cache(4096)(self._rooms)

    def known(self, situation: Situation) -> np.ndarray:
        near = super().known(situation)
        if not len(near):
            return near
        name, rooms = situation.task.world, self._homes[situation.task.world].rooms[near]
        return near[np.isin(rooms, self._manned(name, minute_of(situation.task.id) + situation.time))]

    def seen_from(self, name: str, node: int, minute: int) -> tuple[float, int] | None:
        """The second of the day that is seen from a node, and the node; None where nobody is in sight."""
        day, place = self._day(name), self._places[name]
        moment, eye = day.at(second := day.since(minute % DAY * 60)), place.graph.positions[node]
        return (second, node) if moment.openness or in_sight(moment, eye, day.house) else None

    def _lived(self, name: str) -> Day:
        return day_of(lived_in(self._places[name].house), self._catalogue(), seed=0)

    def _rooms(self, name: str, minute: int) -> list[str]:
        day, time = self._day(name), minute % DAY * 60
        awake = {n for n, p in day.now(time).items() if p.leg or p.spot.activity != "sleeping"}
        at = (p.place.position for n, p in day.at(time).people.items() if n in awake)
        return [room_at(day.house, np.add(place, (0, 0, 0.5))) or "" for place in at]


def minute_of(task: str) -> int:
    """The minute of the day at which a task begins, by its id."""
    return int(stream(0, "hour", task).uniform(*HOURS) * 60)


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
        self.rooms = np.array([graph.room_of_node[r.path[0]] for r in routes])
        self._best: dict[tuple[tuple[int, ...], tuple[int, ...]], tuple[Route, ...]] = {}

    def best(self, known: tuple[int, ...], goals: tuple[int, ...]) -> tuple[Route, ...]:
        """The known routes that come nearest to a goal (4.4, 4.5), in the wordings of the split."""
        key = (known, goals)
        if key not in self._best:
            here = np.array(known)
            nearest = self.closest[np.ix_(here, np.array(goals))].min(axis=1)  # Eq 4.5
            winners = here[nearest <= nearest.min() + TIE]  # Eq 4.4
            self._best[key] = tuple(self.routes[i] for i in winners if self.routes[i].split == self.split)
        return self._best[key]

    def departure(self, path: tuple[int, ...], goals: tuple[int, ...]) -> tuple[int, int]:
        """v_depart (4.6), the first along the path of equals, and the goal g* nearest to it (4.7)."""
        table = np.asarray(self.graph.distance)[np.ix_(np.array(path), np.array(goals))]
        depart = int(np.argmin(np.round(table.min(axis=1), 9)))
        return path[depart], goals[int(np.argmin(table[depart]))]
