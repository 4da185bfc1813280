"""Draws a lit house with shaders of its own: colours, or depth and ids, with a handful of calls of OpenGL.

For where the CPU draws. MuJoCo's renderer leads every corner through lamps that a lit house does not have, changes its
state at every geom, and reads a page for every pixel of the blocks that a triangle touches. Here all meshes lie in one
buffer, and OpenGL notes for every pixel only which texel of the atlas is in front; OpenCV reads them.
"""

import ctypes
import math
from collections.abc import Collection, Mapping, Sequence

from embodied import gl

gl.prepare()

import cv2
import numpy as np
from OpenGL import GL

from embodied.render import atlas, coarser, shaders
from embodied.render.camera import FAR_PLANE, NEAR_PLANE, Camera, Pixels, Planes
from embodied.render.supersampling import nearest, step_of
from embodied.scene.lit_pages import LitMesh

CORNER = np.dtype([("xyz", "<f4", 3), ("at", "<f4", 2), ("id", "<u2"), ("opacity", "<u2")])
"""Of a corner: where it is, metres; its texel in the atlas; its owner's id; its opacity, 0 to 255."""
ATTRIBUTES = (("xyz", 3), ("at", 2), ("id", 2))
"""First fields, and how many numbers from there on, as shaders.CORNERS reads them."""
VERSION = (4, 5)
"""Of OpenGL, the oldest."""
NOWHERE = -9.0
"""Column and row of a pixel that shows nothing."""
SHADER_OUTPUTS = {
    "column": (GL.GL_R32F, GL.GL_RED, GL.GL_FLOAT, np.float32, NOWHERE),
    "row": (GL.GL_R32F, GL.GL_RED, GL.GL_FLOAT, np.float32, NOWHERE),
    "number": (GL.GL_R32UI, GL.GL_RED_INTEGER, GL.GL_INT, np.int32, 0),
    "near": (GL.GL_R32F, GL.GL_RED, GL.GL_FLOAT, np.float32, 0.0),
}
"""How what shaders write is kept and read, and what it is where nothing is; `near` is 1 over metres."""
FRAME_BUFFERS = {"places": ("column", "row"), "numbers": ("number", "near"), "all": tuple(SHADER_OUTPUTS)}
"""Numbers that shaders write, in their order."""
COARSE = 1.5
"""Widest cell of a copy that is drawn in place of a mesh, pixels: between 0 and 1.5 a picture of 128 x 128 loses 0.12
of 33.5 dB against one drawn eight times as large; at 2.5 one sees gaps between drawers close."""
HOLLOW_COARSE = 3.0
"""The same of hollow things, people: they keep 32 dB in a picture of 128 x 128 pixels, and 41 in one of 640 x 480."""


class Raster:
    """Owns the triangles and the pages of a house until `close`. Its methods are called within gl.drawing(); their
    pictures have fewer triangles where that cannot be seen."""

    def __init__(
        self,
        meshes: Sequence[LitMesh],
        ids: np.ndarray,
        pages: Sequence[np.ndarray],
        *,
        copied: bool = True,
        moving: Collection[int] = (),
        hollow: Collection[int] = (),
    ) -> None:
        """
        Args:
          ids: (meshes,) of their owners, below 65536.
          pages: (h, w, 3) uint8 each.
          copied: whether things get coarser copies; without, all is drawn whole.
          moving: numbers of the meshes that `move` may move; they have no copies.
          hollow: numbers of those that are seen from inside, too, unless they are small.
        """
        self._is_clear = np.array([m.alpha < 1 for m in meshes])
        lows, highs = (np.array([f(m.vertices, axis=0) for m in meshes], float) for f in (np.min, np.max))
        self.middles, self.reaches = (lows + highs) / 2, (highs - lows) / 2
        """(meshes, 3) metres, of the boxes that hold them and half their sizes."""
        used = [sorted({m.page for m in meshes if (m.alpha < 1) == clear}) for clear in (False, True)]
        pictures, places = zip(*(atlas.packed([pages[i] for i in some]) for some in used), strict=True)
        self._atlas, self._clear_pages = pictures[0], pictures[1] if moving else None
        place_of = [dict(zip(some, p, strict=True)) for some, p in zip(used, places, strict=True)]
        self._place_of, self._shapes = place_of, [p.shape[:2] for p in pages]
        self._buffers = [int(b) for b in GL.glGenBuffers(2)]
        self._array = int(GL.glGenVertexArrays(1))
        corners, triangles, self._starts, self._counts = _arranged(
            meshes, ids, pages, place_of, copied, frozenset(moving), frozenset(hollow)
        )
        self._coarse = np.where(np.isin(np.arange(len(meshes)), [*hollow]), HOLLOW_COARSE, COARSE)
        ends = np.cumsum([0, *(len(m.vertices) for m in meshes)])
        self._moving = {i: (int(ends[i]), int(ends[i + 1])) for i in moving}
        self._first_moving = min((at for at, _ in self._moving.values()), default=0)
        self._corners = corners[self._first_moving : max((at for _, at in self._moving.values()), default=0)].copy()
        _upload_corners(self._array, self._buffers, corners)
        self._triangles = triangles.astype(np.uint32)
        self._through, self._canvas = (int(t) for t in GL.glGenTextures(2))
        _make_texture(self._through, pictures[1].shape[:2], pictures[1])
        pixels = {"through": shaders.THROUGH, "numbers": shaders.NUMBERS, "places": shaders.PLACES, "all": shaders.ALL}
        size_of = {"through": pictures[1].shape, "numbers": (0, 0)}
        self._programs = {name: _program(p, size_of.get(name, pictures[0].shape)) for name, p in pixels.items()}
        self._frames = {name: int(GL.glGenFramebuffers(1)) for name in (*FRAME_BUFFERS, "canvas")}
        self._pictures = {name: int(GL.glGenRenderbuffers(1)) for name in (*SHADER_OUTPUTS, "depth")}
        GL.glUseProgram(0)
        self._size = (0, 0)

    def rgb(self, camera: Camera, size: Pixels, chosen: np.ndarray) -> np.ndarray:
        """(h, w, 4) uint8, bottom row first.

        Args:
          size: (height, width), pixels.
          chosen: (k,) numbers of the meshes to draw.
        """
        picture = self._coloured("places", camera, size, *self._sorted(camera, size, chosen))
        self._end()
        return picture

    def depth_and_ids(self, camera: Camera, size: Pixels, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(h, w) float32 metres along the optical axis, inf where no owner is, and (h, w) int32, bottom row first; as
        in `rgb`."""
        self._begin("numbers", size)
        self._draw("numbers", self._matrix(camera, size), self._ranges(camera, size, chosen))
        ids, near = (_read("numbers", name, size) for name in FRAME_BUFFERS["numbers"])
        self._end()
        return _metres(near), ids

    def view(self, camera: Camera, size: Pixels, drawn: Pixels, chosen: np.ndarray) -> Planes:
        """`rgb` of the size `drawn`, and `depth_and_ids` of `size`; from one pass where the pixels come out even.

        Then a pixel has the id of the nearest of the larger ones, whose middle is at most a third of a pixel from its
        own, and the depth of its surface in its own middle.
        """
        step = step_of(size, drawn)
        if step is None:
            picture = self.rgb(camera, drawn, chosen)
            return picture, *self.depth_and_ids(camera, size, chosen)
        solid, clear = self._sorted(camera, drawn, chosen)
        program = self._programs["all"][0]
        GL.glProgramUniform3f(program, GL.glGetUniformLocation(program, "drawn"), step, 1 / step, step / (step - 1))
        picture = self._coloured("all", camera, drawn, solid, clear)
        if len(clear):
            GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frames["all"])
            self._draw("all", self._matrix(camera, drawn), clear)
        ids, near = (nearest(_read("all", name, drawn), size) for name in FRAME_BUFFERS["numbers"])
        self._end()
        return picture, _metres(near), ids

    def move(self, meshes: Mapping[int, np.ndarray]) -> None:
        """Put the vertices (n, 3) float32 of moving meshes elsewhere, metres."""
        for mesh, vertices in meshes.items():
            begin, end = (at - self._first_moving for at in self._moving[mesh])
            self._corners["xyz"][begin:end] = vertices
            columns = np.ascontiguousarray(vertices.T)
            low, high = columns.min(1), columns.max(1)
            self.middles[mesh], self.reaches[mesh] = (low + high) / 2, (high - low) / 2
        first, last = min(self._moving[i][0] for i in meshes), max(self._moving[i][1] for i in meshes)
        part = self._corners[first - self._first_moving : last - self._first_moving]
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffers[0])
        GL.glBufferSubData(GL.GL_ARRAY_BUFFER, first * CORNER.itemsize, part.nbytes, part.view(np.uint8))
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, 0)

    def repaint(self, page: int, at: tuple[int, int], part: np.ndarray) -> None:
        """Show `part` (h, w, 3) uint8 from row and column `at` of a page on."""
        for picture, places in zip((self._atlas, self._clear_pages), self._place_of, strict=True):
            if picture is not None and page in places:
                atlas.repaint(picture, places[page], self._shapes[page], at, part)
                if picture is not self._atlas:
                    _make_texture(self._through, picture.shape[:2], picture)

    def close(self) -> None:
        """Free what lies on the graphics side."""
        GL.glDeleteBuffers(len(self._buffers), self._buffers)
        GL.glDeleteTextures(2, [self._through, self._canvas])
        GL.glDeleteVertexArrays(1, [self._array])
        GL.glDeleteFramebuffers(len(self._frames), list(self._frames.values()))
        GL.glDeleteRenderbuffers(len(self._pictures), list(self._pictures.values()))
        for program, _ in self._programs.values():
            GL.glDeleteProgram(program)

    def _sorted(self, camera: Camera, size: Pixels, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """`_ranges` of what is opaque, the nearest first, and of what shines through, the farthest first."""
        order = chosen[((self.middles[chosen] - np.array(camera.position)) ** 2).sum(1).argsort()]
        clear = self._is_clear[order]
        ranges = self._ranges(camera, size, order)
        return ranges[~clear], ranges[clear][::-1]

    def _ranges(self, camera: Camera, size: Pixels, chosen: np.ndarray) -> np.ndarray:
        """(k, 2) first and number of the triangles to draw of the meshes `chosen` (k,)."""
        forward = np.array(camera.forward)
        near = (self.middles[chosen] - np.array(camera.position)) @ forward - self.reaches[chosen] @ np.abs(forward)
        widest = self._coarse[chosen] * 2 * math.tan(camera.vfov / 2) / size[0] * np.maximum(near, 0)
        counts = self._counts[:, chosen]
        fits = (MESH_CELLS[: len(counts), None] <= widest) & (counts > 0)
        level = len(fits) - 1 - fits[::-1].argmax(0)
        return np.stack([self._starts[level, chosen], counts[level, np.arange(len(chosen))]], axis=1)

    def _coloured(self, frame: str, camera: Camera, size: Pixels, solid: np.ndarray, clear: np.ndarray) -> np.ndarray:
        """(h, w, 4) uint8, bottom row first, of what `_sorted` returned; what else is in `frame` is of what is
        solid."""
        matrix = self._matrix(camera, size)
        self._begin(frame, size)
        self._draw(frame, matrix, solid)
        column, row = (_read(frame, name, size) for name in FRAME_BUFFERS["places"])
        picture = cv2.remap(self._atlas, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        if not len(clear):
            return picture
        here = (0, 0, size[1], size[0], GL.GL_RGBA, GL.GL_UNSIGNED_BYTE)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self._canvas)
        GL.glTexSubImage2D(GL.GL_TEXTURE_2D, 0, *here, picture)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frames["canvas"])
        GL.glBindTexture(GL.GL_TEXTURE_2D, self._through)
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_SRC_ALPHA, GL.GL_ONE_MINUS_SRC_ALPHA)
        GL.glDepthMask(False)
        self._draw("through", matrix, clear)
        GL.glDepthMask(True)
        GL.glDisable(GL.GL_BLEND)
        GL.glReadPixels(*here, picture)
        return picture

    def _matrix(self, camera: Camera, size: Pixels) -> np.ndarray:
        """`projection` to the depths that this OpenGL takes at present; MuJoCo leaves it with 0 to 1."""
        mode = np.ravel(GL.glGetIntegerv(GL.GL_CLIP_DEPTH_MODE))[0]
        lowest = 0.0 if mode == GL.GL_ZERO_TO_ONE else -1.0
        return projection(camera, size, lowest)

    def _begin(self, frame: str, size: Pixels) -> None:
        if any(n > s for n, s in zip(size, self._size, strict=True)):
            self._size = max(size[0], self._size[0]), max(size[1], self._size[1])
            self._make_frames()
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frames[frame])
        GL.glViewport(0, 0, size[1], size[0])
        GL.glEnable(GL.GL_CULL_FACE)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDepthFunc(GL.GL_GREATER)
        GL.glDisable(GL.GL_DITHER)
        GL.glClearBufferfv(GL.GL_DEPTH, 0, (0.0,))
        for k, name in enumerate(FRAME_BUFFERS[frame]):
            clear = GL.glClearBufferiv if SHADER_OUTPUTS[name][3] is np.int32 else GL.glClearBufferfv
            clear(GL.GL_COLOR, k, (SHADER_OUTPUTS[name][4], 0, 0, 0))

    def _draw(self, program: str, matrix: np.ndarray, ranges: np.ndarray) -> None:
        """Triangles of `ranges` (k, 2)."""
        if not len(ranges):
            return
        triangles = np.concatenate([self._triangles[first : first + count] for first, count in ranges.tolist()])
        number, place = self._programs[program]
        GL.glUseProgram(number)
        GL.glUniformMatrix4fv(place, 1, True, matrix)
        GL.glBindVertexArray(self._array)
        GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, triangles.nbytes, triangles, GL.GL_STREAM_DRAW)
        GL.glDrawElements(GL.GL_TRIANGLES, triangles.size, GL.GL_UNSIGNED_INT, None)

    def _end(self) -> None:
        GL.glBindVertexArray(0)
        GL.glUseProgram(0)
        GL.glBindTexture(GL.GL_TEXTURE_2D, 0)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, 0)

    def _make_frames(self) -> None:
        """Frame buffers of `_size`, which share their pictures and one buffer of depths; the canvas is a texture."""
        forms = {name: form for name, (form, *_) in SHADER_OUTPUTS.items()} | {"depth": GL.GL_DEPTH_COMPONENT32F}
        for name, picture in self._pictures.items():
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, picture)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, forms[name], *self._size[::-1])
        _make_texture(self._canvas, self._size, None)
        for frame, number in self._frames.items():
            GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, number)
            places = [GL.GL_COLOR_ATTACHMENT0 + k for k in range(len(FRAME_BUFFERS.get(frame, "1")))]
            for place, name in zip(
                (GL.GL_DEPTH_ATTACHMENT, *places), ("depth", *FRAME_BUFFERS.get(frame, ())), strict=False
            ):
                GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, place, GL.GL_RENDERBUFFER, self._pictures[name])
            if frame == "canvas":
                GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, places[0], self._canvas, 0)
            GL.glDrawBuffers(len(places), places)
            if GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER) != GL.GL_FRAMEBUFFER_COMPLETE:
                raise gl.GLError(
                    f"this OpenGL has no frame buffer of {self._size[1]} x {self._size[0]} pixels for {frame}"
                )


def able() -> bool:
    """True where the OpenGL of this process, within gl.drawing(), knows what a `Raster` needs."""
    return (GL.glGetIntegerv(GL.GL_MAJOR_VERSION), GL.glGetIntegerv(GL.GL_MINOR_VERSION)) >= VERSION


def projection(camera: Camera, size: Pixels, lowest: float) -> np.ndarray:
    """(4, 4) float32 from metres of the world to clip space, of depth 1 at NEAR_PLANE and `lowest` at FAR_PLANE."""
    forward, up = np.array(camera.forward), np.array(camera.up)
    tall = math.tan(camera.vfov / 2)
    rows = np.empty((4, 4))
    rows[0, :3], rows[1, :3] = camera.right / (tall * size[1] / size[0]), up / tall
    rows[2, :3], rows[3, :3] = forward * ((lowest * FAR_PLANE - NEAR_PLANE) / (FAR_PLANE - NEAR_PLANE)), forward
    rows[:, 3] = -rows[:, :3] @ np.array(camera.position)
    rows[2, 3] += (1 - lowest) * NEAR_PLANE * FAR_PLANE / (FAR_PLANE - NEAR_PLANE)
    return rows.astype(np.float32)


MESH_CELLS = np.array([0.0, *coarser.COPY_CELLS])


def _arranged(
    meshes: Sequence[LitMesh],
    ids: np.ndarray,
    pages: Sequence[np.ndarray],
    place_of: Sequence[Mapping[int, np.ndarray]],
    copied: bool,
    moving: frozenset[int],
    hollow: frozenset[int],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(n,) CORNER and (m, 3) triangles of all meshes and of coarser copies of the things among them; and where those
    of each mesh begin and how many they are, (MESH_CELLS, meshes) each."""
    sizes = [len(m.vertices) for m in meshes]
    corners, number = np.zeros(sum(sizes), CORNER), np.repeat(np.arange(len(meshes)), sizes)
    first = np.cumsum(sizes) - sizes
    for m, owner, at in zip(meshes, ids, first, strict=True):
        part = corners[at : at + len(m.vertices)]
        part["xyz"], part["id"] = m.vertices, owner
        part["at"] = m.uv * np.array(pages[m.page].shape[1::-1], np.float32) + place_of[int(m.alpha < 1)][m.page]
        part["opacity"] = round(255 * (1 - (1 - m.alpha) ** 2))  # MuJoCo draws what shines through twice
    triangles = np.concatenate([m.faces + at for m, at in zip(meshes, first, strict=True)])
    backs = [np.concatenate([m.faces, m.faces[:, ::-1]]) if i in hollow else m.faces for i, m in enumerate(meshes)]
    shown = np.concatenate([f + at for f, at in zip(backs, first, strict=True)])
    whole = coarser.Corners(corners["xyz"], corners["at"], number, triangles)
    things = np.array([m.kind == "object" and i not in moving for i, m in enumerate(meshes)])
    copies = coarser.copies(whole, len(meshes), things) if copied else []
    more = [corners[first[c.mesh]] for c in copies]
    for copy, part in zip(copies, more, strict=True):
        part["xyz"], part["at"] = copy.xyz, copy.uv
    begin = np.cumsum([len(corners), *(len(part) for part in more)])[:-1]
    faces = [shown, *(c.faces + b for c, b in zip(copies, begin, strict=True))]
    whose = [number[shown[:, 0]], *(c.mesh[c.faces[:, 0]] for c in copies)]
    counts = np.array([np.bincount(w, minlength=len(meshes)) for w in whose])
    starts = np.cumsum(counts).reshape(counts.shape) - counts
    return np.concatenate([corners, *more]), np.concatenate(faces), starts, counts


def _upload_corners(array: int, buffers: Sequence[int], corners: np.ndarray) -> None:
    """Fill the first of two buffers; the other gets the triangles to draw."""
    GL.glBindVertexArray(array)
    GL.glBindBuffer(GL.GL_ARRAY_BUFFER, buffers[0])
    GL.glBufferData(GL.GL_ARRAY_BUFFER, corners.nbytes, corners.view(np.uint8), GL.GL_STATIC_DRAW)
    GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, buffers[1])
    for k, (name, count) in enumerate(ATTRIBUTES):
        form, offset = CORNER.fields[name][:2]  # type: ignore[index]
        kind = GL.GL_FLOAT if form.base == np.float32 else GL.GL_UNSIGNED_SHORT
        if name == "id":
            GL.glVertexAttribIPointer(k, count, kind, CORNER.itemsize, ctypes.c_void_p(offset))
        else:
            GL.glVertexAttribPointer(k, count, kind, False, CORNER.itemsize, ctypes.c_void_p(offset))
        GL.glEnableVertexAttribArray(k)
    GL.glBindVertexArray(0)
    GL.glBindBuffer(GL.GL_ARRAY_BUFFER, 0)


def _make_texture(texture: int, size: Pixels, picture: np.ndarray | None) -> None:
    """(h, w, 4) uint8 without smaller copies."""
    GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
    form = GL.GL_RGBA
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, GL.GL_RGBA8, size[1], size[0], 0, form, GL.GL_UNSIGNED_BYTE, picture)
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR)
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR)
    GL.glBindTexture(GL.GL_TEXTURE_2D, 0)


def _read(frame: str, name: str, size: Pixels) -> np.ndarray:
    """(h, w) of a picture of the bound frame."""
    _, kind, number, dtype, _ = SHADER_OUTPUTS[name]
    out = np.empty(size, dtype)
    GL.glReadBuffer(GL.GL_COLOR_ATTACHMENT0 + FRAME_BUFFERS[frame].index(name))
    GL.glReadPixels(0, 0, size[1], size[0], kind, number, out)
    return out


def _metres(near: np.ndarray) -> np.ndarray:
    """(h, w) float32 metres from 1 over them; inf where that is 0."""
    with np.errstate(divide="ignore"):
        return np.float32(1) / near


def _program(pixels: str, size: Sequence[int]) -> tuple[int, int]:
    """A program of shaders.CORNERS and `pixels` for an atlas of `size`, and where its camera is."""
    program = GL.glCreateProgram()
    for kind, source in ((GL.GL_VERTEX_SHADER, shaders.CORNERS), (GL.GL_FRAGMENT_SHADER, pixels)):
        shader = GL.glCreateShader(kind)
        GL.glShaderSource(shader, source.replace("LEVELS", str(atlas.LEVELS)))
        GL.glCompileShader(shader)
        GL.glAttachShader(program, shader)
        GL.glDeleteShader(shader)
    GL.glLinkProgram(program)
    if not GL.glGetProgramiv(program, GL.GL_LINK_STATUS):
        raise gl.GLError(f"this OpenGL does not take a shader of embodied: {GL.glGetProgramInfoLog(program)}")
    GL.glUseProgram(program)
    GL.glUniform2f(GL.glGetUniformLocation(program, "pages"), size[1] * 2 / 3, size[0])
    return int(program), int(GL.glGetUniformLocation(program, "camera"))
