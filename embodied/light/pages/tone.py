"""From light to picture: exposure and white balance that adapt from room to room, and the film curve.

A camera carried through a house adapts to each room. Here every point in space has a gain per colour channel that
changes smoothly through doors and openings, so that textures lit once can be shown with it and never show a step.
"""

import functools
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import map_coordinates

from embodied.house.house import House
from embodied.light.backend import Array, array, dr, mi, vector
from embodied.light.pages.colours import shown

TARGET = 1.05
"""Linear value (before the curve) that a white sheet in a room's fuller light (85th percentile) is brought to."""
ADAPT = 0.9
"""How far exposure follows a room's own light rather than the house's."""
BALANCE = 0.62
"""How far white balance takes out the colour of the light."""
BLEND = 0.45
"""Metres over which one room's gain turns into the next one's."""
DARKEST = 2e-3
"""Light of a room (100 cd/m2) below which exposure follows no more: by moonlight rooms stay dark."""
WHITE = 5.0
"""Value that the curve brings to full white."""
LIFT, SHOULDER = 1.12, 0.78
"""Factor on sRGB values, and the value above which they are bent so that white stays 1."""


@dataclass(frozen=True, eq=False)
class Exposure:
    """Gains over space."""

    polygons: tuple[tuple[tuple[float, float], ...], ...]
    levels: np.ndarray
    """(r, 2) float, lowest and highest z of each room."""
    gains: np.ndarray
    """(r, 3) float, linear."""
    outdoors: np.ndarray
    """(3,) gain of what is seen through windows."""

    def at(self, position: np.ndarray) -> np.ndarray:
        """(n, 3) float32 gains at points (n, 3)."""
        grid, low = self._grid
        where = ((np.asarray(position, float) - low) / GAIN_SPACING).T
        return np.exp(
            np.stack([map_coordinates(grid[k], where, order=1, mode="nearest") for k in range(3)], axis=-1)
        ).astype(np.float32)

    def many(self, position: np.ndarray) -> np.ndarray:
        """`at` for many points, on Mitsuba's device."""
        grid, low = self._grid
        count = np.array(grid.shape[1:])
        where = ((np.asarray(position, np.float32) - low) / GAIN_SPACING + 0.5) / count
        field = mi.Texture3f(mi.TensorXf(np.ascontiguousarray(grid.transpose(3, 2, 1, 0))), False)
        return array(mi.Color3f(*(dr.exp(x) for x in field.eval(mi.Point3f(vector(where))))))

    def near(self, position: np.ndarray) -> np.ndarray:
        """(n, 3) float32 gains of the grid's points that are nearest to points (n, 3): `at` for many of them."""
        gains, low = self._near
        k = np.rint((np.asarray(position, np.float32) - low) / GAIN_SPACING.astype(np.float32)).astype(np.int64)
        return gains[tuple(np.clip(k, 0, np.array(gains.shape[:3]) - 1).T)]

    @functools.cached_property
    def _near(self) -> tuple[np.ndarray, np.ndarray]:
        grid, low = self._grid
        return np.ascontiguousarray(np.exp(np.moveaxis(grid, 0, -1)), np.float32), low.astype(np.float32)

    @functools.cached_property
    def _grid(self) -> tuple[np.ndarray, np.ndarray]:
        """Log gains (3, nx, ny, nz) on a grid of `GAIN_SPACING` over the house, and its lowest corner."""
        weights, low = _weights(self.polygons, tuple(map(tuple, self.levels.tolist())))
        log = np.zeros((3, *weights[0].shape))
        for w, gain in zip(weights, self.gains, strict=True):
            log += w * np.log(gain)[:, None, None, None]
        return (log / np.sum(weights, axis=0)).astype(np.float32), low


GAIN_SPACING = np.array([0.1, 0.1, 0.4])
"""Spacing of the gain grid, metres."""


@functools.lru_cache(maxsize=1)
def _weights(
    polygons: tuple[tuple[tuple[float, float], ...], ...], levels: tuple[tuple[float, float], ...]
) -> tuple[list[np.ndarray], np.ndarray]:
    """Weights of each room's gain, (nx, ny, nz) on a grid of `GAIN_SPACING` over the house, and the grid's lowest
    corner; the same in every light."""
    corners, heights = np.array([c for p in polygons for c in p]), np.array(levels)
    low = np.array([*(corners.min(0) - 1.0), heights[:, 0].min() - 1.0])
    high = np.array([*(corners.max(0) + 1.0), heights[:, 1].max() + 1.0])
    n = np.ceil((high - low) / GAIN_SPACING).astype(int) + 1
    x, y, z = (low[k] + np.arange(n[k]) * GAIN_SPACING[k] for k in range(3))
    points = shapely.points(*np.meshgrid(x, y, indexing="ij"))
    weights = []
    for polygon, (bottom, top) in zip(polygons, levels, strict=True):
        flat = shapely.distance(shapely.Polygon(polygon), points)[..., None]
        off = np.maximum(np.maximum(bottom - z, z - top), 0.0)
        weights.append(np.exp(-0.5 * (flat**2 + off**2) / BLEND**2) + 1e-12)
    return weights, low


def expose(house: House, light: dict[str, np.ndarray], outside: np.ndarray) -> Exposure:
    """Set the gains.

    Args:
      light: room id to (3,) 85th percentile of e on its walls, floor and ceiling.
      outside: (3,) middle radiance of what windows show.
    """
    e = np.array([light[r.id] for r in house.rooms])
    y = e @ [0.2126, 0.7152, 0.0722]
    middle = np.exp(np.mean(np.log(np.maximum(y, DARKEST))))
    level = np.maximum(y, DARKEST) ** ADAPT * middle ** (1 - ADAPT)
    gains = np.stack([_gain(c, bright) for c, bright in zip(e, level)])
    storeys = [house.storey_of(r) for r in house.rooms]
    levels = np.array([(s.elevation, s.elevation + s.height) for s in storeys])
    out_y = float(outside @ [0.2126, 0.7152, 0.0722])
    inside = float(np.median(gains.mean(1)))
    # a picture's windows are brighter than its walls but hold their detail by day; at night they are dark
    wanted = np.clip(0.75 * (out_y * inside) ** 0.25, 0.05, 1.3)
    return Exposure(tuple(r.polygon for r in house.rooms), levels, gains, np.full(3, wanted / max(out_y, 1e-6)))


def _gain(light: np.ndarray, level: float) -> np.ndarray:
    hue = np.maximum(light / max(light @ [0.2126, 0.7152, 0.0722], 1e-6), 0.05)
    gain = TARGET / level * hue**-BALANCE
    return gain / (gain @ (hue * [0.2126, 0.7152, 0.0722])) * (TARGET / level)


def develop(radiance: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """Radiance times gain, (..., 3), as sRGB in [0, 1] float32: `developed`."""
    x = np.asarray(radiance, np.float32) * np.asarray(gain, np.float32)
    return array(developed(mi.Color3f(vector(x.reshape(-1, 3))))).reshape(x.shape)


def developed(x: Array) -> Array:
    """Exposed radiance, a device colour, as sRGB in [0, 1]: extended Reinhard, half on luminance and half per channel.

    Then lifted a little, with a shoulder that keeps sunlit walls short of plain white.

    Source: Reinhard et al. 2002, eq. 4, with white at `WHITE`.
    """
    y = dr.maximum(x.x * 0.2126 + x.y * 0.7152 + x.z * 0.0722, 1e-9)
    by_luminance = x * (_curve(y) / y)
    lifted = shown(0.5 * (dr.minimum(by_luminance, 1.0) + _curve(x))) * LIFT
    return lifted - dr.square(dr.maximum(lifted - SHOULDER, 0.0)) * ((LIFT - 1) / (LIFT - SHOULDER) ** 2)


def display(radiance: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """`develop` as uint8."""
    return (develop(radiance, gain) * 255 + 0.5).astype(np.uint8)


def _curve(x: Array) -> Array:
    return x * (1 + x / WHITE**2) / (1 + x)


def displayed(x: np.ndarray) -> np.ndarray:
    """Exposed radiance (..., 3) as uint8: `developed` on the thread that asks, from a table."""
    y = np.maximum(x @ np.array([0.2126, 0.7152, 0.0722], np.float32), 1e-9)[..., None]
    curve = lambda v: v * (1 + v / WHITE**2) / (1 + v)
    mixed = 0.5 * (np.minimum(x * (curve(y) / y), 1.0) + curve(x))
    return shown_table()[(np.clip(mixed, 0, 1) * (len(shown_table()) - 1) + 0.5).astype(np.int32)]


@functools.cache
def shown_table() -> np.ndarray:
    """(n,) uint8 of values from 0 to 1, evenly."""
    t = np.linspace(0, 1, 1 << 14)
    lifted = np.where(t <= 0.0031308, 12.92 * t, 1.055 * t ** (1 / 2.4) - 0.055) * LIFT
    lifted = lifted - np.square(np.maximum(lifted - SHOULDER, 0)) * ((LIFT - 1) / (LIFT - SHOULDER) ** 2)
    return (np.clip(lifted, 0, 1) * 255 + 0.5).astype(np.uint8)
