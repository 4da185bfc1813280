"""The path tracer that bakes are judged by: plain, unbiased but for its clamps, no radiosity involved.

Every vertex asks every light once and goes on in a random direction. Surfaces are diffuse, or
diffuse below one GGX lobe (Walter et al. 2007) with Schlick's Fresnel term.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from embodied.light.backend import (
    Array,
    Ray,
    RayScene,
    accumulate,
    array,
    booleans,
    dr,
    floats,
    mi,
    opaque_float,
    opaque_uint,
    unsigned,
    vector,
)
from embodied.light.tracing import radiosity
from embodied.light.tracing.emitters import Lamp, Portal
from embodied.light.tracing.luxels import AMBIENT, Luxels
from embodied.light.tracing.radiosity import Points, Space
from embodied.light.tracing.sky import Outdoors

MOST_BOUNCES = 14
"""Diffuse bounces followed; Russian roulette begins at the third."""
DENSE = 0.8
"""Share of the paths that must be alive for the ended ones to be carried along."""


@dataclass(frozen=True, eq=False)
class Lights:
    """Everything that shines, pooled so that every path picks its own light; k lights, device arrays."""

    count: int
    centre: Array
    """(k * 3) metres."""
    power: Array
    """(k,) rough brightness, for choosing."""
    corner: Array
    along: Array
    up: Array
    normal: Array
    """Flat (k * 3) arrays; zero for lamps."""
    strength: Array
    """(k,) area / pi of portals, glowing area / pi of lamps."""
    radiance: Array
    """(k * 3); zero for portals, which take it from the sky."""
    points: Array
    normals: Array
    """(k * POINTS * 3) of lamps."""
    weights: Array
    """(k * POINTS)."""
    bare: Array
    lamp: Array
    """(k,) bool: a bare bulb; any lamp."""
    scenes: tuple[RayScene, ...]
    """To ask for shadows: the house, and for each bare bulb's lamp the house without it."""
    scene_of_light: Array
    portal_scene: RayScene | None
    towards_sun: np.ndarray
    sun: np.ndarray
    """(3,) e of the sun behind the glass."""


POINTS = 256


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Luxel properties on the device."""

    albedo: Array
    glow: Array
    normal: Array


def surfaces_of(lux: Luxels) -> Surfaces:
    """Upload; glow that lamps account for is left out."""
    return Surfaces(floats(lux.albedo), floats(np.where(lux.sampled[:, None], 0.0, lux.glow)), floats(lux.normal))


def lights_of(
    scene: RayScene,
    without: Mapping[str, RayScene],
    portals: Sequence[Portal],
    lamps: Sequence[Lamp],
    outdoors: Outdoors,
) -> Lights:
    """Pool what shines.

    Args:
      without: the scene without all that belongs to an owner: a bare bulb's own lamp does not stand in its way.
    """
    k = len(portals) + len(lamps)
    zero = np.zeros(3)
    bare = [x.owner is not None for x in lamps]
    scenes = [scene, *(without.get(x.owner, scene) for x in lamps if x.owner is not None)]
    index = [0] * len(portals) + (np.cumsum(bare) * bare).tolist()
    sky = float(outdoors.picture.mean())
    centres = [p.corner + (p.along + p.up) / 2 for p in portals] + [x.points.mean(0) for x in lamps]
    power = [p.area * sky for p in portals]
    power += [float(x.radiance.mean()) * x.area * (4 if x.owner or not x.normals.any() else 1) for x in lamps]
    fill = lambda a: a[np.arange(POINTS) % len(a)]
    ways = radiosity.portal_scene(portals) if portals and outdoors.sun.any() else None
    none = [zero] * len(lamps)
    return Lights(
        k,
        floats(centres),
        floats(np.maximum(power, 1e-6)),
        floats([p.corner for p in portals] + none),
        floats([p.along for p in portals] + none),
        floats([p.up for p in portals] + none),
        floats([p.normal for p in portals] + none),
        floats([p.area * radiosity.GLAZING / np.pi for p in portals] + [x.area / np.pi for x in lamps]),
        floats([zero] * len(portals) + [x.radiance for x in lamps]),
        floats([np.zeros((POINTS, 3))] * len(portals) + [fill(x.points) for x in lamps]),
        floats([np.zeros((POINTS, 3))] * len(portals) + [fill(x.normals) for x in lamps]),
        floats([np.zeros(POINTS)] * len(portals) + [fill(x.weights) for x in lamps]),
        booleans([False] * len(portals) + [not x.normals.any() for x in lamps]),
        booleans([False] * len(portals) + [True] * len(lamps)),
        tuple(scenes),
        unsigned(index or [0]),
        ways,
        outdoors.sun_direction,
        outdoors.sun * radiosity.GLAZING,
    )


def direct(space: Space, lights: Lights, p: Points, *, rng: np.random.Generator, picks: int = 2) -> Array:
    """e (a Color3f) at points straight from the lights: the sun, and `picks` others, by power over distance squared."""
    total = mi.Color3f(*(float(x) for x in AMBIENT))
    for _ in range(picks if lights.count else 0):
        total = total + _one_light(space, lights, p, rng) / picks
    if lights.portal_scene is not None:
        share = radiosity.sun_share(space.scene, p, lights.portal_scene, lights.towards_sun, 1)
        total = total + mi.Color3f(*(opaque_float(x) for x in lights.sun)) * share
    return total


def _one_light(space: Space, lights: Lights, p: Points, rng: np.random.Generator) -> Array:
    u = rng.random((3, p.n), np.float32)
    count, zero = opaque_uint(lights.count), dr.zeros(mi.Float, p.n)

    def weight(i: Array) -> Array:
        far = dr.gather(mi.Point3f, lights.centre, i) - p.position
        return dr.gather(mi.Float, lights.power, i) / (dr.squared_norm(far) + 0.3)

    (whole,) = accumulate(lights.count, lambda i: (weight(i),), zero)
    target = floats(u[0]) * whole

    def until(i: Array, sum_: Array, pick: Array, chance: Array) -> tuple[Array, ...]:
        w = weight(i)
        here = (chance == 0) & ((target < sum_ + w) | (i + 1 == count))
        return i + 1, sum_ + w, dr.select(here, i, pick), dr.select(here, w / whole, chance)

    start = mi.UInt32(0), zero, dr.zeros(mi.UInt32, p.n), dr.zeros(mi.Float, p.n)
    _, _, pick, chance = dr.while_loop(start, lambda i, *_: i < count, until)
    dr.eval(pick, chance)
    a, b = floats(u[1]), floats(u[2])
    at = lambda t: dr.gather(mi.Vector3f, t, pick)
    lamp, bare = dr.gather(mi.Bool, lights.lamp, pick), dr.gather(mi.Bool, lights.bare, pick)
    spot = pick * POINTS + dr.minimum(mi.UInt32(a * POINTS), POINTS - 1)
    on_portal = at(lights.corner) + at(lights.along) * a + at(lights.up) * b
    q = dr.select(lamp, dr.gather(mi.Vector3f, lights.points, spot), on_portal)
    n = dr.select(lamp, dr.gather(mi.Vector3f, lights.normals, spot), at(lights.normal))
    d, far, cos, side, active = radiosity.towards(p, mi.Point3f(q))
    leaving = dr.select(bare, 1.0, -dr.dot(n, d))
    active &= leaving > 0
    reach = dr.select(bare, far - 0.06, far - 4 * radiosity.LIFT)
    ray = mi.Ray3f(p.position + p.face_normal * side * radiosity.LIFT, d, dr.maximum(reach, 1e-4), 0.0, [])
    active &= reach > 0
    which = dr.gather(mi.UInt32, lights.scene_of_light, pick)
    blocked = mi.Bool(False)
    for i, scene in enumerate(lights.scenes):
        blocked |= scene.ray_test(ray, active & (which == i))
    g = cos * leaving / dr.maximum(dr.square(far), dr.select(bare, 0.06, 1e-4))
    g = g * dr.gather(mi.Float, lights.strength, pick)
    g *= dr.select(lamp, dr.gather(mi.Float, lights.weights, spot), 1.0)
    light = dr.select(lamp, at(lights.radiance), mi.Vector3f(radiosity.env_lookup(space.env, d, active)))
    return mi.Color3f(dr.select(active & ~blocked, light * dr.minimum(g, dr.select(bare, 400.0, 4.0)) / chance, 0.0))


def irradiance(
    space: Space, lights: Lights, surfaces: Surfaces, p: Points, *, rng: np.random.Generator, active: Array = True
) -> Array:
    """e (a Color3f) at points, 0 where not `active`, from all lights and any number of diffuse bounces: a path each."""
    sums = np.zeros((p.n, 3), np.float32)
    of = np.flatnonzero(np.broadcast_to(np.asarray(active), p.n))  # the point that each path began at
    p = radiosity.only(p, of)
    total, throughput, alive = mi.Color3f(0.0), mi.Color3f(1.0), mi.Bool(True)
    for depth in range(MOST_BOUNCES if len(of) else 0):
        turn = rng.random((2, p.n), np.float32)
        p = replace(p, turn0=floats(turn[0]), turn1=floats(turn[1]))
        total = total + dr.select(alive, throughput * direct(space, lights, p, rng=rng), 0.0)
        u = rng.random((4, p.n), np.float32)
        side = dr.select(p.thin & (floats(u[2]) < 0.5), -1.0, 1.0)
        ray = radiosity.cosine_ray(p, side, mi.Point2f(floats(u[0]), floats(u[1])))
        luxel, alive, q = hit_points(space, surfaces, ray, alive, p)
        albedo, glow = (dr.gather(mi.Color3f, a, luxel, alive) for a in (surfaces.albedo, surfaces.glow))
        throughput = throughput * albedo
        total = total + dr.select(alive, throughput / dr.maximum(albedo, 1e-4) * glow, 0.0)
        if depth >= 2:
            keep = dr.clip(dr.max(throughput) * 1.5, 0.05, 0.95)
            alive &= floats(u[3]) < keep
            throughput = throughput / keep
        dr.eval(total, throughput, alive, q.position, q.normal, q.face_normal, q.thin)
        living = np.flatnonzero(np.asarray(alive))
        if len(living) == 0:
            break
        if len(living) > DENSE * len(of):
            p = q
            continue
        sums[of] += array(total)
        of, p = of[living], radiosity.only(q, living)
        throughput = dr.gather(type(throughput), throughput, unsigned(living))
        total, alive = mi.Color3f(0.0), mi.Bool(True)
    if len(of):
        sums[of] += array(total)
    return mi.Color3f(vector(sums))


def hit_points(space: Space, surfaces: Surfaces, ray: Ray, active: Array, p: Points) -> tuple[Array, Array, Points]:
    """Hits of rays on the house from the front: luxel, whether they do, and the points there."""
    h = space.scene.ray_intersect_preliminary(ray, False, active)
    luxel, hit, front, _ = radiosity.hit_luxel(space, ray, active, h)
    flat = dr.gather(mi.Vector3f, space.normal, h.prim_index, hit)
    side = dr.select(dr.dot(flat, ray.d) > 0, -1.0, 1.0)
    normal = dr.gather(mi.Vector3f, surfaces.normal, luxel, hit)
    normal = dr.normalize(dr.select(dr.dot(normal, flat) > 0.3, normal, flat))
    thin = dr.gather(mi.Bool, space.thin, h.prim_index, hit)
    q = Points(p.n, ray.o + ray.d * h.t, normal * side, flat * side, thin, p.turn0, p.turn1)
    return luxel, hit & front, q
