"""Detail: what matter shows from nearby, finer than any baked page: threads, tufts, pores, pebbles, grains.

A tile of factors with mean 1 for each, a millimetre to the pixel, and its halves down to one pixel.
"""

from __future__ import annotations

import functools

import cv2
import numpy as np

from embodied.assets.materials.maps import Canvas, blurred
from embodied.assets.materials.textile import Weave, leather
from embodied.assets.records import DETAILS

PIXELS, TILE = 512, 0.512
"""Side of a tile, pixels and metres."""
STRENGTH = {"weave": 0.08, "nap": 0.09, "pores": 0.07, "pebbles": 0.06, "plaster": 0.035, "stipple": 0.012}
"""Standard deviation of the factors, as shown (sRGB)."""


@functools.cache
def pyramid(kind: str) -> tuple[np.ndarray, ...]:
    """(512, 512), (256, 256), ... (1, 1) float32 factors of the tile."""
    field = _field(kind)
    field = field - field.mean()
    levels = [(1 + STRENGTH[kind] * np.clip(field / field.std(), -3, 3)).astype(np.float32)]
    levels[0] /= levels[0].mean()
    while len(levels[-1]) > 1:
        half = len(levels[-1]) // 2
        levels.append(cv2.resize(levels[-1], (half, half), interpolation=cv2.INTER_AREA).reshape(half, half))
    return tuple(levels)


def _field(kind: str) -> np.ndarray:
    on, grey = Canvas(PIXELS, TILE, np.random.default_rng(DETAILS.index(kind))), (0.5, 0.5, 0.5)
    if kind == "weave":
        threads = Weave(grey, grey, 170, irregular=0.09, slubs=1.2, fuzz=0.12)(on).color[..., 0]
        return threads / threads.std() + on.noise(1.2, 9) * 0.4 + on.noise(9, 1.2) * 0.4
    if kind == "nap":
        return on.noise(1.2, 1.2) + 1.1 * on.noise(3.5, 3.5) + 0.5 * on.noise(10, 10)
    if kind == "pores":
        dashes = np.minimum(1.2 - on.noise(24, 0.5), 0)
        return dashes / dashes.std() + 0.7 * on.noise(90, 1.2) + 0.4 * on.noise(90, 4)
    if kind == "pebbles":
        return leather(on, grey).color[..., 0]
    lumps = on.noise(1.0, 1.0) + 0.8 * on.noise(3, 3)
    if kind == "plaster":
        return lumps + 0.8 * on.noise(16, 9)
    return blurred(lumps, 0.8)
