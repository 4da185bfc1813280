"""The records of a house as shapes on the floor: what an object covers, which way an opening faces."""

import functools
from collections.abc import Sequence

import numpy as np
import shapely

from embodied.geometry import rectangle
from embodied.house.house import House, Opening, Placement, Room, Stair

ROOF = 0.25
"""Thickness of a roof, upright, metres."""
_floor = functools.lru_cache(maxsize=256)(shapely.Polygon)
"""A room's: every picture asks where its camera is."""


def footprint(placement: Placement) -> shapely.Polygon:
    """The rotated rectangle that an object covers, metres, world; for a table it includes the air between the legs."""
    x, y, _ = placement.position
    width, depth, _ = placement.size
    return shapely.Polygon(rectangle(x, y, width, depth, placement.yaw))


def inward(house: House, opening: Opening) -> np.ndarray:
    """(2,) unit normal of the opening's wall into its first room."""
    a, b = np.asarray(opening.a, float), np.asarray(opening.b, float)
    along = (b - a) / np.linalg.norm(b - a)
    normal = np.array([-along[1], along[0]])
    room = shapely.Polygon(house.room_by_id[opening.rooms[0]].polygon)
    return normal if room.contains(shapely.Point((a + b) / 2 + 0.05 * normal)) else -normal


def room_at(house: House, position: Sequence[float] | np.ndarray) -> str | None:
    """The room that the point (x, y, z) is in, the floors between storeys included; None outdoors."""
    for room in house.rooms:
        storey = house.storey_of(room)
        level = storey.elevation - 0.3 <= position[2] < storey.elevation + storey.height + 0.3
        if level and shapely.intersects_xy(_floor(room.polygon), position[0], position[1]):
            return room.id
    return None


def well_of(stair: Stair) -> shapely.Polygon:
    """The opening of a stair in the floor above it, and below what the stair covers, metres, world."""
    if stair.well:
        return shapely.Polygon(stair.well)
    line = shapely.LineString([p[:2] for p in stair.path])
    return line.buffer(stair.width / 2 + 0.02, cap_style="flat", join_style="mitre")


def opening_of(stair: Stair) -> shapely.Polygon:
    """All of the opening in the floor above a stair, metres, world."""
    return well_of(stair).union(shapely.Polygon(stair.void)) if stair.void else well_of(stair)


HEADROOM = 2.0
"""Least height of the ceiling over a floor that one walks on, metres."""


def under_slopes(room: Room, height: float) -> list[shapely.Polygon]:
    """For each slope of a room the side of the plane on which its ceiling is lower than `height`."""
    far = [(at + (height - knee) * way, 1e3 * np.array([way[1], -way[0]])) for at, way, knee in room.slope_lines]
    return [shapely.LineString([at - along, at + along]).buffer(-1e3, single_sided=True) for at, along in far]


def slope_over(room: Room, opening: Opening) -> tuple[np.ndarray, np.ndarray, float]:
    """The slope of a room that a roof window lies in, as of Room.slope_lines."""
    jambs = np.array([opening.a, opening.b], float)
    return next(line for line in room.slope_lines if np.abs((jambs - line[0]) @ line[1]).max() < 0.01)


def roof_hole(room: Room, opening: Opening) -> shapely.Polygon:
    """The plan of a roof window's hole in the ceiling, metres, world."""
    _, way, knee = slope_over(room, opening)
    a, b = np.asarray(opening.a, float), np.asarray(opening.b, float)
    low, high = ((z - knee) * way for z in (opening.sill, opening.head))
    return shapely.Polygon([a + low, b + low, b + high, a + high])


def open_floor(house: House, room: Room) -> shapely.Geometry:
    """The floor between the walls of a room, without what stairs cover, where they leave it open, and where one would
    stoop, metres, world."""
    shape = lambda s: opening_of(s) if room.id == s.rooms[1] else well_of(s)
    wells = [shape(s) for s in house.stairs if room.id in s.rooms] + under_slopes(room, HEADROOM)
    return house.floor(room).difference(shapely.union_all(wells)) if wells else house.floor(room)


def room_union(house: House, storey: int) -> shapely.Geometry:
    """The rooms of one storey as one polygon along wall centre lines."""
    pieces = [shapely.Polygon(r.polygon).buffer(1e-6, join_style="mitre") for r in house.rooms if r.storey == storey]
    return shapely.unary_union(pieces).simplify(1e-5)
