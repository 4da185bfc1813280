"""Doors between the rooms of a house: which are closed, which edges of a graph they bar, and what they hide."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Protocol, Self, TypeVar

import numpy as np
import shapely

from embodied.house.house import DOORS, House, Opening
from embodied.house.moment import WIDEST
from embodied.navigation.free_space import leaves

if TYPE_CHECKING:
    from embodied.navigation.graph import NavGraph

OPEN_FROM = 0.4
"""Openness from which a door counts as open: Habitat's. A leaf of 0.75 m then leaves 0.46 m, and the agent needs 0.4.
MolmoSpaces says 0.67, RoboCasa 0.9."""
BESIDE = 0.1
"""Metres from a closed leaf within which nobody stands when it is closed."""
MARK = "|"
"""Between the name of a house and how its doors differ from the house at rest, in the name of what is seen there."""


def closed_doors(house: House, threshold: float = OPEN_FROM) -> frozenset[str]:
    """Doors between rooms that are open by less than `threshold`, as the house rests.

    Args:
      threshold: openness, 0 to 1, from which a door counts as open.
    """
    return frozenset(o.id for o in _room_doors(house) if o.angle < threshold * WIDEST)


def opened(house: House, threshold: float = OPEN_FROM) -> House:
    """The house with its closed doors wide open."""
    return with_doors(house, dict.fromkeys(sorted(closed_doors(house, threshold)), 1.0))


def with_doors(house: House, openness: Mapping[str, float]) -> House:
    """The house with some doors at another openness; itself without any."""
    turned = [dataclasses.replace(o, angle=openness[o.id] * WIDEST) if o.id in openness else o for o in house.openings]
    return dataclasses.replace(house, openings=tuple(turned)) if openness else house


def doors_of_edges(positions: np.ndarray, edges: np.ndarray, house: House) -> dict[tuple[int, int], tuple[str, ...]]:
    """Doors that each edge passes, by edge (i, j), i < j; edges that pass none are left out.

    Args:
      positions: (n, 3) metres, world.
      edges: (m, 2) int node pairs.
    """
    passed: dict[tuple[int, int], tuple[str, ...]] = {}
    lines = shapely.linestrings(positions[edges][:, :, :2])
    floors = np.array([s.elevation for s in house.storeys])
    storeys = np.abs(positions[edges[:, 0], 2, None] - 1.5 - floors).argmin(1)
    for o in _room_doors(house):
        storey = house.room_by_id[o.rooms[0]].storey
        for k in np.flatnonzero(shapely.intersects(lines, shapely.LineString([o.a, o.b])) & (storeys == storey)):
            edge = (int(edges[k, 0]), int(edges[k, 1]))
            passed[edge] = (*passed.get(edge, ()), o.id)
    return passed


def closable_doors(house: House, graph: NavGraph) -> tuple[str, ...]:
    """Doors that bar an edge of the graph and in whose way no viewpoint stands, in the order of the house."""
    barring, eyes = {d for doors in graph.doors.values() for d in doors}, shapely.points(graph.positions[:, :2])
    shut = [dataclasses.replace(o, angle=0.0) for o in _room_doors(house) if o.id in barring]
    return tuple(o.id for o in shut if shapely.distance(eyes, shapely.union_all(leaves(house, o))).min() > BESIDE)


def seen_name(house: House, graph: NavGraph, node: int, closed: Collection[str]) -> str:
    """Name of what is seen from a node while some doors are closed: the house's own where nothing in sight differs.

    A closed door hides what is behind it, so of the doors that differ from the house at rest only those count that
    a way without opening leads to. Two windows that face each other are not looked through.
    """
    changed = changed_doors(graph, closed)
    if not changed:
        return house.name
    rooms = _rooms_within(house, graph, graph.room_of_node[node], closed)
    beside = [o.id for o in _room_doors(house) if o.id in changed and rooms.intersection(o.rooms)]
    return house.name + MARK + ",".join(f"{d}={changed[d]:g}" for d in beside) if beside else house.name


def changed_doors(graph: NavGraph, closed: Collection[str]) -> dict[str, float]:
    """Openness, 0 or 1, of the doors that differ from the house at rest while some doors are closed."""
    return {d: float(d not in closed) for d in sorted(graph.closed.symmetric_difference(closed))}


def parse_seen(name: str) -> tuple[str, dict[str, float]]:
    """Name of the house and openness of the doors that differ, from a name of `seen_name`."""
    house, _, doors = name.partition(MARK)
    return house, {d: float(x) for d, _, x in (part.partition("=") for part in doors.split(",") if part)}


class WithDoors(Protocol):
    """A place that can be seen with its doors otherwise."""

    def with_doors(self, openness: Mapping[str, float]) -> Self:
        """It, with some doors at another openness, 0 to 1, by opening."""


W = TypeVar("W", bound=WithDoors)


def place_named(places: Mapping[str, W], name: str) -> W:
    """The place that a sight is of, by the name that `seen_name` gave it.

    Raises:
      KeyError: of another house.
    """
    house, openness = parse_seen(name)
    return places[house].with_doors(openness) if openness else places[house]


def _room_doors(house: House) -> list[Opening]:
    return [o for o in house.openings if o.kind == "door" and o.rooms[1] is not None and o.leaf_finish is not None]


def _rooms_within(house: House, graph: NavGraph, room: str, closed: Collection[str]) -> set[str]:
    """Rooms that one comes to from a room, itself included, without opening a door."""
    joined = [o.rooms for o in house.openings if o.kind in DOORS and o.id not in closed]
    pairs = {(a, b) for a, b in joined if b is not None}
    shut = {edge for edge, doors in graph.doors.items() if not set(doors).isdisjoint(closed)}
    for i, j in graph.edges.tolist():
        if (i, j) not in shut:
            pairs.add((graph.room_of_node[i], graph.room_of_node[j]))
    reached, more = set[str](), {room}
    while more:
        reached |= more
        more = {b for a, b in pairs if a in more} | {a for a, b in pairs if b in more}
        more -= reached
    return reached
