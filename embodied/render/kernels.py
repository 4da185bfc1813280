"""The pixel loops of embodied.render.sampling, compiled by Numba (extra [numba]): the same numbers, sooner."""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

if numba.config.DISABLE_JIT:
    raise ImportError("Numba is told not to compile, and Python is slow with pixels")
RAYS = "float32[:, ::1], float32[:, ::1], float32[::1]"
MAP = "float32[:, ::1]"


def compiled_for(signature: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Compiles a function for such arguments; what comes out is kept beside this file or in Numba's cache folder."""

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        options = {"error_model": "numpy", "nogil": True}
        try:
            return numba.njit(signature, cache=True, **options)(function)
        except Exception:  # nothing can be written there, or what is there cannot be read
            return numba.njit(signature, **options)(function)

    return decorate


@compiled_for(f"void({RAYS}, int64, {MAP}, {MAP}, {MAP})")
def locate(
    rows: np.ndarray, columns: np.ndarray, up: np.ndarray, s: int, along: np.ndarray, x: np.ndarray, y: np.ndarray
) -> None:
    """Write the three maps of `sampling.locate`."""
    half, middle, side = np.float32(s / 2), np.float32((s + 1) / 2), np.float32(s + 2)
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            a = rows[0, i] * columns[0, j] + rows[1, i] * up[0]
            b = rows[0, i] * columns[1, j] + rows[1, i] * up[1]
            c = rows[0, i] * columns[2, j] + rows[1, i] * up[2]
            depth, right, down, face = abs(a), -b if a > 0 else b, -c, np.float32(0 if a > 0 else 2)
            if abs(b) > depth:
                depth, right, face = abs(b), a if b > 0 else -a, np.float32(1 if b > 0 else 3)
            if abs(c) > depth:
                depth, right, down, face = abs(c), -b, a if c > 0 else -a, np.float32(4 if c > 0 else 5)
            scale = half / depth
            along[i, j] = depth
            x[i, j] = middle + right * scale
            y[i, j] = middle + down * scale + face * side
