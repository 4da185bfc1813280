"""Rugs, curtains, blinds, cushions and blankets."""

from __future__ import annotations

import numpy as np

from assets.built.maker import WHITE, FinishOf, Look, Size, material, metal, parts_of, plain, whole_image
from assets.built.primitives import (
    Shape,
    ball,
    box,
    cylinder,
    folds,
    joined,
    lathe,
    moved,
    pillow,
    quads,
    scaled,
    sheet,
    shifted_uv,
    tube,
    turned,
)
from assets.records import MeshPart

LIVING = {
    "living_room": 1.0,
    "family_room": 1.0,
    "bedroom": 0.8,
    "main_bedroom": 0.9,
    "guest_room": 0.7,
    "study": 0.6,
    "library": 0.7,
    "dining_room": 0.6,
    "hall": 0.4,
}


def rug(size: Size, look: Look, finish: FinishOf, *, rng: np.random.Generator) -> list[MeshPart]:
    """A rectangular rug with its pattern; fringes at the short ends where look['fringe'] is 1."""
    w, d, h = size
    name = str(look.get("pattern", "rug_bordered/0"))
    pattern = finish(name)
    fringe = 0.045 if look.get("fringe") else 0.0
    w0 = w / 2 - fringe
    body = box([-w0, -d / 2, 0], [w0, d / 2, h], min(0.004, h * 0.4))
    body = (
        whole_image(body, pattern, -w0, w0, -d / 2, d / 2, "xy", keep_aspect=False) if name.startswith("rug_") else body
    )
    tassels = []
    if fringe:
        y = np.arange(-d / 2 + 0.008, d / 2 - 0.008, 0.014)
        for side in (-1, 1):
            reach = rng.uniform(0.7, 1.0, len(y)) * fringe
            sway = rng.normal(0, 0.003, len(y))
            a, b = side * w0, side * (w0 + reach)
            c = np.stack(
                [
                    np.stack([np.full_like(y, a), y - 0.004, np.full_like(y, 0.004)], 1),
                    np.stack([b, y - 0.003 + sway, np.full_like(y, 0.002)], 1),
                    np.stack([b, y + 0.003 + sway, np.full_like(y, 0.002)], 1),
                    np.stack([np.full_like(y, a), y + 0.004, np.full_like(y, 0.004)], 1),
                ],
                1,
            )
            tassels.append(quads(c if side > 0 else c[:, ::-1]))
        tassels += [box([-w / 2, -0.004, 0], [-w0, 0.004, 0.003]), box([w0, -0.004, 0], [w / 2, 0.004, 0.003])]
    return parts_of((pattern, body), (plain((0.80, 0.75, 0.64), 0.95, specular=0.05), tassels))


def round_rug(size: Size, look: Look, finish: FinishOf, *, rng: np.random.Generator) -> list[MeshPart]:
    """A round (or oval) rug."""
    w, d, h = size
    pattern = material(look, "pattern", finish, "rug_rings/0")
    disc = lathe([(0, 0), (0.49, 0), (0.5, h * 0.4), (0.495, h * 0.85), (0.485, h), (0, h)], 56, 0.8)
    disc = scaled(disc, w, d, 1.0)
    return parts_of((pattern, whole_image(disc, pattern, -w / 2, w / 2, -d / 2, d / 2, "xy", keep_aspect=False)))


def curtain(size: Size, look: Look, finish: FinishOf, *, rng: np.random.Generator) -> list[MeshPart]:
    """A pair of curtains drawn back to the sides of a window, on a rod with rings and finials."""
    w, d, h = size
    cloth = material(look, "cloth", finish, "linen/0")
    rod_z = h - 0.03
    open_to = float(look.get("drawn", 0.30))
    panel = w * open_to * 0.5 + 0.10
    parts, hooks = [], []
    for side in (-1, 1):
        width = panel * rng.uniform(0.94, 1.06)
        count = max(4, round(width / 0.075))
        grid = folds(width, rod_z - 0.035, count, min(d * 0.30, 0.055), rng=rng, columns=count * 7, rows=5)
        cloth_sheet = sheet(grid, 0.0025)
        # Cloth is gathered: the pattern runs on over the folds, as measured along the sheet.
        parts.append(moved(cloth_sheet, side * (w / 2 - 0.05 - width / 2), -0.01, 0.0))
        for x in np.linspace(-0.46, 0.46, max(4, count // 2)) * width:
            ring = tube(
                [(0, 0.019 * np.cos(t), 0.019 * np.sin(t)) for t in np.linspace(0, 2 * np.pi, 12, endpoint=False)],
                0.0022,
                5,
                closed=True,
            )
            hooks.append(moved(ring, side * (w / 2 - 0.05 - width / 2) + x, -0.01, rod_z - 0.008))
    rod = tube([(-w / 2 + 0.03, -0.01, rod_z), (w / 2 - 0.03, -0.01, rod_z)], 0.011, 10)
    ends = [moved(scaled(ball(0.022, 12, 8), 1.4, 1, 1), s * (w / 2 - 0.031), -0.01, rod_z) for s in (-1, 1)]
    brackets = [
        joined(
            box([x - 0.008, -0.01, rod_z - 0.008], [x + 0.008, d / 2, rod_z + 0.008], 0.002),
            box([x - 0.02, d / 2 - 0.006, rod_z - 0.03], [x + 0.02, d / 2, rod_z + 0.03], 0.002),
        )
        for x in (-w / 2 + 0.09, w / 2 - 0.09)
    ]
    return parts_of((cloth, parts), (metal(look, finish, "black"), [rod, *ends, *brackets, *hooks]))


def sheer(size: Size, look: Look, finish: FinishOf, *, rng: np.random.Generator) -> list[MeshPart]:
    """One light curtain over the whole window."""
    w, d, h = size
    grid = folds(w * 0.97, h - 0.03, max(6, round(w / 0.09)), min(d * 0.35, 0.035), rng=rng, rows=5)
    rail = box([-w / 2, -0.012, h - 0.03], [w / 2, 0.02, h], 0.002)
    return parts_of((plain((0.93, 0.93, 0.92), 0.9, specular=0.05), sheet(grid, 0.001)), (WHITE, rail))


def roller_blind(size: Size, look: Look, finish: FinishOf, *, rng: np.random.Generator) -> list[MeshPart]:
    """Cloth from a roll, a bar at its foot, a bead chain."""
    w, d, h = size
    r = min(d / 2, 0.028)
    roll = moved(turned(cylinder(r * 0.85, -w / 2 + 0.02, w / 2 - 0.02, 0, 16), np.pi / 2, "y"), 0, 0, h - r)
    cloth = box([-w / 2 + 0.025, -0.001, 0.014], [w / 2 - 0.025, 0.001, h - r])
    foot = box([-w / 2 + 0.022, -0.006, 0], [w / 2 - 0.022, 0.006, 0.022], 0.003)
    ends = [
        box(
            [s * w / 2 - (0.02 if s > 0 else 0), -d / 2, h - 2 * r],
            [s * w / 2 + (0 if s > 0 else 0.02), d / 2, h],
            0.003,
        )
        for s in (-1, 1)
    ]
    chain = tube([(w / 2 - 0.01, -d / 2 + 0.006, h - r), (w / 2 - 0.01, -d / 2 + 0.006, h * 0.35)], 0.002, 5)
    return parts_of((material(look, "cloth", finish, "linen/1"), [roll, cloth]), (WHITE, [foot, *ends, chain]))


def cushion(size: Size, look: Look, finish: FinishOf, *, rng: np.random.Generator) -> list[MeshPart]:
    """A cushion lying flat, dented by use."""
    w, d, h = size
    cells = 14
    waves = np.zeros((cells + 1, cells + 1))
    x, y = np.meshgrid(np.linspace(-1, 1, cells + 1), np.linspace(-1, 1, cells + 1))
    for _ in range(4):
        a, k = rng.uniform(0, np.pi), rng.uniform(1.5, 3.5)
        waves += 0.045 * h * np.sin(k * (x * np.cos(a) + y * np.sin(a)) * 2 + rng.uniform(0, 6))
    waves -= 0.10 * h * np.exp(-((x - rng.normal(0, 0.2)) ** 2 + (y - rng.normal(0, 0.2)) ** 2) * 3)
    cloth = material(look, "cloth", finish, "linen/7")
    return parts_of((cloth, moved(shifted_uv(pillow(w, d, h, cells, 0.36, waves), *rng.random(2)), 0, 0, h / 2)))


def throw(size: Size, look: Look, finish: FinishOf, *, rng: np.random.Generator) -> list[MeshPart]:
    """A blanket folded to a stack of soft layers, fringe at one side."""
    return parts_of((material(look, "cloth", finish, "tweed/0"), layers(size, int(look.get("layers", 4)), rng=rng)))


def layers(size: Size, count: int, *, rng: np.random.Generator) -> list[Shape]:
    """Folded cloth: rounded slabs on one another, each a little off, joined by folds at the front."""
    w, d, h = size
    t = h / count
    made = []
    for k in range(count):
        c = 8
        x, y = np.meshgrid(np.linspace(-1, 1, c + 1), np.linspace(-1, 1, c + 1))
        edge = np.maximum(np.abs(x), np.abs(y)) ** 8
        sag = 0.06 * t * np.sin(3 * x + rng.uniform(0, 6)) + 0.06 * t * np.cos(3 * y + rng.uniform(0, 6))
        off = rng.normal(0, 0.003, 2)
        top = np.stack(
            [
                x * (w / 2 - 0.004) + off[0],
                y * (d / 2 - 0.004) + off[1],
                (k + 1) * t - 0.36 * t * edge + sag * (1 - edge),
            ],
            -1,
        )
        low = np.stack([top[..., 0], top[..., 1], k * t + 0.30 * t * edge], -1)
        mid = []
        for p, q in ((top, low),):
            rim = (
                [(0, j) for j in range(c)]
                + [(i, c) for i in range(c)]
                + [(c, j) for j in range(c, 0, -1)]
                + [(i, 0) for i in range(c, 0, -1)]
            )
            i, j = np.array(rim).T
            a, b = q[i, j], p[i, j]
            out = (a + b) / 2 + np.stack(
                [np.sign(x[i, j]) * (np.abs(x[i, j]) > 0.99), np.sign(y[i, j]) * (np.abs(y[i, j]) > 0.99), 0 * x[i, j]],
                1,
            ) * 0.004
            ring = np.stack([a, out, b])
            ring = np.concatenate([ring, ring[:, :1]], axis=1)
            mid.append(sheet(ring))
        low_side = sheet(low)
        made += [sheet(top), Shape(low_side.vertices, low_side.faces[:, ::-1], -low_side.normals, low_side.uv), *mid]
    return [shifted_uv(s, *rng.random(2)) for s in made]
