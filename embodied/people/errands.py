"""Ways of people through a house: over the free floor of all storeys, on stairs, and through doors that they open."""

import dataclasses
import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import shapely
from scipy.ndimage import uniform_filter1d

from embodied.geometry import wrap
from embodied.house.house import House, Opening, Stair
from embodied.house.moment import WIDEST, Triple
from embodied.house.shapes import inward
from embodied.navigation.floor_ways import APART, FloorWays
from embodied.navigation.free_space import closed_doors, leaves, opened
from embodied.navigation.graph import AGENT_RADIUS, stair_ends
from embodied.people.gait import Bearing, Course, Limbs, smooth, turn, walk
from embodied.scene.stairs import flights_of

DOOR_SECONDS = 1.4
HANDLE_REACH, WAY_STEP, BODY_GAP, STEP_EDGE, LEAST_TURN = 0.85, 0.05, 0.45, 0.14, 0.1
"""Metres from which a hand goes to the handle of a door, between the points of a way, between two people's middles at
least, and of a foot from the edge of a landing; radians below which nobody turns on the spot."""
Climb: TypeAlias = tuple[Triple, ...]
"""Places of feet on a stair, metres, world: on the floor below, on each tread and landing, on the floor above."""
Treads: TypeAlias = Sequence[tuple[int, float]]
"""Numbers of points of a way, and heights, metres."""


@dataclass(frozen=True)
class Swing:
    """A door that is closed at rest, and the floor where a body would meet its leaf: metres, world."""

    door: str
    hinge: Triple
    """On the floor."""
    latch: tuple[float, float]
    opens: tuple[float, float]
    """Unit, from the wall to where the leaf goes."""
    corners: tuple[tuple[float, float], ...]

    @functools.cached_property
    def area(self) -> shapely.Polygon:
        return shapely.Polygon(self.corners)

    def handle(self, openness: float) -> np.ndarray:
        """(3,) metres, world."""
        angle, across = openness * WIDEST, np.subtract(self.latch, self.hinge[:2])
        long = float(np.linalg.norm(across))
        along = math.cos(angle) * across / long + math.sin(angle) * np.array(self.opens)
        return np.array([*(self.hinge[:2] + (long - 0.1) * along), self.hinge[2] + 1.02])

    def meets(self, points: np.ndarray) -> np.ndarray:
        """(m,) bool: which of (m, 3) points are in the way of the leaf."""
        return shapely.intersects_xy(self.area, *points[:, :2].T) & (np.abs(points[:, 2] - self.hinge[2]) < 0.5)

    def stop(self, points: np.ndarray) -> int | None:
        """Number of the last of (m, 3) points of a way before the leaf that it leads past; None where it does not."""
        met = np.flatnonzero(self.meets(points))
        line = shapely.LineString([self.hinge[:2], self.latch])
        if len(met) < 2 or not line.intersects(shapely.LineString(points[met[0] : met[-1] + 1, :2])):
            return None
        return max(int(met[0]) - 1, 0)


def swing_of(house: House, opening: Opening) -> Swing:
    swept = [p for k in range(7) for p in leaves(house, dataclasses.replace(opening, angle=k * WIDEST / 6))]
    area = shapely.MultiPolygon(swept).convex_hull.buffer(AGENT_RADIUS + 0.03, quad_segs=4).simplify(0.005)
    hinge, latch = (opening.a, opening.b) if opening.hinge == "a" else (opening.b, opening.a)
    (x, y), corners = inward(house, opening).tolist(), np.round(area.exterior.coords, 3).tolist()
    at = hinge[0], hinge[1], house.floor_height(opening)
    return Swing(opening.id, at, latch, (x, y), tuple((x, y) for x, y in corners))


def climb_of(stair: Stair) -> Climb:
    foot, head = stair_ends(stair)
    points = [foot]
    for f in flights_of(stair):
        treads = [f.at((k + 0.5) * f.going, 0.0, (k + 1) * f.rise) for k in range(f.risers - 1)]
        points += [f.at(-STEP_EDGE, 0.0), *treads, f.at(f.length + STEP_EDGE, 0.0, f.risers * f.rise)]
    return tuple((x, y, z) for x, y, z in np.round([*points, head], 3).tolist())


class Walks:
    """Owns the floor of a house whose doors people open."""

    def __init__(self, house: House) -> None:
        self.house, shut = house, closed_doors(house)
        self.ground = FloorWays(opened(house, shut))
        self.swings = [swing_of(house, o) for o in house.openings if o.id in shut]
        self.fronts = [swing_of(house, o) for o in house.openings if o.kind == "front_door"]
        self.climbs = [climb_of(s) for s in house.stairs]
        inside = self.ground.room_of_cell != ""
        self.clear = np.all([inside, *(~s.meets(self.ground.xyz) for s in self.swings + self.fronts)], axis=0)
        """(n,) bool: cells of the ground where somebody may stand, in a room and not in the way of a leaf."""

    def line(
        self, way: np.ndarray, space: shapely.Geometry | None = None, others: shapely.Geometry | None = None
    ) -> np.ndarray:
        """(m, 3) points, metres, world, along (k, 2) points of the plane of the ground, corners rounded.

        Args:
          space: free floor, of the ground where None.
          others: points to keep BODY_GAP from.
        """
        parts = np.split(way, np.flatnonzero(np.diff(np.rint(way[:, 0] / APART))) + 1)
        space = self.ground.space if space is None else space
        points = np.concatenate([self.ground.world(smooth_line(p, space, others)) for p in parts])
        apart = np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-6
        return points[[0, *(np.flatnonzero(apart[:-1]) + 1), len(points) - 1]]


@dataclass(frozen=True, eq=False)
class ErrandLeg:
    """Part of a way, seconds: a walk, a turn, or standing while the right hand opens a door."""

    begin: float
    end: float
    course: Course
    door: Swing | None = None

    def place(self, seconds: float) -> tuple[np.ndarray, float]:
        """(3,) metres, world, where the body is at a time, and its heading."""
        return self.course.body(self.course.walked(seconds - self.begin))

    def ahead(self, seconds: float) -> np.ndarray:
        """(m, 5) the rest of its Course.line."""
        walked = self.course.walked(seconds - self.begin)
        (x, y, z), heading = self.course.body(walked)
        return np.array([(walked, x, y, z, heading), *self.course.line[self.course.line[:, 0] > walked]])

    def bearing(self, seconds: float) -> Bearing:
        """The body at a time."""
        out = self.course.at(seconds - self.begin)
        if self.door is None:
            return out
        hand = self.door.handle(smooth((seconds - self.begin) / DOOR_SECONDS))
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
    climbs: Sequence[Climb] = (),
    since: float = 0.0,
    turned: tuple[float | None, float | None] = (None, None),
) -> tuple[list[ErrandLeg], Doors]:
    """The legs of a walk, and the doors that it leads through.

    Args:
      points: (m, 3) metres, world, on the floor.
      swings, climbs: doors and stairs of the house.
      since: seconds at which it begins.
      turned: headings of who stands there before and after; that of the way where None.
    """
    begin, end = turned
    steps = np.diff(points[:, :2], axis=0, append=2 * points[-1:, :2] - points[-2:-1, :2])
    headings = uniform_filter1d(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])), 11, mode="nearest")
    still = lambda k, a, b: turn(limbs, points[k], a, b)
    legs = [ErrandLeg(since, since, still(0, headings[0], headings[0]))]
    add = lambda course, seconds, door=None: legs.append(ErrandLeg(legs[-1].end, legs[-1].end + seconds, course, door))
    if begin is not None and abs(float(wrap(headings[0] - begin))) > LEAST_TURN:
        add(course := still(0, begin, headings[0]), course.seconds)
    marks: list[tuple[int, Swing | None, Treads]] = [(i, s, ()) for s in swings if (i := s.stop(points)) is not None]
    for on in (on_stair(points, c) for c in climbs):
        marks += [(on[0][0], None, on[1:-1]), (on[-1][0], None, ())] if on else []
    marks = [(0, None, ()), *sorted(marks, key=lambda m: m[0]), (len(points) - 1, None, ())]
    walked = np.cumsum([0.0, *np.hypot(*np.diff(points[:, :2], axis=0).T)])
    for (first, swing, on), (last, *_) in pairwise(marks):
        if swing is not None:
            add(still(first, headings[first], headings[first]), DOOR_SECONDS, swing)
        if last > first:
            treads, part = [(float(walked[i] - walked[first]), z) for i, z in on], slice(first, last + 1)
            add(course := walk(limbs, points[part], headings[part], treads), course.seconds)
    if end is not None and abs(float(wrap(end - headings[-1]))) > LEAST_TURN:
        add(course := still(-1, headings[-1], end), course.seconds)
    return legs, [(x.door.door, x.begin, _past(x.door, legs[k + 1 :])) for k, x in enumerate(legs) if x.door]


def on_stair(points: np.ndarray, climb: Climb) -> Treads:
    """Places of feet on a stair that a way leads over; none on others."""
    apart = np.linalg.norm(points - np.array(climb)[:, None], axis=2)
    landed = dict(sorted(zip(apart.argmin(1).tolist(), (z for *_, z in climb))))
    return [*landed.items()] if apart[len(climb) // 2].min() < 1.0 else []


def _past(swing: Swing, legs: Sequence[ErrandLeg]) -> float:
    """Seconds at which who walks is past a leaf."""
    times = [(leg, t) for leg in legs for t in np.arange(leg.begin, leg.end, 0.1)]
    met = swing.meets(np.array([leg.place(t)[0] for leg, t in times]).reshape(-1, 3))
    return max((t for (_, t), m in zip(times, met) if m), default=legs[0].begin) + 0.2


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
