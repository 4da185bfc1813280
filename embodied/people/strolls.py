"""Strolls: people who walk to and fro between two rooms while somebody else is on the way."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from embodied.assets.people import people
from embodied.house.house import House
from embodied.house.household import residents
from embodied.house.moment import Moment, MovingPerson, Triple
from embodied.people.errands import WAY_STEP, Climb, ErrandLeg, Swing, Walks, legs_along, openness
from embodied.people.gait import Limbs, solved

PERSON_RADIUS, PERSON_HEIGHT, ABOUT, SHORTEST = 0.25, 1.7, 1.5, 3.0
"""Metres: of the cylinder that stands for a person, from the agent's start at first, and of a way at least."""
TRIES, TOGETHER, PAUSES = 20, 130.0, (1.0, 5.0)
"""Ways that are drawn for a person; seconds for which people keep apart, and for which they stand at an end."""


@dataclass(frozen=True)
class Stroll:
    """Somebody who walks to and fro on one way."""

    person: str
    """One of assets.people."""
    way: tuple[Triple, ...]
    """Metres, world, on the ground."""
    pause: float
    """Seconds of standing at each end, the turn included."""
    begin: float = 0.0
    """Seconds of the round trip that are over when an episode begins."""
    swings: tuple[Swing, ...] = ()
    """Doors on the way, which they open and close."""
    climbs: tuple[Climb, ...] = ()
    """Stairs of the house."""


class Walker:
    """A stroll at any second."""

    def __init__(self, stroll: Stroll) -> None:
        self.person, self._limbs, self._begin = stroll.person, Limbs(people()[stroll.person]), stroll.begin
        self._legs, doors, way = list[ErrandLeg](), list[tuple[str, float, float]](), np.array(stroll.way)
        metres = np.cumsum([0.0, *np.linalg.norm(np.diff(way, axis=0), axis=1)])
        every = np.linspace(0, metres[-1], max(2, int(metres[-1] / WAY_STEP) + 1))
        line, self.seconds = np.column_stack([np.interp(every, metres, c) for c in way.T]), 0.0
        """Of a round trip."""
        for there, back in ((line, line[-2]), (line[::-1], line[1])):
            turned = None, math.atan2(*(back - there[-1])[1::-1])
            legs, opened = legs_along(self._limbs, there, stroll.swings, stroll.climbs, self.seconds, turned)
            self._legs += legs
            self.seconds = max(legs[-1].end, legs[-1].begin + stroll.pause)
            doors += opened
        self._doors = [(i, a - k, b - k) for k in (0.0, self.seconds) for i, a, b in doors]

    def place(self, seconds: float) -> tuple[float, float, float, float]:
        """x, y and z, metres, world, and heading, radians."""
        (x, y, z), heading = self._leg(seconds).place(self._since(seconds))
        return float(x), float(y), float(z), heading

    def figure(self, seconds: float) -> MovingPerson:
        return MovingPerson(self.person, *solved(self._limbs, self._leg(seconds).bearing(self._since(seconds))))

    def openness(self, seconds: float) -> dict[str, float]:
        """How far doors are open that are closed at rest."""
        return openness(self._doors, self._since(seconds))

    def _since(self, seconds: float) -> float:
        return (seconds + self._begin) % self.seconds

    def _leg(self, seconds: float) -> ErrandLeg:
        return self._legs[bisect.bisect(self._legs, self._since(seconds), key=lambda leg: leg.begin) - 1]


class Crowd:
    """The people of an episode, each with a clock of their own."""

    def __init__(self, strolls: Sequence[Stroll], *, polite: bool = False) -> None:
        """`polite`: they stand while somebody is within ABOUT before them; otherwise they see nobody."""
        self._walkers, self._polite = [Walker(s) for s in strolls], polite
        self.clocks = np.zeros(len(strolls))
        self.places = np.array([w.place(0.0) for w in self._walkers]).reshape(-1, 4)
        """(n, 4) x, y and z, metres, world, and heading, radians."""

    def go_on(self, seconds: float, begin: np.ndarray, end: np.ndarray) -> float:
        """Let time pass, in which somebody goes straight from (x, y, z) to another place; returns how near, metres, the
        middles of the two nearest bodies come."""
        before, to = self.places, begin - self.places[:, :3]
        ahead = (to[:, :2] * np.stack([np.cos(before[:, 3]), np.sin(before[:, 3])], 1)).sum(1)
        waits = self._polite & (np.linalg.norm(to, axis=1) < ABOUT) & (ahead > 0)
        self.clocks = self.clocks + np.where(waits, 0.0, seconds)
        self.places = np.array([w.place(t) for w, t in zip(self._walkers, self.clocks)]).reshape(-1, 4)
        way = (self.places - before)[:, :3] - (end - begin)
        share = np.clip((to * way).sum(1) / np.maximum((way * way).sum(1), 1e-12), 0.0, 1.0)
        return float(np.linalg.norm(to - share[:, None] * way, axis=1).min(initial=math.inf))

    @property
    def openness(self) -> dict[str, float]:
        """How far people have opened doors that are closed at rest."""
        return {i: x for w, t in zip(self._walkers, self.clocks) for i, x in w.openness(t).items()}

    @property
    def moment(self) -> Moment:
        """Everybody as they are now, by person, and the doors that they open."""
        figures = {w.person: w.figure(t) for w, t in zip(self._walkers, self.clocks)}
        return Moment(openness=self.openness, people=figures)


def who_is_about(house: House, count: int, *, rng: np.random.Generator) -> list[str]:
    """Those of who lives in a house, in any order, and visitors where these are fewer than `count`."""
    at_home = {p.id for p in residents(house)}
    return [str(p) for who in (at_home, people().keys() - at_home) for p in rng.permutation(sorted(who))][:count]


def draw_strolls(
    walks: Walks, who: Sequence[str], start: np.ndarray, *, rng: np.random.Generator
) -> tuple[Stroll, ...]:
    """People who walk between rooms, begin away from (x, y, z) `start` and keep apart, also from each other's doors;
    fewer where there is no room for that."""
    times, others, strolls, ground = np.arange(0.0, TOGETHER, 0.5), list[np.ndarray](), list[Stroll](), walks.ground
    inside = np.flatnonzero(ground.room_of_cell != "")
    for person in who:
        for _ in range(TRIES):
            a, b = rng.choice(inside, 2).tolist()
            pause, begin = np.round([rng.uniform(*PAUSES), rng.uniform(0, TOGETHER)], 2).tolist()
            ways = ground.wide_ways(np.array([b]))
            if ground.room_of_cell[a] == ground.room_of_cell[b] or not SHORTEST < ways.metres[a] < math.inf:
                continue
            line = walks.line(ground.xy[ways.cells(a)])
            points = np.round([*line[:-1:4], line[-1]], 3)
            swings = tuple(s for s in walks.swings if s.stop(line) is not None)
            way = tuple((x, y, z) for x, y, z in points.tolist())
            stroll = Stroll(person, way, pause, begin, swings, tuple(walks.climbs))
            walker = Walker(stroll)
            if np.linalg.norm(walker.place(0.0)[:3] - start) < ABOUT:
                continue
            track = np.array([walker.place(t)[:3] for t in times])
            apart = all(np.linalg.norm(track - x, axis=1).min() > 2 * PERSON_RADIUS for x in others)
            met = [s.meets(line[[0, -1]]).any() for s in walks.swings]
            met += [s.meets(x).any() for x in others for s in swings]
            if apart and not any(met + [s.meets(track).any() for x in strolls for s in x.swings]):
                strolls.append(stroll)
                others.append(track)
                break
    return tuple(strolls)
