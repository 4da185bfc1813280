"""Smooth edges where the CPU draws: pictures are drawn larger than they are wanted, and averaged.

That is cheaper there than multi-sampling, which multiplies the cost of every small triangle, and smoother.
"""

import functools
import math

import cv2
import numpy as np

SMALL_STEP, LARGE_STEP = 3, 5
"""Pixels drawn, along a side, for every 2 of a small picture and for every 4 of a large one. Against one drawn four
times as large, a picture of 640 x 480 has 36.0 dB so, and 37.5 as a small one, for a quarter more time."""
FROM = 200_000
"""Pixels from which on a picture is large."""


def drawn_size(size: tuple[int, int]) -> tuple[int, int]:
    """(height, width) at which a picture of `size` is drawn."""
    step = LARGE_STEP if size[0] * size[1] >= FROM else SMALL_STEP
    return math.ceil(size[0] * step / (step - 1)), math.ceil(size[1] * step / (step - 1))


def step_of(size: tuple[int, int], drawn: tuple[int, int]) -> int | None:
    """The number of pixels drawn for every one fewer that is wanted; None where they do not come out even."""
    for step in (SMALL_STEP, LARGE_STEP):
        if all(d * (step - 1) == s * step and d % step == 0 for s, d in zip(size, drawn, strict=True)):
            return step
    return None


def averaged(picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(h, w, 3) uint8 of `size`, top row first: the mean over each pixel's area of a picture of 3 or 4 channels that is
    no smaller and has its bottom row first."""
    height, width = picture.shape[:2]
    step = step_of(size, (height, width))
    if step is None:
        if (height, width) != tuple(size):
            picture = cv2.resize(picture, (size[1], size[0]), interpolation=cv2.INTER_AREA)
        return picture[::-1, :, :3]
    if picture.shape[2] == 3:
        picture = cv2.cvtColor(picture, cv2.COLOR_RGB2RGBA)
    rgba = cv2.remap(picture, *_between(*size, step), interpolation=cv2.INTER_LINEAR)
    return cv2.cvtColor(rgba, cv2.COLOR_RGBA2RGB)


@functools.lru_cache(maxsize=8)
def _between(height: int, width: int, step: int) -> tuple[np.ndarray, np.ndarray]:
    """The maps of cv2.remap for `averaged`: each mean, of no more than two pixels along a side, is one sample between
    them."""
    wide = step / (step - 1)
    starts = [np.arange(n) * wide for n in (width, height)]
    columns, rows = (np.floor(s + 1e-6) + (s + wide - np.floor(s + 1e-6) - 1) / wide for s in starts)
    x, y = np.broadcast_arrays(columns[None], rows[::-1, None])
    return x.astype(np.float32), y.astype(np.float32)


def nearest(picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(h, w) of `size`: the pixels of a drawn picture (one channel) nearest to the middles of those wanted."""
    return cv2.resize(picture, size[::-1], interpolation=cv2.INTER_NEAREST_EXACT)
