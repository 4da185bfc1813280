"""Which rooms, and which directions in them, can be seen from a point: looking through doors and windows.

Everything errs on the safe side (furniture, wall thickness, lintels and closed doors hide nothing), so
what is left out is never missed.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from embodied.geometry import TWO_PI
from embodied.house.house import House
from embodied.house.shapes import inward, room_at

OUTDOORS = ""
BESIDE_OPENING = 0.25
"""Closer than this to an opening, in metres, one sees all around through it."""
MARGIN = 1e-3
"""Added to both ends of a field of view, radians: pixels at the edge."""
MOST_OPENINGS = 16
"""Openings looked through one behind another before the search calls everything behind visible."""

FRAME = 0.02
"""Added above and below an opening, metres."""
Point = tuple[float, float]
Eye = tuple[float, float, float]


class Sector(NamedTuple):
    """Directions from a point."""

    low: float
    high: float
    """Radians counter-clockwise; high - low is at most 2 pi."""
    bottom: float = -math.inf
    top: float = math.inf
    """Metres up per metre ahead."""


FULL = Sector(-math.pi, math.pi)


@dataclass(frozen=True, eq=False)
class Passage:
    """An opening as seen from inside the room `leaves`."""

    opening: str
    leaves: str
    enters: str
    a: Point
    b: Point
    """Jambs, metres."""
    normal: Point
    """Unit, out of the room `leaves`."""
    width: float
    bottom: float
    top: float
    """Metres; the heights in the world."""


@dataclass(frozen=True, eq=False)
class Portals:
    """The openings of a house by the room that one looks out of; OUTDOORS is a room too."""

    of_room: Mapping[str, tuple[Passage, ...]]
    stairs: Mapping[str, tuple[str, ...]]
    """Rooms joined to a room by a staircase, and the outdoors over its roof windows: seen together with it."""


def portals_of(house: House) -> Portals:
    """All openings of `house`, each once per side."""
    of_room: dict[str, list[Passage]] = {name: [] for name in (*(r.id for r in house.rooms), OUTDOORS)}
    beside: dict[str, list[str]] = {r.id: [] for r in house.rooms}
    for o in house.openings:
        (ax, ay), (bx, by) = o.a, o.b
        a, b, width = (float(ax), float(ay)), (float(bx), float(by)), math.hypot(bx - ax, by - ay)
        x, y = (float(v) for v in inward(house, o))
        first, second = o.rooms[0], o.rooms[1] or OUTDOORS
        floor = house.storey_of(house.room_by_id[first]).elevation
        tall = floor + o.sill - FRAME, floor + o.head + FRAME
        if o.kind == "roof_window":
            beside[first].append(OUTDOORS)
        of_room[first].append(Passage(o.id, first, second, a, b, (-x, -y), width, *tall))
        of_room[second].append(Passage(o.id, second, first, a, b, (x, y), width, *tall))
    for s in house.stairs:
        beside[s.rooms[0]].append(s.rooms[1])
        beside[s.rooms[1]].append(s.rooms[0])
    return Portals({k: tuple(v) for k, v in of_room.items()}, {k: tuple(v) for k, v in beside.items()})


def visible_rooms(
    house: House, portals: Portals, position: Sequence[float] | np.ndarray, sector: Sector = FULL
) -> dict[str, list[Sector]] | None:
    """Rooms that may be seen from `position`, each with the directions in which it may be seen.

    Args:
      sector: where one looks.

    Returns:
      Room id (OUTDOORS for the outside) to sectors; None when the point is in no room: see all.
    """
    start = room_at(house, position)
    if start is None:
        return None
    seen: dict[str, list[Sector]] = {}
    x, y, z = position
    complete = _look(portals, (float(x), float(y), float(z)), start, sector, (), seen)
    return seen if complete else None


def _look(
    portals: Portals, eye: Eye, room: str, sector: Sector, path: tuple[str, ...], seen: dict[str, list[Sector]]
) -> bool:
    low, high, bottom, top = sector
    if any(s[0] <= low and high <= s[1] and s[2] <= bottom and top <= s[3] for s in seen.get(room, ())):
        return True
    seen.setdefault(room, []).append(sector)
    if len(path) > MOST_OPENINGS:
        return False
    for portal in portals.of_room[room]:
        if portal.opening in path:
            continue
        for part in _through(eye, portal, sector):
            if not _look(portals, eye, portal.enters, part, (*path, portal.opening), seen):
                return False
    return all(_look(portals, eye, other, FULL, path, seen) for other in portals.stairs.get(room, ()))


def _through(eye: Eye, portal: Passage, sector: Sector) -> list[Sector]:
    """The parts of `sector` that go out through `portal`; in plain numbers, which for so few are ten times as fast."""
    ax, ay = portal.a[0] - eye[0], portal.a[1] - eye[1]
    bx, by = portal.b[0] - eye[0], portal.b[1] - eye[1]
    away = ax * portal.normal[0] + ay * portal.normal[1]
    ux, uy = (bx - ax) / portal.width, (by - ay) / portal.width
    reach = min(max(-(ax * ux + ay * uy), 0.0), portal.width)
    nearest, farthest = math.hypot(ax + reach * ux, ay + reach * uy), math.hypot(ax, ay)
    if nearest < BESIDE_OPENING:
        return [sector]
    if away < 0:
        return []
    first, second = math.atan2(ay, ax), math.atan2(by, bx)
    low, width = first, (second - first) % TWO_PI
    if width > math.pi:
        low, width = second, TWO_PI - width
    farthest = max(farthest, math.hypot(bx, by))
    below, above = portal.bottom - eye[2], portal.top - eye[2]
    bottom, top = below / (nearest if below < 0 else farthest), above / (nearest if above > 0 else farthest)
    return overlap(sector, Sector(low, low + width, bottom, top))


def sector_of(forward: np.ndarray, right: np.ndarray, up: np.ndarray, wide: float, tall: float) -> Sector:
    """The compass directions of everything in a field of view; all where straight up or down is in it.

    Args:
      forward, right, up: (3,) the axes of who looks, of length 1.
      wide, tall: tangents of half the horizontal and half the vertical field of view.
    """
    if abs(forward[2]) > 0 and abs(right[2]) <= wide * abs(forward[2]) and abs(up[2]) <= tall * abs(forward[2]):
        return FULL
    corners = [forward + i * wide * right + j * tall * up for i in (-1, 1) for j in (-1, 1)]
    middle = math.atan2(forward[1], forward[0])
    off = [(math.atan2(c[1], c[0]) - middle + math.pi) % TWO_PI - math.pi for c in corners]
    return Sector(middle + min(off) - MARGIN, middle + max(off) + MARGIN)


def overlap(one: Sector, other: Sector) -> list[Sector]:
    """Intersection of two sectors, as none, one or two sectors."""
    bottom, top = max(one.bottom, other.bottom), min(one.top, other.top)
    shared = []
    for turn in (-TWO_PI, 0.0, TWO_PI):
        low, high = max(one.low, other.low + turn), min(one.high, other.high + turn)
        if high > low and top > bottom:
            shared.append(Sector(low, high, bottom, top))
    return shared


@dataclass(frozen=True, eq=False)
class Spans:
    """The directions in which boxes along the world's axes lie from a point. (n,) arrays."""

    middle: np.ndarray
    half: np.ndarray
    """Radians: the compass directions middle - half to middle + half."""
    bottom: np.ndarray
    top: np.ndarray
    """Metres up per metre ahead."""

    def within(self, sectors: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """(k,) bool: which of the `chosen` (k,) boxes reach into their `sectors` (k, 4)."""
        low, high, lowest, highest = sectors.T
        off = np.abs((self.middle[chosen] - (low + high) / 2 + np.pi) % TWO_PI - np.pi)
        beside = off <= (high - low) / 2 + self.half[chosen] + MARGIN
        return beside & (self.top[chosen] >= lowest) & (self.bottom[chosen] <= highest)


def spans_of(eye: np.ndarray, middles: np.ndarray, reaches: np.ndarray) -> Spans:
    """Places of boxes.

    Args:
      eye: (3,) metres.
      middles, reaches: (n, 3) metres, of the boxes and half their sizes.
    """
    (x, y, z), (rx, ry, rz) = (middles - eye).T, reaches.T
    middle = np.arctan2(y, x)
    corners = [np.arctan2(y + j * ry, x + i * rx) - middle for i in (-1, 1) for j in (-1, 1)]
    off = (np.array(corners) + np.pi) % TWO_PI - np.pi
    low, high = off.min(0), off.max(0)
    around = (np.abs(x) <= rx) & (np.abs(y) <= ry)
    near = np.maximum(np.hypot(np.maximum(np.abs(x) - rx, 0), np.maximum(np.abs(y) - ry, 0)), 1e-9)
    far = np.maximum(np.hypot(np.abs(x) + rx, np.abs(y) + ry), 1e-9)
    below, above = z - rz, z + rz
    return Spans(
        middle + (low + high) / 2,
        np.where(around, np.pi, (high - low) / 2),
        below / np.where(below < 0, near, far),
        above / np.where(above > 0, near, far),
    )
