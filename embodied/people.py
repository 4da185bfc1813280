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
NEAREST, FARTHEST = 0.55, 1.3
"""How far from their node people may stand, metres."""
BODY = 0.25
"""Radius that a person keeps free of furniture and walls, metres."""
APART = 0.9
"""Distance between two people, metres."""
STANDING = 1.35
"""Least height of a standing figure, metres."""
PASSAGE = 0.45
"""Distance that people keep from every edge of the graph, so that nobody blocks the way."""


def add_people(house: House, graph: NavGraph, starts: Sequence[int], catalogue: Catalogue, *, seed: int) -> House:
    """The house with one person beside each start node that has room for one, looking at it.

    The navigation graph stays valid: nobody stands within 0.45 m of an edge. A start without free
    floor nearby goes without its figure (the assistant is then heard but not seen). That is most of
    them: of 345 route starts in 20 houses of 90 to 200 m2, 332 have a spot clear of furniture and 269
    one clear of the graph's edges, but only 128 one clear of both; 120 got their figure. No number
    caps it: viewpoints lie in doors, corridors and the lanes between furniture.

    Args:
      starts: node indices; repeats count once.
    """
    figures = [a for a in catalogue.of_class(CLASS) if stands(a)]
    if not figures:
        return house
    ways = shapely.MultiLineString([graph.positions[list(e), :2].tolist() for e in graph.edges])
    taken = _footprints(house)
    people: list[Placement] = []
    for node in sorted({int(s) for s in starts}):
        room = house.room_by_id[graph.room_of_node[node]]
        rng = stream(seed, "person", house.name, node)
        asset = figures[int(rng.integers(len(figures)))]
        others = [*taken, *(_disc(p.position) for p in people)]
        spot = _spot(graph.positions[node], asset, house.floor(room), ways, others, rng=rng)
        if spot is None:
            continue
        direction = math.atan2(graph.positions[node, 1] - spot[1], graph.positions[node, 0] - spot[0])
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


def _spot(
    eye: np.ndarray, asset: Asset, floor: shapely.Polygon, ways, taken: list, *, rng: np.random.Generator
) -> tuple[float, float] | None:
    """The first of 96 seeded spots around `eye` that is free for a figure looking at `eye`, the nearer ones first."""
    angles = rng.permutation(16) * (2 * math.pi / 16)
    for radius in np.linspace(NEAREST, FARTHEST, 6):
        for angle in angles:
            x, y = eye[0] + radius * math.cos(angle), eye[1] + radius * math.sin(angle)
            point = shapely.Point(x, y)
            yaw = yaw_facing(angle + math.pi)
            body = point.buffer(BODY).union(shapely.Polygon(rectangle(x, y, asset.size[0], asset.size[1], yaw)))
            clear = ways.distance(point) >= PASSAGE and ways.distance(body) >= RADIUS
            if clear and floor.covers(body) and not any(t.intersects(body) for t in taken):
                return float(x), float(y)
    return None


def _footprints(house: House) -> list[shapely.Polygon]:
    """What a standing body would run into: everything below head height that is higher than a rug."""
    return [
        shapely.Polygon(rectangle(p.position[0], p.position[1], p.size[0], p.size[1], p.yaw))
        for p in house.placements if p.position[2] < 1.8 and p.size[2] > 0.05
    ]


def _disc(position: tuple[float, float, float]) -> shapely.Polygon:
    return shapely.Point(position[0], position[1]).buffer(APART - BODY)
