"""The outdoors seen through the windows: the house's own facade and roof, the ground, balconies, far things."""

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
import shapely
from scipy.spatial import ConvexHull

from embodied.assets.built.primitives import Shape, bar, box, extruded, facets, flat, joined, part, quads, sheet, tube
from embodied.assets.records import Finish
from embodied.house.house import House, Room
from embodied.house.shapes import inward, room_union
from embodied.scene import roof
from embodied.scene.buildings import DOOR, LIT, PANE, ROOF, TRIM, WALL, Faces, faces_of
from embodied.scene.landscapes import GROUND_DROP, STREET, Scenery, near_buildings, plot, scenery_of, side_frame
from embodied.scene.part import Part
from embodied.scene.walls import hole_on, wall_face
from embodied.seeds import stream

Bounds = tuple[float, float, float, float]

RAIL = Finish(color=(0.10, 0.10, 0.11, 1.0), roughness=0.5)
BARK = Finish(color=(0.26, 0.21, 0.17, 1.0), roughness=0.95, specular=0.1)

CLUMPS, BUNCHES = 13, 70
"""Of a tree's crown, and of the leaves of a clump."""

PIECES = ("facade", "roof", "ground", "terrace", "hedge", "trees", "border", "street", "neighbours", "windows")
"""Owners outside are 'outdoor/<piece>'; 'windows' are the neighbours' that are lit in the evening."""

LEAFY = {"spring": (0, 4), "summer": (0, 1), "autumn": (2, 3), "winter": ()}
"""Kinds of foliage of trees."""
FIRS = 1
"""The kind of foliage of firs and hedges, all year."""
ASPHALT = Finish(color=(0.27, 0.27, 0.28, 1.0), roughness=0.95, specular=0.1)
WOOD = Finish(color=(0.40, 0.35, 0.29, 1.0), roughness=0.9, specular=0.1)
TRIMS = Finish(color=(0.86, 0.85, 0.82, 1.0), roughness=0.8, specular=0.2)
NEIGHBOURS_GLASS = Finish(color=(0.24, 0.27, 0.31, 1.0), roughness=0.3, specular=0.3)
DOORS = ((0.20, 0.27, 0.24), (0.36, 0.15, 0.12), (0.18, 0.22, 0.30), (0.30, 0.22, 0.15))
NEIGHBOURS = (
    "render_white/0", "render_white/1", "brick_red/0", "render_white/2", "brick_yellow/0", "render_white/1",
)  # fmt: skip

_HALF = [(0.42, -0.2), (0.45, 0.5), (0.42, 1.2), (0.28, 1.52)]
HEDGE = np.array([*_HALF, (0.0, 1.6), *((-x, up) for x, up in reversed(_HALF))])
"""Its profile: across and up, metres."""

FACADES = ("render_white/0", "render_white/1", "brick_red/0", "render_white/2")


def facade_finish(house: House) -> str:
    """Material key of the outer walls, the same all around one house."""
    return FACADES[int(stream(house.seed, "outdoors", "facade").integers(len(FACADES)))]


def footprint(house: House, storey: int) -> shapely.Geometry:
    """The outline of one storey's outer walls, metres, world."""
    return room_union(house, storey).buffer(house.outer_wall - house.inner_wall / 2, join_style="mitre")


def outdoor_parts(house: House, finish: Callable[[str], Finish]) -> list[Part]:
    """All parts of kind 'outdoor', nearest first; the same for the same house."""
    place = scenery_of(house)
    walls, roofs = [], []
    for k in range(len(house.storeys)):
        shape, lids = _storey_shell(house, k, place.height)
        walls += shape
        roofs += lids
    parts = [
        _part("facade", finish(facade_finish(house)), walls),
        _part("roof", Finish(color=(0.35, 0.34, 0.33, 1.0), roughness=0.9), roofs),
    ]
    slabs, rails = _terraces(house, place)
    if slabs:
        parts.append(_part("terrace", finish("paving/0"), slabs))
    if rails:
        parts.append(_part("terrace", RAIL, rails, "#rails"))
    if place.table.ground != "town" or place.table.neighbours:
        parts += _garden(house, place, finish)
    return parts + _neighbours(house, place, finish)


def _garden(house: House, place: Scenery, finish: Callable[[str], Finish]) -> list[Part]:
    """The plot: lawn, border and trees; a street where there is one."""
    rng = stream(house.seed, "outdoors", "garden")
    dry = rng.random() < (0.5 if place.season == "summer" else 0.15)
    edge, z = plot(house), -place.height
    lawn = flat(shapely.box(*edge).difference(footprint(house, 0)), z)  # what lies beyond is painted on the sky
    parts = [_part("ground", finish("snow/0" if place.snow else f"lawn/{int(dry)}"), [lawn])]
    street = place.table.neighbours in ("cottages", "terrace")
    open_side = place.outlook if street or place.table.water is not None else None
    sides = [k for k in range(4) if open_side is None or k != round(open_side / (math.pi / 2)) % 4]
    if street:
        parts += _street(edge, place, finish)
    if place.table.border == "hedge":
        shapes, caps = _hedges(edge, sides, z, rng=rng)
        parts.append(_part("hedge", finish(f"foliage/{FIRS}"), shapes))
        if place.snow:
            parts.append(_part("hedge", finish("snow/0"), caps, "#snow"))
    elif place.table.border != "none":
        wall = place.table.border == "wall"
        own = finish("brick_red/0" if place.table.neighbours == "terrace" else "rubble/0") if wall else WOOD
        high = 2.0 if place.table.neighbours == "terrace" else 0.85
        parts.append(_part("border", own, _walls(edge, sides, z, high) if wall else _fence(edge, sides, z)))
    return parts + _trees(edge, place, finish, rng=rng)


def _neighbours(house: House, place: Scenery, finish: Callable[[str], Finish]) -> list[Part]:
    """The houses around the plot, by what their faces are made of."""
    near = near_buildings(house, place)
    if not near:
        return []
    rng = stream(house.seed, "outdoors", "neighbours", "faces")
    roof = [finish("snow/0")] * 2 if place.snow else [finish(f"roof_tiles/{k}") for k in range(2)]
    surfaces_of_kind: dict[str, tuple[str, Finish, list[np.ndarray]]] = {}
    for b in near:
        faces = faces_of(b, -place.height, detail=True, rng=rng)
        seen = _seen_from(house, faces)
        wall = b.paint % len(NEIGHBOURS)
        door = Finish(color=(*DOORS[b.paint % len(DOORS)], 1.0), roughness=0.6)
        own = {
            WALL: finish(NEIGHBOURS[wall]),
            ROOF: roof[b.tiles % 2],
            TRIM: TRIMS,
            DOOR: door,
            PANE: NEIGHBOURS_GLASS,
            LIT: NEIGHBOURS_GLASS,
        }
        tags = {WALL: f"#wall_{wall}", ROOF: f"#roof_{b.tiles % 2}", TRIM: "", DOOR: f"#door_{b.paint % len(DOORS)}"}
        for kind in np.unique(faces.made_of).tolist():
            tag = tags.get(kind, "#panes")
            piece = "windows" if kind == LIT else "neighbours"
            corners_of_kind = faces.corners[seen & (faces.made_of == kind)]
            if len(corners_of_kind):
                surfaces_of_kind.setdefault(piece + tag, (piece, own[kind], []))[2].append(corners_of_kind)
    return [
        _part(piece, own, [quads(np.concatenate(corners))], key[len(piece) :])
        for key, (piece, own, corners) in sorted(surfaces_of_kind.items())
    ]


def _part(piece: str, finish: Finish, shapes: list[Shape], tag: str = "") -> Part:
    return Part(f"outdoor/{piece}", "outdoor", "", part(finish, *shapes), f"outdoor/{piece}{tag}")


def _seen_from(house: House, faces: Faces) -> np.ndarray:
    """(n,) bool: faces that somebody in the house might see the front of."""
    x0, y0, x1, y1 = footprint(house, 0).bounds
    low, high = house.storeys[0].elevation, house.storeys[-1].elevation + house.storeys[-1].height
    eyes = np.array([(x, y, z) for x in (x0, x1) for y in (y0, y1) for z in (low, high)])
    c = faces.corners
    normal = np.cross(c[:, 2] - c[:, 0], c[:, 3] - c[:, 1])
    return np.einsum("nk,nek->ne", normal, eyes[None] - c[:, :1]).max(1) > 0


def _street(edge: Bounds, place: Scenery, finish: Callable[[str], Finish]) -> list[Part]:
    """Pavements and a carriageway along one side of the plot."""
    middle, along, out, half = side_frame(edge, place.outlook)

    def strip(near: float, far: float, up: float) -> Shape:
        ends = [middle + along * s + out * d for s, d in ((-1, near), (1, near), (1, far), (-1, far))]
        ends = [e + along * s * (half + 24.0 - 1.0) for e, s in zip(ends, (-1, 1, 1, -1))]
        return flat(shapely.geometry.polygon.orient(shapely.Polygon(ends)), up - place.height)

    own = finish("snow/0") if place.snow else finish("paving/0")
    return [
        _part("street", own, [strip(0.0, STREET[0], 0.0), strip(STREET[1], place.reach + 0.8, 0.0)]),
        _part("street", ASPHALT, [strip(*STREET, -0.1)], "#road"),
    ]


def _sides(edge: Bounds, sides: Sequence[int]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Ends of the plot's sides; side k lies towards k quarter turns."""
    out = []
    for k in sides:
        middle, along, _, half = side_frame(edge, k * math.pi / 2)
        out.append((middle - along * half, middle + along * half))
    return out


def _walls(edge: Bounds, sides: Sequence[int], z: float, high: float) -> list[Shape]:
    """Garden walls with a coping."""
    made = []
    for a, b in _sides(edge, sides):
        for low, top, thick in ((-0.2, high, 0.28), (high, high + 0.07, 0.36)):
            made.append(bar((*a, z + (low + top) / 2), (*b, z + (low + top) / 2), thick, top - low))
    return made


def _fence(edge: Bounds, sides: Sequence[int], z: float) -> list[Shape]:
    """Posts and three rails."""
    made = []
    for a, b in _sides(edge, sides):
        made += [bar((*a, z + up), (*b, z + up), 0.04, 0.10) for up in (0.35, 0.7, 1.05)]
        for x, y in a + np.linspace(0, 1, round(np.linalg.norm(b - a) / 2.4) + 1)[:, None] * (b - a):
            made.append(box([x - 0.06, y - 0.06, z - 0.2], [x + 0.06, y + 0.06, z + 1.2]))
    return made


def _terraces(house: House, place: Scenery) -> tuple[list[Shape], list[Shape]]:
    """A paved slab before each door that leads out; upstairs a balcony with a railing."""
    slabs, rails = [], []
    for o in house.openings:
        if o.rooms[1] is not None or o.kind not in ("front_door", "back_door", "french_window", "garage_door"):
            continue
        a, b = np.asarray(o.a), np.asarray(o.b)
        d, room = (b - a) / np.linalg.norm(b - a), house.room_by_id[o.rooms[0]]
        n = -inward(house, o)
        upstairs = room.storey > 0 or place.height > 1.0
        side, deep = (0.5, 1.3) if upstairs or o.kind in ("front_door", "garage_door") else (1.2, 3.0)
        near = house.outer_wall - house.inner_wall / 2
        start, end, far = a - side * d, b + side * d, near + deep
        ring = [start + near * n, end + near * n, end + far * n, start + far * n]
        area = shapely.geometry.polygon.orient(shapely.Polygon(ring)).difference(footprint(house, room.storey))
        z = house.storey_of(room).elevation
        for piece in shapely.get_parts(area):
            if piece.geom_type != "Polygon" or piece.area < 0.2:
                continue
            slabs.append(extruded(piece, z - (0.18 if upstairs else GROUND_DROP), z - 0.02))
        if upstairs:
            for p, q in itertools.pairwise(np.array([ring[0], ring[3], ring[2], ring[1]])):
                rails.append(bar((*p, z + 1.0), (*q, z + 1.0), 0.05, 0.04, 0.006))
                for t in np.linspace(0, 1, max(2, round(np.linalg.norm(q - p) / 0.12))):
                    x, y = p + t * (q - p)
                    rails.append(box([x - 0.007, y - 0.007, z - 0.02], [x + 0.007, y + 0.007, z + 1.0]))
    return slabs, rails


def _hedges(
    edge: Bounds, sides: Sequence[int], z: float, *, rng: np.random.Generator
) -> tuple[list[Shape], list[Shape]]:
    """Clipped hedges with an uneven face, and the snow that may lie on them."""
    made, caps = [], []
    for a, b in _sides(edge, sides):
        d = (b - a) / np.linalg.norm(b - a)
        n = np.array([-d[1], d[0]])
        count = int(np.linalg.norm(b - a) / 0.9)
        along = a[None] + np.linspace(0, 1, count + 1)[:, None] * (b - a)[None]
        lump = 1 + 0.12 * rng.standard_normal((len(HEDGE), count + 1))
        xy = along[None] + (HEDGE[:, 0][:, None] * lump)[..., None] * n
        up = HEDGE[:, 1][:, None] * (1 + 0.03 * rng.standard_normal((len(HEDGE), count + 1)))
        grid = np.concatenate([xy, (z + up)[..., None]], -1)[::-1]
        made.append(sheet(grid))
        caps.append(sheet(grid[3:6] + [0.0, 0.0, 0.05]))
    return made, caps


def _trees(edge: Bounds, place: Scenery, finish: Callable[[str], Finish], *, rng: np.random.Generator) -> list[Part]:
    """Some kinds of tree, each standing in several places near the edge of the plot."""
    parts = []
    x0, y0, x1, y1 = edge
    leafy, firs = place.table.trees
    kinds = [(k, False, leafy // 3 + (k < leafy % 3)) for k in range(3)]
    kinds += [(k, True, firs // 2 + (k < firs % 2)) for k in range(2)]
    water = round(place.outlook / (math.pi / 2)) % 4 if place.table.water is not None else None
    for k, fir, count in kinds:
        if not count:
            continue
        if fir:
            tall = 6.0 + 2.5 * k
            trunk = tube([(0, 0, -0.2), (0, 0, tall * 0.5)], [0.16, 0.08], 7)
            meshes = [part(BARK, trunk), part(finish(f"foliage/{FIRS}"), _fir(tall, rng=rng))]
        elif place.season == "winter":
            meshes = [part(BARK, _bare(3.8 + 1.6 * k, rng=rng))]
        else:
            trunk, crown = _tree(3.8 + 1.6 * k, rng=rng)
            meshes = [part(BARK, trunk), part(finish(f"foliage/{LEAFY[place.season][k % 2]}"), crown)]
        for _ in range(count):
            side, t = int(rng.integers(4)), rng.random()
            usual = (-3.5, -0.8 if place.table.neighbours else 4.0)
            away = rng.uniform(*((-3.0, 7.0) if place.landscape == "forest" else usual))
            if side == water:
                side = (side + 1) % 4
            middle, along, out, half = side_frame(edge, side * math.pi / 2)
            x, y = middle + along * (2 * t - 1) * half + out * away
            yaw = float(rng.uniform(0, 6.28))
            name = f"outdoor/{'fir' if fir else 'tree'}_{k}"
            parts += [
                Part("outdoor/trees", "outdoor", "", m, f"{name}_{i}", (float(x), float(y), -place.height), yaw)
                for i, m in enumerate(meshes)
            ]
    return parts


def _fir(height: float, *, rng: np.random.Generator) -> Shape:
    """Whorls of hanging branches, each a few broad needles of green."""
    shapes, levels = [], 15
    for i in range(levels):
        t = i / levels
        reach, z, count = height * 0.21 * (1 - t) ** 0.85 + 0.12, height * (0.08 + 0.9 * t), 11 - i // 2
        for k in range(count):
            yaw = 2 * math.pi * (k + 0.5 * (i % 2)) / count + rng.uniform(-0.15, 0.15)
            out, side = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
            far = reach * rng.uniform(0.75, 1.15)
            half = 0.36 * far + 0.04
            at = lambda d, s, up, out=out, side=side, z=z: (*(out * d + side * s), z + up)
            high, low = height * 0.075, -0.20 * far
            tip = at(far, 0, low)
            root, spine = at(0, 0, high), at(0.6 * far, 0, high * 0.25 + low * 0.3)
            left, right = at(0.55 * far, -half, low * 0.6), at(0.55 * far, half, low * 0.6)
            shapes += [(root, left, spine), (left, tip, spine), (root, spine, right), (right, spine, tip)]
    return facets(shapes).two_sided()


def _bare(height: float, *, rng: np.random.Generator) -> Shape:
    """A tree without leaves: branches that fork three times."""
    shapes = [tube([(0, 0, -0.2), (0.05, 0.02, height * 0.3), (0, 0.05, height * 0.62)], [0.17, 0.13, 0.06], 6)]

    def grow(a: np.ndarray, way: np.ndarray, length: float, thick: float, level: int) -> None:
        b = a + way * length
        shapes.append(tube([tuple(a), tuple(b)], [thick, 0.5 * thick], 4 if level else 3, caps=False))
        for _ in range((5, 4, 0)[2 - level]):
            to = way + rng.normal(0, 0.55, 3) + [0, 0, 0.25]
            fork = a + way * length * rng.uniform(0.45, 1.0)
            grow(fork, to / np.linalg.norm(to), length * rng.uniform(0.45, 0.7), 0.5 * thick, level - 1)

    for i in range(8):
        yaw, level = 2.4 * i + rng.uniform(-0.4, 0.4), 0.34 + 0.3 * i / 8
        way = np.array([math.cos(yaw), math.sin(yaw), 0.9])
        grow(np.array([0, 0.03, height * level]), way / np.linalg.norm(way), height * 0.26, 0.045, 2)
    return joined(*shapes)


def _tree(height: float, *, rng: np.random.Generator) -> tuple[Shape, Shape]:
    """A trunk with branches, and a crown of leafy clumps with gaps between them."""
    trunk = [tube([(0, 0, -0.2), (0.05, 0.02, height * 0.3), (0.0, 0.05, height * 0.62)], [0.17, 0.13, 0.06], 7)]
    crown = [_clump(np.array([0.0, 0.05, height * 0.80]), height * 0.17, rng=rng)]
    for i in range(CLUMPS):
        yaw, level = 2.4 * i + rng.uniform(-0.4, 0.4), 0.46 + 0.34 * (i + rng.random()) / CLUMPS
        out = height * (0.24 - 0.30 * (level - 0.46)) * rng.uniform(0.75, 1.15)
        at = np.array([out * np.cos(yaw), out * np.sin(yaw), height * level])
        crown.append(_clump(at, height * rng.uniform(0.09, 0.14), rng=rng))
        trunk.append(tube([(0, 0.03, height * (level - 0.12)), tuple(at)], [0.05, 0.02], 4))
    return joined(*trunk), joined(*crown)


def _clump(at: np.ndarray, radius: float, *, rng: np.random.Generator) -> Shape:
    """Leaves on the end of a branch: a ball whose surface goes in and out by a third from one bunch to the next."""
    k = np.arange(BUNCHES)
    z = 1 - (2 * k + 1) / BUNCHES
    yaw = k * math.pi * (3 - math.sqrt(5)) + rng.uniform(0, 2 * math.pi)
    out = np.column_stack([np.sqrt(1 - z * z) * np.cos(yaw), np.sqrt(1 - z * z) * np.sin(yaw), z])
    faces = ConvexHull(out).simplices
    a, b, c = out[faces.T]
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces = np.where(inward[:, None], faces[:, ::-1], faces)
    vertices = out * (radius * rng.uniform(0.62, 1.38, BUNCHES))[:, None] * [1.15, 1.15, 0.8] + at
    uv = vertices[:, [0, 2]] + 0.6 * vertices[:, [1, 1]]  # no seam
    return Shape(vertices, faces, out, uv)


def _storey_shell(house: House, k: int, drop: float) -> tuple[list[Shape], list[Shape]]:
    """Facade of one storey with its openings, and its roof (and soffit) where no storey covers it."""
    storey = house.storeys[k]
    low = storey.elevation - (drop if k == 0 else 0.0)
    last = k + 1 == len(house.storeys)
    high = storey.elevation + storey.height + 0.25 if last else house.storeys[k + 1].elevation
    outline = footprint(house, k)
    out = house.outer_wall - house.inner_wall / 2
    own = [o for o in house.openings if house.room_by_id[o.rooms[0]].storey == k and o.kind != "roof_window"]
    openings = [(o, out if o.rooms[1] is None else 0.0) for o in own]
    low_rooms = [(r, roof.covered(house, r)) for r in house.rooms if r.storey == k and r.slopes]
    grown = [area.buffer(1e-3, join_style="mitre") for _, area in low_rooms]
    upright = outline.difference(shapely.union_all(grown)) if grown else outline
    walls, parts = [], shapely.get_parts(upright).tolist()
    rooms: list[Room | None] = [*([None] * len(parts)), *(r for r, _ in low_rooms)]
    for polygon, room in zip([*parts, *(area for _, area in low_rooms)], rooms, strict=True):
        polygon = shapely.geometry.polygon.orient(polygon)
        for ring in [polygon.exterior, *polygon.interiors]:
            points = np.asarray(ring.coords)[:-1][::-1]
            for p, q in zip(points, np.roll(points, -1, axis=0)):
                holes = sorted(h for o, t in openings if (h := hole_on(p, q, o, storey.elevation, t)) is not None)
                face = roof.face(house, room, p, q, low, holes, up=roof.ROOF) if room is not None else None
                walls.append(face or wall_face(p, q, low, high, holes))
    above = footprint(house, k + 1) if not last else shapely.Polygon()
    below = footprint(house, k - 1) if k > 0 else shapely.Polygon()
    lids = [shape for r, area in low_rooms for shape in roof.ceilings(house, r, area, roof.ROOF)]
    if not (lid := upright.difference(above)).is_empty:
        lids.append(flat(lid, high))
    if k > 0 and not (soffit := outline.difference(below)).is_empty:
        lids.append(flat(soffit, low, up=False))
    return walls, lids
