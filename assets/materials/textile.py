"""Carpets, woven and felted cloth, velvet, leather, wicker."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from embodied.assets.materials.maps import Canvas, Colors, Maps, maps_of, mix, rgb, smooth_step
from embodied.assets.records import Color

LIGHT_FROM = (0.55, 0.83)
"""Direction to the light on folds, in a tile, right and up: on upright cloth from above."""


def folds(on: Canvas, width: float, strength: float) -> np.ndarray:
    """(n, n) factors with mean 1 of soft folds some `width` metres apart, lit from LIGHT_FROM, dark in hollows."""
    n = on.n
    cycles = on.tile / width
    height = np.zeros((n, n), np.float32)
    for stretch, across in ((3.0, False), (3.0, True), (1.5, False)):
        field = on.fbm(max(2.0, 0.35 * cycles), 1.6 * cycles, 1.6, stretch)
        height += 0.8 - np.abs(field.T if across else field) ** 0.8
    dx, dy = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) / 2, (np.roll(height, 1, 0) - np.roll(height, -1, 0)) / 2
    lit = -(LIGHT_FROM[0] * dx + LIGHT_FROM[1] * dy)
    shade = np.tanh(lit / (2.0 * lit.std())) + 0.25 * np.tanh((height - height.mean()) / height.std())
    return (1 + strength * (shade - shade.mean()) / shade.std()).astype(np.float32)


@dataclass(frozen=True)
class Weave:
    """Warp and weft threads crossing: a recipe."""

    warp: Color | Colors
    """The upright threads, sRGB: one colour, or several that take turns."""
    weft: Color | Colors
    """The level threads, likewise."""
    threads: int
    """Per tile in each direction; a multiple of 2 * over * the number of colours."""
    over: int = 1
    """1 is plain weave, 2 or 3 twill."""
    irregular: float = 0.05
    """Standard deviation of lightness from thread to thread."""
    slubs: float = 0.3
    """How uneven the threads' thickness is."""
    fuzz: float = 0.05
    rough: float = 0.92
    creases: float = 0.0
    """Standard deviation of lightness by soft folds, a hand's breadth apart."""

    def __call__(self, on: Canvas) -> Maps:
        tile, rng = on.tile, on.rng
        u, v = on.coordinates()
        x, y = u / tile * self.threads, v / tile * self.threads
        swing = on.fbm(3, 40, 1.2)
        x, y = x + 0.12 * swing, y + 0.12 * np.roll(swing, on.n // 2, 1)
        i, j = np.floor(x).astype(int), np.floor(y).astype(int)
        fx, fy = x - i - 0.5, y - j - 0.5
        i, j = i % self.threads, j % self.threads
        up = ((i + j) % 2 == 0) if self.over == 1 else ((i + j) % (2 * self.over) < self.over)
        round_warp, round_weft = np.cos(np.pi * fx) ** 0.7, np.cos(np.pi * fy) ** 0.7
        tone_warp, tone_weft = rng.normal(0, self.irregular, self.threads), rng.normal(0, self.irregular, self.threads)
        fibre_up, fibre_level = on.noise(0.6, 9), on.noise(9, 0.6)
        thick_up, thick_level = on.noise(1.5, 40), on.noise(40, 1.5)
        span = 1 if self.over == 1 else 0.6
        lift_warp, lift_weft = np.cos(np.pi * fy * span), np.cos(np.pi * fx * span)
        grain_warp = 1 + tone_warp[i] + self.fuzz * fibre_up + 0.10 * self.slubs * thick_up
        grain_weft = 1 + tone_weft[j] + self.fuzz * fibre_level + 0.10 * self.slubs * thick_level
        a, b = _turns(self.warp, i) * grain_warp[..., None], _turns(self.weft, j) * grain_weft[..., None]
        shade_a = 0.62 + 0.38 * round_warp * (0.7 + 0.3 * lift_warp)
        shade_b = 0.62 + 0.38 * round_weft * (0.7 + 0.3 * lift_weft)
        color = np.where(up[..., None], a * shade_a[..., None], b * shade_b[..., None])
        if self.creases:
            color = color * folds(on, 0.1, self.creases)[..., None]
        return maps_of(color, self.rough, 0.01, 0.97)


def _turns(colors: Color | Colors, thread: np.ndarray) -> np.ndarray:
    """(n, n, 3) colours of threads by number; several take turns."""
    cycle = np.atleast_2d(np.asarray(colors, np.float32))
    return cycle[thread % len(cycle)]


@dataclass(frozen=True)
class Pile:
    """Carpet, towelling, grass: tufts that each catch the light a little differently. A recipe."""

    color: Color
    second: Color | None = None
    """Of some of the tufts."""
    loop: float = 0.004
    """Size of a tuft, metres."""
    depth: float = 0.12
    """How much the tufts' lightness varies."""
    tracks: float = 0.02
    """How much the lightness varies with the way the pile is brushed."""
    rough: float = 0.97

    def __call__(self, on: Canvas) -> Maps:
        size = self.loop / (on.tile / on.n)
        tuft = on.noise(size, size)
        fine = on.noise(size * 0.35, size * 0.35)
        brushed = on.fbm(3, 20, 1.2)
        base = on.rgb(self.color)
        if self.second is not None:
            base = mix(base, rgb(self.second), smooth_step(on.noise(size * 0.8, size * 0.8), -0.3, 0.9))
        out = base * (1 + self.depth * (0.6 * tuft + 0.55 * fine) / 1.6 + self.tracks * brushed)[..., None]
        return maps_of(out, self.rough, 0.01, 0.97)


def sisal(on: Canvas, color: Color = (0.70, 0.61, 0.47), ribs: int = 64) -> Maps:
    """Boucle of plant fibre in level ribs."""
    tile = on.tile
    u, v = on.coordinates()
    swing = on.fbm(4, 60, 1.2)
    row = v / tile * ribs + 0.10 * swing
    j = np.floor(row).astype(int)
    x = u / tile * ribs + 0.5 * (j % 2) + 0.15 * np.roll(swing, on.n // 3, 0)
    lump = np.cos(np.pi * (row - j - 0.5)) ** 0.6 * (0.6 + 0.4 * np.cos(2 * np.pi * x))
    tone = on.rng.normal(0, 0.02, ribs)[j % ribs] + 0.06 * on.noise(3, 1)
    return maps_of((rgb(color) * (0.6 + 0.45 * lump + tone)[..., None]), 0.95, 0.02, 0.97)


def felt(on: Canvas, color: Color, mottle: float = 0.012, rough: float = 0.95, creases: float = 0.0) -> Maps:
    """Velvet, felt, fleece: no threads to see, soft shading in the nap and, as in Weave, in creases."""
    nap = on.noise(1.6, 2.4)
    cloud = on.fbm(5, 60, 1.2)
    out = rgb(color) * (1 + 0.05 * nap + mottle * cloud)[..., None]
    if creases:
        out = out * folds(on, 0.1, creases)[..., None]
    return maps_of(out, rough, 0.01, 0.97)


def leather(on: Canvas, color: Color, gloss: float = 0.45) -> Maps:
    """Grained leather: a net of fine creases around pebbles."""
    a, b = on.noise(4.5, 4.5), on.noise(4.5, 4.5)
    crease = np.exp(-((np.abs(a) / 0.16) ** 1.2)) + np.exp(-((np.abs(b) / 0.16) ** 1.2))
    cloud = on.fbm(6, 60, 1.1)
    out = rgb(color) * (1 - 0.11 * np.clip(crease, 0, 1) + 0.018 * cloud)[..., None]
    return maps_of(out, np.clip(gloss + 0.12 * crease + 0.03 * cloud, 0.1, 1), 0.01, 0.97)


def printed(on: Canvas, cloth: Callable[..., Maps], motif: Callable[[int], np.ndarray], color: Color) -> Maps:
    """`cloth` with `motif(n)` (n, n) in [0, 1] printed in `color`, the threads still showing."""
    n = on.n
    base = cloth(on)
    shade = base.color.mean(-1, keepdims=True) / max(float(base.color.mean()), 1e-6)
    t = motif(n)[..., None]
    return maps_of(base.color * (1 - t) + rgb(color) * shade * t, base.roughness, 0.01, 0.97)


def stripes_motif(n: int, count: int, share: float = 0.5, upright: bool = True) -> np.ndarray:
    x = (np.arange(n) + 0.5) / n * count % 1
    band = smooth_step(share / 2 - np.abs(x - 0.5), -0.02, 0.02)
    return np.broadcast_to(band[None] if upright else band[:, None], (n, n)).copy()


def check_motif(n: int, count: int) -> np.ndarray:
    """Gingham: half tone where stripes run, full where they cross."""
    s = stripes_motif(n, count)
    return 0.5 * (s + s.T)
