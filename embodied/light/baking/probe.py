"""Light in the middle of a room, for things that move: an ambient cube (McTaggart, Half-Life 2, 2004)."""

from __future__ import annotations

import numpy as np
import shapely

from embodied.house.house import Room
from embodied.light.backend import array, floats
from embodied.light.baking.compose import Solved
from embodied.light.pages.tone import develop
from embodied.light.tracing import radiosity
from embodied.light.tracing.emitters import portals_of
from embodied.light.tracing.luxels import AMBIENT

AXES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
"""Sides of the cube in order."""


def ambient_cubes(solved: Solved, *, rays: int = 256) -> np.ndarray:
    """(rooms, 6, 3) float32 sRGB in [0, 1]: what white paper looks like that faces +x, -x, +y, -y, +z, -z at 1.1 m
    height.

    Seen from 13 spots around the room's middle, so that one table beside it does not decide.
    """
    house, lux, light, space = solved.house, solved.lux, solved.light, solved.space
    ring = [(0.0, 0.0)] + [(r * np.cos(a), r * np.sin(a)) for r in (0.25, 0.5) for a in np.arange(6) * np.pi / 3]
    spots = np.array([[*(_middle(r) + o), house.storey_of(r).elevation + 1.1] for r in house.rooms for o in ring])
    position, normal = np.repeat(spots, 6, axis=0), np.tile(AXES, (len(spots), 1))
    points = radiosity.points_of(position, normal, normal, np.zeros(len(position), bool))
    table = floats(lux.albedo * (light.soft + AMBIENT) + lux.glow)
    e = radiosity.gather(radiosity.meet(space, points, rays), table)[0] / rays + AMBIENT
    for portal in portals_of(house):
        e = e + array(radiosity.sky_light(space, points, portal, 16))
    e = np.median(e.reshape(len(house.rooms), len(ring), 6, 3), axis=1)
    gain = solved.exposure.at(spots[:: len(ring)])
    return develop(0.8 * e, gain[:, None]).astype(np.float32)


def _middle(room: Room) -> np.ndarray:
    return np.array(shapely.Polygon(room.polygon).representative_point().coords[0])
