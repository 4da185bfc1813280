"""Places where the rays of a picture meet the faces of a panorama.

Faces have side s and borders of a pixel, and lie below each other. Numbers are rounded to float32 after each operation,
in the same order here and in embodied.render.kernels, so that pictures are the same with Numba and without.
"""

import functools
import importlib
import math
import warnings
from types import ModuleType
from typing import NamedTuple

import cv2
import numpy as np

FACES = (
    ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0)),
    ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0)),
)
"""Forward and up direction of every face, world."""
AXES = np.array([(forward, np.cross(forward, up), up) for forward, up in FACES])
"""(6, 3, 3): forward, right and up of every face, world."""
INSIDE = (np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]]) @ AXES).reshape(24, 3)
"""(24, 3), four to a face: a ray meets the face where its products with all four are not negative."""
PICTURE_AXES = (AXES * [[1], [1], [-1]]).astype(np.float32)
"""(6, 3, 3): forward, right and down of every face as a picture shows it."""
BY_AXIS = (0, 2, 1, 3, 4, 5)
"""Of faces that a ray meets at their edge, the first here has it."""


class Rays(NamedTuple):
    """Pixel (i, j) looks along rows[0, i] columns[:, j] + rows[1, i] up. All are float32."""

    rows: np.ndarray
    """(2, h), the first not negative."""
    columns: np.ndarray
    """(3, w) world."""
    up: np.ndarray
    """(3,) world."""


def locate(s: int, rays: Rays, maps: np.ndarray) -> None:
    """Write where rays meet faces.

    Args:
      s: side of a face, pixels.
      rays: of a picture of (h, w) pixels.
      maps: (3, h, w) float32, each contiguous: how far the ray goes along the axis of the face, and x and y on the
        faces.
    """
    if (kernels := numba_kernels()) is not None:
        kernels.locate(*rays, s, *maps)
        return
    half, middle, side = np.float32(s / 2), np.float32((s + 1) / 2), np.float32(s + 2)
    maps[0], straight = 0, np.all(rays.rows[0] == 1)
    spare = np.empty(4 * maps[0].size, np.float32)
    for face, i, j in _seen(rays):
        here = maps[:, i, j]
        places, scale = spare[: here.size].reshape(here.shape), spare[-here[0].size :].reshape(here.shape[1:])
        across, up = (PICTURE_AXES[face] @ rays.columns[:, j])[:, None], (PICTURE_AXES[face] @ rays.up)[:, None, None]
        if not straight:
            across = np.multiply(rays.rows[0, i, None], across, out=places)
        np.add(across, rays.rows[1, i, None] * up, out=places)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            np.divide(half, places[0], out=scale)
            places[1:] *= scale
        places[1:] += middle
        places[2] += np.float32(face) * side
        nearer = cv2.compare(places[0], here[0], cv2.CMP_GT)
        for values, to in zip(places, here, strict=True):
            cv2.copyTo(values, nearer, to)


@functools.cache
def numba_kernels() -> ModuleType | None:
    """embodied.render.kernels, which has `locate` in compiled code, if Numba is installed and works."""
    try:
        return importlib.import_module("embodied.render.kernels")
    except ImportError:
        return None
    except Exception as e:
        warnings.warn(f"pictures at new angles take longer, since Numba does not work here: {e!r}", stacklevel=2)
        return None


def _seen(rays: Rays) -> list[tuple[int, slice, slice]]:
    """The faces that rays meet, and between which rows and columns; on seams also those that rounded rays may meet."""
    rows, columns, _ = rays
    across, rising, reach = _reach(rays)
    rounding = -1e-6 * math.hypot(np.abs(rows[0]).max() * math.hypot(*np.abs(columns).max(1)), np.abs(rows[1]).max())
    wide = np.all(reach >= rounding, axis=1)
    high = np.all(rows[0] * across.max(2, keepdims=True) + rows[1] * rising >= rounding, axis=1)
    return [(face, _span(high[face]), _span(wide[face])) for face in BY_AXIS if high[face].any() and wide[face].any()]


def _reach(rays: Rays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(6, 4, w) and (6, 4, 1): INSIDE times columns and up; and (6, 4, w): the most of INSIDE times a ray that a column
    has."""
    across, rising = (INSIDE @ rays.columns).reshape(6, 4, -1), (INSIDE @ rays.up).reshape(6, 4, 1)
    least, most, lowest, highest = rays.rows[0].min(), rays.rows[0].max(), rays.rows[1].min(), rays.rows[1].max()
    reach = most * across if least == most else np.maximum(least * across, most * across)
    return across, rising, reach + np.maximum(lowest * rising, highest * rising)


def _span(where: np.ndarray) -> slice:
    """From the first to the last that is true."""
    indices = np.flatnonzero(where)
    return slice(int(indices[0]), int(indices[-1]) + 1)
