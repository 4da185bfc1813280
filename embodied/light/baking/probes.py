"""Light at probes, from a house whose luxels are lit, as spherical harmonics of e.

The same lights as in `radiosity`, but one ray serves all normals that a place's light is asked for.
"""

import dataclasses
import functools
from collections.abc import Callable

import numpy as np
import shapely

from embodied.geometry import r2
from embodied.house.house import House
from embodied.light.backend import (
    Array,
    LightingCache,
    RayScene,
    accumulate,
    array,
    booleans,
    dr,
    floats,
    get_or_compute,
    mi,
    opaque_float,
    opaque_uint,
    vector,
)
from embodied.light.baking.compose import LightSolution
from embodied.light.baking.solve import BakeInput, clamp_fireflies, leaving, sunlit
from embodied.light.probes import ORDERS, Probes, lobed, terms
from embodied.light.settings import LightSettings
from embodied.light.tracing import radiosity
from embodied.light.tracing.emitters import GLAZING, Lamp, Portal, portals_of
from embodied.light.tracing.luxels import AMBIENT
from embodied.light.tracing.radiosity import LIFT, NOTHING, Met, Patches, Points, Space, env_lookup

SPACING, MARGIN = 0.5, 0.1
"""Metres between probes, about, and from walls, floor and ceiling to the first of them."""
COVERED = 0.25
"""Share of rays that meet back faces, or things at once, beyond which a probe is inside something."""
PROBE_RAYS, PROBE_TRIAL_RAYS = 128, 4
"""From a probe to each light, and those that tell whether any probe of its room is reached."""
AROUND_RAYS = 1024
"""From a probe in all directions, for light that bounces."""


def probes_of(s: LightSolution, settings: LightSettings, memory: LightingCache | None = None) -> Probes:
    """Probes of a lit house. `memory`: keeps what does not depend on sky and lamps."""
    inputs = BakeInput(s.house, s.atlas, s.lux, s.space, s.outdoors, s.lamps, settings, None, s.without)
    own: LightingCache | None = None if memory is None else get_or_compute(memory, "probes", dict)
    probes = get_or_compute(own, "grids", lambda: seeing(grids(s.house), s.space.scene))
    asked = np.flatnonzero(probes.valid)
    places = get_or_compute(own, "places", lambda: places_of(probes.position[asked]))
    met = get_or_compute(own, "met", lambda: meet_around(s.space, places, AROUND_RAYS))
    light = bounced_at(met, places, floats(clamp_fireflies(s.lux, leaving(s.lux, s.light.soft))))
    light[:, 0] += np.sqrt(4 * np.pi) * AMBIENT
    rooms = probes.room[asked]

    def shone(source: Callable[[Points, int], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Probes of the rooms that a source reaches, and its light there."""
        reached = np.flatnonzero(np.isin(rooms, rooms[source(places, PROBE_TRIAL_RAYS)[:, 0].any(1)]))
        return reached, source(radiosity.only(places, reached), PROBE_RAYS) if len(reached) else np.zeros((0, 9, 3))

    for portal in portals_of(s.house):
        reached, arriving = shone(functools.partial(sky_at, s.space, portal))
        light[reached] += arriving
    for lamp in s.lamps:
        scene = s.without.get(lamp.owner or "", s.space.scene)
        lit = functools.partial(shone, functools.partial(lamp_at, scene, lamp))
        reached, arriving = get_or_compute(own, ("lamp", lamp.id), lit)
        light[reached] += arriving * lamp.radiance.astype(np.float32)
    for patches in sunlit(inputs, s.light.sun, settings.patches):
        light += patches_at(s.space.scene, patches, places)
    coefficients, valid = probes.coefficients.copy(), probes.valid.copy()
    valid[asked] = open_air(met.bad / met.rays, rooms)
    coefficients[asked] = np.clip(light, -6e4, 6e4)
    coefficients[~valid] = 0.0
    return dataclasses.replace(probes, coefficients=coefficients, valid=valid)


def open_air(covered: np.ndarray, rooms: np.ndarray) -> np.ndarray:
    """(k,) bool of probes inside nothing; a room in which there is none has the best of them.

    Args:
      covered: (k,) share of rays that meet back faces, or things at once; and (k,) the probes' rooms.
    """
    least = np.full(int(rooms.max(initial=0)) + 1, np.inf)
    np.minimum.at(least, rooms, covered)
    return covered <= np.maximum(COVERED, least[rooms])


def grids(house: House) -> Probes:
    """Grids of all rooms, dark; valid between the walls."""
    placed = []
    for room in house.rooms:
        storey, floor = house.storey_of(room), house.floor(room).buffer(-MARGIN, join_style="mitre")
        heights = storey.elevation + MARGIN, storey.elevation + storey.height - MARGIN
        grid = _grid(floor, heights) if not floor.is_empty else None
        if grid is None or not grid[-1].any():
            grid = _grid(shapely.Polygon(room.polygon).representative_point(), heights)
        placed.append(grid)
    origin, step, counts, inside = zip(*placed)
    valid = np.concatenate(inside)
    dark, far = np.zeros((len(valid), len(ORDERS), 3), np.float16), np.full((len(valid), 2, 3), 255, np.uint8)
    rooms = np.array([r.id for r in house.rooms])
    return Probes(rooms, np.array(origin), np.array(step), np.array(counts), dark, valid, far)


def _grid(floor: shapely.Geometry, heights: tuple[float, float]) -> tuple[np.ndarray, ...]:
    """Lowest corner, steps and counts of a grid over a floor, and which of its points, flat, lie above it."""
    x0, y0, x1, y1 = floor.bounds
    low, high = np.array([x0, y0, heights[0]]), np.array([x1, y1, heights[1]])
    steps = np.maximum(np.rint((high - low) / SPACING), high - low > 1e-3).astype(int)
    step = np.where(steps > 0, (high - low) / np.maximum(steps, 1), SPACING)
    x, y = (low[k] + np.arange(steps[k] + 1) * step[k] for k in range(2))
    inside = shapely.intersects_xy(floor.buffer(1e-3), *np.meshgrid(x, y, indexing="ij"))
    return low, step, steps + 1, np.repeat(inside.ravel(), steps[2] + 1)


def seeing(probes: Probes, scene: RayScene) -> Probes:
    """The same probes with how far those between the walls see along the axes."""
    asked, sight = np.flatnonzero(probes.valid), probes.sight.copy()
    ways = np.concatenate([np.eye(3), -np.eye(3)])
    at, ways = np.repeat(probes.position[asked], len(ways), axis=0), np.tile(ways, (len(asked), 1))
    hit = scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(vector(at)), vector(ways)), False, True)
    far = np.where(np.array(hit.is_valid()), np.array(hit.t), np.inf)
    sight[asked] = np.minimum(100 * far, 255).reshape(-1, 2, 3)
    return dataclasses.replace(probes, sight=sight)


def places_of(positions: np.ndarray) -> Points:
    """Places (k, 3) in the air on the device; one R2 sequence runs through them all."""
    up = np.tile(np.array([0, 0, 1], np.float32), (len(positions), 1))
    turn = np.stack([x % 1.0 for x in r2(np.arange(len(positions), dtype=float) * AROUND_RAYS)]).astype(np.float32)
    return radiosity.points_of(positions, up, up, np.zeros(len(positions), bool), turn)


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
    return radiosity.met_by(space, p.n, rays, lambda k: mi.Ray3f(p.position, _everywhere(p, k)))


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
