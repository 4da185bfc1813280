"""Sightings: which objects can be seen from a node, where and how large. Cheap, from a small id picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from embodied.house.house import House
from embodied.interface import Sighting
from embodied.render.panorama import face_rays, ray_stretch

FACE = 64
"""Side in pixels of the cube faces that sightings are counted on; a pixel spans about 1.4 degrees."""


@dataclass(frozen=True, eq=False)
class SightingTable:
    """All sightings of a house: (n,) arrays that share an index, sorted by node, then by falling pixels."""

    node: np.ndarray
    owner: np.ndarray
    """int32 index into house.placements."""
    yaw: np.ndarray
    pitch: np.ndarray
    distance: np.ndarray
    pixels: np.ndarray

    def __post_init__(self) -> None:
        if len({len(column) for column in vars(self).values()}) != 1:
            raise ValueError("the columns of sightings should be of one length")

    def at(self, node: int, house: House) -> tuple[Sighting, ...]:
        """The sightings of one node, the largest first."""
        first, last = np.searchsorted(self.node, [node, node + 1])
        return tuple(
            Sighting(house.placements[o].id, house.placements[o].object_class, float(y), float(p), float(d), int(n))
            for o, y, p, d, n in zip(*(getattr(self, name)[first:last] for name in SIGHTING_COLUMNS[1:]), strict=True)
        )


SIGHTING_COLUMNS = ("node", "owner", "yaw", "pitch", "distance", "pixels")


def sightings_table(pictures: Sequence[tuple[np.ndarray, np.ndarray]], placements: int) -> SightingTable:
    """Count what each node sees.

    Args:
      pictures: per node depth (6, s, s) metres along the axis, and ids (6, s, s), as Renderer.seen gives them.
      placements: number of placements; ids above it belong to the shell and are not counted.
    """
    rows = [_rows(node, depth, ids, placements) for node, (depth, ids) in enumerate(pictures)]
    columns = [np.concatenate([r[i] for r in rows]) if rows else np.zeros(0) for i in range(len(SIGHTING_COLUMNS))]
    kinds = (np.int32, np.int32, np.float32, np.float32, np.float32, np.int32)
    return SightingTable(*(c.astype(k) for c, k in zip(columns, kinds, strict=True)))


def _rows(node: int, depth: np.ndarray, ids: np.ndarray, placements: int) -> tuple[np.ndarray, ...]:
    s = ids.shape[1]
    owned = (ids > 0) & (ids <= placements) & np.isfinite(depth)
    who = ids[owned] - 1
    rays, lengths = face_rays(s)[owned], (depth * ray_stretch(s))[owned]
    angle = ray_stretch(s)[None].repeat(6, axis=0)[owned] ** -3.0  # solid angle of a cube-face pixel falls as cos^3
    pixels = np.bincount(who, minlength=placements)
    direction = np.stack([np.bincount(who, rays[:, i] * angle, placements) for i in range(3)], axis=1)
    distance = np.bincount(who, lengths, placements) / np.maximum(pixels, 1)
    order = np.argsort(-pixels, kind="stable")
    order = order[: np.count_nonzero(pixels)]
    x, y, z = direction[order].T
    azimuth, elevation = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
    return np.full(len(order), node), order, azimuth, elevation, distance[order], pixels[order]
