"""The footprint: one to four wings along a corridor spine, on a grid of 0.1 m.

A house is drawn in a canonical pose, the first wing running along +x from the public end and the others hanging down
from it; `generate.layout` mirrors and turns the finished plan. Lengths here are integers in decimetres.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from embodied.generate.config import HouseConfig

if TYPE_CHECKING:
    from embodied.generate.modules import Cell

Rect = tuple[int, int, int, int]
"""x0, y0, x1, y1 in decimetres."""


def shared_area(a: Rect, b: Rect) -> int:
    """Square decimetres that two rectangles share."""
    return max(0, min(a[2], b[2]) - max(a[0], b[0])) * max(0, min(a[3], b[3]) - max(a[1], b[1]))


@dataclass(frozen=True)
class Stretch:
    """A stretch along the spine."""

    axis: str
    """'x' or 'y': the world axis it runs along."""
    start: int
    """World coordinate on `axis` where it starts."""
    way: int
    """+1 or -1: in which sense it runs on `axis`."""
    length: int

    def between(self, s0: int, s1: int, low: int, high: int) -> Rect:
        """From s0 to s1 along it, and between two world coordinates across."""
        a, b = sorted((self.start + self.way * s0, self.start + self.way * s1))
        return (a, low, b, high) if self.axis == "x" else (low, a, high, b)


@dataclass(frozen=True)
class Strip(Stretch):
    """A row of rooms on one side of a corridor; u runs along it from the public end, v away from the corridor."""

    base: int
    """World coordinate, across, of the corridor's edge, v = 0."""
    out: int
    """+1 or -1: the sense of v."""
    depth: int
    rank: float
    """Spine distance of its start from the public end."""
    band: int
    """Index of the corridor band it lies along."""
    u_band: int
    """Spine coordinate, on that band, of u = 0."""

    def rect(self, u0: int, u1: int, v0: int, v1: int) -> Rect:
        return self.between(u0, u1, *sorted((self.base + self.out * v0, self.base + self.out * v1)))


@dataclass(frozen=True)
class Band(Stretch):
    """The corridor of one wing: a strip of its own along the spine."""

    low: int
    high: int
    """World coordinates across."""
    free: tuple[bool, bool]
    """True if its start and its end lie on an outer wall, so that a room may take them over."""

    def rect(self, s0: int, s1: int) -> Rect:
        return self.between(s0, s1, self.low, self.high)


@dataclass(frozen=True)
class Cap:
    """The full depth of a wing's free end, for one or two rooms that the corridor runs into."""

    at_start: bool
    axis: str
    """The axis across the wing, along which rooms are stacked."""
    rect: Rect
    passage: tuple[int, int]
    """World interval on `axis` where the corridor arrives."""


@dataclass(frozen=True)
class Footprint:
    strips: tuple[Strip, ...]
    bands: tuple[Band, ...]
    caps: tuple[Cap, ...]
    corridor: int
    """Corridor width between wall centre lines; 0 for flats whose hall reaches every room."""
    wet: tuple[Rect, ...] = ()
    """Rooms with water on the storey below."""
    stair: Cell | None = None
    """The stairwell, of a storey that one enters by stairs; the strips leave it out."""


@dataclass(frozen=True)
class Wing:
    """The cross-section of a wing: two rows of rooms with a corridor between them, decimetres."""

    first: int
    """Depth of the row above its corridor, or left of it."""
    second: int
    """Depth of the row below its corridor, or right of it."""
    corridor: int

    @property
    def depth(self) -> int:
        """Of both rows and the corridor."""
        return self.first + self.corridor + self.second


def draw_shape(area: float, config: HouseConfig, *, rng: np.random.Generator) -> str:
    """One of config.SHAPES, larger houses being less often plain rectangles."""
    if config.shape is not None:
        return config.shape
    if area < 75:
        return "rectangle"
    if rng.random() < np.interp(area, (230, 330, 450), (0, 0.6, 0.85)):
        return "cross"
    x = float(np.interp(area, (75, 140, 230), (0, 0.35, 1)))
    p = np.array([0.62 * (1 - x), 0.28 + 0.12 * x, 0.1 + 0.2 * x, 0.3 * x if area > 140 else 0.0])
    return str(rng.choice(["rectangle", "L", "T", "U"], p=p / p.sum()))


def draw_footprint(area: float, shape: str, *, flat: bool = True, rng: np.random.Generator) -> Footprint:
    """A footprint of `area` square metres with the corridors of its wings; small flats have none where `flat`."""
    if shape == "rectangle":
        return _flat(area, rng) if area < 62 and flat else _bar(area, rng)
    if shape == "cross":
        return _crossed(area, rng)
    if area < (260 if shape == "U" else 150):
        return _bumped(area, shape, rng)
    return _winged(area, shape, rng)


def _draw_wing(corridor: int, low: int, high: int, rng: np.random.Generator) -> Wing:
    """A wing whose rows are low..high deep; often one serves and is shallower."""
    a = int(rng.integers(low, high + 1))
    b = int(rng.integers(max(24, low - 12), low + 1)) if rng.random() < 0.6 else int(rng.integers(low, high + 1))
    return Wing(a, b, corridor) if rng.random() < 0.5 else Wing(b, a, corridor)


def _cap_length(share: float, area: float, least_most: tuple[float, float], across: int, room: int) -> int:
    """Length, decimetres, of the rooms across a wing's end; 0 where `room` is too short for them.

    Args:
      share: of the house's `area`, square metres, that they take.
      least_most: smallest and largest area of these rooms, square metres.
      across: the wing's depth, decimetres.
    """
    size = round(float(np.clip(share * area, *least_most)) * 100 / across)
    return size if 30 <= size <= room - 25 else 0


def _flat(area: float, rng: np.random.Generator) -> Footprint:
    """Two rows back to back, no corridor."""
    top, bottom = int(rng.integers(35, 44)), int(rng.integers(20, 29))
    length = round(area * 100 / (top + bottom))
    strips = (
        Strip("x", 0, 1, length, bottom, 1, top, rank=0.0, band=0, u_band=0),
        Strip("x", 0, 1, length, bottom, -1, bottom, rank=0.0, band=0, u_band=0),
    )
    return Footprint(strips, bands=(), caps=(), corridor=0)


def _bar(area: float, rng: np.random.Generator) -> Footprint:
    """One wing with a corridor between two rows."""
    corridor = int(rng.integers(12, 15)) + (area > 180)
    scale = float(np.interp(area, (60, 110, 200, 400, 600), (0, 0.4, 1.0, 2.4, 3.2)))
    wing = _draw_wing(corridor, int(30 + 9 * scale), int(36 + 12 * scale), rng)
    return _one_wing(round(area * 100 / wing.depth), wing, (), area, rng)


def _one_wing(
    length: int, wing: Wing, bumps: tuple[tuple[int, int, int], ...], area: float, rng: np.random.Generator
) -> Footprint:
    """A wing along x; `bumps` are (x0, x1, extra depth) of the bottom row, sorted."""
    left = right = 0
    top, bottom, corridor, depth = wing.first, wing.second, wing.corridor, wing.depth
    if rng.random() < 0.65 and not any(b[0] == 0 for b in bumps):
        left = round(float(np.clip(rng.uniform(0.22, 0.34) * area, 20, 60)) * 100 / depth)
    if area > 100 and rng.random() < 0.35 and not any(b[1] == length for b in bumps):
        right = round(float(np.clip(rng.uniform(0.13, 0.2) * area, 17, 34)) * 100 / depth)
    if length - left - right < 35:
        right = 0
    left, right = (0 if w and w < 30 else w for w in (left, right))
    strips = [Strip("x", left, 1, length - left - right, bottom + corridor, 1, top, rank=left, band=0, u_band=0)]
    edges = [left]
    for x0, x1, _ in bumps:
        edges += [x0, x1]
    edges = sorted({*(min(max(e, left), length - right) for e in edges), length - right})
    for x0, x1 in itertools.pairwise(edges):
        extra = next((e for b0, b1, e in bumps if b0 <= x0 and x1 <= b1), 0)
        strips.append(Strip("x", x0, 1, x1 - x0, bottom, -1, bottom + extra, rank=x0, band=0, u_band=x0 - left))
    band = Band("x", left, 1, length - left - right, bottom, bottom + corridor, (left == 0, right == 0))
    passage = (bottom, bottom + corridor)
    caps = _caps(
        (left, Cap(True, "y", (0, 0, left, depth), passage)),
        (right, Cap(False, "y", (length - right, 0, length, depth), passage)),
    )
    return Footprint(tuple(strips), (band,), caps, corridor)


def _caps(*ends: tuple[int, Cap]) -> tuple[Cap, ...]:
    """Of (length, cap) the caps that are there."""
    return tuple(cap for length, cap in ends if length)


def _bumped(area: float, shape: str, rng: np.random.Generator) -> Footprint:
    """One wing whose front row steps out: at one end (L), in the middle (T) or at both ends (U)."""
    corridor = int(rng.integers(12, 15))
    scale = float(np.interp(area, (60, 110, 200), (0, 0.35, 0.8)))
    wing = _draw_wing(corridor, int(30 + 9 * scale), int(35 + 11 * scale), rng)
    extra = int(rng.integers(15, 27))
    wide = int(rng.integers(38, 56))
    count = 2 if shape == "U" else 1
    length = round((area * 100 - count * extra * wide) / wing.depth)
    bumps: tuple[tuple[int, int, int], ...]
    if shape == "L":
        bumps = ((0, wide, extra),) if rng.random() < 0.6 else ((length - wide, length, extra),)
    elif shape == "T":
        x0 = int(rng.integers(24, max(25, length - wide - 24)))
        bumps = ((x0, x0 + wide, extra),)
    else:
        bumps = ((0, wide, extra), (length - wide, length, extra))
    return _one_wing(length, wing, bumps, area, rng)


def _winged(area: float, shape: str, rng: np.random.Generator) -> Footprint:
    """Wings with corridors of their own: L (one at the end), T (one in the middle), U (one at each end)."""
    corridor = int(rng.integers(13, 16))
    scale = float(np.interp(area, (130, 200, 400, 600), (0.4, 0.7, 1.2, 1.6)))
    low, high = int(30 + 9 * scale), int(36 + 11 * scale)
    bar, wing = _draw_wing(corridor, low, high, rng), _draw_wing(corridor, low, high, rng)
    if shape == "U":
        public = _draw_wing(corridor, low, high, rng)
        long = wing.depth + public.depth + int(rng.integers(55, 100))
        rest = area * 100 - long * bar.depth
        if rest < 45 * (wing.depth + public.depth):
            long = wing.depth + public.depth + 50
            rest = max(area * 100 - long * bar.depth, 35 * (wing.depth + public.depth))
        share = rng.uniform(0.4, 0.6)
        drop, fall = round(rest * share / public.depth), round(rest * (1 - share) / wing.depth)
        return _u(long, bar, (public, drop), (wing, fall))
    share = float(rng.uniform(0.6, 0.72))
    long = max(round(area * 100 * share / bar.depth), wing.depth + 35)
    drop = max(30, round((area * 100 - long * bar.depth) / wing.depth))
    return _l_or_t(shape, long, drop, bar, wing, area, rng)


def _l_or_t(
    shape: str, long: int, drop: int, bar: Wing, wing: Wing, area: float, rng: np.random.Generator
) -> Footprint:
    """A `bar` of length `long` and a `wing` that hangs `drop` below it, at its end (L) or inside (T)."""
    top, bottom, corridor, left, right = bar.first, bar.second, bar.corridor, wing.first, wing.second
    x0 = long - wing.depth if shape == "L" else int(rng.integers(30, max(31, long - wing.depth - 30)))
    xb = x0 + left
    cap = _cap_length(rng.uniform(0.18, 0.26), area, (24, 60), bar.depth, xb) if rng.random() < 0.6 else 0
    foot = _cap_length(rng.uniform(0.08, 0.14), area, (18, 34), wing.depth, drop) if rng.random() < 0.4 else 0
    end = xb + corridor if shape == "L" else long
    band_a = Band("x", cap, 1, end - cap, bottom, bottom + corridor, (cap == 0, shape == "T"))
    band_b = Band("y", bottom, -1, drop + bottom - foot, xb, xb + corridor, (False, foot == 0))
    a_top = Strip("x", cap, 1, long - cap, bottom + corridor, 1, top, rank=cap, band=0, u_band=0)
    a_left = Strip("x", cap, 1, xb - cap, bottom, -1, bottom, rank=cap, band=0, u_band=0)
    b_left = Strip("y", 0, -1, drop - foot, xb, -1, left, rank=xb + bottom, band=1, u_band=bottom)
    strips: tuple[Strip, ...]
    if shape == "L":
        length = drop + bottom + corridor - foot
        b_right = Strip("y", bottom + corridor, -1, length, xb + corridor, 1, right, rank=xb, band=1, u_band=-corridor)
        strips = (a_top, a_left, b_left, b_right)
    else:
        a_right = Strip(
            "x", xb + corridor, 1, long - xb - corridor, bottom, -1, bottom, rank=xb, band=0, u_band=xb + corridor - cap
        )
        b_right = Strip("y", 0, -1, drop - foot, xb + corridor, 1, right, rank=xb + bottom, band=1, u_band=bottom)
        strips = (a_top, a_left, a_right, b_left, b_right)
    caps = _caps(
        (cap, Cap(True, "y", (0, 0, cap, bar.depth), (bottom, bottom + corridor))),
        (foot, Cap(False, "x", (x0, -drop, x0 + wing.depth, foot - drop), (xb, xb + corridor))),
    )
    return Footprint(strips, (band_a, band_b), caps, corridor)


def _u(long: int, bar: Wing, public: tuple[Wing, int], private: tuple[Wing, int]) -> Footprint:
    """A `bar` of length `long` with a wing below each of its ends, each with its length below the bar."""
    top, bottom, corridor = bar.first, bar.second, bar.corridor
    (out, inner), drop = (public[0].first, public[0].second), public[1]
    (left, right), fall = (private[0].first, private[0].second), private[1]
    xa = out
    xb = long - right - corridor
    band_p = Band("y", -drop, 1, drop + bottom, xa, xa + corridor, (True, False))
    band_a = Band("x", xa, 1, xb + corridor - xa, bottom, bottom + corridor, (False, False))
    band_q = Band("y", bottom, -1, fall + bottom, xb, xb + corridor, (False, True))
    far, roof = drop + bottom, bottom + corridor
    strips = (
        Strip("y", -drop, 1, drop + bottom + corridor, xa, -1, out, rank=0.0, band=0, u_band=0),
        Strip("y", -drop, 1, drop, xa + corridor, 1, inner, rank=0.0, band=0, u_band=0),
        Strip("x", 0, 1, long, bottom + corridor, 1, top, rank=far - xa, band=1, u_band=-xa),
        Strip("x", xa + corridor, 1, xb - xa - corridor, bottom, -1, bottom, rank=far, band=1, u_band=corridor),
        Strip("y", 0, -1, fall, xb, -1, left, rank=far + xb - xa + bottom, band=2, u_band=bottom),
        Strip("y", roof, -1, fall + roof, xb + corridor, 1, right, rank=far + xb - xa, band=2, u_band=-corridor),
    )
    return Footprint(strips, (band_p, band_a, band_q), (), corridor)


def _crossed(area: float, rng: np.random.Generator) -> Footprint:
    """Four short wings about a crossing: the day wings on the left and above, the private ones on the right and below.

    The wing above stands off the one below, so that no corridor is seen from end to end.
    """
    corridor = int(rng.integers(13, 17))
    scale = float(np.interp(area, (200, 300, 450, 700), (0.3, 0.8, 1.4, 2.0)))
    low, high = int(30 + 9 * scale), int(36 + 11 * scale)
    bar, south, north = (_draw_wing(corridor, low, high, rng) for _ in range(3))
    deep, wing, rise = bar.depth, south.depth, north.depth
    arm = area * 100 / ((deep + wing) / 2)  # total length of bar and wings
    long = round(arm * rng.uniform(0.5, 0.6))
    long = max(long, max(wing, rise) + 60)
    rest = max(arm - long, 60.0) * (deep + wing) / (wing + rise)
    share = float(rng.uniform(0.42, 0.58))
    below, above = max(32, round(rest * share)), max(32, round(rest * (1 - share)))
    slack = long - max(wing, rise)
    x_below = round(slack * rng.uniform(0.42, 0.66))
    x_above = round(slack * rng.uniform(0.34, 0.58))
    x_below, x_above = (min(max(x, 28), slack - 28) for x in (x_below, x_above))
    xb, xc = x_below + south.first, x_above + north.first
    inner, usual = long - max(xb, xc) - corridor, (20, 58)
    day = _cap_length(rng.uniform(0.1, 0.15), area, usual, deep, min(xb, xc)) if rng.random() < 0.8 else 0
    night = _cap_length(rng.uniform(0.06, 0.1), area, usual, deep, inner) if rng.random() < 0.5 else 0
    foot = _cap_length(rng.uniform(0.06, 0.1), area, usual, wing, below) if rng.random() < 0.5 else 0
    head = _cap_length(rng.uniform(0.08, 0.12), area, usual, rise, above) if rng.random() < 0.8 else 0
    top, bottom = bar.first, bar.second
    roof, stop, beyond_b, beyond_c = bottom + corridor, long - night, xb + corridor, xc + corridor
    strips = (
        Strip("x", day, 1, xc - day, roof, 1, top, rank=day, band=0, u_band=0),
        Strip("x", beyond_c, 1, stop - beyond_c, roof, 1, top, rank=xc, band=0, u_band=beyond_c - day),
        Strip("x", day, 1, xb - day, bottom, -1, bottom, rank=day, band=0, u_band=0),
        Strip("x", beyond_b, 1, stop - beyond_b, bottom, -1, bottom, rank=xb, band=0, u_band=beyond_b - day),
        Strip("y", 0, -1, below - foot, xb, -1, south.first, rank=xb + bottom, band=1, u_band=bottom),
        Strip("y", 0, -1, below - foot, beyond_b, 1, south.second, rank=xb + bottom, band=1, u_band=bottom),
        Strip("y", deep, 1, above - head, xc, -1, north.first, rank=0.4 * xc, band=2, u_band=top),
        Strip("y", deep, 1, above - head, beyond_c, 1, north.second, rank=0.4 * xc, band=2, u_band=top),
    )
    bands = (
        Band("x", day, 1, stop - day, bottom, roof, (day == 0, night == 0)),
        Band("y", bottom, -1, bottom + below - foot, xb, beyond_b, (False, foot == 0)),
        Band("y", roof, 1, top + above - head, xc, beyond_c, (False, head == 0)),
    )
    up, down = deep + above - head, foot - below
    caps = _caps(
        (day, Cap(True, "y", (0, 0, day, deep), (bottom, roof))),
        (head, Cap(True, "x", (x_above, up, x_above + rise, deep + above), (xc, beyond_c))),
        (night, Cap(False, "y", (stop, 0, long, deep), (bottom, roof))),
        (foot, Cap(False, "x", (x_below, -below, x_below + wing, down), (xb, beyond_b))),
    )
    return Footprint(strips, bands, caps, corridor)
