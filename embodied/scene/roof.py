"""Rooms under the roof: ceilings that slope, walls that end at them, the roof outside, and their collision boxes."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely
import shapely.affinity

from embodied.assets.built.primitives import Shape, flat
from embodied.house.house import House, Room
from embodied.house.shapes import ROOF, roof_hole, under_slopes
from embodied.scene.collision import CollisionBox
from embodied.scene.walls import Hole


def lifted(shape: Shape, line: tuple[np.ndarray, np.ndarray, float], z: float) -> Shape:
    """A flat shape raised onto a slope that begins above `z`, with the sides that it had."""
    at, way, knee = line
    vertices, up = shape.vertices.copy(), np.sign(shape.normals[:, 2:])
    vertices[:, 2] = z + knee + (vertices[:, :2] - at) @ way
    normals = up * np.array([*-way, 1.0]) / math.sqrt(2)
    return Shape(vertices, shape.faces, normals, shape.uv)


def ceilings(house: House, room: Room, area: shapely.Geometry, up: float = 0.0) -> Iterator[Shape]:
    """The ceiling of a room under the roof over an area, slope after slope and what is flat, without the holes of its
    windows; with `up`, the roof over it, so much higher."""
    windows = [o for o in house.openings if o.kind == "roof_window" and o.rooms[0] == room.id]
    storey, holes = house.storey_of(room), [roof_hole(room, o) for o in windows]
    z, turn = storey.elevation + up, up > 0
    for line, strip in zip(room.slope_lines, under_slopes(room, storey.height), strict=True):
        moved = [shapely.affinity.translate(h, *(-up / 2 * line[1])) for h in holes]
        part = area.intersection(strip).difference(shapely.union_all(moved))
        yield lifted(flat(part, 0.0, up=turn), line, z)
    yield flat(area.difference(shapely.union_all(under_slopes(room, storey.height))), z + storey.height, up=turn)


def face(
    house: House,
    room: Room,
    p: np.ndarray,
    q: np.ndarray,
    low: float,
    holes: Sequence[Hole],
    along: float = 0.0,
    up: float = 0.0,
) -> Shape:
    """As walls.wall_face, from `low` to the ceiling of a room under the roof, or the roof `up` over it."""
    (storey, length), d = (house.storey_of(room), float(np.linalg.norm(q - p))), (q - p) / np.linalg.norm(q - p)
    bends = [(storey.height - knee - (p - at) @ way, d @ way) for at, way, knee in room.slope_lines]
    ends = sorted({0.0, length} | {float(np.clip(far / k, 0.0, length)) for far, k in bends if abs(k) > 0.5})
    top = storey.elevation + up + room.clear_height(storey.height, p + np.array(ends)[:, None] * d)
    outline = shapely.Polygon([(0.0, low), (length, low), *list(zip(ends, top.tolist()))[::-1]])
    plane = flat(outline.difference(shapely.union_all([shapely.box(*h) for h in holes])), up=False)
    s, z, _ = plane.vertices.T
    normals = np.tile([-d[1], d[0], 0.0], (len(s), 1))
    return Shape(np.column_stack([p + s[:, None] * d, z]), plane.faces, normals, np.column_stack([-(along + s), z]))


def covered(house: House, room: Room) -> shapely.Polygon:
    """The rectangle of a room under the roof, out to the facade, metres, world."""
    t, (x0, y0, x1, y1) = house.outer_wall - house.inner_wall / 2, shapely.Polygon(room.polygon).bounds
    others = shapely.union_all([shapely.Polygon(r.polygon) for r in house.rooms if r.storey == room.storey])
    sides = ((x0 - t, y0, x0, y1), (x0, y0 - t, x1, y0), (x1, y0, x1 + t, y1), (x0, y1, x1, y1 + t))
    w, s, e, n = (t * (others.intersection(shapely.box(*side)).area < 1e-3) for side in sides)
    return shapely.box(x0 - w, y0 - s, x1 + e, y1 + n)


def ceiling_boxes(house: House, room: Room) -> Iterator[CollisionBox]:
    """A box over each slope of a room, over its windows, too."""
    z, high = house.storey_of(room).elevation, house.storey_of(room).height
    for (k, _), (at, way, knee) in zip(room.slopes, room.slope_lines, strict=True):
        run, length = high - knee, float(np.linalg.norm(np.subtract(at, room.polygon[k - 3])))
        x, y = at + np.array([way[1], -way[0]]) * length / 2 + way * (run / 2 - ROOF / 4)
        half = (length / 2, run / math.sqrt(2), ROOF / math.sqrt(8))
        yield CollisionBox((x, y, z + knee + run / 2 + ROOF / 4), half, math.atan2(-way[0], way[1]), math.pi / 4)
