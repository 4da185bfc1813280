"""Curves given back to coarse models, and folds to their bedding.

A triangle whose corner normals lean apart stands for a curved surface. Its edges are split where that surface is
farthest from them (curved PN triangles: Vlachos et al., I3D 2001, section 3.2, the cubic at its middle), so that arms
of sofas, cushions and tubes have round outlines and not only round shading.
"""

import numpy as np

from embodied.assets.importing.meshing import corner_angles, crease_normals, face_normals

SAG = 0.0012
"""Metres between an edge and the curve over it, from which on the edge is split."""
SPLIT_ROUNDS = 2
"""Times that edges are split at most."""
HIGHEST = 0.2
"""A curve rises over its edge by at most this share of the edge: normals of torn models point anywhere."""
LONGEST_EDGE = 0.15
"""Metres of an edge above which it is straight: bars are, whatever the normals at their bent ends say."""
COARSE, FINE = 0.08, 0.04
"""Metres: cloth with longer edges than the first has no folds of its own; it is split down to the second for them."""
DEEP, FOLD_SPACING = 0.018, 0.26
"""Metres that folds rise at most, and from one to the next."""
HANG = 0.30
"""Metres below its top over which what hangs falls into its full folds."""
LIES = 0.9
"""Upward part of a normal from which on cloth lies. It stays smooth: things lie on it, and neither sink nor float (a
surface is touched within 5 mm)."""


def rounded(
    vertices: np.ndarray, faces: np.ndarray, uv: np.ndarray | None, crease: float, most: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """The mesh with its curved edges split, those that are farthest from their curve first; its box stays.

    Args:
      vertices: (n, 3), metres, welded; faces: (m, 3); uv: (m, 3, 2) of the corners, or None.
      crease: radians between faces from which on their edge is meant.
      most: faces that may come on top.
    """
    limit, low, high = len(faces) + most, vertices[faces].min((0, 1)), vertices[faces].max((0, 1))
    for _ in range(SPLIT_ROUNDS):
        number, pairs = _edges(faces)
        rise = _rises(vertices, faces, number, len(pairs), crease)
        sag = np.linalg.norm(rise, axis=1)
        wanted = np.flatnonzero(sag > SAG)
        room = (limit - len(faces)) // 2  # an edge has two faces
        chosen = wanted[np.argsort(-sag[wanted], kind="stable")[: max(room, 0)]]
        if not len(chosen):
            break
        middles = np.clip(vertices[pairs[chosen]].mean(1) + rise[chosen], low, high)
        vertices, faces, uv = _split(vertices, faces, uv, number, chosen, middles)
    return vertices, faces, uv


def refined(
    vertices: np.ndarray, faces: np.ndarray, uv: np.ndarray | None, longest: float, most: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """The mesh with the edges of what hangs halved until none is longer than `longest`, longer ones first.

    Args:
      most: faces that may come on top.
    """
    limit = len(faces) + most
    while True:
        number, pairs = _edges(faces)
        hangs = np.zeros(len(pairs), bool)  # edges of faces that hang by a corner: all three, or slivers are left
        hangs[number[(_vertex_normals(vertices, faces)[:, 2] < LIES)[faces].any(1)]] = True
        length = np.linalg.norm(vertices[pairs[:, 0]] - vertices[pairs[:, 1]], axis=1) * hangs
        wanted = np.flatnonzero(length > max(longest, 0.6 * float(length.max())))
        chosen = wanted[np.argsort(-length[wanted], kind="stable")[: max((limit - len(faces)) // 2, 0)]]
        if not len(chosen):
            return vertices, faces, uv
        vertices, faces, uv = _split(vertices, faces, uv, number, chosen, vertices[pairs[chosen]].mean(1))


def is_coarse(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """True if the triangles of a cloth are too large to hold folds: a tenth of the edges are longer than COARSE."""
    along = vertices[np.roll(faces, -1, axis=1)] - vertices[faces]
    return bool(np.percentile(np.linalg.norm(along, axis=-1), 90) > COARSE)


def folded(vertices: np.ndarray, faces: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(n, 3) the vertices of bedding (metres, z up, fine) in upright folds where it hangs, deeper towards the hem.

    They go outwards and level, so that it is as high as before.
    """
    normal = _vertex_normals(vertices, faces)
    along = vertices[:, 0] + vertices[:, 1] + 0.06 * np.sin(2 * np.pi * vertices[:, 2] / 0.7 + rng.uniform(0, 6.3))
    phase = along / FOLD_SPACING + 0.35 * np.sin(2 * np.pi * along / (3.4 * FOLD_SPACING) + rng.uniform(0, 6.3))
    top = float(vertices[faces, 2].max())  # of the cloth: `vertices` may hold the rest of the model, too
    depth = np.clip((top - vertices[:, 2]) / HANG, 0.0, 1.0)
    hangs = 1 - np.clip(normal[:, 2] / LIES, 0.0, 1.0) ** 2
    out = normal[:, :2] * (DEEP * hangs * depth * (0.5 + 0.5 * np.sin(2 * np.pi * phase)))[:, None]
    return vertices + np.column_stack([out, np.zeros(len(out))])


def _vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    normal = np.zeros_like(vertices, dtype=np.float64)
    unit = face_normals(vertices, faces)
    unit = unit / np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-30)
    angle = corner_angles(vertices, faces)
    for k in range(3):
        np.add.at(normal, faces[:, k], unit * angle[:, k, None])
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m, 3) the number of the edge from each corner to the next, and (e, 2) the ends of each edge."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64), axis=1)
    many = int(faces.max(initial=0)) + 1
    keys, number = np.unique(ends[:, 0] * many + ends[:, 1], return_inverse=True)
    return number.reshape(-1, 3), np.stack(np.divmod(keys, many), axis=1)


def _rises(vertices: np.ndarray, faces: np.ndarray, number: np.ndarray, edges: int, crease: float) -> np.ndarray:
    """(e, 3) metres from the middle of each edge to the curve over it.

    Each of its faces says how far the curve is off along its own normals. Faces that share their normals say the same,
    once; those that meet at a crease both have a say.
    """
    normals = crease_normals(vertices, faces, crease)
    along = vertices[np.roll(faces, -1, axis=1)] - vertices[faces]
    first, last = normals, np.roll(normals, -1, axis=1)
    off = np.einsum("mij,mij->mi", along, first)[..., None] * first
    off = (np.einsum("mij,mij->mi", -along, last)[..., None] * last + off) / -8
    middle = first + last
    middle /= np.maximum(np.linalg.norm(middle, axis=-1, keepdims=True), 1e-30)
    flat = number.reshape(-1)
    count = np.bincount(flat, minlength=edges)
    total = _summed(flat, off, edges)
    together = np.linalg.norm(_summed(flat, middle, edges), axis=1)
    share = np.clip(together**2 / 2 - 1, 0.0, 1.0)  # of two unit vectors: their cosine
    rise = total / np.where(count == 2, 1 + share, 1.0)[:, None]
    rise[count > 2] = 0.0
    length = np.bincount(flat, np.linalg.norm(along, axis=-1).reshape(-1), minlength=edges) / np.maximum(count, 1)
    rise[length > LONGEST_EDGE] = 0.0
    high = np.linalg.norm(rise, axis=1)
    return rise * np.minimum(1.0, HIGHEST * length / np.maximum(high, 1e-30))[:, None]


def _summed(number: np.ndarray, values: np.ndarray, edges: int) -> np.ndarray:
    rows = values.reshape(-1, 3)
    return np.stack([np.bincount(number, rows[:, k], minlength=edges) for k in range(3)], axis=1)


def _split(
    vertices: np.ndarray,
    faces: np.ndarray,
    uv: np.ndarray | None,
    number: np.ndarray,
    chosen: np.ndarray,
    middles: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """The mesh with a vertex in each of the `chosen` edges: faces become two, three or four.

    Args:
      number: (m, 3) of the edge from each corner to the next.
      middles: (c, 3) where the new vertices are.
    """
    at = np.full(int(number.max()) + 1, -1)
    at[chosen] = len(vertices) + np.arange(len(chosen))
    new = at[number]
    halves = np.concatenate([faces, new], axis=1)  # corners 0 1 2, then the middles of 01, 12, 20
    pattern = (new >= 0) @ np.array([1, 2, 4])
    rows, corners = [], []
    for code, triangles in _PATTERNS.items():
        halved = np.flatnonzero(pattern == code)
        for triangle in triangles:
            rows.append(halved)
            corners.append(np.tile(triangle, (len(halved), 1)))
    row, corner = np.concatenate(rows), np.concatenate(corners)
    order = np.argsort(row, kind="stable")
    row, corner = row[order], corner[order]
    spots = None
    if uv is not None:
        spots = np.concatenate([uv, (uv + np.roll(uv, -1, axis=1)) / 2], axis=1)[row[:, None], corner]
    return np.concatenate([vertices, middles]), halves[row[:, None], corner], spots


_PATTERNS = {
    0: [(0, 1, 2)],
    1: [(0, 3, 2), (3, 1, 2)],
    2: [(0, 1, 4), (0, 4, 2)],
    4: [(0, 1, 5), (5, 1, 2)],
    3: [(3, 1, 4), (0, 3, 4), (0, 4, 2)],
    6: [(4, 2, 5), (0, 1, 4), (0, 4, 5)],
    5: [(0, 3, 5), (3, 1, 2), (3, 2, 5)],
    7: [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
}
"""Triangles of corners and middles by which edges have one: 1 for 01, 2 for 12, 4 for 20."""
