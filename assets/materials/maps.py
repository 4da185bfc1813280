"""The colours of one material, and the periodic noise and layouts they are made from.

All arrays are (n, n) float32 over one square tile that repeats without a seam; row 0 is the top of
the image, which is v = 1. Lengths are metres unless a name says pixels.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import scipy.fft

from embodied.assets.records import Color

Colors = tuple[Color, ...]


@dataclass(frozen=True, eq=False)
class Maps:
    color: np.ndarray
    """(n, n, 3) float32, sRGB in [0, 1]."""
    roughness: float
    """Its mean, in [0, 1]."""


def maps_of(color: np.ndarray, roughness: np.ndarray | float, darkest: float = 0.01, brightest: float = 0.98) -> Maps:
    """Maps of a colour (n, n, 3) kept between two limits, and of a roughness (n, n), or one number for all of it."""
    mean = float(np.full(color.shape[:2], roughness, np.float32).mean())
    return Maps(np.clip(color, darkest, brightest).astype(np.float32), mean)


def filtered(n: int, band: Callable[[np.ndarray, np.ndarray], np.ndarray], *, rng: np.random.Generator) -> np.ndarray:
    """White noise through the transfer function `band(fx, fy)`, frequencies in cycles per pixel."""
    white = rng.standard_normal((n, n), dtype=np.float32)
    fx = scipy.fft.rfftfreq(n).astype(np.float32)[None]
    fy = scipy.fft.fftfreq(n).astype(np.float32)[:, None]
    gain = np.broadcast_to(band(fx, fy), (n, n // 2 + 1)).astype(np.float32).copy()
    gain[0, 0] = 0
    out = scipy.fft.irfft2(scipy.fft.rfft2(white) * gain, s=(n, n))
    return (out / max(float(out.std()), 1e-9)).astype(np.float32)


def look_up(field: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Bilinear periodic lookup of `field` (n, n) at x, y given in tiles (any real numbers)."""
    n = len(field)
    padded = np.pad(field, ((0, 1), (0, 1)), mode="wrap")
    px = (np.asarray(x, np.float64) % 1.0 * n).astype(np.float32)
    py = (np.asarray(y, np.float64) % 1.0 * n).astype(np.float32)
    return cv2.remap(padded, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def blurred(field: np.ndarray, sigma: float) -> np.ndarray:
    """Periodic Gaussian blur, sigma in pixels."""
    k = int(4 * sigma + 2)
    wide = np.pad(field, ((k, k), (k, k), *((0, 0),) * (field.ndim - 2)), mode="wrap")
    return cv2.GaussianBlur(wide, (0, 0), sigma)[k:-k, k:-k]


def smooth_step(x: np.ndarray, a: float, b: float) -> np.ndarray:
    t = np.clip((x - a) / (b - a), 0, 1)
    return (t * t * (3 - 2 * t)).astype(np.float32)


def coordinates(n: int, tile: float) -> tuple[np.ndarray, np.ndarray]:
    """u (to the right) and v (up) of the pixel centres, metres in [0, tile)."""
    t = (np.arange(n, dtype=np.float64) + 0.5) / n * tile
    u, v = np.meshgrid(t, t[::-1])
    return u, v


def rgb(color: Color | Colors | np.ndarray, shape: tuple[int, int] | None = None) -> np.ndarray:
    """A colour as float32, (3,) or spread over (n, n, 3)."""
    c = np.asarray(color, np.float32)
    return np.broadcast_to(c, (*shape, 3)).copy() if shape else c


def mix(a: np.ndarray, b: np.ndarray, t: np.ndarray) -> np.ndarray:
    """a where t is 0, b where t is 1; t (n, n) against colours (3,) or (n, n, 3)."""
    return (a + (b - a) * t[..., None]).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Canvas:
    """A square to draw a material on: n pixels wide, over a square of `tile` metres."""

    n: int
    tile: float
    rng: np.random.Generator

    def noise(self, across: float, down: float) -> np.ndarray:
        """Periodic Gaussian noise, unit variance, with correlation lengths in pixels across and down."""
        band = lambda fx, fy: np.exp(-((fx * across) ** 2 + (fy * down) ** 2) * 4.9)
        return filtered(self.n, band, rng=self.rng)

    def fbm(self, low: float, high: float, slope: float = 1.6, stretch: float = 1.0) -> np.ndarray:
        """Periodic fractal noise, unit variance: amplitude f^-slope from `low` to `high` cycles per tile.

        Nothing slower than `low` remains, so that the tile shows no blob that the eye can count.
        stretch: how many times longer its features are across (x) than down (y).
        """

        def band(fx: np.ndarray, fy: np.ndarray) -> np.ndarray:
            f = np.hypot(fx * stretch, fy) * self.n
            falling = np.where(f > 0, np.maximum(f, 1e-3) ** -slope, 0)
            return falling * (1 - np.exp(-((f / low) ** 4))) * np.exp(-((f / high) ** 2))

        return filtered(self.n, band, rng=self.rng)

    def coordinates(self) -> tuple[np.ndarray, np.ndarray]:
        """As `coordinates`."""
        return coordinates(self.n, self.tile)

    def shares(self) -> np.ndarray:
        """(2, n, n) float32 in [0, 1): y down and x to the right."""
        return np.mgrid[0 : self.n, 0 : self.n].astype(np.float32) / self.n

    def rgb(self, color: Color | np.ndarray) -> np.ndarray:
        """(n, n, 3) of one colour."""
        return rgb(color, (self.n, self.n))


@dataclass(frozen=True, eq=False)
class Places:
    """Places on endless stone from which the pixels of a canvas are cut."""

    on: Canvas
    x: np.ndarray
    """(n, n), in tiles."""
    y: np.ndarray
    """(n, n), in tiles."""

    def noise(self, across: float, down: float) -> np.ndarray:
        """As Canvas.noise, at these places."""
        return look_up(self.on.noise(across, down), self.x, self.y)

    def fbm(self, low: float, high: float, slope: float = 1.6, stretch: float = 1.0) -> np.ndarray:
        """As Canvas.fbm, at these places."""
        return look_up(self.on.fbm(low, high, slope, stretch), self.x, self.y)


@dataclass(frozen=True, eq=False)
class Layout:
    """Pieces (boards, tiles, bricks) that cover the tile."""

    piece: np.ndarray
    """(n, n) int64: which piece a pixel belongs to, 0 .. count - 1."""
    along: np.ndarray
    """(n, n) metres along the piece from its start."""
    across: np.ndarray
    """(n, n) metres across the piece from its middle."""
    edge: np.ndarray
    """(n, n) metres to the nearest edge of the piece."""
    count: int


def _layout(codes: np.ndarray, along: np.ndarray, across: np.ndarray, edge: np.ndarray) -> Layout:
    names, piece = np.unique(codes, return_inverse=True)
    along, across, edge = (a.astype(np.float32) for a in (along, across, edge))
    return Layout(piece.reshape(codes.shape), along, across, edge, len(names))


def planks(
    n: int, tile: float, rows: int, per_row: float, *, rng: np.random.Generator, regular: bool = False
) -> Layout:
    """Boards along u in `rows` rows with staggered, irregular joints (about `per_row` a row)."""
    u, v = coordinates(n, tile)
    width = tile / rows
    row = np.floor(v / width).astype(int)
    code, along, length = np.zeros((n, n), int), np.zeros((n, n)), np.zeros((n, n))
    last = -1.0
    for r in range(rows):
        count = max(1, int(np.floor(per_row + (0 if regular else rng.random()))))
        for _ in range(20):
            start = (r * 0.5 % 1) / count if regular else rng.random()
            if regular or abs((start - last + 0.5) % 1 - 0.5) > 0.12:
                break
        last = start
        parts = np.ones(count) if regular else rng.uniform(0.65, 1.35, count)
        joints = (start + np.concatenate([[0], np.cumsum(parts / parts.sum())])) * tile
        in_row = row == r
        x = (u[in_row] - joints[0]) % tile
        k = np.clip(np.searchsorted(joints - joints[0], x, side="right") - 1, 0, count - 1)
        code[in_row], along[in_row] = r * 64 + k, x - (joints[k] - joints[0])
        length[in_row] = joints[k + 1] - joints[k]
    y = v - row * width
    edge = np.minimum(np.minimum(y, width - y), np.minimum(along, length - along))
    return _layout(code, along, y - width / 2, edge)


def herringbone(n: int, tile: float, ratio: int, repeats: int) -> Layout:
    """Blocks `ratio` times as long as wide, at 45 degrees; `repeats` zigzags across the tile."""
    width = tile / (repeats * ratio * np.sqrt(2))
    u, v = coordinates(n, tile)
    x, y = (u + v) / np.sqrt(2) / width, (u - v) / np.sqrt(2) / width
    cx, cy = np.floor(x).astype(int), np.floor(y).astype(int)
    t = (cx - cy) % (2 * ratio)
    lying = t < ratio
    along = np.where(lying, t + (x - cx), (2 * ratio - 1 - t) + (y - cy))
    across = np.where(lying, y - cy, x - cx)
    bx = np.where(lying, cx - t, cx)
    by = np.where(lying, cy, cy - (2 * ratio - 1 - t))
    period = 2 * repeats * ratio
    code = (((bx + by) % period) * period + (bx - by) % period) * 2 + lying
    edge = np.minimum(np.minimum(across, 1 - across), np.minimum(along, ratio - along)) * width
    return _layout(code, along * width, (across - 0.5) * width, edge)


def chevron(n: int, tile: float, columns: int, boards: int) -> Layout:
    """Boards cut at 45 degrees that meet in `columns` (even) straight ribs; `boards` per tile in each."""
    u, v = coordinates(n, tile)
    rib, step = tile / columns, tile / boards
    c = np.floor(v / rib).astype(int)
    y = v - c * rib
    s = u + np.where(c % 2 == 0, y, rib - y)
    k = np.floor(s / step).astype(int)
    f = s / step - k
    code = c * boards + k % boards
    edge = np.minimum(np.minimum(f, 1 - f) * step / np.sqrt(2), np.minimum(y, rib - y))
    return _layout(code, y * np.sqrt(2), (f - 0.5) * step / np.sqrt(2), edge)


def basket(n: int, tile: float, squares: int, strips: int) -> Layout:
    """Square panels of `strips` little boards each, turned by a quarter from one to the next."""
    u, v = coordinates(n, tile)
    side = tile / squares
    i, j = np.floor(u / side).astype(int), np.floor(v / side).astype(int)
    x, y = u - i * side, v - j * side
    turned = (i + j) % 2 == 1
    x, y = np.where(turned, y, x), np.where(turned, x, y)
    width = side / strips
    k = np.clip(np.floor(y / width).astype(int), 0, strips - 1)
    across = y - k * width
    edge = np.minimum(np.minimum(across, width - across), np.minimum(x, side - x))
    return _layout((i * squares + j) * strips + k, x, across - width / 2, edge)


def bricks(n: int, tile: float, columns: int, rows: int, shift: float = 0.0) -> Layout:
    """Rectangles in rows, every other row moved by `shift` of a piece (0 is a plain grid; rows even else)."""
    u, v = coordinates(n, tile)
    width, height = tile / columns, tile / rows
    r = np.floor(v / height).astype(int)
    x = u + (r % 2) * shift * width
    c = np.floor(x / width).astype(int)
    along, across = x - c * width, v - r * height
    edge = np.minimum(np.minimum(along, width - along), np.minimum(across, height - across))
    return _layout(r * columns + c % columns, along, across - height / 2, edge)


def hexagons(n: int, tile: float, columns: int) -> Layout:
    """Hexagons with a flat side to the left and right, `columns` a row; within 1 % of regular for 7."""
    rows = 2 * round(columns / np.sqrt(3))
    u, v = coordinates(n, tile)
    a, h = tile / columns, tile / rows
    stretch = a / np.sqrt(3) * 1.5 / h
    best, code = np.full((n, n), np.inf), np.zeros((n, n), int)
    second, dx, dy = np.full((n, n), np.inf), np.zeros((n, n)), np.zeros((n, n))
    r0 = np.floor(v / h).astype(int)
    for dr in (-1, 0, 1, 2):
        r = r0 + dr
        offset = (r % 2) * 0.5
        c0 = np.floor(u / a - offset).astype(int)
        for dc in (0, 1):
            c = c0 + dc
            ex, ey = u - (c + offset) * a, (v - r * h) * stretch
            d = np.hypot(ex, ey)
            closer = d < best
            second = np.where(closer, best, np.minimum(second, d))
            code = np.where(closer, (r % rows) * columns + c % columns, code)
            dx, dy = np.where(closer, ex, dx), np.where(closer, ey, dy)
            best = np.where(closer, d, best)
    # The border between two neighbours lies where the distances agree: half the pitch from the centre.
    edge = (second**2 - best**2) / (2 * a)
    return _layout(code, dx + a / 2, dy, edge)
