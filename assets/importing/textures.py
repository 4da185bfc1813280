"""Textures of models: colours multiplied into them, colours of vertices laid out as one, the shape of their holes."""

import functools

import cv2
import numpy as np
import shapely
from PIL import Image
from scipy.ndimage import distance_transform_edt

from embodied.assets.importing.meshing import weld

PALETTE = 2304
"""Most colours of vertices that are told apart: texels of a square of 48 are far enough apart for decimation, which
takes a step of 0.02 for a seam (embodied.assets.importing.meshing.project_uv)."""
FINER = 4
"""Times that a mask is enlarged before its outline is drawn."""
OUTLINE = 0.75
"""Texels by which an outline may depart from the mask."""
MOST_TILES = 64
"""Tiles of a repeating mask that one triangle may cover."""


def to_srgb(linear: np.ndarray) -> np.ndarray:
    """sRGB in [0, 1] of linear values (IEC 61966-2-1)."""
    x = np.clip(np.asarray(linear, float), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def to_linear(srgb: np.ndarray) -> np.ndarray:
    """Linear values of sRGB in [0, 1] (IEC 61966-2-1)."""
    x = np.clip(np.asarray(srgb, float), 0.0, 1.0)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def shrunk(picture: Image.Image, largest: int) -> Image.Image:
    """`picture` as RGB, or RGBA where it has transparency, at most `largest` pixels a side."""
    clear = "A" in picture.getbands() or "transparency" in picture.info
    if picture.mode.startswith("I"):  # 16 bits of grey, which Pillow would cut off at 255
        picture = Image.fromarray((np.asarray(picture, np.uint32) >> 8).astype(np.uint8))
    picture = picture.convert("RGBA" if clear else "RGB")
    if clear and np.asarray(picture)[..., 3].min() > 250:
        picture = picture.convert("RGB")
    scale = largest / max(picture.size)
    if scale < 1.0:
        width, height = (max(1, round(s * scale)) for s in picture.size)
        picture = picture.resize((width, height), Image.Resampling.LANCZOS)
    return picture


def tinted(picture: Image.Image, factor: np.ndarray, *, linear: bool) -> Image.Image:
    """`picture` times the colour `factor` (3,), both linear as in glTF, or both sRGB as in MTL."""
    if np.abs(np.asarray(factor) - 1).max() < 1e-3:
        return picture
    levels = np.arange(256) / 255
    out = [to_srgb(to_linear(levels) * f) if linear else np.clip(levels * f, 0, 1) for f in factor]
    table = np.round(255 * np.stack(out, 1)).astype(np.uint8)  # (256, 3)
    pixels = np.asarray(picture).copy()
    for channel in range(3):
        pixels[..., channel] = table[pixels[..., channel], channel]
    return Image.fromarray(pixels, picture.mode)


def mirrored(picture: Image.Image, across: bool, down: bool) -> Image.Image:
    """`picture` with its mirror images beside it, below it or both: what repeats as MIRRORED_REPEAT asks."""
    pixels = np.asarray(picture)
    if across:
        pixels = np.concatenate([pixels, pixels[:, ::-1]], axis=1)
    if down:
        pixels = np.concatenate([pixels[::-1], pixels], axis=0)
    return Image.fromarray(pixels, picture.mode)


def palette(colours: np.ndarray) -> tuple[Image.Image, np.ndarray]:
    """A texture of one colour to a face.

    Args:
      colours: (m, 3) sRGB in [0, 1].

    Returns:
      The texture, and (m, 3, 2) uv of the faces' corners.
    """
    levels = 256
    while True:
        steps = np.round(np.clip(colours, 0, 1) * (levels - 1)).astype(np.int64)
        levels_used, which = np.unique(steps, axis=0, return_inverse=True)
        if len(levels_used) <= PALETTE:
            break
        levels //= 2
    side = int(np.ceil(np.sqrt(len(levels_used))))
    pixels = np.zeros((side * side, 3), np.uint8)
    pixels[: len(levels_used)] = np.round(levels_used * 255 / (levels - 1))
    which = which.reshape(-1)
    uv = np.stack([(which % side + 0.5) / side, 1 - (which // side + 0.5) / side], axis=1)
    image = Image.fromarray(pixels.reshape(side, side, 3)).resize((8 * side, 8 * side), Image.Resampling.NEAREST)
    return image, np.repeat(uv[:, None], 3, axis=1)


def sampled(picture: Image.Image, uv: np.ndarray) -> np.ndarray:
    """(n, channels) values in [0, 1] of the texels at uv (n, 2), v up, repeating."""
    pixels = np.asarray(picture)
    height, width = pixels.shape[:2]
    x = np.floor((uv[:, 0] % 1) * width).astype(int) % width
    y = np.floor(((1 - uv[:, 1]) % 1) * height).astype(int) % height
    return pixels[y, x].reshape(len(uv), -1) / 255.0


def filled(picture: Image.Image, least: float) -> Image.Image:
    """`picture` without its transparency, holes in the colour of what lies nearest: no edge shows another."""
    pixels = np.asarray(picture)
    holes = pixels[..., 3] < 255 * least
    if holes.all() or not holes.any():
        return Image.fromarray(pixels[..., :3].copy())
    at = distance_transform_edt(holes, return_distances=False, return_indices=True)
    return Image.fromarray(pixels[at[0], at[1], :3])


def cut(
    points: np.ndarray, faces: np.ndarray, uv: np.ndarray, picture: Image.Image, least: float, room: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """The triangles without what the texture's transparency takes away; None where that needs over `room` triangles.

    Args:
      points: (n, 3); faces: (m, 3); uv: (m, 3, 2), v up, repeating.
      least: opacity in [0, 1] from which a texel is there.
    """
    opacity = picture.getchannel("A")
    outline = _outline(opacity.tobytes(), *opacity.size, least)
    new_points, new_uv, kept = [], [], np.ones(len(faces), bool)
    for i, triangle in enumerate(uv):
        piece = _covered(outline, triangle)
        if piece is None:
            continue  # wholly there
        kept[i] = False
        if piece.is_empty:
            continue
        flat = np.array(
            [t.exterior.coords[:3] for t in shapely.get_parts(shapely.constrained_delaunay_triangles(piece))]
        )
        a, b, c = triangle
        weights = (flat.reshape(-1, 2) - a) @ np.linalg.inv(np.stack([b - a, c - a]))
        p = points[faces[i]]
        solid = (p[0] + weights @ np.stack([p[1] - p[0], p[2] - p[0]])).reshape(-1, 3, 3)
        turned = np.linalg.det(flat[:, 1:] - flat[:, :1]) * np.linalg.det(triangle[1:] - triangle[:1]) < 0
        solid[turned], flat[turned] = solid[turned, ::-1], flat[turned, ::-1]
        new_points.append(solid)
        new_uv.append(flat)
        if sum(map(len, new_uv)) > room:
            return None
    corners = np.concatenate([points[faces[kept]], *new_points]).reshape(-1, 3)
    tolerance = 1e-6 * max(float(np.ptp(points, axis=0).max()), 1e-9)
    points, faces = weld(corners, np.arange(len(corners)).reshape(-1, 3), tolerance)
    return points, faces, np.concatenate([uv[kept], *new_uv])


def _covered(outline: shapely.Geometry, triangle: np.ndarray) -> shapely.Geometry | None:
    """The share of a triangle (3, 2) of a repeating texture that lies in `outline`, maybe empty; None for all of it."""
    low, high = np.floor(triangle.min(0) + 1e-9), np.ceil(triangle.max(0) - 1e-9)
    across, down = (int(max(1, n)) for n in high - low)
    whole = shapely.Polygon(triangle)
    if across * down > MOST_TILES or whole.area < 1e-9:
        return None
    tiles = [
        shapely.transform(outline, functools.partial(np.add, low + (i, j))) for i in range(across) for j in range(down)
    ]
    piece = shapely.union_all([p for p in tiles if p.intersects(whole)]).intersection(whole)
    if piece.area > 0.999 * whole.area:
        return None
    polygons = [p for p in shapely.get_parts(piece) if p.geom_type == "Polygon" and p.area > 1e-4 * whole.area]
    return shapely.MultiPolygon(polygons)


@functools.lru_cache(maxsize=8)
def _outline(opacity: bytes, width: int, height: int, least: float) -> shapely.Geometry:
    mask = np.frombuffer(opacity, np.uint8).reshape(height, width)
    border = 2
    wide = np.pad(mask, border, mode="edge")
    wide = cv2.resize(wide, None, fx=FINER, fy=FINER, interpolation=cv2.INTER_LINEAR)
    there = (wide >= 255 * least).astype(np.uint8)
    contours, tree = cv2.findContours(there, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    to_uv = np.array([1, -1]) / (FINER * np.array([width, height]))
    rings = [
        (cv2.approxPolyDP(c, OUTLINE * FINER, True)[:, 0] + 0.5 - FINER * border) * to_uv + [0, 1] for c in contours
    ]
    parents = tree[0, :, 3] if len(rings) else np.zeros(0, int)
    polygons = [
        shapely.make_valid(shapely.Polygon(ring, [r for r, p in zip(rings, parents) if p == i and len(r) > 2]))
        for i, ring in enumerate(rings)
        if parents[i] < 0 and len(ring) > 2
    ]
    return shapely.make_valid(shapely.union_all(polygons)).intersection(shapely.box(0, 0, 1, 1))
