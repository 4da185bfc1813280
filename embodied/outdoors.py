"""What is seen through the windows: the house's own facade and roof, the ground, balconies, far things."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely

from assets.built.primitives import Shape, flat, part
from assets.records import Finish
from embodied.house import House
from embodied.part import Part
from embodied.seeds import stream
from embodied.walls import hole_on, room_union, wall_face

PIECES = ("facade", "roof", "ground", "terrace", "hedge", "trees", "houses")
"""Owners outside are 'outdoor/<piece>'."""

FACADES = ("render_white/0", "render_white/1", "brick_red/0", "render_white/2")


def facade_finish(house: House) -> str:
    """Material key of the outer walls, the same all around one house."""
    return FACADES[int(stream(house.seed, "outdoors", "facade").integers(len(FACADES)))]


def footprint(house: House, storey: int) -> shapely.Geometry:
    """The outline of one storey's outer walls, metres, world."""
    return room_union(house, storey).buffer(house.outer_wall - house.inner_wall / 2, join_style="mitre")


def outdoor_parts(house: House, finish: Callable[[str], Finish]) -> list[Part]:
    """All parts of kind 'outdoor'."""
    walls, roofs = [], []
    for k in range(len(house.storeys)):
        shape, lids = _storey_shell(house, k)
        walls += shape
        roofs += lids
    parts = [
        Part("outdoor/facade", "outdoor", "", part(finish(facade_finish(house)), *walls), "outdoor/facade"),
        Part(
            "outdoor/roof",
            "outdoor",
            "",
            part(Finish(color=(0.35, 0.34, 0.33, 1.0), roughness=0.9), *roofs),
            "outdoor/roof",
        ),
    ]
    return parts


def _storey_shell(house: House, k: int) -> tuple[list[Shape], list[Shape]]:
    """Facade of one storey with its openings, and its roof (and soffit) where no storey covers it."""
    storey = house.storeys[k]
    low = storey.elevation - (0.15 if k == 0 else 0.0)
    last = k + 1 == len(house.storeys)
    high = storey.elevation + storey.height + 0.25 if last else house.storeys[k + 1].elevation
    outline = footprint(house, k)
    openings = [o for o in house.openings if o.rooms[1] is None and house.room_by_id[o.rooms[0]].storey == k]
    walls = []
    for polygon in shapely.get_parts(outline):
        polygon = shapely.geometry.polygon.orient(polygon)
        for ring in [polygon.exterior, *polygon.interiors]:
            points = np.asarray(ring.coords)[:-1][::-1]
            for p, q in zip(points, np.roll(points, -1, axis=0)):
                holes = [hole_on(p, q, o, storey.elevation, house.outer_wall - house.inner_wall / 2) for o in openings]
                walls.append(wall_face(p, q, low, high, sorted(h for h in holes if h is not None)))
    above = footprint(house, k + 1) if not last else shapely.Polygon()
    below = footprint(house, k - 1) if k > 0 else shapely.Polygon()
    lids = []
    if not (roof := outline.difference(above)).is_empty:
        lids.append(flat(roof, high))
    if k > 0 and not (soffit := outline.difference(below)).is_empty:
        lids.append(flat(soffit, low, up=False))
    return walls, lids
