"""Walkways stay free: what blocks the way into a room is taken out again, the least important things first."""

from __future__ import annotations

import dataclasses

import numpy as np
import shapely
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from embodied.house import House, HouseError
from embodied.navgraph import RADIUS, Grid, rooms_of_cells, unreachable_rooms, walkable
from embodied.walkable import HEAD, STEP, footprint

NEEDED = ("bed", "toilet", "bath", "shower", "sink", "basin", "cooker", "fridge", "sofa", "wardrobe", "table", "desk")
"""Words of object classes that are moved out of the way last."""
ROUNDS = 8


def cleared(house: House) -> House:
    """`house` without the things that keep a body of the agent's radius out of some room.

    Raises:
      HouseError: a room stays closed although nothing stands in the way.
    """
    for _ in range(ROUNDS):
        closed = unreachable_rooms(house)
        if not closed:
            return house
        room = house.room_by_id[closed[0]]
        blocking = _blocking(house, room.storey)
        if not blocking:
            raise HouseError(f"room {room.id!r} cannot be entered on foot although no object is in the way; "
                             "its door or corridor is too narrow")
        house = without(house, blocking)
    raise HouseError(f"rooms {unreachable_rooms(house)} stay closed after {ROUNDS} rounds of clearing")


def without(house: House, names: tuple[str, ...]) -> House:
    """The house without some placements, all that rests on them, and their lights."""
    gone = set(names)
    for _ in range(8):
        gone |= {p.id for p in house.placements if p.parent in gone}
    return dataclasses.replace(
        house, placements=tuple(p for p in house.placements if p.id not in gone),
        lights=tuple(x for x in house.lights if x.placement not in gone))


def _blocking(house: House, storey: int) -> tuple[str, ...]:
    """The placements that the cheapest way from the first closed room to the open part runs through."""
    bare = dataclasses.replace(house, placements=())
    space = walkable(bare, storey)
    shapely.prepare(space)
    grid = Grid(space)
    rooms = [r for r in house.rooms if r.storey == storey]
    room_of_cell = rooms_of_cells(grid, rooms)
    closed = set(unreachable_rooms(house))
    floor = house.storeys[storey].elevation
    ids = {r.id for r in rooms}
    things = [p for p in house.placements if p.room in ids and p.position[2] - floor < HEAD
              and p.position[2] + p.size[2] - floor > STEP]
    toll = np.zeros(len(grid.xy))
    reach = []
    points = shapely.points(grid.xy)
    for p in things:
        shape = footprint(p).buffer(RADIUS + 0.06)
        shapely.prepare(shape)
        near = np.flatnonzero(shapely.contains(shape, points))
        reach.append(near)
        toll[near] += 60.0 if any(w in p.object_class for w in NEEDED) else 6.0
    matrix = grid.matrix.tocoo()
    dear = csr_matrix((matrix.data + toll[matrix.row] + toll[matrix.col], (matrix.row, matrix.col)), shape=matrix.shape)
    is_closed = np.array([r.id in closed for r in rooms])
    start = np.flatnonzero((room_of_cell >= 0) & ~is_closed[room_of_cell] & (toll == 0))
    first = next(k for k, r in enumerate(rooms) if r.id in closed)
    goal = np.flatnonzero(room_of_cell == first)
    if len(start) == 0 or len(goal) == 0:
        return ()
    cost, before, _ = dijkstra(dear, directed=False, indices=start, min_only=True, return_predecessors=True)
    # a cell well inside the room, not merely its doorstep
    deep = goal[grid.clearance[goal] >= min(0.3, float(grid.clearance[goal].max()))]
    at = int(deep[np.argmin(cost[deep])])
    way = set()
    while at >= 0:
        way.add(at)
        at = int(before[at])
    return tuple(p.id for p, near in zip(things, reach) if way.intersection(near.tolist()))
