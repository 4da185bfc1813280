"""Panorama: what is seen from one point in all directions, as six cube faces, and views resampled from it.

Faces, in order: +x, +y, -x, -y, up, down, each a square picture of 90 degrees as an upright camera
takes it: row 0 on top, columns to the right. The picture of `up` has -x on top, that of `down` has +x
on top, as if the camera of face 0 had been tilted. Nothing is mirrored.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from embodied.interface import VIEW_PITCHES, VIEW_YAWS, VIEWS
from embodied.render.camera import Pixels, Planes
from embodied.render.sampling import AXES, Rays, locate

VFOV36 = math.radians(60.0)
"""Vertical field of view of the 36 views of the VLN literature (Anderson et al. 2018, sec. 3.2)."""
MOST_TURNS = 4 * math.pi
"""Largest angle that is taken for radians; larger ones are most often degrees."""
CREASE = 0.05
"""Depths that differ by more than this share belong to different things and are not mixed."""


class Recognised(NamedTuple):
    """A thing that somebody finds in a panorama."""

    name: str
    """Its class."""
    probability: float
    yaw: float
    pitch: float
    """Radians, towards where it is seen best."""


@dataclass(frozen=True, eq=False)
class Panorama:
    """Six cube faces around a point.

    Examples:
      >>> world.panorama(0).view_rgb(yaw=0.5, pitch=-0.1).shape
      (480, 640, 3)
      >>> world.panorama(0).views36(32).shape
      (36, 32, 32, 3)
    """

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

    def view(self, yaw: float, pitch: float = 0.0, vfov: float = VFOV36, size: Pixels = (480, 640)) -> Planes:
        """A perspective picture along (yaw, pitch): rgb, depth along its optical axis, ids.

        Args:
          yaw: radians counter-clockwise from +x.
          pitch: radians, up is positive.
          vfov: vertical field of view, radians, below pi.
          size: (height, width), pixels.

        Returns:
          (h, w, 3) uint8, (h, w) float32 metres, (h, w) int32.
        """
        grid = perspective_grid(self.size, float(yaw), float(pitch), float(vfov), *checked(vfov, size))
        return self.through(grid, "rgb"), self.through(grid, "depth"), self.through(grid, "ids")

    def view_rgb(self, yaw: float, pitch: float = 0.0, vfov: float = VFOV36, size: Pixels = (480, 640)) -> np.ndarray:
        """The colours of `view` alone."""
        grid = perspective_grid(self.size, float(yaw), float(pitch), float(vfov), *checked(vfov, size))
        return self.through(grid, "rgb")

    def views36(self, size: int = 224) -> np.ndarray:
        """(36, size, size, 3) uint8: the views of the VLN literature, in the order of embodied.interface.

        View k looks along yaw 30 (k % 12) degrees, counter-clockwise from +x, and along pitch
        30 (k // 12 - 1) degrees: 0-11 down, 12-23 level, 24-35 up, as `Candidates.view` and a
        FeatureSource's rows count them. Matterport's own order is in embodied.mattersim.pictures.
        """
        checked(VFOV36, (size, size))
        return self.through(grid36(self.size, size), "rgb").reshape(VIEWS, size, size, 3)

    def equirect(self, height: int = 512) -> np.ndarray:
        """(height, 2 height, 3) uint8: all directions; +x (yaw 0) in the middle column, +y left of it, up on top."""
        return self.through(equirect_grid(self.size, checked(1.0, (height, height))[0]), "rgb")

    def equirect_depth(self, height: int = 512) -> np.ndarray:
        """(height, 2 height) float32: metres along the ray, in the layout of `equirect`."""
        return self.through(equirect_grid(self.size, height), "depth")

    def equirect_ids(self, height: int = 512) -> np.ndarray:
        """(height, 2 height) int32, in the layout of `equirect`."""
        return self.through(equirect_grid(self.size, height), "ids")

    def through(self, grid: PixelGrid, channel: str) -> np.ndarray:
        """One channel, 'rgb', 'depth' or 'ids', of the picture that a grid describes; see `view` for units.

        Raises:
          ValueError: another channel.
        """
        if channel == "rgb":
            return resampled_rgb(self._padded_rgba, grid)
        if channel == "depth":
            return resampled_depth(self._padded_nearness, grid)
        if channel != "ids":
            raise ValueError(f"channel is {channel!r}; a panorama holds 'rgb', 'depth' and 'ids'")
        return cv2.remap(self._padded_ids, grid.maps[1], grid.maps[2], cv2.INTER_NEAREST).view(np.int32)

    @functools.cached_property
    def _padded_rgba(self) -> np.ndarray:
        return padded_rgba(self.size, lambda k, to: cv2.cvtColor(self.rgb[k], cv2.COLOR_RGB2RGBA, dst=to))

    @functools.cached_property
    def _padded_nearness(self) -> np.ndarray:
        """1 / depth, which is linear over a plane; 0 where nothing is."""
        ratio = pad_grid(self.size).ratio
        return padded_plane(self.size, lambda k, to: np.divide(1.0, self.depth[k], out=to), ratio)

    @functools.cached_property
    def _padded_ids(self) -> np.ndarray:
        """The bits of the ids as float32, which OpenCV can copy from place to place."""
        return padded_plane(self.size, lambda k, to: np.copyto(to.view(np.int32), self.ids[k]))


def padded_rgba(s: int, write: Callable[[int, np.ndarray], object]) -> np.ndarray:
    """(6 (s + 2), s + 2, 4) uint8: the faces below each other, each with a border taken from its neighbours.

    The fourth channel means nothing: OpenCV resamples four channels twice as fast as three.

    Args:
      s: side of a face, pixels.
      write: writes face k into (s, s, 4).
    """
    padded = np.empty((6, s + 2, s + 2, 4), np.uint8)
    for k, whole in enumerate(padded):
        write(k, whole[1:-1, 1:-1])
    flat, pad = padded.reshape(6 * (s + 2), s + 2, 4), pad_grid(s)
    padded[pad.face, pad.row, pad.column] = cv2.remap(flat, pad.x, pad.y, cv2.INTER_LINEAR)[:, 0]
    return flat


def padded_plane(
    s: int, write: Callable[[int, np.ndarray], object], ratio: np.ndarray | None = None, kind: type = np.float32
) -> np.ndarray:
    """(6 (s + 2), s + 2) of `kind`: as `padded_rgba`, with borders of the nearest pixels beyond, times `ratio`."""
    padded: np.ndarray = np.empty((6, s + 2, s + 2), kind)
    pad = pad_grid(s)
    for k, whole in enumerate(padded):
        write(k, whole[1:-1, 1:-1])
    flat = padded.reshape(6 * (s + 2), s + 2)
    border = cv2.remap(flat, pad.x, pad.y, cv2.INTER_NEAREST)[:, 0]
    padded[pad.face, pad.row, pad.column] = border if ratio is None else border * ratio
    return flat


def resampled_rgb(padded: np.ndarray, grid: PixelGrid) -> np.ndarray:
    """(h, w, 3) uint8: what a grid shows of `padded_rgba`."""
    _, x, y = grid.maps
    return cv2.cvtColor(cv2.remap(padded, x, y, cv2.INTER_LINEAR), cv2.COLOR_RGBA2RGB)


def resampled_depth(padded: np.ndarray, grid: PixelGrid) -> np.ndarray:
    """(h, w) float32: the depth that a grid shows of planes of 1 / depth; inf where nothing is."""
    along, x, y = grid.maps
    nearest, smooth = (cv2.remap(padded, x, y, way) for way in (cv2.INTER_NEAREST, cv2.INTER_LINEAR))
    cv2.copyTo(smooth, cv2.inRange(cv2.divide(smooth, nearest), 1 - CREASE, 1 + CREASE), nearest)
    cv2.multiply(nearest, along, dst=nearest)
    with np.errstate(divide="ignore"):
        return np.divide(1.0, nearest, out=nearest)


@dataclass(frozen=True, eq=False)
class PixelGrid:
    """Places of a picture's pixels on the padded faces."""

    shape: tuple[int, int]
    """Height and width of the picture."""
    draw: Callable[[np.ndarray], None]
    """Writes the maps."""

    @functools.cached_property
    def maps(self) -> np.ndarray:
        """(3, h, w) float32: depth in the face per depth in the picture, then the two maps of cv2.remap."""
        out = np.empty((3, *self.shape), np.float32)
        self.draw(out)
        return out


@dataclass(frozen=True, eq=False)
class Pad:
    """The border pixels of all padded faces, and where there their values lie. (n,) arrays; x and y are (n, 1)."""

    face: np.ndarray
    row: np.ndarray
    column: np.ndarray
    x: np.ndarray
    y: np.ndarray
    ratio: np.ndarray
    """float32 1 / depth in this face per 1 / depth in the neighbour."""


@functools.lru_cache(maxsize=48)
def perspective_grid(s: int, yaw: float, pitch: float, vfov: float, height: int, width: int) -> PixelGrid:
    """The grid of an upright perspective picture on faces of side `s`."""
    if not (abs(yaw) <= MOST_TURNS and abs(pitch) <= math.pi):
        raise ValueError(f"yaw and pitch are in radians, got {yaw:g} and {pitch:g}; math.radians(90) is 90 degrees")
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    right, rows = _lens(vfov, height, width)
    columns = np.array([[cp * cy], [cp * sy], [sp]]) + np.array([[sy], [-cy], [0.0]]) * right
    rays = Rays(rows, columns.astype(np.float32), np.array([-sp * cy, -sp * sy, cp], np.float32))
    return PixelGrid((height, width), functools.partial(locate, s, rays))


@functools.lru_cache(maxsize=8)
def _lens(vfov: float, height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """(w,): how far to the right pixels look per metre forward; (2, h) float32: one, and how far up."""
    step = math.tan(vfov / 2) / height
    up = step * np.arange(height - 1, -height, -2)
    return step * np.arange(1 - width, width, 2), np.stack([np.ones(height), up]).astype(np.float32)


@functools.lru_cache(maxsize=4)
def grid36(s: int, size: int) -> PixelGrid:
    """The 36 views of `Panorama.views36`, below each other."""

    def draw(maps: np.ndarray) -> None:
        for k, (yaw, pitch) in enumerate(zip(VIEW_YAWS, VIEW_PITCHES, strict=True)):
            view = perspective_grid.__wrapped__(s, yaw, pitch, VFOV36, size, size)
            view.draw(maps[:, k * size : (k + 1) * size])

    return PixelGrid((VIEWS * size, size), draw)


@functools.lru_cache(maxsize=4)
def equirect_grid(s: int, height: int) -> PixelGrid:
    """The grid of an equirectangular picture of (height, 2 height) pixels."""
    yaw = np.pi - (np.arange(2 * height) + 0.5) * np.pi / height
    pitch = np.pi / 2 - (np.arange(height) + 0.5) * np.pi / height
    rows = np.stack([np.cos(pitch), np.sin(pitch)]).astype(np.float32)
    columns = np.stack([np.cos(yaw), np.sin(yaw), np.zeros(2 * height)]).astype(np.float32)
    rays = Rays(rows, columns, np.array([0, 0, 1], np.float32))
    return PixelGrid((height, 2 * height), functools.partial(locate, s, rays))


@functools.lru_cache(maxsize=8)
def pad_grid(s: int) -> Pad:
    """The one-pixel borders of faces of side `s`."""
    rim = np.ones((s + 2, s + 2), bool)
    rim[1:-1, 1:-1] = False
    row, column = np.nonzero(rim)
    face = np.repeat(np.arange(6), len(row))
    row, column = np.tile(row, 6), np.tile(column, 6)
    u, v = (column - 0.5) / s * 2 - 1, (row - 0.5) / s * 2 - 1
    forward, right, up = AXES[face].swapaxes(0, 1)
    rays = forward + u[:, None] * right - v[:, None] * up
    lengths = np.linalg.norm(rays, axis=-1)
    rays = rays / lengths[:, None]
    forward, right, up = AXES.swapaxes(0, 1)
    other = np.argmax(rays @ forward.T, axis=-1)
    along, u, v = (np.sum(rays * axes[other], axis=-1) for axes in (forward, right, -up))
    x, y = (np.clip((w / along + 1) / 2 * s - 0.5, 0, s - 1) for w in (u, v))
    return Pad(
        face,
        row,
        column,
        (x + 1).astype(np.float32)[:, None],
        (y + 1 + other * (s + 2)).astype(np.float32)[:, None],
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
    forward, right, up = AXES.swapaxes(0, 1)[:, :, None, None]
    rays = forward + u[None, None, :, None] * right - u[None, :, None, None] * up
    return (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).astype(np.float32)


def checked(vfov: float, size: tuple[int, int]) -> tuple[int, int]:
    """`size` as (height, width), refused where no picture can have it."""
    height, width = int(size[0]), int(size[1])
    if not (0 < height <= 8192 and 0 < width <= 16384):
        raise ValueError(f"size is {size}; a picture needs (height, width) from 1 to 8192 and 16384 pixels")
    if not 0 < vfov < math.pi:
        raise ValueError(f"vfov is {vfov} radians; a perspective picture needs more than 0 and less than pi")
    return height, width
