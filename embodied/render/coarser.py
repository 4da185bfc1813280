"""Coarser copies of meshes, for things that are small in a picture: what lies in one cell of a grid becomes one corner.

A cell is never wider than part of a pixel where its copy is drawn, so copies look like what they are copies of. Corners
whose surfaces face another way stay apart; where surface is lost all the same (thin bars, leaves of plants), there is
no copy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

CELLS = (0.004, 0.008, 0.016, 0.032)
"""Sides of the cells, metres."""
KEPT = 0.93
"""Share of a mesh's surface that a copy must have."""
WORTH = 0.7
"""Share of the triangles of the last copy above which another is not worth its memory."""
FEWEST = 48
"""Triangles of a mesh below which it needs no copies."""


@dataclass(frozen=True, eq=False)
class Corners:
    """Meshes, one after another."""

    xyz: np.ndarray
    """(n, 3) float32 metres."""
    uv: np.ndarray
    """(n, 2) float32."""
    mesh: np.ndarray
    """(n,) int, of which mesh a corner is."""
    faces: np.ndarray
    """(m, 3) int, into the corners, in the order of the meshes."""


@dataclass(frozen=True, eq=False)
class _Shape:
    """What all copies need to know of meshes."""

    place: np.ndarray
    """(n,) int: number of the place, of those of one mesh, where a corner lies."""
    xyz: np.ndarray
    """(p, 3) float64 of places."""
    mesh: np.ndarray
    """(p,) int of places."""
    facing: np.ndarray
    """(p,) int: which of six ways the surface faces there."""
    chart: np.ndarray
    """(n,) int: corners that are joined by faces have the same."""


def copies(meshes: Corners, count: int, wanted: np.ndarray) -> list[Corners]:
    """For each of CELLS the copies of those of `count` meshes that are worth one.

    Args:
      wanted: (count,) bool: of which meshes there may be copies.

    Source: J. Rossignac and P. Borrel, Multi-resolution 3D approximations for rendering complex scenes (1993); differs
    in that corners which face different ways stay apart.
    """
    most = np.bincount(meshes.mesh[meshes.faces[:, 0]], minlength=count)
    meshes = _some(meshes, wanted & (most >= FEWEST))
    shape, surface, made = _shape(meshes), _surface(meshes, count), []
    for cell in CELLS:
        copy = _clustered(meshes, shape, cell)
        faces = np.bincount(copy.mesh[copy.faces[:, 0]], minlength=count)
        good = (faces > 0) & (faces <= WORTH * most) & (_surface(copy, count) >= KEPT * surface)
        most = np.where(good, faces, most)
        made.append(_some(copy, good))
    return made


def _shape(meshes: Corners) -> _Shape:
    _, first, place = np.unique(_number(meshes.mesh, meshes.xyz.view(np.int32)), return_index=True, return_inverse=True)
    xyz, count = meshes.xyz[first].astype(float), len(first)
    a, b, c = meshes.xyz[meshes.faces].astype(float).swapaxes(0, 1)
    normal = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    at = place[meshes.faces].ravel()
    normals = np.stack([np.bincount(at, normal[:, k], count) for k in range(3)], axis=1)
    axis = np.abs(normals).argmax(1)
    facing = 2 * axis + (normals[np.arange(count), axis] > 0)
    joined = meshes.faces[:, [0, 1]], meshes.faces[:, [1, 2]]
    start, end = (np.concatenate([j[:, k] for j in joined]) for k in (0, 1))
    n = len(meshes.xyz)
    _, chart = connected_components(coo_array((np.ones(len(start), np.int8), (start, end)), (n, n)), directed=False)
    return _Shape(place, xyz, meshes.mesh[first], facing, chart)


def _clustered(meshes: Corners, shape: _Shape, cell: float) -> Corners:
    """Copies of all meshes with all that lies in one cell, and faces one way, drawn together to its middle."""
    cells = np.floor(shape.xyz / cell).astype(np.int64)
    _, cluster = np.unique(_number(shape.mesh * 6 + shape.facing, cells), return_inverse=True)
    middle = _means(cluster, shape.xyz)
    cluster = cluster[shape.place]
    _, first, corner = np.unique(
        cluster.astype(np.int64) * len(meshes.xyz) + shape.chart, return_index=True, return_inverse=True
    )
    faces, ends = corner[meshes.faces], cluster[meshes.faces]
    apart = (ends[:, 0] != ends[:, 1]) & (ends[:, 1] != ends[:, 2]) & (ends[:, 2] != ends[:, 0])
    faces, ends = faces[apart], ends[apart]
    turn = (ends.argmin(1)[:, None] + np.arange(3)) % 3
    _, once = np.unique(_number(np.zeros(len(ends), int), np.take_along_axis(ends, turn, 1)), return_index=True)
    faces = faces[np.sort(once)]
    return Corners(
        middle[cluster[first]].astype(np.float32),
        _means(corner, meshes.uv).astype(np.float32),
        meshes.mesh[first],
        faces,
    )


def _some(meshes: Corners, wanted: np.ndarray) -> Corners:
    """The meshes that are `wanted`, (count,) bool; their numbers stay."""
    faces = meshes.faces[wanted[meshes.mesh[meshes.faces[:, 0]]]]
    used, faces = np.unique(faces, return_inverse=True)
    return Corners(meshes.xyz[used], meshes.uv[used], meshes.mesh[used], faces.reshape(-1, 3))


def _surface(meshes: Corners, count: int) -> np.ndarray:
    """(count,) square metres."""
    a, b, c = meshes.xyz[meshes.faces].astype(float).swapaxes(0, 1)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return np.bincount(meshes.mesh[meshes.faces[:, 0]], areas, count)


def _means(group: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(groups, k) mean of `values` (n, k) by `group` (n,)."""
    sizes = np.bincount(group)
    return np.stack([np.bincount(group, v) for v in values.T], axis=1) / sizes[:, None]


def _number(one: np.ndarray, three: np.ndarray) -> np.ndarray:
    """(n,) uint64 that tell rows of `one` (n,) and `three` (n, 3) integers apart, but for one chance in a million."""
    mixed = np.asarray(one).astype(np.uint64)
    for column in three.T:
        mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9) + column.astype(np.int64).view(
            np.uint64
        )
    mixed = (mixed ^ (mixed >> np.uint64(32))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(29))
