"""Scores of places for a group: the words of Group.likes, each a number for a pose."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from embodied.generate.furnish.arrange import Item
    from embodied.generate.furnish.context import Context
    from embodied.generate.furnish.space import RoomSpace, Thing, Wall

WINDOWS = ("window", "french_window")
TALL = 0.95
"""Higher things stand in the light of windows, metres."""


@dataclass(frozen=True)
class CandidateSpot:
    """A pose at which a group might go."""

    ctx: Context
    x: float
    """Of a point 0.4 m before the wall, or of the group's middle on the floor."""
    y: float
    yaw: float
    wall: Wall | None
    s: float
    """Along the wall, metres."""
    width: float
    """Of the group, metres."""
    first: Item
    near: Sequence[Thing]
    distance: float
    """From the wall to the back of what faces the first part, or to what is near if it is ahead of that, metres."""


def at_corner(wall: Wall, s: float, width: float) -> float:
    """1 where a thing `width` wide at `s` stands in a corner, else 0."""
    near_start = s - width / 2 < 0.06 and wall.corners[0]
    near_end = wall.length - s - width / 2 < 0.06 and wall.corners[1]
    return float(near_start or near_end)


def at_window(wall: Wall, s: float, width: float) -> float:
    """How much of the width is before a window, 0 to 1."""
    spans = [(s0, s1) for s0, s1, o in wall.openings if o.kind in WINDOWS]
    return sum(max(0.0, min(s + width / 2, s1) - max(s - width / 2, s0)) for s0, s1 in spans) / width


def centred(wall: Wall, s: float) -> float:
    """1 in the middle of the free stretch (between doors and corners) around `s`, 0 at its ends."""
    a, b = free_stretch(wall, s)
    return 1.0 - abs(2 * s - a - b) / max(b - a, 1e-6)


def free_stretch(wall: Wall, s: float, windows: bool = False) -> tuple[float, float]:
    """The stretch of wall around `s` free of doors (and of windows if asked), metres."""
    a, b = 0.0, wall.length
    for s0, s1, o in wall.openings:
        if o.kind == "window" and not windows:
            continue
        if s1 <= s:
            a = max(a, s1)
        elif s0 >= s:
            b = min(b, s0)
        else:
            return s, s
    return a, b


def has_window(wall: Wall) -> bool:
    """True if light falls in through it."""
    return any(o.kind in WINDOWS for _, _, o in wall.openings)


def depth_before(space: RoomSpace, wall: Wall, s: float) -> float:
    """Distance from the wall at `s` straight across to the opposite wall, metres."""
    px, py = wall.point(s)
    ix, iy = wall.inward
    best = 99.0
    for other in space.walls:
        nx, ny = other.inward
        against = ix * nx + iy * ny
        if against > -1e-6:
            continue
        t = ((other.start[0] - px) * nx + (other.start[1] - py) * ny) / against
        hx, hy = px + t * ix - other.start[0], py + t * iy - other.start[1]
        if t > 1e-3 and -1e-3 <= (hx * other.along[0] + hy * other.along[1]) <= other.length + 1e-3:
            best = min(best, t)
    return best


def door_distance(space: RoomSpace, x: float, y: float) -> float:
    """Distance to the nearest entry, metres."""
    return min((math.hypot(x - ex, y - ey) for ex, ey in space.entries), default=9.0)


def window_distance(space: RoomSpace, x: float, y: float) -> float:
    """Distance to the middle of the nearest window, metres."""
    middles = (w.point((s0 + s1) / 2) for w in space.walls for s0, s1, o in w.openings if o.kind in WINDOWS)
    return min((math.hypot(x - wx, y - wy) for wx, wy in middles), default=3.0)


def nearest(x: float, y: float, things: Sequence[Thing]) -> float:
    """Distance to the middle of the nearest of the things, metres."""
    return min((math.hypot(x - t.x, y - t.y) for t in things), default=0.0)


def _across(p: CandidateSpot) -> float:
    """1 where what faces the first part has its back at the opposite wall, -2 where there is no room for it."""
    depth = depth_before(p.ctx.space, p.wall, p.s) if p.wall else p.distance
    return 1.0 if abs(depth - 0.04 - p.distance) < 0.03 else -2.0 if depth < p.distance - 0.02 else 0.0


def _facing_door(p: CandidateSpot) -> float:
    """How many doors are opposite."""
    wall = p.wall
    if wall is None:
        return 0.0
    opposite = (
        w.point((s0 + s1) / 2)
        for w in p.ctx.space.walls
        for s0, s1, o in w.openings
        if o.kind != "window" and w.inward[0] * wall.inward[0] + w.inward[1] * wall.inward[1] < -0.9
    )
    return float(sum(abs(wall.along_of(x, y) - p.s) < p.first.extent[0] / 2 + 0.4 for x, y in opposite))


def _neighbour(p: CandidateSpot) -> float:
    """1 right beside a thing of the same name."""
    same = p.ctx.called(p.first.role)
    gaps = (math.hypot(p.x - t.x, p.y - t.y) - (t.size[0] + p.width) / 2 for t in same)
    return float(any(gap < 0.15 for gap in gaps))


def _long(p: CandidateSpot) -> float:
    x0, y0, x1, y1 = p.ctx.space.polygon.bounds
    return float((x1 - x0 >= y1 - y0) == (abs(math.cos(p.yaw)) > 0.5))


def _middle(p: CandidateSpot) -> float:
    x0, y0, x1, y1 = p.ctx.space.polygon.bounds
    return -math.hypot(p.x - (x0 + x1) / 2, p.y - (y0 + y1) / 2)


def _ahead(p: CandidateSpot) -> float:
    """0 where the group is `distance` before the middle of what is near, less elsewhere."""
    n, (fx, fy) = len(p.near), p.near[0].front
    dx, dy = p.x - sum(t.x for t in p.near) / n, p.y - sum(t.y for t in p.near) / n
    return -abs(dx * fx + dy * fy - p.distance) - 0.5 * abs(dy * fx - dx * fy)


LIKES: Mapping[str, Callable[[CandidateSpot], float]] = {
    "corner": lambda p: at_corner(p.wall, p.s, p.width) if p.wall else 0.0,
    "centre": lambda p: centred(p.wall, p.s) if p.wall else 0.0,
    "window": lambda p: at_window(p.wall, p.s, p.width) if p.wall else 0.0,
    "shade": lambda p: at_window(p.wall, p.s, p.width) if p.wall and p.first.extent[2] >= TALL else 0.0,
    "window_wall": lambda p: float(p.wall is not None and has_window(p.wall)),
    "door": lambda p: float(p.wall is not None and any(o.kind != "window" for _, _, o in p.wall.openings)),
    "near": lambda p: -nearest(p.x, p.y, p.near),
    "near_window": lambda p: -window_distance(p.ctx.space, p.x, p.y),
    "near_door": lambda p: -door_distance(p.ctx.space, p.x, p.y),
    "far_from_door": lambda p: min(door_distance(p.ctx.space, p.x, p.y), 2.0),
    "neighbour": _neighbour,
    "across": _across,
    "room_before": lambda p: (
        min(depth_before(p.ctx.space, p.wall, p.s) - p.first.extent[1], 1.2) if p.wall is not None else 0.0
    ),
    "facing_door": _facing_door,
    "ahead": _ahead,
    "middle": _middle,
    "long": _long,
    "noise": lambda p: float(p.ctx.rng.random()),
}
"""The words of Group.likes."""
