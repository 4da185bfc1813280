"""Walkways stay free: what blocks the way into a room is taken out again, the least important things first."""

import dataclasses

import numpy as np
import shapely
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from embodied.generate.config import RETRIES, DeadEndError
from embodied.house.house import House
from embodied.house.shapes import footprint
from embodied.navigation.free_space import HEAD, LOW
from embodied.navigation.graph import AGENT_RADIUS, CELL, blocked_ends, closed_rooms, reachable

NEEDED = ("bed", "toilet", "bath", "shower", "sink", "basin", "cooker", "fridge", "sofa", "wardrobe", "table", "desk")
"""Words of object classes that are moved out of the way last."""


def remove_blocking_objects(house: House) -> House:
    """`house` without the things that keep a body of the agent's radius out of some room or from some stair.

    Raises:
      DeadEndError: a room stays closed although nothing stands in the way.
    """
    for storey in range(len(house.storeys)):
        for _ in range(RETRIES.clearing):
            grid, room_of_cell, reach = reachable(house, storey)
            rooms = [r for r in house.rooms if r.storey == storey]
            closed = closed_rooms(room_of_cell, reach, len(rooms))
            ends = blocked_ends(house, storey, grid.xy[reach])
            if not closed and not ends:
                break
            blocking = _blocking(house, storey, closed, ends, grid.xy[reach])
            if not blocking and not closed:
                raise DeadEndError(f"a stair of storey {storey} cannot be entered although no object is in the way")
            if not blocking:
                raise DeadEndError(
                    f"room {rooms[closed[0]].id!r} cannot be entered on foot although no object is in the "
                    "way; its door or corridor is too narrow"
                )
            house = without(house, blocking)
        else:
            names = [rooms[k].id for k in closed]
            raise DeadEndError(f"rooms {names} or stairs stay closed after {RETRIES.clearing} rounds of clearing")
    return house


def without(house: House, names: tuple[str, ...]) -> House:
    """The house without some placements, all that rests on them, and their lights."""
    removed = set(names)
    for _ in range(8):
        removed |= {p.id for p in house.placements if p.parent in removed}
    return dataclasses.replace(
        house,
        placements=tuple(p for p in house.placements if p.id not in removed),
        lights=tuple(x for x in house.lights if x.placement not in removed),
    )


def _blocking(
    house: House, storey: int, closed: list[int], ends: list[np.ndarray], open_cells: np.ndarray
) -> tuple[str, ...]:
    """The placements that the cheapest ways from the open part into the closed rooms and to `ends` run through.

    Args:
      closed: indices of rooms among those of the storey.
      open_cells: (n, 2) metres, the cells that can be reached among the furniture.
    """
    grid, room_of_cell, _ = reachable(dataclasses.replace(house, placements=()), storey)
    floor = house.storeys[storey].elevation
    ids = {r.id for r in house.rooms if r.storey == storey}
    things = [
        p
        for p in house.placements
        if p.room in ids and p.position[2] - floor < HEAD and p.position[2] + p.size[2] - floor > LOW
    ]
    toll = np.zeros(len(grid.xy))
    covered = []
    for p in things:
        shape = footprint(p).buffer(AGENT_RADIUS + 0.06)
        x0, y0, x1, y1 = shape.bounds
        box = np.flatnonzero((grid.xy >= (x0, y0)).all(1) & (grid.xy <= (x1, y1)).all(1))
        near = box[shapely.contains_xy(shape, grid.xy[box, 0], grid.xy[box, 1])]
        covered.append(set(near.tolist()))
        toll[near] += 60.0 if any(w in p.object_class for w in NEEDED) else 6.0
    matrix = grid.matrix.tocoo()
    dear = csr_matrix((matrix.data + toll[matrix.row] + toll[matrix.col], (matrix.row, matrix.col)), shape=matrix.shape)
    keys = {tuple(k) for k in np.round(open_cells / CELL).astype(int).tolist()}
    start = [n for n, k in enumerate(np.round(grid.xy / CELL).astype(int).tolist()) if tuple(k) in keys]
    if not start:
        return ()
    at_start = np.zeros(len(grid.xy), bool)
    at_start[start] = True
    cost, before, _ = dijkstra(dear, directed=False, indices=start, min_only=True, return_predecessors=True)
    way: set[int] = set()
    goals = [int(np.argmin(np.linalg.norm(grid.xy - end[:2], axis=1))) for end in ends]
    for k in closed:
        goal = np.flatnonzero((room_of_cell == k) & ~at_start)
        # the free part of the room, not merely its doorstep
        free = goal[toll[goal] == 0]
        goal = free if len(free) else goal
        goals += [int(goal[np.argmin(cost[goal])])] if len(goal) else []
    for at in goals:
        while at >= 0:
            way.add(at)
            at = int(before[at])
    return tuple(p.id for p, cells in zip(things, covered) if way & cells)
