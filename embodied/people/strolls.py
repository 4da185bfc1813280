"""Strolls: people who walk to and fro between two rooms while somebody else is on the way."""

from __future__ import annotations

import bisect
import dataclasses
import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from embodied.assets.people import people
from embodied.house.house import House
from embodied.house.household import residents
from embodied.house.moment import Moment, MovingPerson, Triple
from embodied.navigation.free_space import EYE, sight_floor
from embodied.people.errands import BODY_GAP, WAY_STEP, Climb, ErrandLeg, Swing, Walks, legs_along, openness
from embodied.people.gait import NOTICED, Limbs, between, looking, smooth, solved

PERSON_RADIUS, PERSON_HEIGHT, ABOUT, SHORTEST = 0.25, 1.7, 1.5, 3.0
"""Metres: of the cylinder that stands for a person, from the agent's start at first, and of a way at least."""
PATIENCE, DETOUR = 1.0, 4.0
"""Seconds of waiting before somebody is walked around, and metres that this may be longer."""
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

    def leg(self, seconds: float) -> ErrandLeg:
        """The part of the way at a time, by a clock that does not begin anew with each round."""
        leg, rounds = self._leg(seconds), seconds - self._since(seconds)
        return dataclasses.replace(leg, begin=leg.begin + rounds, end=leg.end + rounds)

    def openness(self, seconds: float) -> dict[str, float]:
        """How far doors are open that are closed at rest."""
        return openness(self._doors, self._since(seconds))

    def _since(self, seconds: float) -> float:
        return (seconds + self._begin) % self.seconds

    def _leg(self, seconds: float) -> ErrandLeg:
        return self._legs[bisect.bisect(self._legs, self._since(seconds), key=lambda leg: leg.begin) - 1]


class Crowd:
    """The people of an episode, each with a clock of their own, who look at somebody who is near."""

    def __init__(
        self, strolls: Sequence[Stroll], walks: Walks | None = None, *, polite: bool = False, eye: float = EYE
    ) -> None:
        """
        Args:
          walks: of the house; without, people look at nobody.
          polite: they stand while somebody is within ABOUT before them, and after PATIENCE walk around them.
          eye: metres above the floor that they look at.
        """
        self._walkers, self._walks, self._polite = [Walker(s) for s in strolls], walks, polite
        self._around: list[tuple[Sequence[ErrandLeg], float] | None] = [None for _ in strolls]
        self._eye, self._met = np.array([0.0, 0.0, eye]), np.full(3, np.inf)
        self.clocks, self._waited, self._still = np.zeros((3, len(strolls)))
        self.places = self._now()
        """(n, 4) x, y and z, metres, world, and heading, radians."""

    def go_on(self, seconds: float, begin: np.ndarray, end: np.ndarray) -> float:
        """Let time pass, in which somebody goes straight from (x, y, z) to another place; returns how near, metres, the
        middles of the two nearest bodies come."""
        before, to = self.places, begin - self.places[:, :3]
        ahead = (to[:, :2] * np.stack([np.cos(before[:, 3]), np.sin(before[:, 3])], 1)).sum(1)
        waits = self._polite & (np.linalg.norm(to, axis=1) < ABOUT) & (ahead > 0)
        for k in np.flatnonzero(waits).tolist():
            if self._around[k] is not None:
                rest = self._leg(k).ahead(self.clocks[k])[:, 1:4]
                waits[k] = np.linalg.norm(rest - begin, axis=1).min() < BODY_GAP
        self._waited = np.where(waits, self._waited + seconds, 0.0)
        self._still = np.clip(self._still + np.where(waits, 2.0, -2.0) * seconds, 0.0, 1.0)
        for k in np.flatnonzero(self._waited > PATIENCE).tolist():
            self._step_aside(k, end)
        self.clocks = self.clocks + np.where(waits, 0.0, seconds)
        for k, around in enumerate(self._around):
            if around is not None and self.clocks[k] >= around[0][-1].end:
                self.clocks[k], self._around[k] = around[1], None
        self.places, self._met = self._now(), end + self._eye
        way = (self.places - before)[:, :3] - (end - begin)
        share = np.clip((to * way).sum(1) / np.maximum((way * way).sum(1), 1e-12), 0.0, 1.0)
        return float(np.linalg.norm(to - share[:, None] * way, axis=1).min(initial=math.inf))

    @property
    def openness(self) -> dict[str, float]:
        """How far people have opened doors that are closed at rest."""
        times = [t if a is None else min(t, a[1]) for t, a in zip(self.clocks, self._around)]
        return {i: x for w, t in zip(self._walkers, times) for i, x in w.openness(t).items()}

    @property
    def moment(self) -> Moment:
        """Everybody as they are now, by person, and the doors that they open."""
        now = Moment(openness=self.openness, people={w.person: self._figure(k) for k, w in enumerate(self._walkers)})
        return now if self._walks is None else noticing(now, self._met, self._walks.house)

    def _leg(self, k: int) -> ErrandLeg:
        around, now = self._around[k], self.clocks[k]
        return self._walkers[k].leg(now) if around is None else next(x for x in around[0] if now <= x.end)

    def _now(self) -> np.ndarray:
        at = (self._leg(k).place(t) for k, t in enumerate(self.clocks))
        return np.array([(*place, heading) for place, heading in at]).reshape(-1, 4)

    def _figure(self, k: int) -> MovingPerson:
        leg = self._leg(k)
        posed = solved(leg.course.limbs, leg.bearing(self.clocks[k]))
        if self._still[k]:
            stands = solved(leg.course.limbs, leg.course.limbs.standing(self.places[k, :3], self.places[k, 3]))
            posed = between(posed, stands, smooth(self._still[k]))
        return MovingPerson(self._walkers[k].person, *posed)

    def _step_aside(self, k: int, other: np.ndarray) -> None:
        """Go on around who stands at (x, y, z), where the free floor of rooms that are open allows that."""
        leg, now, walks, around = self._leg(k), self.clocks[k], self._walks, self._around[k]
        rest, last = leg.ahead(now), leg if around is None else around[0][-1]
        (_, *here, heading), (_, *there, facing) = rest[0], last.course.line[-1]
        if walks is None or leg.door or np.ptp(rest[:, 3]) > 0 or math.dist(here, there) < 2 * BODY_GAP:
            return
        ground, longest = walks.ground, rest[-1, 0] - rest[0, 0] + math.dist(rest[-1, 1:4], there) + DETOUR
        bodies = shapely.MultiPoint(ground.plane(np.array([other, *np.delete(self.places[:, :3], k, axis=0)])))
        closed = [s.meets(ground.xyz) for s in walks.swings if not s.meets(rest[:, 1:4]).any()]
        shut = np.any([shapely.dwithin(shapely.points(ground.xy), bodies, BODY_GAP + WAY_STEP), *closed], axis=0)
        begin, end = ground.cells_at(np.array([here, there]))
        ways = ground.wide_ways(np.array([end]), shut)
        if shut[end] or ways.metres[begin] > longest:
            return
        ends = ground.plane(np.array([here, there]))
        line = walks.line(np.concatenate([ends[:1], ground.xy[ways.cells(begin)], ends[1:]]), others=bodies)
        legs, _ = legs_along(leg.course.limbs, line, (), (), now, (heading, facing))
        self._around[k] = legs, leg.end if around is None else around[1]
        self._waited[k] = self._still[k] = 0.0


walks_of = functools.lru_cache(16)(Walks)
_sight = functools.lru_cache(16)(sight_floor)


def noticing(moment: Moment, eye: np.ndarray, house: House) -> Moment:
    """The moment in which people look at (3,) an eye that is near and in sight."""
    near = {n: looking(f, eye) for n, f in in_sight(moment, eye, house, NOTICED).items()}
    return dataclasses.replace(moment, people={**moment.people, **near})


def in_sight(moment: Moment, eye: np.ndarray, house: House, reach: float = math.inf) -> dict[str, MovingPerson]:
    """Who is within so many metres of (3,) an eye, and no wall or closed door between; furniture hides nobody here."""
    floor = _sight(house, sum(s.elevation < eye[2] for s in house.storeys[1:]))
    lines = {n: shapely.LineString([eye[:2], f.place.position[:2]]) for n, f in moment.people.items()}
    return {n: moment.people[n] for n, line in lines.items() if line.length < reach and floor.covers(line)}


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
