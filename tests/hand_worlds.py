"""Tiny worlds by hand for the tests of play: a four-node line and a grid over four rooms; and houses of the generator
that several files look at."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from embodied.assets.catalogue import load_catalogue
from embodied.generate import generate_house
from embodied.house.house import House, Opening, Placement, Room, Storey
from embodied.navigation.graph import NavGraph, graph_of

FINISHES = ("oak_planks/0", "paint_white/0", "paint_white/0", "paint_white/0")


def hand_graph(positions, edges, rooms) -> NavGraph:
    names = tuple(f"n{i}" for i in range(len(positions)))
    return graph_of(np.asarray(positions, dtype=float), np.asarray(edges), names, tuple(rooms))


@functools.cache
def generated(seed: int) -> House:
    """A furnished house as it comes; seeds from 100 on are asked for by several files."""
    return generate_house(seed, catalogue=load_catalogue())


@dataclass(frozen=True, eq=False)
class HandWorld:
    house: House
    graph: NavGraph

    def sightings(self, node: int) -> tuple:
        return ()


def room(name: str, kind: str, x0: float, y0: float, x1: float, y1: float) -> Room:
    return Room(name, kind, ((x0, y0), (x1, y0), (x1, y1), (x0, y1)), *FINISHES)


def thing(name: str, number: int, where: str, x: float, y: float) -> Placement:
    key = f"{name.replace(' ', '_')}_{number}"
    return Placement(key, f"hand/{name}", name, where, (x, y, 0.0), 0.0, (0.2, 0.2, 0.2))


def line_world() -> HandWorld:
    """Nodes 0-1-2-3 two metres apart along +x in one room; a mug beside node 3."""
    hall = room("hall_1", "hall", 0, 0, 8, 2)
    door = Opening("front_door_1", "front_door", ("hall_1", None), (0, 1.5), (0, 0.5), 0.0, 2.1)
    house = House(0, "line", (Storey(0.0, 2.6),), (hall,), (door,), (thing("mug", 1, "hall_1", 7.4, 1.2),), ())
    positions = [[1 + 2 * i, 1, 1.5] for i in range(4)]
    return HandWorld(house, hand_graph(positions, [[0, 1], [1, 2], [2, 3]], ["hall_1"] * 4))


def grid_world(side: int = 6, spacing: float = 2.0, name: str = "grid") -> HandWorld:
    """side x side nodes over four equal rooms, doors in the middle of the inner walls, a few things."""
    half = side * spacing / 2
    rooms = (
        room("kitchen_1", "kitchen", 0, 0, half, half),
        room("bedroom_1", "bedroom", half, 0, 2 * half, half),
        room("living_room_1", "living_room", 0, half, half, 2 * half),
        room("bathroom_1", "bathroom", half, half, 2 * half, 2 * half),
    )
    m = spacing / 2
    low, high = m + spacing, half + m + spacing
    doors = (
        Opening("door_1", "door", ("kitchen_1", "bedroom_1"), (half, low - 0.4), (half, low + 0.4), 0.0, 2.0),
        Opening("door_2", "door", ("kitchen_1", "living_room_1"), (low - 0.4, half), (low + 0.4, half), 0.0, 2.0),
        Opening("door_3", "door", ("living_room_1", "bathroom_1"), (half, high - 0.4), (half, high + 0.4), 0.0, 2.0),
    )
    things = (
        thing("mug", 1, "kitchen_1", 1.2, 0.8),
        thing("mug", 2, "living_room_1", 0.8, 2 * half - 1.0),
        thing("bed", 1, "bedroom_1", 2 * half - 1.0, 1.0),
        thing("towel", 1, "bathroom_1", 2 * half - 1.2, 2 * half - 0.8),
        thing("sofa", 1, "living_room_1", half - 1.0, half + 1.0),
        thing("lamp", 1, "bedroom_1", half + 1.0, half - 1.0),
    )
    house = House(0, name, (Storey(0.0, 2.6),), rooms, doors, things, ())
    positions, where, edges = [], [], []
    for y in range(side):
        for x in range(side):
            positions.append([m + x * spacing, m + y * spacing, 1.5])
            where.append(rooms[2 * (y >= side // 2) + (x >= side // 2)].id)
    doorways = [{"kitchen_1", "bedroom_1"}, {"kitchen_1", "living_room_1"}, {"living_room_1", "bathroom_1"}]
    door_rows = {1, side // 2 + 1}
    for i in range(side * side):
        x, y = i % side, i // side
        for j, along in ((i + 1 if x + 1 < side else None, y), (i + side if y + 1 < side else None, x)):
            if j is None:
                continue
            if where[i] == where[j] or ({where[i], where[j]} in doorways and along in door_rows):
                edges.append([i, j])
    jitter = np.array(positions) + 0.05 * np.sin(np.arange(3 * side * side)).reshape(-1, 3)
    return HandWorld(house, hand_graph(jitter, edges, where))
