"""A finished bake as a world that camera rays can be traced in; what glossy and reference pictures share."""

from dataclasses import dataclass

import cv2
import numpy as np

from embodied.house.house import House
from embodied.light.backend import Array, Ray, RayScene, bilinear, booleans, dr, floats, mi, scene_of, unsigned
from embodied.light.pages.colours import linear
from embodied.light.pages.files import Bake
from embodied.light.pages.unwrap import distinct, face_normals
from embodied.light.tracing import radiosity
from embodied.light.tracing.emitters import portals_of, read_lamps
from embodied.light.tracing.paths import Lights, Surfaces, lights_of
from embodied.light.tracing.radiosity import Space
from embodied.light.tracing.sky import Outdoors, outdoors
from embodied.scene.far_canvas import KNOTS
from embodied.scene.lit_pages import LitPages, glass_surfaces


@dataclass(frozen=True, eq=False)
class Panes:
    """See-through things, drawn over what lies behind them as the classic renderer does; k faces."""

    scene: RayScene
    normal: Array
    """(k * 3)."""
    uv: Array
    """(k * 3 * 2)."""
    opacity: Array
    """(k,)."""
    surfaces: Array
    """(k,) of glass that stand behind one another; 0 where it is none."""
    owner: np.ndarray
    """(k,) int32 instance ids."""
    page: Array
    """(k,), then of all pages: size (pages * 2), first texel, and sRGB pictures as shown."""
    size: Array
    base: Array
    picture: Array


@dataclass(frozen=True, eq=False)
class BakedScene:
    """Device arrays; m faces in mesh order."""

    space: Space
    """Rays hit opaque indoor things and the house's outer parts; luxel numbers are page pixels."""
    surfaces: Surfaces
    lights: Lights
    owner: np.ndarray
    """(m,) int32 instance ids."""
    is_outdoor: Array
    gloss: Array
    """(m * 3) roughness, specular, metallic."""
    uv: Array
    """(m * 3 * 2)."""
    size: Array
    """(pages * 2) texels: width, height."""
    base: Array
    albedo: Array
    """Flat linear RGB texels of all pages, then:"""
    light: Array
    """Flat e (all light, the sun's too) of all texels; for outer parts the picture as shown, as sRGB."""
    glow: Array
    """Flat radiance of all texels; None if nothing glows."""
    dome: Array
    """Flat sRGB picture of the outdoors as shown, for `backdrop_at`."""
    sky: Array
    """Flat radiance of the outdoors."""
    rows: int
    exposure: Array
    outdoors: Outdoors
    panes: Panes | None
    """See-through faces: glass and sheer curtains."""


@dataclass(frozen=True, eq=False)
class _Pages:
    """The pages of a bake one after another: (t, 3) float32 of t texels, (n, 3) of n luxels."""

    albedo: np.ndarray
    light: np.ndarray
    glow: np.ndarray
    coarse_albedo: np.ndarray
    coarse_glow: np.ndarray
    sizes: np.ndarray
    """(pages, 2) width and height in texels."""
    luxels: np.ndarray
    """(pages, 2) width and height in luxels."""


def _pages_of(bake: Bake, own: int, sun: np.ndarray) -> _Pages:
    """All pages but the sky's; those from `own` on are outdoors, where only what is shown is known.

    Args:
      sun: (3,) e of the sun behind glass.
    """
    columns: list[tuple[np.ndarray, ...]] = []
    sizes, luxels = [], []
    for i, picture in enumerate(bake.lit.pages[:-1]):
        h, w = picture.shape[:2]
        sizes.append((w, h))
        if i >= own:
            nothing = np.zeros((h * w, 3), np.float32)
            grey, dark = np.full((1, 3), 0.2, np.float32), np.zeros((1, 3), np.float32)
            columns.append((nothing, picture.reshape(-1, 3).astype(np.float32) / 255, nothing, grey, dark))
            luxels.append((1, 1))
            continue
        one = bake.ingredients(i)
        soft = one.soft.astype(np.float32)
        size = soft.shape[1::-1]
        fine = linear(np.arange(256, dtype=np.float32) / 255)[one.albedo]
        e = cv2.resize(soft, (w, h), interpolation=cv2.INTER_LINEAR)
        e += (one.sun.astype(np.float32) / 255)[..., None] * sun
        g = one.glow.astype(np.float32) if one.glow.size else np.zeros_like(soft)
        shines = cv2.resize(g, (w, h), interpolation=cv2.INTER_NEAREST)
        coarse = cv2.resize(fine, size, interpolation=cv2.INTER_AREA)
        columns.append(tuple(a.reshape(-1, 3) for a in (fine, e, shines, coarse, g)))
        luxels.append(size)
    return _Pages(*(np.concatenate(c) for c in zip(*columns)), sizes=np.array(sizes), luxels=np.array(luxels))  # type: ignore[misc]


def world_of(bake: Bake, house: House) -> BakedScene:
    """Upload a bake."""
    lit = bake.lit
    number = {o: i + 1 for i, o in enumerate(lit.owners)}
    solid = [
        (m, g[:, :3])
        for m, g in zip(lit.meshes, bake.gloss, strict=True)
        if m.alpha >= 0.9 and g is not None and len(m.faces)
    ]
    corners = np.concatenate([m.vertices[m.faces] for m, _ in solid])
    uv = np.concatenate([m.uv[m.faces] for m, _ in solid])
    page = np.concatenate([np.full(len(m.faces), m.page) for m, _ in solid])
    owner = np.concatenate([np.full(len(m.faces), number.get(m.owner, 0), np.int32) for m, _ in solid])
    outer = np.concatenate([np.full(len(m.faces), m.kind == "outdoor") for m, _ in solid])
    sun = outdoors(house, len(lit.pages[-1]))  # the dome's rows
    pages = _pages_of(bake, bake.manifest["own_pages"], (sun.sun * radiosity.GLAZING).astype(np.float32))
    lw, lh = pages.luxels.T
    thin = np.concatenate([_listed_twice(m.faces) for m, _ in solid])
    texels = pages.sizes.prod(1)
    sampled = {x.placement for x in house.lights if x.on}
    xy = uv * np.stack([lw, lh], 1)[page][:, None]
    space = Space(
        scene_of(corners),
        np.arange(len(corners)),
        unsigned(page),
        floats(xy),
        floats(face_normals(corners.astype(np.float64))),
        booleans(thin),
        unsigned(lw),
        unsigned(lh),
        unsigned(np.cumsum(lw * lh) - lw * lh),
        unsigned(np.arange(int((lw * lh).sum()))),
        floats(radiosity.small_sky(sun.picture)),
    )
    dark = np.zeros_like(pages.coarse_glow)
    surfaces = Surfaces(floats(pages.coarse_albedo), floats(dark if sampled else pages.coarse_glow), floats(dark))
    lamps = read_lamps(bake.folder / "lamps.npz", bake.manifest["lamps"])
    without = {x.owner: scene_of(corners[owner != number[x.owner]]) for x in lamps if x.owner is not None}
    lights = lights_of(space.scene, without, portals_of(house), lamps, sun)
    return BakedScene(
        space,
        surfaces,
        lights,
        owner,
        booleans(outer),
        floats(np.concatenate([g for _, g in solid]) / 255),
        floats(uv),
        unsigned(pages.sizes.ravel()),
        unsigned(np.cumsum(texels) - texels),
        floats(pages.albedo),
        floats(pages.light),
        floats(pages.glow) if pages.glow.any() else None,
        floats(lit.pages[-1] / 255),
        floats(sun.picture),
        sun.picture.shape[0],
        bake.exposure,
        sun,
        _panes_of(lit, number),
    )


def _listed_twice(faces: np.ndarray) -> np.ndarray:
    """(m,) bool: faces whose other side is a face too, which is how sheets are written."""
    _, which = distinct(np.sort(faces, axis=1))
    return np.bincount(which)[which] > 1


def _panes_of(lit: LitPages, number: dict[str, int]) -> Panes | None:
    clear = [m for m in lit.meshes if m.alpha < 0.9 and len(m.faces)]
    if not clear:
        return None
    each = lambda value: np.concatenate([np.full(len(m.faces), value(m)) for m in clear])
    corners = np.concatenate([m.vertices[m.faces] for m in clear])
    used = {p: k for k, p in enumerate(sorted({m.page for m in clear}))}
    pictures = [lit.pages[p] for p in used]
    size = np.array([p.shape[1::-1] for p in pictures])
    texels = size.prod(1)
    return Panes(
        scene_of(corners),
        floats(face_normals(corners.astype(np.float64))),
        floats(np.concatenate([m.uv[m.faces] for m in clear])),
        floats(each(lambda m: m.alpha)),
        floats(each(glass_surfaces)),
        each(lambda m: number.get(m.owner, 0)).astype(np.int32),
        unsigned(each(lambda m: used[m.page])),
        unsigned(size.ravel()),
        unsigned(np.cumsum(texels) - texels),
        floats(np.concatenate([p.reshape(-1, 3) for p in pictures]) / 255),
    )


@dataclass(frozen=True, eq=False)
class Hit:
    """First hits of rays."""

    ok: Array
    distance: Array
    face: Array
    position: Array
    normal: Array
    """Towards the ray's origin."""
    albedo: Array
    e: Array
    """Baked light, or the shown sRGB colour of an outer part."""
    glow: Array
    outdoor: Array
    gloss: Array
    """Roughness, specular, metallic."""
    front: Array
    thin: Array
    """A sheet, lit from both its sides."""


def look(world: BakedScene, ray: Ray, active: Array = True) -> Hit:
    """Bilinear lookup of the pages where rays hit."""
    h = world.space.scene.ray_intersect_preliminary(ray, False, active)
    ok = h.is_valid() & active
    f = h.prim_index
    b1, b2 = h.prim_uv.x, h.prim_uv.y
    at = lambda c: dr.gather(mi.Point2f, world.uv, f * 3 + c, ok)
    q = at(0) * (1 - b1 - b2) + at(1) * b1 + at(2) * b2
    page = dr.gather(mi.UInt32, world.space.page, f, ok)
    w, height = (mi.Float(dr.gather(mi.UInt32, world.size, page * 2 + c, ok)) for c in (0, 1))
    base = dr.gather(mi.UInt32, world.base, page, ok)
    x, y = dr.clip(q.x * w - 0.5, 0, w - 1), dr.clip(q.y * height - 0.5, 0, height - 1)
    x0, y0, around = bilinear(x, y)
    albedo, e, glow = mi.Color3f(0.0), mi.Color3f(0.0), mi.Color3f(0.0)
    for dx, dy, weight in around:
        i = base + mi.UInt32(dr.minimum(y0 + dy, height - 1)) * mi.UInt32(w) + mi.UInt32(dr.minimum(x0 + dx, w - 1))
        albedo += dr.gather(mi.Color3f, world.albedo, i, ok) * weight
        e += dr.gather(mi.Color3f, world.light, i, ok) * weight
        if world.glow is not None:
            glow += dr.gather(mi.Color3f, world.glow, i, ok) * weight
    n = dr.gather(mi.Vector3f, world.space.normal, f, ok)
    front = dr.dot(n, ray.d) < 0
    n = dr.select(front, n, -n)
    return Hit(
        ok,
        h.t,
        f,
        ray.o + ray.d * h.t,
        n,
        albedo,
        e,
        glow,
        dr.gather(mi.Bool, world.is_outdoor, f, ok),
        dr.gather(mi.Vector3f, world.gloss, f, ok),
        front,
        dr.gather(mi.Bool, world.space.thin, f, ok),
    )


def through(panes: Panes, ray: Ray, behind: Array, most: int = 6) -> Array:
    """Light that see-through things before `behind` (distances) put over a picture, front to back.

    Returns:
      Their own share of the shown colour, the share of what lies behind, distance and face of the first (inf and 0
      without).
    """
    colour, left, start = mi.Color3f(0.0), mi.Float(1.0), mi.Float(0.0)
    first, face = mi.Float(dr.inf), mi.UInt32(0)
    for _ in range(most):
        ahead = mi.Ray3f(ray.o + ray.d * start, ray.d)
        h = panes.scene.ray_intersect_preliminary(ahead, False)
        ok = h.is_valid() & (start + h.t < behind)
        if not dr.any(ok):
            break
        f = h.prim_index
        front = ok & (dr.dot(dr.gather(mi.Vector3f, panes.normal, f, ok), ray.d) < 0)
        at = lambda c: dr.gather(mi.Point2f, panes.uv, f * 3 + c, front)  # noqa: B023
        q = at(0) * (1 - h.prim_uv.x - h.prim_uv.y) + at(1) * h.prim_uv.x + at(2) * h.prim_uv.y
        page = dr.gather(mi.UInt32, panes.page, f, front)
        w, height = (dr.gather(mi.UInt32, panes.size, page * 2 + c, front) for c in (0, 1))
        x = dr.minimum(mi.UInt32(dr.maximum(q.x, 0) * w), w - 1)
        y = dr.minimum(mi.UInt32(dr.maximum(q.y, 0) * height), height - 1)
        opacity = dr.gather(mi.Float, panes.opacity, f, front)
        colour += dr.gather(
            mi.Color3f, panes.picture, dr.gather(mi.UInt32, panes.base, page, front) + y * w + x, front
        ) * (left * opacity)
        left *= dr.select(front, 1 - opacity, 1.0)
        face = dr.select(front & dr.isinf(first), f, face)
        first = dr.select(front & dr.isinf(first), start + h.t, first)
        start += dr.select(ok, h.t + 2e-4, 0.0)
        dr.eval(colour, left, start, first, face)
    return colour, left, first, face


def picture_at(table: Array, rows: int, d: Array, active: Array = True) -> Array:
    """Value of an outdoor picture (flat, rows x 2 rows) in direction d, nearest texel."""
    x = (dr.pi - dr.atan2(d.y, d.x)) / dr.two_pi * (2 * rows)
    y = dr.acos(dr.clip(d.z, -1, 1)) / dr.pi * rows
    i = mi.UInt32(dr.clip(y, 0, rows - 1)) * (2 * rows) + mi.UInt32(dr.clip(x, 0, 2 * rows - 1))
    return dr.gather(mi.Color3f, table, i, active)


def backdrop_at(table: Array, rows: int, d: Array) -> Array:
    """As `picture_at` for a picture as it is shown (flat, rows x 4 rows; `embodied.scene.far_canvas.share_down`)."""
    x = (dr.pi - dr.atan2(d.y, d.x)) / dr.two_pi * (4 * rows)
    up, y = dr.asin(dr.clip(d.z, -1, 1)), mi.Float(0.0)
    for k in range(len(KNOTS[0]) - 1):
        (e0, e1), (v0, v1) = (KNOTS[0][k], KNOTS[0][k + 1]), (KNOTS[1][k], KNOTS[1][k + 1])
        y = dr.select(up <= float(e0), (v0 + (up - e0) * ((v1 - v0) / (e1 - e0))) * rows, y)
    i = mi.UInt32(dr.clip(y, 0, rows - 1)) * (4 * rows) + mi.UInt32(dr.clip(x, 0, 4 * rows - 1))
    return dr.gather(mi.Color3f, table, i)
