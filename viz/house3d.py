"""The house as light meshes for the viewer: few triangles, colours in the vertices, no ceilings."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import fast_simplification
import numpy as np
import rerun as rr
from scipy.spatial import cKDTree

from embodied.assets.decoding import read_picture
from embodied.assets.people import people, posed
from embodied.assets.records import Finish, MeshPart
from embodied.geometry import rotation
from embodied.house.moment import Moment
from embodied.render.gloss import texels_at
from embodied.scene.house_meshes import Part
from embodied.scene.lit_pages import LitMesh, LitPages

BUDGET = 500
"""Triangles kept per mesh of an object; the shell is left as it is."""
FIGURES = 5
"""How much larger that budget is for people: faces and clothes have detail that furniture has not."""
PICTURE = 160
"""Longest side in pixels of the picture of a lit wall or floor."""


@dataclass(frozen=True, eq=False)
class LightMesh:
    """A mesh small enough for a recording, in world metres."""

    path: str
    """Entity path: 'house/<room>/<owner>'."""
    positions: np.ndarray
    """(n, 3) float32."""
    faces: np.ndarray
    """(m, 3) uint32."""
    colors: np.ndarray | None = None
    """(n, 4) uint8 sRGB."""
    normals: np.ndarray | None = None
    """(n, 3) float32, or None where the colours already hold the light."""
    uv: np.ndarray | None = None
    """(n, 2) float32, v down, of a wall or floor with its light as a picture."""
    picture: np.ndarray | None = None
    """(h, w, 3) uint8 sRGB."""


def light_meshes(parts: Sequence[Part], hidden: frozenset[str] = frozenset()) -> tuple[LightMesh, ...]:
    """One mesh per owner that can be seen from above: ceilings, the outdoors and the `hidden` owners are left out."""
    by_owner: dict[tuple[str, str], list[Part]] = {}
    for part in parts:
        if part.kind not in ("ceiling", "outdoor") and part.owner not in hidden:
            by_owner.setdefault((part.room, part.owner), []).append(part)
    reduced: dict[tuple[str, int], tuple] = {}
    meshes = []
    for (room, owner), group in by_owner.items():
        pieces = []
        for part in group:
            key = (part.mesh_key, id(part.mesh))
            if key not in reduced:
                whole = part.mesh.vertices, part.mesh.normals, vertex_colors(part.mesh), part.mesh.faces
                is_object = part.kind == "object"
                reduced[key] = _simplified(*whole, _share(owner, BUDGET, len(group))) if is_object else whole
            positions, normals, colors, faces = reduced[key]
            pieces.append((*_placed(positions, normals, part), colors, faces))
        meshes.append(_joined(f"house/{room or 'shared'}/{owner.split('/')[-1]}", pieces))
    return tuple(meshes)


def log_meshes(recording: rr.RecordingStream, meshes: Sequence[LightMesh], *, static: bool = True) -> None:
    """Log a house once, for all times, or what is somewhere now."""
    for mesh in meshes:
        shape: dict[str, Any] = {"vertex_positions": mesh.positions, "triangle_indices": mesh.faces}
        shape |= {"vertex_normals": mesh.normals, "vertex_texcoords": mesh.uv}
        drawn = rr.Mesh3D(**shape, vertex_colors=mesh.colors, albedo_texture=mesh.picture)
        recording.log(mesh.path, drawn, static=static)


def log_people(recording: rr.RecordingStream, moment: Moment) -> None:
    """Log who moves about, as they are now."""
    for name, f in moment.people.items():
        parts, turn = posed(people()[f.person], f.pose, 1), f.place.rotation.T
        pieces = [(f.place.points(p.vertices), p.normals @ turn, vertex_colors(p), p.faces) for p in parts]
        log_meshes(recording, [_joined(f"people/{name}", pieces)], static=False)


def lit_meshes(lit: LitPages, hidden: frozenset[str] = frozenset()) -> tuple[LightMesh, ...]:
    """The same from baked pages: objects with colours in their vertices, walls and floors with light as a picture."""
    by_owner: dict[tuple[str, str, bool], list[LitMesh]] = {}
    for mesh in lit.meshes:
        if mesh.kind not in ("ceiling", "outdoor") and mesh.owner not in hidden:
            by_owner.setdefault((mesh.room, mesh.owner, mesh.kind in ("floor", "wall")), []).append(mesh)
    meshes: list[LightMesh] = []
    for (room, owner, flat), group in by_owner.items():
        path = f"house/{room or 'shared'}/{owner.split('/')[-1]}"
        if flat:
            meshes += [_surface(f"{path}/{i}" if i else path, m, lit.pages[m.page]) for i, m in enumerate(group)]
        else:
            pieces = [_lit_piece(m, lit.pages[m.page], _share(owner, 2 * BUDGET, len(group))) for m in group]
            meshes.append(_joined(path, pieces, shaded=False))
    return tuple(meshes)


def _surface(path: str, mesh: LitMesh, page: np.ndarray) -> LightMesh:
    """A wall or floor with its own part of the page, at most PICTURE pixels wide or high."""
    height, width = page.shape[:2]
    low = np.floor(mesh.uv.min(axis=0) * [width, height]).astype(int).clip(0)
    high = np.maximum(np.ceil(mesh.uv.max(axis=0) * [width, height]).astype(int), low + 1)
    part = page[low[1] : high[1], low[0] : high[0]]
    scale = min(PICTURE / max(part.shape[:2]), 1.0)
    size = tuple(max(round(n * scale), 1) for n in part.shape[1::-1])
    uv = (mesh.uv * [width, height] - low) / (high - low)
    picture = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
    return LightMesh(path, mesh.vertices, mesh.faces.astype(np.uint32), uv=uv.astype(np.float32), picture=picture)


def _share(owner: str, budget: int, meshes: int) -> int:
    """Triangles for each of an owner's meshes."""
    return budget * (FIGURES if owner.split("/")[-1].startswith("person_") else 1) // meshes


SPOTS = np.array([(1, 1, 1), (4, 1, 1), (1, 4, 1), (1, 1, 4), (2, 2, 1), (2, 1, 2), (1, 2, 2)], np.float32)
"""Spots in a face where its colour is read, barycentric up to scale: never on its rim, beside which a page may hold
something else."""


def _lit_piece(mesh: LitMesh, page: np.ndarray, budget: int) -> tuple:
    """Vertices, normals, colours and faces of one mesh with the light of its page in the colours.

    A vertex has the mean colour of the faces around it.
    """
    at = np.einsum("sk,mkc->smc", SPOTS / SPOTS.sum(1, keepdims=True), mesh.uv[mesh.faces])  # (7, m, 2)
    of_face = texels_at(page, at).astype(np.float32).mean(axis=0)  # (m, 3)
    corner, count = mesh.faces.ravel(), np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices)).clip(1)
    sums = np.stack([np.bincount(corner, np.repeat(of_face[:, c], 3), len(mesh.vertices)) for c in range(3)], 1)
    colors = np.full((len(mesh.vertices), 4), round(255 * mesh.alpha), np.uint8)
    colors[:, :3] = np.round(sums / count[:, None])
    return _simplified(mesh.vertices, np.zeros_like(mesh.vertices), colors, mesh.faces, budget)


def _placed(positions: np.ndarray, normals: np.ndarray, part: Part) -> tuple[np.ndarray, np.ndarray]:
    turn = np.eye(3, dtype=np.float32)
    turn[:2, :2] = rotation(part.yaw)
    return positions @ turn.T + np.asarray(part.position, np.float32), normals @ turn.T


def _joined(path: str, pieces: Sequence[tuple], shaded: bool = True) -> LightMesh:
    starts = np.cumsum([0, *(len(p[0]) for p in pieces[:-1])])
    faces = np.concatenate([p[3] + s for p, s in zip(pieces, starts)]).astype(np.uint32)
    positions, normals, colors = (np.concatenate([p[i] for p in pieces]) for i in range(3))
    return LightMesh(path, positions.astype(np.float32), faces, colors, normals.astype(np.float32) if shaded else None)


def _simplified(vertices: np.ndarray, normals: np.ndarray, colors: np.ndarray, faces: np.ndarray, budget: int) -> tuple:
    """A mesh with at most about `budget` triangles; new vertices take normal and colour of the nearest old one."""
    budget = max(budget, 12)
    if len(faces) <= budget:
        return vertices, normals, colors, faces
    points, fewer = fast_simplification.simplify(
        np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(faces, np.int32), target_count=budget, agg=5.0
    )
    if len(fewer) == 0:
        return vertices, normals, colors, faces
    nearest = cKDTree(vertices).query(points)[1]
    return points, normals[nearest], colors[nearest], fewer


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
    image = read_picture(path)
    if image is None:
        raise ValueError(f"texture {path} cannot be read; delete the cache folder and run again")
    return cv2.cvtColor(cv2.resize(image, (32, 32), interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2RGB)
