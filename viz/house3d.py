"""The house as light meshes for the viewer: few triangles, colours in the vertices, no ceilings."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import fast_simplification
import numpy as np
import rerun as rr

from assets.records import Finish, MeshPart
from embodied.geometry import rotation
from embodied.parts import Part

BUDGET = 500
"""Triangles kept per mesh of an object; the shell is left as it is."""
SHELL_CELL = 0.12
"""Side in metres of the grid on which a lit wall or floor carries its colours."""


@dataclass(frozen=True, eq=False)
class LightMesh:
    """A mesh small enough for a recording, in world metres."""

    path: str
    """Entity path: 'house/<room>/<owner>'."""
    positions: np.ndarray
    """(n, 3) float32."""
    faces: np.ndarray
    """(m, 3) uint32."""
    colors: np.ndarray
    """(n, 4) uint8 sRGB."""
    normals: np.ndarray | None
    """(n, 3) float32, or None where the colours already hold the light."""


def light_meshes(parts: Sequence[Part], budget: int = BUDGET) -> tuple[LightMesh, ...]:
    """One mesh per owner that can be seen from above: ceilings and the outdoors are left out."""
    by_owner: dict[tuple[str, str], list[Part]] = {}
    for part in parts:
        if part.kind not in ("ceiling", "outdoor"):
            by_owner.setdefault((part.room, part.owner), []).append(part)
    reduced: dict[tuple[str, int], tuple] = {}
    meshes = []
    for (room, owner), group in by_owner.items():
        pieces = []
        for part in group:
            key = (part.mesh_key, id(part.mesh))
            if key not in reduced:
                reduced[key] = _reduce(part.mesh, budget // len(group) if part.kind == "object" else None)
            positions, normals, colors, faces = reduced[key]
            pieces.append((*_placed(positions, normals, part), colors, faces))
        meshes.append(_joined(f"house/{room or 'shared'}/{owner.split('/')[-1]}", pieces))
    return tuple(meshes)


def log_house(recording: rr.RecordingStream, meshes: Sequence[LightMesh]) -> None:
    """Log the house once, for all times."""
    for mesh in meshes:
        recording.log(
            mesh.path,
            rr.Mesh3D(
                vertex_positions=mesh.positions, triangle_indices=mesh.faces,
                vertex_colors=mesh.colors, vertex_normals=mesh.normals,
            ),
            static=True,
        )


def _placed(positions: np.ndarray, normals: np.ndarray, part: Part) -> tuple[np.ndarray, np.ndarray]:
    turn = np.eye(3, dtype=np.float32)
    turn[:2, :2] = rotation(part.yaw)
    return positions @ turn.T + np.asarray(part.position, np.float32), normals @ turn.T


def _joined(path: str, pieces: Sequence[tuple]) -> LightMesh:
    starts = np.cumsum([0, *(len(p[0]) for p in pieces[:-1])])
    faces = np.concatenate([p[3] + s for p, s in zip(pieces, starts)]).astype(np.uint32)
    positions, normals, colors = (np.concatenate([p[i] for p in pieces]) for i in range(3))
    return LightMesh(path, positions.astype(np.float32), faces, colors, normals.astype(np.float32))


def _reduce(mesh: MeshPart, budget: int | None) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, normals, colours and faces with at most about `budget` triangles."""
    colors = vertex_colors(mesh)
    if budget is None or len(mesh.faces) <= max(budget, 12):
        return mesh.vertices, mesh.normals, colors, mesh.faces
    points, faces = fast_simplification.simplify(
        np.ascontiguousarray(mesh.vertices, np.float32), np.ascontiguousarray(mesh.faces, np.int32),
        target_count=max(budget, 12), agg=5.0,
    )
    if len(faces) == 0:
        return mesh.vertices, mesh.normals, colors, mesh.faces
    nearest = _nearest(mesh.vertices, points)
    return points, mesh.normals[nearest], colors[nearest], faces


def _nearest(points: np.ndarray, queries: np.ndarray) -> np.ndarray:
    from scipy.spatial import cKDTree

    return cKDTree(points).query(queries)[1]


def vertex_colors(mesh: MeshPart) -> np.ndarray:
    """(n, 4) uint8 colours of a mesh: its texture read at the vertices, or its plain colour."""
    finish: Finish = mesh.finish
    plain = np.round(np.clip(finish.color, 0, 1) * np.array(255)).astype(np.uint8)
    colors = np.tile(plain, (len(mesh.vertices), 1))
    if finish.texture is not None:
        texture = _blurred(finish.texture)
        height, width = texture.shape[:2]
        column = np.floor(mesh.uv[:, 0] % 1.0 * width).astype(int) % width
        row = np.floor((1.0 - mesh.uv[:, 1]) % 1.0 * height).astype(int) % height
        colors[:, :3] = texture[row, column]
    return colors


@functools.lru_cache(maxsize=512)
def _blurred(path: str) -> np.ndarray:
    """The texture at 32 px, so that a vertex shows the colour around it. (h, w, 3) RGB."""
    image = cv2.imread(path, cv2.IMREAD_COLOR)
    if image is None:
        raise ValueError(f"texture {path} cannot be read; delete the cache folder and run again")
    return cv2.cvtColor(cv2.resize(image, (32, 32), interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2RGB)
