"""From an atlas to light: every luxel's e, by stages that can be kept on disk and taken up again."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from embodied.house.house import House
from embodied.house.shapes import inward
from embodied.light import denoise, radiosity
from embodied.light.atlas import SHELL, Atlas, Texels, albedo, rasterise
from embodied.light.backend import array, constant, drjit, mitsuba, r2
from embodied.light.emitters import Lamp, Portal, portals_of
from embodied.light.radiosity import Points, Space, points_of
from embodied.light.settings import Settings
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
    """(n,) bool; false inside or behind things."""
    variance: np.ndarray
    """(n,) of the brightness of `indirect` before it is smoothed."""

    @property
    def soft(self) -> np.ndarray:
        """All but the sun itself."""
        return self.direct + self.patches + self.indirect


def luxels_of(house: House, atlas: Atlas, lamps: Sequence[Lamp], read: Callable[[str], np.ndarray]) -> Luxels:
    """What lies under every luxel."""
    texels = tuple(rasterise(p, 1) for p in atlas.pages)
    color, glow, thin, area, owner = [], [], [], [], []
    for page, t in zip(atlas.pages, texels):
        color.append(albedo(page, t, read))
        glow.append(glow_of(house, atlas, page, t, lamps))
        thin.append(page.thin[t.face])
        area.append(_share_of_area(page, t))
        owner.append(page.owner[t.face])
    owner_of = np.concatenate(owner)
    ends = np.cumsum([len(t.index) for t in texels])
    places = {k: np.concatenate([getattr(t, k) for t in texels]) for k in ("position", "normal", "face_normal")}
    mine = lambda i: {k: a[ends[i] - len(texels[i].index) : ends[i]] for k, a in places.items()}
    texels = tuple(replace(t, **mine(i)) for i, t in enumerate(texels))  # views: once in memory, not twice
    units = {}
    for o, room, kind in zip(atlas.owners, atlas.rooms, atlas.kinds):
        units.setdefault(o.split("/")[0] if kind == "opening" else room, len(units))
    unit_of_owner = np.array(
        [units[o.split("/")[0] if k == "opening" else r] for o, r, k in zip(atlas.owners, atlas.rooms, atlas.kinds)]
    )
    shell_of_owner = np.array([k in SHELL for k in atlas.kinds])
    lit = {x.id for x in lamps}
    sampled = np.array([any(x.placement == o and x.id in lit for x in house.lights) for o in atlas.owners])
    glow_all = np.concatenate(glow)
    return Luxels(
        texels,
        *places.values(),
        np.concatenate(thin),
        np.concatenate(color),
        glow_all,
        sampled[owner_of] & (glow_all.sum(1) > 0),
        np.concatenate(area),
        owner_of,
        unit_of_owner[owner_of].astype(np.int32),
        shell_of_owner[owner_of],
    )


def _share_of_area(page, t: Texels) -> np.ndarray:
    """(n,) square metres each luxel stands for: its face's area shared out, every owner's sum kept exact."""
    faces = areas_of(page.corners)
    count = np.bincount(t.face, minlength=len(faces))
    given = np.where(count > 0, faces, 0.0)
    size = int(page.owner.max()) + 1 if len(page.owner) else 0
    whole, got = (np.bincount(page.owner, weights=w, minlength=size) for w in (faces, given))
    scale = whole / np.maximum(got, 1e-12)
    return (faces / np.maximum(count, 1) * scale[page.owner]).astype(np.float32)[t.face]


def glow_of(house: House, atlas: Atlas, page, texels: Texels, lamps: Sequence[Lamp]) -> np.ndarray:
    """(n, 3) radiance that texels of `page` give off themselves."""
    emission = np.array([f.emission or (0.0, 0.0, 0.0) for f in page.finishes], np.float32)[page.finish[texels.face]]
    out = np.zeros_like(emission)
    if not emission.any():
        return out
    by_light = {x.id: x for x in lamps}
    for o in np.unique(page.owner):
        name = atlas.owners[o]
        mine = (page.owner[texels.face] == o) & (emission.sum(1) > 0)
        lights = [x for x in house.lights if x.placement == name]
        if not lights:  # screens, stars on a nursery ceiling: they glow by themselves
            out[mine] = emission[mine]
        for x in lights:
            if x.id in by_light:
                out[mine] = by_light[x.id].radiance
    return out


def direct_light(
    lux: Luxels,
    atlas: Atlas,
    space: Space,
    portals: Sequence[Portal],
    lamps: Sequence[Lamp],
    settings: Settings,
    tell: Callable[[float], None],
) -> np.ndarray:
    """(n, 3) e from sky and lamps."""
    e = np.zeros((len(lux.position), 3), np.float32)
    jobs: list[tuple[Space, Callable]] = []
    for portal in portals:
        jobs.append((space, lambda s, p, r, x=portal: radiosity.sky_light(s, p, x, r or settings.sky_rays)))
    for lamp in lamps:
        own = space
        if lamp.owner is not None and lamp.owner in atlas.owners:
            own = radiosity.without(space, atlas, lamp.owner)
        jobs.append((own, lambda s, p, r, x=lamp: radiosity.lamp_light(s, p, x, r or settings.lamp_rays)))
    for done, (where, shine) in enumerate(jobs):
        tell(done / len(jobs))
        _add_light(e, lux, functools.partial(_shine, lux, where, shine))
    return e


def _shine(lux: Luxels, where: Space, shine: Callable, i: np.ndarray, rays: int) -> np.ndarray:
    return array(shine(where, subset(lux, i), rays))


def _add_light(e: np.ndarray, lux: Luxels, shine: Callable[[np.ndarray, int], np.ndarray]) -> None:
    """Add what one light gives to the luxels that it can reach; 0 rays stands for the settings' number."""
    mine = radiosity.reached(lux.unit, lambda i: shine(i, 4).sum(1) > 0)
    if len(mine):
        e[mine] += shine(mine, 0)


def outer_light(house: House, lux: Luxels, atlas: Atlas, space: Space, samples: int = 24) -> np.ndarray:
    """(n, 3) e that the outer side of windows and outer doors takes from the open sky.

    What faces the room takes none: its luxels at the frame's edge lie in the plane of the lintel, from where
    every second ray runs up inside the wall.
    """
    mi, dr = mitsuba(), drjit()
    e = np.zeros((len(lux.position), 3), np.float32)
    into = {o.id: inward(house, o) for o in house.openings if None in o.rooms}
    inwards = np.array(
        [
            into.get(o.split("/")[0], [np.nan] * 2) if k == "opening" else [np.nan] * 2
            for o, k in zip(atlas.owners, atlas.kinds)
        ]
    )
    mine = np.nonzero((lux.face_normal[:, :2] * inwards[lux.owner]).sum(1) < 0.7)[0]
    if not len(mine):
        return e
    p = subset(lux, mine)
    total = dr.zeros(mi.Color3f, p.n)
    portals = radiosity.portal_scene(portals_of(house) or [_nowhere()])
    for k in range(samples):
        a, b = (constant(x) for x in r2(k))
        u = mi.Point2f(p.turn0 + a, p.turn1 + b)
        d = mi.Frame3f(p.normal).to_world(mi.warp.square_to_cosine_hemisphere(u - dr.floor(u)))
        ray = mi.Ray3f(p.position + p.face_normal * radiosity.LIFT, d)
        free = ~space.scene.ray_test(ray) & ~portals.ray_test(ray)
        total += dr.select(free, radiosity.env_lookup(space, d, free), mi.Color3f(0.0))
        dr.eval(total)
    e[mine] = array(total) / samples
    return e


def _nowhere() -> Portal:
    return Portal("", "", np.array([0.0, 0.0, -1e4]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))


def sun_light(
    lux: Luxels, space: Space, portals: Sequence[Portal], outdoors: Outdoors, settings: Settings
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) share of the sun, and (n, 3) e of its first bounce."""
    n = len(lux.position)
    if not portals or not outdoors.sun.any():
        return np.zeros(n, np.float32), np.zeros((n, 3), np.float32)
    share = np.asarray(
        radiosity.sun_share(
            space, subset(lux, np.arange(n)), radiosity.portal_scene(portals), outdoors.sun_direction, 4
        )
    )
    flux = lux.albedo * (share * lux.area)[:, None] * (outdoors.sun * radiosity.GLASS)
    power = flux.mean(1)
    e = np.zeros((n, 3), np.float32)
    for unit in np.unique(lux.unit[power > 0]):
        mine = np.nonzero((lux.unit == unit) & (power > 0))[0]
        at = np.round(lux.position[mine] * 4)
        mine = mine[np.lexsort((at[:, 0], at[:, 1], at[:, 2]))]
        cut = np.cumsum(power[mine])
        if cut[-1] < 1e-4:
            continue
        k = int(np.clip(settings.patches * min(1.0, len(mine) / 2000 + 0.1), 4, settings.patches))
        pick = mine[np.minimum(np.searchsorted(cut, (np.arange(k) + 0.5) / k * cut[-1]), len(mine) - 1)]
        strength = flux[pick] / flux[pick].mean(1, keepdims=True) * (cut[-1] / k)
        extent = np.full(k, max(float(lux.area[mine].sum()) / k, 1e-3))
        _add_light(e, lux, functools.partial(_patches, lux, space, pick, strength, extent))
    return share, e


def _patches(
    lux: Luxels, space: Space, pick: np.ndarray, strength: np.ndarray, extent: np.ndarray, i: np.ndarray, rays: int
) -> np.ndarray:
    return radiosity.patch_light(
        space, subset(lux, i), lux.position[pick], lux.normal[pick], lux.thin[pick], strength, extent
    )


def bounce(lux: Luxels, space: Space, light: Radiosity, settings: Settings, tell: Callable[[float], None]) -> Radiosity:
    """All further bounces, by Jacobi rounds of gathering."""
    everywhere = subset(lux, np.arange(len(lux.position)))
    glow = np.where(lux.sampled[:, None], 0.0, lux.glow)
    first, total = 0, sum(settings.bounces)
    for samples in settings.bounces:
        tell(first / total)
        seen = _tamed(lux, lux.albedo * (light.soft + AMBIENT) + glow)
        e, bad, variance = radiosity.gather(space, everywhere, seen, samples, first)
        e = e if first else e + _endless(lux, e, bad < 0.5)
        light = replace(light, indirect=e, good=bad < 0.5, variance=variance)
        first += samples
    return light


def _tamed(lux: Luxels, seen: np.ndarray) -> np.ndarray:
    """Radiosity cut, room by room, where at most `SPARKS` of the room's light is lost by it: what is smaller
    than a hand beside a bulb would show as sparks on far walls, one ray in hundreds. What was cut is shared out
    over the room, or every bounce would lose it anew."""
    y = seen.mean(1)
    out = np.array(seen, np.float32)
    for unit in np.unique(lux.unit):
        mine = np.nonzero(lux.unit == unit)[0]
        order = mine[np.argsort(y[mine])]
        rising, above = y[order], np.cumsum(lux.area[order][::-1])[::-1]
        lost = np.cumsum((np.diff(rising, append=rising[-1]) * np.append(above[1:], 0.0))[::-1])[::-1]
        allowed = SPARKS * float((y[order] * lux.area[order]).sum())
        most = max(rising[min(np.searchsorted(-lost, -allowed), len(rising) - 1)], 1e-9)
        out[mine] *= np.minimum(1.0, most / np.maximum(y[mine], 1e-9))[:, None]
        before, after = ((a[mine] * lux.area[mine, None]).sum(0) for a in (seen, out))
        out[mine] *= before / np.maximum(after, 1e-12)
    return out


def _endless(lux: Luxels, once: np.ndarray, good: np.ndarray) -> np.ndarray:
    """First guess (n, 3) of all bounces after the first one `once`: each room as a sphere, e * rho / (1 - rho).

    Jacobi rounds from nothing would miss a fifth of a white room's light after four of them. The
    brightest luxels count at most three times the middle one: what lies between window and closed
    curtain does not light the room.
    """
    out = np.zeros_like(once)
    openings = 0.03  # share of a room's walls that lets light out
    for unit in np.unique(lux.unit):
        mine = np.nonzero((lux.unit == unit) & lux.shell & good)[0]
        if len(mine):
            weight = lux.area[mine, None] / lux.area[mine].sum()
            rho = (lux.albedo[mine] * weight).sum(0) * (1 - openings)
            arrived = np.minimum(once[mine], 3 * np.median(once[mine], axis=0))
            out[lux.unit == unit] = (arrived * weight).sum(0) * rho / (1 - rho)
    return out


def smooth(lux: Luxels, atlas: Atlas, light: Radiosity) -> Radiosity:
    """Noise taken out of all but the sun; luxels that are not good take their neighbours' light."""
    soft = ~lux.shell
    near = denoise.neighbours(lux.position, lux.normal, light.good, soft)
    on_page = (atlas, lux.texels, light.good, lux.shell)
    space = lambda e, n, like: denoise.smooth_space(e, lux.position, lux.normal, near, soft, passes=n, likeness=like)
    mend = lambda e: denoise.fill(e, lux.normal, near, soft, ~light.good) if soft.any() else e
    indirect = denoise.cap_sparks(mend(light.indirect), *on_page)
    indirect = space(denoise.smooth_pages(indirect, *on_page, variance=light.variance), 3, 0.9)
    direct = mend(light.direct)
    grain = denoise.spatial_variance(direct, atlas, lux.texels, lux.shell) * 0.8
    direct = denoise.smooth_pages(direct, *on_page, steps=(1, 2, 4, 8), likeness=(0.3, 0.2, 0.12, 0.1), variance=grain)
    direct = space(direct, 2, 0.6)
    patches = mend(light.patches)
    total = direct + indirect + patches
    if soft.any():
        indirect = indirect + denoise.lift_specks(total, near, soft) - total
    return replace(light, direct=direct, patches=patches, indirect=np.maximum(indirect, 0.0), good=light.good | soft)


def subset(lux: Luxels, i: np.ndarray) -> Points:
    """Some luxels on the device."""
    return points_of(lux.position[i], lux.normal[i], lux.face_normal[i], lux.thin[i])


def solve(
    house: House,
    atlas: Atlas,
    lux: Luxels,
    outdoors: Outdoors,
    lamps: Sequence[Lamp],
    settings: Settings,
    stage: Callable[[str, Callable[[], dict]], dict],
    tell: Callable[[str, float], None],
) -> Radiosity:
    """The light of a house.

    Args:
      stage: runs a named step that returns arrays, or gives back what it returned in an earlier, interrupted run.
    """
    portals = portals_of(house)
    space = radiosity.space_of(atlas, lux.texels, outdoors.picture)
    n = len(lux.position)
    zero = np.zeros((n, 3), np.float32)
    direct = stage(
        "direct",
        lambda: {
            "e": direct_light(lux, atlas, space, portals, lamps, settings, lambda x: tell("direct light", x)),
            "outer": outer_light(house, lux, atlas, space),
        },
    )
    sun = stage("sun", lambda: dict(zip(("share", "bounce"), sun_light(lux, space, portals, outdoors, settings))))
    light = Radiosity(direct["e"], sun["share"], sun["bounce"], zero, np.ones(n, bool), np.zeros(n, np.float32))

    def gathered() -> dict:
        done = bounce(lux, space, light, settings, lambda x: tell("bounces", x))
        return {"e": done.indirect, "good": done.good, "variance": done.variance}

    bounced = stage("bounces", gathered)
    light = replace(light, indirect=bounced["e"], good=bounced["good"], variance=bounced["variance"])
    tell("smoothing", 0.0)
    light = smooth(lux, atlas, light)
    return replace(light, indirect=light.indirect + direct["outer"])
