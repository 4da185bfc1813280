"""Geoms: a house drawn by MuJoCo's own renderer, which tells apart what it draws by painting each in its number; and
depth and instance ids by its ray caster, for machines without OpenGL."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from embodied import gl

gl.prepare()

import cv2
import mujoco
import numpy as np

from embodied.geometry import rotation
from embodied.house.house import House
from embodied.render.camera import FAR_PLANE, NEAR_PLANE, Camera, Pixels, Planes
from embodied.render.panorama import face_rays, ray_stretch
from embodied.scene.model import VISUAL, Scene, compile_scene

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue

HIDDEN = 5
"""Geom group of what is left out."""
PERSON_PIXELS = (0.005, 0.014)
"""Metres on a person that a pixel is wide from which on details 1 and 2 are drawn."""
NUMBERS = [mujoco.mjtRndFlag.mjRND_SEGMENT.value, mujoco.mjtRndFlag.mjRND_IDCOLOR.value]
"""Flags of a scene that paint every geom in its number's colour."""


class Geoms:
    """Owns the textures and display lists of a compiled house until `close`. Has what `raster.Raster` has."""

    def __init__(self, scene: Scene, buffer: tuple[int, int], samples: int) -> None:
        """
        Args:
          buffer: (height, width), pixels, of the first off-screen buffer; it grows when needed.
          samples: of a pixel.
        """
        self._scene, self._buffer = scene, buffer
        model = scene.model
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        model.vis.quality.offsamples = samples
        model.vis.global_.offheight, model.vis.global_.offwidth = buffer
        self._mjr = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._mjr)
        self._mjr.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._drawn = mujoco.MjvScene(model, maxgeom=model.ngeom + 16)
        for name in ("SHADOW", "REFLECTION", "FOG", "HAZE"):
            self._drawn.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{name}")] = 0
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[VISUAL] = 1
        self._camera, self._perturb = mujoco.MjvCamera(), mujoco.MjvPerturb()
        self._groups = model.geom_group.copy()
        self.middles, self.reaches = world_boxes(model, self._data)
        self._rest = model.geom_pos.copy(), model.geom_quat.copy()
        copied = sorted({*scene.owner_of_geom[self._groups < VISUAL]} - {0})
        whose = lambda owner, group: np.flatnonzero((scene.owner_of_geom == owner) & (self._groups == group))
        self._copies = [[whose(owner, VISUAL - detail) for detail in range(3)] for owner in copied]
        """By person and detail, geoms."""

    def turn(self, turns: Mapping[str, tuple[np.ndarray, float]]) -> None:
        """Turn geoms about vertical axes from where they were at first; those that are not named go back there.

        Args:
          turns: by geom, (3,) a point of the axis, metres, world, and radians counter-clockwise.
        """
        model = self._scene.model
        model.geom_pos[:], model.geom_quat[:] = self._rest
        for name, (pivot, angle) in turns.items():
            geom = model.geom(name)
            geom.pos[:2] = pivot[:2] + rotation(angle) @ (geom.pos[:2] - pivot[:2])
            mujoco.mju_mulQuat(geom.quat, [math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)], geom.quat.copy())
        mujoco.mj_kinematics(model, self._data)
        self.middles, self.reaches = world_boxes(model, self._data)

    def rgb(self, camera: Camera, size: Pixels, chosen: np.ndarray) -> np.ndarray:
        """(h, w, 3) uint8, bottom row first, of the geoms `chosen` (k,)."""
        self._choose(camera, size, chosen)
        rect, rgb = mujoco.MjrRect(0, 0, size[1], size[0]), np.empty((*size, 3), np.uint8)
        mujoco.mjr_render(rect, self._drawn, self._mjr)
        mujoco.mjr_readPixels(rgb, None, rect, self._mjr)
        return rgb

    def depth_and_ids(self, camera: Camera, size: Pixels, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(h, w) float32 metres along the optical axis and (h, w) int32, bottom row first; as in `rgb`."""
        chosen = self._choose(camera, size, chosen)
        flags = self._drawn.flags
        flags[NUMBERS] = 1
        rect, numbers = mujoco.MjrRect(0, 0, size[1], size[0]), np.empty((*size, 3), np.uint8)
        reversed_z = np.empty(size, np.float32)
        mujoco.mjr_render(rect, self._drawn, self._mjr)
        mujoco.mjr_readPixels(numbers, reversed_z, rect, self._mjr)
        flags[NUMBERS] = 0
        owner_of_number = np.zeros(len(chosen) + 1, np.int32)
        owner_of_number[1:] = self._scene.owner_of_geom[chosen]
        packed = cv2.cvtColor(numbers, cv2.COLOR_RGB2RGBA).view("<u4")[..., 0] & 0xFFFFFF
        ids = owner_of_number.take(packed)
        # glFrustum's mapping with both ends exchanged, inverted (OpenGL 2.1 reference, glFrustum): 0 at FAR_PLANE
        depth = NEAR_PLANE * FAR_PLANE / (NEAR_PLANE + reversed_z * np.float32(FAR_PLANE - NEAR_PLANE))
        depth[(reversed_z <= 0) | (ids == 0)] = np.inf  # a painted sky is no thing
        return depth, ids

    def view(self, camera: Camera, size: Pixels, drawn: Pixels, chosen: np.ndarray) -> Planes:
        """`rgb` of the size `drawn`, and `depth_and_ids` of `size`."""
        return self.rgb(camera, drawn, chosen), *self.depth_and_ids(camera, size, chosen)

    def close(self) -> None:
        """Free what lies on the graphics side."""
        self._mjr.free()

    def _choose(self, camera: Camera, size: Pixels, chosen: np.ndarray) -> np.ndarray:
        """Prepare OpenGL and the list of geoms to draw, which it returns; of people who are small, copies."""
        mujoco.mjr_restoreBuffer(self._mjr)
        if any(n > b for n, b in zip(size, self._buffer, strict=True)):
            self._buffer = max(size[0], self._buffer[0]), max(size[1], self._buffer[1])
            mujoco.mjr_resizeOffscreen(self._buffer[1], self._buffer[0], self._mjr)
        forward, wide = np.array(camera.forward), 2 * math.tan(camera.vfov / 2) / size[0]
        for copies in self._copies:
            if (here := np.isin(chosen, copies[0])).any():
                apart = self.middles[copies[0]] - np.array(camera.position)
                near = float((apart @ forward - self.reaches[copies[0]] @ np.abs(forward)).min())
                chosen = np.concatenate([chosen[~here], copies[int(np.searchsorted(PERSON_PIXELS, near * wide))]])
        chosen.sort()
        model = self._scene.model
        model.geom_group[:] = HIDDEN
        model.geom_group[chosen] = VISUAL
        mujoco.mjv_updateScene(
            model, self._data, self._option, self._perturb, self._camera, mujoco.mjtCatBit.mjCAT_ALL.value, self._drawn
        )
        model.geom_group[:] = self._groups
        self._aim(camera, size)
        return chosen

    def _aim(self, camera: Camera, size: Pixels) -> None:
        """Write `camera` into both eyes of the scene."""
        top = NEAR_PLANE * math.tan(camera.vfov / 2)
        for eye in self._drawn.camera:
            eye.pos, eye.forward, eye.up = camera.position, camera.forward, camera.up
            eye.frustum_near, eye.frustum_far = NEAR_PLANE, FAR_PLANE
            eye.frustum_bottom, eye.frustum_top = -top, top
            eye.frustum_center, eye.frustum_width = 0.0, top * size[1] / size[0]


def world_boxes(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """(ngeom, 3) middles and (ngeom, 3) half sizes of boxes along the world's axes that hold the geoms, metres."""
    axes = data.geom_xmat.reshape(-1, 3, 3)
    middles = data.geom_xpos + np.einsum("gij,gj->gi", axes, model.geom_aabb[:, :3])
    return middles, np.einsum("gij,gj->gi", np.abs(axes), model.geom_aabb[:, 3:])


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
