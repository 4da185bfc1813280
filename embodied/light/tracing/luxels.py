"""Luxels: the surface under every texel of light of a house."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from embodied.house.house import House
from embodied.light.backend import mi, scene_of, vector
from embodied.light.pages.atlas import SHELL, Atlas, Page
from embodied.light.pages.colours import ColourMaps, albedo
from embodied.light.pages.cover import Sheet, Texels, rasterise, sheets_of
from embodied.light.pages.unwrap import areas_of, face_normals
from embodied.light.tracing.emitters import Lamp
from embodied.light.tracing.radiosity import LIFT, Points, points_of, woven

AMBIENT = np.array([4.5e-4, 5e-4, 6e-4])
"""e that every surface receives besides: starlight and the lamps of the street; no room is ever black."""
WAYS_AROUND = np.array([np.roll([0.0, a, b * 1.618], k) / 1.902 for k in range(3) for a in (-1, 1) for b in (-1, 1)])
"""(12, 3) unit: the corners of an icosahedron."""


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


def luxels_of(atlas: Atlas, maps: ColourMaps) -> Luxels:
    """Surfaces under every luxel; nothing glows yet (`with_glow`)."""
    sheets = sheets_of(atlas.pages)
    texels = _in_the_open(atlas, tuple(rasterise(p, 1, s) for p, s in zip(atlas.pages, sheets)))
    pairs = list(zip(atlas.pages, texels))
    owner = np.concatenate([p.owner[t.face] for p, t in pairs])
    ends = np.cumsum([len(t.index) for t in texels])
    places = {k: np.concatenate([getattr(t, k) for t in texels]) for k in ("position", "normal", "face_normal")}
    of_page = lambda i: {k: a[ends[i] - len(texels[i].index) : ends[i]] for k, a in places.items()}
    texels = tuple(replace(t, **of_page(i)) for i, t in enumerate(texels))  # type: ignore[arg-type]  # views: once in memory, not twice
    names = [o.split("/")[0] if k == "opening" else r for o, r, k in zip(atlas.owners, atlas.rooms, atlas.kinds)]
    unit = {name: i for i, name in enumerate(dict.fromkeys(names))}
    return Luxels(
        texels,
        places["position"],
        places["normal"],
        places["face_normal"],
        np.concatenate([p.thin[t.face] for p, t in pairs]),
        np.concatenate([albedo(p, t, maps) for p, t in pairs]),
        np.zeros((len(owner), 3), np.float32),
        np.zeros(len(owner), bool),
        np.concatenate([_share_of_area(p, t) for p, t in pairs]),
        owner,
        np.array([unit[name] for name in names], np.int32)[owner],
        np.array([k in SHELL for k in atlas.kinds])[owner],
        sheets,
    )


def _in_the_open(atlas: Atlas, texels: tuple[Texels, ...]) -> tuple[Texels, ...]:
    """Without those in the folds of a person, from which more than a third of the rays meet back faces. What is seen
    of such a fold takes the light of the luxels around."""
    people = [np.array(atlas.people)[p.owner] for p in atlas.pages]
    corners = np.concatenate([p.corners[whose] for p, whose in zip(atlas.pages, people)])
    if not len(corners):
        return texels
    scene, normals, open_ = scene_of(corners), face_normals(corners), []
    for t, whose in zip(texels, people):
        of_people = np.flatnonzero(whose[t.face])
        if not len(of_people):
            open_.append(t)
            continue
        ways = (t.face_normal[of_people, None] + 0.99 * WAYS_AROUND).reshape(-1, 3)
        start = np.repeat(t.position[of_people] + t.face_normal[of_people] * LIFT, len(WAYS_AROUND), axis=0)
        hit = scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(vector(start)), vector(ways)), False, True)
        met, face = np.array(hit.is_valid()), np.array(hit.prim_index)
        behind = met & ((normals[np.where(met, face, 0)] * ways).sum(1) > 0)
        keep = np.ones(len(t.index), bool)
        keep[of_people] = behind.reshape(-1, len(WAYS_AROUND)).mean(1) <= 0.35
        open_.append(replace(t, **{f.name: getattr(t, f.name)[keep] for f in fields(t) if f.name != "shape"}))
    return tuple(open_)


def with_glow(lux: Luxels, house: House, atlas: Atlas, lamps: Sequence[Lamp]) -> Luxels:
    """The same luxels with what shines itself: the lamps that are on, screens."""
    glows = [glow_of(house, atlas, p, t.face, lamps) for p, t in zip(atlas.pages, lux.texels)]
    glow = np.concatenate(
        [np.zeros((len(t.face), 3), np.float32) if g is None else g for g, t in zip(glows, lux.texels)]
    )
    lit = {x.id for x in lamps}
    sampled = np.array([any(x.placement == o and x.id in lit for x in house.lights) for o in atlas.owners])
    return replace(lux, glow=glow, sampled=sampled[lux.owner] & (glow.sum(1) > 0))


def _share_of_area(page: Page, t: Texels) -> np.ndarray:
    """(n,) square metres each luxel stands for: what it covers of its face, every owner's sum kept exact."""
    faces, (u, v) = areas_of(page.corners), np.moveaxis(page.luxels[:, 1:] - page.luxels[:, :1], 1, 0)
    each = faces / np.maximum(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2, 1e-3)
    size = int(page.owner.max()) + 1 if len(page.owner) else 0
    whole, got = np.bincount(page.owner, faces, size), np.bincount(page.owner[t.face], each[t.face], size)
    return (each * (whole / np.maximum(got, 1e-12))[page.owner]).astype(np.float32)[t.face]


def glow_of(house: House, atlas: Atlas, page: Page, face: np.ndarray, lamps: Sequence[Lamp]) -> np.ndarray | None:
    """(n, 3) radiance that texels on faces (n,) of `page` give off themselves; None where nothing does."""
    emission = np.array([f.emission or (0.0, 0.0, 0.0) for f in page.finishes], np.float32)[page.finish]
    if not emission.any():
        return None
    out = np.zeros_like(emission)
    by_light = {x.id: x for x in lamps}
    for o in np.unique(page.owner[emission.any(1)]):
        name = atlas.owners[o]
        emitting = (page.owner == o) & (emission.sum(1) > 0)
        lights = [x for x in house.lights if x.placement == name]
        if not lights:  # screens, stars on a nursery ceiling: they glow by themselves
            out[emitting] = emission[emitting]
        for x in lights:
            if x.id in by_light:
                out[emitting] = by_light[x.id].radiance
    return out[face]


def subset(lux: Luxels, i: np.ndarray) -> Points:
    """Some luxels on the device."""
    return points_of(lux.position[i], lux.normal[i], lux.face_normal[i], lux.thin[i])


def points(lux: Luxels, rays: int) -> Points:
    """All luxels on the device, their samples `woven` for so many rays each."""
    turn = [woven(t.index, t.shape[1], rays) for t in lux.texels]
    return points_of(lux.position, lux.normal, lux.face_normal, lux.thin, np.concatenate(turn, axis=1))
