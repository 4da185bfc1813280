"""From light to pages: albedo times light at texel size, sharp sun, reflections, exposure."""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias, TypeVar

import cv2
import numpy as np
import shapely
from scipy.spatial import cKDTree

from embodied.house.house import House
from embodied.light.backend import (
    Array,
    LightingCache,
    RayScene,
    accumulate,
    array,
    booleans,
    brightness,
    dr,
    floats,
    get_or_compute,
    mi,
    opaque_float,
    opaque_uint,
    unsigned,
    vector,
)
from embodied.light.baking.solve import Radiosity
from embodied.light.pages.atlas import Atlas, Page
from embodied.light.pages.colours import ColourMaps, colour_at, linear, paints_of, shown
from embodied.light.pages.cover import Cover, Texels, cover, sources, surface
from embodied.light.pages.files import Ingredients
from embodied.light.pages.tone import Exposure, developed
from embodied.light.settings import LightSettings
from embodied.light.tracing import radiosity
from embodied.light.tracing.emitters import Lamp, portals_of
from embodied.light.tracing.luxels import AMBIENT, Luxels, glow_of
from embodied.light.tracing.radiosity import Space, points_of, woven
from embodied.light.tracing.sky import Outdoors

METAL_SHARE = 0.3
"""Metallic share from which on a surface shows its surroundings rather than its own colour."""
DULL, SHARP_RAYS, DULL_RAYS = 0.1, 1 / 3, 2
"""Roughness from which a metal's picture is so blurred that it is made per luxel, with many rays lest grain is left;
and the rays of sharp metals per texel and of dull ones per luxel, times the settings' `other_rays`."""
AROUND = 0.15
"""Addition to the blur of dull metals, tangent of an angle: what they show from elsewhere in the room is in it, too."""


@dataclass(frozen=True, eq=False)
class LightSolution:
    """A house with its light, in memory: what pages are composed from and checks are made on."""

    house: House
    atlas: Atlas
    lux: Luxels
    light: Radiosity
    outdoors: Outdoors
    lamps: tuple[Lamp, ...]
    exposure: Exposure
    space: Space
    """The house as rays meet it."""
    without: Mapping[str, RayScene]
    """As in `solve.BakeInput`."""


T = TypeVar("T")
Mirrors: TypeAlias = tuple[Array, Array, Array, Array, np.ndarray]
"""Metallic share, tint and dullness of faces, what sharp ones show, and a blurred picture for the dull."""


class Composer:
    """Makes the pages of a solved house; owns what all of them share on the device."""

    def __init__(
        self, solution: LightSolution, settings: LightSettings, maps: ColourMaps, memory: LightingCache | None = None
    ) -> None:
        self.solution, self.space, self.settings, self.maps = solution, solution.space, settings, maps
        self.memory = memory
        counts = [len(t.index) for t in solution.lux.texels]
        self._starts = np.cumsum([0, *counts])
        self.soft = solution.light.soft + AMBIENT.astype(np.float32)
        """(n, 3) all light but the sun's own."""
        self.sun = (solution.outdoors.sun * radiosity.GLAZING).astype(np.float32)
        """(3,) e of the sun behind the glass."""

    def kept(self, what: str, number: int, make: Callable[[], T]) -> T:
        """`make`, of a page's geometry, once for all lightings."""
        return get_or_compute(self.memory, (what, number), make)

    @functools.cached_property
    def gains(self) -> np.ndarray:
        """(n, 3) exposure at luxels."""
        return self.solution.exposure.many(self.solution.lux.position)

    def luxels(self, number: int) -> slice:
        """Positions of a page's luxels among all."""
        return slice(self._starts[number], self._starts[number + 1])

    @functools.cached_property
    def portals(self) -> RayScene | None:
        """Portals that sunlight comes in by; None without sun or windows."""
        portals = portals_of(self.solution.house)
        return radiosity.portal_scene(portals) if portals and self.solution.outdoors.sun.any() else None

    @functools.cached_property
    def seen(self) -> tuple[tuple[float, Array], tuple[float, Array]]:
        """For sharp and for dull metals the most that they show of a lamp's glint, which few rays would find, and the
        radiance of all luxels cut to that, on the device."""
        lux, light = self.solution.lux, self.solution.light
        seen = lux.albedo * (light.soft + light.sun[:, None] * self.sun) + lux.glow
        bright = float(np.percentile(brightness(seen), 95))
        sharp, dull = ((most * bright, floats(np.minimum(seen, most * bright))) for most in (8.0, 3.0))
        return sharp, dull


def page_of(number: int, composer: Composer) -> Ingredients:
    """Compose page `number` of the atlas."""
    solution = composer.solution
    page, coarse, luxels = solution.atlas.pages[number], solution.lux.texels[number], composer.luxels(number)
    light = np.concatenate([composer.soft[luxels], solution.light.sun[luxels, None]], axis=1)
    good, shell = solution.light.good[luxels], solution.lux.shell[luxels]
    light[:, :3] = out_of_gaps(light[:, :3], coarse.position, solution.lux.owner[luxels], good, good | shell)
    good |= ~shell
    known = filled(composer.kept("filling", number, lambda: filling(coarse.index, good, coarse.shape)), light)
    soft, share = np.ascontiguousarray(known[..., :3]), known[..., 3]
    fine = lambda: cover(page, page.fineness, solution.lux.sheets[number])
    c = coarse if page.fineness == 1 else composer.kept("cover", number, fine)
    sun = _sharp_sun(composer, page, coarse, c, share)
    nearest_luxel = composer.kept("luxels", number, lambda: sources(coarse.index, coarse.shape))
    gain = composer.gains[luxels][nearest_luxel].reshape(*coarse.shape, 3)
    glow = glow_of(solution.house, solution.atlas, page, c.face, solution.lamps)
    picture, albedo = _painted(composer, number, c, soft, gain, sun, glow, _mirrors(composer, page, coarse, c))
    whole = np.zeros(c.shape, np.uint8)
    if sun is not None:
        whole.ravel()[c.index] = (sun * 255 + 0.5).astype(np.uint8)
    nearest_texel = lambda: sources(c.index, c.shape)
    shown_by = nearest_luxel if page.fineness == 1 else composer.kept("texels", number, nearest_texel)

    def page_like(codes: np.ndarray) -> np.ndarray:
        codes = codes[shown_by] if len(codes) else shown_by.astype(np.uint32)
        return cv2.cvtColor(codes.astype("<u4").view(np.uint8).reshape(*c.shape, 4), cv2.COLOR_RGBA2RGB)

    glow = solution.lux.glow[luxels]
    glow = glow[nearest_luxel].reshape(*coarse.shape, 3) if glow.any() else np.zeros((0, 0, 3))
    half = lambda a: np.clip(a, 0, 6e4).astype(np.float16)
    return Ingredients(half(soft), whole, page_like(albedo), page_like(picture), half(glow))


def _painted(
    composer: Composer,
    number: int,
    c: Cover,
    soft: np.ndarray,
    gain: np.ndarray,
    sun: np.ndarray | None,
    glow: np.ndarray | None,
    mirrors: Mirrors | None,
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) uint32 packed sRGB of the covered texels: as shown, and their reflectance.

    Args:
      soft, gain: (h luxels, w luxels, 3). sun: (n,) share, or None. glow: (n, 3) or None. mirrors: from `_mirrors`.
    """
    if not len(c.index):
        return np.zeros(0, np.uint32), np.zeros(0, np.uint32)
    face, b1, b2 = unsigned(c.face), floats(c.b1), floats(c.b2)
    page = composer.solution.atlas.pages[number]

    def colours() -> np.ndarray:
        codes = _packed(shown(colour_at(paints_of(page, page.fineness, composer.maps), face, b1, b2)))
        dr.eval(codes)
        return np.array(codes)

    albedo = composer.kept("albedo", number, colours)
    colour = _linear(unsigned(albedo))
    read = _Bilinear(c, page)
    e = read(soft)
    if sun is not None:
        e += mi.Color3f(*(opaque_float(x) for x in composer.sun)) * floats(sun)
    radiance = colour * e
    if mirrors is not None:
        metal, tint, dull, sharp, blurred = mirrors
        share = dr.gather(mi.Float, metal, face)
        seen = dr.select(dr.gather(mi.Bool, dull, face), read(blurred), sharp)
        radiance = radiance * (1 - share) + seen * dr.maximum(colour, dr.gather(mi.Float, tint, face)) * share
    if glow is not None:
        radiance += mi.Color3f(vector(glow))
    picture = _packed(developed(radiance * read(gain)))
    dr.eval(picture)
    return np.array(picture), albedo


class _Bilinear:
    """Reads pictures of a page's luxels at its texels."""

    def __init__(self, c: Cover, page: Page) -> None:
        row, column = np.divmod(c.index.astype(np.int32), np.int32(c.shape[1]))
        right, bottom, width, step = (
            opaque_uint(x) for x in (page.width - 1, page.height - 1, page.width, page.fineness)
        )
        at = lambda a, last: dr.clip((floats(a) + 0.5) / mi.Float(step) - 0.5, 0.0, mi.Float(last))
        x, y = at(column, right), at(row, bottom)
        x0, y0 = mi.UInt32(x), mi.UInt32(y)
        x1, y1 = dr.minimum(x0 + 1, right), dr.minimum(y0 + 1, bottom)
        fx, fy = x - mi.Float(x0), y - mi.Float(y0)
        spots = y0 * width + x0, y0 * width + x1, y1 * width + x0, y1 * width + x1
        self._terms = tuple(zip(spots, ((1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy)))
        self._size = page.height, page.width

    def __call__(self, picture: np.ndarray) -> Array:
        assert picture.shape[:2] == self._size
        table, out = floats(picture), mi.Color3f(0.0)
        for spot, weight in self._terms:
            out += dr.gather(mi.Color3f, table, spot) * weight
        return out


def _packed(colour: Array) -> Array:
    """A colour in [0, 1] as red, green and blue bytes of one number, red lowest."""
    r, g, b = (mi.UInt32(dr.clip(x, 0.0, 1.0) * 255 + 0.5) for x in (colour.x, colour.y, colour.z))
    return r | (g << 8) | (b << 16)


def _linear(codes: Array) -> Array:
    """The linear colour of packed sRGB."""
    table = floats(linear(np.arange(256, dtype=np.float32) / 255))
    return mi.Color3f(*(dr.gather(mi.Float, table, (codes >> shift) & 255) for shift in (0, 8, 16)))


def _mirrors(composer: Composer, page: Page, coarse: Texels, c: Cover) -> Mirrors | None:
    """The sight that mirrors and metals show in place of their diffuse light: what somebody in the middle
    of the room sees in them.

    A texture cannot follow the eye; one fixed viewpoint gives them a plausible picture to wear.

    Returns:
      None for a page without any, else device arrays: metallic share, least tint and whether dull of each face;
      radiance of sharp metals per texel; and (h luxels, w luxels, 3) radiance of dull ones.
    """
    metal = np.array([1.0 if f.mirror else f.metallic for f in page.finishes], np.float32)[page.finish]
    rough = np.array([0.015 if f.mirror else f.roughness for f in page.finishes], np.float32)[page.finish]
    metal = np.where(metal > METAL_SHARE, metal, 0.0).astype(np.float32)
    if not metal.any():
        return None
    dull = rough > DULL
    blurred, sharp = np.zeros((*coarse.shape, 3), np.float32), np.zeros((len(c.index), 3), np.float32)
    if len(i := np.nonzero((dull & (metal > 0))[coarse.face])[0]):
        around = coarse.position[i], coarse.normal[i], coarse.face_normal[i]
        turn = woven(coarse.index[i], coarse.shape[1], _rays(composer, dull=True))
        seen = _mirrored(composer, page, coarse.face[i], around, rough[coarse.face[i]], turn)
        blurred = spread(coarse.index[i], evened(seen, coarse.index[i], coarse.shape), coarse.shape)
    if len(i := np.nonzero((~dull & (metal > 0))[c.face])[0]):
        sharp[i] = _mirrored(composer, page, c.face[i], surface(page, c, i), rough[c.face[i]])
    tint = np.where((metal > 0) & (rough < 0.02), 0.85, 0.0).astype(np.float32)
    return floats(metal), floats(tint), booleans(dull), mi.Color3f(vector(sharp)), blurred


def _mirrored(
    composer: Composer,
    page: Page,
    face: np.ndarray,
    surfaces: Sequence[np.ndarray],
    rough: np.ndarray,
    turn: np.ndarray | None = None,
) -> np.ndarray:
    """(k, 3) radiance that k places of one page mirror, all of them dull or none.

    Args:
      face: (k,) of the page. surfaces: position, normal and face normal, (k, 3) each. rough: (k,).
      turn: (2, k) of the samples at dull ones; None for sharp ones.
    """
    house, atlas, space = composer.solution.house, composer.solution.atlas, composer.space
    position, normal, face_normal = surfaces
    room = house.room_by_id.get(atlas.rooms[page.owner[face[0]]], house.rooms[0])
    eye = [*shapely.Polygon(room.polygon).representative_point().coords[0], house.storey_of(room).elevation + 1.5]
    to_eye = np.asarray(eye, np.float32) - position
    to_eye /= np.linalg.norm(to_eye, axis=1, keepdims=True) + 1e-9
    side = np.where((to_eye * face_normal).sum(1, keepdims=True) < 0, -1.0, 1.0).astype(np.float32)
    normal = normal * np.where(page.thin[face][:, None], side, 1.0)
    cos = (normal * to_eye).sum(1, keepdims=True)
    bounced = np.where(cos > 0.05, 2 * cos * normal - to_eye, normal)
    p = points_of(position, normal, normal, np.zeros(len(face), bool), turn)
    dull = turn is not None
    rays = _rays(composer, dull=dull)
    width = np.square(rough) + AROUND * dull
    limit, table = composer.seen[dull]
    spread_of, straight = floats(width), vector(bounced)

    def one(k: Array) -> tuple[Array, ...]:
        d = dr.normalize(straight + mi.warp.square_to_uniform_sphere(p.sample(k)) * spread_of)
        d = dr.select(dr.dot(d, p.normal) < 0.02, straight, d)
        near, hit = radiosity.hit_colour(space, table, mi.Ray3f(p.position + p.normal * radiosity.LIFT, d))
        return (dr.select(hit, near, radiosity.env_lookup(space.env, d, ~hit) * radiosity.GLAZING),)

    return np.minimum(array(accumulate(rays, one, dr.zeros(mi.Color3f, p.n))[0]) / rays, limit)


def _rays(composer: Composer, *, dull: bool) -> int:
    """Rays for each place that mirrors."""
    return max(round((DULL_RAYS if dull else SHARP_RAYS) * composer.settings.other_rays), 1)


def evened(values: np.ndarray, index: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Values (n, c) at flat positions of a page, each mixed with those two texels around it: the grain of too few
    rays goes."""
    there, sum_ = np.zeros(shape, np.float32), np.zeros((*shape, values.shape[1]), np.float32)
    there.ravel()[index] = 1.0
    sum_.reshape(-1, values.shape[1])[index] = values
    blurred = lambda a: cv2.GaussianBlur(a, (5, 5), 1.2, borderType=cv2.BORDER_CONSTANT)
    return (blurred(sum_) / np.maximum(blurred(there), 1e-6)[..., None]).reshape(-1, values.shape[1])[index]


HIDDEN = (2.0, 8.0)
"""Luxels behind things take their visible neighbours' light up to the first distance (in luxels), and none of it from
the second on."""


@dataclass(frozen=True, eq=False)
class Filling:
    """How a page's hidden luxels are filled."""

    shown_by: np.ndarray
    """(h * w,) which of the n luxels each texel shows: the nearest good one."""
    shape: tuple[int, int]
    hidden: np.ndarray
    """(k,) luxels that are not good, their flat positions, and (k, 1) how much of the good ones' light they take."""
    index: np.ndarray
    weight: np.ndarray


def filling(index: np.ndarray, good: np.ndarray, shape: tuple[int, int]) -> Filling:
    """How to fill a page whose n luxels lie at flat positions `index`.

    Args:
      good: (n,) bool; where none is, none is hidden either.
    """
    chosen, hidden = np.flatnonzero(good), np.flatnonzero(~good)
    if not len(chosen) or not len(hidden):
        chosen, hidden = np.arange(len(index)), hidden[:0]
    shown_by = sources(index[chosen], shape)
    if len(chosen) == len(index):
        return Filling(shown_by, shape, hidden, index[hidden], np.zeros((0, 1), np.float32))
    seen = np.zeros(shape, np.uint8)
    seen.ravel()[index[chosen]] = 1
    apart = cv2.distanceTransform(1 - seen, cv2.DIST_L2, 5).ravel()[index[hidden]]
    weight = 1 - np.clip((apart - HIDDEN[0]) / (HIDDEN[1] - HIDDEN[0]), 0.0, 1.0)[:, None].astype(np.float32)
    return Filling(chosen[shown_by], shape, hidden, index[hidden], weight)


def filled(filling: Filling, own: np.ndarray) -> np.ndarray:
    """(h, w, c) of a page: the good luxels' values, and theirs that fade into each hidden luxel's own beyond them.

    A luxel below a cupboard that stands on the floor must not darken the floor beside it; one below a
    bed is seen, and dark.

    Args:
      own: (n, c) values of luxels; without any, all is 0.
    """
    if not len(own):
        return np.zeros((*filling.shape, own.shape[1]), own.dtype)
    flat = own[filling.shown_by]
    theirs, at = flat[filling.index], filling.index
    flat[at] = theirs * filling.weight + np.minimum(own[filling.hidden], theirs) * (1 - filling.weight)
    return flat.reshape(*filling.shape, -1)


GAP, GAP_SHARE = 0.05, 0.6
"""Metres from which a luxel in a gap takes light, and the least share of that light it has."""


def out_of_gaps(
    e: np.ndarray, position: np.ndarray, owner: np.ndarray, good: np.ndarray, kept: np.ndarray
) -> np.ndarray:
    """Light (n, 3) of luxels; those in gaps get at least a share of what the nearest in the open has on the same thing.

    The gap between two doors of a cabinet is dark, but it is narrower than a luxel, which carries the dark onto the
    edges, and narrower than a pixel, which shows it as black dashes.

    Args:
      position: (n, 3). owner: (n,). good: (n,) bool, luxels in the open. kept: (n,) bool, luxels that stay as they are.
    """
    out, (at, gaps) = e.copy(), (np.flatnonzero(x) for x in (good, ~kept))
    if len(at):
        where = np.column_stack([position, owner * 2 * GAP])
        far, near = cKDTree(where[at]).query(where[gaps], distance_upper_bound=GAP)
        gaps, near = gaps[np.isfinite(far)], at[near[np.isfinite(far)]]
        out[gaps] = np.maximum(e[gaps], GAP_SHARE * e[near])
    return out


def spread(index: np.ndarray, values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Values (n, c) at flat positions of a page, and beyond them the nearest one's: (h, w, c)."""
    if not len(index):
        return np.zeros((*shape, values.shape[1]), values.dtype)
    return values[sources(index, shape)].reshape(*shape, -1)


def _sharp_sun(composer: Composer, page: Page, coarse: Texels, c: Cover, share: np.ndarray) -> np.ndarray | None:
    """(n,) float32 share of the sun per texel: traced where luxels around disagree, else taken from them; None for
    none."""
    if composer.portals is None or not len(c.index) or share.max() <= 0:
        return None
    towards = composer.solution.outdoors.sun_direction
    facing = np.clip(coarse.normal @ towards.astype(np.float32), 0, 1)
    own = share.ravel()[coarse.index]
    whole = np.where(own > 0.5 * facing, facing, 0.0) * (own > 0.004)
    whole = spread(coarse.index, np.where(page.thin[coarse.face], own, whole)[:, None].astype(np.float32), coarse.shape)
    box = np.ones((5, 5), np.uint8)
    high, low = cv2.dilate(share, box), cv2.erode(share, box)
    unsure = (high - low > 0.02) & (high > 0.004)
    rows, columns = np.divmod(c.index, c.shape[1])
    at = rows // page.fineness, columns // page.fineness
    out, i = whole[..., 0][at], np.nonzero(unsure[at])[0]
    if len(i):
        p = points_of(*surface(page, c, i), page.thin[c.face[i]])
        rays, scene = composer.settings.sun_rays, composer.space.scene
        out[i] = np.asarray(radiosity.sun_share(scene, p, composer.portals, towards, rays))
    return out
