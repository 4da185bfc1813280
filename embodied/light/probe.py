"""Light in the middle of a room, for things that move: an ambient cube (McTaggart, Half-Life 2, 2004)."""

from __future__ import annotations

import numpy as np
import shapely

from embodied.house.house import Room
from embodied.light import radiosity
from embodied.light.backend import array
from embodied.light.emitters import portals_of
from embodied.light.solve import AMBIENT
from embodied.light.tone import develop

AXES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
"""Sides of the cube in order."""


def ambient_cube(solved, space: radiosity.Space, room: Room, *, rays: int = 256) -> np.ndarray:
    """(6, 3) float32 sRGB in [0, 1]: what white paper looks like that faces +x, -x, +y, -y, +z, -z at 1.1 m height.

    Seen from 13 spots around the room's middle, so that one table beside it does not decide.
    """
    house, lux, light = solved.house, solved.lux, solved.light
    middle = np.array(shapely.Polygon(room.polygon).representative_point().coords[0])
    floor = house.storey_of(room).elevation
    ring = [(0.0, 0.0)] + [(r * np.cos(a), r * np.sin(a)) for r in (0.25, 0.5) for a in np.arange(6) * np.pi / 3]
    spots = np.array([[*(middle + o), floor + 1.1] for o in ring])
    position, normal = np.repeat(spots, 6, axis=0), np.tile(AXES, (len(spots), 1))
    points = radiosity.points_of(position, normal, normal, np.zeros(len(position), bool))
    seen = lux.albedo * (light.soft + AMBIENT) + lux.glow
    e, _, _ = radiosity.gather(space, points, seen, rays)
    e = e + AMBIENT
    for portal in portals_of(house):
        e = e + array(radiosity.sky_light(space, points, portal, 16))
    e = np.median(e.reshape(len(spots), 6, 3), axis=0)
    return develop(0.8 * e, solved.exposure.at(spots[:1])).astype(np.float32)
