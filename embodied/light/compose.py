"""From light to pages: albedo times light at texel size, sharp sun, reflections, exposure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import shapely

from embodied.house.house import House
from embodied.light import radiosity
from embodied.light.atlas import Atlas, Texels, albedo, gamma, nearest, rasterise
from embodied.light.backend import array, constant, drjit, mitsuba, r2, vector
from embodied.light.emitters import Lamp, portals_of
from embodied.light.radiosity import Space, points_of
from embodied.light.settings import Settings
from embodied.light.sky import Outdoors
from embodied.light.solve import AMBIENT, Luxels, Radiosity, glow_of
from embodied.light.tone import Exposure, display


@dataclass(frozen=True, eq=False)
class Ingredients:
    """One page before exposure, at texel size unless said otherwise."""

    soft: np.ndarray
    """(h luxels, w luxels, 3) float16 e of all light but the sun's own."""
    sun: np.ndarray
    """(h, w) uint8 share of the sun seen, times 255."""
    albedo: np.ndarray
    """(h, w, 3) uint8 sRGB."""
    picture: np.ndarray
    """(h, w, 3) uint8 sRGB, exposed: what the classic renderer shows."""
    glow: np.ndarray
    """(h luxels, w luxels, 3) float16 radiance of what shines itself; (0, 0, 3) where nothing does."""


DULL, SHARP_RAYS, DULL_RAYS = 0.1, 8, 96
"""Roughness from which a metal's picture is blurred so much that few rays leave grain, and the rays of either kind."""
AROUND = 0.15
"""What is added to the blur of dull metals, tangent of an angle: what they show from elsewhere in the room is in it, too."""


@dataclass(frozen=True, eq=False)
class Solved:
    """A house with its light, in memory: what pages are composed from and checks are made on."""

    house: House
    atlas: Atlas
    lux: Luxels
    light: Radiosity
    outdoors: Outdoors
    lamps: tuple[Lamp, ...]
    exposure: Exposure


def page_of(
    number: int, solved: Solved, space: Space, settings: Settings, read: Callable[[str], np.ndarray]
) -> Ingredients:
    """Compose page `number` of the atlas."""
    lux, light = solved.lux, solved.light
    page = solved.atlas.pages[number]
    start = sum(len(t.index) for t in lux.texels[:number])
    mine = slice(start, start + len(lux.texels[number].index))
    coarse = lux.texels[number]
    own = np.concatenate([light.soft[mine] + AMBIENT.astype(np.float32), light.sun[mine, None]], axis=1)
    known = filled(coarse.index, own, light.good[mine], coarse.shape)
    soft, share = np.ascontiguousarray(known[..., :3]), known[..., 3]
    t = rasterise(page, page.fineness)
    colour = albedo(page, t, read)
    size = (page.width * page.fineness, page.height * page.fineness)
    e = cv2.resize(soft, size, interpolation=cv2.INTER_LINEAR).reshape(-1, 3)[t.index]
    sun = _sharp_sun(solved, page, t, share, space, settings)
    radiance = colour * (e + sun[:, None] * (solved.outdoors.sun * radiosity.GLASS).astype(np.float32))
    _add_metal(radiance, solved, page, t, colour, space)
    radiance += glow_of(solved.house, solved.atlas, page, t, solved.lamps)
    shown_by = sources(t.index, t.shape)
    page_like = lambda values: (
        values[shown_by].reshape(*t.shape, -1) if len(t.index) else np.zeros((*t.shape, values.shape[1]), values.dtype)
    )
    picture = page_like(display(radiance, solved.exposure.at(t.position)))
    whole = np.zeros((t.shape[0] * t.shape[1], 1), np.uint8)
    whole[t.index] = (sun[:, None] * 255 + 0.5).astype(np.uint8)
    shown = page_like((gamma(colour) * 255 + 0.5).astype(np.uint8))
    glow = lux.glow[mine]
    glow = spread(coarse.index, glow, coarse.shape) if glow.any() else np.zeros((0, 0, 3))
    half = lambda a: np.clip(a, 0, 6e4).astype(np.float16)
    return Ingredients(half(soft), whole.reshape(t.shape), shown, picture, half(glow))


def _add_metal(radiance: np.ndarray, solved: Solved, page, t: Texels, colour: np.ndarray, space: Space) -> None:
    """Mirrors and metals in place of their diffuse light: what somebody in the middle of the room sees in them.

    A texture cannot follow the eye; one fixed viewpoint gives them a plausible picture to wear.
    """
    metal = np.array([1.0 if f.mirror else f.metallic for f in page.finishes], np.float32)[page.finish[t.face]]
    i = np.nonzero(metal > 0.3)[0]
    rough = np.array([0.015 if f.mirror else f.roughness for f in page.finishes], np.float32)[page.finish[t.face[i]]]
    for dull in (False, True):
        some = (rough > DULL) == dull
        mine, share = i[some], metal[i[some], None]
        if len(mine):
            tint = np.maximum(colour[mine], np.where(rough[some] < 0.02, 0.85, 0.0)[:, None])
            radiance[mine] = (
                radiance[mine] * (1 - share)
                + _mirrored(solved, page, t, mine, rough[some], space, dull=dull) * tint * share
            )


def _mirrored(
    solved: Solved, page, t: Texels, i: np.ndarray, rough: np.ndarray, space: Space, *, dull: bool
) -> np.ndarray:
    """(k, 3) radiance that the texels `i` of one roughness each mirror, all of them dull or none."""
    mi, dr = mitsuba(), drjit()
    house, atlas, lux, light, sun = solved.house, solved.atlas, solved.lux, solved.light, solved.outdoors.sun
    room = house.room_by_id.get(atlas.rooms[page.owner[t.face[i[0]]]], house.rooms[0])
    eye = [*shapely.Polygon(room.polygon).representative_point().coords[0], house.storey_of(room).elevation + 1.5]
    to_eye = np.asarray(eye, np.float32) - t.position[i]
    to_eye /= np.linalg.norm(to_eye, axis=1, keepdims=True) + 1e-9
    side = np.where((to_eye * t.face_normal[i]).sum(1, keepdims=True) < 0, -1.0, 1.0).astype(np.float32)
    normal = t.normal[i] * np.where(page.thin[t.face[i]][:, None], side, 1.0)
    cos = (normal * to_eye).sum(1, keepdims=True)
    bounced = np.where(cos > 0.05, 2 * cos * normal - to_eye, normal)
    p = points_of(t.position[i], normal, normal, np.zeros(len(i), bool))
    seen = lux.albedo * (light.soft + light.sun[:, None] * (sun * radiosity.GLASS).astype(np.float32)) + lux.glow
    rays, width = DULL_RAYS if dull else SHARP_RAYS, np.square(rough) + AROUND * dull
    limit = (3.0 if dull else 8.0) * np.percentile(seen.mean(1), 95)  # of a lamp's glint: few rays would find it
    seen = np.minimum(seen, limit).astype(np.float32)
    table, spread_of = mi.Float(seen.ravel()), mi.Float(width.astype(np.float32))
    straight, total = vector(bounced), dr.zeros(mi.Color3f, p.n)
    for k in range(rays):
        a, b = (constant(x) for x in r2(k))
        u = mi.Point2f(p.turn0 + a, p.turn1 + b)
        ball = mi.warp.square_to_uniform_sphere(u - dr.floor(u))
        d = dr.normalize(straight + ball * spread_of)
        d = dr.select(dr.dot(d, p.normal) < 0.02, straight, d)
        near, hit = radiosity.hit_colour(space, table, mi.Ray3f(p.position + p.normal * radiosity.LIFT, d))
        far = radiosity.env_lookup(space, d, ~hit) * radiosity.GLASS
        total += dr.select(hit, near, far)
        dr.eval(total)
    mirrored = np.minimum(array(total) / rays, limit)
    return evened(mirrored, t.index[i], t.shape) if dull else mirrored


def evened(values: np.ndarray, index: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Values (n, c) at flat positions of a page, each mixed with those two texels around it: the grain of too few rays goes."""
    there, sum_ = np.zeros(shape, np.float32), np.zeros((*shape, values.shape[1]), np.float32)
    there.ravel()[index] = 1.0
    sum_.reshape(-1, values.shape[1])[index] = values
    blurred = lambda a: cv2.GaussianBlur(a, (5, 5), 1.2, borderType=cv2.BORDER_CONSTANT)
    return (blurred(sum_) / np.maximum(blurred(there), 1e-6)[..., None]).reshape(-1, values.shape[1])[index]


def sources(index: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """(h * w,) int64: which of the n covered texels at flat positions `index` each texel of a page shows: its own or the nearest."""
    if not len(index):
        return np.zeros(shape[0] * shape[1], np.int64)
    mask = np.zeros(shape[0] * shape[1], bool)
    mask[index] = True
    number = np.zeros(len(mask), np.int64)
    number[index] = np.arange(len(index))
    return number[nearest(mask.reshape(shape)).ravel()]


HIDDEN = (2.0, 8.0)
"""Luxels behind things take their visible neighbours' light up to the first distance (in luxels), and none of it from the second on."""


def filled(index: np.ndarray, own: np.ndarray, good: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """(h, w, c) of a page: the good luxels' values, and theirs that fade into each hidden luxel's own beyond them.

    A luxel below a cupboard that stands on the floor must not darken the floor beside it; one below a
    bed is seen, and dark.

    Args:
      index: (n,) flat positions. own: (n, c). good: (n,) bool.
    """
    if good.all() or not good.any():
        return spread(index, own, shape)
    out, seen = spread(index[good], own[good], shape), np.zeros(shape, np.uint8)
    seen.ravel()[index[good]] = 1
    hidden = index[~good]
    apart = cv2.distanceTransform(1 - seen, cv2.DIST_L2, 5).ravel()[hidden]
    weight = np.clip((apart - HIDDEN[0]) / (HIDDEN[1] - HIDDEN[0]), 0.0, 1.0)[:, None].astype(out.dtype)
    flat = out.reshape(-1, out.shape[-1])
    flat[hidden] = flat[hidden] * (1 - weight) + np.minimum(own[~good], flat[hidden]) * weight
    return out


def spread(index: np.ndarray, values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Values (n, c) at flat positions of a page, and beyond them the nearest one's: (h, w, c)."""
    if not len(index):
        return np.zeros((*shape, values.shape[1]), values.dtype)
    return values[sources(index, shape)].reshape(*shape, -1)


def _sharp_sun(solved: Solved, page, t: Texels, share: np.ndarray, space: Space, settings: Settings) -> np.ndarray:
    """(n,) share of the sun per texel: traced where luxels around disagree, else taken from them."""
    outdoors, portals = solved.outdoors, portals_of(solved.house)
    if not outdoors.sun.any() or not portals or share.max() <= 0:
        return np.zeros(len(t.index), np.float32)
    facing = np.clip(t.normal @ outdoors.sun_direction.astype(np.float32), 0, 1)
    box = np.ones((5, 5), np.uint8)
    high, low = cv2.dilate(share, box), cv2.erode(share, box)
    unsure = (high - low > 0.02) & (high > 0.004)
    at = lambda a: np.kron(a, np.ones((page.fineness, page.fineness), a.dtype)).ravel()[t.index]
    out = at(share).astype(np.float32)
    out = np.where(page.thin[t.face], out, np.where(out > 0.5 * facing, facing, 0.0) * (out > 0.004))
    i = np.nonzero(at(unsure.astype(np.uint8)) > 0)[0]
    if len(i):
        p = points_of(t.position[i], t.normal[i], t.face_normal[i], page.thin[t.face[i]])
        out[i] = np.asarray(
            radiosity.sun_share(space, p, radiosity.portal_scene(portals), outdoors.sun_direction, settings.sun_rays)
        )
    return out
