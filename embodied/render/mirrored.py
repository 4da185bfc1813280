"""Light that a picture's surfaces mirror, in half its size: averaged over a surface's neighbours, and enlarged."""

import functools
from collections.abc import Sequence

import cv2
import numpy as np

from embodied.geometry import r2

TILE = 8
"""Pixels after which the directions in the lobe repeat."""
FINE_TILE = (4, 2)
"""The same for polished metal, looked at in full size: rows and columns."""
GLINT = 1.5
"""The most that rough surfaces mirror where a whole tile of rays was averaged; less where it was fewer, in
proportion to what their mean is sure to: single rays from thin bars would be dots of light."""
CREASE = 0.9
"""Cosine of two normals below which they belong to two surfaces."""


class Mirrored:
    """A picture of half the size: whose surface each pixel shows, and what it loses and mirrors."""

    def __init__(self, shape: tuple[int, int], pixel: np.ndarray, owner: np.ndarray, normal: np.ndarray) -> None:
        """
        Args:
          pixel: (n,) flat positions in the picture of what mirrors and is looked at in this size.
          owner: (n,) whose surface it is.
          normal: (n, 3) of it, towards the camera.
        """
        self.shape, self._pixel = shape, pixel
        self.owner = np.full(shape, -1, np.int32)
        self.owner.ravel()[pixel] = owner
        self._normal = np.zeros((3, *shape), np.float32)
        self._normal.reshape(3, -1)[:, pixel] = normal.T
        self.values = np.zeros((4, *shape), np.float32)
        self.averaged = np.zeros(len(pixel), np.float32)
        """(n,) how many of these pixels each value was averaged over."""

    def smooth(self, lost: np.ndarray, mirrored: np.ndarray, rays: np.ndarray) -> None:
        """Fill `values` with the share of its own light that the surface loses and what it sends for it, averaged on
        the same surface so that every direction of a tile counts the same.

        Args:
          lost: (n,) of the pixels that mirror.
          mirrored: (n, 3).
          rays: (n,) how many found it.
        """
        sums = self._summed(np.stack([lost, *mirrored.T, np.ones_like(lost), rays]))
        self.averaged = sums[4].ravel()[self._pixel]
        self.values = sums[:4] / np.maximum(sums[4], 1e-6)
        most = GLINT * np.sqrt(sums[5] / np.float32(TILE * TILE))
        np.minimum(self.values[1:], most, out=self.values[1:])

    def _summed(self, values: np.ndarray) -> np.ndarray:
        """(k, h, w) sums of values (k, n) over neighbours on the same surface: over four pixels along rows and columns,
        then over three of those sums, TILE / 2 apart."""
        sums = np.zeros((len(values), *self.shape), np.float32)
        sums.reshape(len(values), -1)[:, self._pixel] = values
        for axis, step, reach in ((1, 1, 2), (0, 1, 2), (1, TILE // 2, 1), (0, TILE // 2, 1)):
            total = sums.copy()
            for k in range(1, reach + 1):
                near, far = _apart(axis, k * step)
                same = self._alike(near, far) * np.float32(0.5 if k == reach else 1.0)
                total[:, *near] += sums[:, *far] * same
                total[:, *far] += sums[:, *near] * same
            sums = total
        return sums

    def edges(self) -> np.ndarray:
        """(h, w) uint8: pixels beside another surface of which one mirrors."""
        edge = np.zeros(self.shape, np.uint8)
        for axis in (0, 1):
            near, far = _apart(axis, 1)
            other = ~self._alike(near, far) & ((self.owner[near] >= 0) | (self.owner[far] >= 0))
            edge[near] |= other
            edge[far] |= other
        return edge

    def nearest(self, row: np.ndarray, column: np.ndarray, owner: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """(n, 4) values for pixels of the full picture: of the nearest pixels here that show the same surface."""
        known = np.concatenate([self.values, self._normal]).reshape(7, -1).T.copy()
        total, is_known = self._around(known, row, column, owner, normal, (0, 1))
        if len(left := np.flatnonzero(~is_known)):
            wider = (-1, 0, 1, 2)
            total[left] = self._around(known, row[left], column[left], owner[left], normal[left], wider)[0]
        return total

    def _around(
        self,
        known: np.ndarray,
        row: np.ndarray,
        column: np.ndarray,
        owner: np.ndarray,
        normal: np.ndarray,
        steps: Sequence[int],
    ) -> tuple[np.ndarray, np.ndarray]:
        """`nearest` among so many neighbours each way, and for which pixels there was one; zeros for the others.

        Args:
          known: (h * w, 7) values and normals.
        """
        h, w = self.shape
        y0, x0 = (row - 1) >> 1, (column - 1) >> 1
        y, x = ((row - 0.5) / 2 - y0).astype(np.float32), ((column - 0.5) / 2 - x0).astype(np.float32)
        owners = self.owner.ravel()
        total, weight = np.zeros((len(row), 4), np.float32), np.zeros(len(row), np.float32)
        for dy in steps:
            for dx in steps:
                at = np.clip(y0 + dy, 0, h - 1) * w + np.clip(x0 + dx, 0, w - 1)
                there = np.flatnonzero(owners[at] == owner)
                neighbours = known[at[there]]
                near = np.exp(-2 * (np.square(y[there] - dy) + np.square(x[there] - dx)))
                near *= np.einsum("ij,ij->i", neighbours[:, 4:], normal[there]) > CREASE
                total[there] += neighbours[:, :4] * near[:, None]
                weight[there] += near
        return total / np.maximum(weight, 1e-6)[:, None], weight > 0

    def _alike(self, near: tuple[slice, slice], far: tuple[slice, slice]) -> np.ndarray:
        """True where pixels and their neighbours show the same surface."""
        x, y, z = self._normal
        cos = x[near] * x[far] + y[near] * y[far] + z[near] * z[far]
        return (self.owner[near] == self.owner[far]) & (cos > CREASE)


def evened(values: np.ndarray, pixels: np.ndarray, size: tuple[int, int], apart: int = 1) -> np.ndarray:
    """(n, k) values of pixels, averaged over those of them around each that look along the other directions of the
    lobe, FINE_TILE, and over what lies between two of these directions: `apart` pixels."""
    n = values.shape[1]
    sums = np.zeros((size[0] * size[1], n + 1), np.float32)
    sums[pixels, :n], sums[pixels, n] = values, 1
    between = np.convolve(np.ones(apart), np.ones(apart))
    across, down = (np.convolve(tile, between) for tile in ([0.5, 1, 0.5], [0.5, 1, 1, 1, 0.5]))
    planes = [cv2.sepFilter2D(p, -1, across, down, borderType=cv2.BORDER_CONSTANT) for p in sums.T.reshape(-1, *size)]
    sums = np.stack([p.ravel()[pixels] for p in planes], axis=1)
    return sums[:, :n] / sums[:, n:]


def _apart(axis: int, k: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Index of all pixels but the last k along `axis`, and of all but the first k."""
    near, far = slice(None, -k), slice(k, None)
    return ((near, slice(None)), (far, slice(None))) if axis == 0 else ((slice(None), near), (slice(None), far))


@functools.cache
def interleaved(n: int) -> np.ndarray:
    """(n, n) int: numbers from 0 to n * n - 1, n a power of two, so that every aligned square of 4, 16, ... pixels has
    consecutive ones (Morton 1966), which are spread over the whole lobe."""
    bits = np.arange(n)
    wide = np.sum([((bits >> b) & 1) << 2 * b for b in range(n.bit_length() - 1)], axis=0)
    return 2 * wide[:, None] + wide[None, :]


@functools.cache
def lobe(n: int) -> np.ndarray:
    """(n, 2) float32 evenly spread numbers in [0, 1): neighbours in the picture are far apart in the lobe."""
    points = np.array([r2(k + 1) for k in range(n)]) % 1.0
    first = (np.argsort(np.argsort(points[:, 0])) + 0.5) / n * 0.98
    return np.stack([first, points[:, 1]], axis=1).astype(np.float32)
