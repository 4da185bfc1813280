"""The fixed part of a house as meshes: walls with their openings, floors, ceilings, skirting, facade.

Each room has its own wall faces on the edges of `house.floor(room)`, looking into the room; joinery
and reveals (embodied.scene.joinery) close the gap between the faces of two rooms, and a facade closes the
house from outside. Every wall is one planar mesh around its holes, so that it makes one light-map
chart. Texture coordinates are metres divided by the finish's tile.
"""

import math
from collections.abc import Callable

import numpy as np
import shapely

from embodied.assets.built.primitives import Shape, flat, joined, part, quads
from embodied.assets.records import Finish
from embodied.house.house import House, Room
from embodied.house.shapes import opening_of, well_of
from embodied.scene import joinery, outdoors, roof, stairs
from embodied.scene.part import Part
from embodied.scene.walls import Hole, floor_turn, hole_on, inset, turned_uv, wall_face

FinishOf = Callable[[str], Finish]

SKIRTING_HEIGHT = 0.08
SKIRTING_THICKNESS = 0.014


def shell_parts(house: House, finish: FinishOf, apart: bool = False) -> tuple[Part, ...]:
    """All parts that are no placements: rooms, openings, stairs, outdoors, in `shell_owners` order; `apart`: as of
    joinery.opening_parts."""
    parts: list[Part] = []
    for room in house.rooms:
        parts += room_parts(house, room, finish)
    for opening in house.openings:
        parts += joinery.opening_parts(house, opening, finish, apart)
    for stair in house.stairs:
        parts += stairs.stair_parts(house, stair, finish)
    parts += outdoors.outdoor_parts(house, finish)
    return tuple(parts)


def shell_owners(house: House) -> tuple[str, ...]:
    """Every owner that `shell_parts` may use, in a fixed order."""
    names: list[str] = []
    for room in house.rooms:
        names += [f"{room.id}/floor", f"{room.id}/ceiling", f"{room.id}/skirting"]
        names += [f"{room.id}/wall_{i}" for i in range(len(room.polygon))]
    for opening in house.openings:
        names += [f"{opening.id}/{piece}" for piece in joinery.PIECES]
    names += [f"{s.id}/stairs" for s in house.stairs]
    names += [f"outdoor/{piece}" for piece in outdoors.PIECES]
    return tuple(names)


def room_parts(house: House, room: Room, finish: FinishOf) -> list[Part]:
    """Floor, ceiling, walls and skirting of one room."""
    storey = house.storey_of(room)
    z0, z1 = storey.elevation, storey.elevation + storey.height
    floor_area, ceiling_area = house.floor(room), house.floor(room)
    for stair in house.stairs:
        lower, upper = (house.room_by_id[r] for r in stair.rooms)
        if room.storey == lower.storey:
            ceiling_area = ceiling_area.difference(opening_of(stair))
        if room.storey == upper.storey:
            floor_area = floor_area.difference(opening_of(stair))
    turn = floor_turn(house)
    ceiling = joined(*roof.ceilings(house, room, ceiling_area)) if room.slopes else flat(ceiling_area, z1, up=False)
    parts = [
        _part(f"{room.id}/floor", "floor", room, finish(room.floor_finish), turned_uv(flat(floor_area, z0), turn)),
        _part(f"{room.id}/ceiling", "ceiling", room, finish(room.ceiling_finish), ceiling),
    ]
    ring = inset(room.polygon, house.inner_wall / 2)
    along = 0.0
    for i, (p, q) in enumerate(zip(ring, np.roll(ring, -1, axis=0))):
        key = room.accent_finish if i == room.accent_wall and room.accent_finish else room.wall_finish
        holes = holes_of(house, room, p, q)
        low = roof.face(house, room, p, q, z0, holes, along) if room.slopes else None
        face = low or wall_face(p, q, z0, z1, holes, along)
        parts.append(_part(f"{room.id}/wall_{i}", "wall", room, finish(key), face))
        along += float(np.linalg.norm(q - p))
    skirting = skirting_of(house, room)
    if skirting is not None:
        parts.append(_part(f"{room.id}/skirting", "wall", room, finish(room.skirting_finish), skirting))
    return parts


def _part(owner: str, kind: str, room: Room, finish: Finish, shape: Shape) -> Part:
    return Part(owner, kind, room.id, part(finish, shape), owner)


def holes_of(house: House, room: Room, p: np.ndarray, q: np.ndarray, casings: bool = False) -> list[Hole]:
    """The holes in the wall face from p to q of `room`, sorted; with the casings around them, clipped to the wall."""
    z, length = house.storey_of(room).elevation, float(np.linalg.norm(q - p))
    holes = []
    for o in house.openings:
        if (
            room.id in o.rooms
            and o.kind != "roof_window"
            and (hole := hole_on(p, q, o, z, house.inner_wall / 2)) is not None
        ):
            s0, low, s1, high = hole
            margin = joinery.casing_width(o) if casings else 0.0
            holes.append((max(0.0, s0 - margin), low, min(length, s1 + margin), high))
    return sorted(holes)


def skirting_of(house: House, room: Room) -> Shape | None:
    """Boards at the foot of the walls, mitred in the corners, left out at doors; None if nothing is left."""
    z = house.storey_of(room).elevation
    wells = shapely.union_all([well_of(s).buffer(0.05) for s in house.stairs if room.id in s.rooms])
    wall, front = (inset(room.polygon, house.inner_wall / 2 + t) for t in (0.0, SKIRTING_THICKNESS))
    runs = []
    for i in range(len(wall)):
        p, q, fp, fq = wall[i], wall[(i + 1) % len(wall)], front[i], front[(i + 1) % len(wall)]
        length = float(np.linalg.norm(q - p))
        d = (q - p) / length
        n = np.array([-d[1], d[0]]) * SKIRTING_THICKNESS
        cuts = [(s0, s1) for s0, low, s1, _ in holes_of(house, room, p, q, casings=True) if low < z + SKIRTING_HEIGHT]
        for line in shapely.get_parts(shapely.LineString([p, q]).intersection(wells)):
            s = ((np.asarray(line.coords) - p) @ d).tolist()  # no floor there, or a flight before the wall
            cuts = sorted([*cuts, (min(s), max(s))]) if s else cuts
        start = 0.0
        for s0, s1 in [*cuts, (length, math.inf)]:
            if s0 - start > 0.01:
                a, b = p + start * d, p + s0 * d
                fa = fp if start == 0.0 else a + n
                fb = fq if s0 == length else b + n
                runs.append(_board(a, b, fa, fb, z, start > 0.0, s0 < length))
            start = max(start, s1)
    return joined(*runs) if runs else None


def _board(a: np.ndarray, b: np.ndarray, fa: np.ndarray, fb: np.ndarray, z: float, cap_a: bool, cap_b: bool) -> Shape:
    """One skirting board from a to b on the wall, fa to fb on its front: front, rounded top, cut ends."""
    top, shoulder = z + SKIRTING_HEIGHT, z + SKIRTING_HEIGHT - 0.008
    length = float(np.linalg.norm(b - a))

    at = lambda point, height: [point[0], point[1], height]
    ia, ib = fa + (a - fa) * 0.55, fb + (b - fb) * 0.55
    corners = [
        [at(fb, z), at(fa, z), at(fa, shoulder), at(fb, shoulder)],
        [at(fb, shoulder), at(fa, shoulder), at(ia, top), at(ib, top)],
        [at(ib, top), at(ia, top), at(a, top), at(b, top)],
    ]
    uv = [[(0, v0), (length, v0), (length, v1), (0, v1)] for v0, v1 in ((0.0, 0.072), (0.072, 0.08), (0.08, 0.09))]
    if cap_a:
        corners.append([at(fa, z), at(a, z), at(a, top), at(fa, shoulder)])
    if cap_b:
        corners.append([at(b, z), at(fb, z), at(fb, shoulder), at(b, top)])
    uv += [[(0, 0), (0.014, 0), (0.014, 0.08), (0, 0.08)]] * (cap_a + cap_b)
    return quads(np.asarray(corners), np.asarray(uv))
