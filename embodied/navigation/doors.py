"""Doors in play: which can be closed, and what is seen while some are."""

import dataclasses
from collections.abc import Collection, Mapping
from typing import TypeVar

import numpy as np
import shapely

from embodied.house.house import House
from embodied.navigation.free_space import leaves, room_doors
from embodied.navigation.graph import NavGraph, behind_doors

P = TypeVar("P")
BESIDE = 0.1
"""Metres from a closed leaf within which nobody stands when it is closed."""
MARK = "|"
"""Between the name of a house and how its doors differ from the house at rest, in the name of what is seen there."""


def closable_doors(house: House, graph: NavGraph) -> tuple[str, ...]:
    """Doors that bar an edge of the graph and in whose way no viewpoint stands, in the order of the house."""
    barring, eyes = {d for doors in graph.doors.values() for d in doors}, shapely.points(graph.positions[:, :2])
    shut = [dataclasses.replace(o, angle=0.0) for o in room_doors(house) if o.id in barring]
    return tuple(o.id for o in shut if shapely.distance(eyes, shapely.union_all(leaves(house, o))).min() > BESIDE)


def seen_name(house: House, graph: NavGraph, node: int, closed: Collection[str]) -> str:
    """Name of what is seen from a node while some doors are closed, and parts of furniture, 'dresser_1/drawer_1', open:
    the house's own where nothing in sight differs.

    A closed door hides what is behind it, so of the doors that differ from the house at rest only those count that
    a way without opening leads to, and of furniture what stands in the same room.
    """
    changed = changed_doors(graph, closed)
    if not changed:
        return house.name
    reached = np.isfinite(behind_doors(graph, frozenset(closed), np.inf).distance[node])
    rooms = {graph.room_of_node[n] for n in np.flatnonzero(reached)}
    beside = [o.id for o in room_doors(house) if o.id in changed and rooms.intersection(o.rooms)]
    room_of = {p.id: p.room for p in house.placements}
    beside += [d for d in changed if room_of.get(d.partition("/")[0]) == graph.room_of_node[node]]
    return house.name + MARK + ",".join(f"{d}={changed[d]:g}" for d in beside) if beside else house.name


def changed_doors(graph: NavGraph, closed: Collection[str]) -> dict[str, float]:
    """Openness, 0 or 1, of what differs from the house at rest while some doors are closed and furniture is open."""
    return {d: float("/" in d or d not in closed) for d in sorted(graph.closed.symmetric_difference(closed))}


def place_named(places: Mapping[str, P], name: str) -> P:
    """The place that a sight is of, by the name that `seen_name` gave it.

    Raises:
      KeyError: of another house.
    """
    house, _, doors = name.partition(MARK)
    openness = {d: float(x) for d, _, x in (part.partition("=") for part in doors.split(",") if part)}
    return places[house].with_doors(openness) if openness else places[house]  # type: ignore[attr-defined]
