"""Wood: floors by pattern and species, and wood for furniture and doors."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from embodied.assets.materials.maps import (
    Canvas,
    Layout,
    Maps,
    fbm,
    look_up,
    maps_of,
    mix,
    noise,
    planks,
    rgb,
    smooth_step,
)


@dataclass(frozen=True)
class Species:
    early: tuple[float, float, float]
    """sRGB of spring wood."""
    late: tuple[float, float, float]
    """sRGB of summer wood: the dark lines."""
    pore: tuple[float, float, float]
    contrast: float = 0.8
    """Of the rings, 0 to 1."""
    pores: float = 0.5
    """How many open pores show, 0 to 1."""
    ring: float = 0.006
    """Distance of growth rings, metres."""
    tone: float = 0.07
    """Standard deviation of lightness from board to board."""
    rays: float = 0.0
    """Silvery flecks across the grain."""
    knots: float = 0.0
    """Knots per square metre."""


SPECIES = {
    "oak": Species((0.755, 0.615, 0.455), (0.615, 0.465, 0.31), (0.44, 0.30, 0.18), 0.75, 0.8, 0.006, 0.055, 0.4, 0.25),
    "light oak": Species((0.82, 0.72, 0.57), (0.72, 0.60, 0.45), (0.56, 0.44, 0.31), 0.7, 0.7, 0.006, 0.045, 0.3, 0.2),
    "grey oak": Species((0.64, 0.59, 0.53), (0.53, 0.48, 0.42), (0.39, 0.34, 0.29), 0.75, 0.8, 0.006, 0.055, 0.3, 0.3),
    "smoked oak": Species((0.42, 0.31, 0.22), (0.31, 0.22, 0.15), (0.20, 0.14, 0.09), 0.75, 0.8, 0.006, 0.06, 0.2, 0.2),
    "walnut": Species((0.45, 0.31, 0.21), (0.30, 0.19, 0.12), (0.20, 0.12, 0.08), 0.8, 0.4, 0.008, 0.09),
    "maple": Species((0.85, 0.74, 0.59), (0.78, 0.64, 0.48), (0.68, 0.53, 0.37), 0.5, 0.1, 0.007, 0.035),
    "ash": Species((0.84, 0.75, 0.61), (0.69, 0.57, 0.43), (0.56, 0.44, 0.31), 0.9, 0.6, 0.008, 0.04),
    "pine": Species((0.86, 0.71, 0.49), (0.74, 0.53, 0.31), (0.66, 0.45, 0.25), 0.85, 0.0, 0.008, 0.04, 0.0, 1.6),
    "wenge": Species((0.27, 0.20, 0.155), (0.17, 0.12, 0.09), (0.11, 0.075, 0.055), 0.9, 0.7, 0.004, 0.06),
    "beech": Species((0.80, 0.63, 0.47), (0.73, 0.54, 0.39), (0.60, 0.42, 0.28), 0.5, 0.2, 0.006, 0.035, 0.5),
    "cherry": Species((0.66, 0.42, 0.28), (0.56, 0.33, 0.20), (0.44, 0.24, 0.14), 0.6, 0.2, 0.007, 0.05),
    "teak": Species((0.61, 0.43, 0.27), (0.48, 0.32, 0.18), (0.34, 0.21, 0.11), 0.7, 0.5, 0.007, 0.06),
    "mahogany": Species((0.44, 0.23, 0.15), (0.34, 0.16, 0.10), (0.22, 0.10, 0.06), 0.6, 0.6, 0.006, 0.05),
}


def floor(on: Canvas, layout: Callable[..., Layout], species: str, gloss: float = 0.38, groove: float = 0.0012) -> Maps:
    """A wooden floor: `layout(n, tile)` or `layout(n, tile, rng=rng)` gives the boards."""
    n, tile, rng = on.n, on.tile, on.rng
    inner = layout.func if isinstance(layout, functools.partial) else layout
    pieces = layout(n, tile, rng=rng) if inner is planks else layout(n, tile)
    return boards(n, tile, pieces, SPECIES[species], gloss, groove, rng=rng)


def furniture(on: Canvas, species: str, strips: int = 5, gloss: float = 0.42) -> Maps:
    """Glued panels without grooves, the grain along u running on over the tile's border."""
    n, tile = on.n, on.tile
    u, v = on.coordinates()
    width = tile / strips
    # Half a strip up: the tile's border lies within a strip, not on a joint.
    k = np.floor(v / width + 0.5).astype(int)
    across = v - k * width
    edge = np.full((n, n), 1.0, np.float32)
    layout = Layout(k % strips, u.astype(np.float32), across.astype(np.float32), edge, strips)
    kind = SPECIES[species]
    calm = dataclasses.replace(kind, tone=kind.tone * 0.25, knots=0.0)
    return boards(n, tile, layout, calm, gloss, 0.0, endless=True, rng=on.rng)


def boards(
    n: int,
    tile: float,
    layout: Layout,
    species: Species,
    gloss: float,
    groove: float,
    endless: bool = False,
    *,
    rng: np.random.Generator,
) -> Maps:
    """Every piece of `layout` sawn from its own place of its own log.

    Args:
      groove: width of the cut around each board, metres; 0 for none.
      endless: the grain runs on over the tile's border.
    """
    piece = layout.piece
    grain = _sawn(n, tile, layout, species, endless, rng=rng)
    streak = look_up(noise(n, 70, 0.7, rng=rng), grain.x, grain.y)
    hair = look_up(noise(n, 22, 0.35, rng=rng), grain.x, grain.y)
    late = np.clip(species.contrast * grain.dark + 0.09 * streak + 0.06 * grain.fine, 0, 1.15)
    color = mix(rgb(species.early), rgb(species.late), late)
    pore = species.pores * smooth_step(hair + 0.8 * (grain.dark - 0.4), 1.0, 2.4)
    color = mix(color, rgb(species.pore), 0.75 * pore)
    if species.rays:
        fleck = look_up(noise(n, 3.0, 1.2, rng=rng), grain.x, grain.y)
        color += (species.rays * 0.05 * smooth_step(fleck, 1.5, 2.6) * (~grain.plain)[piece])[..., None]
    if species.knots:
        color = _knots(color, layout, species, tile, rng=rng)
    tone = np.clip(rng.normal(0, species.tone, layout.count), -2 * species.tone, 2 * species.tone)
    warmth = np.clip(rng.normal(0, 0.1 * species.tone, layout.count), -0.01, 0.01)
    color = color * (1 + tone[piece])[..., None] * (1 + warmth[piece][..., None] * rgb((1.0, 0.0, -1.0)))
    rough = gloss + 0.05 * grain.dark + 0.10 * pore + 0.02 * streak
    if groove > 0:
        pixel = tile / n
        cut = 1 - smooth_step(layout.edge, groove * 0.35, groove * 0.35 + max(groove, pixel * 0.9))
        color = color * (1 - 0.55 * cut)[..., None]
        rough = rough + 0.25 * cut
    return maps_of(color, np.clip(rough, 0.08, 1))


@dataclass(frozen=True, eq=False)
class _Grain:
    """How the wood of every board runs; arrays (n, n) but for `plain`."""

    x: np.ndarray
    """Places along the boards at which noise is looked up, tiles."""
    y: np.ndarray
    dark: np.ndarray
    """Summer wood, 0 to 1."""
    fine: np.ndarray
    """Fine noise along the grain."""
    plain: np.ndarray
    """(count,) bool: boards sawn beside the pith, the others towards it."""


def _sawn(n: int, tile: float, layout: Layout, species: Species, endless: bool, *, rng: np.random.Generator) -> _Grain:
    """A board cuts the growth rings, cylinders about the pith, in a plane at some distance from it:
    near the pith that draws cathedrals, far from it straight lines."""
    count, pixel, piece = layout.count, tile / n, layout.piece
    plain = rng.random(count) < 0.6
    beside, away = rng.normal(0, 0.035, count), rng.choice([-1, 1], count) * rng.uniform(0.10, 0.35, count)
    pith_across = np.where(plain, beside, away)
    pith_depth = np.where(plain, rng.uniform(0.015, 0.07, count), rng.uniform(0.0, 0.05, count))
    slope = np.zeros(count) if endless else rng.normal(0, 0.02, count)
    flip = rng.choice([-1.0, 1.0], count)
    start, lane = rng.random(count), rng.random(count)
    ring = species.ring * rng.uniform(0.75, 1.35, count)
    # Over the border an endless board goes on at the next pixel.
    x = layout.along / tile + (np.round(start[piece] * n) / n if endless else start[piece])
    y = layout.across / tile + lane[piece]
    slow = look_up(fbm(n, 1.0, 24, 1.8, 4.0, rng=rng), x, y * 3)
    fine = look_up(fbm(n, 4.0, 200, 1.2, 14.0, rng=rng), x, y)
    depth = pith_depth[piece] + slope[piece] * layout.along + 0.010 * slow
    radius = np.hypot(layout.across * flip[piece] - pith_across[piece], depth)
    phase = radius / ring[piece] + 0.10 * fine
    drift = np.abs(np.gradient(phase, axis=1)) + np.abs(np.gradient(phase, axis=0))
    visible = np.clip(1.5 - 2.6 * drift, 0.0, 1)
    visible = visible * np.clip(1.35 - 0.5 * drift / max(pixel / species.ring, 1e-6), 0.35, 1)
    f = phase - np.floor(phase)
    dark = np.where(f < 0.85, (f / 0.85) ** 2.4, 1 - (f - 0.85) / 0.15)
    each = look_up(noise(n, 1, 1, rng=rng), np.floor(phase) * 0.137 + lane[piece], lane[piece] * np.ones_like(phase))
    dark = dark * (0.75 + 0.3 * np.tanh(each)) * visible + 0.33 * (1 - visible)
    return _Grain(x, y, dark, fine, plain)


def _knots(color: np.ndarray, layout: Layout, species: Species, tile: float, *, rng: np.random.Generator) -> np.ndarray:
    """Round dark knots with a bright halo, each inside its own board."""
    n = len(color)
    mask = np.zeros((n, n), np.float32)
    for k in range(layout.count):
        for _ in range(rng.poisson(species.knots * tile * tile / layout.count)):
            inside = np.flatnonzero(layout.piece.reshape(-1) == k)
            if len(inside) == 0:
                continue
            at = inside[rng.integers(len(inside))]
            a0, c0 = layout.along.reshape(-1)[at], layout.across.reshape(-1)[at]
            size = rng.uniform(0.006, 0.014)
            on_board = layout.piece == k
            d = np.hypot((layout.along - a0) / 1.5, layout.across - c0) / size
            mask = np.maximum(mask, np.where(on_board, np.exp(-(d**2) * 1.2), 0))
    swirl = 1 - 0.25 * np.sin(mask * 22) * (mask > 0.05)
    return mix(color, rgb(species.pore) * 0.75, np.clip(mask * 0.95 * swirl, 0, 1))
