"""Human assistants as visible figures: people beside the starts of the routes they know."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely

from embodied.geometry import rectangle, yaw_facing
from embodied.house import House, Placement, rounded
from embodied.navgraph import RADIUS, unreachable_rooms
from embodied.seeds import stream

if TYPE_CHECKING:
    from assets.catalogue import Catalogue
    from assets.records import Asset
    from embodied.navgraph import NavGraph

CLASS = "person"
NEAREST, FARTHEST = 0.5, 2.0
"""How far from their node people may stand, metres: within its zone of attention."""
APART = 0.9
"""Width of the circle around a person that nobody else's body enters, metres."""
STANDING = 1.35
"""Least height of a standing figure, metres."""
ROOM = 0.01
"""Least area of the free spots that a figure may choose from, square metres."""


def add_people(house: House, graph: NavGraph, starts: Sequence[int], catalogue: Catalogue, *, seed: int) -> House:
    """The house with one person beside each start node that has room for one, looking at it.

    The navigation graph stays valid: everybody keeps the walker's radius from its edges. Figures are
    tried in a drawn order until one fits; a start without free floor within 2 m goes without (the
    assistant is then heard but not seen).

    Args:
      starts: node indices; repeats count once.
    """
    figures = [a for a in catalogue.of_class(CLASS) if stands(a)]
    if not figures:
        return house
    ways = shapely.MultiLineString([graph.positions[list(e), :2].tolist() for e in graph.edges])
    taken = _obstacles(house)
    people: list[Placement] = []
    for node in sorted({int(s) for s in starts}):
        room = house.room_by_id[graph.room_of_node[node]]
        rng = stream(seed, "person", house.name, node)
        eye = graph.positions[node, :2]
        around = _disc(eye, 2 * FARTHEST)
        others = [_disc(p.position[:2], APART / 2) for p in people if math.dist(p.position[:2], eye) < 2 * FARTHEST]
        free = house.floor(room).intersection(around).difference(shapely.union_all([taken.intersection(around), *others]))
        edges, ring = ways.intersection(around), _disc(eye, FARTHEST).difference(_disc(eye, NEAREST))
        spots = ((a, _spots(free, edges, ring, max(a.size[:2]) / 2)) for a in (figures[int(i)] for i in rng.permutation(len(figures))))
        asset, where = next((pair for pair in spots if pair[1].area >= ROOM), (None, None))
        if asset is None:
            continue
        spot = _drawn(where, rng)
        direction = math.atan2(eye[1] - spot[1], eye[0] - spot[0])
        people.append(Placement(
            f"{CLASS}_{len(people) + 1}", asset.key, CLASS, room.id,
            rounded((spot[0], spot[1], house.storey_of(room).elevation)), rounded(yaw_facing(direction)), asset.size,
        ))
    return _passable(house, people)


def _passable(house: House, people: list[Placement]) -> House:
    """The house with those people who shut nobody off from a room; the last to come step aside first."""
    full = dataclasses.replace(house, placements=(*house.placements, *people))
    while people and (shut := set(unreachable_rooms(full)) - set(unreachable_rooms(house))):
        near = [p for p in people if p.room in shut] or people
        people = [p for p in people if p is not near[-1]]
        full = dataclasses.replace(house, placements=(*house.placements, *people))
    return full


def stands(asset: Asset) -> bool:
    """Whether a figure stands on its own feet; those that sit or lie need something to do it on."""
    return asset.support == "floor" and asset.size[2] >= STANDING and max(asset.size[:2]) <= 2 * STANDING / 3


def _spots(
    free: shapely.Polygon, edges: shapely.MultiLineString, ring: shapely.Polygon, body: float
) -> shapely.Geometry:
    """Where in `ring` somebody of radius `body` may stand: on `free` floor, and a walker can still follow the `edges`."""
    return free.buffer(-body, quad_segs=4).intersection(ring).difference(edges.buffer(body + RADIUS, quad_segs=4))


def _drawn(spots: shapely.Geometry, rng: np.random.Generator) -> tuple[float, float]:
    """A point of an area, drawn evenly; of a very thin one, some point."""
    x0, y0, x1, y1 = spots.bounds
    drawn = shapely.points(rng.uniform((x0, y0), (x1, y1), (256, 2)))
    x, y = next(iter(drawn[shapely.contains(spots, drawn)]), spots.representative_point()).coords[0]
    return float(x), float(y)


def _obstacles(house: House) -> shapely.Geometry:
    """What a standing body would run into: everything below head height that is higher than a rug."""
    return shapely.union_all([
        shapely.Polygon(rectangle(p.position[0], p.position[1], p.size[0], p.size[1], p.yaw))
        for p in house.placements if p.position[2] < 1.8 and p.size[2] > 0.05
    ])


def _disc(middle: Sequence[float], radius: float) -> shapely.Polygon:
    return shapely.Point(middle).buffer(radius, quad_segs=8)
