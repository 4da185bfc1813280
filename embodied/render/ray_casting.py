"""Depth and instance ids by MuJoCo's ray caster, for machines without OpenGL."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from embodied import gl

gl.prepare()

import mujoco
import numpy as np

from embodied.house.house import House
from embodied.render.camera import FAR_PLANE
from embodied.render.panorama import face_rays, ray_stretch
from embodied.scene.model import VISUAL, compile_scene

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue


class RayCaster:
    """A compiled house that rays are cast in, one through the middle of every pixel: what a Renderer sees but for
    pixels at edges, in 0.02 to 0.04 ms a pixel."""

    def __init__(self, house: House, catalogue: Catalogue) -> None:
        self._scene = compile_scene(house, catalogue, collisions=False)
        self._data = mujoco.MjData(self._scene.model)
        mujoco.mj_forward(self._scene.model, self._data)

    def seen(self, position: Sequence[float] | np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
        """Depth and ids of the six cube faces around `position` (x, y, z), as of `Renderer.seen`: (6, s, s) float32
        metres along the optical axis, (6, s, s) int32."""
        shape, count = (6, size, size), 6 * size * size
        rays, groups = face_rays(size).astype(float).ravel(), np.zeros(6, np.uint8)
        groups[VISUAL] = 1
        geoms, distances = np.empty(count, np.int32), np.empty(count)
        eye = np.array(position, float)
        mujoco.mj_multiRay(
            self._scene.model, self._data, eye, rays, groups, 1, -1, geoms, distances, None, count, FAR_PLANE
        )
        met = geoms >= 0
        ids = np.where(met, self._scene.owner_of_geom[geoms], 0).astype(np.int32).reshape(shape)
        depth = np.where(met, distances, np.inf).reshape(shape) / ray_stretch(size)
        return depth.astype(np.float32), ids
