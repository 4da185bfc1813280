"""Support surfaces: where small things can rest on a model, measured on its mesh.

The rectangles of the reviewed catalogue were found by `find_surfaces`; `contact` says how well a
rectangle fits its mesh, and the tests hold the whole catalogue to it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from assets.records import MeshPart, SupportSurface

FLAT = 0.95
"""Smallest z of a unit normal on which things are put: 18 degrees of slope."""
TOLERANCE = 0.004
"""Metres that a surface may depart from its plane."""
OPEN = 9.0
"""Headroom of a surface with nothing above it, metres."""
MIN_HEADROOM, MIN_SIDE, MIN_AREA = 0.08, 0.07, 0.012
"""Metres, metres and square metres below which a place is not worth naming."""


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


def find_surfaces(parts: Sequence[MeshPart], step: float = 0.01, limit: int = 12) -> tuple[SupportSurface, ...]:
    """Horizontal rectangles with room above them, from the lowest to the highest.

    Args:
      step: grid of the search, metres.
      limit: most rectangles returned; the largest are kept.
    """
    low = np.min([p.vertices.min(axis=0) for p in parts], axis=0)
    high = np.max([p.vertices.max(axis=0) for p in parts], axis=0)
    xs = np.arange(low[0] + step / 2, high[0], step) + 1e-5
    ys = np.arange(low[1] + step / 2, high[1], step) + 1.3e-5
    line, z, nz = columns(parts, xs, ys)
    room, buried = _above(line, z, nz)
    flat = (nz > FLAT) & ~buried & (room >= MIN_HEADROOM) & (z > 0.02)
    found: list[SupportSurface] = []
    for level in _levels(z[flat], step * step):
        chosen = flat & (np.abs(z - level) < TOLERANCE)
        for least in (1.0, 0.22, MIN_HEADROOM):
            free = np.zeros(len(xs) * len(ys), dtype=bool)
            free[line[chosen & (room >= least)]] = True
            for i0, j0, i1, j1 in _rectangles(free.reshape(len(xs), len(ys)), step):
                inside = chosen & (line // len(ys) >= i0) & (line // len(ys) < i1)
                inside &= (line % len(ys) >= j0) & (line % len(ys) < j1)
                found.append(
                    SupportSurface(
                        "",
                        float(np.median(z[inside])),
                        float(low[0] + i0 * step + 0.002),
                        float(low[1] + j0 * step + 0.002),
                        float(min(low[0] + i1 * step, high[0]) - 0.002),
                        float(min(low[1] + j1 * step, high[1]) - 0.002),
                        float(room[inside].min()),
                    )
                )
                chosen &= ~inside
    found = [s for s in found if s.headroom == OPEN or reach(parts, s) > 0.6]
    found = sorted(found, key=lambda s: -(s.x1 - s.x0) * (s.y1 - s.y0))[:limit]
    return tuple(_named(sorted(found, key=lambda s: (round(s.z, 3), s.x0, s.y0))))


def reach(parts: Sequence[MeshPart], surface: SupportSurface, points: int = 9) -> float:
    """Share of `surface` that a hand reaches from the front: lines towards -y that no door bars."""
    turned = [MeshPart(p.vertices[:, [0, 2, 1]], p.faces, p.normals, p.uv, p.finish) for p in parts]
    xs = surface.x0 + (surface.x1 - surface.x0) * (np.arange(points) + 0.5) / points + 1e-6
    zs = surface.z + min(surface.headroom, 0.5) * np.array([0.25, 0.5, 0.75]) + 1.3e-6
    line, y, _ = columns(turned, xs, zs)
    barred = np.unique(line[y < surface.y0 + 0.3 * (surface.y1 - surface.y0)])
    return 1.0 - len(barred) / (points * 3)


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


def _above(line: np.ndarray, z: np.ndarray, nz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Free height over each hit, and whether it lies within a solid (the next face up looks up)."""
    room, buried = np.full(len(z), OPEN), np.zeros(len(z), dtype=bool)
    settled = np.zeros(len(z), dtype=bool)
    pair = (line[1:] == line[:-1]) & (z[1:] - z[:-1] < 1e-3) & (nz[1:] * nz[:-1] < 0)
    sheet = np.append(pair, False) | np.insert(pair, 0, False)
    for k in range(1, 60):
        same = np.zeros(len(z), dtype=bool)
        same[: -k or None] = line[k:] == line[:-k]
        if not same.any():
            break
        gap = np.zeros(len(z))
        gap[:-k] = z[k:] - z[:-k]
        upward = np.zeros(len(z), dtype=bool)
        upward[:-k] = (nz[k:] > 0) & ~sheet[k:]
        first = same & ~settled & (gap > TOLERANCE)
        room[first], buried[first] = gap[first], upward[first]
        settled |= first
    return room, buried


def _levels(z: np.ndarray, cell: float) -> list[float]:
    """Heights with much flat area, the largest area first."""
    left = np.sort(z)
    levels: list[float] = []
    while len(left) * cell >= MIN_AREA and len(levels) < 24:
        first = np.searchsorted(left, left - TOLERANCE)
        last = np.searchsorted(left, left + TOLERANCE)
        best = int(np.argmax(last - first))
        if (last[best] - first[best]) * cell < MIN_AREA:
            break
        levels.append(float(np.median(left[first[best] : last[best]])))
        left = np.concatenate([left[: first[best]], left[last[best] :]])
    return levels


def _rectangles(free: np.ndarray, step: float, most: int = 6) -> list[tuple[int, int, int, int]]:
    """Disjoint large rectangles of free cells as (i0, j0, i1, j1), ends excluded."""
    free = free.copy()
    out: list[tuple[int, int, int, int]] = []
    side = int(np.ceil(MIN_SIDE / step))
    while len(out) < most:
        i0, j0, i1, j1 = _largest(free, side)
        if min(i1 - i0, j1 - j0) < side or (i1 - i0) * (j1 - j0) * step * step < MIN_AREA:
            break
        out.append((i0, j0, i1, j1))
        free[i0:i1, j0:j1] = False
    return out


def _largest(free: np.ndarray, side: int) -> tuple[int, int, int, int]:
    """The largest rectangle of true cells that is at least `side` cells wide (histogram method)."""
    heights = np.zeros(free.shape[1] + 1, dtype=int)
    best, area = (0, 0, 0, 0), 0
    for i, row in enumerate(free):
        heights[:-1] = np.where(row, heights[:-1] + 1, 0)
        stack: list[int] = []
        for j, h in enumerate(heights.tolist()):
            while stack and heights[stack[-1]] >= h:
                tall = int(heights[stack.pop()])
                left = stack[-1] + 1 if stack else 0
                if tall >= side and j - left >= side and tall * (j - left) > area:
                    area, best = tall * (j - left), (i + 1 - tall, left, i + 1, j)
            stack.append(j)
    return best


def _named(found: list[SupportSurface]) -> list[SupportSurface]:
    """Open surfaces are tops, the largest first; covered ones are shelves, counted from below."""
    tops = sorted((s for s in found if s.headroom >= 1.0), key=lambda s: -(s.x1 - s.x0) * (s.y1 - s.y0))
    covered = [s for s in found if s.headroom < 1.0]
    names = {id(s): "top" if k == 0 else f"top_{k + 1}" for k, s in enumerate(tops)}
    names |= {id(s): f"shelf_{k + 1}" for k, s in enumerate(covered)}
    return [
        SupportSurface(names[id(s)], *(round(v, 4) for v in (s.z, s.x0, s.y0, s.x1, s.y1, s.headroom)))
        for s in [*tops, *covered]
    ]
