"""Joinery of the openings: reveals, window frames with panes and sills, door linings, casings and leaves.

An opening is built in its own frame: x from jamb p to jamb q along the wall's centre line, y into
the first room, z up from the storey's floor; `_Hole.world` carries it into the house.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from embodied.assets.built.primitives import Shape, between, box, cylinder, frame, joined, part, quads, tube, upright
from embodied.assets.records import Finish
from embodied.house.house import GLAZED, House, Opening
from embodied.house.shapes import ROOF, inward, slope_over
from embodied.scene.outdoors import facade_finish
from embodied.scene.part import Part
from embodied.scene.walls import floor_turn, turned_uv
from embodied.seeds import stream

PIECES = ("reveal", "frame", "leaf", "leaf_2", "handle", "glass", "sill", "threshold")
"""Owners of an opening are '<opening>/<piece>'."""

Sash = tuple[list[Shape], list[Shape], list[Shape]]
"""Boards, panes and handles of one casement."""
FIXED_FRAME = "#fixed"
"""End of the mesh key of what stays of a window that is open."""
SASH_STEP = 0.012
"""Metres by which casements stand before their frame."""
LIP = 0.004
"""Metres by which casements cover their frame: a slot would be a black hairline."""
PANE_FINISH = Finish(color=(0.86, 0.93, 0.92, 0.08), roughness=0.02, specular=0.5)
FITTING_METAL = Finish(color=(0.72, 0.71, 0.69, 1.0), roughness=0.32, metallic=1.0)
STONE_SILL = Finish(color=(0.78, 0.77, 0.74, 1.0), roughness=0.35)

LINING = 0.025
"""Thickness of a door's lining, metres; it stands inside the hole."""
CASING = (0.065, 0.015)
"""Width and thickness of the boards around a door, metres."""
LEAF_STYLES = ("flat", "two_panels", "four_panels", "three_panels")


@dataclass(frozen=True, eq=False)
class _Hole:
    opening: Opening
    length: float
    origin: tuple[float, float, float]
    yaw: float
    inside: float
    """y of the first room's wall face."""
    outside: float
    """y of the far face: the second room's wall or the facade."""
    hinge_at_origin: bool
    tilt: float = 0.0
    """Turn about x of a roof window, whose z runs up the slope and whose inside is that of the ceiling."""

    def world(self, shape: Shape) -> Shape:
        shape = shape.turned(self.tilt, "x") if self.tilt else shape
        return shape.turned(self.yaw).moved(*self.origin)

    def point(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return (self.origin[0] + c * x - s * y, self.origin[1] + s * x + c * y, self.origin[2] + z)


def casing_width(opening: Opening) -> float:
    """How far the boards around a door reach beyond its hole, metres; skirting stops there."""
    cased = opening.kind == "passage" and opening.leaf_finish is not None
    return CASING[0] if opening.kind in ("door", "front_door", "back_door") or cased else 0.0


def hole_frame(house: House, opening: Opening) -> _Hole:
    """The opening's own frame in the house."""
    room = house.room_by_id[opening.rooms[0]]
    p, q = np.asarray(opening.a, float), np.asarray(opening.b, float)
    d = (q - p) / np.linalg.norm(q - p)
    flipped = float(inward(house, opening) @ [-d[1], d[0]]) < 0
    if flipped:
        p, q, d = q, p, -d
    half = house.inner_wall / 2
    far = -half if opening.rooms[1] is not None else -(house.outer_wall - half)
    z = house.storey_of(room).elevation
    at, yaw, at_origin = (float(p[0]), float(p[1]), z), math.atan2(d[1], d[0]), (opening.hinge == "a") != flipped
    length = float(np.linalg.norm(q - p))
    if opening.kind == "roof_window":
        _, way, knee = slope_over(room, opening)
        x, y = p + (opening.sill - knee) * way
        flat = dataclasses.replace(opening, sill=0.0, head=(opening.head - opening.sill) * math.sqrt(2))
        return _Hole(flat, length, (x, y, z + opening.sill), yaw, 0.0, -ROOF / math.sqrt(2), at_origin, -math.pi / 4)
    return _Hole(opening, length, at, yaw, half, far, at_origin)


def opening_parts(house: House, opening: Opening, finish: Callable[[str], Finish], apart: bool = False) -> list[Part]:
    """Everything that belongs to one opening; `apart`: with the casements of a window apart, though it is closed."""
    hole = hole_frame(house, opening)
    if opening.kind in GLAZED:
        return _window(house, hole, finish, opening.opens and (apart or opening.angle > 0))
    if opening.kind == "passage" and opening.leaf_finish is None:
        wall = finish(house.room_by_id[opening.rooms[0]].wall_finish)
        reveal = _part(hole, "reveal", "wall", wall, _tunnel(hole, hole.outside, hole.inside, False))
        return [reveal, *_threshold(house, hole, hole.outside, hole.inside, finish)]
    return _door(house, hole, finish)


def _part(hole: _Hole, piece: str, kind: str, finish: Finish, *shapes: Shape, tag: str = "") -> Part:
    owner = f"{hole.opening.id}/{piece}"
    return Part(owner, kind, hole.opening.rooms[0], part(finish, hole.world(joined(*shapes))), owner + tag)


def _tunnel(hole: _Hole, y0: float, y1: float, floor: bool) -> Shape:
    """Jambs and head (and the floor of the hole) from depth y0 to y1, looking into the hole."""
    w, z0, z1 = hole.length, hole.opening.sill, hole.opening.head
    corners = [
        [(0, y0, z0), (0, y1, z0), (0, y1, z1), (0, y0, z1)],
        [(w, y1, z0), (w, y0, z0), (w, y0, z1), (w, y1, z1)],
        [(0, y0, z1), (0, y1, z1), (w, y1, z1), (w, y0, z1)],
    ]
    if floor:
        corners.append([(0, y0, z0), (w, y0, z0), (w, y1, z0), (0, y1, z0)])
    return quads(np.asarray(corners, float))


def _threshold(house: House, hole: _Hole, y0: float, y1: float, finish: Callable[[str], Finish]) -> list[Part]:
    """The floor through a doorway, laid in line with the floor it continues."""
    o = hole.opening
    first = house.room_by_id[o.rooms[0]]
    second = house.room_by_id[o.rooms[1]] if o.rooms[1] is not None else first
    strip = hole.world(quads(np.array([[(0, y0, 0), (hole.length, y0, 0), (hole.length, y1, 0), (0, y1, 0)]])))
    strip = Shape(strip.vertices, strip.faces, strip.normals, strip.vertices[:, :2].copy())
    owner = f"{o.id}/threshold"
    floor = part(finish(second.floor_finish), turned_uv(strip, floor_turn(house)))
    parts = [Part(owner, "floor", first.id, floor, owner)]
    if first.floor_finish != second.floor_finish:
        lining = LINING if o.kind != "passage" else 0
        bar = box([lining, y1 - 0.028, -0.001], [hole.length - lining, y1 - 0.002, 0.0035], 0.0015)
        parts.append(Part(owner, "floor", first.id, part(FITTING_METAL, hole.world(bar)), owner + "#bar"))
    return parts


def _window(house: House, hole: _Hole, finish: Callable[[str], Finish], apart: bool) -> list[Part]:
    o = hole.opening
    room = house.room_by_id[o.rooms[0]]
    frame_finish = finish(o.leaf_finish or "paint_white/0")
    outdoors = o.rooms[1] is None
    y0 = hole.outside + (0.10 if outdoors and not hole.tilt else 0.025)
    y1 = y0 + 0.07
    french = o.kind == "french_window" or (o.sill < 0.05 and not hole.tilt)
    outer_frame, sashes = _sashes(house, hole, y0, y1, french)
    inner = finish(room.ceiling_finish if hole.tilt else room.wall_finish)
    parts = [_part(hole, "reveal", "wall", inner, _tunnel(hole, y1 - 0.01, hole.inside, bool(hole.tilt)))]
    outer = finish(facade_finish(house)) if outdoors else finish(room.wall_finish)
    parts.append(_part(hole, "reveal", "wall", outer, _tunnel(hole, hole.outside, y0, True), tag="#outer"))
    materials = {"frame": frame_finish, "glass": PANE_FINISH, "handle": FITTING_METAL}
    if apart:
        parts.append(_part(hole, "frame", "opening", frame_finish, *outer_frame, tag=FIXED_FRAME))
        parts += _casements(hole, y1 + SASH_STEP, sashes, materials)
    else:
        for k, (piece, material) in enumerate(materials.items()):
            shapes = [*(outer_frame if k == 0 else ()), *(x for sash in sashes for x in sash[k])]
            parts.append(_part(hole, piece, "opening", material, *shapes))
    if french:
        parts += _threshold(house, hole, y1, hole.inside, finish)
    elif not hole.tilt:
        w, inside, low, top = hole.length, hole.inside, o.sill - 0.002, o.sill + 0.022
        board = [
            box([0.0, y1, low], [w, inside, top]),
            box([-0.035, inside, low], [w + 0.035, inside + 0.04, top], 0.005),
        ]
        stone = stream(house.seed, "joinery", "sill").random() < 0.4
        parts.append(_part(hole, "sill", "opening", STONE_SILL if stone else frame_finish, *board))
    return parts


def _casements(hole: _Hole, y: float, sashes: Sequence[Sash], materials: dict[str, Finish]) -> Iterator[Part]:
    """Casements on their hinges, at the opening's angle, into the first room; handles are away from the hinges."""
    for k, sash in enumerate(sashes):
        side, o, xs = (1.0, -1.0)[k % 2], hole.opening, joined(*sash[0]).vertices[:, 0]
        x = float(xs.min() if side > 0 else xs.max())
        for (piece, material), shapes in zip(materials.items(), sash, strict=True):
            if shapes:
                mesh, key = part(material, joined(*shapes).moved(-x, -y, 0.0)), f"leaf/{o.id}/{k}/{piece}/{side:+.0f}"
                place = hole.point(x, y, 0.0), hole.yaw + side * o.angle
                yield Part(f"{o.id}/{piece}", "opening", o.rooms[0], mesh, key, *place)


def _sashes(house: House, hole: _Hole, y0: float, y1: float, french: bool) -> tuple[list[Shape], list[Sash]]:
    """Fixed frame with one to six casements: two meet, and pairs have a post between them."""
    o = hole.opening
    w, z0, z1 = hole.length, o.sill, o.head
    outer, sash = 0.045, 0.055
    count = o.casements
    bars = stream(house.seed, "joinery", "bars").random() < 0.3
    foot = 0.12 if french else sash
    cells, gaps = np.linspace(outer, w - outer, count + 1), np.where(np.arange(count + 1) % 2, 0.0, 0.001)
    gaps[[0, -1]] = -LIP
    sashes: list[Sash] = []
    for i in range(count):
        handles: list[Shape] = []
        x0, x1 = cells[i] + gaps[i], cells[i + 1] - gaps[i + 1]
        b0, b1 = z0 + outer - LIP, z1 - outer + LIP
        boards = frame(x0, x1, b0, b1, (y0 + SASH_STEP, y1 + SASH_STEP), sash, 0.006, foot)
        gx0, gx1 = x0 + sash - 0.006, x1 - sash + 0.006
        gz0, gz1 = b0 + foot - 0.006, b1 - sash + 0.006
        ym = (y0 + y1) / 2
        pane = upright(gx1, gx0, gz0, gz1, ym).two_sided()
        if bars:
            rows = max(1, round((gz1 - gz0) / 0.5))
            for k in range(1, rows):
                zb = gz0 + (gz1 - gz0) * k / rows
                boards.append(box([gx0, ym - 0.012, zb - 0.011], [gx1, ym + 0.012, zb + 0.011], 0.003))
            if gx1 - gx0 > 0.45:
                xb = (gx0 + gx1) / 2
                boards.append(box([xb - 0.011, ym - 0.0125, gz0], [xb + 0.011, ym + 0.0125, gz1], 0.003))
        if i % 2 == 0:
            x, y = x1 - sash / 2, y1 + SASH_STEP
            z = min(max(1.05, z0 + 0.25), (z0 + z1) / 2 + 0.25) if french else (z0 + z1) / 2
            way = [(x, y + 0.008, z), (x, y + 0.035, z), (x, y + 0.042, z - 0.012), (x, y + 0.042, z - 0.11)]
            handles += [box([x - 0.014, y, z - 0.035], [x + 0.014, y + 0.01, z + 0.035], 0.004), tube(way, 0.008, 8)]
        sashes.append((boards, [pane], handles))
    posts = [box([x - 0.02, y0, z0], [x + 0.02, y1, z1]) for x in cells[2:-1:2]]
    return [*frame(0, w, z0, z1, (y0, y1), outer), *posts], sashes


def _door(house: House, hole: _Hole, finish: Callable[[str], Finish]) -> list[Part]:
    o = hole.opening
    wood = finish(o.leaf_finish or "paint_white/0")
    outdoors = o.rooms[1] is None
    y0 = hole.inside - 0.10 if outdoors else hole.outside
    boards = [*_lining(hole, y0, hole.inside), *_casing(hole, hole.inside, 1.0)]
    if not outdoors:
        boards += _casing(hole, hole.outside, -1.0)
    parts = [_part(hole, "frame", "opening", wood, *boards)]
    if outdoors:
        parts.append(_part(hole, "reveal", "wall", finish(facade_finish(house)), _tunnel(hole, hole.outside, y0, True)))
    parts += _threshold(house, hole, y0, hole.inside, finish)
    if o.kind == "garage_door":
        parts.append(_part(hole, "leaf", "opening", wood, *_sections(hole)))
    elif o.kind != "passage":
        parts += _leaves(house, hole, wood)
    return parts


def _lining(hole: _Hole, y0: float, y1: float) -> list[Shape]:
    w, head, t = hole.length, hole.opening.head, LINING
    stop = y1 - 0.045
    boards = frame(0, w, 0, head, (y0, y1), t)[:3]
    if hole.opening.kind in ("door", "front_door", "back_door"):
        boards += frame(t, w - t, 0, head - t, (y0 + 0.004, stop), 0.012, 0.002)[:3]
    return boards


def _casing(hole: _Hole, y: float, side: float) -> list[Shape]:
    """Boards on the wall around the hole, mitred at the corners, standing out by CASING[1] towards `side`."""
    w, head = hole.length, hole.opening.head
    wide, thick = CASING
    i = 0.006  # the casing leaves a small step on the lining
    inner = np.array([(i, 0), (i, head - i), (w - i, head - i), (w - i, 0)])
    outer = np.array([(-wide, 0), (-wide, head + wide), (w + wide, head + wide), (w + wide, 0)])
    lip, ridge = inner + (outer - inner) * 0.06, inner + (outer - inner) * 0.72
    low = [(inner, 0.0), (inner, thick * 0.55), (lip, thick * 0.7)]
    lines = [*low, (ridge, thick), (outer, thick * 0.9), (outer, 0.0)]
    corners = []
    for (a, ya), (b, yb) in itertools.pairwise(lines):
        for k in range(3):
            quad = [(a[k], ya), (b[k], yb), (b[k + 1], yb), (a[k + 1], ya)]
            placed = [(x, y + side * depth, z) for (x, z), depth in quad]
            corners.append(placed if side > 0 else placed[::-1])
    return [_grain_up(quads(np.asarray(corners, float)))]


def _grain_up(shape: Shape) -> Shape:
    """uv with the grain (u) along z, as boards of a frame are cut."""
    return Shape(shape.vertices, shape.faces, shape.normals, np.stack([shape.uv[:, 1], shape.uv[:, 0]], axis=1))


def _leaves(house: House, hole: _Hole, wood: Finish) -> list[Part]:
    """One leaf, or two from 1.25 m on, at the opening's angle; hinges on the first room's side."""
    o = hole.opening
    clear = hole.length - 2 * LINING - 0.006
    pair = clear > 1.2
    width = clear / 2 - 0.0015 if pair else clear
    height = o.head - LINING - 0.004 - 0.006
    style = LEAF_STYLES[int(stream(house.seed, "joinery", "leaf").integers(len(LEAF_STYLES)))]
    thick = 0.042 if o.kind == "door" else 0.058
    glazed = o.kind == "back_door"
    wood_shape, panes = _leaf(width, height, thick, "glazed" if glazed else style)
    handle = _lever(width - 0.06, thick)
    parts = []
    hinges = (hole.hinge_at_origin, not hole.hinge_at_origin)
    for n, at_origin in enumerate(hinges if pair else hinges[:1]):
        side = 1.0 if at_origin else -1.0
        x = LINING + 0.003 if at_origin else hole.length - LINING - 0.003
        pivot = hole.point(x, hole.inside + CASING[1], 0.006)
        yaw = hole.yaw + side * o.angle
        piece = "leaf" if n == 0 else "leaf_2"
        stem = f"leaf/{style}/{o.kind}/{width:.4f}/{height:.4f}/{side:+.0f}"
        pieces = [
            (piece, wood, wood_shape, f"{stem}/{o.leaf_finish}"),
            ("handle", FITTING_METAL, handle, stem + "/handle"),
        ]
        if panes is not None:
            pieces.append(("glass", PANE_FINISH, panes, stem + "/glass"))
        for name, material, shape, key in pieces:
            mesh = part(material, shape.scaled(side, 1, 1))
            parts.append(Part(f"{o.id}/{name}", "opening", o.rooms[0], mesh, key, pivot, yaw))
    return parts


def leaf_poses(
    house: House, opening: Opening, finish: Callable[[str], Finish]
) -> dict[str, tuple[tuple[float, float, float], float]]:
    """Hinges, metres, and yaws, radians, of the parts of a door's leaves, by name of the geom that draws them."""
    poses, count = {}, dict[str, int]()
    for p in opening_parts(house, opening, finish):
        k = count[p.owner] = count.get(p.owner, -1) + 1
        if p.mesh_key.startswith("leaf/"):
            poses[f"{p.owner}#{k}"] = p.position, p.yaw
    return poses


def _leaf(width: float, height: float, thick: float, style: str) -> tuple[Shape, Shape | None]:
    """A leaf from its hinge at x = 0, its room side at y = 0: stiles, rails and recessed panels or a pane."""
    if style == "flat":
        return box([0, -thick, 0], [width, 0, height], 0.0025), None
    stile, top, lock = 0.105, 0.11, 0.15
    rows = {
        "two_panels": [(0.2, 0.95), (0.95 + lock, height - top)],
        "four_panels": [(0.2, 0.85), (0.85 + lock, height - top)],
        "three_panels": [(0.2, 0.75), (0.75 + 0.1, 1.35), (1.35 + 0.1, height - top)],
        "glazed": [(0.22, 0.85), (0.85 + 0.12, height - top)],
    }[style]
    columns = [(stile, width - stile)]
    if style == "four_panels" and width > 0.5:
        columns = [(stile, width / 2 - 0.045), (width / 2 + 0.045, width - stile)]
    shapes = [
        box([0, -thick, 0], [stile, 0, height]),  # flush: grooves so narrow are dark dashes from a distance
        box([width - stile, -thick, 0], [width, 0, height]),
    ]
    heights = [0.0, *(z for row in rows for z in row), height]
    for z0, z1 in zip(heights[::2], heights[1::2]):
        shapes.append(box([stile, -thick, z0], [width - stile, 0, z1]))
    if len(columns) == 2:
        for z0, z1 in rows:
            shapes.append(box([columns[0][1], -thick, z0], [columns[1][0], 0, z1]))
    panes = []
    for r, (z0, z1) in enumerate(rows):
        for x0, x1 in columns:
            if style == "glazed" and r == 1:
                ym = -thick / 2
                panes.append(upright(x1, x0, z0, z1, ym).two_sided())
            else:
                shapes.append(_panel(x0, x1, z0, z1, thick))
    return joined(*shapes), joined(*panes) if panes else None


def _panel(x0: float, x1: float, z0: float, z1: float, thick: float) -> Shape:
    """A panel between stiles, sunk by a third of the leaf, with a sloping moulding on both sides."""
    sunk, slope, lip = thick * 0.28, 0.022, 0.001
    proud = lip * sunk / slope  # the moulding leaves the face just where a stile ends: nothing of its dark side shows
    outer = [(x0 - lip, z0 - lip), (x1 + lip, z0 - lip), (x1 + lip, z1 + lip), (x0 - lip, z1 + lip)]
    inner = [(x0 + slope, z0 + slope), (x1 - slope, z0 + slope), (x1 - slope, z1 - slope), (x0 + slope, z1 - slope)]
    shapes = []
    for face, side in ((0.0, -1.0), (-thick, 1.0)):
        rim = [(x, face - side * proud, z) for x, z in outer]
        bed = [(x, face + side * sunk, z) for x, z in inner]
        shapes += [quads([bed]), between(rim, bed)] if side > 0 else [quads([bed[::-1]]), between(bed, rim)]
    return _grain_up(joined(*shapes))


def _lever(x: float, thick: float) -> Shape:
    """Lever handles on both sides of a leaf at 1.03 m."""
    z, shapes = 1.03, []
    for y, out in ((0.0, 1.0), (-thick, -1.0)):
        rose = cylinder(0.025, 0, 0.009, 0.003, 14).turned(-out * math.pi / 2, "x").moved(x, y, z)
        near, far = y + out * 0.045, y + out * 0.055
        path = [(x, y + out * 0.004, z), (x, near, z), (x - 0.012, far, z), (x - 0.12, far, z)]
        key = cylinder(0.018, 0, 0.006, 0.0, 12).turned(-out * math.pi / 2, "x").moved(x, y, z - 0.09)
        shapes += [rose, tube(path, 0.0095, 10), key]
    return joined(*shapes)


def _sections(hole: _Hole) -> list[Shape]:
    """A closed sectional garage door: horizontal panels with grooves between."""
    o, y = hole.opening, hole.inside - 0.06
    count = max(3, round(o.head / 0.5))
    edges = np.linspace(0.0, o.head - LINING, count + 1)
    return [
        box([LINING, y - 0.04, a + 0.002], [hole.length - LINING, y, b - 0.002], 0.004)
        for a, b in itertools.pairwise(edges)
    ]
