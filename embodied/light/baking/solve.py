"""From an atlas to light: every luxel's e, by stages that can be kept on disk and taken up again."""

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from embodied.house.house import House
from embodied.house.shapes import inward
from embodied.light.backend import LightingCache, RayScene, array, brightness, floats, free_memory, get_or_compute, mi
from embodied.light.baking import denoise
from embodied.light.pages.atlas import Atlas
from embodied.light.settings import LightSettings
from embodied.light.tracing import radiosity
from embodied.light.tracing.emitters import Lamp, Portal, portals_of
from embodied.light.tracing.luxels import AMBIENT, Luxels, points
from embodied.light.tracing.radiosity import Met, Patches, Points, Space, Together, meet
from embodied.light.tracing.sky import Outdoors

SPARKS = 0.01
"""Share of a room's light that may be lost to keep its brightest spots from sparkling."""
LUXELS_TRIED = 300
"""Luxels of every room and opening that are asked whether a light reaches them."""
BOUNCE_ROUNDS = 3
"""Of gathering along the same rays, before what is seen is gathered."""


@dataclass(frozen=True, eq=False)
class Radiosity:
    """Light that reaches each luxel: (n, 3) float32 each, radiosity e = E / pi in 100 cd/m2."""

    direct: np.ndarray
    """From sky and lamps."""
    sun: np.ndarray
    """(n,) cosine-weighted share of the sun seen."""
    patches: np.ndarray
    """First bounce of the sun."""
    indirect: np.ndarray
    """All other bounces."""
    good: np.ndarray
    """(n,) bool; false behind and inside things, and in gaps."""

    @property
    def soft(self) -> np.ndarray:
        """All but the sun itself."""
        return self.direct + self.patches + self.indirect


@dataclass(frozen=True, eq=False)
class BakeInput:
    """A house to be lit, at one hour."""

    house: House
    atlas: Atlas
    lux: Luxels
    space: Space
    outdoors: Outdoors
    lamps: tuple[Lamp, ...]
    settings: LightSettings
    memory: LightingCache | None = None
    """Results that lightings share; None where the house is lit once."""
    without: Mapping[str, RayScene] = field(default_factory=dict)
    """Scenes that the shadow rays of a bare bulb meet, by the owner that the bulb hangs in."""
    _own: LightingCache = field(default_factory=dict)

    @functools.cached_property
    def points(self) -> Points:
        """All luxels on the device."""
        return get_or_compute(self.memory, "points", lambda: points(self.lux, self.settings.seen_rays))

    @functools.cached_property
    def near(self) -> Met:
        """Hits of the rays that carry light from bounce to bounce."""
        return get_or_compute(self.memory, "near", lambda: meet(self.space, self.points, self.settings.bounce_rays))

    @functools.cached_property
    def free(self) -> np.ndarray:
        """Numbers of the luxels that may be seen: not all of those rays meet what is inside or close before them."""
        return np.nonzero(self.near.bad < self.near.rays)[0]

    @functools.cached_property
    def far(self) -> Met:
        """Hits of the other rays of the luxels `free`."""
        first, last = self.settings.bounce_rays, self.settings.seen_rays
        return get_or_compute(self.memory, "far", lambda: meet(self.space, self.at(self.free), last - first, first))

    def reached(self, sees: Callable[[np.ndarray], np.ndarray], tries: int = LUXELS_TRIED) -> np.ndarray:
        """Numbers of the luxels that may be seen and that a light may reach.

        Args:
          sees: from luxel numbers (k,) to whether each is reached, (k,) bool.
          tries: luxels of every room and opening that are asked.
        """
        free = self.free
        units = self.lux.unit[free].astype(np.int16)  # which are sorted ten times as fast
        if not len(free):
            return free
        memory = self._own if self.memory is None else self.memory
        some = get_or_compute(memory, ("tried", tries), lambda: radiosity.tried(units, tries))
        return free[radiosity.reached(units, some, sees(free[some]))]

    def at(self, luxels: np.ndarray) -> Points:
        """Some luxels on the device, by their numbers."""
        return radiosity.only(self.points, luxels)


def _shine(inputs: BakeInput, source: Portal | Lamp, i: np.ndarray, rays: int | None = None) -> np.ndarray:
    """(m, 3) e that a source gives to luxels (m,), by so many rays; by those of the settings, and remembered, without a
    number."""
    points, settings = inputs.at(i), inputs.settings
    if isinstance(source, Portal):
        memory = inputs.memory if rays is None else None
        return array(radiosity.sky_light(inputs.space, points, source, rays or settings.sky_rays, memory))
    scene = inputs.without.get(source.owner or "", inputs.space.scene)
    return array(radiosity.lamp_light(scene, points, source, rays or settings.lamp_rays))


def shone_on(inputs: BakeInput, source: Portal | Lamp) -> tuple[np.ndarray, np.ndarray]:
    """The light of a source: (k,) luxels that it may reach, rooms that it reaches nowhere left out, and (k, 3) e."""
    radiance = np.asarray(source.radiance, np.float32) if isinstance(source, Lamp) else None

    def shone() -> tuple[np.ndarray, np.ndarray]:
        seen = lambda: inputs.reached(lambda i: _shine(inputs, source, i, 4).sum(1) > 0)
        which = get_or_compute(inputs.memory, ("reached", source.id), seen)
        e = _shine(inputs, source, which) if len(which) else np.zeros((0, 3), np.float32)
        return which, e if radiance is None or inputs.memory is None else e / radiance

    if radiance is None or inputs.memory is None:
        return shone()
    which, e = get_or_compute(inputs.memory, ("shone", source.id), shone)  # whatever its colour or power was
    return which, e * radiance


def outer_light(inputs: BakeInput, samples: int = 24) -> np.ndarray:
    """(n, 3) e that the outer side of windows and outer doors takes from the open sky.

    What faces the room takes none: its luxels at the frame's edge lie in the plane of the lintel, from where
    every second ray runs up inside the wall.
    """
    house, lux, space = inputs.house, inputs.lux, inputs.space
    e = np.zeros((len(lux.position), 3), np.float32)
    outer_side = np.nonzero(_facing_in(inputs) < 0.7)[0]
    if not len(outer_side):
        return e
    ways = portals_of(house)
    scene = Together((space.scene, radiosity.portal_scene(ways))) if ways else space.scene
    e[outer_side] = radiosity.open_sky(scene, space.env, inputs.at(outer_side), samples, mi.Color3f(0.0))
    return e


def _facing_in(inputs: BakeInput) -> np.ndarray:
    """(n,) how far luxels of windows and outer doors face the room, level, 1 to -1; nan of all else."""
    house, atlas, lux = inputs.house, inputs.atlas, inputs.lux
    into = {o.id: inward(house, o) for o in house.openings if None in o.rooms}
    outer = [k == "opening" and o.split("/")[0] in into for o, k in zip(atlas.owners, atlas.kinds)]
    inwards = [into[o.split("/")[0]] if x else [np.nan] * 2 for o, x in zip(atlas.owners, outer)]
    return (lux.face_normal[:, :2] * np.array(inwards).reshape(-1, 2)[lux.owner]).sum(1)


def _lit_by(inputs: BakeInput, patches: Patches, which: np.ndarray) -> np.ndarray:
    """(k, 3) e of sunlit patches at some luxels; of none at none (a glint may reach no luxel)."""
    if not len(which):
        return np.zeros((0, 3), np.float32)
    return radiosity.patch_light(inputs.space.scene, inputs.at(which), patches)


def sun_light(inputs: BakeInput) -> tuple[np.ndarray, np.ndarray]:
    """(n,) share of the sun at luxels, and (n, 3) e of its first bounce."""
    lux, scene, outdoors = inputs.lux, inputs.space.scene, inputs.outdoors
    portals = portals_of(inputs.house)
    share, e = np.zeros(len(lux.position), np.float32), np.zeros((len(lux.position), 3), np.float32)
    if not portals or not outdoors.sun.any():
        return share, e
    through, towards = radiosity.portal_scene(portals), outdoors.sun_direction
    seen = lambda i, rays: np.asarray(radiosity.sun_share(scene, inputs.at(i), through, towards, rays))
    facing = inputs.reached(lambda i: seen(i, 1) > 0, tries=1000)
    facing = facing[lux.thin[facing] | (lux.face_normal[facing] @ towards.astype(np.float32) > 0)]
    if len(facing):
        share[facing] = seen(facing, 4)
    for patches in sunlit(inputs, share, inputs.settings.patches):
        lit = functools.partial(_lit_by, inputs, patches)
        which = inputs.reached(lambda i, lit=lit: lit(i).sum(1) > 0)  # type: ignore[misc]
        e[which] += lit(which)
    return share, e


def sunlit(inputs: BakeInput, share: np.ndarray, most: int) -> Iterator[Patches]:
    """At most so many small lights for each room and opening where luxels have a share (n,) of the sun, what faces
    outdoors left out."""
    lux, share = inputs.lux, np.where(_facing_in(inputs) < -0.3, 0.0, share)
    flux = lux.albedo * (share * lux.area)[:, None] * (inputs.outdoors.sun * radiosity.GLAZING)
    for u in np.unique(lux.unit[share > 0]):
        patches = _patches(lux, flux, np.nonzero((lux.unit == u) & (share > 0))[0], most)
        if patches is not None:
            yield patches


def _patches(lux: Luxels, flux: np.ndarray, sunlit: np.ndarray, most: int) -> Patches | None:
    """At most so many small lights for the luxels `sunlit` of one room; None for a glint."""
    power = brightness(flux)
    at = np.round(lux.position[sunlit] * 4)
    sunlit = sunlit[np.lexsort((at[:, 0], at[:, 1], at[:, 2]))]
    cut = np.cumsum(power[sunlit])
    if cut[-1] < 1e-4:
        return None
    k = int(np.clip(most * min(1.0, 0.8 * float(lux.area[sunlit].sum()) + 0.1), 4, most))
    pick = sunlit[np.minimum(np.searchsorted(cut, (np.arange(k) + 0.5) / k * cut[-1]), len(sunlit) - 1)]
    strength = flux[pick] / flux[pick].mean(1, keepdims=True) * (cut[-1] / k)
    extent = np.full(k, max(float(lux.area[sunlit].sum()) / k, 1e-3))
    return Patches(lux.position[pick], lux.normal[pick], lux.thin[pick], strength, extent)


@dataclass(frozen=True, eq=False)
class Bounced:
    """Indirect light at luxels."""

    e: np.ndarray
    """(n, 3)."""
    good: np.ndarray
    """(n,) bool; false inside or behind things."""
    variance: np.ndarray
    """(n,) of brightness, before it is smoothed."""


def bounce(inputs: BakeInput, soft: np.ndarray, tell: Callable[[float], None]) -> Bounced:
    """All further bounces, by Jacobi rounds of gathering along the same few rays, and more of them for what is seen.

    In the last round and in what is seen no spot sparkles (`clamp_fireflies`).

    Args:
      soft: (n, 3) first light, without the sun's own.
    """
    lux, near, free = inputs.lux, inputs.near, inputs.free
    seen = leaving(lux, soft)
    e = np.zeros_like(soft)
    for k in range(BOUNCE_ROUNDS):
        tell(k / (BOUNCE_ROUNDS + 1))
        table = seen + lux.albedo * e
        calm = table if k < BOUNCE_ROUNDS - 1 else clamp_fireflies(lux, table)
        e = radiosity.gather(near, floats(calm))[0] / near.rays
        if k == 0:
            e += _infinite_bounces(lux, e, near.bad < 0.5 * near.rays)
    tell(BOUNCE_ROUNDS / (BOUNCE_ROUNDS + 1))
    last = floats(clamp_fireflies(lux, seen + lux.albedo * e))
    total, square = radiosity.gather(near, last)
    bad, rays = near.bad.copy(), np.full(len(e), near.rays, np.float32)
    if len(free) and inputs.settings.seen_rays > near.rays:
        for all_, more in zip((total, square, bad), (*radiosity.gather(inputs.far, last), inputs.far.bad)):
            all_[free] += more
        rays[free] += inputs.far.rays
    e = total / rays[:, None]
    variance = np.maximum(square / rays - brightness(e) ** 2, 0.0) / np.maximum(rays - 1, 1)
    return Bounced(e, bad < 0.5 * rays, variance)


def leaving(lux: Luxels, soft: np.ndarray) -> np.ndarray:
    """(n, 3) radiosity of luxels in light (n, 3), without the glow that lamps account for."""
    glow = np.where(lux.sampled[:, None], 0.0, lux.glow).astype(np.float32)
    return lux.albedo * (soft + AMBIENT.astype(np.float32)) + glow


def clamp_fireflies(lux: Luxels, seen: np.ndarray) -> np.ndarray:
    """Radiosity cut, room by room, where at most `SPARKS` of the room's light is lost by it: what is smaller
    than a hand beside a bulb would show as sparks on far walls, one ray in hundreds. What was cut is shared out
    over the room, or every bounce would lose it anew."""
    y, units = brightness(seen), lux.unit.astype(np.int16)  # which are sorted ten times as fast
    order = np.argsort(units, kind="stable")
    first = np.flatnonzero(np.diff(units[order], prepend=-1))
    most = np.zeros(int(units.max(initial=0)) + 1, np.float32)
    for unit in np.split(order, first[1:]):
        most[units[unit[:1]]] = max(_most(y[unit], lux.area[unit]), 1e-9)
    out = seen * np.minimum(1.0, most[units] / np.maximum(y, 1e-9))[:, None]
    before, after = ([np.bincount(units, c * lux.area, len(most)) for c in a.T] for a in (seen, out))
    scale = np.transpose([b / np.maximum(a, 1e-12) for b, a in zip(before, after, strict=True)])
    return (out * scale.astype(np.float32)[units]).astype(np.float32, copy=False)


def _most(y: np.ndarray, area: np.ndarray) -> float:
    """The least brightness to which luxels can be cut where that loses at most `SPARKS` of their light."""
    allowed = SPARKS * float((y * area).sum())
    order = np.argsort(y)
    rising, above = y[order], np.cumsum(area[order][::-1])[::-1]
    lost = np.cumsum((np.diff(rising, append=rising[-1]) * np.append(above[1:], 0.0))[::-1])[::-1]
    return float(rising[min(int(np.searchsorted(-lost, -allowed)), len(rising) - 1)])


def _infinite_bounces(lux: Luxels, direct: np.ndarray, good: np.ndarray) -> np.ndarray:
    """First guess (n, 3) of all bounces after the first one `direct`: each room as a sphere, e * rho / (1 - rho).

    Jacobi rounds from nothing would miss a fifth of a white room's light after four of them. The
    brightest luxels count at most three times the middle one: what lies between window and closed
    curtain does not light the room.
    """
    out = np.zeros_like(direct)
    openings = 0.03  # share of a room's walls that lets light out
    for u in np.unique(lux.unit):
        walls = np.nonzero((lux.unit == u) & lux.shell & good)[0]
        if len(walls):
            weight = lux.area[walls, None] / lux.area[walls].sum()
            rho = (lux.albedo[walls] * weight).sum(0) * (1 - openings)
            arrived = np.minimum(direct[walls], 3 * np.median(direct[walls], axis=0))
            out[lux.unit == u] = (arrived * weight).sum(0) * rho / (1 - rho)
    return out


def solve(inputs: BakeInput, tell: Callable[[str, float], None] = lambda stage, done: None) -> Radiosity:
    """The light of a house."""
    atlas, lux = inputs.atlas, inputs.lux
    sources: tuple[Portal | Lamp, ...] = (*portals_of(inputs.house), *inputs.lamps)
    direct = np.zeros((len(lux.position), 3), np.float32)
    for k, source in enumerate(sources):
        tell("direct light", k / len(sources))
        which, e = shone_on(inputs, source)
        direct[which] += e
    free_memory()
    share, patches = sun_light(inputs)
    free_memory()
    bounced = bounce(inputs, direct + patches, lambda x: tell("bounces", x))
    free_memory()
    tell("smoothing", 0.0)
    good, grid = bounced.good, get_or_compute(inputs.memory, "grid", lambda: denoise.Grid(atlas, lux.texels))
    indirect = denoise.smooth_pages(bounced.e, grid, good, variance=bounced.variance, likeness=(0.08, 0.08, 0.08))
    grain = denoise.spatial_variance(direct, grid) * 0.8
    direct = denoise.smooth_pages(direct, grid, good, variance=grain, likeness=(0.3, 0.2))
    free_memory()
    return Radiosity(direct, share, patches, indirect + outer_light(inputs), good)
