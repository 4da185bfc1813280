"""Coarser copies of meshes, for things that are small in a picture: what lies in one cell of a grid becomes one corner.

A cell is never wider than part of a pixel where its copy is drawn, so copies look like what they are copies of. Corners
whose surfaces face another way stay apart; where surface is lost all the same (thin bars, leaves of plants), there is
no copy.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Normals: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]
COPY_CELLS = (0.004, 0.008, 0.016, 0.032)
"""Sides of the cells, metres, each twice the last: what lies in one cell lies in one of every wider kind."""
SURFACE_KEPT = 0.93
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
    """Facts about meshes that all copies need."""

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


@dataclass(frozen=True, eq=False)
class _Groups:
    """Meshes that are drawn together; by copies with wider cells, too."""

    cluster: np.ndarray
    """(p,) int of places."""
    corner: np.ndarray
    """(n,) int: number of the copy's corner that each corner becomes."""
    place: np.ndarray
    first: np.ndarray
    """One place of each cluster, and one corner of each of the copy's corners."""
    faces: np.ndarray
    """(m, 3) int, into the corners before: what is left of the faces."""


def copies(meshes: Corners, count: int, wanted: np.ndarray) -> list[Corners]:
    """For each of COPY_CELLS the copies of those of `count` meshes that are worth one.

    Args:
      wanted: (count,) bool: of which meshes there may be copies.

    Source: J. Rossignac and P. Borrel, Multi-resolution 3D approximations for rendering complex scenes (1993); differs
    in that corners which face different ways stay apart.
    """
    most = np.bincount(meshes.mesh[meshes.faces[:, 0]], minlength=count)
    meshes = _some(meshes, wanted & (most >= FEWEST))
    across = normals(meshes.xyz, meshes.faces)
    shape, surface, made = _shape(meshes, across), _surface(meshes, across, count), []
    places, corners = np.arange(len(shape.xyz)), np.arange(len(meshes.xyz))
    groups = _Groups(places, corners, places, corners, meshes.faces)
    for cell in COPY_CELLS:
        groups = _clustered(groups, meshes, shape, cell)
        copy = _copy(groups, meshes, shape)
        faces = np.bincount(copy.mesh[copy.faces[:, 0]], minlength=count)
        good = (
            (faces > 0)
            & (faces <= WORTH * most)
            & (_surface(copy, normals(copy.xyz, copy.faces), count) >= SURFACE_KEPT * surface)
        )
        most = np.where(good, faces, most)
        made.append(_some(copy, good))
    return made


def _shape(meshes: Corners, across: Normals) -> _Shape:
    _, first, place = np.unique(_number(meshes.mesh, meshes.xyz.view(np.int32)), return_index=True, return_inverse=True)
    xyz, count = meshes.xyz[first].astype(float), len(first)
    at = place[meshes.faces].ravel()
    sums = [np.bincount(at, np.repeat(n, 3), count) for n in across]
    axis = np.abs(sums).argmax(0)
    facing = 2 * axis + (np.choose(axis, sums) > 0)
    joined = meshes.faces[:, [0, 1]], meshes.faces[:, [1, 2]]
    start, end = (np.concatenate([j[:, k] for j in joined]) for k in (0, 1))
    n = len(meshes.xyz)
    _, chart = connected_components(coo_array((np.ones(len(start), np.int8), (start, end)), (n, n)), directed=False)
    return _Shape(place, xyz, meshes.mesh[first], facing, chart)


def _clustered(groups: _Groups, meshes: Corners, shape: _Shape, cell: float) -> _Groups:
    """Groups of all that lies in one cell and faces one way, made of those of narrower cells."""
    key = _number((shape.mesh * 6 + shape.facing)[groups.place], np.floor(shape.xyz[groups.place] / cell).astype(int))
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    place, cluster = groups.place[first], which[groups.cluster]
    key = cluster[shape.place[groups.first]].astype(np.int64) * len(meshes.xyz) + shape.chart[groups.first]
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    ends = cluster[shape.place][groups.faces]
    a, b, c = ends.T
    apart = (a != b) & (b != c) & (c != a)
    ends = ends[apart]
    turn = (ends.argmin(1)[:, None] + np.arange(3)) % 3
    _, once = np.unique(_number(np.zeros(len(ends), int), np.take_along_axis(ends, turn, 1)), return_index=True)
    faces = groups.faces[apart][np.sort(once)]
    return _Groups(cluster, which[groups.corner], place, groups.first[first], faces)


def _copy(groups: _Groups, meshes: Corners, shape: _Shape) -> Corners:
    """All meshes with every group drawn together to its middle."""
    middle = _means(groups.cluster, shape.xyz)
    return Corners(
        middle[groups.cluster[shape.place[groups.first]]].astype(np.float32),
        _means(groups.corner, meshes.uv).astype(np.float32),
        meshes.mesh[groups.first],
        groups.corner[groups.faces],
    )


def _some(meshes: Corners, wanted: np.ndarray) -> Corners:
    """The meshes that are `wanted`, (count,) bool; their numbers stay."""
    faces = meshes.faces[wanted[meshes.mesh[meshes.faces[:, 0]]]]
    used = np.zeros(len(meshes.xyz), bool)
    used[faces] = True
    return Corners(meshes.xyz[used], meshes.uv[used], meshes.mesh[used], (np.cumsum(used) - 1)[faces])


def _surface(meshes: Corners, across: Normals, count: int) -> np.ndarray:
    """(count,) square metres."""
    x, y, z = across
    return np.bincount(meshes.mesh[meshes.faces[:, 0]], np.sqrt(x * x + y * y + z * z) / 2, count)


def normals(xyz: np.ndarray, faces: np.ndarray) -> Normals:
    """x, y and z, (m,) float64 each, of the normals of triangles `faces` (m, 3), as long as twice their areas."""
    a, b, c = xyz.astype(float)[faces].swapaxes(0, 1)
    x, y, z = np.cross(b - a, c - a).T
    return x, y, z


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
