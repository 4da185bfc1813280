"""Light probes: the light at places in a room's air, from which everything that moves takes it.

Each probe holds e = E / pi (100 cd/m2, as everywhere in `embodied.light`) of every normal as nine real spherical
harmonics for each colour, without the direct sun. Every room has a grid of its own.

Source: Ramamoorthi and Hanrahan, An efficient representation for irradiance environment maps (2001).
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

ORDERS = np.repeat([0, 1, 2], [1, 3, 5])
"""(9,) order of each harmonic."""
LOBE = np.array([1.0, 2 / 3, 1 / 4], np.float32)
"""e of each order for one of radiance: the cosine lobe's A_0 to A_2 divided by pi (eq. 8)."""
CORNERS = np.array(list(np.ndindex(2, 2, 2)))
"""(8, 3) of a cell, 0 or 1 along each axis."""
AXES = np.arange(3)
SLACK = 0.02
"""Metres behind what a probe sees along an axis at which its light still counts."""
LEAST = 1e-3
"""Sum of weights below which the nearest probe counts instead."""


def _icosahedron() -> np.ndarray:
    """(12, 3) unit corners; sums over them are exact for polynomials up to degree 5."""
    golden = (1 + np.sqrt(5)) / 2
    flat = np.array([[0.0, a, b * golden] for a in (-1, 1) for b in (-1, 1)]) / np.sqrt(1 + golden**2)
    return np.concatenate([np.roll(flat, k, axis=1) for k in range(3)])


NORMALS = _icosahedron()
"""(12, 3) that tell all nine harmonics."""


def terms(x: Any, y: Any, z: Any) -> tuple[Any, ...]:
    """Nine real spherical harmonics up to order 2, orthonormal, without the phase (-1)^m, of unit vectors.

    Args:
      x, y, z: numbers or arrays, on the device, too.
    """
    straight, mixed = 0.4886025119, 1.0925484306
    ones = x * 0 + 0.2820947918
    return (
        *(ones, straight * y, straight * z, straight * x),
        *(mixed * x * y, mixed * y * z, 0.3153915653 * (3 * z * z - 1), mixed * x * z, mixed / 2 * (x * x - y * y)),
    )


def harmonics(normals: np.ndarray) -> np.ndarray:
    """(..., 9) spherical harmonics (`terms`) at unit vectors (..., 3)."""
    return np.stack(terms(*np.moveaxis(np.asarray(normals), -1, 0)), axis=-1)


FROM_NORMALS = 4 * np.pi / len(NORMALS) * harmonics(NORMALS).T
"""(9, 12) from values at `NORMALS` to coefficients."""


def lobed(coefficients: np.ndarray) -> np.ndarray:
    """(..., 9, c) coefficients of e, from those of the radiance that arrives."""
    return coefficients * LOBE[ORDERS][:, None]


def radiance(coefficients: np.ndarray) -> np.ndarray:
    """(..., 9, c) coefficients of the radiance that arrives, from those of e."""
    return coefficients / LOBE[ORDERS][:, None]


def turned(coefficients: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """The coefficients (..., 9, c) of the same light turned by `rotation` (3, 3): what n was, `rotation @ n` is now.

    A body of pose `rotation` sees a room's light in its own frame turned by `rotation.T`.
    """
    return (FROM_NORMALS @ harmonics(NORMALS @ np.asarray(rotation, float))) @ coefficients


@dataclass(frozen=True, eq=False)
class _Grid:
    """Numbers that `Probes.at` needs of a room's grid."""

    origin: np.ndarray
    step: np.ndarray
    last: np.ndarray
    """(3,) float, place of the highest corner, in steps."""
    lowest: np.ndarray
    """(3,) int, highest place of a cell's lowest corner."""
    strides: np.ndarray
    """(3,) int, between neighbours' numbers."""
    corners: np.ndarray
    """(8,) int, numbers of the first cell's corners."""
    nearest: Callable[[np.ndarray], np.ndarray]
    """From points (m, 3) to numbers (m,) of the nearest valid probes."""


@dataclass(frozen=True, eq=False)
class Probes:
    """Probes of all rooms of a house, n in all: room after room, in each with z fastest and x slowest."""

    rooms: np.ndarray
    """(r,) ids."""
    origin: np.ndarray
    """(r, 3) float64 of each grid's lowest corner, metres, world."""
    step: np.ndarray
    """(r, 3) float64 metres between neighbours."""
    counts: np.ndarray
    """(r, 3) int of probes along each axis."""
    coefficients: np.ndarray
    """(n, 9, 3) float16 of e."""
    valid: np.ndarray
    """(n,) bool; false in walls and things."""
    sight: np.ndarray
    """(n, 2, 3) uint8 centimetres to the first thing along +x, +y, +z and along -x, -y, -z; 255 for more."""

    @functools.cached_property
    def room(self) -> np.ndarray:
        """(n,) int, place of each probe's room in `rooms`."""
        return np.repeat(np.arange(len(self.rooms)), self.counts.prod(1))

    @functools.cached_property
    def position(self) -> np.ndarray:
        """(n, 3) float32 metres, world."""
        places = [np.array(list(np.ndindex(*c))) * s + o for o, s, c in zip(self.origin, self.step, self.counts)]
        return np.concatenate(places).astype(np.float32)

    def at(self, points: np.ndarray, room: str) -> np.ndarray:
        """(m, 9, 3) float32 coefficients of e at points (m, 3) of a room, which `embodied.house.shapes.room_at` tells.

        Trilinear among those of the probes around a point that are valid and see as far as to it along each axis;
        where there is none, the nearest valid one's. Beyond a room's grid light stays what it is at its edge.

        Raises:
          ValueError: the house has no such room.
        """
        if room not in self._grids:
            raise ValueError(f"the house has no room {room!r}; its rooms are {self.rooms.tolist()}")
        grid = self._grids[room]
        place = np.minimum(np.maximum((np.asarray(points, float) - grid.origin) / grid.step, 0.0), grid.last)
        low = np.minimum(place.astype(np.int64), grid.lowest)
        away = np.abs(CORNERS - (place - low)[:, None])
        near = (low @ grid.strides)[:, None] + grid.corners
        weights = (1 - away).prod(2) * (away * grid.step <= self._sight[near[..., None], CORNERS, AXES]).all(2)
        total = weights.sum(1)
        if (total < LEAST).any():
            lost = np.flatnonzero(total < LEAST)
            near[lost] = grid.nearest(grid.origin + place[lost] * grid.step)[:, None]
            weights[lost], total[lost] = 1.0, len(CORNERS)
        weights /= total[:, None]
        return (weights[:, None].astype(np.float32) @ self._table[near])[:, 0].reshape(-1, *self.coefficients.shape[1:])

    @functools.cached_property
    def _table(self) -> np.ndarray:
        """(n, 27) float32."""
        return self.coefficients.reshape(len(self.coefficients), -1).astype(np.float32)

    @functools.cached_property
    def _sight(self) -> np.ndarray:
        """(n, 2, 3) metres; below 0 for what is not valid."""
        return np.where(self.valid[:, None, None], np.where(self.sight == 255, 9.0, self.sight / 100 + SLACK), -1.0)

    @functools.cached_property
    def _grids(self) -> dict[str, _Grid]:
        firsts = np.cumsum(self.counts.prod(1)) - self.counts.prod(1)
        grids = zip(self.rooms.tolist(), firsts, self.origin, self.step, self.counts)
        return {room: self._grid(*numbers) for room, *numbers in grids}

    def _grid(self, first: int, origin: np.ndarray, step: np.ndarray, counts: np.ndarray) -> _Grid:
        strides = np.array([counts[1] * counts[2], counts[2], 1]) * (counts > 1)
        here = first + np.flatnonzero(self.valid[first : first + counts.prod()])
        tree = cKDTree(self.position[here])
        return _Grid(
            origin,
            step,
            counts - 1.0,
            np.maximum(counts - 2, 0),
            strides,
            first + CORNERS @ strides,
            lambda points: here[tree.query(points)[1]],
        )
