"""From an atlas to light: every luxel's e, by stages that can be kept on disk and taken up again."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from embodied.geometry import r2
from embodied.house.house import House
from embodied.house.shapes import inward
from embodied.light import denoise, radiosity
from embodied.light.arrays import Array
from embodied.light.atlas import SHELL, Atlas, Page
from embodied.light.backend import added_up, array, drjit, fraction, mitsuba
from embodied.light.colours import ColourMaps, albedo
from embodied.light.cover import Sheet, Texels, rasterise, sheets_of
from embodied.light.emitters import Lamp, Portal, portals_of
from embodied.light.memory import Memory, once
from embodied.light.radiosity import Patches, Points, Space, points_of
from embodied.light.settings import Settings
from embodied.light.sites import Sites, Spread, around_good
from embodied.light.sky import Outdoors
from embodied.light.unwrap import areas_of

AMBIENT = np.array([4.5e-4, 5e-4, 6e-4])
"""e that every surface receives besides: starlight and the lamps of the street; no room is ever black."""
SPARKS = 0.01
"""Share of a room's light that may be lost to keep its brightest spots from sparkling."""


@dataclass(frozen=True, eq=False)
class Luxels:
    """All luxels of a house in page order; n of them."""

    texels: tuple[Texels, ...]
    position: np.ndarray
    normal: np.ndarray
    face_normal: np.ndarray
    """(n, 3) float32 each."""
    thin: np.ndarray
    """(n,) bool."""
    albedo: np.ndarray
    """(n, 3) float32."""
    glow: np.ndarray
    """(n, 3) float32 radiance of what shines itself."""
    sampled: np.ndarray
    """(n,) bool, glow that lamps already account for."""
    area: np.ndarray
    """(n,) square metres."""
    owner: np.ndarray
    """(n,) int32 into Atlas.owners."""
    unit: np.ndarray
    """(n,) int32: room or opening, for leaving out lights that cannot reach."""
    shell: np.ndarray
    """(n,) bool: walls, floors and ceilings."""
    sheets: tuple[Sheet, ...]
    """The layouts of the atlas's pages."""


@dataclass(frozen=True, eq=False)
class Radiosity:
    """What reaches each luxel: (n, 3) float32 each, radiosity e = E / pi in 100 cd/m2."""

    direct: np.ndarray
    """From sky and lamps."""
    sun: np.ndarray
    """(n,) cosine-weighted share of the sun seen."""
    patches: np.ndarray
    """First bounce of the sun."""
    indirect: np.ndarray
    """All other bounces."""
    good: np.ndarray
    """(n,) bool; false on walls, floors and ceilings behind things."""

    @property
    def soft(self) -> np.ndarray:
        """All but the sun itself."""
        return self.direct + self.patches + self.indirect


def luxels_of(atlas: Atlas, maps: ColourMaps) -> Luxels:
    """What lies under every luxel; nothing glows yet (`with_glow`)."""
    sheets = sheets_of(atlas.pages)
    texels = tuple(rasterise(p, 1, s) for p, s in zip(atlas.pages, sheets))
    pairs = list(zip(atlas.pages, texels))
    owner = np.concatenate([p.owner[t.face] for p, t in pairs])
    ends = np.cumsum([len(t.index) for t in texels])
    places = {k: np.concatenate([getattr(t, k) for t in texels]) for k in ("position", "normal", "face_normal")}
    mine = lambda i: {k: a[ends[i] - len(texels[i].index) : ends[i]] for k, a in places.items()}
    texels = tuple(replace(t, **mine(i)) for i, t in enumerate(texels))  # type: ignore[arg-type]  # views: once in memory, not twice
    names = [o.split("/")[0] if k == "opening" else r for o, r, k in zip(atlas.owners, atlas.rooms, atlas.kinds)]
    unit = {name: i for i, name in enumerate(dict.fromkeys(names))}
    return Luxels(
        texels,
        places["position"],
        places["normal"],
        places["face_normal"],
        np.concatenate([p.thin[t.face] for p, t in pairs]),
        np.concatenate([albedo(p, t.cover, maps) for p, t in pairs]),
        np.zeros((len(owner), 3), np.float32),
        np.zeros(len(owner), bool),
        np.concatenate([_share_of_area(p, t) for p, t in pairs]),
        owner,
        np.array([unit[name] for name in names], np.int32)[owner],
        np.array([k in SHELL for k in atlas.kinds])[owner],
        sheets,
    )


def with_glow(lux: Luxels, house: House, atlas: Atlas, lamps: Sequence[Lamp]) -> Luxels:
    """The same luxels with what shines itself: the lamps that are on, screens."""
    found = [glow_of(house, atlas, p, t.face, lamps) for p, t in zip(atlas.pages, lux.texels)]
    glow = np.concatenate(
        [np.zeros((len(t.face), 3), np.float32) if g is None else g for g, t in zip(found, lux.texels)]
    )
    lit = {x.id for x in lamps}
    sampled = np.array([any(x.placement == o and x.id in lit for x in house.lights) for o in atlas.owners])
    return replace(lux, glow=glow, sampled=sampled[lux.owner] & (glow.sum(1) > 0))


def _share_of_area(page: Page, t: Texels) -> np.ndarray:
    """(n,) square metres each luxel stands for: its face's area shared out, every owner's sum kept exact."""
    faces = areas_of(page.corners)
    count = np.bincount(t.face, minlength=len(faces))
    given = np.where(count > 0, faces, 0.0)
    size = int(page.owner.max()) + 1 if len(page.owner) else 0
    whole, got = (np.bincount(page.owner, weights=w, minlength=size) for w in (faces, given))
    scale = whole / np.maximum(got, 1e-12)
    return (faces / np.maximum(count, 1) * scale[page.owner]).astype(np.float32)[t.face]


def glow_of(house: House, atlas: Atlas, page: Page, face: np.ndarray, lamps: Sequence[Lamp]) -> np.ndarray | None:
    """(n, 3) radiance that texels on faces (n,) of `page` give off themselves; None where nothing does."""
    emission = np.array([f.emission or (0.0, 0.0, 0.0) for f in page.finishes], np.float32)[page.finish]
    if not emission.any():
        return None
    out = np.zeros_like(emission)
    by_light = {x.id: x for x in lamps}
    for o in np.unique(page.owner[emission.any(1)]):
        name = atlas.owners[o]
        mine = (page.owner == o) & (emission.sum(1) > 0)
        lights = [x for x in house.lights if x.placement == name]
        if not lights:  # screens, stars on a nursery ceiling: they glow by themselves
            out[mine] = emission[mine]
        for x in lights:
            if x.id in by_light:
                out[mine] = by_light[x.id].radiance
    return out[face]


@dataclass(frozen=True, eq=False)
class Problem:
    """A house to be lit, at one hour."""

    house: House
    atlas: Atlas
    lux: Luxels
    sites: Sites
    space: Space
    outdoors: Outdoors
    lamps: tuple[Lamp, ...]
    settings: Settings
    memory: Memory | None = None
    """Where the house is lit more than once."""


@dataclass(frozen=True, eq=False)
class Source:
    """A light, as something that shines on luxels."""

    shine: Callable
    """From luxel numbers (m,), a number of rays, 0 for the settings', and a memory to e (m, 3)."""
    id: str
    lamp: Lamp | None = None


def sources_of(problem: Problem) -> list[Source]:
    """Sky and lamps."""
    atlas, lux, space, settings = problem.atlas, problem.lux, problem.space, problem.settings
    found = []
    for way in portals_of(problem.house):
        found.append(Source(_sky_of(problem, way), way.id))
    for x in problem.lamps:
        own = space
        if x.owner is not None and x.owner in atlas.owners:
            alone = functools.partial(radiosity.without, space, atlas, x.owner)
            own = once(problem.memory, ("without", x.owner), alone)
        lamp = lambda i, rays, x=x, s=own: radiosity.lamp_light(s, subset(lux, i), x, rays or settings.lamp_rays)
        found.append(Source(lambda i, rays, memory=None, f=lamp: array(f(i, rays)), x.id, x))
    return found


def _sky_of(problem: Problem, way: Portal) -> Callable:
    """`Source.shine` of the sky through a portal."""

    def shine(i: np.ndarray, rays: int, memory: Memory | None = None) -> np.ndarray:
        p = subset(problem.lux, i)
        return array(radiosity.sky_light(problem.space, p, way, rays or problem.settings.sky_rays, memory))

    return shine


@dataclass(frozen=True, eq=False)
class Shone:
    """What one light gives to sites."""

    source: Source
    units: np.ndarray
    """Numbers of the units it reaches."""
    which: np.ndarray
    """Sites it may reach, in those units."""
    e: np.ndarray
    """(len(which), 3) float32."""


def shone_on(problem: Problem, source: Source) -> Shone:
    """The light of a source at the sites; rooms that it reaches nowhere are left out."""
    lux, sites = problem.lux, problem.sites
    unit = lux.unit[sites.luxel]

    def shone() -> tuple[np.ndarray, np.ndarray]:
        seen = lambda: radiosity.reached(unit, lambda i: source.shine(sites.luxel[i], 4).sum(1) > 0)
        which = once(problem.memory, ("reached", source.id), seen)
        e = source.shine(sites.luxel[which], 0, problem.memory) if len(which) else np.zeros((0, 3), np.float32)
        return which, e

    if source.lamp is None or problem.memory is None:
        which, e = shone()
    else:  # of the same lamp with another colour or power
        radiance = np.asarray(source.lamp.radiance, np.float32)
        which, e = problem.memory.once(("shone", source.lamp.id), lambda: _per(radiance, *shone()))
        e = e * radiance
    return Shone(source, np.unique(unit[which]), which, e)


def _per(radiance: np.ndarray, which: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Light for each unit of a lamp's radiance."""
    return which, e / radiance


def direct_light(
    problem: Problem, shone: Sequence[Shone], spread: Spread, good: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) e from sky and lamps, and (n,) bool where rays of its own have found it.

    It is interpolated between sites; good luxels whose sites disagree about a light by more than the settings' `doubt`
    times all light there are asked with rays.
    """
    lux, sites = problem.lux, problem.sites
    total = np.zeros((len(sites.luxel), 3), np.float32)
    for x in shone:
        total[x.which] += x.e
    e = spread(total)
    bright, traced = e.mean(1), np.zeros(len(e), bool)
    enough = problem.settings.doubt * (bright + AMBIENT.mean())
    for x in shone:
        values = np.zeros_like(total)
        values[x.which] = x.e
        most = spread.most_apart(values.mean(1))
        mine = np.nonzero(np.isin(lux.unit, x.units) & good & (most[sites.own] > enough))[0]
        if not len(mine):
            continue
        _, apart = spread.moments(values.mean(1), mine)
        mine = mine[apart > enough[mine]]
        if len(mine):
            e[mine] += x.source.shine(mine, 0) - spread(values, mine)
            traced[mine] = True
    return np.maximum(e, 0.0), traced


def outer_light(problem: Problem, spread: Spread, samples: int = 24) -> np.ndarray:
    """(n, 3) e that the outer side of windows and outer doors takes from the open sky.

    What faces the room takes none: its luxels at the frame's edge lie in the plane of the lintel, from where
    every second ray runs up inside the wall.
    """
    mi, dr = mitsuba(), drjit()
    house, atlas, lux, sites, space = problem.house, problem.atlas, problem.lux, problem.sites, problem.space
    e = np.zeros((len(lux.position), 3), np.float32)
    into = {o.id: inward(house, o) for o in house.openings if None in o.rooms}
    outer = [k == "opening" and o.split("/")[0] in into for o, k in zip(atlas.owners, atlas.kinds)]
    inwards = np.array([into[o.split("/")[0]] if x else [np.nan] * 2 for o, x in zip(atlas.owners, outer)]).reshape(
        -1, 2
    )
    lies = (lux.face_normal[:, :2] * inwards[lux.owner]).sum(1) < 0.7
    mine = np.nonzero(lies[sites.luxel])[0]
    if not len(mine):
        return e
    p = subset(lux, sites.luxel[mine])
    portals = radiosity.portal_scene(portals_of(house) or [_nowhere()])

    def one(k: Array) -> tuple[Array, ...]:
        a, b = r2(mi.Float(k) + 1)
        u = fraction(mi.Point2f(p.turn0 + a, p.turn1 + b))
        d = mi.Frame3f(p.normal).to_world(mi.warp.square_to_cosine_hemisphere(u))
        ray = mi.Ray3f(p.position + p.face_normal * radiosity.LIFT, d)
        free = ~space.scene.ray_test(ray) & ~portals.ray_test(ray)
        return (dr.select(free, radiosity.env_lookup(space, d, free), mi.Color3f(0.0)),)

    at_sites = np.zeros((len(sites.luxel), 3), np.float32)
    at_sites[mine] = array(added_up(samples, one, dr.zeros(mi.Color3f, p.n))[0]) / samples
    e[lies] = spread(at_sites, np.nonzero(lies)[0])
    return e


def _nowhere() -> Portal:
    return Portal("", "", np.array([0.0, 0.0, -1e4]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))


def _lit_by(problem: Problem, patches: Patches, which: np.ndarray) -> np.ndarray:
    """(k, 3) e of sunlit patches at some sites; of none at none (a glint may reach no site)."""
    if not len(which):
        return np.zeros((0, 3), np.float32)
    return radiosity.patch_light(problem.space, subset(problem.lux, problem.sites.luxel[which]), patches)


def sun_light(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """(n,) share of the sun at luxels, and (k, 3) e of its first bounce at sites."""
    lux, sites, space, outdoors = problem.lux, problem.sites, problem.space, problem.outdoors
    portals = portals_of(problem.house)
    share, e = np.zeros(len(lux.position), np.float32), np.zeros((len(sites.luxel), 3), np.float32)
    if not portals or not outdoors.sun.any():
        return share, e
    through, towards = radiosity.portal_scene(portals), outdoors.sun_direction
    seen = lambda i, rays: np.asarray(radiosity.sun_share(space, subset(lux, i), through, towards, rays))
    mine = radiosity.reached(lux.unit, lambda i: seen(i, 1) > 0, tries=1000)
    mine = mine[lux.thin[mine] | (lux.face_normal[mine] @ towards.astype(np.float32) > 0)]
    if len(mine):
        share[mine] = seen(mine, 4)
    flux = lux.albedo * (share * lux.area)[:, None] * (outdoors.sun * radiosity.GLASS)
    unit = lux.unit[sites.luxel]
    for u in np.unique(lux.unit[share > 0]):
        patches = _patches(lux, flux, np.nonzero((lux.unit == u) & (share > 0))[0], problem.settings.patches)
        if patches is not None:
            lit = functools.partial(_lit_by, problem, patches)
            which = radiosity.reached(unit, lambda i, lit=lit: lit(i).sum(1) > 0)  # type: ignore[misc]
            e[which] += lit(which)
    return share, e


def _patches(lux: Luxels, flux: np.ndarray, mine: np.ndarray, most: int) -> Patches | None:
    """At most so many small lights for the sunlit luxels `mine` of one room; None for a glint."""
    power = flux.mean(1)
    at = np.round(lux.position[mine] * 4)
    mine = mine[np.lexsort((at[:, 0], at[:, 1], at[:, 2]))]
    cut = np.cumsum(power[mine])
    if cut[-1] < 1e-4:
        return None
    k = int(np.clip(most * min(1.0, 0.8 * float(lux.area[mine].sum()) + 0.1), 4, most))
    pick = mine[np.minimum(np.searchsorted(cut, (np.arange(k) + 0.5) / k * cut[-1]), len(mine) - 1)]
    strength = flux[pick] / flux[pick].mean(1, keepdims=True) * (cut[-1] / k)
    extent = np.full(k, max(float(lux.area[mine].sum()) / k, 1e-3))
    return Patches(lux.position[pick], lux.normal[pick], lux.thin[pick], strength, extent)


@dataclass(frozen=True, eq=False)
class Bounced:
    """Indirect light at sites."""

    e: np.ndarray
    """(k, 3)."""
    good: np.ndarray
    """(k,) bool; false inside or behind things."""
    variance: np.ndarray
    """(k,) of brightness, before it is smoothed."""


def bounce(problem: Problem, soft: np.ndarray, tell: Callable[[float], None]) -> Bounced:
    """All further bounces, by Jacobi rounds of gathering.

    Args:
      soft: (n, 3) first light, without the sun's own.
    """
    lux, sites, settings = problem.lux, problem.sites, problem.settings
    here = subset(lux, sites.luxel)
    first, total, e = 0, sum(settings.bounces), np.zeros((len(sites.luxel), 3), np.float32)
    seen = lux.albedo * (soft + AMBIENT.astype(np.float32)) + np.where(lux.sampled[:, None], 0.0, lux.glow).astype(
        np.float32
    )
    for samples in settings.bounces:
        tell(first / total)
        table = _tamed(lux, seen + lux.albedo * e[sites.own])
        more, bad, variance = radiosity.gather(problem.space, here, table, samples, first, problem.memory)
        e = more if first else more + _endless(lux, sites, more, bad < 0.5)
        first += samples
    return Bounced(e, bad < 0.5, variance)


def _tamed(lux: Luxels, seen: np.ndarray) -> np.ndarray:
    """Radiosity cut, room by room, where at most `SPARKS` of the room's light is lost by it: what is smaller
    than a hand beside a bulb would show as sparks on far walls, one ray in hundreds. What was cut is shared out
    over the room, or every bounce would lose it anew."""
    y = seen.mean(1)
    out = np.array(seen, np.float32)
    for unit in np.unique(lux.unit):
        mine = np.nonzero(lux.unit == unit)[0]
        most = max(_most(y[mine], lux.area[mine]), 1e-9)
        out[mine] *= np.minimum(1.0, most / np.maximum(y[mine], 1e-9))[:, None]
        before, after = ((a[mine] * lux.area[mine, None]).sum(0) for a in (seen, out))
        out[mine] *= before / np.maximum(after, 1e-12)
    return out


def _most(y: np.ndarray, area: np.ndarray) -> float:
    """The least brightness to which luxels can be cut where that loses at most `SPARKS` of their light."""
    allowed = SPARKS * float((y * area).sum())
    tenth = len(y) // 10 + 1
    bright = float(np.partition(y, -tenth)[-tenth])
    top = np.nonzero(y >= bright)[0]
    if float(((y[top] - bright) * area[top]).sum()) < allowed:  # too little is lost there: look at all
        top = np.arange(len(y))
    order = top[np.argsort(y[top])]
    rising, above = y[order], np.cumsum(area[order][::-1])[::-1]
    lost = np.cumsum((np.diff(rising, append=rising[-1]) * np.append(above[1:], 0.0))[::-1])[::-1]
    return float(rising[min(int(np.searchsorted(-lost, -allowed)), len(rising) - 1)])


def _endless(lux: Luxels, sites: Sites, once: np.ndarray, good: np.ndarray) -> np.ndarray:
    """First guess (n, 3) of all bounces after the first one `once`: each room as a sphere, e * rho / (1 - rho).

    Jacobi rounds from nothing would miss a fifth of a white room's light after four of them. The
    brightest luxels count at most three times the middle one: what lies between window and closed
    curtain does not light the room.
    """
    out, unit, shell = np.zeros_like(once), lux.unit[sites.luxel], lux.shell[sites.luxel]
    openings = 0.03  # share of a room's walls that lets light out
    for u in np.unique(unit):
        mine = np.nonzero((unit == u) & shell & good)[0]
        if len(mine):
            which = sites.luxel[mine]
            weight = lux.area[which, None] / lux.area[which].sum()
            rho = (lux.albedo[which] * weight).sum(0) * (1 - openings)
            arrived = np.minimum(once[mine], 3 * np.median(once[mine], axis=0))
            out[unit == u] = (arrived * weight).sum(0) * rho / (1 - rho)
    return out


def smooth(sites: Sites, bounced: Bounced) -> np.ndarray:
    """(k, 3) indirect light without its noise."""
    capped = denoise.cap_sparks(bounced.e, sites.around, bounced.good, variance=bounced.variance)
    return denoise.smooth_sites(
        capped, sites.position, sites.normal, sites.around, bounced.good, variance=bounced.variance
    )


def visible(problem: Problem, spread: Spread, good: np.ndarray) -> np.ndarray:
    """(n,) bool: luxels that are neither inside nor behind things; asked with rays where the sites around disagree.

    Args:
      good: (k,) bool, of sites.
    """
    lux = problem.lux
    share, _ = spread.moments(good)
    out = share > 0.5
    unsure = np.nonzero((share > 0.03) & (share < 0.97))[0]
    if len(unsure):
        _, bad, _ = radiosity.gather(problem.space, subset(lux, unsure), np.zeros_like(lux.position), 12)
        out[unsure] = bad < 0.5
    return out


def subset(lux: Luxels, i: np.ndarray) -> Points:
    """Some luxels on the device."""
    return points_of(lux.position[i], lux.normal[i], lux.face_normal[i], lux.thin[i])


def solve(
    problem: Problem,
    tell: Callable[[str, float], None] = lambda stage, done: None,
    clock: Callable[[str], None] = lambda name: None,
) -> Radiosity:
    """The light of a house."""
    atlas, lux, sites, memory = problem.atlas, problem.lux, problem.sites, problem.memory
    k, sources = len(sites.luxel), sources_of(problem)
    anywhere = Spread(sites, lux.position, lux.normal, np.ones(k, bool))
    shone: list[Shone] = []
    first = np.zeros((k, 3), np.float32)
    for source in sources:
        tell("direct light", len(shone) / len(sources))
        shone.append(shone_on(problem, source))
        first[shone[-1].which] += shone[-1].e
    clock("direct")
    share, patches = sun_light(problem)
    clock("sun")
    bounced = bounce(problem, anywhere(first + patches), lambda x: tell("bounces", x))
    clock("bounces")
    tell("smoothing", 0.0)
    around = once(memory, "around", lambda: around_good(sites, bounced.good))
    spread = Spread(around, lux.position, lux.normal, bounced.good)
    indirect = spread(smooth(sites, bounced))
    good = once(memory, "visible", lambda: visible(problem, anywhere, bounced.good))
    clock("smooth")
    direct, traced = direct_light(problem, shone, spread, good)
    grain = denoise.spatial_variance(direct, atlas, lux.texels, traced) * 0.8
    direct = denoise.smooth_pages(
        direct, atlas, lux.texels, good, traced, steps=(1, 2), likeness=(0.3, 0.2), variance=grain
    )
    clock("direct")
    indirect += outer_light(problem, anywhere)
    return Radiosity(direct, share, spread(patches), indirect, good | ~lux.shell)
