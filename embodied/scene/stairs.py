"""Stairs: flights and landings, closed below where nothing lies beneath, railings, and the edges of the well."""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from embodied.assets.built.primitives import Shape, bar, box, extruded, part, quads
from embodied.assets.records import Finish
from embodied.house.house import House, Stair
from embodied.house.shapes import opening_of
from embodied.scene.collision import CollisionBox
from embodied.scene.part import Part

TREAD, NOSING, BELOW = 0.035, 0.025, 0.15
"""Thickness of a tread, how far it reaches over its riser, and how far below the riser's foot the underside of a flight
is that has nothing beneath, metres."""
RAIL, BALUSTERS, ASIDE = 0.92, 0.11, 0.035
"""Height of a railing above floor or pitch line, distance of its balusters, and its own from the edge, metres."""
IRON = Finish(color=(0.08, 0.08, 0.085, 1.0), roughness=0.45)


@dataclass(frozen=True)
class Flight:
    """Steps between two levels, straight along `yaw` from `start`."""

    start: np.ndarray
    """(3,) metres, world: where the lowest riser stands."""
    yaw: float
    risers: int
    going: float
    rise: float
    width: float

    def at(self, along: float, side: float, z: float = 0.0) -> np.ndarray:
        """(3,) the point so far along the flight, to its left, and above its foot."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return self.start + [along * c - side * s, along * s + side * c, z]

    @property
    def length(self) -> float:
        """Metres in the plan, from the first riser to the last."""
        return (self.risers - 1) * self.going


def flights_of(stair: Stair) -> list[Flight]:
    """The flights of a stair from its foot up."""
    rise = (stair.path[-1][2] - stair.path[0][2]) / stair.risers
    flights = []
    for a, b in itertools.pairwise(np.asarray(stair.path, float)):
        if b[2] - a[2] > 1e-6:
            n, (x, y) = max(2, round((b[2] - a[2]) / rise)), (b - a)[:2]
            flights.append(Flight(a, float(np.arctan2(y, x)), n, float(np.hypot(x, y)) / (n - 1), rise, stair.width))
    return flights


def landings_of(stair: Stair) -> list[tuple[shapely.Polygon, float]]:
    """The landings between flights with their heights, metres, world."""
    levels = [list(points) for _, points in itertools.groupby(stair.path, lambda p: round(p[2], 3))]
    lines = [(shapely.LineString([p[:2] for p in level]), level[0][2]) for level in levels if len(level) > 1]
    return [(line.buffer(stair.width / 2, cap_style="flat", join_style="mitre"), z) for line, z in lines]


def _base(house: House, stair: Stair) -> float | None:
    """Height of the floor down to which a stair is closed; None where another stair lies beneath it."""
    stacked = any(s.rooms[1] == stair.rooms[0] for s in house.stairs)
    return None if stacked else house.storey_of(house.room_by_id[stair.rooms[0]]).elevation


def stair_parts(house: House, stair: Stair, finish: Callable[[str], Finish]) -> list[Part]:
    """Treads, risers, sides, landings, railings, and the edges of the well."""
    room, upper = (house.room_by_id[r] for r in stair.rooms)
    wood, base = finish("oak/0"), _base(house, stair)
    treads: list[Shape] = []
    faces: list[np.ndarray] = []
    for f in flights_of(stair):
        for k in range(f.risers - 1):
            low, high = (k * f.going - NOSING, (k + 1) * f.rise - TREAD), ((k + 1) * f.going, (k + 1) * f.rise)
            tread = box([low[0], -f.width / 2, low[1]], [high[0], f.width / 2, high[1]], 0.006)
            treads.append(tread.turned(f.yaw).moved(*f.start))
        faces += _faces(house, stair, f, base)
    for polygon, z in landings_of(stair):
        treads.append(extruded(polygon, z - (TREAD if base is not None else BELOW), z))
        if base is not None:
            faces += [_upright(q, p, base, z - TREAD) for p, q in _open_edges(house, stair, polygon)]
    ceiling, floor = house.storey_of(room).elevation + house.storey_of(room).height, house.storey_of(upper).elevation
    ring = np.asarray(shapely.geometry.polygon.orient(opening_of(stair)).exterior.coords)
    edges = part(finish(room.wall_finish), quads([_upright(b, a, ceiling, floor) for a, b in itertools.pairwise(ring)]))
    rails = [_rail(a, b) for a, b in railings(house, stair)]
    meshes = {
        "": part(wood, *treads),
        "#sides": part(finish("paint_white/0"), quads(np.asarray(faces))),
        "#well": edges,
        "#rails": part(wood, *(s for r in rails for s in r[0])) if rails else None,
        "#balusters": part(IRON, *(s for r in rails for s in r[1])) if rails else None,
    }
    owner = f"{stair.id}/stairs"
    return [Part(owner, "opening", room.id, mesh, owner + tag) for tag, mesh in meshes.items() if mesh is not None]


def _upright(p: np.ndarray, q: np.ndarray, z0: float, z1: float) -> np.ndarray:
    """(4, 3) the upright rectangle over p-q that looks to the right of the way from p to q."""
    return np.array([(*p[:2], z0), (*q[:2], z0), (*q[:2], z1), (*p[:2], z1)])


def _faces(house: House, stair: Stair, f: Flight, base: float | None) -> Iterator[np.ndarray]:
    """(4, 3) each: the risers, the open sides, the underside or the back of what is closed down to `base`."""
    w, open_sides = f.width / 2, _open_sides(house, stair, f)
    last = abs(f.start[2] + f.risers * f.rise - stair.path[-1][2]) < 1e-3
    bottom = lambda k: k * f.rise - BELOW if base is None else base - f.start[2]
    for k in range(f.risers - last):
        x, z0, z1 = k * f.going, k * f.rise, (k + 1) * f.rise - TREAD
        yield np.array([f.at(x, w, z0), f.at(x, -w, z0), f.at(x, -w, z1), f.at(x, w, z1)])
        if k + 1 == f.risers:
            continue
        x1, low = x + f.going, bottom(k)
        for s in (side * w for side in open_sides):
            a, b = (x, x1) if s < 0 else (x1, x)
            yield np.array([f.at(a, s, low), f.at(b, s, low), f.at(b, s, z1), f.at(a, s, z1)])
        if base is None:  # a step's underside, and the step down from the next one's
            yield np.array([f.at(x, w, low), f.at(x1, w, low), f.at(x1, -w, low), f.at(x, -w, low)])
            yield np.array([f.at(x1, -w, low), f.at(x1, w, low), f.at(x1, w, low + f.rise), f.at(x1, -w, low + f.rise)])
    if last and base is not None:
        x, low, z1 = f.length, bottom(0), (f.risers - 1) * f.rise - TREAD
        yield np.array([f.at(x, -w, low), f.at(x, w, low), f.at(x, w, z1), f.at(x, -w, z1)])


def _open_sides(house: House, stair: Stair, f: Flight) -> list[int]:
    """-1 for the right side, 1 for the left: those beside which there is no wall."""
    floor = house.floor(house.room_by_id[stair.rooms[0]])
    beside = lambda side: shapely.Point(f.at(f.length / 2, side * (f.width / 2 + 0.06))[:2])
    return [side for side in (-1, 1) if floor.contains(beside(side))]


def _open_edges(house: House, stair: Stair, polygon: shapely.Polygon) -> list[tuple[np.ndarray, np.ndarray]]:
    """The edges of a landing, counter-clockwise, along which there is neither wall nor flight."""
    ends = [
        shapely.LineString([f.at(x, f.width / 2)[:2], f.at(x, -f.width / 2)[:2]]).buffer(ASIDE + 0.02, cap_style="flat")
        for f in flights_of(stair)
        for x in (0.0, f.length)
    ]
    inside = house.floor(house.room_by_id[stair.rooms[0]]).buffer(-ASIDE - 0.02)
    return _pieces(polygon, inside, shapely.union_all(ends))


def _pieces(
    polygon: shapely.Polygon, inside: shapely.Geometry, without: shapely.Geometry
) -> list[tuple[np.ndarray, np.ndarray]]:
    """The parts of a polygon's edges, counter-clockwise, that lie inside one shape and not in another."""
    pieces = []
    ring = np.asarray(shapely.geometry.polygon.orient(polygon).exterior.coords)
    for a, b in itertools.pairwise(ring):
        for line in shapely.get_parts(shapely.LineString([a, b]).intersection(inside).difference(without)):
            if line.length > 0.06:
                p, q = np.asarray(line.coords)[[0, -1]]
                pieces.append((p, q) if (q - p) @ (b - a) > 0 else (q, p))
    return pieces


def railings(house: House, stair: Stair) -> list[tuple[np.ndarray, np.ndarray]]:
    """(3,) and (3,): the lines at floor or pitch height that are railed: open sides of flights, edges of landings, and
    the edge of the well upstairs save where one arrives."""
    lines: list[tuple] = []
    for f in flights_of(stair):
        for s in (side * (f.width / 2 - ASIDE) for side in _open_sides(house, stair, f)):
            lines.append((f.at(0.0, s, f.rise), f.at(f.length, s, f.risers * f.rise)))
    for polygon, z in landings_of(stair):
        lines += [((*p, z), (*q, z)) for p, q in _open_edges(house, stair, polygon.buffer(-ASIDE, join_style="mitre"))]
    upper, head = house.room_by_id[stair.rooms[1]], flights_of(stair)[-1]
    arriving = [head.at(head.length + x, 0.0)[:2] for x in (-0.1, 0.1)]
    inside, z = house.floor(upper).buffer(-0.02), house.storey_of(upper).elevation
    gap = shapely.LineString(arriving).buffer(stair.width / 2, cap_style="flat")
    lines += [((*p, z), (*q, z)) for p, q in _pieces(opening_of(stair).buffer(ASIDE, join_style="mitre"), inside, gap)]
    return [(np.asarray(p, float), np.asarray(q, float)) for p, q in lines]


def _rail(p: np.ndarray, q: np.ndarray) -> tuple[list[Shape], list[Shape]]:
    """Handrail and posts, and the balusters of a railing from p to q."""
    up, posts, bars = np.array([0, 0, RAIL]), [], []
    for x, y, z in (p, q):
        posts.append(box([x - 0.03, y - 0.03, z - 0.13], [x + 0.03, y + 0.03, z + RAIL + 0.06], 0.006))
    count = max(2, round(float(np.linalg.norm((q - p)[:2])) / BALUSTERS))
    drop = 0.1 if abs(q[2] - p[2]) > 0.1 else 0.0  # a baluster stands on a tread, which lies below the pitch line
    for x, y, z in p + np.arange(1, count)[:, None] / count * (q - p):
        bars.append(box([x - 0.007, y - 0.007, z - drop], [x + 0.007, y + 0.007, z + RAIL - 0.02]))
    return [bar(p + up, q + up, 0.05, 0.045, 0.012), *posts], bars


def stair_boxes(house: House, stair: Stair) -> list[CollisionBox]:
    """Boxes of treads, of landings, and of railings."""
    base, boxes = _base(house, stair), []
    add = lambda x, y, top, a, b, h, yaw: boxes.append(CollisionBox((x, y, top - h), (a, b, h), yaw))
    for f in flights_of(stair):
        for k in range(f.risers - 1):
            (x, y, z), low = f.at((k + 0.5) * f.going, 0.0, (k + 1) * f.rise), f.start[2] + k * f.rise - BELOW
            add(x, y, z, f.going / 2, f.width / 2, (z - (low if base is None else base)) / 2, f.yaw)
    for polygon, z in landings_of(stair):
        (x0, y0, x1, y1), low = polygon.bounds, z - BELOW if base is None else base
        add((x0 + x1) / 2, (y0 + y1) / 2, z, (x1 - x0) / 2, (y1 - y0) / 2, (z - low) / 2, 0.0)
    for p, q in railings(house, stair):
        count = max(1, round(abs(q[2] - p[2]) / 0.18))
        for k in range(count):
            (x, y, z), (dx, dy, _) = p + (q - p) * (k + 0.5) / count, (q - p) / count
            add(x, y, z + RAIL, max(np.hypot(dx, dy) / 2, 0.02), 0.02, RAIL / 2, float(np.arctan2(dy, dx)))
    return boxes
