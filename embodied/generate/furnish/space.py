"""The space of one room: boxes that may not meet, walls to stand at, and the floor one walks on.

Everything that stands, hangs or must stay free in a room is an upright box. A plan of the floor in cells of 5 cm,
eroded by the radius of a walker, tells whether doors and furniture stay reachable when a box is added.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import shapely

from embodied.assets.records import Asset
from embodied.house.house import DOORS, House, Opening, Room, Stair
from embodied.house.shapes import HEADROOM, opening_of, under_slopes
from embodied.navigation.free_space import LOW

Params = tuple[tuple[str, str | float], ...]
"""Arguments for a built asset, (name, value)."""
WALK_CELL = 0.05
"""Side of a cell of the walking plan, metres."""
NARROW = 0.4
"""Narrowest gap that one still gets through sideways, metres."""
TOUCH = 1e-3
"""Boxes that overlap by less than this only touch, metres."""


@dataclass(frozen=True, slots=True)
class Box:
    """An upright box: centre (x, y), half sizes along its own axes, yaw, bottom and top, metres."""

    x: float
    y: float
    half_width: float
    half_depth: float
    yaw: float
    bottom: float
    top: float
    cos: float
    sin: float
    reach_x: float
    """Half sizes of the axis-aligned rectangle around it, metres."""
    reach_y: float
    square: bool
    """True if its sides run along the world's axes."""

    def corners(self, grow: float = 0.0) -> np.ndarray:
        """(4, 2) corners counter-clockwise, metres; `grow` widens it on all sides."""
        a, b = self.half_width + grow, self.half_depth + grow
        c, s = self.cos, self.sin
        return np.array(
            [(self.x + c * u - s * v, self.y + s * u + c * v) for u, v in ((-a, -b), (a, -b), (a, b), (-a, b))]
        )


def box(x: float, y: float, width: float, depth: float, yaw: float, bottom: float, top: float) -> Box:
    """The box of full `width` and `depth` at (x, y)."""
    c, s = math.cos(yaw), math.sin(yaw)
    square = min(abs(c), abs(s)) < 1e-6
    a, b = max(width / 2, 0.0), max(depth / 2, 0.0)
    return Box(x, y, a, b, yaw, bottom, top, c, s, abs(c) * a + abs(s) * b, abs(s) * a + abs(c) * b, square)


def overlap(p: Box, q: Box, gap: float = -TOUCH) -> bool:
    """True if two boxes come closer than `gap` (separating axes); a negative gap forgives touching, upwards, too."""
    touch = max(TOUCH, -gap)
    if p.bottom >= q.top - touch or q.bottom >= p.top - touch:
        return False
    dx, dy = q.x - p.x, q.y - p.y
    if abs(dx) >= p.reach_x + q.reach_x + gap or abs(dy) >= p.reach_y + q.reach_y + gap:
        return False
    if p.square and q.square:
        return True
    for a in (p, q):
        for ux, uy in ((a.cos, a.sin), (-a.sin, a.cos)):
            distance = abs(dx * ux + dy * uy)
            reach = gap
            for b in (p, q):
                reach += b.half_width * abs(b.cos * ux + b.sin * uy) + b.half_depth * abs(b.cos * uy - b.sin * ux)
            if distance >= reach:
                return False
    return True


def same_box(p: Box, q: Box) -> bool:
    """True if two boxes are the box of one thing."""
    return abs(p.x - q.x) < 1e-9 and abs(p.y - q.y) < 1e-9 and p.bottom == q.bottom and p.top == q.top


@dataclass(frozen=True)
class Wall:
    """One straight inner face of a room, seen from inside with the wall at the back.

    Positions on it are measured from `start` along `along`, metres.
    """

    start: tuple[float, float]
    along: tuple[float, float]
    inward: tuple[float, float]
    length: float
    openings: tuple[tuple[float, float, Opening], ...]
    """(from, to, opening) along the wall."""
    corners: tuple[bool, bool]
    """True if the room turns inwards (an ordinary corner) at its start and at its end."""

    @property
    def yaw(self) -> float:
        """Yaw of a thing that stands with its back to this wall."""
        return math.atan2(self.inward[1], self.inward[0]) + math.pi / 2

    def point(self, s: float, away: float = 0.0) -> tuple[float, float]:
        """World point at `s` along the wall and `away` from it, metres."""
        return (
            self.start[0] + s * self.along[0] + away * self.inward[0],
            self.start[1] + s * self.along[1] + away * self.inward[1],
        )

    def along_of(self, x: float, y: float) -> float:
        """How far along the wall a world point is, metres."""
        return (x - self.start[0]) * self.along[0] + (y - self.start[1]) * self.along[1]


@dataclass(frozen=True, eq=False)
class Thing:
    """An object that has found its place; becomes a Placement once it has an id."""

    asset: Asset
    x: float
    y: float
    z: float
    yaw: float
    size: tuple[float, float, float]
    params: Params = ()
    parent: Thing | None = None
    surface: str | None = None
    group: str | None = None
    role: str = ""
    wall: Wall | None = None

    @property
    def box(self) -> Box:
        """The upright box that it fills."""
        w, d, h = self.size
        return box(self.x, self.y, w, d, self.yaw, self.z, self.z + h)

    @property
    def front(self) -> tuple[float, float]:
        """Unit vector toward which its front looks."""
        return math.sin(self.yaw), -math.cos(self.yaw)

    def local(self, u: float, v: float) -> tuple[float, float]:
        """World point of (u, v) in its own frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return self.x + c * u - s * v, self.y + s * u + c * v


@dataclass(frozen=True, eq=False)
class RoomSpace:
    """A room and what is in it so far. It never changes: `holding` gives the room with more in it."""

    room: Room
    bottom: float
    """z of its floor, metres."""
    height: float
    polygon: shapely.Polygon
    ceiling: shapely.Geometry
    """`polygon`, without the opening of stairs that lead up and where it slopes."""
    walls: tuple[Wall, ...]
    entries: tuple[tuple[float, float], ...]
    """Spots where one stands after each door, metres."""
    keepouts: tuple[Box, ...]
    """Areas in which nothing may stand: door swings, approaches, the light of windows, stairs."""
    radius: float
    """Of the walker, metres."""
    walk: np.ndarray
    """(rows, columns) uint8, 1 where the walker's centre may be."""
    origin: tuple[float, float]
    grown: shapely.Polygon
    """`polygon`, a millimetre larger, prepared."""
    convex: bool
    rectangle: tuple[float, float, float, float] | None
    """x0, y0, x1, y1 of `grown` where it is a rectangle along the axes."""
    things: tuple[Thing, ...] = ()
    solids: tuple[Box, ...] = ()
    clearances: tuple[Box, ...] = ()

    @property
    def kind(self) -> str:
        """Of the room."""
        return self.room.kind

    @property
    def area(self) -> float:
        """Of the floor between the walls, square metres."""
        return self.polygon.area

    @property
    def longest_walls(self) -> list[Wall]:
        """The walls, the longest first."""
        return sorted(self.walls, key=lambda w: -w.length)

    def inside(self, b: Box) -> bool:
        """True if the box stays between the walls and under slopes, a millimetre forgiven."""
        if self.room.slopes and b.top > self.bottom + self.room.clear_height(self.height, b.corners()).min() + TOUCH:
            return False
        if self.rectangle is not None:
            x0, y0, x1, y1 = self.rectangle
            return x0 <= b.x - b.reach_x and b.x + b.reach_x <= x1 and y0 <= b.y - b.reach_y and b.y + b.reach_y <= y1
        return bool(shapely.contains_xy(self.grown, b.corners()).all()) and (
            self.convex or self.grown.covers(shapely.Polygon(b.corners()))
        )

    def fits(self, b: Box, *, ignore: Sequence[Box] = (), passage: bool = False, aside: bool = False) -> bool:
        """True if a solid may be put at `b`.

        Args:
          ignore: solids it may overlap (the table a chair is pushed under).
          passage: whether it may reach into keep-outs and clearances (a curtain, a rug).
          aside: whether it may reach into clearances (slippers).
        """
        if not self.inside(b) or b.top > self.bottom + self.height + TOUCH:
            return False
        if not passage and any(overlap(b, k) for k in self.keepouts):
            return False
        if any(overlap(b, other) and not any(other is i for i in ignore) for other in self.solids):
            return False
        return passage or aside or not any(overlap(b, c) for c in self.clearances)

    def walkable(self, added: Iterable[Box], reach: Iterable[tuple[float, float]]) -> np.ndarray | None:
        """The walking plan with `added` boxes in it, or None if it would cut the room apart.

        Every entry and every point of `reach` must lie in one connected part that holds nearly all of the free floor.
        """
        plan = self.walk.copy()
        for b in added:
            if self._in_the_way(b):
                cv2.fillConvexPoly(plan, self._cells(b.corners(self.radius - 0.02)), 0)
        cells = [self._cell(p) for p in (*self.entries, *reach)]
        if not cells:
            return plan
        _, labels, stats, _ = cv2.connectedComponentsWithStats(plan, connectivity=4)
        seen = {self._label(labels, c) for c in cells}
        if len(seen) != 1 or 0 in seen:
            return None
        free = stats[:, cv2.CC_STAT_AREA]
        return plan if free[seen.pop()] >= 0.88 * int(free[1:].sum()) else None

    def leaves_a_way_past(self, b: Box) -> bool:
        """True if someone `NARROW` wide still gets from every door to every other past the box `b`.

        What is hung last is asked this instead of `walkable`: cloth gives way where one would not put a chest.
        """
        if len(self.entries) < 2:
            return True
        radius = NARROW / 2
        plan = _free_cells(self.polygon, radius, self.walk.shape, self.origin)
        for solid in (*self.solids, b):
            if self._in_the_way(solid):
                cv2.fillConvexPoly(plan, self._cells(solid.corners(radius - 0.02)), 0)
        _, labels = cv2.connectedComponents(plan, connectivity=4)
        seen = {self._label(labels, self._cell(p)) for p in self.entries}
        return len(seen) == 1 and 0 not in seen

    def taken(self, b: Box) -> float:
        """How much of the floor that one can walk on `b` would take, square metres."""
        plan = self.without_floor(b, self.radius).walk
        return float(int(self.walk.sum()) - int(plan.sum())) * WALK_CELL**2

    def holding(
        self,
        things: Iterable[Thing],
        solids: Iterable[Box],
        clearances: Iterable[Box] = (),
        walk: np.ndarray | None = None,
    ) -> RoomSpace:
        """The room with these things in it, too, and the boxes that they fill and that must stay clear for them."""
        return replace(
            self,
            things=(*self.things, *things),
            solids=(*self.solids, *solids),
            clearances=(*self.clearances, *clearances),
            walk=self.walk if walk is None else walk,
        )

    def without_floor(self, b: Box, grow: float) -> RoomSpace:
        """The room where nobody walks within `grow` metres of a box."""
        walk = self.walk.copy()
        cv2.fillConvexPoly(walk, self._cells(b.corners(grow)), 0)
        return replace(self, walk=walk)

    def _in_the_way(self, b: Box) -> bool:
        return b.bottom - self.bottom < 1.9 and b.top - self.bottom > LOW

    def _cells(self, points: np.ndarray) -> np.ndarray:
        return np.rint((points - self.origin) / WALK_CELL).astype(np.int32)

    def _cell(self, point: tuple[float, float]) -> tuple[int, int]:
        row = round((point[1] - self.origin[1]) / WALK_CELL)
        column = round((point[0] - self.origin[0]) / WALK_CELL)
        rows, columns = self.walk.shape
        return min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)

    @staticmethod
    def _label(labels: np.ndarray, cell: tuple[int, int]) -> int:
        """The free part that contains the cell or one of its close neighbours, else 0."""
        r, c = cell
        return int(labels[r, c]) or int(labels[max(r - 2, 0) : r + 3, max(c - 2, 0) : c + 3].max(initial=0))


def room_space(house: House, room: Room) -> RoomSpace:
    """The empty space of `room`."""
    storey = house.storey_of(room)
    floor = shapely.remove_repeated_points(house.floor(room).simplify(1e-4))
    floor = shapely.orient_polygons(floor)
    openings = tuple(o for o in house.openings if room.id in o.rooms and o.kind != "roof_window")
    walls = _walls(floor, openings, house.inner_wall)
    x0, y0, x1, y1 = floor.bounds
    roomy = floor.area > 6.5 and min(x1 - x0, y1 - y0) > 2.75
    radius = 0.3 if roomy else 0.25 if floor.area > 4.0 else 0.2
    keepouts: list[Box] = []
    entries: list[tuple[float, float]] = []
    for wall in walls:
        for s0, s1, o in wall.openings:
            keepouts.extend(_opening_keepouts(wall, s0, s1, o, room, storey.elevation, floor.area))
            if o.kind in DOORS:
                entries.append(wall.point((s0 + s1) / 2, radius + 0.1))
    wells = [opening_of(s) for s in house.stairs if s.rooms[0] == room.id] + under_slopes(room, storey.height)
    standing = floor.difference(shapely.union_all(under_slopes(room, HEADROOM))) if room.slopes else floor
    flights = [
        b
        for stair in house.stairs
        if room.id in stair.rooms
        for b in _stair_keepouts(stair, stair.rooms[1] == room.id, storey.elevation, storey.height)
    ]
    origin = (x0 - WALK_CELL, y0 - WALK_CELL)
    shape = (int((y1 - y0) / WALK_CELL) + 3, int((x1 - x0) / WALK_CELL) + 3)
    grown = floor.buffer(TOUCH, join_style="mitre")
    shapely.prepare(grown)
    space = RoomSpace(
        room=room,
        bottom=storey.elevation,
        height=storey.height,
        polygon=floor,
        ceiling=floor.difference(shapely.union_all(wells)) if wells else floor,
        walls=walls,
        entries=tuple(entries),
        keepouts=(*keepouts, *flights),
        radius=radius,
        walk=_free_cells(standing, radius, shape, origin),
        origin=origin,
        grown=grown,
        convex=floor.convex_hull.area - floor.area < 1e-4,
        rectangle=grown.bounds if (x1 - x0) * (y1 - y0) - floor.area < 1e-4 else None,
    )
    leaves = (
        _leaf(wall, s0, s1, o)
        for wall in walls
        for s0, s1, o in wall.openings
        if o.rooms[0] == room.id and o.angle > 0.5 and o.kind in ("door", "front_door", "back_door")
    )
    for leaf in leaves:
        shut = space.without_floor(leaf, radius - 0.05)
        if space.walkable((), ()) is not None and shut.walkable((), ()) is not None:
            space = shut
    for b in flights:
        if b.top - storey.elevation > 2.3:
            space = space.without_floor(b, radius - 0.02)
    return space


def _free_cells(
    floor: shapely.Polygon, radius: float, shape: tuple[int, ...], origin: tuple[float, float]
) -> np.ndarray:
    """(rows, columns) uint8, 1 where the walls let a walker's centre be."""
    plan = np.zeros(shape, np.uint8)
    eroded = floor.buffer(-(radius - 0.02), join_style="mitre")
    for part in getattr(eroded, "geoms", (eroded,)):
        if not part.is_empty:
            ring = np.asarray(part.exterior.coords)[:-1]
            cv2.fillPoly(plan, [np.rint((ring - origin) / WALK_CELL).astype(np.int32)], 1)
    return plan


def _walls(floor: shapely.Polygon, openings: Sequence[Opening], thickness: float) -> tuple[Wall, ...]:
    ring = np.asarray(floor.exterior.coords)[:-1]
    n = len(ring)
    steps = np.roll(ring, -1, axis=0) - ring
    lengths = np.hypot(*steps.T)
    units = steps / lengths[:, None]
    lefts = [bool(units[i - 1][0] * units[i][1] - units[i - 1][1] * units[i][0] > 0) for i in range(n)]  # of corners
    walls = []
    for i in range(n):
        along, inward = units[i], np.array([-units[i][1], units[i][0]])
        holes = []
        for o in openings:
            a, b = np.asarray(o.a) - ring[i], np.asarray(o.b) - ring[i]
            if abs(a @ inward + thickness / 2) > 0.02 or abs(b @ inward + thickness / 2) > 0.02:
                continue
            s0, s1 = sorted((float(a @ along), float(b @ along)))
            if s1 >= 0 and s0 <= lengths[i]:
                holes.append((s0, s1, o))
        holes.sort(key=lambda f: (f[0], f[2].id))
        walls.append(
            Wall(
                start=(float(ring[i][0]), float(ring[i][1])),
                along=(float(along[0]), float(along[1])),
                inward=(float(inward[0]), float(inward[1])),
                length=float(lengths[i]),
                openings=tuple(holes),
                corners=(lefts[i], lefts[(i + 1) % n]),
            )
        )
    return tuple(walls)


def _opening_keepouts(wall: Wall, s0: float, s1: float, o: Opening, room: Room, z: float, area: float) -> list[Box]:
    """Boxes that stay free: before a door its approach and swing, before a window its light."""
    width = s1 - s0
    yaw = math.atan2(wall.along[1], wall.along[0])

    def before(from_: float, to: float, depth: float, bottom: float, top: float) -> Box:
        x, y = wall.point((from_ + to) / 2, depth / 2)
        return box(x, y, to - from_, depth, yaw, z + bottom, z + top)

    if o.kind == "window":
        return [before(s0 - 0.05, s1 + 0.05, 0.3, o.sill, o.head)]
    swings_here = o.rooms[0] == room.id and o.kind in ("door", "front_door", "back_door")
    usual = {"passage": 0.6 if area > 9.0 else 0.4, "french_window": 0.6, "garage_door": 1.2, "front_door": 1.0}
    depth = usual.get(o.kind, 0.6 if area > 3.0 else 0.4)
    if swings_here:
        depth = max(depth, width + 0.05)
    boxes = [before(s0 - 0.1, s1 + 0.1, depth, 0.0, o.head + 0.08)]
    if swings_here and o.angle > 0.6 * math.pi:  # folded back against the wall beside the door
        leaf = _leaf(wall, s0, s1, o)
        boxes.append(box(leaf.x, leaf.y, width, 0.12, leaf.yaw, z, z + o.head))
    return boxes


def _leaf(wall: Wall, s0: float, s1: float, o: Opening) -> Box:
    """The open leaf of a door that swings into the room."""
    at = wall.along_of(*(o.a if o.hinge == "a" else o.b))
    width, sign = s1 - s0, 1.0 if abs(at - s0) < abs(at - s1) else -1.0
    u, v = sign * math.cos(o.angle), math.sin(o.angle)
    dx, dy = u * wall.along[0] + v * wall.inward[0], u * wall.along[1] + v * wall.inward[1]
    x, y = wall.point(s0 if sign > 0 else s1)
    return box(x + dx * width / 2, y + dy * width / 2, width, 0.05, math.atan2(dy, dx), 0.0, 2.0)


def _stair_keepouts(stair: Stair, upstairs: bool, z: float, height: float) -> list[Box]:
    boxes, path = [], stair.path
    for ring in (stair.well, stair.void if upstairs else ()):
        if len(ring) != 4:  # else with what lies between two flights
            continue
        (x0, y0), (x1, y1) = np.min(ring, axis=0), np.max(ring, axis=0)
        boxes.append(box((x0 + x1) / 2, (y0 + y1) / 2, x1 - x0, y1 - y0, 0.0, z, z + height))
    for (ax, ay, az), (bx, by, bz) in itertools.pairwise(path):
        length = math.hypot(bx - ax, by - ay)
        if length < 1e-6:
            continue
        yaw, length = math.atan2(by - ay, bx - ax), length + stair.width * (az == bz)  # all of a landing
        boxes.append(box((ax + bx) / 2, (ay + by) / 2, length, stair.width + 0.06, yaw, z, z + height))
    for end, next_ in ((path[0], path[1]), (path[-1], path[-2])):
        length = math.hypot(next_[0] - end[0], next_[1] - end[1]) or 1.0
        ux, uy = (end[0] - next_[0]) / length, (end[1] - next_[1]) / length
        boxes.append(box(end[0] + 0.45 * ux, end[1] + 0.45 * uy, 0.9, stair.width, math.atan2(uy, ux), z, z + 2.1))
    return boxes
