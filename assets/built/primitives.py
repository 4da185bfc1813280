"""Small solid shapes with smooth normals and uv in metres, from which things are built in code.

Every function is pure. Points are (n, 3) float64 in metres; faces run counter-clockwise seen from outside. Texture
coordinates are metres along the surface, u along the grain; `part` divides them by the finish's tile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike

from embodied.assets.records import Finish, MeshPart, bounds


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh without a finish: (n, 3) vertices, (m, 3) faces, (n, 3) unit normals, (n, 2) uv in metres."""

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    uv: np.ndarray

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Shape:
        return Shape(self.vertices + [x, y, z], self.faces, self.normals, self.uv)

    def turned(self, angle: float, axis: str = "z") -> Shape:
        """Turned by `angle` radians, right-handed, about an axis through the origin."""
        i = "xyz".index(axis)
        j, k = (i + 1) % 3, (i + 2) % 3
        m = np.eye(3)
        m[j, j] = m[k, k] = np.cos(angle)
        m[k, j] = np.sin(angle)
        m[j, k] = -np.sin(angle)
        return Shape(self.vertices @ m.T, self.faces, self.normals @ m.T, self.uv)

    def hung(self, x: float, y: float, z: float) -> Shape:
        """The shape standing on a front at y instead of the floor: what was up looks along -y."""
        return self.turned(np.pi / 2, "x").moved(x, y, z)

    def scaled(self, x: float, y: float, z: float) -> Shape:
        """Scaled along the axes; a negative factor mirrors and keeps faces outward."""
        factors = np.array([x, y, z])
        faces = self.faces if np.prod(factors) > 0 else self.faces[:, ::-1]
        return Shape(self.vertices * factors, faces, _unit(self.normals / factors), self.uv)

    def reversed(self) -> Shape:
        """The same surface seen from its other side."""
        return Shape(self.vertices, self.faces[:, ::-1], -self.normals, self.uv)

    def two_sided(self) -> Shape:
        return joined(self, self.reversed())

    def shifted_uv(self, u: float, v: float) -> Shape:
        """The same shape cut from another place of its material, metres."""
        return Shape(self.vertices, self.faces, self.normals, self.uv + [u, v])


def joined(*shapes: Shape) -> Shape:
    """All `shapes` as one."""
    starts = np.cumsum([0, *(len(s.vertices) for s in shapes)])
    return Shape(
        np.concatenate([s.vertices for s in shapes]),
        np.concatenate([s.faces + k for s, k in zip(shapes, starts)]),
        np.concatenate([s.normals for s in shapes]),
        np.concatenate([s.uv for s in shapes]),
    )


def _unit(vectors: np.ndarray) -> np.ndarray:
    """(..., 3) vectors at length 1; zeros stay."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def part(finish: Finish, *shapes: Shape) -> MeshPart:
    """`shapes` as one mesh of `finish`, uv divided by its tile."""
    s = joined(*shapes)
    return MeshPart(
        s.vertices.astype(np.float32),
        s.faces.astype(np.int32),
        s.normals.astype(np.float32),
        (s.uv / (finish.tile or 1.0)).astype(np.float32),
        finish,
    )


def fitted(parts: Sequence[MeshPart], size: Sequence[float]) -> tuple[MeshPart, ...]:
    """`parts` scaled and moved so that their box is exactly `size`, origin at the centre of its base."""
    low, high = bounds(parts)
    factors = np.asarray(size, float) / np.maximum(high - low, 1e-9)
    origin = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
    done = []
    for p in parts:
        vertices, normals = (p.vertices - origin) * factors, _unit(p.normals / factors)
        done.append(MeshPart(vertices.astype(np.float32), p.faces, normals.astype(np.float32), p.uv, p.finish))
    return tuple(done)


def quads(corners: ArrayLike, uv: np.ndarray | None = None) -> Shape:
    """Flat quadrilaterals (m, 4, 3), counter-clockwise; uv (m, 4, 2) metres or projected along the face."""
    p = np.asarray(corners, float).reshape(-1, 4, 3)
    normals = _unit(np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]))
    base = 4 * np.arange(len(p))[:, None]
    faces = np.concatenate([base + [0, 1, 2], base + [0, 2, 3]], axis=1).reshape(-1, 3)
    vertices, normals = p.reshape(-1, 3), np.repeat(normals, 4, axis=0)
    uv = projected_uv(vertices, normals) if uv is None else np.asarray(uv, float).reshape(-1, 2)
    return Shape(vertices, faces, normals, uv)


def facets(corners: ArrayLike) -> Shape:
    """Flat triangles (m, 3, 3), counter-clockwise, but for those without area; uv projected as of `quads`."""
    p = np.asarray(corners, float)
    normals = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    sound = np.linalg.norm(normals, axis=1) > 1e-12
    vertices, normals = p[sound].reshape(-1, 3), np.repeat(_unit(normals[sound]), 3, axis=0)
    return Shape(vertices, np.arange(len(vertices)).reshape(-1, 3), normals, projected_uv(vertices, normals))


def outline(x0: float, x1: float, z0: float, z1: float, y: float) -> list[tuple[float, float, float]]:
    """Corners of an upright rectangle at y."""
    return [(x0, y, z0), (x1, y, z0), (x1, y, z1), (x0, y, z1)]


def border(x0: float, x1: float, z0: float, z1: float, outer: tuple[float, float], inner: tuple[float, float]) -> Shape:
    """A strip around an upright rectangle; its edges lie so far inside the rectangle, at a y."""
    low, high = (outline(x0 + by, x1 - by, z0 + by, z1 - by, y) for by, y in (outer, inner))
    return between(low, high)


def upright(x0: float, x1: float, z0: float, z1: float, y: float) -> Shape:
    """A flat upright rectangle at y that looks along -y, or along +y where x1 is less than x0."""
    return quads([outline(x0, x1, z0, z1, y)])


def between(low: ArrayLike, high: ArrayLike, uv: np.ndarray | None = None) -> Shape:
    """Faces between two closed lines of as many points (k, 3), seen from outside where they run counter-clockwise;
    uv (k, 4, 2) as for `quads`."""
    a, b = np.asarray(low, float), np.asarray(high, float)
    return quads(np.stack([a, np.roll(a, -1, 0), np.roll(b, -1, 0), b], axis=1), uv)


def projected_uv(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """uv (n, 2) in metres by projection along the axis each normal is closest to, z upward as v."""
    axis = np.abs(normals).argmax(axis=1)
    sign = np.sign(np.take_along_axis(normals, axis[:, None], 1)[:, 0])
    x, y, z = points.T
    u = np.select([axis == 0, axis == 1], [y * sign, -x * sign], x)
    v = np.select([axis == 0, axis == 1], [z, z], y * sign)
    return np.stack([u, v], axis=1)


def flat(polygon: shapely.Geometry, z: float = 0.0, up: bool = True) -> Shape:
    """A horizontal polygon (holes allowed) at height z, facing up or down; uv = x, y in metres."""
    shape_points: list[np.ndarray] = []
    for t in shapely.get_parts(shapely.constrained_delaunay_triangles(polygon)):
        ring = np.asarray(t.exterior.coords)[:3]
        a, b, c = ring
        if abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) < 1e-12:
            continue
        if ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0) != up:
            ring = ring[::-1]
        shape_points.append(ring[:, :2])
    points = np.array(shape_points, dtype=np.float64).reshape(-1, 2)
    points, inverse = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    vertices = np.column_stack([points, np.full(len(points), z)])
    normals = np.tile([0.0, 0.0, 1.0 if up else -1.0], (len(points), 1))
    return Shape(vertices, inverse.reshape(-1, 3), normals, points.copy())


def extruded(polygon: shapely.Polygon, z0: float, z1: float) -> Shape:
    """A prism over `polygon` from z0 to z1."""
    polygon = shapely.geometry.polygon.orient(polygon)
    rings = [polygon.exterior, *polygon.interiors]
    walls = [wall_band(np.asarray(ring.coords)[:-1], z0, z1) for ring in rings]
    return joined(flat(polygon, z0, up=False), flat(polygon, z1), *walls)


def wall_band(ring: np.ndarray, z0: float, z1: float) -> Shape:
    """Vertical band under a closed ring (k, 2), facing outward for a counter-clockwise ring."""
    a, b = (np.column_stack([ring, np.full(len(ring), z)]) for z in (z0, z1))
    return between(a, b, unrolled_uv(ring, z0, z1))


def unrolled_uv(ring: np.ndarray, v0: float, v1: float) -> np.ndarray:
    """uv (k, 4, 2) of the faces over a closed ring (k, 2): u is metres along it, v runs from v0 to v1."""
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.roll(ring, -1, 0) - ring, axis=1))])
    uv = np.empty((len(ring), 4, 2))
    uv[:, [0, 3], 0], uv[:, [1, 2], 0] = along[:-1, None], along[1:, None]
    uv[:, :2, 1], uv[:, 2:, 1] = v0, v1
    return uv


def _box_corners() -> tuple[np.ndarray, np.ndarray]:
    """(24, 3) signs of the corners of a box's six faces, and their outward normals."""
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    corners, normals = np.zeros((24, 3)), np.zeros((24, 3))
    for f in range(6):
        i, s = f // 2, 1.0 if f % 2 else -1.0
        j, k = (i + 1) % 3, (i + 2) % 3
        corners[4 * f : 4 * f + 4, [j, k]] = signs if s > 0 else signs[::-1]
        corners[4 * f : 4 * f + 4, i] = normals[4 * f : 4 * f + 4, i] = s
    return corners, normals


def _bevel_faces(vertices: np.ndarray) -> list[list[int]]:
    """Edge strips and corner triangles between the six inset faces of a box centred at 0."""
    octant = {}
    for n, v in enumerate(vertices):
        octant[(n // 8, *(v > 0).tolist())] = n
    faces = []
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for sj in (False, True):
            for sk in (False, True):
                ends = []
                for si in (False, True):
                    key = [False] * 3
                    key[i], key[j], key[k] = si, sj, sk
                    ends.append((octant[(j, *key)], octant[(k, *key)]))
                (a, b), (c, d) = ends
                faces += [[a, c, d], [a, d, b]]
    for octet in np.ndindex(2, 2, 2):
        faces.append([octant[(i, *(bool(o) for o in octet))] for i in range(3)])
    done = []
    for f in faces:
        p = vertices[f]
        outward = np.dot(np.cross(p[1] - p[0], p[2] - p[0]), p.mean(0)) > 0
        done.append(f if outward else f[::-1])
    return done


CORNERS, NORMALS = _box_corners()
AXIS = np.abs(NORMALS).argmax(1)
FACES = (4 * np.arange(6)[:, None] + [0, 1, 2, 0, 2, 3]).reshape(-1, 3)
BEVELLED_FACES = np.concatenate([FACES, _bevel_faces(CORNERS * np.where(NORMALS != 0, 1.0, 0.9))])
U_AXIS, V_AXIS = np.array([1, 0, 0])[AXIS], np.array([2, 2, 1])[AXIS]
U_SIGN = np.where(AXIS == 2, 1.0, np.where(AXIS == 0, 1.0, -1.0) * NORMALS.sum(1))
V_SIGN = np.where(AXIS == 2, NORMALS.sum(1), 1.0)
ROWS = np.arange(24)
for shared in (NORMALS, FACES, BEVELLED_FACES):
    shared.setflags(write=False)


def box(low: ArrayLike, high: ArrayLike, bevel: float = 0.0) -> Shape:
    """An axis-aligned box from corner `low` to corner `high`, its edges rounded off by `bevel` metres.

    The bevel shares the faces' vertices, so that shading runs smoothly around the edge. The grain
    (u) follows the longest side.
    """
    lowest, highest = np.asarray(low, float), np.asarray(high, float)
    half = (highest - lowest) / 2
    bevel = min(bevel, 0.49 * float(half.min()))
    vertices = (lowest + highest) / 2 + CORNERS * (half - bevel + bevel * np.abs(NORMALS))
    uv = np.stack([vertices[ROWS, U_AXIS] * U_SIGN, vertices[ROWS, V_AXIS] * V_SIGN], axis=1)
    longest = half.argmax()
    swap = (longest == V_AXIS) | ((longest != U_AXIS) & (half[V_AXIS] > half[U_AXIS]))
    uv[swap] = uv[swap, ::-1]
    return Shape(vertices, BEVELLED_FACES if bevel > 0 else FACES, NORMALS, uv)


def bar(a: ArrayLike, b: ArrayLike, width: float, height: float, bevel: float = 0.0) -> Shape:
    """A straight beam from a to b, `width` across (level) and `height` thick (upright), metres."""
    start, end = np.asarray(a, float), np.asarray(b, float)
    length = float(np.linalg.norm(end - start))
    x = (end - start) / length
    side = np.cross([0.0, 0.0, 1.0], x)
    side = side / np.linalg.norm(side) if np.linalg.norm(side) > 1e-6 else np.array([0.0, 1.0, 0.0])
    m = np.stack([x, side, np.cross(x, side)], axis=1)
    s = box([0, -width / 2, -height / 2], [length, width / 2, height / 2], bevel)
    return Shape(s.vertices @ m.T + start, s.faces, s.normals @ m.T, s.uv)


def frame(
    x0: float,
    x1: float,
    z0: float,
    z1: float,
    depth: tuple[float, float],
    width: float,
    bevel: float = 0.0,
    foot: float | None = None,
) -> list[Shape]:
    """Four boards `width` wide inside an upright rectangle, left, right, top and bottom, from depth[0] to depth[1];
    `foot` is the height of the bottom one."""
    y0, y1 = depth
    foot = width if foot is None else foot
    return [
        box([x0, y0, z0], [x0 + width, y1, z1], bevel),
        box([x1 - width, y0, z0], [x1, y1, z1], bevel),
        box([x0 + width, y0, z1 - width], [x1 - width, y1, z1], bevel),
        box([x0 + width, y0, z0], [x1 - width, y1, z0 + foot], bevel),
    ]


def lathe(profile: ArrayLike, segments: int = 24, crease: float = 0.7) -> Shape:
    """A surface of revolution about z of `profile` (k, 2): radius, height.

    Outside is to the right of the profile's direction: run it bottom-centre, outside, up, and down
    the inside. Corners sharper than `crease` radians get split normals.
    """
    p = np.asarray(profile, float)
    p = p[np.concatenate([[True], np.linalg.norm(np.diff(p, axis=0), axis=1) > 1e-7])]
    d = np.diff(p, axis=0)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    outward = np.stack([d[:, 1], -d[:, 0]], axis=1)
    points: list[np.ndarray] = []
    point_normals: list[np.ndarray] = []
    bands = []
    for i in range(len(d)):
        turn = np.arccos(np.clip(d[i - 1] @ d[i], -1, 1)) if i else np.pi
        if i and turn < crease:
            first = len(points) - 1
            mixed = outward[i - 1] + outward[i]
            point_normals[first] = mixed / np.linalg.norm(mixed)
        else:
            first = len(points)
            points.append(p[i])
            point_normals.append(outward[i])
        points.append(p[i + 1])
        point_normals.append(outward[i])
        bands.append((first, len(points) - 1))
    rows, row_normals = np.array(points), np.array(point_normals)
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    c, s = np.cos(angle), np.sin(angle)
    vertices = np.stack([rows[:, :1] * c, rows[:, :1] * s, np.repeat(rows[:, 1:], segments + 1, 1)], axis=-1)
    normals = np.stack(
        [row_normals[:, :1] * c, row_normals[:, :1] * s, np.repeat(row_normals[:, 1:], segments + 1, 1)], axis=-1
    )
    along = np.zeros(len(rows))
    for a, b in bands:
        along[b] = along[a] + np.linalg.norm(rows[b] - rows[a])
        if b + 1 < len(rows):
            along[b + 1] = along[b]
    reach = max(float(rows[:, 0].max()), 1e-6)
    uv = np.stack(np.broadcast_arrays(angle[None] * reach, along[:, None]), axis=-1)
    w, faces = segments + 1, []
    k = np.arange(segments)
    for a, b in bands:
        quad = np.stack([a * w + k, a * w + k + 1, b * w + k + 1, b * w + k], axis=1)
        if rows[a, 0] > 1e-9:
            faces.append(quad[:, [0, 1, 2]])
        if rows[b, 0] > 1e-9:
            faces.append(quad[:, [0, 2, 3]])
    return Shape(vertices.reshape(-1, 3), np.concatenate(faces), normals.reshape(-1, 3), uv.reshape(-1, 2))


def cylinder(radius: float, z0: float, z1: float, bevel: float = 0.0, segments: int = 20) -> Shape:
    """An upright closed cylinder about the z axis."""
    b = min(bevel, radius * 0.45, (z1 - z0) * 0.45)
    if b <= 0:
        return lathe([(0, z0), (radius, z0), (radius, z1), (0, z1)], segments)
    return lathe(
        [(0, z0), (radius - b, z0), (radius, z0 + b), (radius, z1 - b), (radius - b, z1), (0, z1)], segments, 0.9
    )


def ball(radius: float, segments: int = 16, rings: int = 9) -> Shape:
    t = np.linspace(-np.pi / 2, np.pi / 2, rings)
    return lathe(np.column_stack([np.abs(np.cos(t)) * radius * (np.abs(t) < 1.57), np.sin(t) * radius]), segments, 2.0)


def tube(path: ArrayLike, radius: ArrayLike, segments: int = 8, closed: bool = False, caps: bool = True) -> Shape:
    """A round pipe along `path` (k, 3); `radius` in metres, one or one per point."""
    p = np.asarray(path, float)
    k = len(p)
    r = np.broadcast_to(np.asarray(radius, float), (k,))
    tangent = _unit((np.roll(p, -1, 0) - np.roll(p, 1, 0)) if closed else np.gradient(p, axis=0))
    side = np.empty_like(p)
    start = np.eye(3)[np.abs(tangent[0]).argmin()]
    for i in range(k):
        start = start - tangent[i] * (start @ tangent[i])
        start = start / np.linalg.norm(start)
        side[i] = start
    other = np.cross(tangent, side)
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    normals = side[:, None] * np.cos(angle)[None, :, None] + other[:, None] * np.sin(angle)[None, :, None]
    vertices = p[:, None] + normals * r[:, None, None]
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    if closed:
        vertices, normals = np.concatenate([vertices, vertices[:1]]), np.concatenate([normals, normals[:1]])
        along = np.append(along, along[-1] + np.linalg.norm(p[0] - p[-1]))
    uv = np.stack(np.broadcast_arrays(along[:, None], angle[None] * r.max()), axis=-1)
    shape = _grid(vertices, normals, uv)
    if closed or not caps:
        return shape
    ends = []
    for i, sign in ((0, -1.0), (k - 1, 1.0)):
        rim = np.concatenate([p[i][None], vertices[i, :-1]])
        j = np.arange(segments)
        f = np.stack([np.zeros(segments, int), 1 + j, 1 + (j + 1) % segments], axis=1)
        n = np.tile(tangent[i] * sign, (len(rim), 1))
        ends.append(Shape(rim, f if sign > 0 else f[:, ::-1], n, np.zeros((len(rim), 2))))
    return joined(shape, *ends)


def sheet(points: np.ndarray, thickness: float = 0.0) -> Shape:
    """A smooth surface through a grid of points (r, c, 3); rows run up, columns run right, seen from its front.

    With a `thickness` it becomes a closed slab, the given points its front.
    """
    p = np.asarray(points, float)
    normals = _grid_normals(p)
    across = np.concatenate(
        [np.zeros((len(p), 1)), np.cumsum(np.linalg.norm(np.diff(p, axis=1), axis=2), axis=1)], axis=1
    )
    up = np.concatenate([np.zeros((1, p.shape[1])), np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=2), axis=0)])
    uv = np.stack([across, up], axis=-1)
    front = _grid(p, normals, uv)
    if thickness <= 0:
        return front
    q = p - normals * thickness
    return joined(front, _grid(q, normals, uv).reversed(), between(rim(q), rim(p)))


def skirt(grid: np.ndarray) -> Shape:
    """The sides from the border of a grid of points (r, c, 3) straight down to the floor."""
    return between(rim(grid) * [1, 1, 0], rim(grid))


def rim(grid: np.ndarray) -> np.ndarray:
    """The border of a grid of points (r, c, 3) as a closed line: the first row, the last column and back."""
    return np.concatenate([grid[0], grid[1:, -1], grid[-1, -2::-1], grid[-2:0:-1, 0]])


def _grid_normals(p: np.ndarray) -> np.ndarray:
    """Unit normals of a grid (r, c, 3); where rows meet in a point, those of the next row."""
    du, dv = np.gradient(p, axis=1), np.gradient(p, axis=0)
    n = np.cross(du, dv)
    length = np.linalg.norm(n, axis=2, keepdims=True)
    pointed = length[..., 0] < 1e-9 * max(float(length.max()), 1e-12)
    n = n / np.maximum(length, 1e-12)
    if pointed.any():
        near = sum(
            np.roll(np.pad(n, ((1, 1), (1, 1), (0, 0))), s, (0, 1))[1:-1, 1:-1]
            for s in ((0, 1), (0, -1), (1, 0), (-1, 0))
        )
        near = np.where(np.linalg.norm(near, axis=2, keepdims=True) > 1e-9, near, n.mean((0, 1)))
        n = np.where(pointed[..., None], _unit(near), n)
    return n


def _grid(points: np.ndarray, normals: np.ndarray, uv: np.ndarray) -> Shape:
    r, c = points.shape[:2]
    i, j = (x.reshape(-1) for x in np.meshgrid(np.arange(r - 1), np.arange(c - 1), indexing="ij"))
    a, b, d, e = i * c + j, i * c + j + 1, (i + 1) * c + j + 1, (i + 1) * c + j
    faces = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, e], 1)])
    return Shape(points.reshape(-1, 3), faces, normals.reshape(-1, 3), uv.reshape(-1, 2))


def pillow(
    width: float, depth: float, height: float, cells: int = 14, roundness: float = 0.35, waves: np.ndarray | None = None
) -> Shape:
    """A stuffed cushion lying flat: pointed corners, a seam around its middle, origin at its centre.

    waves: optional (cells + 1, cells + 1) metres added to the upper side, zero at the rim.
    """
    t = np.linspace(-1, 1, cells + 1)
    t = np.sign(t) * np.abs(t) ** 0.8
    x, y = np.meshgrid(t, t)
    puff = ((1 - x**4) * (1 - y**4)) ** roundness
    pinch = 1 - 0.06 * (1 - np.abs(np.stack([y, x])) ** 2) * np.abs(np.stack([x, y])) ** 6
    px, py = x * pinch[0] * width / 2, y * pinch[1] * depth / 2
    rise = puff * height / 2
    bump = 0.0 if waves is None else waves * puff
    top = sheet(np.stack([px, py, rise + bump], axis=-1))
    low = sheet(np.stack([px, py, -rise], axis=-1))
    return joined(top, low.reversed())


def folds(
    width: float,
    height: float,
    count: float,
    depth: float,
    *,
    rng: np.random.Generator,
    columns: int | None = None,
    rows: int = 8,
    gather: float = 0.0,
) -> np.ndarray:
    """Grid (rows + 1, columns + 1, 3) of hanging cloth in the xz plane facing -y, z from 0 to height.

    `count` folds of +-`depth` metres, irregular in width and swing; `gather` narrows it toward the top.
    """
    columns = columns or int(count * 8)
    s = np.linspace(0, 1, columns + 1)
    wobble = np.cumsum(rng.normal(0, 1, columns + 1))
    wobble = (wobble - np.linspace(wobble[0], wobble[-1], columns + 1)) / max(np.abs(wobble).max(), 1e-9)
    phase = 2 * np.pi * count * s + 0.9 * wobble
    amplitude = depth * (0.75 + 0.25 * np.sin(2 * np.pi * s * rng.uniform(1, 3) + rng.uniform(0, 6)))
    z = np.linspace(0, height, rows + 1)[:, None]
    drop = 1 - z / height
    # Below the heading folds wander and run into one another.
    turn, lean = rng.uniform(0, 6), rng.uniform(0.5, 0.9)
    wander = drop * (0.25 * np.sin(3 * phase / count + 1.0) + lean * np.sin(2.3 * phase / count + 2.2 * drop + turn))
    merged = 0.25 * drop * np.sin(0.5 * phase + turn)
    y = -amplitude * (np.sin(phase + wander) + merged) / (1 + 0.25 * drop) * (0.55 + 0.45 * drop)
    x = (s - 0.5)[None] * width * (1 - gather * (z / height))
    x = x + 0.35 * depth * np.cos(2 * phase) * drop * 0.3
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1)
