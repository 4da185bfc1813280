"""Detail: threads, nap, pores and grains laid over pictures of a lit house, where they are seen from nearby.

Pages hold light and colour to the centimetre; what is finer would fill the memory. Here each pixel that shows a known
matter from so near that a pixel is some millimetres wide is multiplied by a factor of that matter's tile. The tile lies
in the world, along the surface's axes, so that it stays where it is from frame to frame; it is read as coarsely as the
pixel is wide, and its factors are 1 in the mean, so that light, depth and ids stay.
"""

import functools
import math

import cv2
import numpy as np

from embodied.assets.materials.maps import Canvas, blurred
from embodied.assets.materials.textile import Weave, leather
from embodied.assets.records import DETAILS
from embodied.render.camera import Camera

PIXELS, TILE = 512, 0.512
"""Side of a tile, pixels and metres: a millimetre to the pixel."""
STRENGTH = {"weave": 0.08, "nap": 0.09, "pores": 0.07, "pebbles": 0.06, "plaster": 0.035, "stipple": 0.012}
"""Standard deviation of the factors, as shown (sRGB)."""
COARSEST = 8e-3
"""Metres on the surface from which on a pixel is too wide to show any of it."""
SOFTER = 0.4
"""Halvings by which the tile is read coarser than a pixel asks for: frames of a video shimmer less."""
GRAZING = 0.15
"""Cosine of the view below which surfaces are read no coarser."""


class Detail:
    """Knows for all faces of a house how their matter lies on them."""

    def __init__(self, corners: np.ndarray, normal: np.ndarray, code: np.ndarray) -> None:
        """
        Args:
          corners: (m, 3, 3) metres, world. normal: (m, 3) unit.
          code: (m,) uint8, number of what a face shows from 1 on, 0 for none, and 16 times the axis of its grain.
        """
        self._kind = np.append(code % 16, 0).astype(np.int64)  # nothing that is met is face -1
        self._normal = normal
        self._plane = np.einsum("ij,ij->i", normal, corners[:, 0])
        out_of, grain = np.abs(normal).argmax(1), code // 16
        first, second = np.array([1, 0, 0])[out_of], np.array([2, 2, 1])[out_of]
        turned = grain == second
        self._u = np.where(turned, second, first)
        self._v = np.where(turned, first, second)

    def lay(self, out: np.ndarray, camera: Camera, ahead: np.ndarray, face: np.ndarray, distance: np.ndarray) -> None:
        """Lay what is seen from nearby over `out` (h, w, 3) uint8.

        Args:
          ahead: (h * w, 3) unit rays through its pixels.
          face, distance: what every other pixel of every other row shows, -1 for nothing.
        """
        h, w = out.shape[:2]
        wide = 2 * math.tan(camera.vfov / 2) / h
        near = np.flatnonzero((self._kind[face] > 0) & (distance * wide < COARSEST))
        if not len(near):
            return
        row, column = np.divmod(near, (w + 1) // 2)
        row = (2 * row[:, None] + [0, 0, 1, 1]).ravel()
        column = (2 * column[:, None] + [0, 1, 0, 1]).ravel()
        inside = (row < h) & (column < w)
        at = (row * w + column)[inside]
        face, far = (np.repeat(a[near], 4)[inside] for a in (face, distance))
        flat = out.reshape(-1, 3)
        factor = self._factors(np.asarray(camera.position, np.float32), ahead[at], face, far, wide)
        flat[at] = np.clip(flat[at] * factor[:, None] + 0.5, 0, 255)

    def _factors(
        self, eye: np.ndarray, ahead: np.ndarray, face: np.ndarray, far: np.ndarray, wide: float
    ) -> np.ndarray:
        """(n,) factors of what rays from `eye` meet; the ray of a neighbour met its plane `far` away."""
        normal = self._normal[face]
        cos = np.einsum("ij,ij->i", normal, ahead)
        cos = np.where(np.abs(cos) < 1e-3, 1e-3, cos)
        t = np.clip((self._plane[face] - normal @ eye) / cos, 0.8 * far, 1.25 * far)
        rows = np.arange(len(face))
        u, v = (eye[axis] + t * ahead[rows, axis] for axis in (self._u[face], self._v[face]))
        width = t * wide / np.maximum(np.abs(cos), GRAZING)
        level = np.clip(np.log2(width * (PIXELS / TILE)) + SOFTER, 0, LAST)
        below = level.astype(np.int64)
        share, kind = level - below, self._kind[face] - 1
        fine, coarse = (_read(kind, np.minimum(below + k, LAST), u, v) for k in (0, 1))
        return fine + (coarse - fine) * share


LAST = PIXELS.bit_length() - 1
"""Level of the tile at which a single pixel is left."""
STARTS = np.cumsum([0, *(4**k for k in range(LAST, 0, -1))])
"""First texels of the levels of a tile."""


def _read(kind: np.ndarray, level: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(n,) factors at places (metres) of tiles."""
    side = PIXELS >> level
    x = np.floor(u * (1 / TILE) * side).astype(np.int64) & (side - 1)
    y = np.floor(v * (1 / TILE) * side).astype(np.int64) & (side - 1)
    return _tables()[kind, STARTS[level] + y * side + x]


@functools.cache
def _tables() -> np.ndarray:
    """(kinds, pixels of all levels) float32."""
    return np.stack([np.concatenate([level.ravel() for level in pyramid(kind)]) for kind in DETAILS])


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
    return lumps + 0.8 * on.noise(16, 9) if kind == "plaster" else blurred(lumps, 0.8)
