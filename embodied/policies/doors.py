"""Agents for houses with closed doors that do not learn (docs/doors.md)."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from embodied.house.contents import kept_in, part_of
from embodied.interface import Action, Close, FindObject, Observation, Open, SeenPlace, Situation, Stop, viewpoint
from embodied.navigation.doors import place_named
from embodied.navigation.graph import OPENING
from embodied.policies.baselines import PerEpisodePolicy
from embodied.teachers.shortest import shortest_of

WITHIN = 2.0
"""Metres within which the wanderer takes a thing that it sees for found."""
GIVES_UP, GUESSES = 0.05, 0.5
"""Probability with which the blind wanderer stops at a step, and the blind searcher when it has opened something."""


class NeverOpens(PerEpisodePolicy):
    """The shortest way on which nothing is opened; stops at once where there is none."""

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        return shortest_of(s, opening=np.inf)


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
        return Stop() if self._found(o, s, rng) else shortest_of(s, sorted(beside - been), self._opening)

    def _found(self, o: Observation, s: Situation, rng: np.random.Generator) -> bool:
        if self._worlds is None:
            return bool(rng.random() < GIVES_UP)
        assert isinstance(s.task.goal, FindObject), "it is told what class of things it seeks"
        at, sought = viewpoint(o.sight), s.task.goal.object_class
        seen = place_named(self._worlds, at.world).sightings(at.node)
        return any(x.object_class == sought and x.distance * np.cos(x.pitch) <= WITHIN for x in seen)


class Searcher(Wanderer):
    """Wanders, opens where it stands what may hold what it seeks, the likeliest first, and closes it again; stops by
    what it sees there. It is told the names of what it sees, and which classes furniture holds; a blind one guesses."""

    def new_memory(self) -> Any:
        """As of Wanderer, and what it has opened from where."""
        return *super().new_memory(), set[tuple[int, str]]()

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        assert isinstance(s.task.goal, FindObject), "it is told what class of things it seeks"
        (*known, tried), likely = memory, dict[int, float]()
        if self._found(o, s, rng):
            return Stop()
        for k, part in s.extras.items():
            if k in o.can_close:
                return Close(k)
            words = kept_in(s.world.house.placement_by_id[part.split("/")[0]].object_class, part.split("/")[1])
            share = sum(w.split(":")[0] == s.task.goal.object_class for w in words) / len(words)
            likely |= {k: share} if share and (s.pose.node, part) not in tried else {}
        if not likely:
            return super().act_one(o, s, known, rng)
        best = max(likely, key=lambda k: likely[k])
        tried.add((s.pose.node, s.extras[best]))
        return Open(best)

    def _found(self, o: Observation, s: Situation, rng: np.random.Generator) -> bool:
        if o.moved or not o.can_close:  # it has not just opened something
            return False
        return bool(rng.random() < GUESSES) if self._worlds is None else super()._found(o, s, rng)


class Fetch(PerEpisodePolicy):
    """The shortest way to where something that is sought can be seen, opening what holds it there."""

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        assert isinstance(s.task.goal, FindObject), "it is told what it seeks"
        held = {*map(part_of, s.task.goal.placements)} if s.pose.node in s.targets else ()
        here = [k for k, part in s.extras.items() if part in held]
        return Open(here[0]) if here and not {*here} & {*o.can_close} else shortest_of(s)
