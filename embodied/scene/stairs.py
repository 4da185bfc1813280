"""Stairs: treads and risers of a flight, and the well it needs in ceiling and floor."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import shapely

from embodied.assets.built.primitives import bar, box, part, quads
from embodied.assets.records import Finish
from embodied.house.house import House, Stair
from embodied.scene.part import Part

TREAD = 0.035
"""Thickness of a tread, metres."""


def well(stair: Stair) -> shapely.Polygon:
    """The hole that the flight needs in the ceiling it passes and the floor it reaches."""
    line = shapely.LineString([p[:2] for p in stair.path])
    return line.buffer(stair.width / 2 + 0.02, cap_style="flat", join_style="mitre")


def steps(stair: Stair) -> np.ndarray:
    """(risers, 4): x, y, z of each tread's front edge middle, and the yaw one walks there.

    The rise is shared evenly; along the path, height runs as the path's z does, so a level
    stretch of the path is a landing.
    """
    p = np.asarray(stair.path, float)
    rise = (p[-1, 2] - p[0, 2]) / stair.risers
    heights = p[0, 2] + rise * (np.arange(stair.risers) + 1)
    rows = []
    for z in heights:
        i = int(np.clip(np.searchsorted(p[:, 2], z - rise, side="right") - 1, 0, len(p) - 2))
        span = p[i + 1, 2] - p[i, 2]
        t = (z - rise - p[i, 2]) / span if span > 1e-9 else 0.0
        at = p[i] + t * (p[i + 1] - p[i])
        d = p[i + 1] - p[i]
        rows.append((at[0], at[1], z, np.arctan2(d[1], d[0])))
    return np.asarray(rows)


def stair_parts(house: House, stair: Stair, finish: Callable[[str], Finish]) -> list[Part]:
    """Closed treads and risers with strings beside them, landings, and the edges of the well."""
    room = house.room_by_id[stair.rooms[0]]
    upper = house.room_by_id[stair.rooms[1]]
    wood, paint = finish("oak/0"), finish("paint_white/0")
    rows = steps(stair)
    p = np.asarray(stair.path, float)
    rise = (p[-1, 2] - p[0, 2]) / stair.risers
    length = float(np.linalg.norm(np.diff(p[:, :2], axis=0), axis=1).sum())
    going = length / stair.risers
    half = stair.width / 2
    treads, risers = [], []
    for k, (x, y, z, yaw) in enumerate(rows):
        if k < len(rows) - 1:
            nx, ny = rows[k + 1, :2]
            deep = max(going, float(np.hypot(nx - x, ny - y)))
            treads.append(box([-0.025, -half, z - TREAD], [deep + 0.002, half, z], 0.006).turned(yaw).moved(x, y))
        risers.append(box([0, -half, z - rise], [0.018, half, z - TREAD]).turned(yaw).moved(x, y))
    for a, b in itertools.pairwise(p):
        d = (b - a) / max(np.linalg.norm((b - a)[:2]), 1e-9)
        side = np.array([-d[1], d[0], 0.0])
        for s in (1, -1):
            off = side * s * (half + 0.012) + [0, 0, 0.02]
            risers.append(bar(a + off, b + off, 0.024, 0.30, 0.003))
    owner = f"{stair.id}/stairs"
    parts = [
        Part(owner, "opening", room.id, part(wood, *treads), owner),
        Part(owner, "opening", room.id, part(paint, *risers), owner + "#risers"),
    ]
    low = house.storey_of(room).elevation + house.storey_of(room).height
    high = house.storey_of(upper).elevation
    ring = np.asarray(shapely.geometry.polygon.orient(well(stair)).exterior.coords)[:-1]
    edge = [[(*b, low), (*a, low), (*a, high), (*b, high)] for a, b in zip(ring, np.roll(ring, -1, axis=0))]
    parts.append(Part(owner, "opening", room.id, part(paint, quads(np.asarray(edge))), owner + "#well"))
    return parts
