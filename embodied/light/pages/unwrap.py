"""Unwrapping: every thing gets a flat atlas of its own, in luxels, to hold its light.

Furniture goes through xatlas once per geometry and is cached; walls, floors and ceilings are
unfolded plane by plane, so that one wall is one chart however many holes it has.
"""

import itertools
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from embodied.assets.cache import digest
from embodied.assets.closure import code_digest
from embodied.assets.decoding import load_record, save_record
from embodied.assets.records import MeshPart
from embodied.geometry import r2
from embodied.light.backend import Array, accumulate, dr, floats, fraction, mi, scene_of, vector

ONCE = 6000.0
"""Budget for which models are unwrapped; other budgets get the same charts at another density."""
SPARSEST = 0.36
"""Luxels per metre that large things get at least, times the square root of the budget."""
REST = 0.05
"""Seconds after which the threads of an atlas are surely asleep."""
_retired: list[tuple[Any, float]] = []
"""The atlas that is freed next, and since when it rests."""
UNCOUNTED_BY_UNWRAPPING = ("embodied.assets", "embodied.assets.data", "embodied", "embodied.light")
"""Modules that the code of an unwrapping does not count: what packages offer by name, and the catalogue's rows."""


@dataclass(frozen=True, eq=False)
class Unwrapped:
    """Triangles with their place in a flat atlas. m faces; corners in the frame they came in."""

    corners: np.ndarray
    """(m, 3, 3) float32, metres."""
    normals: np.ndarray
    """(m, 3, 3) float32, unit, on the side the face is seen from."""
    luxels: np.ndarray
    """(m, 3, 2) float32, atlas position in luxels, x right and y down."""
    uv: np.ndarray
    """(m, 3, 2) float32, the source's texture coordinates."""
    part: np.ndarray
    """(m,) int32, which MeshPart the face came from."""
    thin: np.ndarray
    """(m,) bool, faces that are seen and lit from both sides."""
    size: np.ndarray
    """(2,) int32, atlas width and height in luxels."""
    chart: np.ndarray
    """(m,) int32, which connected piece of the atlas the face lies in."""


def corners_of(parts: Sequence[MeshPart]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Faces of `parts` as corners (m, 3, 3), normals (m, 3, 3), uv (m, 3, 2) and part index (m,); slivers dropped."""
    corners = np.concatenate([p.vertices[p.faces] for p in parts]).astype(np.float64)
    normals = np.concatenate([p.normals[p.faces] for p in parts]).astype(np.float64)
    uv = np.concatenate([p.uv[p.faces] for p in parts]).astype(np.float64)
    part = np.concatenate([np.full(len(p.faces), i, np.int32) for i, p in enumerate(parts)])
    real = np.isfinite(corners).all((1, 2)) & (areas_of(corners) > 5e-9)
    uv = np.where(np.isfinite(uv), uv, 0.0)
    return corners[real], _on_the_face(corners[real], normals[real]), uv[real], part[real]


def areas_of(corners: np.ndarray) -> np.ndarray:
    """(m,) square metres of triangles (m, 3, 3)."""
    return 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)


def distinct(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k,) first occurrence of each different row of (n, c) numbers, in the order of their columns, and (n,) which of
    these each row is: what np.unique returns of axis 0, in a tenth of the time."""
    return told_apart(rows, np.lexsort(rows.T[::-1]))


def told_apart(rows: np.ndarray, order: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`distinct` of rows that are brought side by side by an order where they are alike."""
    in_order, new = rows[order], np.ones(len(rows), bool)
    new[1:] = (in_order[1:] != in_order[:-1]).any(1)
    which = np.empty(len(rows), np.int64)
    which[order] = np.cumsum(new) - 1
    return order[new], which


def face_normals(corners: np.ndarray) -> np.ndarray:
    """(m, 3) unit normals of triangles (m, 3, 3), counter-clockwise seen from outside."""
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return n / (np.linalg.norm(n, axis=1, keepdims=True) + 1e-20)


def unwrap_planes(parts: Sequence[MeshPart], density: float) -> Unwrapped:
    """Unfold flat things: one rectangle per plane, packed; what lies far apart in a plane (the top edges of a
    room's skirting) gets rectangles of its own.

    Args:
      parts: what walls, floors and ceilings are made of; every face is seen from its front.
      density: luxels per metre.
    """
    corners, normals, uv, part = corners_of(parts)
    n = face_normals(corners)
    offset = np.einsum("mk,mk->m", n, corners[:, 0])
    keys = np.concatenate([np.round(n * 200), np.round(offset[:, None] * 500), part[:, None]], axis=1).astype(np.int64)
    chart = _strips(corners, distinct(keys)[1])
    flat = np.zeros((len(corners), 3, 2))
    sizes = []
    for c in range(chart.max() + 1):
        in_chart = chart == c
        across = np.cross([0.0, 0.0, 1.0], n[in_chart][0])
        across = across / np.linalg.norm(across) if np.linalg.norm(across) > 0.05 else np.array([1.0, 0.0, 0.0])
        up = np.cross(n[in_chart][0], across)
        q = np.stack([corners[in_chart] @ across, -(corners[in_chart] @ up)], axis=-1)
        if np.diff(np.ptp(q.reshape(-1, 2), axis=0)) > 0:  # what lies packs well
            q = np.stack([q[..., 1], -q[..., 0]], axis=-1)
        flat[in_chart] = (q - q.reshape(-1, 2).min(0)) * density
        sizes.append(np.ceil(flat[in_chart].reshape(-1, 2).max(0) - 1e-6).astype(int) + 2)
    places, size = pack(np.array(sizes))
    flat += places[chart][:, None] + 1.0
    return _single(Unwrapped(corners, normals, flat, uv, part, np.zeros(len(part), bool), size, chart))


def unwrap_model(parts: Sequence[MeshPart], budget: float, *, trusted: bool = False) -> Unwrapped:
    """Turn faces outwards, drop what nobody can see, unfold with xatlas.

    Args:
      parts: one asset, in its own frame.
      budget: luxels wanted for the whole asset; at most 160 per metre; large things get more, so
        that no density falls under 28 per metre for a budget of 6000.
      trusted: all faces are known to look outwards (joinery); no vote is held.

    Source: steps 2 and 3 of the bake prototype's recipe; the orientation vote asks 96 rays from
    either side of every face whether they leave the model.
    """
    import xatlas

    corners, normals, uv, part = corners_of(parts)
    if not len(corners):
        empty = np.zeros((0, 3, 3))
        flat = empty[..., :2]
        return _single(Unwrapped(empty, empty, flat, flat, part, np.zeros(0, bool), np.array([1, 1], np.int32), part))
    if not trusted:
        once = _without_doubles(corners)
        corners, normals, uv, part = (x[once] for x in (corners, normals, uv, part))
    front, back = (np.ones(len(corners)), np.zeros(len(corners))) if trusted else openness(corners)
    keep = _with_rings(corners, (front > 0) | (back > 0))
    corners, normals, uv, part, front, back = (x[keep] for x in (corners, normals, uv, part, front, back))
    flip = (back > 2 * front) & (front < 0.1)
    thin = (front > 0.12) & (back > 0.12)
    corners[flip], normals[flip], uv[flip] = corners[flip][:, ::-1], normals[flip][:, ::-1], uv[flip][:, ::-1]
    normals = _on_the_face(corners, normals)
    density = density_of(corners, budget)
    welded, index = _weld(corners, normals)
    atlas = xatlas.Atlas()
    atlas.add_mesh(welded[:, :3].astype(np.float32), index.astype(np.uint32), welded[:, 3:].astype(np.float32))
    charts, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    charts.max_iterations, charts.max_cost = 1, 5.0  # few, large charts: each costs a gutter
    packing.texels_per_unit, packing.padding, packing.bilinear, packing.create_image = density, 1, False, False
    atlas.generate(charts, packing)
    _, faces, place = atlas[0]  # faces keep their order, so part and uv carry over per corner
    luxels, size, chart = _repacked(place[faces] * [atlas.width, atlas.height], faces)
    _retire(atlas)
    return _single(Unwrapped(corners, normals, luxels, uv, part, thin, size, chart))


def _retire(atlas: Any) -> None:
    """Free the atlas that was retired before, once it has rested, and keep this one until then.

    xatlas ends its threads when an atlas is freed, and waits for ever for one that was just about to sleep and misses
    the call. (Seen once in some thousands of models, on a busy machine: the process stood still in ~TaskScheduler.)
    """
    if _retired:
        _, since = _retired[0]
        time.sleep(max(0.0, since + REST - time.monotonic()))
        _retired.clear()
    _retired.append((atlas, time.monotonic()))


def _repacked(luxels: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Charts as upright rectangles packed anew: xatlas leaves half of a sheet of strips empty.

    Args:
      luxels: (m, 3, 2). faces: (m, 3) int, vertices that belong to one chart each.

    Returns:
      (m, 3, 2) luxels, (2,) int32 width and height, and (m,) int32 chart of each face.
    """
    links = np.repeat(np.arange(len(faces)), 3), faces.ravel().astype(int)
    touch = coo_matrix((np.ones(len(links[0])), links)).tocsr()
    chart = connected_components(touch @ touch.T, directed=False)[1]
    low, _ = _corners_of(luxels, chart)
    return *_laid_out(luxels - np.floor(low)[chart][:, None], chart), chart


def _corners_of(luxels: np.ndarray, chart: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(c, 2) least and largest coordinates of each chart."""
    count = int(chart.max()) + 1
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, np.repeat(chart, 3), luxels.reshape(-1, 2))
    np.maximum.at(high, np.repeat(chart, 3), luxels.reshape(-1, 2))
    return low, high


def _laid_out(flat: np.ndarray, chart: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m, 3, 2) luxels of charts packed on a sheet, and its (2,) int32 width and height.

    Two luxels lie between charts, one for each, so that reading between luxels brings no light from another chart.

    Args:
      flat: (m, 3, 2) luxels from each chart's own corner on. chart: (m,) int.
    """
    sizes = np.ceil(_corners_of(flat, chart)[1] - 1e-4).astype(int) + 2
    lying = sizes[:, 0] > sizes[:, 1]
    turned = np.stack([flat[..., 1], sizes[chart, 0][:, None] - 2 - flat[..., 0]], axis=-1)
    flat = np.where(lying[chart][:, None, None], turned, flat)
    sizes[lying] = sizes[lying][:, ::-1]
    side = np.sqrt(sizes.prod(1).sum())
    places, size = min((pack(sizes, int(x * side) + 1) for x in (0.9, 1.0, 1.1, 1.25)), key=lambda p: int(p[1].prod()))
    return flat + places[chart][:, None], size


def density_of(corners: np.ndarray, budget: float) -> float:
    """Luxels per metre of a model of triangles (m, 3, 3): so many luxels for the whole, at most 160 per metre, and no
    fewer than `SPARSEST` says."""
    return float(np.clip(np.sqrt(budget / areas_of(corners).sum()), SPARSEST * np.sqrt(budget), 160.0))


def with_budget(flat: Unwrapped, before: float, budget: float) -> Unwrapped:
    """The same charts for another budget, packed anew; each stretched to whole luxels, as xatlas does it, so that what
    is thinner than a luxel keeps one.

    Args:
      before: the budget of `flat`.
    """
    if not len(flat.corners):
        return flat
    low, high = _corners_of(flat.luxels, flat.chart)
    scale = density_of(flat.corners, budget) / density_of(flat.corners, before)
    extent = (high - low) * scale
    whole = np.maximum(np.ceil(extent - 1e-2), 1.0)
    stretch = scale * np.where(extent > 1e-6, whole / np.maximum(extent, 1e-6), 1.0)
    luxels, size = _laid_out((flat.luxels - low[flat.chart][:, None]) * stretch[flat.chart][:, None], flat.chart)
    return replace(flat, luxels=luxels.astype(np.float32), size=size)


def cached_model(
    parts: Sequence[MeshPart], budget: float, cache: Path, *, trusted: bool = False, alone: bool = False
) -> Unwrapped:
    """`unwrap_model`, done once per geometry, at `ONCE`, and its charts packed once per budget; a damaged cache file,
    or one made by other code or libraries, is replaced.

    Args:
      alone: one house alone has this model: it is unwrapped for this budget.
    """
    arrays = [(p.vertices, p.faces, p.normals, p.uv) for p in parts]
    shapes = [digest(*(np.ascontiguousarray(a).tobytes() for a in of_part)) for of_part in arrays]

    def known(budget: float, make: Callable[[], Unwrapped]) -> Unwrapped:
        key = digest(code_digest(__name__, without=UNCOUNTED_BY_UNWRAPPING), round(budget), trusted, alone, shapes)
        path = Path(cache) / "unwrapped" / f"{key[:32]}.npz"
        if (stored := load_record(Unwrapped, path)) is not None:
            return stored
        made = make()
        save_record(made, path)
        return made

    if alone:
        return known(budget, lambda: unwrap_model(parts, budget, trusted=trusted))
    once = lambda: known(ONCE, lambda: unwrap_model(parts, ONCE, trusted=trusted))
    return once() if round(budget) == ONCE else known(budget, lambda: with_budget(once(), ONCE, budget))


def pack(sizes: np.ndarray, width: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Place rectangles, tallest first, each where its top comes to lie lowest.

    Args:
      sizes: (n, 2) int, widths and heights.
      width: of the sheet; by default a square that should hold them.

    Returns:
      (n, 2) int32 corners and (2,) int32 width and height of the sheet.

    Source: the skyline heuristic, bottom left (Jylaenki 2010, A Thousand Ways to Pack the Bin, sec. 2.4).
    """
    sizes = np.asarray(sizes, int)
    if width is None:
        width = int(np.sqrt(sizes.prod(1).sum() * 1.1)) + 1
    skyline = _Skyline(max(width, int(sizes[:, 0].max())))
    places = np.zeros((len(sizes), 2), np.int32)
    order = np.lexsort((-sizes[:, 0], -sizes[:, 1]))
    places[order] = [skyline.put(w, h) for w, h in sizes[order].tolist()]
    return places, (places + sizes).max(0).astype(np.int32)


class _Skyline:
    """How high a sheet is filled, as steps from left to right, neighbours of different heights."""

    def __init__(self, width: int) -> None:
        self._width, self._starts, self._heights = width, [0], [0]

    def put(self, width: int, height: int) -> tuple[int, int]:
        """Put a rectangle, no wider than the sheet, where it comes to lie lowest, leftmost of these; its corner."""
        at, stop, rest = self._lowest(width)
        x = self._starts[at]
        starts, heights = [x], [rest + height]
        if (self._starts[stop] if stop < len(self._starts) else self._width) > x + width:  # the last step sticks out
            starts.append(x + width)
            heights.append(self._heights[stop - 1])
        self._starts[at:stop], self._heights[at:stop] = starts, heights
        for k in (at + len(starts), at):
            if 0 < k < len(self._starts) and self._heights[k] == self._heights[k - 1]:
                del self._starts[k], self._heights[k]
        return x, rest

    def _lowest(self, width: int) -> tuple[int, int, int]:
        """The step that a rectangle best begins with, the step after those that it covers, and the height of the
        highest of these. (From one step's beginning to the next a place comes to lie only higher: what it leaves
        behind on the left is no whole step.)
        """
        starts, heights = self._starts, self._heights
        best, rest = (0, 0), sys.maxsize
        for first, x in enumerate(starts):
            if x + width > self._width:
                break
            stop, top = first, -1
            while stop < len(starts) and starts[stop] < x + width:
                top = max(top, heights[stop])
                if top >= rest:
                    break
                stop += 1
            else:
                best, rest = (first, stop), top
        return *best, rest


def _strips(corners: np.ndarray, chart: np.ndarray, full: float = 0.25, most: int = 100) -> np.ndarray:
    """Chart numbers, sparse charts cut up: joined piece by piece while what is joined fills 0.6 of its rectangle.

    Args:
      corners: (m, 3, 3). chart: (m,) int.
      full: charts that fill this share of their rectangle stay whole; so do those of over `most` faces.
    """
    out, area = np.zeros(len(chart), int), areas_of(corners)
    for c in range(chart.max() + 1):
        chart_faces = np.nonzero(chart == c)[0]
        pieces = [chart_faces]
        if len(chart_faces) <= most and area[chart_faces].sum() < full * _spread(corners[chart_faces]):
            pieces = [np.array([k]) for k in chart_faces]
            joined = True
            while joined:
                joined = False
                for a, b in itertools.combinations(range(len(pieces)), 2):
                    both = np.concatenate([pieces[a], pieces[b]])
                    if area[both].sum() > 0.6 * _spread(corners[both]):
                        pieces = [both, *(p for i, p in enumerate(pieces) if i not in (a, b))]
                        joined = True
                        break
        for piece in pieces:
            out[piece] = out.max() + 1
    return out - 1


def _spread(corners: np.ndarray) -> float:
    """Area of the rectangle around faces (m, 3, 3) of one plane, square metres."""
    size = np.sort(np.ptp(corners.reshape(-1, 3), axis=0))
    return float(size[1] * size[2])


def _single(flat: Unwrapped) -> Unwrapped:
    """The record with its coordinates in single precision."""
    corners, normals, luxels, uv = (
        np.ascontiguousarray(a, np.float32) for a in (flat.corners, flat.normals, flat.luxels, flat.uv)
    )
    return Unwrapped(corners, normals, luxels, uv, flat.part, flat.thin, flat.size, np.asarray(flat.chart, np.int32))


def _on_the_face(corners: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Vertex normals turned to their face's side; replaced by the face's where they disagree with it."""
    n = face_normals(corners)[:, None]
    side = np.where((normals * n).sum(-1, keepdims=True) < 0, -1.0, 1.0)
    normals = np.where(np.isfinite(normals), normals, 0.0) * side
    normals = normals / (np.linalg.norm(normals, axis=-1, keepdims=True) + 1e-12)
    return np.where((normals * n).sum(-1, keepdims=True) < 0.3, n, normals)


def openness(corners: np.ndarray, rays: int = 96) -> tuple[np.ndarray, np.ndarray]:
    """Share of cosine-distributed rays that leave the model from the front and the back of each face."""
    scene, n, centre = scene_of(corners), vector(face_normals(corners)), vector(corners.mean(1))
    turn = np.random.default_rng(0).random((2, len(corners)), np.float32)
    r0, r1 = floats(turn[0]), floats(turn[1])
    reach = max(1e-5, 1e-4 * float(np.ptp(corners.reshape(-1, 3), axis=0).max()))
    shares = []
    for side in (1.0, -1.0):
        frame, origin = mi.Frame3f(n * side), mi.Point3f(centre + n * (side * reach))

        def one(k: Array, frame: Array = frame, origin: Array = origin) -> tuple[Array, ...]:
            a, b = r2(mi.Float(k) + 1)
            d = frame.to_world(mi.warp.square_to_cosine_hemisphere(fraction(mi.Point2f(r0 + a, r1 + b))))
            return (dr.select(scene.ray_test(mi.Ray3f(origin, d)), 0.0, 1.0),)

        shares.append(np.asarray(accumulate(rays, one, dr.zeros(mi.Float, len(corners)))[0]) / rays)
    return shares[0], shares[1]


def _without_doubles(corners: np.ndarray) -> np.ndarray:
    """Faces (k,) in rising order, each triangle once: models list sheets once per side, and the vote settles the sides.

    Twice the triangles to draw is the lesser cost: edges with four faces break every chart of xatlas into crumbs.
    """
    _, spot = distinct(np.round(corners.reshape(-1, 3), 4))
    return np.sort(distinct(np.sort(spot.reshape(-1, 3), axis=1))[0])


def _with_rings(corners: np.ndarray, keep: np.ndarray, rings: int = 2) -> np.ndarray:
    """`keep` grown by vertex rings: faces beside a visible one are kept, else cracks open."""
    _, spot = distinct(np.round(corners.reshape(-1, 3), 4))
    spot = spot.reshape(-1, 3)
    for _ in range(rings):
        touched = np.zeros(spot.max() + 1, bool)
        touched[spot[keep]] = True
        keep = np.asarray(touched[spot].any(1))
    return keep


def _weld(corners: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shared vertices (n, 6) of position and normal, and faces (m, 3) into them."""
    both = np.concatenate([corners, normals], -1).reshape(-1, 6)
    first, index = distinct(np.round(both * [1, 1, 1, 0.02, 0.02, 0.02], 5))
    return both[first], index.reshape(-1, 3)
