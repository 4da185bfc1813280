"""How well a support surface of the catalogue fits the mesh that things are put on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from embodied.assets.records import MeshPart, SupportSurface


def columns(parts: Sequence[MeshPart], xs: np.ndarray, ys: np.ndarray) -> tuple[np.ndarray, ...]:
    """Where vertical lines through the grid xs (n,) by ys (m,) pierce the mesh.

    Returns:
      Index of the line (i * m + j), height in metres, and z of the face's unit normal, sorted by
      line and height.
    """
    found = [_pierce(p.vertices.astype(np.float64)[p.faces], xs, ys) for p in parts]
    line, z, nz = (np.concatenate([f[i] for f in found]) for i in range(3))
    order = np.lexsort((z, line))
    return line[order], z[order], nz[order]


def contact(parts: Sequence[MeshPart], surface: SupportSurface, points: int = 12) -> float:
    """Share of a grid of points of `surface` under which the mesh lies within 5 mm of its height."""
    xs = surface.x0 + (surface.x1 - surface.x0) * (np.arange(points) + 0.5) / points
    ys = surface.y0 + (surface.y1 - surface.y0) * (np.arange(points) + 0.5) / points
    line, z, nz = columns(parts, xs + 1e-6, ys + 1.3e-6)
    touched = line[(np.abs(z - surface.z) < 0.005) & (np.abs(nz) > 0.5)]
    return len(np.unique(touched)) / points**2


def _pierce(triangles: np.ndarray, xs: np.ndarray, ys: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    i0, i1 = (np.searchsorted(xs, f(triangles[:, :, 0], axis=1)) for f in (np.min, np.max))
    j0, j1 = (np.searchsorted(ys, f(triangles[:, :, 1], axis=1)) for f in (np.min, np.max))
    counts = (i1 - i0) * (j1 - j0)
    counts[np.abs(normal[:, 2]) < 1e-6] = 0
    t = np.repeat(np.arange(len(triangles)), counts)
    rank = np.arange(len(t)) - np.repeat(np.cumsum(counts) - counts, counts)
    width = (j1 - j0)[t]
    i, j = i0[t] + rank // np.maximum(width, 1), j0[t] + rank % np.maximum(width, 1)
    x, y = xs[i], ys[j]
    sides = []
    for p, q in ((a, b), (b, c), (c, a)):
        sides.append((q[t, 0] - p[t, 0]) * (y - p[t, 1]) - (q[t, 1] - p[t, 1]) * (x - p[t, 0]))
    inside = np.all(np.array(sides) >= 0, axis=0) | np.all(np.array(sides) <= 0, axis=0)
    t, i, j, x, y = t[inside], i[inside], j[inside], x[inside], y[inside]
    n = normal[t]
    z = a[t, 2] - (n[:, 0] * (x - a[t, 0]) + n[:, 1] * (y - a[t, 1])) / n[:, 2]
    return i * len(ys) + j, z, n[:, 2]
