"""Colours: sRGB and linear light, and the reflectance under the texels of a page, looked up on the device."""

import functools
import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from embodied.assets.decoding import read_picture
from embodied.light.backend import Array, array, bilinear, dr, floats, mi, unsigned
from embodied.light.pages.atlas import Page, flat_areas
from embodied.light.pages.cover import Cover

DARKEST, LIGHTEST = 0.02, 0.88
"""Reflectances are kept between these."""
HALVINGS = 8
"""Of a colour map, at most."""
CODE = 1023
"""Colour maps lie on the device as three 10-bit square roots of linear light per pixel."""


class ColourMaps:
    """Reads colour maps and remembers the last ones; all of a house would fill hundreds of megabytes."""

    def __init__(self, kept: int = 256, whole: int = 48) -> None:
        """`kept` maps are remembered halved, and `whole` as they are."""
        self._levels = functools.lru_cache(maxsize=kept)(lambda path: _halvings(read_colours(path)))
        self._whole = functools.lru_cache(maxsize=whole)(lambda path: _coded(_ROOTS[read_colours(path)]))
        self.shape = functools.cache(self._shape)
        """Height and width of the map at a path."""

    def _shape(self, path: str) -> tuple[int, int]:
        h, w = self._levels(path)[:2]
        return int(h), int(w)

    def halved(self, path: str, level: int) -> np.ndarray:
        """The map at a path, halved so many times: (h, w) uint32 codes of linear colour."""
        if level == 0:
            return self._whole(path)
        sizes = [_halved_size(self.shape(path), k) for k in range(1, level + 1)]
        start = 2 + sum(h * w for h, w in sizes[:-1])
        return self._levels(path)[start : start + math.prod(sizes[-1])].reshape(sizes[-1])


def read_colours(path: str) -> np.ndarray:
    """(h, w, 3) uint8 sRGB of an image file."""
    image = read_picture(path)
    if image is None:
        raise OSError(f"texture {path} is missing or damaged; delete {Path(path).parent}, it is made again")
    return np.ascontiguousarray(image[..., ::-1])


def linear(srgb: np.ndarray) -> np.ndarray:
    """sRGB in [0, 1] to linear (IEC 61966-2-1)."""
    srgb = np.asarray(srgb)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4).astype(np.float32)


def shown(x: Array) -> Array:
    """Linear to sRGB in [0, 1] (IEC 61966-2-1), a device colour or number."""
    x = dr.clip(x, 0.0, 1.0)
    return dr.select(x <= 0.0031308, x * 12.92, 1.055 * dr.power(dr.maximum(x, 1e-6), 1 / 2.4) - 0.055)


@dataclass(frozen=True, eq=False)
class Paints:
    """Colours of the faces of one page, on the device; m faces."""

    plain: Array
    """(m * 3) linear colour of faces without a map."""
    uv: Array
    """(m * 3 * 2)."""
    first: Array
    """(m,) where a face's map begins in `maps`, then its size; 0 wide for none."""
    width: Array
    height: Array
    maps: Array
    """Codes of all maps."""


def paints_of(page: Page, scale: float, read: ColourMaps) -> Paints:
    """Upload the colours of a page. `scale`: texels per luxel; maps are halved until they are no finer."""
    plain = linear(np.array([f.color[:3] for f in page.finishes], np.float32).reshape(-1, 3))[page.finish]
    first, width, height = (np.zeros(len(page.finish), np.uint32) for _ in range(3))
    maps, end = [np.zeros(1, np.uint32)], 1
    source, target = flat_areas(page.uv), flat_areas(page.luxels) * scale**2
    for f, finish in enumerate(page.finishes):
        faces = np.nonzero(page.finish == f)[0]
        if finish.texture is None or not len(faces):
            continue
        full = read.shape(finish.texture)
        levels = _levels(source[faces] * math.prod(full), target[faces])
        for level in np.unique(levels):
            image = read.halved(finish.texture, int(level))
            which = faces[levels == level]
            first[which], height[which], width[which] = end, *image.shape
            maps.append(image.ravel())
            end += image.size
    return Paints(floats(plain), floats(page.uv), *(unsigned(a) for a in (first, width, height, np.concatenate(maps))))


def colour_at(paints: Paints, face: Array, b1: Array, b2: Array) -> Array:
    """Reflectance (a Color3f) at places on faces: bilinear, repeating; v runs up."""
    at = lambda c: dr.gather(mi.Point2f, paints.uv, face * 3 + c)
    uv = at(0) * (1 - b1 - b2) + at(1) * b1 + at(2) * b2
    first, w, h = (dr.gather(mi.UInt32, a, face) for a in (paints.first, paints.width, paints.height))
    mapped = w > 0
    x = (uv.x - dr.floor(uv.x)) * mi.Float(w) - 0.5
    y = (1 - uv.y - dr.floor(1 - uv.y)) * mi.Float(h) - 0.5
    x0, y0, around = bilinear(x, y)
    column, row = mi.UInt32(x0 + mi.Float(w)), mi.UInt32(y0 + mi.Float(h))
    safe_w, safe_h = dr.maximum(w, 1), dr.maximum(h, 1)
    out = mi.Color3f(0.0)
    for dx, dy, weight in around:
        spot = first + (row + dy) % safe_h * w + (column + dx) % safe_w
        out += _decoded(dr.gather(mi.UInt32, paints.maps, spot, mapped)) * weight
    out = dr.select(mapped, out, dr.gather(mi.Color3f, paints.plain, face))
    return dr.clip(out, DARKEST, LIGHTEST)


def albedo(page: Page, c: Cover, read: ColourMaps) -> np.ndarray:
    """(n, 3) float32 linear reflectance under each texel, kept inside [DARKEST, LIGHTEST]."""
    if not len(c.face):
        return np.zeros((0, 3), np.float32)
    paints = paints_of(page, c.shape[1] / page.width, read)
    return array(colour_at(paints, unsigned(c.face), floats(c.b1), floats(c.b2)))


def _levels(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """(k,) int: how often a map must be halved for faces that hold `source` pixels of it on `target` texels."""
    ratio = np.maximum(source, 1e-9) / np.maximum(target, 1e-9)
    return np.clip(np.round(0.5 * np.log2(ratio)), 0, HALVINGS).astype(int)


def _halved_size(shape: tuple[int, ...], level: int) -> tuple[int, int]:
    """Height and width of a map of `shape`, halved so many times."""
    return max(1, shape[0] >> level), max(1, shape[1] >> level)


def _halvings(image: np.ndarray) -> np.ndarray:
    """(n,) uint32: height and width of an (h, w, 3) uint8 sRGB image, and the codes of it halved 1 to `HALVINGS` times
    in linear light."""
    light = linear(np.arange(256, dtype=np.float32) / 255)[image]
    out = [np.array(image.shape[:2], np.uint32)]
    for level in range(1, HALVINGS + 1):
        h, w = _halved_size(image.shape, level)
        light = cv2.resize(light, (w, h), interpolation=cv2.INTER_AREA)
        out.append(_coded(np.round(np.sqrt(light) * CODE).astype(np.uint32)).ravel())
    return np.concatenate(out)


_ROOTS = np.round(np.sqrt(linear(np.arange(256, dtype=np.float32) / 255)) * CODE).astype(np.uint32)
"""Square roots of linear light by sRGB byte, as codes hold them."""


def _coded(roots: np.ndarray) -> np.ndarray:
    """(h, w) uint32 codes of square roots (h, w, 3) of linear colour."""
    return np.ascontiguousarray(roots[..., 0] | roots[..., 1] << 10 | roots[..., 2] << 20)


def _decoded(code: Array) -> Array:
    part = lambda shift: dr.square(mi.Float((code >> shift) & CODE) * (1.0 / CODE))
    return mi.Color3f(part(0), part(10), part(20))
