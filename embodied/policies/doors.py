"""Agents for houses with closed doors that do not learn (docs/doors.md)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from embodied.interface import Action, FindObject, Move, Observation, Open, SeenPlace, Situation, Stop, viewpoint
from embodied.navigation.doors import place_named
from embodied.navigation.graph import OPENING, behind_doors, nearest
from embodied.policies.baselines import PerEpisodePolicy

WITHIN = 2.0
"""Metres within which the wanderer takes a thing that it sees for found."""
GIVES_UP = 0.05
"""Probability with which the blind wanderer stops at a step."""


class NeverOpens(PerEpisodePolicy):
    """The shortest way on which nothing is opened; stops at once where there is none."""

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        return towards(s, s.targets, np.inf)


class Wanderer(PerEpisodePolicy):
    """Goes to the nearest viewpoint beside which it has been, but not at it, opening doors or not; stops by what it
    seeks. It is told the names of what it sees: a baseline of exploring, not of seeing."""

    def __init__(self, worlds: Mapping[str, SeenPlace] | None, *, opens: bool = True) -> None:
        """
        Args:
          worlds: what it looks at; None for one that is blind, which stops at random.
          opens: it opens doors.
        """
        self._worlds, self._opening = worlds, OPENING if opens else np.inf

    def new_memory(self) -> tuple[set[int], set[int]]:
        """Nodes where it has been, and beside which."""
        return set(), set()

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        been, beside = memory
        been.add(s.pose.node)
        beside.update(s.candidate_nodes)
        return Stop() if self._found(o, s, rng) else towards(s, sorted(beside - been), self._opening)

    def _found(self, o: Observation, s: Situation, rng: np.random.Generator) -> bool:
        if self._worlds is None:
            return bool(rng.random() < GIVES_UP)
        assert isinstance(s.task.goal, FindObject), "it is told what class of things it seeks"
        at, sought = viewpoint(o.sight), s.task.goal.object_class
        seen = place_named(self._worlds, at.world).sightings(at.node)
        return any(x.object_class == sought and x.distance * np.cos(x.pitch) <= WITHIN for x in seen)


def towards(s: Situation, nodes: tuple[int, ...] | list[int], opening: float) -> Action:
    """The next action on the shortest way to the nearest of some nodes; stop where there is none, or at it.

    Args:
      opening: metres that opening a door counts as; infinite for who opens none.
    """
    ways, here = behind_doors(s.world.graph, s.closed, opening), s.pose.node
    goal = nearest(ways, here, nodes) if nodes else here
    if goal == here or not np.isfinite(ways.distance[here, goal]):
        return Stop()
    step = int(ways.next_hop[here, goal])
    chosen = s.candidate_nodes.index(step)
    return Open(chosen) if s.world.graph.barred(here, step, s.closed) else Move(chosen)
