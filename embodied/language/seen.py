"""What somebody standing at a node can tell without any map: things, ways to go, the room around them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from embodied.language.clauses import Thing
from embodied.language.lexicon import UNFIT, says

if TYPE_CHECKING:
    from assets.records import Asset
    from embodied.world import World

SMALLEST = 5
"""Fewest pixels of a sighting (of 24576 around) by which a thing is noticed."""


@dataclass(frozen=True)
class SeenThing:
    """One thing in view."""

    placement: str
    """Tells two things apart; a listener must not use it as a name."""
    asset: Asset
    yaw: float
    """Direction, radians counter-clockwise from +x."""
    distance: float
    """Horizontal metres to what is visible of it."""
    pixels: int


@dataclass(frozen=True)
class Way:
    """One way to go on."""

    node: int
    yaw: float
    """Radians counter-clockwise from +x."""
    length: float
    """Metres."""
    kind: str
    """Kind of the room it leads into, as one sees through the doorway."""
    leaves: bool
    """Whether it leads into another room."""


@dataclass(frozen=True)
class Seen:
    """All of it from one node."""

    kind: str
    things: tuple[SeenThing, ...]
    ways: tuple[Way, ...]

    def nearest(self, thing: Thing) -> SeenThing | None:
        """The nearest thing in view that `thing` may mean."""
        fitting = [s for s in self.things if says(s.asset, thing)]
        return min(fitting, key=lambda s: (s.distance, s.placement)) if fitting else None


class Eyes:
    """Looks around in a world, remembering every look. The only way a listener learns of the world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._looks: dict[int, Seen] = {}

    @property
    def visited(self) -> int:
        """At how many nodes it has looked around."""
        return len(self._looks)

    def at(self, node: int) -> Seen:
        """What is seen from `node`."""
        if node not in self._looks:
            self._looks[node] = look(self._world, node)
        return self._looks[node]


def look(world: World, node: int) -> Seen:
    """What is seen from `node`, the largest things first."""
    graph, house, assets = world.graph, world.house, world.catalogue.assets
    things = tuple(
        SeenThing(s.placement, assets[house.placement_by_id[s.placement].asset], s.yaw, s.distance * math.cos(s.pitch), s.pixels)
        for s in world.sightings(node) if s.pixels >= SMALLEST and s.object_class not in UNFIT
    )
    here, room = np.asarray(graph.positions[node]), graph.room_of_node[node]
    ways = []
    for n in graph.neighbours(node):
        step = np.asarray(graph.positions[n]) - here
        other = graph.room_of_node[n]
        ways.append(Way(int(n), math.atan2(step[1], step[0]), float(np.hypot(step[0], step[1])), house.room_by_id[other].kind, other != room))
    return Seen(house.room_by_id[room].kind, things, tuple(ways))
