"""Surroundings of a node, as one sees them without a map: things, ways to go, the room around them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from embodied.interface import SeenPlace
from embodied.language.clauses import DOWN, LEFT, RIGHT, UP, Referent
from embodied.language.lexicon import UNFIT, says
from embodied.language.plain_language import LEVEL
from embodied.navigation.free_space import EYE

if TYPE_CHECKING:
    from embodied.assets.records import Asset

FEWEST_PIXELS = 5
"""Fewest pixels of a sighting (of 24576 around) by which a thing is noticed."""


@dataclass(frozen=True)
class VisibleThing:
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
    """It leads into another room."""
    door: str | None = None
    """The doorway it goes through; tells two apart."""
    closed: bool = False
    """A closed door bars it."""
    climb: str | None = None
    """UP or DOWN along stairs."""


@dataclass(frozen=True)
class Door:
    """One doorway of the room one is in."""

    id: str
    """Tells two doorways apart; a listener must not use it as a name."""
    offset: tuple[float, float]
    """Metres in x and y from where one stands."""


@dataclass(frozen=True)
class Surroundings:
    """All of it from one node."""

    kind: str
    things: tuple[VisibleThing, ...]
    ways: tuple[Way, ...]
    doors: tuple[Door, ...] = ()
    on_stairs: bool = False

    def nearest(self, thing: Referent) -> VisibleThing | None:
        """The nearest thing in view that `thing` may mean."""
        fitting = [s for s in self.things if says(s.asset, thing)]
        return min(fitting, key=lambda s: (s.distance, s.placement)) if fitting else None


class Lookout:
    """Looks around in a world, remembering every look. The only way a listener learns of the world."""

    def __init__(self, world: SeenPlace) -> None:
        self._world = world
        self._looks: dict[int, Surroundings] = {}

    def at(self, node: int) -> Surroundings:
        """The surroundings of `node`."""
        if node not in self._looks:
            self._looks[node] = look(self._world, node)
        return self._looks[node]


def look(world: SeenPlace, node: int) -> Surroundings:
    """The surroundings of `node`, the largest things first."""
    graph, house, assets = world.graph, world.house, world.catalogue.assets
    things = tuple(
        VisibleThing(
            placement=s.placement,
            asset=assets[house.placement_by_id[s.placement].asset],
            yaw=s.yaw,
            distance=s.distance * math.cos(s.pitch),
            pixels=s.pixels,
        )
        for s in world.sightings(node)
        if s.pixels >= FEWEST_PIXELS and s.object_class not in UNFIT
    )
    here, room = np.asarray(graph.positions[node]), graph.room_of_node[node]
    ways, doors = [], _doors(world, room)
    for n in graph.neighbours(node):
        step = np.asarray(graph.positions[n]) - here
        other = graph.room_of_node[n]
        between = [
            (float(np.hypot(*(at - here[:2] - step[:2] / 2))), name) for name, beyond, at in doors if beyond == other
        ]
        where = int(n), math.atan2(step[1], step[0]), float(np.hypot(step[0], step[1]))
        beyond_it = house.room_by_id[other].kind, other != room, min(between)[1] if between else None
        climb = (UP if step[2] > 0 else DOWN) if abs(step[2]) > LEVEL else None
        ways.append(Way(*where, *beyond_it, closed=bool(graph.barred(node, n, graph.closed)), climb=climb))
    seen_doors = tuple(Door(name, (float(at[0] - here[0]), float(at[1] - here[1]))) for name, _, at in doors)
    return Surroundings(house.room_by_id[room].kind, things, tuple(ways), seen_doors, is_on_stairs(world, node))


def is_on_stairs(world: SeenPlace, node: int) -> bool:
    """True if a node lies between two floors."""
    floor = world.graph.positions[node][2] - EYE
    return bool(world.house.stairs) and min(abs(floor - s.elevation) for s in world.house.storeys) > LEVEL


def _doors(world: SeenPlace, room: str) -> list[tuple[str, str, np.ndarray]]:
    """(id, room beyond, middle in x and y) of the doorways of a room that lead to another."""
    doorways = []
    for o in world.house.openings:
        first, second = o.rooms
        if o.kind == "door" and room in o.rooms and second is not None:
            doorways.append((o.id, first if second == room else second, (np.asarray(o.a) + np.asarray(o.b)) / 2))
    return doorways


def doorway(eyes: Lookout, path: Sequence[int]) -> tuple[str, int, int] | None:
    """Which doorway the last step of `path` goes through: (side, its number on that side, doors on that side).

    Counted along the way, from where the path came into the room that it leaves; None where nobody would count.
    """
    steps: list[Way] = []
    for a, b in itertools.pairwise(path):
        way = next((w for w in eyes.at(a).ways if w.node == b), None)
        if way is None:
            return None
        steps.append(way)
    if not steps or steps[-1].door is None:
        return None
    first = max((i + 1 for i, s in enumerate(steps[:-1]) if s.leaves), default=0)
    along = steps[first:-1] or steps[first - 1 : first]
    if not along:
        return None
    x = sum(s.length * math.cos(s.yaw) for s in along)
    y = sum(s.length * math.sin(s.yaw) for s in along)
    size = math.hypot(x, y)
    if size < 0.5:
        return None
    sides: dict[str, list[tuple[float, str]]] = {LEFT: [], RIGHT: []}
    for door in eyes.at(path[first]).doors:
        ahead, across = (
            (door.offset[0] * x + door.offset[1] * y) / size,
            (door.offset[1] * x - door.offset[0] * y) / size,
        )
        if ahead > 0.3 and abs(across) > 0.3:
            sides[LEFT if across > 0 else RIGHT].append((ahead, door.id))
    for side, doors in sides.items():
        names = [name for _, name in sorted(doors)]
        if steps[-1].door in names:
            return side, names.index(steps[-1].door) + 1, len(names)
    return None
