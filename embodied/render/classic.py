"""The classic renderer: a house drawn off-screen by OpenGL into rgb, depth and instance ids.

The house is uploaded once. What cannot be seen (rooms behind walls, things outside the field of view) is left out of
the list of geoms to draw. MuJoCo draws them; where the CPU draws a lit house, embodied.render.raster does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol, Self

from embodied import gl

gl.prepare()

import cv2
import numpy as np

from embodied.house.house import House
from embodied.render import visibility
from embodied.render.camera import Camera, Pixels, Position, View, camera_at, face_cameras
from embodied.render.geoms import Geoms
from embodied.render.panorama import Panorama
from embodied.render.pictures import check_size
from embodied.render.supersampling import averaged, drawn_size
from embodied.scene.house_meshes import house_parts, owners
from embodied.scene.joinery import leaf_poses
from embodied.scene.lit_pages import ANYWHERE, LitMesh, LitPages
from embodied.scene.model import compile_scene, drawn_meshes, give_memory_back, hollow_things
from embodied.scene.part import Part

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.render.raster import Raster

MULTISAMPLES = 4
"""Of a pixel, where a GPU draws."""
BARE: tuple[np.ndarray, ...] = (np.zeros((1, 1, 3), np.uint8),)
"""Pages of a house that is drawn without colours."""


class Overlay(Protocol):
    """Adds to the colours of a house what no page holds."""

    def over(self, rgb: np.ndarray, camera: Camera) -> np.ndarray:
        """(h, w, 3) uint8: the picture that `camera` drew, with it."""
        ...

    def change(self, corners: Mapping[int, np.ndarray], patches: Sequence[tuple[int, int, int, np.ndarray]]) -> None:
        """Follow `Renderer.change`."""
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
        overlay: Overlay | None = None,
        colours: bool = True,
    ) -> None:
        """Compile `house`, open OpenGL and upload.

        A pane of glass counts as what is seen where it is: its depth and its id, though colours shine through.

        Args:
          size: side of a cube face of `panorama`, pixels.
          lit: the baked pages to show; even light from all sides without.
          overlay: adds reflections; depth and ids stay as they are.
          colours: False for depth and ids alone: where the CPU draws, a house without light then opens in a fifth of
            the time, and one in 200,000 pixels, at an edge, shows another id.

        Raises:
          ValueError: impossible size.
          GLError: no OpenGL context can be opened.
        """
        from embodied.render import raster  # late: loads OpenGL

        check_size(size)
        self.house, self.size = house, size
        self._made_of, self._finish = house, catalogue.finish
        self._drawing: Geoms | Raster | None = None
        self._overlay = overlay
        self._software = gl.info().software
        self.owners = owners(house)
        self._portals = visibility.portals_of(house)
        if (lit is not None or not colours) and self._software and raster.able():
            if lit is None:
                self._rasterise(_bare_meshes(house_parts(house, catalogue)), BARE, copied=False)
            else:
                self._rasterise([m for _, m in drawn_meshes(lit, house, twice=False)], lit.pages)
        else:
            scene = compile_scene(house, catalogue, collisions=False, lit=lit)
            samples = 0 if self._software else MULTISAMPLES
            self._drawing = Geoms(scene, self._drawn_size((size, size)), samples)
            self._list(scene.owner_of_geom, scene.kind_of_geom, scene.room_of_geom)

    def _rasterise(
        self, meshes: Sequence[LitMesh], pages: Sequence[np.ndarray], *, copied: bool = True, moving: Sequence[int] = ()
    ) -> None:
        from embodied.render import raster  # late: loads OpenGL

        number = {name: i + 1 for i, name in enumerate(self.owners)}
        ids = np.array([number.get(m.owner, 0) for m in meshes], np.int32)
        things = hollow_things(self.house)
        hollow = [i for i, m in enumerate(meshes) if m.owner in things]
        self._drawing = raster.Raster(meshes, ids, pages, copied=copied, moving=moving, hollow=hollow)
        self._list(ids, [m.kind for m in meshes], [m.room for m in meshes])

    def _list(self, ids: np.ndarray, kinds: Sequence[str], rooms: Sequence[str]) -> None:
        """Note whose each of the geoms is, and from where it is seen."""
        self._is_visual = np.array([k != "collision" for k in kinds])
        self._geoms_of_room = _geoms_by_room(
            self.house, [self.owners[i - 1] if i else "" for i in ids], list(kinds), list(rooms)
        )

    @gl.drawing()
    def replace(self, lit: LitPages, moving: Sequence[int], owners: Sequence[str], overlay: Overlay | None) -> None:
        """Draw other meshes and pages of the same lit house, some of which `move` moves.

        Args:
          moving: numbers of meshes in `lit`.
          owners: as the attribute, with those of what is no part of the house behind the others.
        """
        from embodied.render import raster  # late: loads OpenGL

        if not raster.able():
            raise gl.GLError("what moves in a lit house is drawn by OpenGL 4.5 or later, and this one is older")
        self._open().close()
        self.owners, self._overlay = tuple(owners), overlay
        drawn = list(drawn_meshes(lit, self.house, twice=False))
        self._numbers = {i: k for k, (i, _) in enumerate(drawn) if i in set(moving)}
        self._rasterise([m for _, m in drawn], lit.pages, moving=list(self._numbers.values()))

    @gl.drawing()
    def change(self, corners: Mapping[int, np.ndarray], patches: Sequence[tuple[int, int, int, np.ndarray]]) -> None:
        """Move meshes that `replace` named, and repaint parts of pages.

        Args:
          corners: (n, 3) float32 vertices by number of mesh in the lit house, metres.
          patches: page, row, column and (h, w, 3) uint8 of each part.
        """
        drawing = self._open()
        if corners:
            drawing.move({self._numbers[number]: v for number, v in corners.items()})  # type: ignore[union-attr]
        for page, row, column, picture in patches:
            drawing.repaint(page, (row, column), picture)  # type: ignore[union-attr]
        if self._overlay is not None:
            self._overlay.change(corners, patches)

    @gl.drawing()
    def turn(self, house: House) -> None:
        """Draw doors as `house` has them, which differs in nothing else from that which this was made for; not where a
        house is lit (`World.show` moves its doors)."""
        if house is self.house:
            return
        drawing, turns = self._open(), dict[str, tuple[np.ndarray, float]]()
        assert isinstance(drawing, Geoms), "drawn with its materials"
        for then, now in zip(self._made_of.openings, house.openings, strict=True):
            if then.angle != now.angle:
                after = leaf_poses(house, now, self._finish)
                for name, (pivot, yaw) in leaf_poses(self._made_of, then, self._finish).items():
                    turns[name] = np.array(pivot), after[name][1] - yaw
        drawing.turn(turns)
        self.house = house

    def view(
        self, position: Position, yaw: float, pitch: float = 0.0, vfov: float = math.pi / 3, size: Pixels = (480, 640)
    ) -> View:
        """The picture from `position` (x, y, z) along (yaw, pitch).

        Args:
          vfov: vertical field of view, radians.
          size: (height, width), pixels.
        """
        return self.through(camera_at(position, yaw, pitch, vfov), size)

    @gl.drawing()
    def through(self, camera: Camera, size: Pixels) -> View:
        """The picture of (height, width) that `camera` takes.

        Where the CPU draws a lit house, an id is of a point up to a third of a pixel beside the middle: it tells at
        edges.
        """
        drawing, chosen = self._open(), np.flatnonzero(self._in_view(camera, size))
        picture, depth, ids = drawing.view(camera, size, self._drawn_size(size), chosen)
        return View(self._overlaid(averaged(picture, size), camera), cv2.flip(depth, 0), cv2.flip(ids, 0))

    @gl.drawing()
    def rgb(self, camera: Camera, size: Pixels) -> np.ndarray:
        """(h, w, 3) uint8: colours alone."""
        picture = self._open().rgb(camera, self._drawn_size(size), np.flatnonzero(self._in_view(camera, size)))
        return self._overlaid(averaged(picture, size), camera)

    @gl.drawing()
    def depth_and_ids(self, camera: Camera, size: Pixels) -> tuple[np.ndarray, np.ndarray]:
        """(h, w) float32 metres along the optical axis and (h, w) int32, without the colours."""
        depth, ids = self._open().depth_and_ids(camera, size, np.flatnonzero(self._in_view(camera, size)))
        return cv2.flip(depth, 0), cv2.flip(ids, 0)

    @gl.drawing()
    def panorama(self, position: Position, size: int | None = None) -> Panorama:
        """Six cube faces of rgb, depth and ids around `position` (x, y, z)."""
        s = size or self.size
        rgb = np.stack([self.rgb(camera, (s, s)) for camera in face_cameras(position)])
        return Panorama(rgb, *self.seen(position, s))

    @gl.drawing()
    def seen(self, position: Position, size: int = 64) -> tuple[np.ndarray, np.ndarray]:
        """Depth and ids of the six faces without the colours: (6, s, s) float32 metres, (6, s, s) int32."""
        faces = [self.depth_and_ids(camera, (size, size)) for camera in face_cameras(position)]
        return np.stack([depth for depth, _ in faces]), np.stack([ids for _, ids in faces])

    def close(self) -> None:
        """Free what lies on the graphics side; the renderer cannot be used afterwards."""
        if self._drawing is not None:
            with gl.drawing():
                self._drawing.close()
            self._drawing = None
            give_memory_back()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _open(self) -> Geoms | Raster:
        if self._drawing is None:
            raise RuntimeError("the renderer is closed; make a new one")
        return self._drawing

    def _in_view(self, camera: Camera, size: Pixels) -> np.ndarray:
        """(ngeom,) bool: drawn and maybe seen: through doors and windows, with its box in the field of view."""
        drawing = self._open()
        forward, up = np.array(camera.forward), np.array(camera.up)
        right, tall = camera.right, math.tan(camera.vfov / 2)
        wide = tall * size[1] / size[0]
        planes = np.stack([forward * wide - right, forward * wide + right, forward * tall - up, forward * tall + up])
        planes /= np.sqrt((planes**2).sum(1, keepdims=True))
        apart = drawing.middles - np.array(camera.position)
        framed = (apart @ planes.T >= -drawing.reaches @ np.abs(planes.T) - 1e-3).all(1)
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
        spans = visibility.spans_of(np.array(camera.position), drawing.middles, drawing.reaches)
        mask = np.zeros_like(framed)
        mask[geoms[spans.within(sectors, geoms)]] = True
        return mask & framed

    def _drawn_size(self, size: Pixels) -> tuple[int, int]:
        """(height, width) at which colours of a picture of `size` are drawn."""
        return drawn_size(size) if self._software else size

    def _overlaid(self, rgb: np.ndarray, camera: Camera) -> np.ndarray:
        return rgb if self._overlay is None else self._overlay.over(rgb, camera)


def _bare_meshes(parts: Sequence[Part]) -> list[LitMesh]:
    """Meshes of what has faces, where it stands in the world, with nothing painted on."""
    meshes = []
    for p in parts:
        if len(p.mesh.faces):
            c, s = math.cos(p.yaw), math.sin(p.yaw)
            turned = p.mesh.vertices.astype(float) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
            xyz, uv = (turned + p.position).astype(np.float32), np.zeros((len(turned), 2), np.float32)
            meshes.append(LitMesh(p.owner, p.kind, p.room, 0, xyz, p.mesh.faces, uv))
    return meshes


def _geoms_by_room(
    house: House, owner_of_geom: Sequence[str], kinds: Sequence[str], rooms: Sequence[str]
) -> dict[str, np.ndarray]:
    """Room id to the geoms seen when that room is seen; joinery and stairs belong to both their rooms."""
    sides = {o.id: tuple(r or visibility.OUTDOORS for r in o.rooms) for o in house.openings}
    sides |= {s.id: s.rooms for s in house.stairs}
    everywhere = [*(r.id for r in house.rooms), visibility.OUTDOORS]
    geoms: dict[str, list[int]] = {}
    for g, (owner, kind) in enumerate(zip(owner_of_geom, kinds, strict=True)):
        if kind != "collision":
            here = tuple(everywhere) if rooms[g] == ANYWHERE else (rooms[g],)
            for room in sides.get(owner.partition("/")[0], here):
                geoms.setdefault(room, []).append(g)
    return {room: np.array(list_of, int) for room, list_of in geoms.items()}
