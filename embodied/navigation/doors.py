"""Doors in play: which can be closed, and what is seen while some are."""

import dataclasses
import itertools
import weakref
from collections.abc import Collection, Mapping
from typing import TypeVar

import numpy as np
import shapely

from embodied.house.house import House
from embodied.navigation.free_space import between_walls, leaves, room_doors
from embodied.navigation.graph import NavGraph, behind_doors

P = TypeVar("P")
BESIDE = 0.1
"""Metres from a closed leaf within which nobody stands when it is closed."""
MARK, LIVING = "|", "@"
"""Between the name of a house and how its doors differ from the house at rest, in the name of what is seen there."""


def closable_doors(house: House, graph: NavGraph) -> tuple[str, ...]:
    """Doors that bar an edge of the graph and in whose way no viewpoint stands, in the order of the house."""
    barring, eyes = {d for doors in graph.doors.values() for d in doors}, shapely.points(graph.positions[:, :2])
    shut = [dataclasses.replace(o, angle=0.0) for o in room_doors(house) if o.id in barring]
    return tuple(o.id for o in shut if shapely.distance(eyes, shapely.union_all(leaves(house, o))).min() > BESIDE)


_IN_SIGHT: weakref.WeakKeyDictionary[NavGraph, np.ndarray] = weakref.WeakKeyDictionary()
THIN, STEP = 0.03, 0.1
"""Metres: walls are taken to be thinner by this on each side; between points of a leaf that are looked at."""


def doors_in_sight(house: House, graph: NavGraph) -> np.ndarray:
    """(n, d) bool, doors between rooms in the house's order: no wall hides a door, open or closed, from a viewpoint.
    Furniture and floors hide nothing here; what is seen through two windows does not count."""
    if graph not in _IN_SIGHT:
        doors, storey = room_doors(house), np.array([house.room_by_id[r].storey for r in graph.room_of_node])
        seen = np.zeros((len(storey), len(doors)), bool)
        for (k, o), level in itertools.product(enumerate(doors), range(len(house.storeys))):
            ends, here = sorted((house.room_by_id[o.rooms[0]].storey, level)), storey == level
            area = between_walls(house, range(ends[0], ends[1] + 1)).buffer(THIN)
            shapely.prepare(area)
            swept = [dataclasses.replace(o, angle=a) for a in (0.0, o.angle, np.pi / 2)]
            hull = shapely.union_all([leaf for one in swept for leaf in leaves(house, one)]).convex_hull
            points = np.asarray(hull.segmentize(STEP).exterior.coords)
            eyes = np.repeat(graph.positions[here, None, :2], len(points), 1)
            lines = shapely.linestrings(np.stack([eyes, np.broadcast_to(points, eyes.shape)], 2))
            seen[here, k] = shapely.covers(area, lines).any(1)
        _IN_SIGHT[graph] = seen
    return _IN_SIGHT[graph]


def seen_name(house: House, graph: NavGraph, node: int, closed: Collection[str]) -> str:
    """Name of what is seen from a node while some doors are closed, and parts of furniture, 'dresser_1/drawer_1', open:
    the house's own where nothing in sight differs.

    Walls and closed doors hide what is behind them, so of the doors that differ from the house at rest only those
    count that are in sight and that a way without opening leads to, and of furniture what stands in the same room.
    """
    changed = changed_doors(graph, closed)
    if not changed:
        return house.name
    reached = np.isfinite(behind_doors(graph, frozenset(closed), np.inf).distance[node])
    rooms = {graph.room_of_node[n] for n in np.flatnonzero(reached)}
    doors = zip(room_doors(house), doors_in_sight(house, graph)[node], strict=True)
    beside = [o.id for o, seen in doors if seen and o.id in changed and rooms.intersection(o.rooms)]
    room_of = {p.id: p.room for p in house.placements}
    beside += [d for d in changed if room_of.get(d.partition("/")[0]) == graph.room_of_node[node]]
    return house.name + MARK + ",".join(f"{d}={changed[d]:g}" for d in beside) if beside else house.name


def changed_doors(graph: NavGraph, closed: Collection[str]) -> dict[str, float]:
    """Openness, 0 or 1, of what differs from the house at rest while some doors are closed and furniture is open."""
    return {d: float("/" in d or d not in closed) for d in sorted(graph.closed.symmetric_difference(closed))}


def lived_name(seen: str, moment: tuple[float, int] | None) -> str:
    """Name of what is seen from a node, as `seen_name` has it, among who lives there: the second of the day, and the
    node that they look at, or nobody."""
    return f"{seen}{'' if MARK in seen else MARK}{LIVING}" + ("" if moment is None else f"{moment[0]:g}/{moment[1]}")


def place_named(places: Mapping[str, P], name: str) -> P:
    """The place that a sight is of, by the name that `seen_name` or `lived_name` gave it.

    Raises:
      KeyError: of another house.
    """
    house, _, now = name.partition(MARK)
    doors, living, moment = now.partition(LIVING)
    openness = {d: float(x) for d, _, x in (part.partition("=") for part in doors.split(",") if part)}
    if living:
        second, _, node = moment.partition("/")
        when = (float(second), int(node)) if moment else None
        return places[house].living(when, openness)  # type: ignore[attr-defined]
    return places[house].with_doors(openness) if openness else places[house]  # type: ignore[attr-defined]
