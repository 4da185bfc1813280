"""What is seen through the windows: the house's own facade and roof, the ground, balconies, far things."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import shapely
from scipy.spatial import ConvexHull

from assets.built.primitives import Shape, bar, box, extruded, flat, joined, part, sheet, tube
from assets.records import Finish
from embodied.house.house import House
from embodied.scene.part import Part
from embodied.scene.walls import hole_on, room_union, wall_face
from embodied.seeds import stream

GROUND_DROP = 0.15
"""How far the ground lies below the ground floor, metres."""
GARDEN = 11.0
"""From the house to the hedge, metres."""
RAIL = Finish(color=(0.10, 0.10, 0.11, 1.0), roughness=0.5)
BARK = Finish(color=(0.26, 0.21, 0.17, 1.0), roughness=0.95, specular=0.1)

CLUMPS, BUNCHES = 13, 70
"""Of a tree's crown, and of the leaves of a clump."""

PIECES = ("facade", "roof", "ground", "terrace", "hedge", "trees")
"""Owners outside are 'outdoor/<piece>'."""

FACADES = ("render_white/0", "render_white/1", "brick_red/0", "render_white/2")


def facade_finish(house: House) -> str:
    """Material key of the outer walls, the same all around one house."""
    return FACADES[int(stream(house.seed, "outdoors", "facade").integers(len(FACADES)))]


def footprint(house: House, storey: int) -> shapely.Geometry:
    """The outline of one storey's outer walls, metres, world."""
    return room_union(house, storey).buffer(house.outer_wall - house.inner_wall / 2, join_style="mitre")


def outdoor_parts(house: House, finish: Callable[[str], Finish]) -> list[Part]:
    """All parts of kind 'outdoor', nearest first; the same for the same house."""
    walls, roofs = [], []
    for k in range(len(house.storeys)):
        shape, lids = _storey_shell(house, k)
        walls += shape
        roofs += lids
    rng = stream(house.seed, "outdoors", "garden")
    lawn = finish(f"lawn/{int(rng.random() < 0.3)}")
    parts = [
        _part("facade", finish(facade_finish(house)), walls),
        _part("roof", Finish(color=(0.35, 0.34, 0.33, 1.0), roughness=0.9), roofs),
        _part("ground", lawn, [_ground(house)]),
    ]
    slabs, rails = _terraces(house)
    if slabs:
        parts.append(_part("terrace", finish("paving/0"), slabs))
    if rails:
        parts.append(_part("terrace", RAIL, rails, "#rails"))
    x0, y0, x1, y1 = footprint(house, 0).bounds
    edge = (x0 - GARDEN, y0 - GARDEN, x1 + GARDEN, y1 + GARDEN)
    parts.append(_part("hedge", finish("foliage/1"), _hedges(*edge, rng=rng)))
    parts += _trees(edge, finish, rng=rng)
    return parts


def _part(piece: str, finish: Finish, shapes: list[Shape], tag: str = "") -> Part:
    return Part(f"outdoor/{piece}", "outdoor", "", part(finish, *shapes), f"outdoor/{piece}{tag}")


def _ground(house: House) -> Shape:
    """The lawn from the house to the hedge; what lies beyond is painted on the sky."""
    x0, y0, x1, y1 = footprint(house, 0).bounds
    plot = shapely.box(x0 - GARDEN, y0 - GARDEN, x1 + GARDEN, y1 + GARDEN).difference(footprint(house, 0))
    return flat(plot, house.storeys[0].elevation - GROUND_DROP)


def _terraces(house: House) -> tuple[list[Shape], list[Shape]]:
    """A paved slab before each door that leads out; upstairs a balcony with a railing."""
    slabs, rails = [], []
    for o in house.openings:
        if o.rooms[1] is not None or o.kind not in ("front_door", "back_door", "french_window", "garage_door"):
            continue
        a, b = np.asarray(o.a), np.asarray(o.b)
        d = (b - a) / np.linalg.norm(b - a)
        room = house.room_by_id[o.rooms[0]]
        n = np.array([-d[1], d[0]])
        if shapely.Polygon(room.polygon).contains(shapely.Point((a + b) / 2 + 0.03 * n)):
            n = -n
        upstairs = room.storey > 0
        side, deep = (0.5, 1.3) if upstairs or o.kind in ("front_door", "garage_door") else (1.2, 3.0)
        near = house.outer_wall - house.inner_wall / 2
        ring = [
            a - side * d + near * n,
            b + side * d + near * n,
            b + side * d + (near + deep) * n,
            a - side * d + (near + deep) * n,
        ]
        area = shapely.geometry.polygon.orient(shapely.Polygon(ring)).difference(footprint(house, room.storey))
        z = house.storey_of(room).elevation
        for piece in shapely.get_parts(area):
            if piece.geom_type != "Polygon" or piece.area < 0.2:
                continue
            slabs.append(extruded(piece, z - (0.18 if upstairs else GROUND_DROP), z - 0.02))
        if upstairs:
            line = np.array([ring[0], ring[3], ring[2], ring[1]])
            for p, q in itertools.pairwise(line):
                rails.append(bar((*p, z + 1.0), (*q, z + 1.0), 0.05, 0.04, 0.006))
                for t in np.linspace(0, 1, max(2, round(np.linalg.norm(q - p) / 0.12))):
                    x, y = p + t * (q - p)
                    rails.append(box([x - 0.007, y - 0.007, z - 0.02], [x + 0.007, y + 0.007, z + 1.0]))
    return slabs, rails


def _hedges(x0: float, y0: float, x1: float, y1: float, *, rng: np.random.Generator) -> list[Shape]:
    """Clipped hedges around the plot, with an uneven face."""
    made = []
    sides = [((x0, y0), (x1, y0)), ((x1, y0), (x1, y1)), ((x1, y1), (x0, y1)), ((x0, y1), (x0, y0))]
    for a, b in np.array(sides):
        d = (b - a) / np.linalg.norm(b - a)
        n = np.array([-d[1], d[0]])
        count = int(np.linalg.norm(b - a) / 0.9)
        across = np.array(
            [
                (0.42, -0.2),
                (0.45, 0.5),
                (0.42, 1.2),
                (0.28, 1.52),
                (0.0, 1.6),
                (-0.28, 1.52),
                (-0.42, 1.2),
                (-0.45, 0.5),
                (-0.42, -0.2),
            ]
        )
        along = a[None] + np.linspace(0, 1, count + 1)[:, None] * (b - a)[None]
        lump = 1 + 0.12 * rng.standard_normal((len(across), count + 1))
        xy = along[None] + (across[:, 0][:, None] * lump)[..., None] * n
        z = across[:, 1][:, None] * (1 + 0.03 * rng.standard_normal((len(across), count + 1)))
        made.append(sheet(np.concatenate([xy, z[..., None]], -1)[::-1]))
    return made


def _trees(
    bounds: tuple[float, float, float, float], finish: Callable[[str], Finish], *, rng: np.random.Generator
) -> list[Part]:
    """Three kinds of tree, each standing in three places near the hedge."""
    parts = []
    x0, y0, x1, y1 = bounds
    for k in range(3):
        trunk, crown = _tree(3.8 + 1.6 * k, rng=rng)
        meshes = [part(BARK, trunk), part(finish(f"foliage/{k % 2}"), crown)]
        for _ in range(3):
            side, t, away = int(rng.integers(4)), rng.random(), rng.uniform(-3.0, 4.0)
            x = (x0 - away, x1 + away)[side % 2] if side < 2 else x0 + t * (x1 - x0)
            y = (y0 - away, y1 + away)[side % 2] if side >= 2 else y0 + t * (y1 - y0)
            yaw = float(rng.uniform(0, 6.28))
            parts += [
                Part(
                    "outdoor/trees", "outdoor", "", m, f"outdoor/tree_{k}_{i}", (float(x), float(y), -GROUND_DROP), yaw
                )
                for i, m in enumerate(meshes)
            ]
    return parts


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
    reach = radius * rng.uniform(0.62, 1.38, BUNCHES)
    vertices = out * reach[:, None] * [1.15, 1.15, 0.8] + at
    uv = vertices[:, [0, 2]] + 0.6 * vertices[:, [1, 1]]  # no seam
    return Shape(vertices, faces, out, uv)


def _storey_shell(house: House, k: int) -> tuple[list[Shape], list[Shape]]:
    """Facade of one storey with its openings, and its roof (and soffit) where no storey covers it."""
    storey = house.storeys[k]
    low = storey.elevation - (GROUND_DROP if k == 0 else 0.0)
    last = k + 1 == len(house.storeys)
    high = storey.elevation + storey.height + 0.25 if last else house.storeys[k + 1].elevation
    outline = footprint(house, k)
    openings = [o for o in house.openings if o.rooms[1] is None and house.room_by_id[o.rooms[0]].storey == k]
    walls = []
    for polygon in shapely.get_parts(outline):
        polygon = shapely.geometry.polygon.orient(polygon)
        for ring in [polygon.exterior, *polygon.interiors]:
            points = np.asarray(ring.coords)[:-1][::-1]
            for p, q in zip(points, np.roll(points, -1, axis=0)):
                holes = [hole_on(p, q, o, storey.elevation, house.outer_wall - house.inner_wall / 2) for o in openings]
                walls.append(wall_face(p, q, low, high, sorted(h for h in holes if h is not None)))
    above = footprint(house, k + 1) if not last else shapely.Polygon()
    below = footprint(house, k - 1) if k > 0 else shapely.Polygon()
    lids = []
    if not (roof := outline.difference(above)).is_empty:
        lids.append(flat(roof, high))
    if k > 0 and not (soffit := outline.difference(below)).is_empty:
        lids.append(flat(soffit, low, up=False))
    return walls, lids
