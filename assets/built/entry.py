"""Things by the door: coats, shoes, umbrellas, mats."""

from __future__ import annotations

import numpy as np
import shapely

from embodied.assets.built.parametric import TINTS, BuildRequest, parts_of, plain
from embodied.assets.built.primitives import Shape, bar, box, extruded, joined, lathe, sheet, tube
from embodied.assets.records import MeshPart


def shoes(spec: BuildRequest) -> list[MeshPart]:
    """A pair of low shoes, one a little askew."""
    (w, d, h), rng = spec.size, spec.rng
    colour = TINTS[f"{spec.word('colour', 'brown')} shoe"]
    length, width = d * 0.97, w * 0.44
    uppers: list[Shape] = []
    soles: list[Shape] = []
    laces: list[Shape] = []
    for side in (-1, 1):
        s, t = np.linspace(0, 1, 22), np.linspace(0, np.pi, 13)
        wide = 0.62 + 0.50 * np.sin(np.pi * s**0.75) ** 0.7 - 0.22 * np.exp(-(((s - 0.38) / 0.16) ** 2))
        outline = width / 2 * wide * np.clip(np.sin(np.pi * (s * 0.94 + 0.03)) * 3.2, 0, 1) ** 0.5
        places = [0, 0.08, 0.22, 0.42, 0.60, 0.80, 0.94, 1]
        height = h * np.interp(s, places, [0.55, 0.98, 0.92, 0.86, 0.72, 0.50, 0.36, 0.16])
        y = length * (0.5 - s)
        across = outline[:, None] * np.cos(t)[None]
        up = 0.024 + (height[:, None] - 0.024) * np.sin(t)[None] ** 0.55
        open_ = ((s > 0.08) & (s < 0.40))[:, None] * np.exp(-((np.cos(t)[None] / 0.55) ** 4))
        upper = sheet(np.stack([-across, y[:, None] + 0 * across, up - open_ * h * 0.42], -1)[::-1])
        lay = [(upper, uppers), (_sole(outline, y), soles)]
        for k, q in enumerate((0.46, 0.53, 0.60)):
            i = int(q * 21)
            x, z = outline[i] * 0.45, height[i] * 0.97
            lay.append((bar([-x, y[i], z], [x, y[i] - 0.004 * k, z], 0.007, 0.005), laces))
        turn, at = side * 0.04 + rng.normal(0, 0.05), side * w * 0.25
        for shape, group in lay:
            group.append(shape.scaled(side, 1, 1).turned(turn).moved(at, rng.normal(0, 0.003)))
    pale = (0.88, 0.87, 0.84) if spec.params.get("colour") in ("white", "blue") else (0.09, 0.08, 0.075)
    dark = (0.7 * colour[0], 0.7 * colour[1], 0.7 * colour[2])
    return parts_of((plain(colour, 0.45), uppers), (plain(pale, 0.7), soles), (plain(dark, 0.8), laces))


def _sole(outline: np.ndarray, y: np.ndarray) -> Shape:
    ring = np.concatenate([np.stack([outline * 1.06, y], 1), np.stack([-outline * 1.06, y], 1)[::-1]])
    return extruded(shapely.Polygon(ring).buffer(0), 0, 0.026)


def coat_hooks(spec: BuildRequest) -> list[MeshPart]:
    """A board with hooks, some of them with coats, a bag or a scarf."""
    (w, d, h), rng = spec.size, spec.rng
    top = h - 0.10
    plank = box([-w / 2, d / 2 - 0.02, top], [w / 2, d / 2, h], 0.004)
    count = max(3, round(w / 0.17))
    hooks, clothes = [], []
    cloths = ("tweed/0", "linen/4", "denim/0", "linen/3", "velvet/3", "linen/6", "tweed/1")
    turns = rng.permutation(len(cloths))
    full = {int(k) for k in rng.choice(count, min(int(spec.params.get("coats", 3)), count), replace=False)}
    for k, x in enumerate(np.linspace(-w / 2 + 0.07, w / 2 - 0.07, count)):
        y = d / 2 - 0.02
        hooks.append(tube([(x, y, h - 0.03), (x, y - 0.045, h - 0.035), (x, y - 0.06, h - 0.012)], 0.006, 8))
        hooks.append(tube([(x, y, h - 0.065), (x, y - 0.025, h - 0.075), (x, y - 0.035, h - 0.06)], 0.005, 8))
        if k in full:
            drop = (h - 0.04) * (1.0 if k == min(full) else rng.uniform(0.72, 0.98))
            garment = _coat(min(0.40, w / count * 2.0), d * 0.62, drop, rng=rng)
            garment = garment.moved(x, d / 2 - 0.02 - d * 0.40, h - 0.035 - drop)
            clothes.append((spec.finish(cloths[turns[k % len(cloths)]]), garment))
    return parts_of((spec.material("wood", "oak/0"), plank), (spec.metal("black"), hooks), *clothes)


def _coat(w: float, d: float, h: float, *, rng: np.random.Generator) -> Shape:
    """A coat on a hook: a tube of cloth with sloping shoulders, folded towards the hem, its front lapped over, with
    sleeves, cuffs, flaps of pockets and a turned-down collar."""
    rows, cols = 11, 28
    t = np.linspace(0, 1, rows + 1)[:, None]
    a = np.linspace(0, 2 * np.pi, cols + 1)[None]
    turn = rng.uniform(0, 6)

    def at(t: np.ndarray, a: np.ndarray, out: float = 0.0) -> np.ndarray:
        """Points on the body, `out` metres before it: t from hem to neck, a around it, -pi / 2 in front."""
        half = w / 2 * np.interp(t, [0, 0.45, 0.8, 0.87, 0.94, 1.0], [0.92, 0.78, 0.80, 0.72, 0.36, 0.16]) + out
        deep = d / 2 * np.interp(t, [0, 0.5, 0.85, 0.93, 1.0], [0.85, 0.75, 0.7, 0.45, 0.26]) + out
        fold = 1 + 0.10 * (1 - t) ** 1.3 * np.sin(7 * a + turn + 1.5 * t) + 0.04 * (1 - t) * np.sin(3 * a + 4 * t)
        x, y = half * np.cos(a) * fold, deep * np.sin(a) * fold
        return np.stack(np.broadcast_arrays(x, y, h * t - 0.01 * (1 - t) * np.sin(7 * a + turn)), -1)

    shapes = [sheet(at(t, a))]
    lap = np.linspace(-0.12, 0.16, 4)[None] - np.pi / 2
    shapes.append(sheet(at(np.linspace(0.01, 0.93, 12)[:, None], lap, 0.006), 0.004))
    for s in (-1, 1):
        flap = np.linspace(-0.24, 0.24, 5)[None] + s * 0.62 - np.pi / 2
        shapes.append(sheet(at(np.linspace(0.36, 0.41, 3)[:, None], flap, 0.007), 0.005))
        q = np.linspace(0, 1, 8)
        reach = np.interp(q, [0, 0.12, 0.3, 1], [0.24, 0.36, 0.41, 0.44 + rng.uniform(-0.02, 0.02)])
        bend = rng.uniform(0.02, 0.10) * d * np.sin(np.pi * q) + 0.05 * d * q
        path = np.stack([s * w * reach, -bend, h * np.interp(q, [0, 0.12, 1], [0.88, 0.83, 0.30])], 1)
        wide = w * np.interp(q, [0, 0.15, 0.6, 1], [0.07, 0.125, 0.105, 0.095])
        shapes.append(tube(path, wide * (1 + 0.05 * np.sin(9 * q + turn)), 8))
        shapes.append(tube(path[-2:], 1.08 * wide[-2:], 8))
    around = np.linspace(0, 2 * np.pi, 14, endpoint=False)
    neck = 0.10 * w * np.cos(around), 0.22 * d * np.sin(around) - 0.01, h * (0.955 + 0.02 * np.sin(around))
    shapes.append(tube(np.stack(neck, 1), 0.05 * w, 6, closed=True))
    return joined(*shapes)


def coat(spec: BuildRequest) -> list[MeshPart]:
    """A coat on a hook."""
    w, d, h = spec.size
    hook = tube([(0, d / 2, h - 0.02), (0, d / 2 - 0.04, h - 0.025), (0, d / 2 - 0.05, h)], 0.005, 8)
    body = _coat(w, d * 0.7, h - 0.02, rng=spec.rng).moved(0, d / 2 - 0.01 - d * 0.42, 0)
    return parts_of((spec.metal("black"), hook), (spec.material("cloth", "tweed/0"), body))


def shoe_rack(spec: BuildRequest) -> list[MeshPart]:
    """Two slatted boards between two sides."""
    w, d, h = spec.size
    board = 0.018
    sides = [box([x0, -d / 2, 0], [x0 + board, d / 2, h], 0.002) for x0 in (-w / 2, w / 2 - board)]
    slats = [
        box([-w / 2 + board, y, z], [w / 2 - board, y + 0.05, z + 0.016], 0.002)
        for z in (h * 0.22 - 0.016, h - 0.016)
        for y in np.linspace(-d / 2 + 0.005, d / 2 - 0.055, 4)
    ]
    return parts_of((spec.material("wood", "oak/0"), [*sides, *slats]))


def umbrella_stand(spec: BuildRequest) -> list[MeshPart]:
    """A tall pot with two umbrellas."""
    w, _, h = spec.size
    r, pot = w / 2, h * 0.58
    stand = lathe([(0, 0), (r * 0.92, 0), (r * 0.96, pot), (r * 0.9, pot), (r * 0.86, 0.012), (0, 0.012)], 28)
    shafts, cloths = [], []
    for k, lean in enumerate((0.10, -0.12)):
        t = np.linspace(0, 1, 7)
        foot = np.array([-lean * r * 3, 0.02 * k, 0.02])
        crook = np.array([lean * r * 5, 0.03 * k, h * (0.90 - 0.05 * k)])
        up = 0.032 * np.sin(np.pi * t) + 0.01 * (t < 0.1)
        hook = crook + np.stack([0.032 * (1 - np.cos(np.pi * t)), 0 * t, up], 1)
        shafts += [tube([foot, crook], 0.005, 7), tube(hook, 0.008, 8)]
        along = foot + (crook - foot) * np.array([0.12, 0.3, 0.55, 0.75])[:, None]
        cloths.append(tube(along, [0.008, 0.026, 0.032, 0.012], 10))
    return parts_of(
        (spec.metal("black"), stand),
        (plain((0.30, 0.20, 0.12), 0.4), shafts),
        (plain((0.10, 0.12, 0.18), 0.7), cloths[0]),
        (plain((0.45, 0.12, 0.12), 0.7), cloths[1]),
    )


def doormat(spec: BuildRequest) -> list[MeshPart]:
    w, d, h = spec.size
    edge = box([-w / 2, -d / 2, 0], [w / 2, d / 2, h * 0.6], 0.002)
    mat = box([-w / 2 + 0.02, -d / 2 + 0.02, 0], [w / 2 - 0.02, d / 2 - 0.02, h], 0.004)
    return parts_of((plain((0.06, 0.06, 0.06), 0.8), edge), (spec.material("skin", "sisal/0"), mat))
