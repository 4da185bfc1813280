"""Light that arrives at places in the air, as spherical harmonics of e.

The same lights as in `radiosity`, but one ray serves all normals that a place's light is asked for.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from embodied.light.backend import (
    Array,
    RayScene,
    accumulate,
    array,
    booleans,
    dr,
    floats,
    mi,
    opaque_float,
    opaque_uint,
)
from embodied.light.probes import lobed, terms
from embodied.light.tracing.emitters import GLAZING, Lamp, Portal
from embodied.light.tracing.radiosity import LIFT, NOTHING, Met, Patches, Points, Space, env_lookup, hit_luxel

BARE = 0.06
"""Metres around a bare bulb, and square metres of the least squared distance from it, that are no nearer to it."""


def sky_at(space: Space, portal: Portal, p: Points, samples: int) -> np.ndarray:
    """(n, 9, 3) coefficients of e from the outdoors through one portal, by area sampling."""
    sides = portal.corner, portal.along, portal.up, portal.normal
    corner, along, up, n = (mi.Vector3f(*(opaque_float(x) for x in a)) for a in sides)
    area = opaque_float(portal.area * GLAZING)

    def place(k: Array) -> tuple[Array, Callable]:
        u = p.sample(k)
        extent = lambda d, far: area * dr.maximum(-dr.dot(n, d), 0.0) / dr.maximum(dr.square(far), 1e-4)
        return mi.Point3f(corner + along * u.x + up * u.y), lambda d, far: env_lookup(space.env, d) * extent(d, far)

    return _arriving(space.scene, p, samples, place, 4 * LIFT) / samples


def lamp_at(scene: RayScene, lamp: Lamp, p: Points, samples: int) -> np.ndarray:
    """(n, 9, 1) coefficients of e from one lamp of radiance 1."""
    bare, count = not lamp.normals.any(), opaque_uint(len(lamp.points))
    at, out, weights, area = floats(lamp.points), floats(lamp.normals), floats(lamp.weights), opaque_float(lamp.area)

    def place(k: Array) -> tuple[Array, Callable]:
        i = dr.minimum(mi.UInt32(p.sample(k).x * mi.Float(count)), count - 1)
        strength = dr.gather(mi.Float, weights, i) * area
        leaving = lambda d: 1.0 if bare else dr.maximum(-dr.dot(dr.gather(mi.Vector3f, out, i), d), 0.0)
        extent = lambda d, far: strength * leaving(d) / dr.maximum(dr.square(far), BARE if bare else 1e-4)
        return dr.gather(mi.Point3f, at, i), lambda d, far: mi.Color3f(dr.minimum(extent(d, far), 4 * dr.pi))

    return _arriving(scene, p, samples, place, BARE if bare else 4 * LIFT)[..., :1] / samples


def patches_at(scene: RayScene, patches: Patches, p: Points) -> np.ndarray:
    """(n, 9, 3) coefficients of e from sunlit patches."""
    lift = np.where(patches.thin[:, None], 0.0, LIFT)
    places, normals = floats(patches.position + patches.normal * lift), floats(patches.normal)
    both, flux, extent = booleans(patches.thin), floats(patches.flux), floats(patches.extent / np.pi)

    def place(k: Array) -> tuple[Array, Callable]:
        def light(d: Array, far: Array) -> Array:
            leaving = -dr.dot(dr.gather(mi.Vector3f, normals, k), d)
            leaving = dr.select(dr.gather(mi.Bool, both, k), dr.abs(leaving), dr.maximum(leaving, 0.0))
            return dr.gather(mi.Color3f, flux, k) * (leaving / (dr.square(far) + dr.gather(mi.Float, extent, k)))

        return dr.gather(mi.Point3f, places, k), light

    return _arriving(scene, p, len(patches.flux), place, 3 * LIFT)


def meet_around(space: Space, p: Points, rays: int) -> Met:
    """Send rays from places, evenly in all directions."""
    luxels, lane, count = dr.zeros(mi.UInt32, rays * p.n), dr.arange(mi.UInt32, p.n), opaque_uint(p.n)

    def one(k: Array) -> tuple[Array, ...]:
        luxel, hit, front, near = hit_luxel(space, mi.Ray3f(p.position, _everywhere(p, k)))
        dr.scatter(luxels, dr.select(hit & front, luxel, NOTHING), k * count + lane)
        return (dr.select(hit & (~front | near), 1.0, 0.0),)

    (bad,) = accumulate(rays, one, dr.zeros(mi.Float, p.n))
    dr.eval(luxels)
    return Met(rays, luxels, np.array(bad))


def bounced_at(met: Met, p: Points, table: Array) -> np.ndarray:
    """(n, 9, 3) coefficients of e from what rays of places met.

    Args:
      table: flat (n luxels * 3), radiosity of the whole house on the device.
    """
    lane, count = dr.arange(mi.UInt32, p.n), opaque_uint(p.n)

    def one(k: Array) -> tuple[Array, ...]:
        luxel = dr.gather(mi.UInt32, met.luxels, k * count + lane)
        colour, d = dr.gather(mi.Color3f, table, luxel, luxel != NOTHING), _everywhere(p, k)
        return tuple(colour * y for y in terms(d.x, d.y, d.z))

    return _summed(met.rays, one, p.n) * (4 * np.pi / met.rays)


def _everywhere(p: Points, k: Array) -> Array:
    """The k-th direction of every place, even over the sphere."""
    return mi.warp.square_to_uniform_sphere(p.sample(k))


def _arriving(scene: RayScene, p: Points, samples: int, place: Callable, gap: float) -> np.ndarray:
    """(n, 9, 3) sums of e over places that shine.

    Args:
      place: from a number to a place and, of direction and distance, its radiance times its solid angle.
      gap: metres before the place where a shadow ray ends.
    """

    def one(k: Array) -> tuple[Array, ...]:
        q, light = place(k)
        d = q - p.position
        far = dr.norm(d)
        d /= dr.maximum(far, 1e-6)
        colour = light(d, far)
        active = (far > gap) & (dr.max(colour) > 0)
        free = active & ~scene.ray_test(mi.Ray3f(p.position, d, far - gap, 0.0, []), active)
        colour = dr.select(free, colour, 0.0)
        return tuple(colour * y for y in terms(d.x, d.y, d.z))

    return _summed(samples, one, p.n)


def _summed(samples: int, one: Callable[[Array], tuple[Array, ...]], n: int) -> np.ndarray:
    """(n, 9, 3) coefficients of e from sums of what `one` returns: nine of radiance."""
    totals = accumulate(samples, one, *(dr.zeros(mi.Color3f, n) for _ in range(9)))
    return lobed(np.stack([array(total) for total in totals], axis=1))
