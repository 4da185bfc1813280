"""Tiles with grout, stone, brick, concrete, terrazzo and worktops."""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from embodied.assets.materials.maps import (
    Canvas,
    Color,
    Colors,
    Layout,
    Maps,
    Places,
    blurred,
    bricks,
    look_up,
    maps_of,
    mix,
    rgb,
    smooth_step,
)

Face = tuple[np.ndarray, np.ndarray]
"""Colour (n, n, 3) and roughness to add (n, n)."""


@dataclass(frozen=True)
class Tiles:
    """Tiles with grout: a recipe."""

    layout: Callable[[int, float], Layout]
    surface: Callable[..., Face]
    """surface(places) paints the faces; places are shifted per piece."""
    grout: Color = (0.72, 0.70, 0.66)
    joint: float = 0.003
    """Width of the grout, metres."""
    bevel: float = 0.0015
    tone: float = 0.015
    """Standard deviation of lightness from tile to tile."""
    gloss: float = 0.15

    def __call__(self, on: Canvas) -> Maps:
        n, tile, rng = on.n, on.tile, on.rng
        pieces = self.layout(n, tile)
        pixel = tile / n
        u, v = on.coordinates()
        shift = rng.random((pieces.count, 2))
        x, y = u / tile + shift[pieces.piece, 0], v / tile + shift[pieces.piece, 1]
        color, rough = self.surface(Places(on, x, y))
        lightness = np.clip(rng.normal(0, self.tone, pieces.count), -2.2 * self.tone, 2.2 * self.tone)
        color = color * (1 + lightness[pieces.piece])[..., None]
        half = self.joint / 2
        inside = smooth_step(pieces.edge, half - pixel * 0.4, half + pixel * 0.6)
        grain = on.noise(1.2, 1.2)
        dirt = on.fbm(3, 30, 1.0)
        filler = rgb(self.grout) * (1 + 0.05 * grain + 0.05 * dirt)[..., None]
        shade = 1 - 0.10 * (1 - smooth_step(pieces.edge, half, half + self.bevel + pixel))
        color = filler * (1 - inside)[..., None] + color * (inside * shade)[..., None]
        rough = np.where(inside > 0.5, self.gloss + rough, 0.88)
        return maps_of(color, np.clip(rough, 0.05, 1))


def checker(on: Canvas) -> Maps:
    """Black and white squares, six to the tile."""
    n, tile = on.n, on.tile
    layout = functools.partial(bricks, columns=6, rows=6)
    white = functools.partial(glaze, color=(0.86, 0.85, 0.82), mottle=0.015)
    made = Tiles(layout, white, tone=0.015, gloss=0.2)(on)
    u, v = on.coordinates()
    black = ((u // (tile / 6) + v // (tile / 6)) % 2 == 1)[..., None]
    joint = (layout(n, tile).edge < 0.0015)[..., None]
    dark = made.color * [0.10, 0.10, 0.105] + 0.01
    return Maps(np.where(black & ~joint, dark, made.color).astype("float32"), made.roughness)


def glaze(at: Places, color: Color, mottle: float = 0.008) -> Face:
    """Glazed ceramic, nearly one colour."""
    cloud = at.fbm(3, 60, 1.3)
    return rgb(color) * (1 + mottle * cloud)[..., None], 0.01 * cloud


def matt(at: Places, color: Color, speck: float = 0.025, cloudiness: float = 0.016) -> Face:
    """Unglazed stoneware and cement: clouds and fine grain."""
    cloud = at.fbm(2, 120, 1.2)
    grain = at.noise(0.8, 0.8)
    return rgb(color) * (1 + cloudiness * cloud + speck * grain)[..., None], 0.03 * cloud


def marble(at: Places, base: Color, vein: Color, amount: float = 0.7) -> Face:
    """Veined marble: ridges of warped noise, some sharp, most faint."""
    # Whole-number shears keep the period; veins run long along the diagonal.
    x, y = at.x, at.y
    p, q = x + y, 2 * (x - y)
    wx, wy = at.on.fbm(1.5, 14, 1.8), at.on.fbm(3, 40, 1.6)
    p = p + 0.05 * look_up(wx, x, y) + 0.008 * look_up(wy, x, y)
    q = q + 0.06 * look_up(wx, y, x) + 0.012 * look_up(wy, y, x)
    x2, y2 = x + 0.03 * look_up(wx, x, y), y + 0.03 * look_up(wy, x, y)
    wide = np.abs(look_up(at.on.fbm(0.9, 7, 2.3), p, q))
    thin = np.abs(look_up(at.on.fbm(1.8, 16, 2.0), p, q + 0.3))
    presence = smooth_step(at.fbm(1.5, 8, 1.3), -0.6, 1.6)
    cloud = look_up(at.on.fbm(1.5, 90, 1.3), x2, y2)
    strong = np.exp(-((wide / 0.045) ** 2)) * (0.25 + 0.75 * presence) + 0.35 * np.exp(-wide / 0.22)
    faint = 0.45 * np.exp(-((thin / 0.05) ** 2)) * presence
    t = np.clip(amount * (0.75 * strong + faint) + 0.06 * cloud, 0, 1)
    return mix(rgb(base) * (1 + 0.012 * cloud)[..., None], rgb(vein), t), 0.02 * t


def slate(at: Places, base: Color, warm: Color = (0.40, 0.34, 0.28), rust: float = 0.25) -> Face:
    """Cleft slate: layered relief and rusty patches."""
    relief = at.fbm(2, 150, 1.5)
    cloud = at.fbm(2, 40, 1.4)
    color = rgb(base) * (1 + 0.10 * relief + 0.05 * cloud)[..., None]
    color = mix(color, rgb(warm), rust * smooth_step(cloud, 0.6, 2.0))
    return color, 0.06 * relief


def terracotta(at: Places, base: Color = (0.70, 0.42, 0.29), pale: Color = (0.80, 0.58, 0.44)) -> Face:
    """Fired clay: mottled from red to straw."""
    cloud = at.fbm(1.5, 50, 1.5)
    grain = at.noise(0.9, 0.9)
    color = mix(rgb(base), rgb(pale), np.clip(0.35 + 0.28 * cloud, 0, 1)) * (1 + 0.025 * grain)[..., None]
    return color, 0.04 * cloud


def travertine(at: Places, base: Color = (0.83, 0.76, 0.66), dark: Color = (0.70, 0.60, 0.48)) -> Face:
    """Layered limestone with small holes."""
    bands = at.fbm(2, 60, 1.2, 7.0)
    cloud = at.fbm(2, 100, 1.3)
    pits = smooth_step(at.noise(5.0, 1.4) + 0.4 * bands, 2.1, 2.6)
    color = mix(rgb(base), rgb(dark), np.clip(0.3 + 0.25 * bands + 0.1 * cloud, 0, 1)) * (1 - 0.25 * pits)[..., None]
    return color, 0.2 * pits


def slab(on: Canvas, surface: Callable[..., Face], gloss: float) -> Maps:
    """One endless face of stone."""
    tile = on.tile
    u, v = on.coordinates()
    color, rough = surface(Places(on, u / tile, v / tile))
    return maps_of(color, np.clip(gloss + rough, 0.05, 1))


def granite(on: Canvas, colors: Colors, weights: tuple[float, ...], grain: float = 0.004, gloss: float = 0.12) -> Maps:
    """Crystals of several minerals: each pixel shows the mineral whose noise is largest there."""
    n = on.n
    size = grain / (on.tile / n)
    best, color = np.full((n, n), -np.inf, np.float32), np.zeros((n, n, 3), np.float32)
    for c, w in zip(colors, weights):
        f = 0.75 * on.noise(size, size) + 0.5 * on.noise(size * 0.4, size * 0.4) + w
        shade = rgb(c) * (1 + 0.08 * on.noise(size * 0.5, size * 0.5))[..., None]
        edge = smooth_step(f - best, -0.08, 0.08)
        color = color * (1 - edge)[..., None] + shade * edge[..., None]
        best = np.maximum(best, f)
    color *= (1 + 0.03 * on.fbm(3, 12, 1.0))[..., None]
    return maps_of(color, gloss, 0.01, 0.97)


def terrazzo(on: Canvas, base: Color, chips: Colors, size: float = 0.009, cover: float = 0.45) -> Maps:
    """Broken stone chips in cement, ground flat."""
    n, rng = on.n, on.rng
    color = np.round(on.rgb(base) * 255).astype(np.uint8)
    placed, area = 0.0, n * n
    pixel = on.tile / n
    for _ in range(20000):
        if placed > cover * area * 1.25:
            break
        r = size / pixel * float(np.clip(rng.lognormal(-0.5, 0.55), 0.15, 1.8))
        angle = np.sort(rng.random(rng.integers(4, 8))) * 2 * np.pi
        shape = np.stack([np.cos(angle), np.sin(angle) * rng.uniform(0.6, 1.0)], 1) * r
        shape = shape * rng.uniform(0.7, 1.0, (len(angle), 1))
        spin = rng.uniform(0, 6.28)
        shape = shape @ np.array([[np.cos(spin), -np.sin(spin)], [np.sin(spin), np.cos(spin)]])
        at = rng.random(2) * n
        chip = rgb(chips[rng.integers(len(chips))]) * rng.normal(1, 0.06)
        tint = tuple(float(c) for c in np.clip(chip * 255, 4, 250))
        for dx in (-n, 0, n):
            for dy in (-n, 0, n):
                p = shape + at + [dx, dy]
                if p.max() < 0 or p[:, 0].min() > n or p[:, 1].min() > n or p[:, 0].max() < 0 or p[:, 1].max() < 0:
                    continue
                cv2.fillPoly(color, [np.round(p * 16).astype(np.int32)], tint, cv2.LINE_AA, 4)
        placed += 1.6 * r * r
    fine = on.noise(0.8, 0.8)
    return maps_of((color.astype(np.float32) / 255 * (1 + 0.02 * fine)[..., None]), 0.22)


def concrete(on: Canvas, base: Color = (0.60, 0.59, 0.57), contrast: float = 0.03, gloss: float = 0.75) -> Maps:
    """Cast or trowelled cement: clouds, fine grain, a few air holes."""
    cloud = on.fbm(3.5, 200, 1.05)
    sweep = on.fbm(3, 40, 1.5, 2.5)
    grain = on.noise(0.8, 0.8)
    holes = smooth_step(on.noise(2.2, 2.2), 3.15, 3.5)
    color = rgb(base) * (1 + contrast * cloud + 0.6 * contrast * sweep + 0.018 * grain)[..., None]
    color = color * (1 - 0.45 * holes)[..., None]
    return maps_of(color, np.clip(gloss + 0.06 * sweep, 0.1, 1), 0.02, 0.97)


@dataclass(frozen=True)
class Brick:
    """Brickwork in running bond with rough edges: a recipe."""

    columns: int
    rows: int
    color: Color
    mortar: Color = (0.70, 0.67, 0.62)
    spread: float = 0.10
    """Standard deviation of lightness from brick to brick."""
    painted: bool = False
    """One coat covers bricks and mortar."""

    def __call__(self, on: Canvas) -> Maps:
        tile, rng = on.tile, on.rng
        u, v = on.coordinates()
        wave_x, wave_y = on.fbm(8, 200, 1.0), on.fbm(8, 200, 1.0)
        width, height = tile / self.columns, tile / self.rows
        uu, vv = u + 0.0011 * wave_x, v + 0.0011 * wave_y
        r = np.floor(vv / height).astype(int)
        x = uu + (r % 2) * 0.5 * width
        c = np.floor(x / width).astype(int)
        a, b = x - c * width, vv - r * height
        edge = np.minimum(np.minimum(a, width - a), np.minimum(b, height - b))
        piece = (r % self.rows) * self.columns + c % self.columns
        count = self.rows * self.columns
        face = smooth_step(edge, 0.0045, 0.0075)
        cloud, grain = on.fbm(4, 150, 1.1), on.noise(1.0, 1.0)
        tone = np.clip(rng.normal(0, self.spread, count), -0.22, 0.2)
        burnt = (rng.random(count) < 0.10) * rng.uniform(0.1, 0.3, count)
        clay = rgb(self.color) * (1 + tone[piece] - burnt[piece] + 0.05 * cloud + 0.03 * grain)[..., None]
        clay = clay * (1 + rng.normal(0, 0.025, (count, 1)) * [1.0, 0.0, -1.0])[piece]
        filler = rgb(self.mortar) * (1 + 0.04 * grain + 0.05 * cloud)[..., None]
        mixed = filler * (1 - face)[..., None] + clay * face[..., None]
        if self.painted:
            shade = 1 - 0.13 * (1 - smooth_step(blurred(face, 2.0), 0.2, 0.9))
            mixed = rgb(self.color) * (shade * (1 + 0.012 * cloud))[..., None]
        return maps_of(mixed, 0.6 if self.painted else 0.88, 0.02, 0.97)


def rubble(on: Canvas, base: Color = (0.62, 0.57, 0.50), across: int = 5, mortar: Color = (0.64, 0.61, 0.56)) -> Maps:
    """Natural stone walling: cells of jittered points, flat courses, each stone its own shade."""
    n, tile, rng = on.n, on.tile, on.rng
    rows = int(across * 1.7)
    py, px = np.meshgrid(np.arange(rows), np.arange(across), indexing="ij")
    at_x, at_y = px + 0.5 * (py % 2) + rng.uniform(-0.28, 0.28, px.shape), py + rng.uniform(-0.2, 0.2, px.shape)
    points = np.stack([at_x / across, at_y / rows], -1).reshape(-1, 2)
    u, v = on.coordinates()
    bend = on.fbm(4, 60, 1.5)
    x, y = u / tile + 0.0025 * bend, v / tile + 0.0025 * np.roll(bend, n // 3, 0)
    first, second = np.full((n, n), 9.0), np.full((n, n), 9.0)
    owner = np.zeros((n, n), int)
    for k, p in enumerate(points):
        dx = (x - p[0] + 0.5) % 1 - 0.5
        dy = ((y - p[1] + 0.5) % 1 - 0.5) * 1.35
        d = np.sqrt(dx**2 + dy**2)
        closer = d < first
        second = np.where(closer, first, np.minimum(second, d))
        owner = np.where(closer, k, owner)
        first = np.where(closer, d, first)
    face = smooth_step(((second - first) * tile / 2), 0.004, 0.012)
    tone = np.clip(rng.normal(0, 0.10, len(points)), -0.2, 0.2)
    hue = rng.normal(0, 0.03, (len(points), 1)) * [1.0, 0.3, -1.0]
    cloud, grain = on.fbm(5, 200, 1.1), on.noise(1, 1)
    stone = rgb(base) * (1 + tone[owner] + 0.07 * cloud + 0.03 * grain)[..., None] * (1 + hue[owner])
    color = rgb(mortar) * (1 + 0.05 * cloud)[..., None] * (1 - face)[..., None] + stone * face[..., None]
    return maps_of(color, 0.9, 0.02, 0.97)
