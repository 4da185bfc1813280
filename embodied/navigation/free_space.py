"""Places where a person can stand and what they can see: flat free-space polygons of one storey, metres, world."""

import math
from collections.abc import Collection

import numpy as np
import shapely

from embodied.house.house import DOORS, House, Opening, Room
from embodied.house.moment import WIDEST, Moment
from embodied.house.shapes import footprint, inward, open_floor

EYE = 1.5
"""Eye height above the floor, metres (Matterport3D's cameras: mean 1.50)."""
HEAD = 1.8
"""Things whose base is higher than this do not stop a person."""
LOW = 0.04
"""Things lower than this (rugs, mats, thresholds) are walked over."""
JAMB = 0.03
"""Width that a door's lining and the play of its leaf take from its hole on each side, metres."""
LEAF = 0.05
"""Thickness of an open leaf with its handle, metres."""
OPEN_FROM = 0.5
"""Openness from which a door counts as open: the agent's body then passes. Habitat has 0.4, MolmoSpaces 0.67, RoboCasa
0.9."""
LATCHED = 0.005
"""Openness up to which a door is shut fast, as RoboCasa's; a body pushes open what stands wider."""


def free_floor(house: House, storey: int) -> shapely.Geometry:
    """The floor that is neither wall, furniture nor door leaf; doorways included."""
    return _floor_without(house, storey, LOW, HEAD)


def sight_floor(house: House, storey: int) -> shapely.Geometry:
    """Area in which a horizontal sight line at eye height may run."""
    return _floor_without(house, storey, EYE - 0.02, EYE + 0.02)


def _floor_without(house: House, storey: int, low: float, high: float) -> shapely.Geometry:
    """Floors and doorways without what occupies heights between low and high."""
    open_floor, things = _floors_and_doorways(house, storey), obstacles(house, storey, low, high)
    return open_floor.difference(shapely.union_all(things)) if things else open_floor


def obstacles(house: House, storey: int, low: float, high: float) -> list[shapely.Polygon]:
    """Footprints of placements and leaves that occupy heights between low and high above the floor."""
    rooms = {r.id for r in house.rooms if r.storey == storey}
    floor = house.storeys[storey].elevation
    polygons = []
    for p in house.placements:
        if p.room in rooms and p.position[2] - floor < high and p.position[2] + p.size[2] - floor > low:
            polygons.append(footprint(p))
    for o in house.openings:
        if o.kind == "door" and o.rooms[0] in rooms:
            polygons += leaves(house, o)
    return polygons


def leaves(house: House, opening: Opening) -> list[shapely.Polygon]:
    """The one leaf of a door, or two from 1.25 m on, as it stands open."""
    a, b = np.asarray(opening.a, float), np.asarray(opening.b, float)
    width = float(np.linalg.norm(b - a))
    normal = inward(house, opening)
    face = house.inner_wall / 2 * normal
    pairs = [(a, b), (b, a)] if width >= 1.25 else [(a, b) if opening.hinge == "a" else (b, a)]
    polygons = []
    for hinge, other in pairs:
        across = (other - hinge) / width
        long = (width - 2 * JAMB) / len(pairs)
        start = hinge + JAMB * across + face
        tip = start + long * (math.cos(opening.angle) * across + math.sin(opening.angle) * normal)
        polygons.append(shapely.LineString([start, tip]).buffer(LEAF / 2, cap_style="flat"))
    return polygons


def room_doors(house: House) -> list[Opening]:
    """Doors with a leaf between two rooms."""
    return [o for o in house.openings if o.kind == "door" and o.rooms[1] is not None and o.leaf_finish is not None]


def closed_doors(house: House, threshold: float = OPEN_FROM) -> frozenset[str]:
    """Doors between rooms that are open by less than `threshold`, as the house rests.

    Args:
      threshold: openness, 0 to 1, from which a door counts as open.
    """
    return frozenset(o.id for o in room_doors(house) if o.angle < threshold * WIDEST)


def ajar_doors(house: House) -> frozenset[str]:
    """Doors that count as closed and are not shut fast."""
    return closed_doors(house) - closed_doors(house, LATCHED)


def opened(house: House, doors: Collection[str]) -> House:
    """The house with some doors wide open."""
    return Moment(openness=dict.fromkeys(sorted(doors), 1.0)).applied(house) if doors else house


def doors_of_edges(positions: np.ndarray, edges: np.ndarray, house: House) -> dict[tuple[int, int], tuple[str, ...]]:
    """Doors that each edge passes, by edge (i, j), i < j; edges that pass none are left out.

    Args:
      positions: (n, 3) metres, world.
      edges: (m, 2) int node pairs.
    """
    passed: dict[tuple[int, int], tuple[str, ...]] = {}
    lines = shapely.linestrings(positions[edges][:, :, :2])
    floors = np.array([s.elevation for s in house.storeys])
    storeys = np.abs(positions[edges[:, 0], 2, None] - 1.5 - floors).argmin(1)
    for o in room_doors(house):
        storey = house.room_by_id[o.rooms[0]].storey
        for k in np.flatnonzero(shapely.intersects(lines, shapely.LineString([o.a, o.b])) & (storeys == storey)):
            edge = (int(edges[k, 0]), int(edges[k, 1]))
            passed[edge] = (*passed.get(edge, ()), o.id)
    return passed


def doorway(house: House, opening: Opening) -> shapely.Polygon:
    """The floor inside the wall that a door or passage between two rooms opens up."""
    a, b = np.asarray(opening.a, float), np.asarray(opening.b, float)
    along = (b - a) / np.linalg.norm(b - a)
    lining = JAMB if opening.kind != "passage" or opening.leaf_finish is not None else 0.0
    a, b = a + lining * along, b - lining * along
    half = (house.inner_wall / 2 + 1e-3) * inward(house, opening)
    return shapely.Polygon([a - half, b - half, b + half, a + half])


def between_walls(house: House, storeys: Collection[int]) -> shapely.Geometry:
    """Floors, with what stairs cover and where they leave them open, and doorways of some storeys."""
    rooms = [r for r in house.rooms if r.storey in storeys]
    return shapely.union_all([*map(house.floor, rooms), *_doorways(house, rooms)])


def _floors_and_doorways(house: House, storey: int) -> shapely.Geometry:
    rooms = [r for r in house.rooms if r.storey == storey]
    return shapely.union_all([*(open_floor(house, r) for r in rooms), *_doorways(house, rooms)])


def _doorways(house: House, rooms: Collection[Room]) -> list[shapely.Polygon]:
    ids, inside = {r.id for r in rooms}, [o for o in house.openings if o.kind in DOORS and o.rooms[1] is not None]
    return [doorway(house, o) for o in inside if o.rooms[0] in ids]
