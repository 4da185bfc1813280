"""Ways through a house, and the doors that somebody opens on them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import shapely
from scipy.ndimage import uniform_filter1d

from embodied.geometry import wrap
from embodied.house.house import House, Opening
from embodied.house.moment import WIDEST
from embodied.house.shapes import inward
from embodied.navigation.free_space import leaves
from embodied.navigation.graph import AGENT_RADIUS
from embodied.people.gait import Bearing, Course, Limbs, smooth, turn, walk

DOOR_SECONDS = 1.4
HANDLE_REACH, WAY_STEP, BODY_GAP, LEAST_TURN = 0.85, 0.05, 0.45, 0.1
"""Metres from which a hand goes to the handle of a door, between the points of a way, and between two people's middles
at least; radians below which nobody turns on the spot."""


@dataclass(frozen=True, eq=False)
class ErrandLeg:
    """Part of a way, seconds: a walk, a turn, or standing while the right hand opens a door."""

    begin: float
    end: float
    course: Course
    door: Swing | None = None

    def bearing(self, seconds: float) -> Bearing:
        """The body at a time."""
        out = self.course.at(seconds - self.begin)
        if self.door is None:
            return out
        hand = self.door.handle(smooth((seconds - self.begin) / DOOR_SECONDS), float(out.position[2]))
        near = math.dist(hand[:2], out.position[:2]) < HANDLE_REACH
        return dataclasses.replace(out, hands={"right": hand} if near else {}, look=hand)


Doors: TypeAlias = Sequence[tuple[str, float, float]]
"""Openings, with the seconds at which they begin to open and to close."""


def openness(doors: Doors, seconds: float) -> dict[str, float]:
    """How far doors are open at a time, those that are not closed."""
    moving = (x for x in doors if x[1] < seconds < x[2] + DOOR_SECONDS)
    return {i: smooth((seconds - a) / DOOR_SECONDS) - smooth((seconds - b) / DOOR_SECONDS) for i, a, b in moving}


def legs_along(
    limbs: Limbs,
    points: np.ndarray,
    swings: Sequence[Swing],
    since: float = 0.0,
    turned: tuple[float | None, float | None] = (None, None),
) -> tuple[list[ErrandLeg], Doors]:
    """The legs of a walk, and the doors that it leads through.

    Args:
      points: (m, 3) metres, world, on the floor.
      since: seconds at which it begins.
      turned: headings of who stands there before and after; that of the way where None.
    """
    begin, end = turned
    steps = np.diff(points[:, :2], axis=0, append=2 * points[-1:, :2] - points[-2:-1, :2])
    headings = uniform_filter1d(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])), 11, mode="nearest")
    still = lambda k, a, b: turn(limbs, points[k], a, b)
    legs, doors = [ErrandLeg(since, since, still(0, headings[0], headings[0]))], []
    add = lambda course, seconds, door=None: legs.append(ErrandLeg(legs[-1].end, legs[-1].end + seconds, course, door))
    if begin is not None and abs(float(wrap(headings[0] - begin))) > LEAST_TURN:
        add(course := still(0, begin, headings[0]), course.seconds)
    stops = sorted(((i, s) for s in swings if (i := s.stop(points[:, :2])) is not None), key=lambda stop: stop[0])
    for (first, swing), (last, _) in pairwise([(0, None), *stops, (len(points) - 1, None)]):
        course = walk(limbs, points[first : last + 1], headings[first : last + 1])
        if swing is not None:
            add(still(first, headings[first], headings[first]), DOOR_SECONDS, swing)
            times = np.arange(0, course.seconds, 0.1)
            on_way = np.array([course.body(course.walked(t))[0][:2] for t in times])
            past = float(times[shapely.intersects_xy(swing.area, *on_way.T)].max(initial=0.0)) + 0.2
            doors.append((swing.opening.id, legs[-1].begin, legs[-1].end + past))
        if last > first:
            add(course, course.seconds)
    if end is not None and abs(float(wrap(end - headings[-1]))) > LEAST_TURN:
        add(course := still(-1, headings[-1], end), course.seconds)
    return legs, doors


def smooth_line(cells: np.ndarray, space: shapely.Geometry, others: shapely.Geometry | None = None) -> np.ndarray:
    """(m, 2) points along a way, its corners rounded as far as the free floor allows and BODY_GAP from `others`."""
    metres = np.cumsum([0.0, *np.linalg.norm(np.diff(cells, axis=0), axis=1)])
    every = np.linspace(0, metres[-1], max(2, int(metres[-1] / WAY_STEP) + 1))
    line = np.column_stack([np.interp(every, metres, c) for c in cells.T])
    for size in (17, 9, 5):
        bent = uniform_filter1d(line, size, axis=0, mode="nearest")
        bent[[0, -1]] = line[[0, -1]]
        way = shapely.LineString(bent)
        if space.covers(way) and (others is None or not way.dwithin(others, BODY_GAP)):
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
