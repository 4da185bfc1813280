"""The classic renderer: a house drawn off-screen by OpenGL into rgb, depth and instance ids.

The house is uploaded once. To move the camera is to write six vectors; what cannot be seen (rooms
behind walls, things outside the field of view) is left out of the list of geoms to draw.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol, Self

from embodied import gl

gl.prepare()

import cv2
import mujoco
import numpy as np

from embodied.house.house import House
from embodied.render import visibility
from embodied.render.camera import Camera, View, camera_at, face_cameras
from embodied.render.panorama import Panorama
from embodied.render.pictures import check_size
from embodied.scene.lit_pages import LitPages
from embodied.scene.model import COLLISION, VISUAL, Scene, compile_scene, give_memory_back

if TYPE_CHECKING:
    from assets.catalogue import Catalogue

NEAR, FAR = 0.03, 200.0
"""Clipping planes, metres."""
SUPERSAMPLING = 1.5
"""Where the CPU draws, colours are drawn this many times larger and averaged: cheaper there than multi-sampling, which
multiplies the cost of every small triangle, and smoother. A GPU multi-samples instead."""
MULTISAMPLES = 4
HIDDEN = 5
"""Geom group of what is left out."""
NUMBERS = [mujoco.mjtRndFlag.mjRND_SEGMENT.value, mujoco.mjtRndFlag.mjRND_IDCOLOR.value]
"""Flags of a scene that paint every geom in its number's colour."""


class Painter(Protocol):
    """Draws the colours of a house in the classic renderer's place."""

    def rgb(self, camera: Camera, size: tuple[int, int], near: float, far: float) -> np.ndarray:
        """(h, w, 3) uint8 as `camera` sees it, top row first, between two planes."""
        ...

    def close(self) -> None: ...


class Overlay(Protocol):
    """Adds to the colours of a house what no page holds."""

    def over(self, rgb: np.ndarray, camera: Camera) -> np.ndarray:
        """(h, w, 3) uint8: the picture that `camera` drew, with it."""
        ...


class Renderer:
    """Draws one house. Owns textures and display lists on the graphics side until `close`.

    All renderers of a process share its one OpenGL context (embodied.gl), in which threads take turns; one renderer
    is used by one thread at a time.

    Examples:
      >>> with embodied.Renderer(house, catalogue) as renderer:
      ...     depth = renderer.view((2.0, 3.0, 1.5), yaw=0.5).depth
    """

    @gl.drawing()
    def __init__(
        self,
        house: House,
        catalogue: Catalogue,
        *,
        size: int = 256,
        lit: LitPages | None = None,
        painter: Painter | None = None,
        scene: Scene | None = None,
        overlay: Overlay | None = None,
    ) -> None:
        """Compile `house`, open OpenGL and upload.

        A pane of glass counts as what is seen where it is: its depth and its id, though colours shine through.

        Args:
          size: side of a cube face of `panorama`, pixels.
          lit: the baked pages to show; even light from all sides without.
          painter: draws the colours instead, from the same pages; it is closed with the renderer.
          scene: a scene compiled before from the same house and pages, to save compiling again.
          overlay: adds reflections; depth and ids stay as they are.

        Raises:
          ValueError: impossible size.
          GLError: no OpenGL context can be opened.
        """
        check_size(size)
        self.house, self.size = house, size
        self._mjr, self._painter, self._overlay = None, painter, overlay
        self.scene = scene or compile_scene(house, catalogue, collisions=False, lit=lit)
        model = self.scene.model
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        self._software = gl.info().software
        model.vis.quality.offsamples = 0 if self._software else MULTISAMPLES
        self._buffer = self._drawn_size((size, size))
        model.vis.global_.offheight, model.vis.global_.offwidth = self._buffer
        self._mjr = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._mjr)
        self._mjr.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._drawn = _empty_scene(model)
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[VISUAL] = 1
        self._camera, self._perturb = mujoco.MjvCamera(), mujoco.MjvPerturb()
        self._is_visual = np.array([k != "collision" for k in self.scene.kind_of_geom])
        self._portals = visibility.portals_of(house)
        self._geoms_of_room = _geoms_by_room(house, self.scene)
        self._middles, self._reaches = world_boxes(model, self._data)

    def view(
        self,
        position: Sequence[float] | np.ndarray,
        yaw: float,
        pitch: float = 0.0,
        vfov: float = math.pi / 3,
        size: tuple[int, int] = (480, 640),
        *,
        cull: bool = True,
    ) -> View:
        """The picture from `position` (x, y, z) along (yaw, pitch).

        Args:
          vfov: vertical field of view, radians.
          size: (height, width), pixels.
          cull: False draws everything, for comparison.
        """
        return self.through(camera_at(position, yaw, pitch, vfov), size, cull=cull)

    @gl.drawing()
    def through(self, camera: Camera, size: tuple[int, int], *, cull: bool = True) -> View:
        """The picture of (height, width) that `camera` takes; `cull` as in `view`."""
        drawn = self._choose(camera, size, cull)
        rgb = self._rgb(camera, size)
        depth, ids = self._depth_and_ids(size, drawn)
        return View(rgb, depth, ids)

    @gl.drawing()
    def rgb(self, camera: Camera, size: tuple[int, int]) -> np.ndarray:
        """(h, w, 3) uint8: colours alone."""
        self._choose(camera, size, True)
        return self._rgb(camera, size)

    @gl.drawing()
    def depth_and_ids(self, camera: Camera, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """(h, w) float32 metres along the optical axis and (h, w) int32, without the colours."""
        return self._depth_and_ids(size, self._choose(camera, size, True))

    @gl.drawing()
    def panorama(self, position: Sequence[float] | np.ndarray, size: int | None = None) -> Panorama:
        """Six cube faces of rgb, depth and ids around `position` (x, y, z)."""
        s = size or self.size
        rgb = np.empty((6, s, s, 3), np.uint8)
        depth, ids = np.empty((6, s, s), np.float32), np.empty((6, s, s), np.int32)
        for k, camera in enumerate(face_cameras(position)):
            drawn = self._choose(camera, (s, s), True)
            rgb[k] = self._rgb(camera, (s, s))
            depth[k], ids[k] = self._depth_and_ids((s, s), drawn)
        return Panorama(rgb, depth, ids)

    @gl.drawing()
    def seen(self, position: Sequence[float] | np.ndarray, size: int = 64) -> tuple[np.ndarray, np.ndarray]:
        """Depth and ids of the six faces without the colours: (6, s, s) float32 metres, (6, s, s) int32."""
        depth, ids = np.empty((6, size, size), np.float32), np.empty((6, size, size), np.int32)
        for k, camera in enumerate(face_cameras(position)):
            depth[k], ids[k] = self.depth_and_ids(camera, (size, size))
        return depth, ids

    def close(self) -> None:
        """Free what lies on the graphics side; the renderer cannot be used afterwards."""
        if self._painter is not None:
            self._painter.close()
            self._painter = None
        if self._mjr is not None:
            with gl.drawing():
                self._mjr.free()
            self._mjr = None
            give_memory_back()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _choose(self, camera: Camera, size: tuple[int, int], cull: bool) -> np.ndarray:
        """Prepare OpenGL and the list of geoms to draw; returns their indices, in drawing order."""
        if self._mjr is None:
            raise RuntimeError("the renderer is closed; make a new one")
        mujoco.mjr_restoreBuffer(self._mjr)
        if any(n > b for n, b in zip(self._drawn_size(size), self._buffer, strict=True)):
            height, width = self._drawn_size(size)
            self._buffer = max(height, self._buffer[0]), max(width, self._buffer[1])
            mujoco.mjr_resizeOffscreen(self._buffer[1], self._buffer[0], self._mjr)
        mask = self._is_visual
        if cull:
            mask = self._in_view(camera, size)
        model = self.scene.model
        model.geom_group[:] = np.where(mask, VISUAL, HIDDEN)
        mujoco.mjv_updateScene(
            model, self._data, self._option, self._perturb, self._camera, mujoco.mjtCatBit.mjCAT_ALL.value, self._drawn
        )
        model.geom_group[:] = np.where(self._is_visual, VISUAL, COLLISION)
        _aim(self._drawn, camera, size)
        return np.flatnonzero(mask)

    def _in_view(self, camera: Camera, size: tuple[int, int]) -> np.ndarray:
        """(ngeom,) bool: what may be seen: through doors and windows, with its box in the field of view."""
        forward, up = np.array(camera.forward), np.array(camera.up)
        right, tall = np.cross(forward, up), math.tan(camera.vfov / 2)
        wide = tall * size[1] / size[0]
        planes = np.stack([forward * wide - right, forward * wide + right, forward * tall - up, forward * tall + up])
        planes /= np.linalg.norm(planes, axis=1, keepdims=True)
        apart = self._middles - np.array(camera.position)
        framed = np.all(apart @ planes.T >= -self._reaches @ np.abs(planes.T) - 1e-3, axis=1)
        towards = visibility.sector_of(forward, right, up, wide, tall)
        rooms = visibility.visible_rooms(self.house, self._portals, camera.position, towards)
        if rooms is None:
            return framed & self._is_visual
        there = [
            (s, g) for r, sectors in rooms.items() if (g := self._geoms_of_room.get(r)) is not None for s in sectors
        ]
        if not there:
            return np.zeros_like(framed)
        geoms = np.concatenate([g for _, g in there])
        sectors = np.repeat([s for s, _ in there], [len(g) for _, g in there], axis=0)
        spans = visibility.spans_of(np.array(camera.position), self._middles, self._reaches)
        mask = np.zeros_like(framed)
        mask[geoms[spans.within(sectors, geoms)]] = True
        return mask & framed

    def _drawn_size(self, size: tuple[int, int]) -> tuple[int, int]:
        """(height, width) at which colours of a picture of `size` are drawn."""
        factor = SUPERSAMPLING if self._software else 1.0
        return math.ceil(size[0] * factor), math.ceil(size[1] * factor)

    def _rgb(self, camera: Camera, size: tuple[int, int]) -> np.ndarray:
        rgb = self._drawn_rgb(camera, size)
        return rgb if self._overlay is None else self._overlay.over(rgb, camera)

    def _drawn_rgb(self, camera: Camera, size: tuple[int, int]) -> np.ndarray:
        if self._painter is not None:
            return self._painter.rgb(camera, size, NEAR, FAR)
        height, width = self._drawn_size(size)
        rect, rgb = mujoco.MjrRect(0, 0, width, height), np.empty((height, width, 3), np.uint8)
        mujoco.mjr_render(rect, self._drawn, self._mjr)
        mujoco.mjr_readPixels(rgb, None, rect, self._mjr)
        if (height % 3, width % 3, 2 * height, 2 * width) == (0, 0, 3 * size[0], 3 * size[1]):
            return two_thirds(rgb)
        if (height, width) != tuple(size):
            rgb = cv2.resize(rgb, (size[1], size[0]), interpolation=cv2.INTER_AREA)
        return rgb[::-1]

    def _depth_and_ids(self, size: tuple[int, int], drawn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A second pass that paints every geom in its number's colour."""
        flags = self._drawn.flags
        flags[NUMBERS] = 1
        rect, numbers = mujoco.MjrRect(0, 0, size[1], size[0]), np.empty((*size, 3), np.uint8)
        reversed_z = np.empty(size, np.float32)
        mujoco.mjr_render(rect, self._drawn, self._mjr)
        mujoco.mjr_readPixels(numbers, reversed_z, rect, self._mjr)
        flags[NUMBERS] = 0
        owner_of_number = np.zeros(len(drawn) + 1, np.int32)
        owner_of_number[1:] = self.scene.owner_of_geom[drawn]
        packed = cv2.cvtColor(numbers, cv2.COLOR_RGB2RGBA).view("<u4")[::-1, :, 0] & 0xFFFFFF
        ids = owner_of_number.take(packed)
        depth = depth_of_reversed_z(reversed_z[::-1])
        depth[ids == 0] = np.inf  # a painted sky is no thing
        return depth, ids


def world_boxes(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """(ngeom, 3) middles and (ngeom, 3) half sizes of boxes along the world's axes that hold the geoms, metres."""
    axes = data.geom_xmat.reshape(-1, 3, 3)
    middles = data.geom_xpos + np.einsum("gij,gj->gi", axes, model.geom_aabb[:, :3])
    return middles, np.einsum("gij,gj->gi", np.abs(axes), model.geom_aabb[:, 3:])


def depth_of_reversed_z(z: np.ndarray, near: float = NEAR, far: float = FAR) -> np.ndarray:
    """Metres along the optical axis (float32) from a depth buffer that is 1 at `near` and 0 at `far`; inf at 0.

    Source: the inverse of glFrustum's mapping with both ends exchanged (OpenGL 2.1 reference, glFrustum).
    """
    depth = near * far / (near + z * np.float32(far - near))
    depth[z <= 0] = np.inf
    return depth


def two_thirds(picture: np.ndarray) -> np.ndarray:
    """(2 h, 2 w, 3) uint8 from (3 h, 3 w, 3), bottom row first: the mean over each pixel's area, top row first."""
    rgba = cv2.remap(
        cv2.cvtColor(picture, cv2.COLOR_RGB2RGBA), *_thirds(*picture.shape[:2]), interpolation=cv2.INTER_LINEAR
    )
    return cv2.cvtColor(rgba, cv2.COLOR_RGBA2RGB)


@functools.lru_cache(maxsize=8)
def _thirds(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """The maps of cv2.remap for `two_thirds`: a mean of three pixels' one and a half is one sample between two."""
    columns, rows = (
        n // 2 * 3 + np.where(n % 2, 5 / 3, 1 / 3) for n in map(np.arange, (width // 3 * 2, height // 3 * 2))
    )
    x, y = np.broadcast_arrays(columns[None], rows[::-1, None])
    return x.astype(np.float32), y.astype(np.float32)


def _empty_scene(model: mujoco.MjModel) -> mujoco.MjvScene:
    scene = mujoco.MjvScene(model, maxgeom=model.ngeom + 16)
    for name in ("SHADOW", "REFLECTION", "FOG", "HAZE"):
        scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{name}")] = 0
    return scene


def _aim(scene: mujoco.MjvScene, camera: Camera, size: tuple[int, int]) -> None:
    """Write `camera` into both eyes of `scene`."""
    top = NEAR * math.tan(camera.vfov / 2)
    for eye in scene.camera:
        eye.pos, eye.forward, eye.up = camera.position, camera.forward, camera.up
        eye.frustum_near, eye.frustum_far = NEAR, FAR
        eye.frustum_bottom, eye.frustum_top = -top, top
        eye.frustum_center, eye.frustum_width = 0.0, top * size[1] / size[0]


def _geoms_by_room(house: House, scene: Scene) -> dict[str, np.ndarray]:
    """Room id to the geoms seen when that room is seen; joinery and stairs belong to both their rooms."""
    sides = {o.id: tuple(r or visibility.OUTDOORS for r in o.rooms) for o in house.openings}
    sides |= {s.id: s.rooms for s in house.stairs}
    geoms: dict[str, list[int]] = {}
    for g, kind in enumerate(scene.kind_of_geom):
        if kind == "collision":
            continue
        owner = scene.owners[scene.owner_of_geom[g] - 1] if scene.owner_of_geom[g] else ""
        rooms = sides.get(owner.partition("/")[0], (scene.room_of_geom[g],))
        for room in rooms:
            geoms.setdefault(room, []).append(g)
    return {room: np.array(list_of, int) for room, list_of in geoms.items()}
