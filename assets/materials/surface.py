"""Coats on walls and things: paint, plaster, wallpaper, metal, plastic, paper, wicker."""

from collections.abc import Callable

import cv2
import numpy as np

from embodied.assets.materials.maps import Canvas, Colors, Maps, coordinates, maps_of, mix, rgb, smooth_step
from embodied.assets.records import Color


def paint(on: Canvas, color: Color, rough: float = 0.85, nap: float = 1.0) -> Maps:
    """Wall paint from a roller: one colour, a fine orange peel, hardly any shade."""
    peel = on.fbm(40, 220, 0.6)
    cloud = on.fbm(4, 12, 1.0)
    out = rgb(color) * (1 + 0.004 * nap * peel + 0.002 * cloud)[..., None]
    return maps_of(out, np.clip(rough + 0.02 * peel, 0.1, 1))


def gloss_paint(on: Canvas, color: Color, rough: float = 0.35) -> Maps:
    """Satin paint on joinery, with faint brush marks along u."""
    brush = on.noise(40, 1.2)
    out = rgb(color) * (1 + 0.0022 * brush)[..., None]
    return maps_of(out, np.clip(rough + 0.02 * brush, 0.05, 1))


def plaster(on: Canvas, color: Color, relief: float = 1.0, mottle: float = 0.009) -> Maps:
    """Trowelled lime plaster or roughcast: sweeps, grain, soft clouds."""
    sweep = on.fbm(5, 90, 1.2, 1.6)
    grain = on.noise(1.6, 1.6)
    return maps_of((rgb(color) * (1 + mottle * sweep + 0.012 * relief * grain)[..., None]), 0.92)


def metal(on: Canvas, color: Color, rough: float = 0.28, brushed: float = 1.0, stain: float = 0.0) -> Maps:
    """Brushed or polished metal; `stain` adds patina."""
    lines = on.noise(90, 0.5)
    out = rgb(color) * (1 + 0.02 * brushed * lines)[..., None]
    if stain:
        cloud = on.fbm(3, 80, 1.2)
        out = mix(out, rgb(color) * 0.55, stain * smooth_step(cloud, -0.5, 2.0))
    return maps_of(out, np.clip(rough + 0.05 * brushed * lines, 0.04, 1))


def wicker(on: Canvas, color: Color, strands: int = 24) -> Maps:
    """Basketwork: level strands over and under upright stakes."""
    tile = on.tile
    u, v = on.coordinates()
    y = v / tile * strands + 0.5
    j = np.floor(y).astype(int)
    fy = y - j - 0.5
    over = np.cos(np.pi * ((u / tile * (strands // 3)) + (j % 2)))
    bulge = np.cos(np.pi * fy) ** 0.7
    fibre = on.noise(12, 0.8)
    tone = on.rng.normal(0, 0.05, strands)[j % strands]
    out = rgb(color) * (0.5 + 0.42 * bulge * (0.72 + 0.28 * over) + tone + 0.06 * fibre)[..., None]
    return maps_of(out, 0.7, 0.01, 0.97)


def wallpaper(
    on: Canvas, ground: Color, inks: Colors, motif: Callable[..., list[np.ndarray]], woven: float = 0.5
) -> Maps:
    """Paper with `motif(n, rng=rng)`: masks (n, n) printed one over the other in `inks`."""
    grain = on.noise(1.2, 1.2)
    thread = on.noise(0.6, 14)
    out = on.rgb(ground)
    for mask, ink in zip(motif(on.n, rng=on.rng), inks):
        out = mix(out, on.rgb(ink), np.clip(mask, 0, 1))
    out = out * (1 + 0.008 * grain + 0.012 * woven * thread)[..., None]
    return maps_of(out, 0.85)


def stripes(n: int, count: int, share: float = 0.5, pin: bool = False, *, rng: np.random.Generator) -> list[np.ndarray]:
    """Upright stripes; `pin` sets a thin line beside each."""
    x = (np.arange(n) + 0.5) / n * count % 1
    wide = smooth_step(share / 2 - np.abs(x - 0.5), -0.01, 0.01)
    thin = smooth_step(0.012 - np.abs(np.abs(x - 0.5) - share / 2 - 0.06), -0.006, 0.006)
    return [np.broadcast_to(m[None], (n, n)) for m in ([wide, thin] if pin else [wide])]


class _Print:
    """A mask on which polygons are stamped around the tile's border, at twice the resolution."""

    def __init__(self, n: int) -> None:
        self.n, self.mask = n, np.zeros((2 * n, 2 * n), np.uint8)

    def fill(self, points: np.ndarray, level: float = 1.0) -> None:
        """points (k, 2) in tiles."""
        size = 2 * self.n
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                p = (points + [dx, dy]) * size
                if p[:, 0].max() > 0 and p[:, 1].max() > 0 and p[:, 0].min() < size and p[:, 1].min() < size:
                    cv2.fillPoly(self.mask, [np.round(p * 16).astype(np.int32)], int(level * 255), cv2.LINE_AA, 4)

    def line(self, points: np.ndarray, width: float, level: float = 1.0) -> None:
        """A stroke of `width` tiles that thins out towards its ends."""
        d = np.gradient(points, axis=0)
        d /= np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-9)
        half = width / 2 * (0.35 + 0.65 * np.sin(np.linspace(0.15, np.pi - 0.15, len(points))))
        side = np.stack([-d[:, 1], d[:, 0]], 1) * half[:, None]
        self.fill(np.concatenate([points + side, (points - side)[::-1]]), level)

    def done(self) -> np.ndarray:
        return cv2.resize(self.mask, (self.n, self.n), interpolation=cv2.INTER_AREA).astype(np.float32) / 255


def _leaf(at: np.ndarray, angle: float, length: float, width: float, bend: float = 0.0) -> np.ndarray:
    t = np.linspace(0, 1, 14)
    half = width * np.sin(np.pi * t) ** 0.8 * (1 - 0.35 * t)
    mid = np.stack([t * length, bend * length * t * t], 1)
    shape = np.concatenate([mid + np.stack([0 * t, half], 1), (mid - np.stack([0 * t, half], 1))[::-1]])
    c, s = np.cos(angle), np.sin(angle)
    return shape @ np.array([[c, s], [-s, c]]) + at


def floral(n: int, stems: int = 5, scale: float = 1.0, *, rng: np.random.Generator) -> list[np.ndarray]:
    """Climbing stems with leaves and flowers: inks are leaves, petals, hearts."""
    green, petals, hearts = _Print(n), _Print(n), _Print(n)
    for k in range(stems):
        x0, phase = (k + rng.uniform(-0.1, 0.1)) / stems, rng.uniform(0, 6.28)
        t = np.linspace(0, 1, 60)
        stem = np.stack([x0 + 0.035 * np.sin(2 * np.pi * t + phase) + 0.012 * np.sin(6 * np.pi * t), 1 - t], 1)
        green.line(stem, 0.004 * scale + 0.002)
        for i in range(2, 60, 6):
            side = 1 if (i // 6) % 2 else -1
            angle = -np.pi / 2 + side * rng.uniform(0.7, 1.2)
            leaf = _leaf(stem[i], angle, scale * rng.uniform(0.05, 0.075), 0.013 * scale, side * 0.25)
            green.fill(leaf, rng.uniform(0.6, 1.0))
        for i in rng.choice(np.arange(4, 58), 2, replace=False):
            centre = stem[i] + rng.normal(0, 0.02, 2)
            r, spin = scale * rng.uniform(0.028, 0.042), rng.uniform(0, 6)
            for j in range(6):
                petals.fill(_leaf(centre, spin + j * np.pi / 3, r, r * 0.42), 0.75 + 0.25 * (j % 2))
            a = np.linspace(0, 2 * np.pi, 16)
            hearts.fill(centre + 0.24 * r * np.stack([np.cos(a), np.sin(a)], 1))
    return [green.done(), petals.done(), hearts.done()]


def damask(n: int, columns: int = 3, *, rng: np.random.Generator) -> list[np.ndarray]:
    """Mirrored ogee ornaments in half drop, tone on tone."""
    out = _Print(n)
    w = 1.0 / columns
    curls = [(rng.uniform(0.10, 0.3), rng.uniform(0.15, 0.85), rng.uniform(0.3, 1.3)) for _ in range(5)]
    for c in range(columns):
        for r in range(columns):
            centre = np.array([(c + 0.5 * (r % 2) * (columns % 2 == 0)) * w, r * w])
            for drop in (0, 1):
                _ornament(out, (centre + ([0.5 * w, 0.5 * w] if drop else [0, 0])), w, curls)
    return [out.done()]


def _ornament(out: _Print, o: np.ndarray, w: float, curls: list[tuple[float, float, float]]) -> None:
    t = np.linspace(0, 1, 24)
    for side in (-1, 1):
        flip = np.array([side, 1.0])
        ogee = np.stack([0.36 * w * np.sin(np.pi * t) ** 1.3, (t - 0.5) * 0.92 * w], 1)
        out.line(o + ogee * flip, 0.035 * w)
        inner = np.stack([0.20 * w * np.sin(np.pi * t) ** 1.1, (t - 0.45) * 0.55 * w], 1)
        out.line(o + inner * flip, 0.022 * w)
        for k in range(5):
            angle = -np.pi / 2 + side * (0.25 + 0.42 * k)
            out.fill(_leaf(o + np.array([0, 0.10 * w]), angle, (0.27 - 0.025 * k) * w, 0.030 * w, -side * 0.2))
        for reach, height, bend in curls:
            start = o + np.array([side * 0.30 * w * np.sin(np.pi * height), (height - 0.5) * 0.8 * w])
            out.fill(_leaf(start, np.pi / 2 - side * (0.8 + bend), reach * 0.6 * w, 0.022 * w, side * 0.5))
    out.fill(_leaf(o + np.array([0, 0.36 * w]), -np.pi / 2, 0.20 * w, 0.04 * w))
    out.fill(_leaf(o + np.array([0, 0.12 * w]), -np.pi / 2, 0.36 * w, 0.045 * w))


def scallops(n: int, columns: int = 8, *, rng: np.random.Generator) -> list[np.ndarray]:
    """Overlapping fans, as on paper of the 1920s: lines only."""
    u, v = coordinates(n, 1.0)
    a = 1.0 / columns
    x, y = u / a, v / a * 2
    lines, done = np.zeros((n, n)), np.zeros((n, n), bool)
    for step in (1, 0, -1):
        row = np.floor(y) + step
        cx = np.round(x - 0.5 * (row % 2)) + 0.5 * (row % 2)
        d = np.hypot(x - cx, (y - row - 0.0) / 2)
        inside = (d < 0.5) & ~done
        rings = np.min([np.abs(d - r) for r in (0.485, 0.36, 0.24, 0.12)], axis=0)
        lines = np.where(inside, 1 - smooth_step(rings, 0.010, 0.025), lines)
        done |= inside
    return [lines]


def trellis(n: int, columns: int = 6, width: float = 0.09, *, rng: np.random.Generator) -> list[np.ndarray]:
    """A rounded lattice: level sets of a sum of cosines."""
    u, v = coordinates(n, 1.0)
    across, up = 2 * np.pi * columns * u, 2 * np.pi * columns * v
    f = np.cos(across) + np.cos(up) + 0.35 * np.cos(2 * across) * np.cos(2 * up)
    slope = np.hypot(*np.gradient(f)) * n / columns / 6.28
    return [1 - smooth_step(np.abs(f) / np.maximum(slope, 0.25), width * 0.7, width)]


def leaves(n: int, count: int = 60, *, rng: np.random.Generator) -> list[np.ndarray]:
    """Scattered sprigs in two tones."""
    pale, dark = _Print(n), _Print(n)
    side = int(np.ceil(np.sqrt(count)))
    for i in range(side):
        for j in range(side):
            at = (np.array([i + 0.5 * (j % 2), j]) + rng.uniform(-0.22, 0.22, 2)) / side
            angle = rng.uniform(0, 2 * np.pi)
            reach = 0.8 / side * rng.uniform(0.75, 1.1)
            layer = pale if (i + j) % 2 else dark
            d = np.array([np.cos(angle), np.sin(angle)])
            layer.line(at + np.linspace(0, 1, 8)[:, None] * d * reach, 0.006)
            for k in range(1, 6):
                for s in (-1, 1):
                    start, long = at + d * reach * k / 6, reach * 0.42 * (1 - 0.08 * k)
                    layer.fill(_leaf(start, angle + s * 0.75, long, reach * 0.085, s * 0.15), 0.9)
            layer.fill(_leaf(at + d * reach * 0.9, angle, reach * 0.32, reach * 0.08), 0.9)
    return [pale.done(), dark.done()]


def grasscloth(on: Canvas, color: Color) -> Maps:
    """Woven grass on paper: level fibres of uneven thickness and colour."""
    long, fine = on.noise(120, 1.3), on.noise(40, 0.6)
    upright = on.noise(0.8, 60)
    knots = smooth_step(on.noise(3, 1), 2.6, 3.2)
    shade = 1 + 0.06 * long + 0.045 * fine + 0.02 * upright - 0.12 * knots
    return maps_of(rgb(color) * shade[..., None], 0.9, 0.01, 0.97)
