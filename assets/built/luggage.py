"""Bags for the way: rucksacks and suitcases."""

from __future__ import annotations

import numpy as np
import shapely

from embodied.assets.built.parametric import BuildRequest, parts_of, plain
from embodied.assets.built.primitives import Shape, box, flat, joined, sheet, tube
from embodied.assets.records import MeshPart


def rucksack(spec: BuildRequest) -> list[MeshPart]:
    """A rucksack that stands: a stuffed body with a zip over it, a pocket before it, straps behind, a loop on top."""
    w, d, h = spec.size
    y, bw, bd = 0.02 * d, 0.80 * w, 0.60 * d
    body = _stuffed(bw, bd, 0.94 * h, 0.24 * h).moved(0, y)
    front_y = y - bd / 2
    pocket = _stuffed(0.66 * w, 0.26 * d, 0.44 * h, 0.09 * h).moved(0, front_y - 0.045 * d, 0.03 * h)
    bag = _stuffed(0.20 * w, 0.34 * d, 0.36 * h, 0.05 * h)
    sides = [bag.moved(s * (bw / 2 + 0.01 * w), y, 0.02 * h) for s in (-1, 1)]
    foot = _stuffed(bw * 1.02, bd * 1.02, 0.14 * h, 0.01 * h).moved(0, y)
    a = np.linspace(0.04, 0.96, 17) * np.pi
    ridge = np.stack([0.93 * bw / 2 * np.cos(a), np.full(17, y - 0.30 * bd), 0.60 * h + 0.285 * h * np.sin(a)], 1)
    mouth = np.stack([0.30 * w * np.cos(a), np.full(17, front_y - 0.160 * d), 0.355 * h + 0.075 * h * np.sin(a)], 1)
    zips = [tube(ridge, 0.005, 6), tube(mouth, 0.004, 6)]
    pulls = [
        box([p[0] - 0.005, p[1] - 0.010, p[2] - 0.032], [p[0] + 0.005, p[1] - 0.005, p[2]], 0.002)
        for p in (ridge[4], mouth[12])
    ]
    t = np.linspace(0, np.pi, 11)
    arch = np.stack([0.11 * w * np.cos(t), np.full(11, y + 0.12 * d), 0.915 * h + 0.085 * h * np.sin(t)], 1)
    loop = tube(arch, 0.008, 7)
    straps = [_strap(s * 0.19 * w, y + bd / 2, d / 2, h) for s in (-1, 1)]
    label = box([-0.05 * w, front_y - 0.178 * d, 0.17 * h], [0.05 * w, front_y - 0.160 * d, 0.25 * h], 0.003)
    cloth = spec.material("cloth", "denim/0")
    trim = spec.material("trim", "leather/0")
    return parts_of(
        (cloth, [body, pocket.shifted_uv(0.1, 0.3), *sides]),
        (trim, [foot, loop, *straps, label]),
        ("seam", zips),
        ("steel", pulls),
    )


def _stuffed(w: float, d: float, h: float, shoulder: float) -> Shape:
    """A stuffed bag on the floor, round-cornered from above, its top domed from `shoulder` below it."""
    cols, t = 28, np.linspace(0, 1, 6)
    side, dome = np.linspace(0.12, 1, 5), t[1:] * np.pi / 2
    up = np.concatenate([[0.0, 0.02], side * (h - shoulder) / h, 1 - shoulder / h * (1 - np.sin(dome))])
    wide = np.concatenate([[0.86, 0.95], 1 - 0.05 * side, 0.95 * np.cos(dome[:-1]) ** 0.55, [0.0]])
    angle = np.linspace(0, 2 * np.pi, cols + 1)
    c, s = np.cos(angle), np.sin(angle)
    x, y = np.sign(c) * np.abs(c) ** 0.55 * w / 2, np.sign(s) * np.abs(s) ** 0.55 * d / 2
    grid = np.stack([wide[:, None] * x, wide[:, None] * y, np.repeat(up[:, None] * h, cols + 1, 1)], -1)
    rim = shapely.Polygon(np.column_stack([0.86 * x, 0.86 * y])[:-1])
    return joined(sheet(grid), flat(rim, 0.0, up=False))


def _strap(x: float, y: float, back: float, h: float) -> Shape:
    """A padded shoulder strap at x: from the top of the back at y, out to `back`, and in again near the floor."""
    s = np.linspace(0, 1, 12)
    bow = np.sin(np.pi * s) ** 0.6
    path = np.stack([x * (1 + 0.35 * s), y - 0.012 + (back - y - 0.002) * bow, h * (0.86 - 0.80 * s)], 1)
    across = np.array([0.022, 0, 0])
    return sheet(np.stack([path - across, path, path + across], 1)[:, ::-1], 0.012)


def suitcase(spec: BuildRequest) -> list[MeshPart]:
    """A hard suitcase on its long edge: two ribbed shells, a metal seam, corners, two locks and a grip above."""
    w, d, h = spec.size
    low, high = 0.018, h - 0.055
    outline = shapely.box(-w / 2 + 0.004, low, w / 2 - 0.004, high)
    tall, wide = high - low, w - 0.008
    shell = _half_shell(outline, d / 2 - 0.009, 0.05)
    ribs = [
        box([x - 0.011, -d / 2, low + 0.09 * tall], [x + 0.011, -d / 2 + 0.012, high - 0.09 * tall], 0.004)
        for x in np.linspace(-0.38, 0.38, 8) * wide
    ]
    halves = [joined(shell, *ribs), joined(shell, *ribs).turned(np.pi)]
    ring = np.asarray(outline.buffer(-0.05).buffer(0.052, quad_segs=6).exterior.coords)[:-1]
    seam = tube(np.column_stack([ring[:, 0], 0 * ring[:, 0], ring[:, 1]]), 0.0065, 6, closed=True)
    corners = [
        _corner(s * (w / 2 - 0.05), t, s, u, d) for s in (-1, 1) for t, u in ((low + 0.046, -1), (high - 0.046, 1))
    ]
    locks = [
        joined(
            box([x - 0.022, -0.024, high - 0.004], [x + 0.022, 0.024, high + 0.008], 0.002),
            box([x - 0.012, -0.010, high + 0.006], [x + 0.012, 0.010, high + 0.014], 0.002),
        )
        for x in (-0.30 * w, 0.30 * w)
    ]
    t = np.linspace(0, 1, 13)
    lift = np.clip(np.sin(np.pi * t) * 2.2, 0, 1)
    grip = tube(np.stack([(t - 0.5) * 0.17, 0 * t, high + 0.006 + (h - high - 0.014) * lift], 1), 0.0085, 8)
    posts = [box([x - 0.016, -0.016, high - 0.002], [x + 0.016, 0.016, high + 0.014], 0.003) for x in (-0.085, 0.085)]
    feet = [
        box([x - 0.02, y - 0.012, 0], [x + 0.02, y + 0.012, low + 0.008], 0.004)
        for x in (-0.34 * w, 0.34 * w)
        for y in (-0.06, 0.06)
    ]
    return parts_of(
        (spec.material("shell", "leather/0") if "shell" in spec.params else plain((0.15, 0.29, 0.46), 0.35), halves),
        ("chrome", [seam, *locks, *posts]),
        ("black", [grip, *feet]),
        (plain((0.55, 0.55, 0.56), 0.35, 1.0), corners),
    )


def _half_shell(outline: shapely.Polygon, deep: float, r: float) -> Shape:
    """Half a case over an outline in x and z, from y = 0 to -`deep`, its edges rounded by r."""
    t = np.linspace(0, np.pi / 2, 7)
    rows = [(0.0, 0.0), *((deep - r + r * np.sin(a), r * (1 - np.cos(a))) for a in t)]
    grid = []
    for y, inset in rows:
        ring = outline.buffer(-0.07).buffer(0.07 - inset, quad_segs=5)
        p = np.asarray(shapely.geometry.polygon.orient(ring).exterior.coords)
        grid.append(np.column_stack([p[:, 0], np.full(len(p), -y), p[:, 1]]))
    p = grid[-1]
    face = flat(shapely.Polygon(p[:, [0, 2]]), deep)
    return joined(sheet(np.array(grid)[:, ::-1]).reversed(), face.turned(np.pi / 2, "x"))


def _corner(x: float, z: float, side: int, up: int, d: float) -> Shape:
    """A metal cap on an edge's corner, as deep as the case."""
    a = np.linspace(0, np.pi / 2, 7)
    ring = np.stack([x + side * 0.0495 * np.cos(a), z + up * 0.0495 * np.sin(a)], 1)
    grid = np.stack([np.column_stack([ring[:, 0], np.full(7, y), ring[:, 1]]) for y in (-d * 0.26, d * 0.26)])
    return sheet(grid if side * up > 0 else grid[::-1], 0.003)
