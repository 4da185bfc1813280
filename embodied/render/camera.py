"""Cameras and what they give: a pinhole camera in world metres, the six of a panorama, one perspective picture."""

from __future__ import annotations

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
