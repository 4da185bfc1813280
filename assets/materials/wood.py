"""Wood: floors by pattern and species, and wood for furniture and doors."""

import dataclasses
import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from embodied.assets.json_file import from_plain, read_toml
from embodied.assets.materials.maps import Canvas, Layout, Maps, Places, maps_of, mix, planks, rgb, smooth_step


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


SPECIES = from_plain(dict[str, Species], read_toml(Path(__file__).with_name("species.toml")))


def floor(on: Canvas, layout: Callable[..., Layout], species: str, gloss: float = 0.38, groove: float = 0.0012) -> Maps:
    """A wooden floor: `layout(n, tile)` or `layout(n, tile, rng=rng)` gives the boards."""
    inner = layout.func if isinstance(layout, functools.partial) else layout
    pieces = layout(on.n, on.tile, rng=on.rng) if inner is planks else layout(on.n, on.tile)
    return boards(on, pieces, SPECIES[species], gloss, groove)


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
    return boards(on, layout, calm, gloss, 0.0, endless=True)


def boards(on: Canvas, layout: Layout, species: Species, gloss: float, groove: float, endless: bool = False) -> Maps:
    """Every piece of `layout` sawn from its own place of its own log.

    Args:
      groove: width of the cut around each board, metres; 0 for none.
      endless: the grain runs on over the tile's border.
    """
    piece, rng = layout.piece, on.rng
    grain = _sawn(on, layout, species, endless)
    streak, hair = grain.at.noise(70, 0.7), grain.at.noise(22, 0.35)
    late = np.clip(species.contrast * grain.dark + 0.09 * streak + 0.06 * grain.fine, 0, 1.15)
    color = mix(rgb(species.early), rgb(species.late), late)
    pore = species.pores * smooth_step(hair + 0.8 * (grain.dark - 0.4), 1.0, 2.4)
    color = mix(color, rgb(species.pore), 0.75 * pore)
    if species.rays:
        fleck = grain.at.noise(3.0, 1.2)
        color += (species.rays * 0.05 * smooth_step(fleck, 1.5, 2.6) * (~grain.plain)[piece])[..., None]
    if species.knots:
        color = _knots(on, color, layout, species)
    tone = np.clip(rng.normal(0, species.tone, layout.count), -2 * species.tone, 2 * species.tone)
    warmth = np.clip(rng.normal(0, 0.1 * species.tone, layout.count), -0.01, 0.01)
    color = color * (1 + tone[piece])[..., None] * (1 + warmth[piece][..., None] * rgb((1.0, 0.0, -1.0)))
    rough = gloss + 0.05 * grain.dark + 0.10 * pore + 0.02 * streak
    if groove > 0:
        pixel = on.tile / on.n
        cut = 1 - smooth_step(layout.edge, groove * 0.35, groove * 0.35 + max(groove, pixel * 0.9))
        color = color * (1 - 0.55 * cut)[..., None]
        rough = rough + 0.25 * cut
    return maps_of(color, np.clip(rough, 0.08, 1))


@dataclass(frozen=True, eq=False)
class _Grain:
    """How the wood of every board runs; arrays (n, n) but for `plain`."""

    at: Places
    """Places at which noise is looked up, along the boards and across."""
    dark: np.ndarray
    """Summer wood, 0 to 1."""
    fine: np.ndarray
    """Fine noise along the grain."""
    plain: np.ndarray
    """(count,) bool: boards sawn beside the pith, the others towards it."""


def _sawn(on: Canvas, layout: Layout, species: Species, endless: bool) -> _Grain:
    """A board cuts the growth rings, cylinders about the pith, in a plane at some distance from it:
    near the pith that draws cathedrals, far from it straight lines."""
    n, tile, rng, count, piece = on.n, on.tile, on.rng, layout.count, layout.piece
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
    slow = Places(on, x, y * 3).fbm(1.0, 24, 1.8, 4.0)
    fine = Places(on, x, y).fbm(4.0, 200, 1.2, 14.0)
    depth = pith_depth[piece] + slope[piece] * layout.along + 0.010 * slow
    radius = np.hypot(layout.across * flip[piece] - pith_across[piece], depth)
    phase = radius / ring[piece] + 0.10 * fine
    drift = np.abs(np.gradient(phase, axis=1)) + np.abs(np.gradient(phase, axis=0))
    visible = np.clip(1.5 - 2.6 * drift, 0.0, 1)
    visible = visible * np.clip(1.35 - 0.5 * drift / max(tile / n / species.ring, 1e-6), 0.35, 1)
    f = phase - np.floor(phase)
    dark = np.where(f < 0.85, (f / 0.85) ** 2.4, 1 - (f - 0.85) / 0.15)
    each = Places(on, np.floor(phase) * 0.137 + lane[piece], lane[piece] * np.ones_like(phase)).noise(1, 1)
    dark = dark * (0.75 + 0.3 * np.tanh(each)) * visible + 0.33 * (1 - visible)
    return _Grain(Places(on, x, y), dark, fine, plain)


def _knots(on: Canvas, color: np.ndarray, layout: Layout, species: Species) -> np.ndarray:
    """Round dark knots with a bright halo, each inside its own board."""
    n, tile, rng = on.n, on.tile, on.rng
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
