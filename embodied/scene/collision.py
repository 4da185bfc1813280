"""Simple collision shapes: a handful of boxes for every object, and boxes around the openings of walls."""

import dataclasses
import itertools
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from scipy import ndimage

from embodied.assets.cache import atomic_path, digest
from embodied.assets.closure import code_digest
from embodied.assets.json_file import parse_file
from embodied.assets.records import Asset, MeshPart, Size
from embodied.geometry import r2
from embodied.house.house import House, Room
from embodied.house.shapes import opening_of

UNCOUNTED_MODULES = (
    "embodied.assets", "embodied.assets.data", "embodied", "embodied.house", "embodied.house.house",
    "embodied.house.shapes", "embodied.scene",
)  # fmt: skip
"""Modules that do not count as code of boxes: packages' names, the catalogue's rows, and houses, which boxes know
nothing of."""
GRID_CELLS = (20, 14, 10, 7, 5, 3, 2)
"""Cells along the longest side of the occupancy grid, tried from fine to coarse until few enough boxes remain."""
MOST_BOXES = 30
SLAB = 0.02
"""Thickness in metres of the board under a support surface."""
EVEN = 0.006
"""Unevenness of a support surface that is smoothed away, metres."""
THINNEST = 0.002
"""Half thickness below which a box is thickened, metres."""
ONE_BOX = 0.35
"""Objects no larger than this in metres, without support surfaces, are one box."""

DENSITIES = (
    ("metal", 900.0),
    ("stone", 2000.0),
    ("marble", 2000.0),
    ("ceramic", 1200.0),
    ("glass", 1200.0),
    ("wood", 500.0),
    ("leather", 200.0),
    ("fabric", 120.0),
    ("plastic", 300.0),
    ("paper", 600.0),
)
"""Material word to kg per cubic metre of what a box encloses (things are hollow)."""
DENSITY = 300.0


@dataclass(frozen=True)
class CollisionBox:
    """A box turned about z by `yaw` radians; upright but for the slopes of roofs."""

    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    """Half extents, metres."""
    yaw: float = 0.0
    tilt: float = 0.0
    """Turn about its own x axis before that, radians."""


def kept_boxes(asset: Asset, parts: Sequence[MeshPart], size: Size, cache: Path) -> tuple[CollisionBox, ...]:
    """`object_boxes`, kept on disk under what they depend on, code included; nonsense in a file is made again."""
    surfaces = [dataclasses.astuple(s) for s in asset.surfaces]
    meshes = [array.tobytes() for p in parts for array in (p.vertices, p.faces)]
    key = digest(code_digest(__name__, without=UNCOUNTED_MODULES), surfaces, asset.size, size, *meshes)[:32]
    path = Path(cache) / "collision" / f"{key}.json"
    try:
        rows = np.array(parse_file(path), float).reshape(-1, 7)
        if np.isfinite(rows).all() and (rows[:, 3:6] > 0).all():
            return tuple(CollisionBox(tuple(r[:3]), tuple(r[3:6]), r[6]) for r in rows.tolist())
    except (OSError, ValueError, TypeError):
        path.unlink(missing_ok=True)
    boxes = object_boxes(asset, parts, size)
    with atomic_path(path, sync=False) as temporary:
        temporary.write_text(json.dumps([[*map(float, (*b.centre, *b.half, b.yaw))] for b in boxes]))
    return boxes


def object_boxes(asset: Asset, parts: Sequence[MeshPart], size: Size) -> tuple[CollisionBox, ...]:
    """Boxes that cover an object and leave the space under tables and over its support surfaces free.

    Args:
      asset: gives the support surfaces, in the asset's own size.
      parts: the object's meshes scaled to `size`, in the asset frame.
      size: (width, depth, height) of the placed object, metres.
    """
    scale = np.asarray(size) / np.asarray(asset.size)
    slabs, free, points = [], [], surface_points(parts)
    for s in asset.surfaces:
        low = np.array([s.x0, s.y0, s.z]) * scale
        high = np.array([s.x1, s.y1, s.z + s.headroom]) * scale
        inside = np.all((points[:, :2] > low[:2]) & (points[:, :2] < high[:2]), axis=1)
        points[inside & (np.abs(points[:, 2] - low[2]) < EVEN), 2] = low[2]
        points = points[~(inside & (points[:, 2] > low[2]) & (points[:, 2] < high[2]))]
        free.append((low, high))
        bottom = max(low[2] - SLAB, 0.0)
        slabs.append((np.append(low[:2], bottom), np.append(high[:2], max(low[2], bottom + 2 * THINNEST))))
    if not len(points):
        return tuple(_box(low, high) for low, high in slabs)
    whole = points.min(axis=0), points.max(axis=0)
    if not slabs and (max(size) < ONE_BOX or _volume(grid_boxes(points, 5)) > 0.97 * _volume([whole])):  # a crate
        return (_box(*whole),)
    cut = sorted({round(float(high[2]), 4) + 1e-6 for _, high in slabs} | set(levels(parts)))
    for n in GRID_CELLS:
        bounds = grid_boxes(points, n, cut, MOST_BOXES)
        if len(bounds) <= MOST_BOXES:
            break
    else:
        bounds = [whole]
    for low, high in free:
        bounds = [piece for b in bounds for piece in without(b, (low, high))]
    return tuple(_box(low, high, whole[0]) for low, high in (*slabs, *bounds))


def surface_points(parts: Sequence[MeshPart], n: int = 6000) -> np.ndarray:
    """(k, 3) points spread evenly over the surface of `parts` (`embodied.geometry.r2`), vertices included."""
    corners = np.concatenate([p.vertices[p.faces] for p in parts]).astype(float)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if areas.sum() <= 0:
        return corners.reshape(-1, 3)
    k = np.arange(n)
    chosen = corners[np.searchsorted(np.cumsum(areas) / areas.sum(), (k + 0.5) / n).clip(max=len(corners) - 1)]
    first, second = r2(k)
    a, b = np.sqrt(first % 1)[:, None], (second % 1)[:, None]
    spread = (1 - a) * chosen[:, 0] + a * (1 - b) * chosen[:, 1] + a * b * chosen[:, 2]
    return np.concatenate([spread, corners.reshape(-1, 3)[:: max(1, len(corners) // 1000)]])


def without(
    one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """The part of box `one` outside box `other` as up to six boxes; all given as (low, high) corners."""
    low, high = one[0].copy(), one[1].copy()
    if np.any(low >= other[1] - 1e-6) or np.any(high <= other[0] + 1e-6):
        return [one]
    pieces = []
    for axis in (2, 0, 1):
        if low[axis] < other[0][axis] - 1e-6:
            cut = high.copy()
            cut[axis] = other[0][axis]
            pieces.append((low.copy(), cut))
            low[axis] = other[0][axis]
        if high[axis] > other[1][axis] + 1e-6:
            cut = low.copy()
            cut[axis] = other[1][axis]
            pieces.append((cut, high.copy()))
            high[axis] = other[1][axis]
    return pieces


def levels(parts: Sequence[MeshPart]) -> tuple[float, ...]:
    """Heights of horizontal faces (undersides just below, tops just above), metres: where to cut the grid. Faces at
    one height must cover a tenth of the thing's outline."""
    corners = np.concatenate([p.vertices[p.faces] for p in parts]).astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    flat = np.abs(normals[:, 2]) > 0.98 * np.linalg.norm(normals, axis=1)
    heights = corners[flat][:, :, 2].mean(axis=1)
    sides = np.where(normals[flat, 2] > 0, 1, -1)
    keys, group = np.unique(np.stack([np.rint(heights / 0.004), sides]), axis=1, return_inverse=True)
    areas = np.bincount(group.ravel(), np.abs(normals[flat, 2]), keys.shape[1])
    many = np.bincount(group.ravel(), minlength=keys.shape[1])
    mean = np.bincount(group.ravel(), heights, keys.shape[1]) / np.maximum(many, 1)
    outline = np.prod(np.ptp(corners.reshape(-1, 3), axis=0)[:2])
    large = np.argsort(-areas)[:8]
    return tuple(float(mean[i] + 1e-5 * keys[1, i]) for i in large if areas[i] > 0.1 * outline)


def _volume(boxes: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    return sum(float(np.prod(high - low)) for low, high in boxes)


def grid_boxes(
    points: np.ndarray, n: int, cut: Sequence[float] = (), most: int = 10**6
) -> list[tuple[np.ndarray, np.ndarray]]:
    """(low, high) corners of boxes that cover `points` (k, 3), from a grid of cubes, n along the longest side.

    The grid is cut at the heights `cut` too; cavities without a way out are filled. Every box is shrunk to the points
    in it, so a table top stays thin and its height exact; what nearly reaches the bounds of the whole reaches them, so
    that a thing stands on all its feet. Stops as soon as there are more than `most` boxes.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    counts = np.maximum(1, np.rint((high - low) / ((high - low).max() / n + 1e-12))).astype(int)
    edges = [np.linspace(low[i], high[i] + 1e-9, counts[i] + 1) for i in range(3)]
    edges[2] = np.unique(np.concatenate([edges[2], [z for z in cut if low[2] < z < high[2]]]))
    cells = [np.clip(np.searchsorted(e, points[:, i], side="right") - 1, 0, len(e) - 2) for i, e in enumerate(edges)]
    shape = tuple(len(e) - 1 for e in edges)
    flat = np.ravel_multi_index(cells, shape)
    order = np.argsort(flat, kind="stable")
    filled_cells, first = np.unique(flat[order], return_index=True)
    lows, highs = np.full((math.prod(shape), 3), np.inf), np.full((math.prod(shape), 3), -np.inf)
    lows[filled_cells] = np.minimum.reduceat(points[order], first)
    highs[filled_cells] = np.maximum.reduceat(points[order], first)
    lows, highs = lows.reshape(*shape, 3), highs.reshape(*shape, 3)
    occupied = np.isfinite(lows[..., 0])
    filled = ndimage.binary_fill_holes(occupied)
    snap = 0.25 * (high - low) / counts
    boxes: list[tuple[np.ndarray, np.ndarray]] = []
    for x, y, z in np.argwhere(filled).tolist():
        if not filled[x, y, z]:
            continue
        if len(boxes) > most:
            break
        block = _grow(filled, x, y, z)
        filled[block] = False
        if occupied[block].any():
            inner, outer = lows[block].min(axis=(0, 1, 2)), highs[block].max(axis=(0, 1, 2))
            boxes.append((np.where(inner - low < snap, low, inner), np.where(high - outer < snap, high, outer)))
    return boxes


def _grow(filled: np.ndarray, x: int, y: int, z: int) -> tuple[slice, slice, slice]:
    """The block of true cells from (x, y, z) on, grown along x, then y, then z."""
    x1, y1, z1 = x + 1, y + 1, z + 1
    while x1 < filled.shape[0] and filled[x1, y, z]:
        x1 += 1
    while y1 < filled.shape[1] and filled[x:x1, y1, z].all():
        y1 += 1
    while z1 < filled.shape[2] and filled[x:x1, y:y1, z1].all():
        z1 += 1
    return slice(x, x1), slice(y, y1), slice(z, z1)


def _box(low: np.ndarray, high: np.ndarray, least: np.ndarray | None = None) -> CollisionBox:
    """The box between two corners, thickened downwards where too thin, but not below `least`."""
    half = np.maximum((high - low) / 2, THINNEST)
    centre = (low + high) / 2
    centre[2] = high[2] - half[2]
    if least is not None:
        centre[2] = max(centre[2], least[2] + half[2])
    return CollisionBox(tuple(centre.tolist()), tuple(half.tolist()))


def bounding_box(vertices: np.ndarray) -> CollisionBox:
    """The box around `vertices` (n, 3), in their own frame."""
    return _box(vertices.min(axis=0).astype(float), vertices.max(axis=0).astype(float))


def density_of(asset: Asset) -> float:
    """Kilograms per cubic metre of the asset's boxes, from its material words."""
    return next((d for word, d in DENSITIES if any(word in m for m in asset.materials)), DENSITY)


def floor_boxes(house: House, room: Room, thickness: float = 0.2) -> tuple[CollisionBox, ...]:
    """Boxes under the floor of `room`; oblique rooms are covered by boxes up to half a metre beyond."""
    polygon, top = shapely.Polygon(room.polygon), house.storey_of(room).elevation
    wells = [opening_of(s) for s in house.stairs if s.rooms[1] == room.id]
    corners = [*room.polygon, *(c for w in wells for c in w.exterior.coords)]
    polygon = polygon.difference(shapely.union_all(wells)) if wells else polygon
    xs, ys = (sorted({round(c[i], 6) for c in corners}) for i in (0, 1))
    boxes = []
    for x0, x1 in itertools.pairwise(xs):
        for y0, y1 in itertools.pairwise(ys):
            if polygon.intersects(shapely.box(x0 + 1e-3, y0 + 1e-3, x1 - 1e-3, y1 - 1e-3)):
                boxes.append(_box(np.array([x0, y0, top - thickness]), np.array([x1, y1, top])))
    return tuple(boxes)


def wall_boxes(house: House, room: Room, edge: int) -> tuple[CollisionBox, ...]:
    """Boxes of the wall along polygon edge `edge` of `room`, on the room's side of its centre line."""
    storey = house.storey_of(room)
    a, b = (np.array(room.polygon[i % len(room.polygon)]) for i in (edge, edge + 1))
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length
    holes = []
    for o in house.openings:
        if room.id in o.rooms:
            ends = np.array([o.a, o.b]) - a
            if np.abs(ends @ [along[1], -along[0]]).max() < 1e-3:
                s = np.sort(ends @ along)
                if s[0] > -1e-3 and s[1] < length + 1e-3:
                    holes.append((s[0], s[1], o.sill, o.head))
    thickness, reach = house.inner_wall / 2, house.inner_wall / 2
    pieces, start = [], -reach
    for s0, s1, sill, head in sorted(holes):
        pieces += [(start, s0, 0.0, storey.height), (s0, s1, 0.0, sill), (s0, s1, head, storey.height)]
        start = s1
    pieces.append((start, length + reach, 0.0, storey.height))
    inward, yaw = np.array([-along[1], along[0]]), float(np.arctan2(along[1], along[0]))
    boxes = []
    for s0, s1, z0, z1 in pieces:
        if s1 - s0 > 1e-3 and z1 - z0 > 1e-3:
            middle = a + along * (s0 + s1) / 2 + inward * thickness / 2
            centre = (float(middle[0]), float(middle[1]), storey.elevation + (z0 + z1) / 2)
            boxes.append(CollisionBox(centre, ((s1 - s0) / 2, thickness / 2, (z1 - z0) / 2), yaw))
    return tuple(boxes)
