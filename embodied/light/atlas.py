"""The atlas of a house: which page holds whose light, and what lies under every texel.

A page is one texture. Things of one room that want the same fineness share pages; every owner
keeps its own triangles, so that instance ids and culling by room go on working.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from assets.records import Finish, MeshPart
from embodied.geometry import rotation
from embodied.light.backend import drjit, mitsuba, scene_of
from embodied.light.unwrap import Unwrapped, areas_of, cached_model, face_normals, pack, unwrap_planes

SHELL = ("wall", "floor", "ceiling")


@dataclass(frozen=True, eq=False)
class Thing:
    """Everything of one owner, unwrapped, in world coordinates."""

    owner: str
    room: str
    kind: str
    flat: Unwrapped
    finishes: tuple[Finish, ...]
    """Indexed by `flat.part`."""
    fineness: int
    """Texels per luxel along each axis."""
    glass: bool
    """Lets light through and is drawn see-through."""


@dataclass(frozen=True, eq=False)
class Page:
    """One texture and the triangles that wear it; m faces."""

    width: int
    """Luxels."""
    height: int
    fineness: int
    glass: bool
    corners: np.ndarray
    """(m, 3, 3) float32, metres, world."""
    normals: np.ndarray
    """(m, 3, 3) float32."""
    luxels: np.ndarray
    """(m, 3, 2) float32, position on the page in luxels."""
    uv: np.ndarray
    thin: np.ndarray
    finish: np.ndarray
    """(m,) int32 into `finishes`."""
    finishes: tuple[Finish, ...]
    owner: np.ndarray
    """(m,) int32 into `Atlas.owners`."""


@dataclass(frozen=True, eq=False)
class Atlas:
    """All pages of a house, and who its faces belong to."""

    pages: tuple[Page, ...]
    owners: tuple[str, ...]
    rooms: tuple[str, ...]
    """Room of each owner."""
    kinds: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Texels:
    """What lies under the covered texels of one page; n of them."""

    index: np.ndarray
    """(n,) int64, row * width + column."""
    position: np.ndarray
    """(n, 3) float32, metres, world."""
    normal: np.ndarray
    """(n, 3) float32, unit, shading."""
    face_normal: np.ndarray
    face: np.ndarray
    """(n,) int32, face of the page."""
    weights: np.ndarray
    """(n, 3) float32 barycentric."""
    shape: tuple[int, int]
    """Height and width of the page in these texels."""


def things_of(
    parts: Sequence,
    *,
    density: float,
    budget: float,
    cache: Path,
    finest: int = 8,
    progress: Callable[[int, int], None] = lambda i, n: None,
) -> tuple[Thing, ...]:
    """Group parts by owner and unwrap each; furniture from the cache.

    Args:
      parts: embodied.scene.house_meshes.Part of one house; kind 'outdoor' must be left out.
      density: luxels per metre of walls, floors and ceilings.
      budget: luxels per piece of furniture.
      finest: texels per luxel at most.
    """
    groups: dict[tuple, list] = {}
    for p in parts:
        groups.setdefault((p.owner, p.room, p.kind, _is_glass(p.mesh.finish), p.position, p.yaw), []).append(p)
    things = []
    for done, ((owner, room, kind, glass, position, yaw), mine) in enumerate(groups.items()):
        progress(done, len(groups))
        meshes: list[MeshPart] = [p.mesh for p in mine]
        if kind in SHELL:
            flat = unwrap_planes(meshes, density)
        else:
            flat = cached_model(meshes, budget, cache, trusted=kind == "opening")
        if len(flat.corners):
            flat = _placed(flat, position, yaw)
            finishes = tuple(m.finish for m in meshes)
            things.append(
                Thing(owner, room, kind, flat, finishes, min(finest, _fineness(kind, flat, finishes, density)), glass)
            )
    return tuple(things)


def coarsened(things: Sequence[Thing], most: float) -> tuple[Thing, ...]:
    """The same things with at most `most` texels, if it takes no more than this: the largest floors lose a fifth
    of their fineness first, then the largest patterned pieces a quarter. Mirrors (over 5 texels per luxel) stay sharp."""
    out = list(things)
    texels = lambda t: int(t.flat.size.prod()) * t.fineness**2
    total = sum(map(texels, out))
    for finest in (5, 4):
        for i in sorted((i for i, t in enumerate(out) if t.fineness == finest), key=lambda i: -texels(out[i])):
            if total <= most:
                return tuple(out)
            coarse = replace(out[i], fineness=finest - 1)
            total -= texels(out[i]) - texels(coarse)
            out[i] = coarse
    return tuple(out)


def atlas_of(things: Sequence[Thing], widest: int = 4096, most: int = 3_000_000) -> Atlas:
    """Lay the things of a house out on pages, by room and fineness.

    Args:
      widest: a page's largest side in texels.
      most: texels that a page may have, if one thing alone does not need more; composing a page takes 150 bytes for each.
    """
    owners = tuple(dict.fromkeys(t.owner for t in things))
    number = {o: i for i, o in enumerate(owners)}
    first = {t.owner: t for t in reversed(things)}
    shelves: dict[tuple, list[Thing]] = {}
    for t in things:
        shelves.setdefault((t.room, t.fineness, t.glass), []).append(t)
    pages = []
    for (_, fineness, glass), mine in shelves.items():
        limit = widest // fineness
        while mine:
            whole = min(sum(int(t.flat.size.prod()) for t in mine), most / fineness**2)
            sizes = np.array([t.flat.size for t in mine])
            widths = [int(min(limit, max(128, x * np.sqrt(whole)))) for x in (0.8, 0.9, 1.0, 1.05, 1.1, 1.2, 1.35, 1.5)]
            width, places = min(((w, pack(sizes, w)[0]) for w in widths), key=lambda x: _sheet(sizes, x[1]))
            tall = min(limit, max(most / fineness**2 / width, max(int(t.flat.size[1]) for t in mine)))
            inside = [bool(y + t.flat.size[1] <= tall) for t, (_, y) in zip(mine, places)]
            if not any(inside):
                raise ValueError(
                    f"{mine[0].owner!r} needs an atlas of {mine[0].flat.size} luxels, over {limit}; lower the density"
                )
            pages.append(_page([t for t, ok in zip(mine, inside) if ok], places[inside], fineness, glass, number))
            mine = [t for t, ok in zip(mine, inside) if not ok]
    return Atlas(tuple(pages), owners, tuple(first[o].room for o in owners), tuple(first[o].kind for o in owners))


def _sheet(sizes: np.ndarray, places: np.ndarray) -> int:
    """Luxels of the rectangle that holds packed rectangles."""
    return int((places + sizes).max(0).prod())


OFFSETS = (
    (0.0, 0.0),
    (-0.3, -0.3),
    (0.3, 0.3),
    (-0.3, 0.3),
    (0.3, -0.3),
    (0.0, 0.47),
    (0.0, -0.47),
    (0.47, 0.0),
    (-0.47, 0.0),
    (0.45, 0.45),
    (-0.45, -0.45),
    (0.45, -0.45),
    (-0.45, 0.45),
    (0.15, -0.15),
    (-0.15, 0.15),
)
"""Where in a texel a face is looked for, one after the other: slivers that miss all centres still get texels of their own."""


def rasterise(page: Page, fineness: int) -> Texels:
    """What lies under each texel, found by shooting rays straight down on the layout; centres first."""
    w, h = page.width * fineness, page.height * fineness
    flat = np.concatenate([page.luxels * fineness, np.zeros((*page.luxels.shape[:2], 1), np.float32)], axis=-1)
    scene = scene_of(flat)
    face, b1, b2 = np.full(w * h, -1, np.int32), np.zeros(w * h, np.float32), np.zeros(w * h, np.float32)
    left = np.arange(w * h)
    for dx, dy in OFFSETS:
        hit, f, u, v = _straight_down(scene, left % w + 0.5 + dx, left // w + 0.5 + dy)
        face[left[hit]], b1[left[hit]], b2[left[hit]] = f[hit], u[hit], v[hit]
        left = left[~hit]
    index = np.nonzero(face >= 0)[0]
    face = face[index]
    weights = np.stack([1 - b1[index] - b2[index], b1[index], b2[index]], axis=1)
    normal = mix(weights, page.normals, face)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-12
    flat_normal = face_normals(page.corners).astype(np.float32)[face]
    return Texels(index, mix(weights, page.corners, face), normal, flat_normal, face, weights, (h, w))


def _straight_down(scene, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Whether a face lies under (x, y), which, and where on it."""
    mi, dr = mitsuba(), drjit()
    above = mi.Point3f(mi.Float(np.asarray(x, np.float32)), mi.Float(np.asarray(y, np.float32)), 1.0)
    hit = scene.ray_intersect_preliminary(mi.Ray3f(above, mi.Vector3f(0, 0, -1)), True)
    u, v, f, ok = hit.prim_uv.x, hit.prim_uv.y, hit.prim_index, hit.is_valid()
    dr.eval(u, v, f, ok)
    return np.asarray(ok), np.asarray(f).astype(np.int32), np.asarray(u), np.asarray(v)


def nearest(mask: np.ndarray) -> np.ndarray:
    """(h, w) int64: flat position of the nearest true pixel of a mask that has any."""
    _, labels = cv2.distanceTransformWithLabels(
        (~mask).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    at = np.zeros(int(labels.max()) + 1, np.int64)
    flat = np.nonzero(mask.ravel())[0]
    at[labels.ravel()[flat]] = flat
    return at[labels]


def mix(weights: np.ndarray, corners: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Barycentric mean of per-corner values (m, 3, c) at n points: (n, c) float32."""
    values = corners[face]
    return (weights[:, :1] * values[:, 0] + weights[:, 1:2] * values[:, 1] + weights[:, 2:] * values[:, 2]).astype(
        np.float32
    )


def albedo(page: Page, texels: Texels, read: Callable[[str], np.ndarray]) -> np.ndarray:
    """(n, 3) float32 linear reflectance under each texel, kept inside [0.02, 0.88].

    Args:
      read: colour map by path as (h, w, 3) uint8 sRGB.
    """
    out = np.zeros((len(texels.face), 3), np.float32)
    which = page.finish[texels.face]
    scale = texels.shape[1] / page.width
    for f, finish in enumerate(page.finishes):
        mine = np.nonzero(which == f)[0]
        if not len(mine):
            continue
        if finish.texture is None:
            out[mine] = linear(np.asarray(finish.color[:3], np.float32))
            continue
        image = read(finish.texture)
        uv = mix(texels.weights[mine], page.uv, texels.face[mine])
        for level, chosen in _by_level(page, f, scale, image.shape, texels.face[mine]):
            out[mine[chosen]] = _sample(_shrunk(image, level), uv[chosen])
    return np.clip(out, 0.02, 0.88)


def linear(srgb: np.ndarray) -> np.ndarray:
    """sRGB in [0, 1] to linear (IEC 61966-2-1)."""
    srgb = np.asarray(srgb)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4).astype(np.float32)


def gamma(x: np.ndarray) -> np.ndarray:
    """Linear to sRGB in [0, 1] (IEC 61966-2-1)."""
    x = np.clip(x, 0.0, 1.0)
    return np.where(x <= 0.0031308, x * 12.92, 1.055 * x ** (1 / 2.4) - 0.055).astype(np.float32)


def read_colours(path: str) -> np.ndarray:
    """(h, w, 3) uint8 sRGB of an image file."""
    image = cv2.imread(path, cv2.IMREAD_COLOR)
    if image is None:
        raise OSError(f"texture {path} is missing or damaged; delete {Path(path).parent}, it is made again")
    return np.ascontiguousarray(image[..., ::-1])


def _is_glass(finish: Finish) -> bool:
    return finish.color[3] < 0.9


def _placed(flat: Unwrapped, position: Sequence[float], yaw: float) -> Unwrapped:
    turn = np.eye(3)
    turn[:2, :2] = rotation(yaw)
    corners = flat.corners.astype(np.float64) @ turn.T + np.asarray(position, float)
    return replace(flat, corners=corners.astype(np.float32), normals=(flat.normals @ turn.T.astype(np.float32)))


def _fineness(kind: str, flat: Unwrapped, finishes: Sequence[Finish], density: float) -> int:
    """Texels per luxel: as many as patterns and mirrors need to stay sharp, 2 for what is plain, 1 where luxels are small.

    Floors get 200 texels per metre, patterned walls and ceilings 120 and 80, patterned furniture 180 where
    its luxels are not too coarse, mirrors 400.
    """
    used = np.bincount(flat.part, weights=areas_of(flat.corners), minlength=len(finishes))
    patterned = sum(a for a, f in zip(used, finishes) if f.texture) > 0.15 * used.sum()
    if kind in SHELL:
        return round({"floor": 200, "wall": 120, "ceiling": 80}[kind] / density) if patterned else 2
    side = np.sqrt(areas_of(np.pad(flat.luxels, ((0, 0), (0, 0), (0, 1)))).sum() / used.sum())
    if sum(a for a, f in zip(used, finishes) if f.mirror) > 0.15 * used.sum():
        return int(np.clip(round(400 / side), 2, 8))
    return int(np.clip(round(180 / side), 2, max(4, round(160 / density)))) if patterned else 1 if side > 80 else 2


def _page(things: Sequence[Thing], places: np.ndarray, fineness: int, glass: bool, number: dict[str, int]) -> Page:
    finishes: list[Finish] = []
    known: dict[Finish, int] = {}
    which, owner, luxels = [], [], []
    for t, place in zip(things, places):
        local = []
        for f in t.finishes:
            if f not in known:
                known[f] = len(finishes)
                finishes.append(f)
            local.append(known[f])
        which.append(np.array(local, np.int32)[t.flat.part])
        owner.append(np.full(len(t.flat.part), number[t.owner], np.int32))
        luxels.append(t.flat.luxels + place.astype(np.float32))
    join = lambda name: np.concatenate([getattr(t.flat, name) for t in things])
    width = max(int(x + t.flat.size[0]) for t, (x, _) in zip(things, places))
    height = max(int(y + t.flat.size[1]) for t, (_, y) in zip(things, places))
    return Page(
        width,
        height,
        fineness,
        glass,
        join("corners"),
        join("normals"),
        np.concatenate(luxels),
        join("uv"),
        join("thin"),
        np.concatenate(which),
        tuple(finishes),
        np.concatenate(owner),
    )


def _by_level(page: Page, finish: int, scale: float, shape: tuple[int, ...], face: np.ndarray):
    """Texels by how far the colour map must be shrunk first: pairs of level and positions in `face`."""
    pad = lambda a: np.pad(a, ((0, 0), (0, 0), (0, 1)))
    source = areas_of(pad(page.uv)) * shape[0] * shape[1]
    target = areas_of(pad(page.luxels)) * scale**2
    levels = np.clip(np.round(0.5 * np.log2(np.maximum(source, 1e-9) / np.maximum(target, 1e-9))), 0, 8).astype(int)
    mine = levels[face]
    for level in np.unique(mine):
        yield int(level), np.nonzero(mine == level)[0]


def _shrunk(image: np.ndarray, level: int) -> np.ndarray:
    """(h, w, 3) float32 linear, halved `level` times."""
    light = linear(np.arange(256, dtype=np.float32) / 255)[image]
    h, w = max(1, image.shape[0] >> level), max(1, image.shape[1] >> level)
    return cv2.resize(light, (w, h), interpolation=cv2.INTER_AREA) if level else light


def _sample(light: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Bilinear, repeating lookup; v runs up."""
    h, w = light.shape[:2]
    x, y = (uv[:, 0] % 1) * w - 0.5, ((1 - uv[:, 1]) % 1) * h - 0.5
    xi, yi = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - xi)[:, None].astype(np.float32), (y - yi)[:, None].astype(np.float32)
    at = lambda a, b: light[b % h, a % w]
    top = at(xi, yi) * (1 - fx) + at(xi + 1, yi) * fx
    return top * (1 - fy) + (at(xi, yi + 1) * (1 - fx) + at(xi + 1, yi + 1) * fx) * fy
