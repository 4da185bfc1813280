"""Goal nodes: where an object can be found, per object class, room kind and house."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from embodied.house.house import House, Placement
from embodied.interface import Place

GOAT_REACH = 2.0
"""Metres within which a thing of a sequence counts as found, in its room."""
NOT_OBJECTS = frozenset({"person"})
"""Classes that are never looked for."""


@dataclass(frozen=True)
class Instance:
    """One findable object."""

    placement: str
    object_class: str
    room: str
    room_kind: str
    nodes: tuple[int, ...]
    """Nodes of its room within reach of it, nearest first, at least one."""


@dataclass(frozen=True)
class GoalClass:
    """All instances that satisfy one request."""

    object_class: str
    room_kind: str | None
    placements: tuple[str, ...]
    goal_nodes: tuple[int, ...]
    """Ascending, without repeats."""


def footprint_distance(placement: Placement, points: np.ndarray) -> np.ndarray:
    """(n,) horizontal distance in metres of points (n, 2+) to the placement's footprint; 0 above it."""
    offset = np.asarray(points)[:, :2] - np.asarray(placement.position[:2])
    c, s = math.cos(placement.yaw), math.sin(placement.yaw)
    own = np.stack([c * offset[:, 0] + s * offset[:, 1], -s * offset[:, 0] + c * offset[:, 1]], axis=1)
    outside = np.maximum(np.abs(own) - np.asarray(placement.size[:2]) / 2, 0.0)
    return np.hypot(outside[:, 0], outside[:, 1])


def find_instances(world: Place, reach: float) -> tuple[Instance, ...]:
    """Every object that somebody standing in the same room can be within `reach` metres of.

    The same room is required because a wall between node and object would make "found" a lie.
    The order is that of the house's placements.
    """
    house: House = world.house
    positions = np.asarray(world.graph.positions)
    nodes_of_room: dict[str, list[int]] = {}
    for node, room in enumerate(world.graph.room_of_node):
        nodes_of_room.setdefault(str(room), []).append(node)
    instances = []
    for p in house.placements:
        nodes = nodes_of_room.get(p.room)
        if not nodes or p.object_class in NOT_OBJECTS:
            continue
        distance = np.round(footprint_distance(p, positions[nodes]), 6)
        order = [nodes[i] for i in np.argsort(distance, kind="stable") if distance[i] <= reach]
        if order:
            kind = house.room_by_id[p.room].kind
            instances.append(Instance(p.id, p.object_class, p.room, kind, tuple(order)))
    return tuple(instances)


def goal_classes(instances: tuple[Instance, ...], *, by_room: bool, nearest_only: bool) -> tuple[GoalClass, ...]:
    """Requests that the house can satisfy, sorted by class and room kind.

    Args:
      by_room: one request per (class, room kind) rather than per class.
      nearest_only: the goal is each instance's nearest node rather than all nodes within reach.
    """
    groups: dict[tuple[str, str], list[Instance]] = {}
    for x in instances:
        groups.setdefault((x.object_class, x.room_kind if by_room else ""), []).append(x)
    classes = []
    for (name, kind), members in sorted(groups.items()):
        nodes = sorted({v for x in members for v in (x.nodes[:1] if nearest_only else x.nodes)})
        classes.append(GoalClass(name, kind or None, tuple(x.placement for x in members), tuple(nodes)))
    return tuple(classes)
