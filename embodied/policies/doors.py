"""Agents for houses with closed doors that do not learn (docs/doors.md)."""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from embodied.geometry import wrap
from embodied.interface import (
    STEP,
    Action,
    Actions,
    FindObject,
    Move,
    Observation,
    Observations,
    Open,
    Rngs,
    SeenPlace,
    Situation,
    Stop,
    viewpoint,
)
from embodied.navigation.doors import place_named
from embodied.navigation.graph import OPENING, NavGraph, behind_doors, nearest
from embodied.policies.baselines import PerEpisodePolicy

WITHIN = 2.0
"""Metres within which the wanderer takes a thing that it sees for found."""
GIVES_UP = 0.05
"""Probability with which the blind wanderer stops at a step."""


class NeverOpens(PerEpisodePolicy):
    """The shortest way on which nothing is opened; stops at once where there is none."""

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        open_ways = behind_doors(s.world.graph, s.closed, np.inf)
        goal = nearest(open_ways, s.pose.node, s.targets)
        if goal == s.pose.node or not np.isfinite(open_ways.distance[s.pose.node, goal]):
            return Stop()
        return Move(s.candidate_nodes.index(int(open_ways.next_hop[s.pose.node, goal])))


class RandomOpener:
    """Uniform over moves, closed doors and stop."""

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, Any]:
        return [None if o is None else self._one(o, rng) for o, rng in zip(observations, rngs, strict=True)], ()

    def _one(self, o: Observation, rng: np.random.Generator) -> Action:
        moves: list[Action] = [Move(int(k)) for k in np.flatnonzero(o.candidates.allowed)]
        possible = [*moves, *(Open(k) for k in o.can_open), Stop()]
        return possible[int(rng.integers(len(possible)))]


@dataclass
class Tour:
    """Owns what a wanderer knows of the house: where it has been, and the nodes that it saw a way to from there."""

    ends: dict[int, tuple[int, ...]] = field(default_factory=dict)

    def way(self, here: int, closed: frozenset[str], graph: NavGraph, *, opens: bool) -> tuple[int, ...]:
        """The shortest known way from a node to one where it has not been; empty where there is none."""
        queue: list[tuple[float, tuple[int, ...]]] = [(0.0, (here,))]
        seen: set[int] = set()
        while queue:
            metres, way = heapq.heappop(queue)
            at = way[-1]
            if at not in self.ends:
                return way
            if at in seen:
                continue
            seen.add(at)
            for end in self.ends[at]:
                barred = graph.barred(at, end, closed)
                if opens or not barred:
                    length = float(graph.distance[at, end]) + OPENING * len(barred)
                    heapq.heappush(queue, (metres + length, (*way, end)))
        return ()


class Wanderer(PerEpisodePolicy):
    """Goes to the nearest place where it has not been, opening doors or not; stops beside what it seeks.

    It knows again where it has been and is told the names of what it sees: a baseline of exploring, not of seeing.
    """

    def __init__(self, worlds: Mapping[str, SeenPlace] | None, *, opens: bool = True) -> None:
        """
        Args:
          worlds: what it looks at; None for one that is blind, which stops at random.
          opens: it opens doors.
        """
        self._worlds, self._opens = worlds, opens

    def new_memory(self) -> Tour:
        return Tour()

    def act_one(self, o: Observation, s: Situation, memory: Tour, rng: np.random.Generator) -> Action:
        here = s.pose.node
        memory.ends[here] = s.candidate_nodes
        away, yaw = self._look(o, s, rng)
        if away <= WITHIN:
            return Stop()
        step: int | None = None
        if np.isfinite(away):  # walk up to it, where that is new
            fresh = [
                k
                for k, n in enumerate(s.candidate_nodes)
                if n not in memory.ends and (self._opens or k not in o.can_open)
            ]
            off = np.abs(wrap(o.candidates.bearing + s.pose.yaw - yaw))
            step = min((k for k in fresh if off[k] < STEP), key=lambda k: off[k], default=None)
        if step is None:
            way = memory.way(here, s.closed, s.world.graph, opens=self._opens)
            if not way:
                return Stop()
            step = s.candidate_nodes.index(way[1])
        return Open(step) if step in o.can_open else Move(step)

    def _look(self, o: Observation, s: Situation, rng: np.random.Generator) -> tuple[float, float]:
        """Metres and yaw, radians, of the nearest of what it seeks that is in sight; infinitely far where none is."""
        if self._worlds is None:
            return (0.0 if rng.random() < GIVES_UP else np.inf), 0.0
        assert isinstance(s.task.goal, FindObject), "it is told what class of things it seeks"
        at = viewpoint(o.sight)
        seen = place_named(self._worlds, at.world).sightings(at.node)
        sought = [
            (x.distance * float(np.cos(x.pitch)), x.yaw) for x in seen if x.object_class == s.task.goal.object_class
        ]
        return min(sought, default=(np.inf, 0.0))
