"""Light at probes, from a house whose luxels are lit."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import numpy as np
import shapely

from embodied.geometry import r2
from embodied.house.house import House
from embodied.light.backend import LightingCache, RayScene, floats, get_or_compute, mi, vector
from embodied.light.baking.compose import LightSolution
from embodied.light.baking.solve import BakeInput, clamp_fireflies, leaving, sunlit
from embodied.light.probes import ORDERS, Probes
from embodied.light.settings import LightSettings
from embodied.light.tracing import air, radiosity
from embodied.light.tracing.emitters import portals_of
from embodied.light.tracing.luxels import AMBIENT
from embodied.light.tracing.radiosity import Points

SPACING, MARGIN = 0.5, 0.1
"""Metres between probes, about, and from walls, floor and ceiling to the first of them."""
COVERED = 0.25
"""Share of rays that meet back faces, or things at once, beyond which a probe is inside something."""
PROBE_RAYS, PROBE_TRIAL_RAYS = 128, 4
"""From a probe to each light, and those that tell whether any probe of its room is reached."""
AROUND_RAYS = 1024
"""From a probe in all directions, for light that bounces."""


def probes_of(s: LightSolution, settings: LightSettings, memory: LightingCache | None = None) -> Probes:
    """Probes of a lit house.

    Args:
      memory: keeps what does not depend on sky and lamps.
    """
    inputs = BakeInput(s.house, s.atlas, s.lux, s.space, s.outdoors, s.lamps, settings, None, s.without)
    own: LightingCache | None = None if memory is None else get_or_compute(memory, "probes", dict)
    probes = get_or_compute(own, "grids", lambda: seeing(grids(s.house), s.space.scene))
    asked = np.flatnonzero(probes.valid)
    places = get_or_compute(own, "places", lambda: places_of(probes.position[asked]))
    met = get_or_compute(own, "met", lambda: air.meet_around(s.space, places, AROUND_RAYS))
    light = air.bounced_at(met, places, floats(clamp_fireflies(s.lux, leaving(s.lux, s.light.soft))))
    light[:, 0] += np.sqrt(4 * np.pi) * AMBIENT
    rooms = probes.room[asked]

    def shone(source: Callable[[Points, int], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Probes of the rooms that a source reaches, and its light there."""
        reached = np.flatnonzero(np.isin(rooms, rooms[source(places, PROBE_TRIAL_RAYS)[:, 0].any(1)]))
        return reached, source(radiosity.only(places, reached), PROBE_RAYS) if len(reached) else np.zeros((0, 9, 3))

    for portal in portals_of(s.house):
        reached, arriving = shone(functools.partial(air.sky_at, s.space, portal))
        light[reached] += arriving
    for lamp in s.lamps:
        scene = s.without.get(lamp.owner or "", s.space.scene)
        lit = functools.partial(shone, functools.partial(air.lamp_at, scene, lamp))
        reached, arriving = get_or_compute(own, ("lamp", lamp.id), lit)
        light[reached] += arriving * lamp.radiance.astype(np.float32)
    for patches in sunlit(inputs, s.light.sun, settings.patches):
        light += air.patches_at(s.space.scene, patches, places)
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
