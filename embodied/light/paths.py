"""The path tracer that bakes are judged by: plain, unbiased but for its clamps, no radiosity involved.

Every vertex asks every light once and goes on in a random direction. Surfaces are diffuse, or
diffuse below one GGX lobe (Walter et al. 2007) with Schlick's Fresnel term.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from embodied.light import radiosity
from embodied.light.backend import mitsuba
from embodied.light.emitters import Lamp, Portal
from embodied.light.radiosity import Points, Space
from embodied.light.solve import AMBIENT, Luxels

DEEPEST = 9
"""Diffuse bounces followed; Russian roulette begins at the third."""


@dataclass(frozen=True, eq=False)
class Lights:
    """Everything that shines."""

    portals: tuple[Portal, ...]
    lamps: tuple[Lamp, ...]
    lamp_spaces: tuple[Space, ...]
    """What each lamp's rays may hit."""
    portal_scene: object | None
    towards_sun: np.ndarray
    sun: np.ndarray
    """(3,) e of the sun behind the glass."""


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Luxel properties on the device."""

    albedo: object
    glow: object
    normal: object


def surfaces_of(lux: Luxels) -> Surfaces:
    """Upload; glow that lamps account for is left out."""
    mi = mitsuba()
    flat = lambda a: mi.Float(np.ascontiguousarray(a, np.float32).ravel())  # noqa: E731
    return Surfaces(flat(lux.albedo), flat(np.where(lux.sampled[:, None], 0.0, lux.glow)), flat(lux.normal))


def lights_of(atlas, lux: Luxels, space: Space, portals: Sequence[Portal], lamps: Sequence[Lamp], outdoors) -> Lights:
    """Gather what shines."""
    own = tuple(
        radiosity.space_of(atlas, lux.texels, outdoors.picture, frozenset({atlas.owners.index(x.owner)}))
        if x.owner in atlas.owners else space for x in lamps
    )
    scene = radiosity.portal_scene(portals) if portals and outdoors.sun.any() else None
    return Lights(tuple(portals), tuple(lamps), own, scene, outdoors.sun_direction, outdoors.sun * radiosity.GLASS)


def direct(space: Space, lights: Lights, p: Points):
    """e (a Color3f) at points straight from all lights, one sample each."""
    mi = mitsuba()

    total = mi.Color3f(*(float(x) for x in AMBIENT))
    for portal in lights.portals:
        total = total + radiosity.sky_light(space, p, portal, 1)
    for lamp, own in zip(lights.lamps, lights.lamp_spaces):
        total = total + radiosity.lamp_light(own, p, lamp, 1)
    if lights.portal_scene is not None:
        share = radiosity.sun_share(space, p, lights.portal_scene, lights.towards_sun, 1)
        total = total + mi.Color3f(*(float(x) for x in lights.sun)) * share
    return total


def irradiance(space: Space, lights: Lights, surfaces: Surfaces, p: Points, *, rng: np.random.Generator, deepest: int = DEEPEST):
    """e (a Color3f) at points from all lights and any number of diffuse bounces, one path each."""
    mi = mitsuba()
    import drjit as dr

    total, throughput, alive = mi.Color3f(0.0), mi.Color3f(1.0), mi.Bool(True)
    for depth in range(deepest):
        p = _turned(p, rng)
        total = total + dr.select(alive, throughput * direct(space, lights, p), 0.0)
        u = rng.random((4, p.n), np.float32)
        side = dr.select(p.thin & (mi.Float(u[2]) < 0.5), -1.0, 1.0)
        out = p.face_normal * side
        d = mi.Frame3f(p.normal * side).to_world(mi.warp.square_to_cosine_hemisphere(mi.Point2f(mi.Float(u[0]), mi.Float(u[1]))))
        rise = dr.dot(d, out)
        d = dr.normalize(dr.select(rise < 0.01, d - out * (rise - 0.02), d))
        ray = mi.Ray3f(p.position + out * radiosity.LIFT, d)
        luxel, alive, q = hit_points(space, surfaces, ray, alive, p)
        throughput = throughput * dr.gather(mi.Color3f, surfaces.albedo, luxel, alive)
        total = total + dr.select(alive, throughput / dr.maximum(dr.gather(mi.Color3f, surfaces.albedo, luxel, alive), 1e-4)
                                  * dr.gather(mi.Color3f, surfaces.glow, luxel, alive), 0.0)
        if depth >= 2:
            keep = dr.clip(dr.max(throughput) * 1.5, 0.05, 0.95)
            alive &= mi.Float(u[3]) < keep
            throughput = throughput / keep
        dr.eval(total, throughput, alive, q.position, q.normal, q.face_normal, q.thin)
        p = q
    return total


def hit_points(space: Space, surfaces: Surfaces, ray, active, p: Points):
    """Where rays meet the house from the front: luxel, whether they do, and the points there."""
    mi = mitsuba()
    import drjit as dr

    h = space.scene.ray_intersect_preliminary(ray, False, active)
    luxel, hit, front, _ = radiosity.hit_luxel(space, ray, active)
    flat = dr.gather(mi.Vector3f, space.normal, h.prim_index, hit)
    side = dr.select(dr.dot(flat, ray.d) > 0, -1.0, 1.0)
    normal = dr.gather(mi.Vector3f, surfaces.normal, luxel, hit)
    normal = dr.normalize(dr.select(dr.dot(normal, flat) > 0.3, normal, flat))
    thin = dr.gather(mi.Bool, space.thin, h.prim_index, hit)
    q = Points(p.n, ray.o + ray.d * h.t, normal * side, flat * side, thin, p.turn0, p.turn1)
    return luxel, hit & front, q


def _turned(p: Points, rng: np.random.Generator) -> Points:
    mi = mitsuba()
    turn = rng.random((2, p.n), np.float32)
    return Points(p.n, p.position, p.normal, p.face_normal, p.thin, mi.Float(turn[0]), mi.Float(turn[1]))
