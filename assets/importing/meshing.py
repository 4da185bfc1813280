"""Triangles made ready for rendering: welding, crease normals, decimation that keeps texture coordinates."""

import fast_simplification
import numpy as np
from scipy.spatial import cKDTree

CREASE = np.radians(42.0)
"""Faces that meet at less than this angle share a smooth normal."""

PAIRS = 4_000_000
"""Pairs of corners compared at a time."""

WORKING_SIZE, AGGRESSIVENESS = 50.0, 5.0
"""The simplifier's error thresholds are absolute, so parts are brought to this extent for it: at
their size in metres it would take every collapse of a small thing for free."""


def face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(m, 3) normals, twice the area long."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def weld(vertices: np.ndarray, faces: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Merge vertices that round to the same multiple of `tolerance`; keeps the order of faces."""
    keys = np.round(vertices / tolerance).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return vertices[first], inverse.reshape(-1)[faces]


def sound_faces(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(m,) bool: False for slivers without area and for repeats of an earlier face (same winding)."""
    area = np.linalg.norm(face_normals(vertices, faces), axis=1)
    longest = np.max(
        [np.linalg.norm(vertices[faces[:, i]] - vertices[faces[:, i - 1]], axis=1) for i in range(3)], axis=0
    )
    keep = area > 1e-6 * np.maximum(longest, 1e-9) ** 2
    turned = np.take_along_axis(faces, (np.argmin(faces, axis=1)[:, None] + [0, 1, 2]) % 3, axis=1)
    _, first = np.unique(turned, axis=0, return_index=True)
    unique = np.zeros(len(faces), dtype=bool)
    unique[first] = True
    return keep & unique


def crease_normals(vertices: np.ndarray, faces: np.ndarray, crease: float = CREASE) -> np.ndarray:
    """(m, 3, 3) unit normal of every corner: the mean, weighted by angle and area, over the faces
    around the vertex that turn from the corner's own face by less than `crease`. The areas keep
    large flat panels flat beside their small bevels."""
    unit = face_normals(vertices, faces)
    area = np.linalg.norm(unit, axis=1, keepdims=True)
    unit /= np.maximum(area, 1e-30)
    weight = (corner_angles(vertices, faces) * area).reshape(-1)
    weight /= max(float(weight.max(initial=0.0)), 1e-30)
    corner_vertex = faces.reshape(-1)
    normal = np.empty((len(corner_vertex), 3))
    around = _Around(corner_vertex, np.argsort(corner_vertex, kind="stable"), len(vertices))
    pairs = np.cumsum(around.counts[corner_vertex])
    ends = np.searchsorted(pairs, np.arange(PAIRS, pairs[-1] if len(pairs) else 0, PAIRS))
    for chunk in np.split(np.arange(len(corner_vertex)), ends):
        normal[chunk] = _corner_sums(chunk, around, unit, weight, np.cos(crease))
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(length > 1e-15, normal / np.maximum(length, 1e-15), np.repeat(unit, 3, axis=0))
    return normal.reshape(-1, 3, 3)


class _Around:
    """The corners (face * 3 + k) at each vertex: `order[starts[v] : starts[v] + counts[v]]`."""

    def __init__(self, corner_vertex: np.ndarray, order: np.ndarray, vertices: int) -> None:
        self.vertex, self.order = corner_vertex, order
        self.counts = np.bincount(corner_vertex, minlength=vertices)
        self.starts = np.cumsum(self.counts) - self.counts


def _corner_sums(
    corners: np.ndarray, around: _Around, unit: np.ndarray, weight: np.ndarray, least: float
) -> np.ndarray:
    """(c, 3) weighted sums of face normals around `corners` (c,), over the faces whose cosine is over `least`."""
    counts = around.counts[around.vertex[corners]]
    row = np.repeat(np.arange(len(corners)), counts)
    rank = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    other = around.order[around.starts[around.vertex[corners[row]]] + rank]
    cosine = np.einsum("ij,ij->i", unit[corners[row] // 3], unit[other // 3])
    row, other = row[cosine > least], other[cosine > least]
    sums = [np.bincount(row, unit[other // 3, k] * weight[other], minlength=len(corners)) for k in range(3)]
    return np.stack(sums, axis=1)


def corner_angles(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(m, 3) interior angle of every corner, radians."""
    p = vertices[faces]
    angles = np.empty(faces.shape)
    for i in range(3):
        u, v = p[:, (i + 1) % 3] - p[:, i], p[:, (i + 2) % 3] - p[:, i]
        cosine = np.einsum("ij,ij->i", u, v) / np.maximum(np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1), 1e-30)
        angles[:, i] = np.arccos(np.clip(cosine, -1.0, 1.0))
    return angles


def decimate(vertices: np.ndarray, faces: np.ndarray, uv: np.ndarray | None, target: int) -> tuple:
    """About `target` faces with the same look.

    Args:
      vertices: (n, 3), faces: (m, 3) welded by position alone.
      uv: (m, 3, 2) texture coordinates of the corners, or None.

    Returns:
      vertices, faces and the corners' uv of the smaller mesh. Texture coordinates are read back
      from the nearest original triangle, so seams may lie anywhere.
    """
    points, small = _collapse(vertices, faces, (np.empty((0, 3)), np.empty((0, 3), int)), target, keep_rims=True)
    if len(small) > 1.5 * target:
        points, small = _collapse(vertices, faces, border_fins(vertices, faces), target, keep_rims=False)
    keep = sound_faces(points, small) if len(small) else np.zeros(0, dtype=bool)
    small = small[keep]
    if not len(small) or not np.isfinite(points).all():
        return vertices, faces, uv
    return points, small, None if uv is None else project_uv(vertices, faces, uv, points, small)


def _collapse(
    vertices: np.ndarray, faces: np.ndarray, fins: tuple[np.ndarray, np.ndarray], target: int, keep_rims: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Edge collapses down to about `target` faces, the fins left out of the result."""
    extent = max(float(np.ptp(vertices[np.unique(faces)], axis=0).max()), 1e-9)
    fenced = np.concatenate([vertices, fins[0]]) * (WORKING_SIZE / extent)
    fenced_faces = np.concatenate([faces, fins[1]]).astype(np.int32)
    _, _, collapses = fast_simplification.simplify(
        fenced,
        fenced_faces,
        target_count=round(target * len(fenced_faces) / len(faces)),
        agg=AGGRESSIVENESS,
        return_collapses=True,
        preserve_border=keep_rims,
    )
    points, _, image = fast_simplification.replay_simplification(fenced, fenced_faces, collapses)
    image = np.asarray(image, dtype=np.int64)[: len(vertices)]
    points = np.asarray(points, dtype=np.float64) * (extent / WORKING_SIZE)
    low, high = np.full(points.shape, np.inf), np.full(points.shape, -np.inf)
    np.minimum.at(low, image, vertices)
    np.maximum.at(high, image, vertices)
    slack = 0.1 * (high - low)
    met = np.isfinite(low).all(axis=1)
    # Where the quadrics leave a direction free (cones, cylinders), the best point may lie far off.
    points[met] = np.clip(points[met], (low - slack)[met], (high + slack)[met])
    small = image[faces]
    return points, small[(small != np.roll(small, 1, axis=1)).all(axis=1)]


def border_fins(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a small wall along every open edge, to be appended to the mesh.

    The simplifier feels no force against moving the rim of a flat sheet within its plane, and so
    cuts its corners off; the wall's plane holds the rim in place.
    """
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    ordered = np.sort(edges, axis=1)
    _, inverse, counts = np.unique(ordered, axis=0, return_inverse=True, return_counts=True)
    rim = counts[inverse.reshape(-1)] == 1
    a, b = edges[rim].T
    normal = face_normals(vertices, faces)[np.repeat(np.arange(len(faces)), 3)[rim]]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    rise = normal * np.linalg.norm(vertices[a] - vertices[b], axis=1, keepdims=True)
    n, k = len(vertices), len(a)
    top_a, top_b = n + np.arange(k), n + k + np.arange(k)
    return (
        np.concatenate([vertices[a] + rise, vertices[b] + rise]),
        np.concatenate([np.stack([b, a, top_a], axis=1), np.stack([b, top_a, top_b], axis=1)]),
    )


def project_uv(
    vertices: np.ndarray, faces: np.ndarray, uv: np.ndarray, points: np.ndarray, small: np.ndarray
) -> np.ndarray:
    """(k, 3, 2) corners' uv of the mesh (points, small) taken from the mesh (vertices, faces, uv)."""
    rows = np.repeat(np.arange(len(faces)), 7)
    bary = np.tile(
        [[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 0.2], [0.2, 2, 2], [2, 0.2, 2]], (len(faces), 1)
    ).astype(float)
    bary /= bary.sum(axis=1, keepdims=True)
    samples = np.einsum("ij,ijk->ik", bary, vertices[faces[rows]])
    n = face_normals(vertices, faces)
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)
    size = np.ptp(vertices, axis=0).max()
    tree = cKDTree(np.hstack([samples, 0.1 * size * n[rows]]))
    own = face_normals(points, small)
    own /= np.maximum(np.linalg.norm(own, axis=1, keepdims=True), 1e-30)
    corners = points[small]
    centre = corners.mean(axis=1, keepdims=True)
    inner = corners + 0.15 * (centre - corners)
    query = np.concatenate([inner, np.repeat(0.1 * size * own[:, None], 3, axis=1)], axis=2)
    source = rows[tree.query(query.reshape(-1, 6))[1]]
    out = _affine_uv(vertices[faces[source]], uv[source], corners.reshape(-1, 3)).reshape(-1, 3, 2)
    middle = rows[tree.query(np.concatenate([centre[:, 0], 0.1 * size * own], axis=1))[1]]
    middle = np.repeat(middle, 3)
    whole = _affine_uv(vertices[faces[middle]], uv[middle], corners.reshape(-1, 3)).reshape(-1, 3, 2)
    torn = np.ptp(out, axis=1).max(axis=1) > 3.0 * np.ptp(whole, axis=1).max(axis=1) + 0.02
    out[torn] = whole[torn]
    return out


def _affine_uv(triangles: np.ndarray, uv: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(k, 2) the affine texture map of each triangle (k, 3, 3), (k, 3, 2) at each point (k, 3)."""
    e1, e2 = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    d = points - triangles[:, 0]
    a, b, c = (np.einsum("ij,ij->i", x, y) for x, y in ((e1, e1), (e1, e2), (e2, e2)))
    p, q = np.einsum("ij,ij->i", d, e1), np.einsum("ij,ij->i", d, e2)
    det = a * c - b * b
    good = det > 1e-12 * np.maximum(a * c, 1e-30)
    s = np.where(good, (c * p - b * q) / np.where(good, det, 1.0), 0.0)
    t = np.where(good, (a * q - b * p) / np.where(good, det, 1.0), 0.0)
    s, t = np.clip(s, -1.0, 2.0), np.clip(t, -1.0, 2.0)
    return uv[:, 0] + s[:, None] * (uv[:, 1] - uv[:, 0]) + t[:, None] * (uv[:, 2] - uv[:, 0])


def indexed(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray, uv: np.ndarray | None) -> tuple:
    """Corner attributes turned into vertices with one normal and one uv each.

    Args:
      vertices: (n, 3); faces: (m, 3); normals: (m, 3, 3); uv: (m, 3, 2) or None.

    Returns:
      float32 vertices (k, 3), int32 faces (m, 3), float32 normals (k, 3), float32 uv (k, 2).
    """
    uv = np.zeros((*faces.shape, 2)) if uv is None else uv
    rows = np.hstack(
        [faces.reshape(-1, 1), np.round(normals.reshape(-1, 3) * 512), np.round(uv.reshape(-1, 2) * 16384)]
    ).astype(np.int64)
    _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    first = first[order]
    return (
        vertices[faces.reshape(-1)[first]].astype(np.float32),
        rank[inverse.reshape(-1)].reshape(-1, 3).astype(np.int32),
        normals.reshape(-1, 3)[first].astype(np.float32),
        uv.reshape(-1, 2)[first].astype(np.float32),
    )
