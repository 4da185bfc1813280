"""Cameras and what they give: a pinhole camera in world metres, the six of a panorama, one perspective picture."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from embodied.render.sampling import FACES

if TYPE_CHECKING:
    import mujoco

NEAR_PLANE, FAR_PLANE = 0.03, 200.0
"""Nothing nearer or farther is drawn, metres."""
Position = Sequence[float] | np.ndarray
"""x, y, z, metres."""
Pixels = tuple[int, int]
"""Height and width of a picture."""
Planes = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Pixels of one picture or of several: rgb, depth and ids, as `View` has them."""


@dataclass(frozen=True, eq=False)
class View:
    """One perspective picture."""

    rgb: np.ndarray
    """(h, w, 3) uint8 sRGB, top row first."""
    depth: np.ndarray
    """(h, w) float32 metres along the optical axis; inf where nothing is (the sky)."""
    ids: np.ndarray
    """(h, w) int32: i + 1 for parts.owners(house)[i], 0 where nothing is."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera in world metres."""

    position: tuple[float, float, float]
    forward: tuple[float, float, float]
    up: tuple[float, float, float]
    vfov: float = math.pi / 2
    """Vertical field of view, radians."""

    @property
    def right(self) -> np.ndarray:
        """(3,) unit."""
        (a, b, c), (x, y, z) = self.forward, self.up
        return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


def camera_at(position: Position, yaw: float, pitch: float = 0.0, vfov: float = math.pi / 2) -> Camera:
    """The camera that looks along (yaw, pitch), upright. Radians; yaw ccw from +x, pitch up."""
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    return Camera(_point(position), (cy * cp, sy * cp, sp), (-cy * sp, -sy * sp, cp), vfov)


def camera_of(model: mujoco.MjModel, data: mujoco.MjData, name: str | int) -> Camera:
    """A camera of a MuJoCo model, where it is now."""
    camera = model.camera(name).id
    _, up, back = data.cam_xmat[camera].reshape(3, 3).T
    return Camera(_point(data.cam_xpos[camera]), _point(-back), _point(up), math.radians(model.cam_fovy[camera]))


def face_cameras(position: Position) -> list[Camera]:
    """The cameras of the six cube faces, in the order of panorama.FACES."""
    at = _point(position)
    return [Camera(at, forward, up) for forward, up in FACES]


def _point(position: Position) -> tuple[float, float, float]:
    x, y, z = position
    return float(x), float(y), float(z)


def pixel_rays(
    camera: Camera, size: Pixels, pixels: np.ndarray | None = None, step: int = 1, aside: np.ndarray | None = None
) -> np.ndarray:
    """(n, 3) float32 unit rays through pixels (flat positions; all without) of a picture of `size`.

    Args:
      step: every so many pixels only; then `pixels` is None.
      aside: (n, 2) pixels to the right and down from the centres.
    """
    if pixels is None:
        return _all_rays(tuple(camera.forward), tuple(camera.up), camera.vfov, size, step)
    if aside is None:
        return _all_rays(tuple(camera.forward), tuple(camera.up), camera.vfov, size, 1)[pixels]
    h, w = size
    forward, up = np.asarray(camera.forward, np.float32), np.asarray(camera.up, np.float32)
    right, tall = np.cross(forward, up), math.tan(camera.vfov / 2)
    x, y = _across(size, 1, tall)
    row, column = np.divmod(pixels, w)
    across, along = x[column] + aside[:, 0] * (2 * tall / h), y[row] - aside[:, 1] * (2 * tall / h)
    rays = forward + across[:, None] * right + along[:, None] * up
    return (rays / np.linalg.norm(rays, axis=1, keepdims=True)).astype(np.float32)


@functools.lru_cache(maxsize=24)
def _all_rays(forward: tuple[float, ...], up: tuple[float, ...], vfov: float, size: Pixels, step: int) -> np.ndarray:
    """Kept, as panoramas look along the same six directions from everywhere."""
    ahead, above = np.asarray(forward, np.float32), np.asarray(up, np.float32)
    x, y = _across(size, step, math.tan(vfov / 2))
    rays = ahead + x[None, :, None] * np.cross(ahead, above) + y[:, None, None] * above
    rays = rays.reshape(-1, 3)
    rays = (rays / np.linalg.norm(rays, axis=1, keepdims=True)).astype(np.float32)
    rays.flags.writeable = False
    return rays


def _across(size: Pixels, step: int, tall: float) -> tuple[np.ndarray, np.ndarray]:
    """How far to the right and up of its middle the columns and rows of a picture are, a metre ahead."""
    h, w = size
    x = ((np.arange(0, w, step) + step / 2) / w * 2 - 1) * tall * w / h
    return x, (1 - (np.arange(0, h, step) + step / 2) / h * 2) * tall
