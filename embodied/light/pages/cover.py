"""The surface under every texel of a page: which face, where on it, and the surface there."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from embodied.light.backend import Array, RayScene, dr, floats, looped, mi, opaque_float, opaque_uint, scene_of
from embodied.light.pages.atlas import Page
from embodied.light.pages.unwrap import face_normals

OFFSETS = (
    *((-0.3, -0.3), (0.3, 0.3), (-0.3, 0.3), (0.3, -0.3), (0.0, 0.47), (0.0, -0.47), (0.47, 0.0), (-0.47, 0.0)),
    *((0.45, 0.45), (-0.45, -0.45), (0.45, -0.45), (-0.45, 0.45), (0.15, -0.15), (-0.15, 0.15)),
)
"""Places in a texel where a face is looked for when its centre shows none, one after the other: slivers that miss all
centres still get texels of their own."""


@dataclass(frozen=True, eq=False)
class Cover:
    """The covered texels of one page; n of them."""

    index: np.ndarray
    """(n,) int64, row * width + column."""
    face: np.ndarray
    """(n,) int32, face of the page."""
    b1: np.ndarray
    b2: np.ndarray
    """(n,) float32, barycentric weights of the face's second and third corner."""
    shape: tuple[int, int]
    """Height and width of the page in these texels."""

    def weights(self, i: np.ndarray | slice = slice(None)) -> np.ndarray:
        """(k, 3) float32 barycentric weights of texels `i`."""
        b1, b2 = self.b1[i], self.b2[i]
        return np.stack([1 - b1 - b2, b1, b2], axis=1)


@dataclass(frozen=True, eq=False)
class Texels(Cover):
    """The covered texels of one page and the surface under them; n of them."""

    position: np.ndarray
    """(n, 3) float32, metres, world."""
    normal: np.ndarray
    """(n, 3) float32, unit, shading."""
    face_normal: np.ndarray


@dataclass(frozen=True, eq=False)
class Sheet:
    """A page's layout in luxels, as something that rays meet."""

    scene: RayScene
    """The layouts of some pages, one above the other a metre apart."""
    height: int
    """Its place among them."""
    first: int
    """Number of its first face."""


def sheets_of(pages: Sequence[Page]) -> tuple[Sheet, ...]:
    """The layouts of pages, in one scene."""
    ends = np.cumsum([0, *(len(p.luxels) for p in pages)])
    if not ends[-1]:
        return tuple(Sheet(None, i, 0) for i in range(len(pages)))
    height = np.repeat(np.arange(len(pages), dtype=np.float32), np.diff(ends))
    flat = np.concatenate([p.luxels for p in pages])
    scene = scene_of(np.concatenate([flat, np.broadcast_to(height[:, None, None], (*flat.shape[:2], 1))], axis=-1))
    return tuple(Sheet(scene, i, int(first)) for i, first in enumerate(ends[:-1]))


def cover(page: Page, fineness: int, sheet: Sheet | None = None) -> Cover:
    """Faces under texels, found by shooting rays straight down on the layout: at centres, and beside what these find
    and along the slivers that they miss at `OFFSETS`.

    Args:
      fineness: texels per luxel along each axis.
      sheet: the page's layout, where it is at hand.
    """
    sheet = sheet or sheets_of((page,))[0]
    w, h = page.width * fineness, page.height * fineness
    face, b1, b2 = _straight_down(sheet, np.arange(w * h), w, fineness, ((0.0, 0.0),))
    left = _doubtful(face.reshape(h, w) >= 0, page.luxels * fineness, face)
    for all_, new in zip((face, b1, b2), _straight_down(sheet, left, w, fineness, OFFSETS)):
        all_[left] = new
    index = np.nonzero(face >= 0)[0]
    return Cover(index, face[index], b1[index], b2[index], (h, w))


def rasterise(page: Page, fineness: int, sheet: Sheet | None = None) -> Texels:
    """The surface under every covered texel."""
    c = cover(page, fineness, sheet)
    return Texels(c.index, c.face, c.b1, c.b2, c.shape, *surface(page, c))


def surface(page: Page, c: Cover, i: np.ndarray | slice = slice(None)) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, shading normals and face normals, (k, 3) float32 each, under the texels `i` of a cover."""
    face, weights = c.face[i], c.weights(i)
    normal = mix(weights, page.normals, face)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-12
    return mix(weights, page.corners, face), normal, face_normals(page.corners).astype(np.float32)[face]


def mix(weights: np.ndarray, corners: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Barycentric mean of per-corner values (m, 3, c) at n points: (n, c) float32."""
    out = corners[face, 0] * weights[:, :1]
    out += corners[face, 1] * weights[:, 1:2]
    out += corners[face, 2] * weights[:, 2:]
    return out.astype(np.float32, copy=False)


def nearest(mask: np.ndarray) -> np.ndarray:
    """(h, w) int32: flat position of the nearest true pixel of a mask that has any."""
    _, labels = cv2.distanceTransformWithLabels(
        (~mask).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    flat = np.flatnonzero(mask).astype(np.int32)
    at = np.zeros(len(flat) + 1, np.int32)
    at[labels.ravel()[flat]] = flat
    return at[labels]


def sources(index: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """(h * w,) int: which of the n covered texels at flat positions `index` each texel of a page shows: its own or
    the nearest."""
    if not len(index):
        return np.zeros(shape[0] * shape[1], np.int64)
    mask = np.zeros(shape[0] * shape[1], bool)
    mask[index] = True
    number = np.zeros(len(mask), np.int32)
    number[index] = np.arange(len(index))
    return number[nearest(mask.reshape(shape)).ravel()]


def _straight_down(
    sheet: Sheet, spot: np.ndarray, width: int, fineness: int, offsets: Sequence[tuple[float, float]]
) -> tuple[np.ndarray, ...]:
    """Face under each texel `spot` (-1 for none) at the first of `offsets` that shows one, and where on it."""
    if not len(spot) or not len(offsets) or sheet.scene is None:
        return np.full(len(spot), -1, np.int32), np.zeros(len(spot), np.float32), np.zeros(len(spot), np.float32)
    row, column = (floats(a) for a in np.divmod(spot.astype(np.int32), np.int32(width)))
    aside, step, above = floats(offsets), opaque_float(1 / fineness), opaque_float(sheet.height + 0.5)
    down, first, last = mi.Vector3f(0, 0, -1), opaque_uint(sheet.first), opaque_uint(len(offsets))

    def body(k: Array, face: Array, u: Array, v: Array) -> tuple[Array, ...]:
        o = dr.gather(mi.Point2f, aside, k)
        at = mi.Point3f((column + (o.x + 0.5)) * step, (row + (o.y + 0.5)) * step, above)
        open_ = face < 0
        hit = sheet.scene.ray_intersect_preliminary(mi.Ray3f(at, down, 0.9, 0.0, []), True, open_)
        new = open_ & hit.is_valid()
        face = dr.select(new, mi.Int32(hit.prim_index - first), face)
        return k + 1, face, dr.select(new, hit.prim_uv.x, u), dr.select(new, hit.prim_uv.y, v)

    none, zero = dr.zeros(mi.Int32, len(spot)) - 1, dr.zeros(mi.Float, len(spot))
    _, face, u, v = looped((mi.UInt32(0), none, zero, zero), lambda k, *_: k < last, body)
    dr.eval(face, u, v)
    return np.array(face), np.array(u), np.array(v)


def _doubtful(covered: np.ndarray, at: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Flat positions of texels without a face that may yet touch one: beside covered ones, and along faces without any.

    Args:
      covered: (h, w) bool. at: (m, 3, 2) corners in texels. face: (h * w,) int.
    """
    h, w = covered.shape
    open_ = cv2.dilate(covered.astype(np.uint8), np.ones((3, 3), np.uint8))
    missed = np.ones(len(at), bool)
    missed[face[face >= 0]] = False
    corners = at[missed]
    for a, b in ((0, 1), (1, 2), (2, 0)):
        count = np.ceil(np.linalg.norm(corners[:, b] - corners[:, a], axis=1)).astype(int) * 2 + 1
        which = np.repeat(np.arange(len(corners)), count)
        along = (np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)) / np.repeat(count, count)
        x, y = (corners[which, a] + (corners[which, b] - corners[which, a]) * along[:, None]).T
        open_[np.clip(y.astype(int), 0, h - 1), np.clip(x.astype(int), 0, w - 1)] = 1
    return np.flatnonzero(open_.astype(bool) & ~covered)
