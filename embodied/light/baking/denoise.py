"""Smoothing light over surfaces without carrying it around corners or across edges of shadow.

Every chart is smoothed on its page by an a-trous filter with growing steps (Dammertz et al. 2010), along its surface,
weighed by likeness of brightness.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from embodied.light.backend import Array, array, brightness, dr, floats, mi, opaque_float, signed, vector
from embodied.light.pages.atlas import Atlas
from embodied.light.pages.cover import Texels

KERNEL = (0.0625, 0.25, 0.375, 0.25, 0.0625)
"""B3 spline, as in Dammertz et al."""


def smooth_pages(
    e: np.ndarray, grid: Grid, good: np.ndarray, *, variance: np.ndarray, likeness: Sequence[float]
) -> np.ndarray:
    """A-trous smoothing along surfaces.

    Args:
      e: (n, 3) float32.
      good: (n,) bool, luxels whose value counts.
      variance: (n,) of each luxel's brightness; likeness is widened by the noise that is left, as in SVGF (Schied et
        al. 2017, sec. 4.4): noise goes, contact shadows stay.
      likeness: for steps of 1, 2, 4, ... luxels, the standard deviation of log brightness that still counts as the
        same light.
    """
    if not len(e):
        return e
    trust = np.where(good, 1.0, 1e-4).astype(np.float32)[:, None]
    out = np.array(e, np.float32)
    noise, floor = _relative_noise(grid, out, variance)
    for k, like in enumerate(likeness):
        values = floats(np.concatenate([out, trust], axis=1))  # one gather of four is faster than two
        own, own_noise = mi.Color3f(vector(out)), floats(noise)
        least = floats(floor) + 1e-4
        shade = dr.log(_brightness(own) + least)
        total, weight, squares = mi.Color3f(0.0), mi.Float(0.0), mi.Float(0.0)
        tight = 1 / (opaque_float(like**2) + dr.square(NOISES * own_noise))
        for i, j, q, inside in grid.around(2**k):
            *colour, trusted = dr.gather(mi.Vector4f, values, q, inside)
            other = mi.Color3f(*colour)
            far = dr.log(_brightness(other) + least) - shade
            w = dr.select(inside, dr.exp(-0.5 * dr.square(far) * tight), 0.0)
            w *= KERNEL[i + 2] * KERNEL[j + 2] * trusted
            total += other * w
            weight += w
            squares += dr.square(w)
        safe = dr.maximum(weight, 1e-12)
        mean, left = dr.select(weight > 1e-12, total / safe, own), own_noise * dr.sqrt(squares) / safe
        dr.eval(mean, left)
        out, noise = array(mean), np.array(left)
    return out


NOISES = 1.8
"""How many standard deviations of noise still count as the same light."""


def spatial_variance(e: np.ndarray, grid: Grid) -> np.ndarray:
    """(n,) variance of brightness among the 25 luxels around: noise where nothing else is known of it."""
    values = floats(brightness(e))
    mean, square = _means(grid, (values, lambda v: v), (values, dr.square))
    return np.array(dr.maximum(square - dr.square(mean), 0.0))


def _means(grid: Grid, *of: tuple[Array, Callable[[Array], Array]]) -> list[Array]:
    """For each table of luxels, and what becomes of its values, the mean over the 25 around every luxel."""
    sums, count = [mi.Float(0.0) for _ in of], mi.Float(0.0)
    for _, _, q, inside in grid.around(1):
        sums = [total + made(dr.gather(mi.Float, table, q, inside)) for total, (table, made) in zip(sums, of)]
        count += dr.select(inside, 1.0, 0.0)
    return [total / dr.maximum(count, 1.0) for total in sums]


def _relative_noise(grid: Grid, e: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) standard deviation over mean, both over the 25 luxels around: few rays alone know not how noisy they are.

    And (n,) what to add before logarithms are taken, more where there is more noise: a luxel whose rays
    all missed is no shadow.
    """
    own = lambda v: v
    mean, spread = _means(grid, (floats(brightness(e)), own), (floats(variance), own))
    relative = np.minimum(np.asarray(dr.sqrt(spread) / dr.maximum(mean, 1e-5)), 1.5)
    return relative, np.asarray(mean) * np.minimum(relative, 1.0)


BENT, TURNED = 0.1, 0.9
"""Luxels are of one surface if they lie out of each other's plane by at most this share of their distance (or 4 mm),
and the cosine between their normals is no less: what is curved is smoothed, too."""


class Grid:
    """The luxels of a house on the device, and what lies around them on their page in the same plane."""

    def __init__(self, atlas: Atlas, luxels: Sequence[Texels]) -> None:
        sizes = np.array([p.width * p.height for p in atlas.pages])
        base = np.cumsum(sizes) - sizes
        number = np.full(int(sizes.sum()), -1, np.int32)
        flat = np.concatenate([t.index + b for t, b in zip(luxels, base)])
        number[flat] = np.arange(len(flat))
        page = np.repeat(np.arange(len(sizes)), [len(t.index) for t in luxels])
        widths = np.array([p.width for p in atlas.pages])[page]
        self._number, self._at, self._width = signed(number), signed(flat), signed(widths)
        self._low, self._high = signed(base[page]), signed(base[page] + sizes[page] - 1)
        self._column = signed((flat - base[page]) % widths)
        self._position = np.concatenate([t.position for t in luxels])
        self._normal = np.concatenate([t.normal for t in luxels])
        self._together: dict[int, Array] = {}

    def around(self, step: int) -> Iterator[tuple[int, int, Array, Array]]:
        """The 25 luxels at multiples of `step`: offsets, luxel numbers, whether each is there and in the same plane."""
        if step not in self._together:
            self._together[step] = self._bits(step)
        for bit, (i, j, spot) in enumerate(self._spots(step)):
            inside = ((self._together[step] >> bit) & 1) == 1
            yield i, j, mi.UInt32(dr.gather(mi.Int32, self._number, mi.UInt32(spot), inside)), inside

    def _spots(self, step: int) -> Iterator[tuple[int, int, Array]]:
        """Offsets and where in all pages they lead."""
        for j in range(-2, 3):
            for i in range(-2, 3):
                yield i, j, self._at + j * step * self._width + i * step

    def _bits(self, step: int) -> Array:
        """For each luxel one bit per luxel around: whether it is there and of the same surface."""
        places, normals = floats(self._position), floats(self._normal)
        p, n, out = vector(self._position), vector(self._normal), mi.UInt32(0)
        for bit, (i, _, spot) in enumerate(self._spots(step)):
            x = self._column + i * step
            inside = (x >= 0) & (x < self._width) & (spot >= self._low) & (spot <= self._high)
            k = dr.gather(mi.Int32, self._number, mi.UInt32(spot), inside)
            inside &= k >= 0
            q = mi.UInt32(k)
            apart = dr.gather(mi.Vector3f, places, q, inside) - p
            inside &= dr.abs(dr.dot(apart, n)) < dr.maximum(0.004, BENT * dr.norm(apart))
            inside &= dr.dot(dr.gather(mi.Vector3f, normals, q, inside), n) > TURNED
            out |= dr.select(inside, mi.UInt32(1 << bit), 0)
        dr.eval(out)
        return out


def _brightness(c: Array) -> Array:
    return (c.x + c.y + c.z) * (1.0 / 3.0)
