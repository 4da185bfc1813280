"""Gloss: reflections laid over pictures of a lit house, by rays from what is seen into the baked light.

A page holds the light that a surface sends to everybody; what it mirrors depends on who looks. Here the glossy pixels
of a picture that is drawn already send one ray each: to the surface, whose roughness, specular and metallic share are
known per face, and on by its lobe to what it mirrors, whose light is read from the same pages. Rough surfaces are
looked at in half the resolution, each pixel along another direction of the lobe, and averaged over their neighbours on
the same surface; smooth ones in full. The directions depend on the pixel alone, so that frames of a video do not
flicker against each other. Depth and ids stay.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from embodied.render.camera import Camera, pixel_rays
from embodied.render.detail import Detail
from embodied.render.film import light_of, shown_of
from embodied.render.mirrored import FINE_TILE, TILE, Mirrored, evened, interleaved, lobe
from embodied.scene.lit_pages import LitMesh, LitPages, glass_surfaces

Rays = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]
"""From starts and directions, (n, 3) each, to what is met first, (n,) each: triangle (-1 for none), distance in lengths
of the direction, and how much of the triangle's second and third corner is in that place."""
MATTE = 0.7
"""Roughness from which on nothing is looked for: the lobe is so wide that three views gained 0.0 to 0.3 dB by it and
cost half as much again."""
FAINT = 0.006
"""Share of the light that has to be mirrored for a ray to be worth it."""
SMOOTH = 0.12
"""Roughness below which every pixel looks for itself: mirrors, panes, tiles, polished metal."""
METALLIC = 0.3
"""Metallic share from which on a page wears a picture of what the face mirrors for somebody in the middle of the
room."""
BRIGHTEST = 12.0
"""Reflected light is cut at this multiple of what is shown as a white sheet, as in the tracer."""
COARSER = 4
"""Texels of a page, in one direction, that are averaged for what rough surfaces mirror."""
PANE_STEP = 4
"""Panes are looked for in every n-th pixel; thinner ones mirror nothing."""
CLOUDY = 0.5
"""Opacity from which on things hide what lies behind them, as shades of lamps and sheer curtains do."""
LIFT = 1e-3
"""Metres that a ray begins above its surface."""
SUBPIXEL_OFFSETS = ((-0.25, -0.25), (0.25, 0.25))
"""Places in a pixel where smooth surfaces are looked at, from its centre: no two in a row or column."""
MIN_SAMPLES = 24.0
"""Rays averaged on a surface below which each of its pixels sends UNDERSAMPLED_RAYS: on thin bars what few rays find
would jump from frame to frame of a video, as the pattern of directions lies still in the picture."""
VISIBLE_GLOSS = 0.02
"""Mirrored light, of that of a white sheet, below which that goes unnoticed."""
UNDERSAMPLED_RAYS = 8
"""Rays of each of those pixels."""
BRUSHED = 4
"""Rays of each pixel of polished metal that is not smooth, in each of SUBPIXEL_OFFSETS."""
BETWEEN = 0.5
"""Tangent of the angle between two directions in which a picture of polished metal looks, for the square of its
roughness: the bright edge of a window would show once in each."""
WHITE = 5.0
"""Light that is shown as full white: no more of it counts where a pixel is averaged, or edges would be ragged."""
DOUBLE_GLAZING = 0.81
"""Share of the outdoors' light that comes in through double glazing, as the bake has it."""
PANE_F0 = 0.04
"""Share of the light that one surface of glass mirrors straight ahead (refractive index 1.5)."""


@dataclass(frozen=True, eq=False)
class GlossData:
    """A house's gloss besides its pages; each sequence goes with LitPages.meshes or .pages."""

    gloss: Sequence[np.ndarray | None]
    """Per mesh (m, 3) uint8: roughness, specular and metallic share of each face, times 255; None: matte."""
    tint: Sequence[np.ndarray | None]
    """Per mesh (m, 3) float32 linear colour of each face; None where none is of metal."""
    glow: Sequence[np.ndarray | None]
    """Per page (h, w, 3) radiance of what glows; None where nothing does."""
    gain_at: Callable[[np.ndarray], np.ndarray]
    """From points (n, 3) to what light is multiplied by there before it is shown, (n, 3)."""
    outdoors: np.ndarray
    """(3,) what light is multiplied by that windows show."""
    middle: float
    """Factor of light in rooms, in the median."""
    detail: Sequence[np.ndarray | None] = ()
    """Per mesh (m,) uint8 of each face (embodied.render.detail); empty: none shows any."""


@dataclass(frozen=True, eq=False)
class _Faces:
    """All opaque faces of a house, m, one after another."""

    corners: np.ndarray
    """(m, 3, 3) float32 metres."""
    normal: np.ndarray
    """(m, 3) float32."""
    uv: np.ndarray
    """(m, 3, 2) float32."""
    page: np.ndarray
    """(m,) int32."""
    owner: np.ndarray
    """(m,) int32, of meshes."""
    gloss: np.ndarray
    """(m, 3) float32 roughness, specular, metallic; zero where matte."""
    tint: np.ndarray
    """(m, 3) float32."""
    outer: np.ndarray
    """(m,) bool, beyond the windows."""
    detail: np.ndarray
    """(m,) uint8, as of `GlossData`; 0 for none."""


@dataclass(frozen=True, eq=False)
class _Panes:
    """Clear, smooth glass, k faces."""

    first: Rays
    normal: np.ndarray
    """(k, 3) float32."""
    surfaces: np.ndarray
    """(k,) float32 how many surfaces of glass stand behind one another."""


class Gloss:
    """Owns the faces of a lit house, arranged for rays, and its light, coarser than the pages."""

    def __init__(
        self, lit: LitPages, data: GlossData, rays_among: Callable[[np.ndarray], Rays], moving: Sequence[int] = ()
    ) -> None:
        """
        Args:
          rays_among: from triangles (m, 3, 3) to rays among them.
          moving: numbers of the last meshes, which `change` may move.
        """
        self._faces = _faces_of(lit, data)
        self._pages, self._own = list(lit.pages), set[int]()
        gloss = self._faces.gloss
        self._mirrors = np.append((gloss[:, 0] < MATTE) & (gloss[:, 1] > 0), False)  # nothing that is met is face -1
        self._moving, self._rays_among = {i: lit.meshes[i].faces for i in moving}, rays_among
        self._fixed = int(np.searchsorted(self._faces.owner, moving[0])) if moving else len(self._faces.owner)
        self._first = self._first_fixed = rays_among(self._faces.corners[: self._fixed])
        self._panes = _panes_of(lit.meshes[: moving[0]] if moving else lit.meshes, rays_among)
        self._gain_at, self._beyond = data.gain_at, data.outdoors / DOUBLE_GLAZING
        some_of_page = {m.page: m.vertices.mean(0)[None] for m in lit.meshes if len(m.vertices)}
        gains = [data.gain_at(some_of_page[i])[0] if i in some_of_page else None for i in range(len(lit.pages))]
        small = [_coarse(*one) for one in zip(lit.pages, data.glow, gains, strict=True)]
        self._width = np.array([s.shape[1] for s in small], np.int32)
        self._height = np.array([s.shape[0] for s in small], np.int32)
        texels = self._width.astype(np.int64) * self._height
        self._base = np.cumsum(texels) - texels
        self._light = np.concatenate([s.reshape(-1, 3) for s in small])
        self._middle = data.middle
        self._detail = Detail(self._faces.corners, self._faces.normal, self._faces.detail)

    def change(self, corners: Mapping[int, np.ndarray], patches: Sequence[tuple[int, int, int, np.ndarray]]) -> None:
        """Move meshes, and repaint parts of pages, as Renderer.change does."""
        faces = self._faces
        for number, vertices in corners.items():
            rows = np.flatnonzero(faces.owner == number)
            if len(rows):
                faces.corners[rows] = vertices[self._moving[number]]
        if corners and self._fixed < len(faces.owner):
            moved = faces.corners[self._fixed :]
            sides = moved[:, 1:] - moved[:, :1]
            normal = np.cross(sides[:, 0], sides[:, 1])
            faces.normal[self._fixed :] = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
            self._first = _nearer(self._first_fixed, self._rays_among(moved), self._fixed)
        for page, row, column, part in patches:
            self._repaint(page, row, column, part)

    def _repaint(self, page: int, row: int, column: int, part: np.ndarray) -> None:
        if page not in self._own:
            self._pages[page] = self._pages[page].copy()
            self._own.add(page)
        picture = self._pages[page]
        picture[row : row + part.shape[0], column : column + part.shape[1]] = part
        h, w = self._height[page], self._width[page]
        light = self._light[self._base[page] : self._base[page] + h * w].reshape(h, w, 3)
        top, left = row // COARSER, column // COARSER
        bottom, right = min(-(-(row + part.shape[0]) // COARSER), h), min(-(-(column + part.shape[1]) // COARSER), w)
        if bottom > top and right > left:
            some = picture[top * COARSER : bottom * COARSER, left * COARSER : right * COARSER]
            size = (int(right - left), int(bottom - top))
            light[top:bottom, left:right] = cv2.resize(light_of(some), size, interpolation=cv2.INTER_AREA)

    def over(self, rgb: np.ndarray, camera: Camera) -> np.ndarray:
        """The picture (h, w, 3) uint8 that `camera` drew, with what its surfaces mirror; matte pixels stay."""
        h, w = rgb.shape[:2]
        out = np.array(rgb)
        half = (h + 1) // 2, (w + 1) // 2
        ahead = pixel_rays(camera, (h, w), step=2)
        met = self._met(camera, ahead)
        self._detail.lay(out, camera, pixel_rays(camera, (h, w)), *met)
        seen = self._seen(ahead, *met)
        if seen.rough.any():
            values = self._enlarged(camera, self._rough(seen.of(seen.rough), camera, half), (h, w))
            where = np.flatnonzero(values[0])
            lost, mirrored = values[0].ravel()[where, None], values[1:].reshape(3, -1)[:, where].T
            own = light_of(out.reshape(-1, 3)[where])
            out.reshape(-1, 3)[where] = shown_of(own * (1 - lost) + mirrored)
        if seen.sharp.any():
            sharp = np.zeros(half, np.uint8)
            sharp.ravel()[seen.pixel[seen.sharp]] = 1
            near = cv2.dilate(sharp, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)))
            self._lay_smooth(out, rgb, camera, _twice(near)[:h, :w])
        if self._panes is not None:
            self._lay_panes(out, camera, self._panes)
        return out

    def _met(self, camera: Camera, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n,) face (-1 for none) and distance of what is seen along directions (n, 3) from a camera."""
        origin = np.broadcast_to(np.asarray(camera.position, np.float32), directions.shape)
        return self._first(origin, directions)[:2]

    def _seen(
        self, directions: np.ndarray, face: np.ndarray, distance: np.ndarray, pixels: np.ndarray | None = None
    ) -> _Seen:
        """Hits that mirror, of those met along directions (n, 3), `pixels` of a picture."""
        faces = self._faces
        hit = np.flatnonzero(self._mirrors[face])
        face, ahead = face[hit], directions[hit]
        gloss = faces.gloss[face]
        cos = -np.einsum("ij,ij->i", faces.normal[face], ahead)
        facing = np.where(cos < 0, np.float32(-1), np.float32(1))
        metal = gloss[:, 2]
        f0 = 0.08 * gloss[:, 1] * (1 - metal) + metal
        worth = schlick(f0, np.abs(cos), gloss[:, 0]) > FAINT
        pixels = hit if pixels is None else pixels[hit]
        sharp = (gloss[:, 0] < SMOOTH) | (metal > METALLIC)
        normal = faces.normal[face] * facing[:, None]
        return _Seen(pixels, face, distance[hit], ahead, normal, gloss[:, 0], worth & ~sharp, worth & sharp, hit)

    def _mirrored(self, camera: Camera, seen: _Seen, half: np.ndarray, *, sharp: bool) -> tuple[np.ndarray, np.ndarray]:
        """Shares of their own light that surfaces lose, and what they send for it, each (n, 3) exposed.

        Args:
          half: (n, 3) half vectors: the normals that the rays are mirrored at.
        """
        faces = self._faces
        c = np.maximum(-np.einsum("ij,ij->i", seen.ahead, half), 0)[:, None]
        onward = seen.ahead + 2 * c * half
        above = np.einsum("ij,ij->i", onward, seen.normal)[:, None] > 0
        start = np.asarray(camera.position, np.float32) + seen.ahead * seen.distance[:, None] + seen.normal * LIFT
        light = self._arriving(start, onward, sharp=sharp) * self._gain_at(start)
        gloss = faces.gloss[seen.face]
        rough, specular, metal = gloss[:, :1], gloss[:, 1:2], gloss[:, 2:]
        f0 = 0.08 * specular * (1 - metal) + faces.tint[seen.face] * metal
        f = schlick(f0, c, rough) * above
        return (1 - (1 - metal) * (1 - f)) * above, light * f

    def _lay_panes(self, out: np.ndarray, camera: Camera, panes: _Panes) -> None:
        """Lay what panes of glass mirror over `out` (h, w, 3): windows at night show the room."""
        h, w = out.shape[:2]
        rough = pixel_rays(camera, (h, w), step=PANE_STEP)
        at = np.asarray(camera.position, np.float32)
        shape = (-(-h // PANE_STEP), -(-w // PANE_STEP))
        on_pane = (panes.first(np.broadcast_to(at, rough.shape), rough)[0] >= 0).reshape(shape)
        if not on_pane.any():
            return
        near = cv2.dilate(on_pane.astype(np.uint8), np.ones((3, 3), np.uint8)).repeat(PANE_STEP, 0).repeat(PANE_STEP, 1)
        pixels = np.flatnonzero(near[:h, :w])
        ahead = pixel_rays(camera, (h, w), pixels)
        origin = np.broadcast_to(at, ahead.shape)
        pane, distance, _, _ = panes.first(origin, ahead)
        hit = np.flatnonzero(pane >= 0)
        solid, behind, _, _ = self._first(origin[hit], ahead[hit])
        hit = hit[(solid < 0) | (distance[hit] < behind)]
        if not len(hit):
            return
        pane, ahead, pixels = pane[hit], ahead[hit], pixels[hit]
        c = -np.einsum("ij,ij->i", panes.normal[pane], ahead)[:, None]
        onward, c = ahead + 2 * c * panes.normal[pane], np.abs(c)
        start = at + ahead * distance[hit, None] + onward * LIFT
        light = self._arriving(start, onward, sharp=True) * self._gain_at(start)
        share = stacked(schlick(np.full_like(c, PANE_F0), c, np.zeros_like(c)), panes.surfaces[pane][:, None])
        flat = out.reshape(-1, 3)
        flat[pixels] = shown_of(light_of(flat[pixels]) * (1 - share) + np.minimum(light, WHITE) * share)

    def _arriving(self, start: np.ndarray, onward: np.ndarray, *, sharp: bool) -> np.ndarray:
        """(n, 3) light that comes from where rays go, before it is exposed."""
        face, far, u, v = self._first(start, onward)
        there = start + onward * np.where(face >= 0, far, 0)[:, None]
        gain = np.where(self._faces.outer[face][:, None], self._beyond, self._gain_at(there))
        return np.minimum(self._light_at(face, u, v, sharp=sharp) / gain, BRIGHTEST / self._middle)

    def _light_at(self, face: np.ndarray, u: np.ndarray, v: np.ndarray, *, sharp: bool) -> np.ndarray:
        """(n, 3) exposed light of the places where rays ended."""
        faces, hit = self._faces, face >= 0
        face = np.where(hit, face, 0)
        corners = faces.uv[face]
        at = corners[:, 0] + u[:, None] * (corners[:, 1] - corners[:, 0]) + v[:, None] * (corners[:, 2] - corners[:, 0])
        page = faces.page[face]
        x = np.clip(at[:, 0] * self._width[page], 0, self._width[page] - 1).astype(np.int64)
        y = np.clip(at[:, 1] * self._height[page], 0, self._height[page] - 1).astype(np.int64)
        light = self._light[self._base[page] + y * self._width[page] + x]
        if sharp:
            light = np.where((light > 4.0).any(1)[:, None], light, self._fine(page, at))
        light[~hit] = 0
        return light

    def _fine(self, page: np.ndarray, at: np.ndarray) -> np.ndarray:
        """(n, 3) exposed light at places (n, 2) of whole pages, between texels."""
        out, order = np.empty((len(page), 3), np.float32), np.argsort(page, kind="stable")
        if not len(page):
            return out
        ends = np.flatnonzero(np.diff(page[order], append=-1)) + 1
        for i in np.split(order, ends[:-1]):
            picture = self._pages[page[i[0]]]
            h, w = picture.shape[:2]
            x, y = (np.clip(at[i, k] * n - 0.5, 0, n - 1) for k, n in ((0, w), (1, h)))
            x0, y0 = x.astype(np.int32), y.astype(np.int32)
            x1, y1, fx, fy = np.minimum(x0 + 1, w - 1), np.minimum(y0 + 1, h - 1), (x - x0)[:, None], (y - y0)[:, None]
            upper = picture[y0, x0] * (1 - fx) + picture[y0, x1] * fx
            lower = picture[y1, x0] * (1 - fx) + picture[y1, x1] * fx
            out[i] = light_of(upper * (1 - fy) + lower * fy)
        return out

    def _rough(self, seen: _Seen, camera: Camera, size: tuple[int, int]) -> Mirrored:
        """Light that rough surfaces lose and mirror in a picture of half the size, averaged over neighbours on the same
        surface; what they lose is the mean of the colours."""
        row, column = np.divmod(seen.pixel, size[1])
        k = interleaved(TILE)[row % TILE, column % TILE]
        grid = Mirrored(size, seen.pixel, self._faces.owner[seen.face], seen.normal)
        values = self._averaged(camera, seen, k, TILE * TILE, 1, sharp=False)
        rays = np.ones(len(k), np.float32)
        grid.smooth(values[:, :3].mean(1), values[:, 3:], rays)
        undersampled = (grid.averaged < MIN_SAMPLES) & (
            grid.values[1:].reshape(3, -1)[:, seen.pixel].max(0) > VISIBLE_GLOSS
        )
        if undersampled.any():
            values[undersampled] = self._averaged(
                camera, seen.of(undersampled), k[undersampled], TILE * TILE, UNDERSAMPLED_RAYS, sharp=False
            )
            rays[undersampled] = UNDERSAMPLED_RAYS
            grid.smooth(values[:, :3].mean(1), values[:, 3:], rays)
        return grid

    def _averaged(
        self, camera: Camera, seen: _Seen, k: np.ndarray, count: int, rays: int, *, sharp: bool
    ) -> np.ndarray:
        """(n, 6) `_mirrored`, both side by side, as the mean of so many rays of each pixel.

        Args:
          k: (n,) which of `count` parts of the lobe each pixel looks into.
        """
        several = seen.of(np.repeat(np.arange(len(k)), rays))
        u = lobe(count * rays)[(k[:, None] * rays + np.arange(rays)).ravel()]
        half = _half_vectors(several.normal, several.roughness, u)
        values = np.concatenate(self._mirrored(camera, several, half, sharp=sharp), axis=1)
        return values.reshape(len(k), rays, 6).mean(1)

    def _enlarged(self, camera: Camera, grid: Mirrored, size: tuple[int, int]) -> np.ndarray:
        """(4, h, w) what is lost and mirrored, in full size: between surfaces every pixel asks whose it is."""
        h, w = size
        values = np.stack([_twice(plane, cv2.INTER_LINEAR)[:h, :w] for plane in grid.values])
        pixels = np.flatnonzero(_twice(grid.edges())[:h, :w])
        if not len(pixels):
            return values
        flat = values.reshape(4, -1)
        flat[:, pixels] = 0
        ahead = pixel_rays(camera, size, pixels)
        seen = self._seen(ahead, *self._met(camera, ahead), pixels)
        seen = seen.of(seen.rough)
        near = grid.nearest(*np.divmod(seen.pixel, w), self._faces.owner[seen.face], seen.normal)
        flat[:, seen.pixel] = near.T
        return values

    def _lay_smooth(self, out: np.ndarray, rgb: np.ndarray, camera: Camera, where: np.ndarray) -> None:
        """Write what mirrors and polished things show into `out`, looking once for every pixel in `where` (h, w)."""
        pixels = np.flatnonzero(where)
        all_pixels = np.tile(pixels, len(SUBPIXEL_OFFSETS))
        aside = np.repeat(np.array(SUBPIXEL_OFFSETS, np.float32), len(pixels), axis=0)
        ahead = pixel_rays(camera, rgb.shape[:2], all_pixels, aside=aside)
        seen = self._seen(ahead, *self._met(camera, ahead), all_pixels)
        turn = np.repeat(np.arange(len(SUBPIXEL_OFFSETS)), len(pixels))
        row, column = np.divmod(all_pixels, rgb.shape[1])
        rows, columns = FINE_TILE
        k = ((row % rows) * columns + column % columns) * len(SUBPIXEL_OFFSETS) + turn
        k = k[seen.which[seen.sharp]]
        seen = seen.of(seen.sharp)
        if not len(seen.pixel):
            return
        polished = seen.roughness < SMOOTH
        both = np.empty((len(k), 6), np.float32)
        clear = seen.of(polished)
        both[polished] = np.concatenate(self._mirrored(camera, clear, clear.normal, sharp=True), axis=1)
        count = rows * columns * len(SUBPIXEL_OFFSETS)
        both[~polished] = self._averaged(camera, seen.of(~polished), k[~polished], count, BRUSHED, sharp=True)
        lost, mirrored = both[:, :3], both[:, 3:]
        which = seen.which % len(pixels)
        there = np.bincount(which, minlength=len(pixels)) > 0
        mean = lambda a: np.bincount(which, a, len(pixels))[there] / len(SUBPIXEL_OFFSETS)
        values = np.stack([mean(a) for a in (*lost.T, *np.minimum(mirrored, WHITE).T)], axis=1)
        where, rough = pixels[there], mean(seen.roughness >= SMOOTH) > 0.5
        focal = rgb.shape[0] / (2 * math.tan(camera.vfov / 2))
        apart = np.where(rough, np.ceil(BETWEEN * focal * np.square(mean(seen.roughness))), 0).astype(int)
        for wide in np.unique(apart[rough]).tolist():
            values[apart == wide] = evened(values[apart == wide], where[apart == wide], rgb.shape[:2], wide)
        own = light_of(out.reshape(-1, 3)[where])
        out.reshape(-1, 3)[where] = shown_of(own * (1 - values[:, :3]) + values[:, 3:])


@dataclass(frozen=True, eq=False)
class _Seen:
    """First hits of n rays."""

    pixel: np.ndarray
    """(n,) flat positions in the picture."""
    face: np.ndarray
    distance: np.ndarray
    ahead: np.ndarray
    """(n, 3) the rays."""
    normal: np.ndarray
    """(n, 3) towards the camera."""
    roughness: np.ndarray
    rough: np.ndarray
    sharp: np.ndarray
    """(n,) bool: it mirrors enough to look, and is looked at in half the size or in full."""
    which: np.ndarray
    """(n,) of the rays that were sent."""

    def of(self, which: np.ndarray) -> _Seen:
        """Some of them."""
        return _Seen(**{name: values[which] for name, values in vars(self).items()})


def _twice(a: np.ndarray, way: int = cv2.INTER_NEAREST) -> np.ndarray:
    """(2 h, 2 w) of (h, w)."""
    return cv2.resize(a, (2 * a.shape[1], 2 * a.shape[0]), interpolation=way)


def schlick(f0: np.ndarray, cos: np.ndarray, rough: np.ndarray) -> np.ndarray:
    """Share of the light that is mirrored: Schlick 1994, less at grazing angles on rough surfaces, as in the tracer."""
    grazing = np.square(np.square(1 - cos)) * (1 - cos)
    return f0 + (1 - f0) * grazing * (1 - 0.9 * np.square(rough))


def stacked(f: np.ndarray, surfaces: np.ndarray) -> np.ndarray:
    """Share of the light that surfaces behind one another mirror, f each, with all light to and fro between them.

    Source: Stokes 1862 for plates that take nothing of the light: n f / (1 + (n - 1) f).
    """
    return surfaces * f / (1 + (surfaces - 1) * f)


def _half_vectors(normal: np.ndarray, rough: np.ndarray, u: np.ndarray) -> np.ndarray:
    """(n, 3) float32 directions in the lobes around `normal`, for numbers (n, 2) in [0, 1).

    Source: Walter et al. 2007 eq. 35 and 36 (GGX), the far tail left out as in the tracer; basis of Duff et al. 2017.
    """
    u0, u1 = u.T
    a2 = np.square(np.maximum(np.square(rough), 1e-3))
    cos = np.sqrt((1 - u0) / (1 + (a2 - 1) * u0))
    sin, phi = np.sqrt(np.maximum(1 - cos * cos, 0)), 2 * math.pi * u1
    x, y, z = normal.T
    sign = np.where(z < 0, np.float32(-1), np.float32(1))
    a = -1 / (sign + z)
    b = x * y * a
    one = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    two = np.stack([b, sign + y * y * a, -y], axis=1)
    half = one * (sin * np.cos(phi))[:, None] + two * (sin * np.sin(phi))[:, None] + normal * cos[:, None]
    return half.astype(np.float32)


def _faces_of(lit: LitPages, data: GlossData) -> _Faces:
    """The faces of what is hardly seen through, and of the sky; what is a little mirrors nothing."""
    solid = [(i, m) for i, m in enumerate(lit.meshes) if m.alpha >= CLOUDY and len(m.faces)]
    each = lambda value: np.concatenate([np.full(len(m.faces), value(i, m)) for i, m in solid])
    corners = np.concatenate([m.vertices[m.faces] for _, m in solid]).astype(np.float32)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    outer = each(lambda i, m: m.kind == "outdoor")
    known = lambda of, *shape: np.concatenate(
        [np.zeros((len(m.faces), *shape), np.uint8) if not len(of) or of[i] is None else of[i] for i, m in solid]
    )
    gloss = known(data.gloss, 3).astype(np.float32) / 255
    gloss[outer] = 0
    gloss[each(lambda i, m: m.alpha < 0.9)] = 0
    gloss[np.concatenate([_glowing(m, data.glow[m.page]) for _, m in solid])] = 0
    return _Faces(
        corners,
        (normal / np.maximum(length, 1e-12)).astype(np.float32),
        np.concatenate([m.uv[m.faces] for _, m in solid]).astype(np.float32),
        each(lambda i, m: m.page).astype(np.int32),
        each(lambda i, m: i).astype(np.int32),
        gloss,
        known(data.tint, 3).astype(np.float32),
        outer,
        known(data.detail),
    )


def _glowing(mesh: LitMesh, glow: np.ndarray | None) -> np.ndarray:
    """(m,) bool: faces that give light of their own, beside which what they mirror is nothing."""
    if glow is None:
        return np.zeros(len(mesh.faces), bool)
    corners = mesh.uv[mesh.faces]
    at = np.concatenate([corners, corners.mean(1, keepdims=True)], axis=1)
    return texels_at(glow, at).max((1, 2)) > 0


def texels_at(picture: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """(..., c) values of a picture (h, w, c) at places (..., 2) of it, v down."""
    h, w = picture.shape[:2]
    x, y = (np.clip(uv[..., k] * n, 0, n - 1).astype(int) for k, n in ((0, w), (1, h)))
    values: np.ndarray = picture[y, x]
    return values


def _nearer(first: Rays, second: Rays, count: int) -> Rays:
    """Rays among two sets of triangles, the second of which is numbered from `count` on."""

    def nearer(start: np.ndarray, onward: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        (face, far, u, v), (other, beyond, u2, v2) = first(start, onward), second(start, onward)
        near = (other >= 0) & ((face < 0) | (beyond < far))
        both = (face, other + count), (far, beyond), (u, u2), (v, v2)
        return tuple(np.where(near, b, a) for a, b in both)  # type: ignore[return-value]

    return nearer


def _panes_of(meshes: Sequence[LitMesh], rays_among: Callable[[np.ndarray], Rays]) -> _Panes | None:
    clear = [m for m in meshes if glass_surfaces(m) and len(m.faces)]
    if not clear:
        return None
    corners = np.concatenate([m.vertices[m.faces] for m in clear]).astype(np.float32)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    surfaces = np.concatenate([np.full(len(m.faces), glass_surfaces(m), np.float32) for m in clear])
    return _Panes(rays_among(corners), normal, surfaces)


def _coarse(page: np.ndarray, glow: np.ndarray | None, gain: np.ndarray | None) -> np.ndarray:
    """(h, w, 3) float32 exposed light of a page, COARSER times smaller, with the full light of what glows."""
    h, w = (max(n // COARSER, 1) for n in page.shape[:2])
    light = cv2.resize(light_of(page), (w, h), interpolation=cv2.INTER_AREA)
    if glow is None or gain is None:
        return light
    shines = cv2.resize(glow.astype(np.float32), (w, h), interpolation=cv2.INTER_LINEAR) * gain
    return np.maximum(light, shines.astype(np.float32))
