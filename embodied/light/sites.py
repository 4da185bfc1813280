"""Sites: one luxel in every few, where smooth light is computed, and how the others take theirs from them.

Indirect light varies slowly along a surface, and so does direct light away from the edges of shadows. Irradiance is
computed at sites and interpolated between them (Ward, Rubinstein and Clear 1988, A Ray Tracing Solution for Diffuse
Interreflection, sec. 3); here sites are spread evenly over every surface instead of being found one by one, so that
all of them are computed at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from embodied.light.arrays import Array
from embodied.light.backend import array, drjit, floats, mitsuba, vector, wholes
from embodied.light.denoise import LAYER, neighbours

if TYPE_CHECKING:
    from embodied.light.solve import Luxels

AROUND = 10
"""Sites that a luxel may take its light from: its own and the nearest ones of that on the same layer."""
REACH = 1.6
"""How far a site's light reaches, in distances between sites."""

ALIKE = 0.6
"""Cells of few luxels take another one's site that faces their way up to this cosine: half of all cells lie at the
rims of small things, where a site serves one luxel."""
OWNERS = 1000.0
"""Metres put between owners, so that a rug and the floor below it are no neighbours."""
LAYERS = 4
"""Sheets closer together than a site's cell over this share one."""


@dataclass(frozen=True, eq=False)
class Sites:
    """k of n luxels, and which of them lie around each."""

    luxel: np.ndarray
    """(k,) int64, in rising order of nothing in particular."""
    own: np.ndarray
    """(n,) int32, the site in whose cell a luxel lies."""
    around: np.ndarray
    """(k, AROUND) int32, itself first."""
    spacing: np.ndarray
    """(k,) float32 metres between neighbouring sites."""
    position: np.ndarray
    normal: np.ndarray
    """(k, 3) float32."""
    apart: np.ndarray
    """(k, 3) float64, position with every owner's sites far from all others'."""


def sites_of(lux: Luxels, every: float, *, few: int = 2, things: float = 1.0) -> Sites:
    """Sites for luxels, one in every cell of a grid in space, for each facing; cells of few luxels are their
    neighbours'.

    Args:
      every: luxels between neighbouring sites, along each axis.
      few: luxels of a cell that takes a neighbour's site; 0 for none.
      things: times `every` on what is neither wall nor floor nor ceiling.
    """
    position, normal, side, owner = lux.position, lux.normal, np.sqrt(lux.area), lux.owner
    size = np.zeros(int(owner.max()) + 1)
    count = np.maximum(np.bincount(owner, minlength=len(size)), 1)
    size = (every * np.bincount(owner, weights=side, minlength=len(size)) / count)[owner].astype(np.float32)
    size = np.where(lux.shell, size, size * np.float32(things))
    cell = np.floor(position / size[:, None] + 0.37)
    above = ((position - (cell + 0.13) * size[:, None]) * normal).sum(1) / size  # tells the layers of one cell apart
    parts = [*cell.astype(np.int64).T % 1021, *(np.round(normal * 1.4).astype(np.int64).T + 1)]
    key = owner.astype(np.int64) * 16 + np.floor(above * LAYERS + 0.41).astype(np.int64) + 8
    for part, most in zip(parts, (1021, 1021, 1021, 3, 3, 3)):
        key = key * most + part
    _, own = np.unique(key, return_inverse=True)
    own = own.reshape(-1).astype(np.int32)
    members = np.bincount(own)
    middle = np.stack([np.bincount(own, weights=position[:, k]) for k in range(3)], 1) / members[:, None]
    off = ((position - middle[own]) ** 2).sum(1)
    order = np.lexsort((off, own))
    luxel = order[np.cumsum(members) - members]
    apart = position[luxel] + owner[luxel, None] * np.array([OWNERS, 0.0, 0.0])
    whose = _joined(apart, normal[luxel], size[luxel], members <= few)
    kept = np.unique(whose)
    own, luxel, apart = np.searchsorted(kept, whose[own]).astype(np.int32), luxel[kept], apart[kept]
    facing, all_ = normal[luxel], np.ones(len(luxel), bool)
    around = neighbours(apart, facing, all_, all_, AROUND, asked=2)
    return Sites(luxel, own, around, size[luxel], position[luxel], facing, apart)


def _joined(apart: np.ndarray, facing: np.ndarray, size: np.ndarray, small: np.ndarray) -> np.ndarray:
    """(c,) int64: for each cell the one whose site it takes: a larger one of the same facing on the same layer within
    a cell's size, where it is small itself and there is such a one.

    Args:
      apart, facing: (c, 3) of the cells' sites. size: (c,) metres. small: (c,) bool.
    """
    whose = np.arange(len(small))
    if small.all() or not small.any():
        return whose
    mine = np.nonzero(small)[0]
    near = neighbours(apart, facing, ~small, small, 1, asked=4)[:, 0]
    gap = apart[near] - apart[mine]
    far, off = np.linalg.norm(gap, axis=1), np.abs((gap * facing[mine]).sum(1))
    fits = (far < size[mine]) & ((facing[near] * facing[mine]).sum(1) > ALIKE) & (off < LAYER[0] * far + LAYER[1])
    whose[mine[fits]] = near[fits]
    return whose


def around_good(sites: Sites, good: np.ndarray) -> Sites:
    """The same sites, of which those with few good ones around know the nearest good ones instead."""
    lonely = good[sites.around].sum(1) < 3
    if not lonely.any() or not good.any():
        return sites
    around = sites.around.copy()
    around[lonely] = neighbours(sites.apart, sites.normal, good, lonely, AROUND)
    return replace(sites, around=around)


class Spread:
    """Carries values from sites to luxels, on the device."""

    def __init__(self, sites: Sites, position: np.ndarray, normal: np.ndarray, good: np.ndarray) -> None:
        """`position` and `normal`, (n, 3), of all luxels; `good`, (k,) bool, sites whose light counts where there are
        any."""
        self._sites, self._position, self._normal = sites, position, normal
        self._around = wholes(sites.around)
        self._places, self._facing = floats(sites.position), floats(sites.normal)
        self._reach, self._trust = floats(sites.spacing * REACH), floats(np.where(good, 1.0, 1e-3))

    def __call__(self, values: np.ndarray, i: np.ndarray | None = None) -> np.ndarray:
        """Values (k, 3) of sites at luxels `i` (all by default): (m, 3) float32."""
        mi, dr = mitsuba(), drjit()
        table, total, weight = (floats(values), mi.Color3f(0.0), mi.Float(0.0))
        for site, w in self._weights(i):
            total += dr.gather(mi.Color3f, table, site) * w
            weight += w
        return array(total / weight)

    def moments(self, values: np.ndarray, i: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation (m,) of numbers (k,) among the sites that luxels `i` take their light from."""
        mi, dr = mitsuba(), drjit()
        table = floats(values)
        total, squares, weight = mi.Float(0.0), mi.Float(0.0), mi.Float(0.0)
        for site, w in self._weights(i):
            v = dr.gather(mi.Float, table, site)
            total += v * w
            squares += v * v * w
            weight += w
        mean = total / weight
        spread = dr.sqrt(dr.maximum(squares / weight - dr.square(mean), 0.0))
        dr.eval(mean, spread)
        return np.array(mean), np.array(spread)

    def most_apart(self, values: np.ndarray) -> np.ndarray:
        """(k,) that the standard deviation of `moments` of numbers (k,) stays under, for the luxels of each site: half
        of the range (Popoviciu's inequality)."""
        around = values[self._sites.around]
        return np.ptp(around, axis=1) / 2

    def _weights(self, which: np.ndarray | None) -> Iterator[tuple[Array, Array]]:
        mi, dr = mitsuba(), drjit()
        i: Any = slice(None) if which is None else which
        own = wholes(self._sites.own[i])
        p, n = vector(self._position[i]), vector(self._normal[i])
        reach = dr.gather(mi.Float, self._reach, own)
        for k in range(self._sites.around.shape[1]):
            site = dr.gather(mi.UInt32, self._around, own * self._sites.around.shape[1] + k)
            gap = dr.gather(mi.Vector3f, self._places, site) - p
            near = dr.maximum(1 - dr.squared_norm(gap) / dr.square(reach), 0.0)
            alike = dr.maximum(dr.dot(dr.gather(mi.Vector3f, self._facing, site), n), 0.0)
            off = dr.abs(dr.dot(gap, n)) / reach
            layer = dr.exp(-dr.square(off * 4.0))
            far = 1e-4 * (alike + 0.01) / dr.square(1 + dr.squared_norm(gap) / dr.square(reach))
            near = dr.square(near) * dr.square(dr.square(alike)) * layer
            yield site, (near + far) * dr.gather(mi.Float, self._trust, site)
