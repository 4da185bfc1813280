"""Errands: somebody goes through a house, opens the doors on the way, and may sit down at the end."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from scipy.ndimage import uniform_filter1d

from embodied.assets.people import Person
from embodied.geometry import wrap
from embodied.house.house import House, Opening
from embodied.house.moment import WIDEST, Moment, MovingPerson
from embodied.house.shapes import inward
from embodied.navigation.floor_ways import FloorWays
from embodied.navigation.free_space import closed_doors, leaves, opened
from embodied.navigation.graph import AGENT_RADIUS, walkable
from embodied.people.gait import Course, Limbs, sitting, smooth, solved, turn, walk

SIT_SECONDS, DOOR_SECONDS = 1.8, 1.4
HANDLE_REACH, WAY_STEP = 0.85, 0.05
"""Metres from which a hand goes to the handle of a door, and between the points of a way."""


@dataclass(frozen=True, eq=False)
class ErrandLeg:
    """Part of an errand, seconds: a walk, a turn, or standing while the right hand opens a door."""

    begin: float
    end: float
    course: Course
    door: Swing | None = None


@dataclass(frozen=True, eq=False)
class Errand:
    """Who goes where, from second 0 on: doors with the seconds at which they begin to open and to close, and a seat, x,
    y and z of the middle of what is sat on at the end and the heading of its front."""

    person: Person
    legs: Sequence[ErrandLeg]
    doors: Sequence[tuple[str, float, float]]
    seat: Sequence[float] | None

    @property
    def seconds(self) -> float:
        """Seconds until the person is there."""
        return self.legs[-1].end + SIT_SECONDS * (self.seat is not None)

    def at(self, seconds: float) -> Moment:
        """The house at a time: the person, by id, and the doors that are open because of them."""
        leg = next((x for x in self.legs if seconds < x.end), self.legs[-1])
        limbs, bearing = Limbs(self.person), leg.course.at(seconds - leg.begin)
        if leg.door is not None:
            hand = leg.door.handle(smooth((seconds - leg.begin) / DOOR_SECONDS), float(bearing.position[2]))
            hands = {"right": hand} if math.dist(hand[:2], bearing.position[:2]) < HANDLE_REACH else {}
            bearing = dataclasses.replace(bearing, hands=hands, look=hand)
        if self.seat is not None and seconds > self.legs[-1].end:
            *middle, front = self.seat
            bearing = sitting(limbs, bearing, np.array(middle), front, (seconds - self.legs[-1].end) / SIT_SECONDS)
        openness = {}
        for door, opens, closes in self.doors:
            if opens < seconds < closes + DOOR_SECONDS:
                openness[door] = smooth((seconds - opens) / DOOR_SECONDS) - smooth((seconds - closes) / DOOR_SECONDS)
        return Moment(openness=openness, people={self.person.id: MovingPerson(self.person.id, *solved(limbs, bearing))})


def errand(
    house: House, person: Person, start: Sequence[float], goal: Sequence[float], seat: Sequence[float] | None = None
) -> Errand:
    """The way over the ground floor between the free places nearest to (x, y) points, away from things where there is
    room, with a seat beside the goal (`Errand.seat`)."""
    rest, limbs, floor = opened(house, closed_doors(house)), Limbs(person), house.storeys[0].elevation
    ways = FloorWays(rest, stairs=False)
    swings = [Swing(house, o) for o in house.openings if o.id in closed_doors(house)]
    swept = shapely.union_all([s.area for s in swings])
    free = np.flatnonzero(~shapely.intersects_xy(swept, *ways.xy.T))  # nobody stands in the way of a leaf
    begin, end = (int(free[np.linalg.norm(ways.xy[free] - p, axis=1).argmin()]) for p in (start[:2], goal[:2]))
    line = _smooth_line(ways.xy[ways.wide_ways(np.array([end])).cells(begin)], walkable(rest))
    steps = np.diff(line, axis=0, append=2 * line[-1:] - line[-2:-1])
    headings = uniform_filter1d(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])), 11, mode="nearest")
    points = np.insert(line, 2, floor, axis=1)
    legs, doors = [ErrandLeg(0.0, 0.0, turn(limbs, points[0], headings[0], headings[0]))], []
    add = lambda course, seconds, door=None: legs.append(ErrandLeg(legs[-1].end, legs[-1].end + seconds, course, door))
    stops = sorted(((i, s) for s in swings if (i := s.stop(line)) is not None), key=lambda stop: stop[0])
    for (first, swing), (last, _) in pairwise([(0, None), *stops, (len(line) - 1, None)]):
        course = walk(limbs, points[first : last + 1], headings[first : last + 1])
        if swing is not None:
            add(turn(limbs, points[first], headings[first], headings[first]), DOOR_SECONDS, swing)
            times = np.arange(0, course.seconds, 0.1)
            on_way = np.array([course.body(course.walked(t))[0][:2] for t in times])
            past = float(times[shapely.intersects_xy(swing.area, *on_way.T)].max(initial=0.0)) + 0.2
            doors.append((swing.opening.id, legs[-1].begin, legs[-1].end + past))
        if last > first:
            add(course, course.seconds)
    if seat is not None and abs(float(wrap(seat[3] - headings[-1]))) > 0.1:
        course = turn(limbs, points[-1], headings[-1], seat[3])
        add(course, course.seconds)
    return Errand(person, legs, doors, seat)


def _smooth_line(cells: np.ndarray, space: shapely.Geometry) -> np.ndarray:
    """(m, 2) points along a way, its corners rounded as far as the free floor allows."""
    metres = np.cumsum([0.0, *np.linalg.norm(np.diff(cells, axis=0), axis=1)])
    every = np.linspace(0, metres[-1], max(2, int(metres[-1] / WAY_STEP) + 1))
    line = np.column_stack([np.interp(every, metres, c) for c in cells.T])
    for size in (17, 9, 5):
        bent = uniform_filter1d(line, size, axis=0, mode="nearest")
        bent[[0, -1]] = line[[0, -1]]
        if space.covers(shapely.LineString(bent)):
            return bent
    return line


class Swing:
    """A door that is closed at rest, and the floor where a body would meet its leaf."""

    def __init__(self, house: House, opening: Opening) -> None:
        self.opening, self._normal = opening, inward(house, opening)
        swept = [p for k in range(7) for p in leaves(house, dataclasses.replace(opening, angle=k * WIDEST / 6))]
        self.area = shapely.MultiPolygon(swept).convex_hull.buffer(AGENT_RADIUS + 0.03)
        hinge, latch = (opening.a, opening.b) if opening.hinge == "a" else (opening.b, opening.a)
        self._hinge, self._across = np.array(hinge), np.subtract(latch, hinge)

    def handle(self, openness: float, floor: float) -> np.ndarray:
        """(3,) metres, world."""
        angle, long = openness * WIDEST, float(np.linalg.norm(self._across))
        along = math.cos(angle) * self._across / long + math.sin(angle) * self._normal
        return np.array([*(self._hinge + (long - 0.1) * along), floor + 1.02])

    def stop(self, line: np.ndarray) -> int | None:
        """Number of the last point of a way before the leaf that it leads past; None where it does not."""
        if not shapely.LineString([self.opening.a, self.opening.b]).intersects(shapely.LineString(line)):
            return None
        return max(int(np.argmax(shapely.intersects_xy(self.area, *line.T))) - 1, 0)
