"""What windows show: a dome with the painted outdoors, and the house's own outer parts, simply lit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from embodied.house import House
from embodied.light.sky import Outdoors
from embodied.light.tone import Exposure, display
from embodied.light.unwrap import face_normals
from embodied.lit import LitMesh

RADIUS = 70.0
"""Metres to the dome."""
DOME = "outdoor/sky"
"""Owner of the dome; no instance id belongs to it."""


def surroundings(house: House, catalogue, outdoors: Outdoors, exposure: Exposure, read: Callable[[str], np.ndarray],
                 first: int) -> tuple[list[LitMesh], list[np.ndarray]]:
    """Meshes and pages of everything outdoors.

    Args:
      first: number of the first new page.
    """
    dome = dome_mesh(house, first)
    gain = exposure.outdoors.astype(np.float32)
    return [dome], [display(outdoors.picture, gain)]


def dome_mesh(house: House, page: int, rows: int = 24) -> LitMesh:
    """A sphere around the house that wears the picture of the outdoors on its inside."""
    corners = np.array([c for r in house.rooms for c in r.polygon])
    centre = np.array([*(corners.min(0) + corners.max(0)) / 2, 1.6])
    v, u = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, 2 * rows + 1), indexing="ij")
    elevation, yaw = (0.5 - v) * np.pi, np.pi * (1 - 2 * u)
    d = np.stack([np.cos(elevation) * np.cos(yaw), np.cos(elevation) * np.sin(yaw), np.sin(elevation)], axis=-1)
    i = np.arange(rows)[:, None] * (2 * rows + 1) + np.arange(2 * rows)[None]
    a, b, c, e = i, i + 1, i + 2 * rows + 2, i + 2 * rows + 1
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, e], -1).reshape(-1, 3)])
    vertices = (centre + RADIUS * d).reshape(-1, 3).astype(np.float32)
    inward = (face_normals(vertices[faces].astype(float)) * (centre - vertices[faces].mean(1))).sum(1)
    faces = np.where((inward < 0)[:, None], faces[:, ::-1], faces)
    size = vertices[faces]
    real = np.linalg.norm(np.cross(size[:, 1] - size[:, 0], size[:, 2] - size[:, 0]), axis=1) > 1e-4
    uv = np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32)
    return LitMesh(DOME, "outdoor", "", page, vertices, faces[real].astype(np.int32), uv)
