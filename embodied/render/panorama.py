"""Panorama: what is seen from one point in all directions, as six cube faces, and views resampled from it.

Faces, in order: +x, +y, -x, -y, up, down, each a square picture of 90 degrees as an upright camera
takes it: row 0 on top, columns to the right. The picture of `up` has -x on top, that of `down` has +x
on top, as if the camera of face 0 had been tilted. Nothing is mirrored.
"""

from __future__ import annotations

import functools
import math
import threading
from dataclasses import dataclass

import cv2
import numpy as np

from embodied.interface import VIEW_PITCHES, VIEW_YAWS, VIEWS

FACES = (
    ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0)),
    ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0)),
)
"""Forward and up direction of every face, world."""
VFOV36 = math.radians(60.0)
"""Vertical field of view of the 36 views of the VLN literature (Anderson et al. 2018, sec. 3.2)."""
MOST_TURNS = 4 * math.pi
"""Largest angle that is taken for radians; larger ones are most often degrees."""
CREASE = 0.05
"""Depths that differ by more than this share belong to different things and are not mixed."""


@dataclass(frozen=True, eq=False)
class Panorama:
    """Six cube faces around a point."""

    rgb: np.ndarray
    """(6, s, s, 3) uint8 sRGB."""
    depth: np.ndarray
    """(6, s, s) float32 metres along each face's optical axis; inf where nothing is."""
    ids: np.ndarray
    """(6, s, s) int32: i + 1 for parts.owners(house)[i], 0 where nothing is."""

    @property
    def size(self) -> int:
        """Side of a face, pixels."""
        return self.rgb.shape[1]

    def view(
        self, yaw: float, pitch: float = 0.0, vfov: float = VFOV36, size: tuple[int, int] = (480, 640)
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A perspective picture along (yaw, pitch): rgb, depth along its optical axis, ids.

        Args:
          yaw: radians counter-clockwise from +x.
          pitch: radians, up is positive.
          vfov: vertical field of view, radians, below pi.
          size: (height, width), pixels.

        Returns:
          (h, w, 3) uint8, (h, w) float32 metres, (h, w) int32.
        """
        grid = perspective_grid(self.size, float(yaw), float(pitch), float(vfov), *_checked(vfov, size))
        return self._rgb(grid), self._depth(grid), self._ids(grid)

    def view_rgb(
        self, yaw: float, pitch: float = 0.0, vfov: float = VFOV36, size: tuple[int, int] = (480, 640)
    ) -> np.ndarray:
        """The colours of `view` alone."""
        return self._rgb(perspective_grid(self.size, float(yaw), float(pitch), float(vfov), *_checked(vfov, size)))

    def views36(self, size: int = 224) -> np.ndarray:
        """(36, size, size, 3) uint8: the views of the VLN literature, in the order of embodied.interface.

        View k looks along yaw 30 (k % 12) degrees, counter-clockwise from +x, and along pitch
        30 (k // 12 - 1) degrees: 0-11 down, 12-23 level, 24-35 up, as `Candidates.view` and a
        FeatureSource's rows count them. Matterport's own order is in embodied.datasets.matterport.
        """
        _checked(VFOV36, (size, size))
        return self._rgb(grid36(self.size, size)).reshape(VIEWS, size, size, 3)

    def equirect(self, height: int = 512) -> np.ndarray:
        """(height, 2 height, 3) uint8: all directions; +x (yaw 0) in the middle column, +y left of it, up on top."""
        return self._rgb(equirect_grid(self.size, _checked(1.0, (height, height))[0]))

    def equirect_depth(self, height: int = 512) -> np.ndarray:
        """(height, 2 height) float32: metres along the ray, in the layout of `equirect`."""
        return self._depth(equirect_grid(self.size, height))

    def equirect_ids(self, height: int = 512) -> np.ndarray:
        """(height, 2 height) int32, in the layout of `equirect`."""
        return self._ids(equirect_grid(self.size, height))

    def through(self, grid: PixelGrid, channel: str) -> np.ndarray:
        """One channel, 'rgb', 'depth' or 'ids', of the picture that a grid describes; see `view` for units.

        Raises:
          ValueError: another channel.
        """
        if channel not in ("rgb", "depth", "ids"):
            raise ValueError(f"channel is {channel!r}; a panorama holds 'rgb', 'depth' and 'ids'")
        return {"rgb": self._rgb, "depth": self._depth, "ids": self._ids}[channel](grid)

    @functools.cached_property
    def _padded_rgba(self) -> np.ndarray:
        """(6 (s + 2), s + 2, 4): the faces below each other, each with a border taken from its neighbours.

        The fourth channel is empty: OpenCV resamples four channels twice as fast as three.
        """
        s, pad = self.size, pad_grid(self.size)
        padded = np.zeros((6, s + 2, s + 2, 4), np.uint8)
        padded[:, 1:-1, 1:-1, :3] = self.rgb
        border = cv2.remap(np.ascontiguousarray(self.rgb).reshape(6 * s, s, 3), pad.x, pad.y, cv2.INTER_LINEAR)
        padded[pad.face, pad.row, pad.column, :3] = border.reshape(-1, 3)
        return padded.reshape(6 * (s + 2), s + 2, 4)

    @functools.cached_property
    def _padded_nearness(self) -> np.ndarray:
        """(6 (s + 2), s + 2) float32: 1 / depth, which is linear over a plane, with borders as above."""
        s, pad = self.size, pad_grid(self.size)
        padded = np.empty((6, s + 2, s + 2), np.float32)
        nearness = self._nearness.reshape(6, s, s)
        padded[:, 1:-1, 1:-1] = nearness
        border = cv2.remap(nearness.reshape(6 * s, s), pad.x, pad.y, cv2.INTER_NEAREST).reshape(-1)
        padded[pad.face, pad.row, pad.column] = border * pad.ratio
        return padded.reshape(6 * (s + 2), s + 2)

    @functools.cached_property
    def _nearness(self) -> np.ndarray:
        """(6 s, s) float32: 1 / depth, 0 where nothing is."""
        return (1.0 / self.depth).astype(np.float32).reshape(6 * self.size, self.size)

    @functools.cached_property
    def _ids_as_floats(self) -> np.ndarray:
        """(6 s, s): the bits of the ids as float32, which OpenCV can copy from place to place."""
        return np.ascontiguousarray(self.ids, dtype=np.int32).view(np.float32).reshape(6 * self.size, self.size)

    def _rgb(self, grid: PixelGrid) -> np.ndarray:
        rgba = cv2.remap(self._padded_rgba, grid.x, grid.y, cv2.INTER_LINEAR)
        return cv2.cvtColor(rgba, cv2.COLOR_RGBA2RGB)

    def _ids(self, grid: PixelGrid) -> np.ndarray:
        return cv2.remap(self._ids_as_floats, grid.nearest, None, cv2.INTER_NEAREST).view(np.int32)

    def _depth(self, grid: PixelGrid) -> np.ndarray:
        nearest, other, mixed = _scratch(grid.x.shape, threading.get_ident())
        smooth = cv2.remap(self._padded_nearness, grid.x, grid.y, cv2.INTER_LINEAR)
        cv2.remap(self._nearness, grid.nearest, None, cv2.INTER_NEAREST, dst=nearest)
        cv2.absdiff(smooth, nearest, dst=other)
        cv2.scaleAdd(nearest, -CREASE, other, dst=other)
        cv2.compare(other, 0.0, cv2.CMP_GT, dst=mixed)
        cv2.copyTo(nearest, mixed, smooth)
        with np.errstate(divide="ignore"):
            return np.divide(grid.stretch, smooth, out=smooth)


@functools.lru_cache(maxsize=8)
def _scratch(shape: tuple[int, int], thread: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two float32 arrays and one uint8 for one thread to work in: fresh memory costs more than what is done with it."""
    return np.empty(shape, np.float32), np.empty(shape, np.float32), np.empty(shape, np.uint8)


@dataclass(frozen=True, eq=False)
class PixelGrid:
    """Where the pixels of a picture lie on the faces. (h, w) arrays."""

    x: np.ndarray
    y: np.ndarray
    """float32: the two maps of cv2.remap into the padded faces."""
    nearest: np.ndarray
    """(h, w, 2) int16: column and row of the nearest pixel of the faces below each other, without borders."""
    stretch: np.ndarray
    """float32 depth in this picture per depth in the face."""


@dataclass(frozen=True, eq=False)
class Pad:
    """The border pixels of all padded faces, and where their values lie. (n,) arrays; x and y are (n, 1)."""

    face: np.ndarray
    row: np.ndarray
    column: np.ndarray
    x: np.ndarray
    y: np.ndarray
    ratio: np.ndarray
    """float32 1 / depth in this face per 1 / depth in the neighbour."""


@functools.lru_cache(maxsize=96)
def perspective_grid(s: int, yaw: float, pitch: float, vfov: float, height: int, width: int) -> PixelGrid:
    if not (abs(yaw) <= MOST_TURNS and abs(pitch) <= math.pi):
        raise ValueError(f"yaw and pitch are in radians, got {yaw:g} and {pitch:g}; math.radians(90) is 90 degrees")
    """The grid of an upright perspective picture on faces of side `s`."""
    return _grid(s, *_pinhole_rays(yaw, pitch, vfov, height, width))


@functools.lru_cache(maxsize=4)
def grid36(s: int, size: int) -> PixelGrid:
    """The 36 views of `Panorama.views36`, below each other."""
    rays = [_pinhole_rays(yaw, pitch, VFOV36, size, size) for yaw, pitch in zip(VIEW_YAWS, VIEW_PITCHES, strict=True)]
    return _grid(s, np.concatenate([r[0] for r in rays]), np.concatenate([r[1] for r in rays]))


@functools.lru_cache(maxsize=4)
def equirect_grid(s: int, height: int) -> PixelGrid:
    """The grid of an equirectangular picture of (height, 2 height) pixels."""
    yaw = np.pi - (np.arange(2 * height) + 0.5) * np.pi / height
    pitch = np.pi / 2 - (np.arange(height) + 0.5) * np.pi / height
    rays = np.empty((height, 2 * height, 3))
    rays[..., 0] = np.cos(pitch)[:, None] * np.cos(yaw)
    rays[..., 1] = np.cos(pitch)[:, None] * np.sin(yaw)
    rays[..., 2] = np.sin(pitch)[:, None]
    return _grid(s, rays, np.ones(rays.shape[:2]))


def _pinhole_rays(yaw: float, pitch: float, vfov: float, height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """(h, w, 3) unit rays through the pixel centres, and (h, w) cosines with the optical axis."""
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    forward, right, up = np.array([cy * cp, sy * cp, sp]), np.array([sy, -cy, 0.0]), np.array([-cy * sp, -sy * sp, cp])
    tall = math.tan(vfov / 2)
    y = tall * (1 - 2 * (np.arange(height) + 0.5) / height)
    x = tall * width / height * (2 * (np.arange(width) + 0.5) / width - 1)
    rays = forward + x[None, :, None] * right + y[:, None, None] * up
    lengths = np.linalg.norm(rays, axis=-1)
    return rays / lengths[..., None], 1.0 / lengths


def _grid(s: int, rays: np.ndarray, cosines: np.ndarray) -> PixelGrid:
    """Where unit `rays` (h, w, 3) meet the faces; cosines (h, w) turn ray lengths into depths of the picture."""
    face, u, v, along = _face_coordinates(rays)
    x, y = (u + 1) / 2 * s - 0.5, (v + 1) / 2 * s - 0.5
    map_x, map_y = (x + 1).astype(np.float32), (y + 1 + face * (s + 2)).astype(np.float32)
    column, row = np.clip(np.rint(x), 0, s - 1), np.clip(np.rint(y), 0, s - 1) + face * s
    nearest = np.stack([column, row], axis=-1).astype(np.int16)
    return PixelGrid(map_x, map_y, nearest, (cosines / along).astype(np.float32))


def _face_coordinates(rays: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Face index, u (right) and v (down) in [-1, 1], and the part of each unit ray along the face's axis."""
    forward, up = (np.array([f[i] for f in FACES]) for i in (0, 1))
    right = np.cross(forward, up)
    face = np.argmax(rays @ forward.T, axis=-1)
    along, u, v = (np.sum(rays * axes[face], axis=-1) for axes in (forward, right, -up))
    return face, u / along, v / along, along


@functools.lru_cache(maxsize=8)
def pad_grid(s: int) -> Pad:
    """The one-pixel borders of faces of side `s`."""
    rim = np.ones((s + 2, s + 2), bool)
    rim[1:-1, 1:-1] = False
    row, column = np.nonzero(rim)
    face = np.repeat(np.arange(6), len(row))
    row, column = np.tile(row, 6), np.tile(column, 6)
    u, v = (column - 0.5) / s * 2 - 1, (row - 0.5) / s * 2 - 1
    forward, up = (np.array([f[i] for f in FACES])[face] for i in (0, 1))
    rays = forward + u[:, None] * np.cross(forward, up) - v[:, None] * up
    lengths = np.linalg.norm(rays, axis=-1)
    other, ou, ov, along = _face_coordinates(rays / lengths[:, None])
    x, y = (np.clip((w + 1) / 2 * s - 0.5, 0, s - 1) for w in (ou, ov))
    return Pad(
        face,
        row,
        column,
        x.astype(np.float32)[:, None],
        (y + other * s).astype(np.float32)[:, None],
        (along * lengths).astype(np.float32),
    )


@functools.lru_cache(maxsize=8)
def ray_stretch(s: int) -> np.ndarray:
    """(s, s) float32: length of the ray through each pixel of a face per metre of depth."""
    u = (np.arange(s) + 0.5) / s * 2 - 1
    return np.sqrt(1 + u[None] ** 2 + u[:, None] ** 2).astype(np.float32)


@functools.lru_cache(maxsize=8)
def face_rays(s: int) -> np.ndarray:
    """(6, s, s, 3) float32 unit directions, world, of every pixel."""
    u = (np.arange(s) + 0.5) / s * 2 - 1
    forward, up = (np.array([f[i] for f in FACES])[:, None, None] for i in (0, 1))
    rays = forward + u[None, None, :, None] * np.cross(forward, up) - u[None, :, None, None] * up
    return (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).astype(np.float32)


def _checked(vfov: float, size: tuple[int, int]) -> tuple[int, int]:
    """`size` as (height, width), refused where no picture can have it."""
    height, width = int(size[0]), int(size[1])
    if not (0 < height <= 8192 and 0 < width <= 16384):
        raise ValueError(f"size is {size}; a picture needs (height, width) from 1 to 8192 and 16384 pixels")
    if not 0 < vfov < math.pi:
        raise ValueError(f"vfov is {vfov} radians; a perspective picture needs more than 0 and less than pi")
    return height, width
