"""Strolls: people who walk to and fro between two rooms while somebody else is on the way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from embodied.assets.people import people
from embodied.house.house import House
from embodied.house.household import residents
from embodied.house.moment import MovingPerson
from embodied.navigation.floor_ways import FloorWays
from embodied.people.errands import WAY_STEP, ErrandLeg, legs_along, smooth_line
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
    way: tuple[tuple[float, float, float], ...]
    """Metres, world, on the ground."""
    pause: float
    """Seconds of standing at each end, the turn included."""
    begin: float = 0.0
    """Seconds of the round trip that are over when an episode begins."""


class Walker:
    """A stroll at any second."""

    def __init__(self, stroll: Stroll) -> None:
        self.person, self._limbs, self._begin = stroll.person, Limbs(people()[stroll.person]), stroll.begin
        self._legs, way = list[tuple[float, ErrandLeg]](), np.array(stroll.way)
        metres = np.cumsum([0.0, *np.linalg.norm(np.diff(way, axis=0), axis=1)])
        every = np.linspace(0, metres[-1], max(2, int(metres[-1] / WAY_STEP) + 1))
        line = np.column_stack([np.interp(every, metres, c) for c in way.T])
        for there, back in ((line, line[-2]), (line[::-1], line[1])):
            turned = math.atan2(*(back - there[-1])[1::-1])
            legs, _ = legs_along(self._limbs, there, (), turned=(None, turned))
            long = [leg.end - leg.begin for leg in legs]
            self._legs += zip([*long[:-1], max(long[-1], stroll.pause)], legs)
        self.seconds = sum(s for s, _ in self._legs)
        """Of a round trip."""

    def place(self, seconds: float) -> tuple[float, float, float]:
        """x and y, metres, world, and heading, radians."""
        leg, since = self._leg(seconds)
        at, heading = leg.course.body(leg.course.walked(since))
        return float(at[0]), float(at[1]), heading

    def figure(self, seconds: float) -> MovingPerson:
        leg, since = self._leg(seconds)
        return MovingPerson(self.person, *solved(self._limbs, leg.course.at(since)))

    def _leg(self, seconds: float) -> tuple[ErrandLeg, float]:
        since = (seconds + self._begin) % self.seconds
        for long, leg in self._legs[:-1]:
            if since < long:
                return leg, since
            since -= long
        return self._legs[-1][1], since


class Crowd:
    """The people of an episode, each with a clock of their own."""

    def __init__(self, strolls: Sequence[Stroll], *, polite: bool = False) -> None:
        """`polite`: they stand while somebody is within ABOUT before them; otherwise they see nobody."""
        self._walkers, self._polite = [Walker(s) for s in strolls], polite
        self.clocks = np.zeros(len(strolls))
        self.places = np.array([w.place(0.0) for w in self._walkers]).reshape(-1, 3)
        """(n, 3) x and y, metres, world, and heading, radians."""

    def go_on(self, seconds: float, begin: np.ndarray, end: np.ndarray) -> float:
        """Let time pass, in which somebody goes straight from (x, y) to another place; returns how near, metres, the
        middles of the two nearest bodies come."""
        before, to = self.places, begin - self.places[:, :2]
        ahead = (to * np.stack([np.cos(before[:, 2]), np.sin(before[:, 2])], 1)).sum(1)
        waits = self._polite & (np.hypot(*to.T) < ABOUT) & (ahead > 0)
        self.clocks = self.clocks + np.where(waits, 0.0, seconds)
        self.places = np.array([w.place(t) for w, t in zip(self._walkers, self.clocks)]).reshape(-1, 3)
        way = (self.places - before)[:, :2] - (end - begin)
        share = np.clip((to * way).sum(1) / np.maximum((way * way).sum(1), 1e-12), 0.0, 1.0)
        return float(np.linalg.norm(to - share[:, None] * way, axis=1).min(initial=math.inf))

    @property
    def figures(self) -> dict[str, MovingPerson]:
        """Everybody as they are now, by person: `Moment.people`."""
        return {w.person: w.figure(t) for w, t in zip(self._walkers, self.clocks)}


def draw_strolls(
    house: House, ground: FloorWays, count: int, start: Sequence[float], *, rng: np.random.Generator
) -> tuple[Stroll, ...]:
    """`count` of those who live in a house, and visitors where these are fewer, who walk between rooms of the ground
    floor, begin away from (x, y) `start` and keep apart; fewer where there is no room for that."""
    times, others, strolls = np.arange(0.0, TOGETHER, 0.5), list[np.ndarray](), list[Stroll]()
    inside = np.flatnonzero((ground.room_of_cell != "") & (ground.xyz[:, 2] == house.storeys[0].elevation))
    at_home = {p.id for p in residents(house)}
    known = [*rng.permutation(sorted(at_home)), *rng.permutation(sorted(people().keys() - at_home))]
    for person in map(str, known[:count]):
        for _ in range(TRIES):
            a, b = rng.choice(inside, 2).tolist()
            seconds = np.round([rng.uniform(*PAUSES), rng.uniform(0, TOGETHER)], 2).tolist()
            ways = ground.wide_ways(np.array([b]))
            if ground.room_of_cell[a] == ground.room_of_cell[b] or not SHORTEST < ways.metres[a] < math.inf:
                continue
            line = smooth_line(ground.xyz[ways.cells(a), :2], ground.space)
            floor, points = float(house.storeys[0].elevation), np.round([*line[:-1:4], line[-1]], 3).tolist()
            stroll = Stroll(person, tuple((x, y, floor) for x, y in points), *seconds)
            walker = Walker(stroll)
            if math.dist(walker.place(0.0)[:2], start[:2]) < ABOUT:
                continue
            track = np.array([walker.place(t)[:2] for t in times])
            if all(np.linalg.norm(track - x, axis=1).min() > 2 * PERSON_RADIUS for x in others):
                strolls.append(stroll)
                others.append(track)
                break
    return tuple(strolls)
