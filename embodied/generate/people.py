"""Human assistants as visible figures: people who stand or sit where the routes they know begin; and a house on another
day: other people in it, and small things moved or put away."""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely

from embodied.assets.people.figures import person_of
from embodied.geometry import rectangle, rotation, yaw_facing
from embodied.house.house import House, Placement, Room, rounded
from embodied.house.household import residents
from embodied.house.shapes import footprint
from embodied.navigation.free_space import leaves
from embodied.navigation.graph import AGENT_RADIUS, unreachable_rooms
from embodied.seeds import stream

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.assets.records import Asset
    from embodied.navigation.graph import NavGraph


CLASS = "person"
NEAREST_PERSON, FARTHEST_PERSON = 0.5, 2.0
"""How far from their node people may be, metres: within its zone of attention."""
POLITE = 1.0
"""How far they are where there is room, metres."""
PERSONAL_SPACE = 0.9
"""Width of the circle around a person that nobody else's body enters, metres."""
STANDING = 0.9
"""Least height of a standing figure, metres."""
RESIDENT = 4.0
"""How many times as often one meets somebody who lives in the house as somebody who visits it."""
ROOM = 0.01
"""Least area of the free spots that a figure may choose from, square metres."""
SIT = 0.5
"""Chance that somebody who could sit there does, instead of standing."""
LAP = 0.45
"""Height of what sitting figures were modelled on, metres; measured on the furniture pack's."""
SOFT, HARD = 0.07, 0.07
"""How far below and above LAP a seat may be, metres."""
ELBOWS = 0.3
"""Half of what somebody on a sofa takes of its width, metres."""
BACK, LEAN = 0.06, 0.10
"""How far behind the level part of a seat a sitting figure's back is, metres, and how much farther when it leans."""
DEEP, GROWN = 0.68, 0.8
"""Depth from which a seat has cushions to lean on, and a sitting figure legs that reach its front, metres."""


def place_people(house: House, graph: NavGraph, catalogue: Catalogue, *, seed: int) -> dict[int, Placement]:
    """People whom one could meet, by node: somebody in its room, 0.5 to 2 m away, who stands on free floor or sits.

    One person may be met at several nodes. The navigation graph stays valid: everybody keeps the
    walker's radius from its edges, and nobody shuts a room. Figures are tried in a drawn order until
    one fits; nodes without room for anybody are left out.
    """
    figures, chance, used = catalogue.of_class(CLASS), _chances(house, catalogue.of_class(CLASS)), Counter[str]()
    seats = _seats(house, catalogue) if any(map(sits, figures)) else []
    ways = shapely.MultiLineString([graph.positions[list(e), :2].tolist() for e in graph.edges])
    people: list[Placement] = []
    for node in range(len(graph.positions)):
        room = house.room_by_id[graph.room_of_node[node]]
        eye = graph.positions[node, :2]
        if _nearest(people, room, eye) is not None:
            continue
        rng = stream(seed, "person", house.name, node)
        site = _Site(house, room, eye, ways, people)
        who = stream(seed, "person", house.name, node, "who")
        drawn = sorted(figures, key=lambda a: (used[_who(a)], -(who.random() ** (1 / chance[_who(a)]))))
        standing, sitting = list(filter(stands, drawn)), list(filter(sits, drawn))
        sit = rng.random() < SIT
        person = site.sit(sitting, seats) if sit else site.stand(standing, rng)
        person = person or (site.stand(standing, rng) if sit else site.sit(sitting, seats))
        if person is not None:
            people.append(dataclasses.replace(person, id=f"{CLASS}_{len(people) + 1}"))
            used[_who(catalogue.assets[person.asset])] += 1
    people = _passable(house, people)
    met = {
        n: _nearest(people, house.room_by_id[graph.room_of_node[n]], graph.positions[n, :2])
        for n in range(len(graph.positions))
    }
    return {n: p for n, p in met.items() if p is not None}


def _who(asset: Asset) -> str:
    """The person that a figure shows, or its own key where it is no figure of the pack."""
    return person_of(asset.key).id if asset.pack == "people" else asset.key


def _chances(house: House, figures: Sequence[Asset]) -> dict[str, float]:
    """How often one meets somebody, by person."""
    here = {p.id for p in residents(house)}
    return {_who(a): RESIDENT if _who(a) in here else 1.0 for a in figures}


def add_people(house: House, met: Mapping[int, Placement], starts: Iterable[int]) -> House:
    """The house with those of `met` who are met at one of the nodes `starts`."""
    known = {met[n].id for n in starts if n in met}
    people, number = {p.id: p for p in met.values() if p.id in known}, lambda name: int(name.rpartition("_")[2])
    placed = (dataclasses.replace(people[i], id=f"{CLASS}_{k + 1}") for k, i in enumerate(sorted(people, key=number)))
    return dataclasses.replace(house, placements=(*house.placements, *placed))


def stands(asset: Asset) -> bool:
    """True if a figure stands on its own feet; those that sit or lie need something to do it on."""
    return (
        asset.support == "floor"
        and "sitting" not in asset.tags
        and asset.size[2] >= STANDING
        and max(asset.size[:2]) <= 2 * STANDING / 3
    )


def sits(asset: Asset) -> bool:
    """True if a figure sits as one sits on a chair."""
    return "sitting" in asset.tags


@dataclasses.dataclass(frozen=True)
class _Seat:
    """A place where somebody may sit down."""

    placement: Placement
    room: str
    spot: np.ndarray
    """(2,) where the back of somebody who sits upright on it is, metres."""
    deep: bool
    """True if grown people lean back on it."""
    lift: float
    """How much higher than LAP it is, metres; not below 0, feet do not go through floors."""


class _Site:
    """The surroundings of one node, and who finds room in them."""

    def __init__(
        self, house: House, room: Room, eye: np.ndarray, ways: shapely.MultiLineString, people: Sequence[Placement]
    ) -> None:
        around = _disc(eye, 2 * FARTHEST_PERSON)
        self.eye, self.room, self.floor = eye, room, house.storey_of(room).elevation
        self.edges, far = ways.intersection(around), _disc(eye, FARTHEST_PERSON)
        self.ring, self.polite = far.difference(_disc(eye, NEAREST_PERSON)), far.difference(_disc(eye, POLITE))
        self.others = [
            _disc(p.position[:2], PERSONAL_SPACE / 2)
            for p in people
            if math.dist(p.position[:2], eye) < 2 * FARTHEST_PERSON
        ]
        self.open = house.floor(room).intersection(around)
        low = self.floor + 1.8
        self.things = [p for p in house.placements if p.room == room.id and p.position[2] < low and p.size[2] > 0.05]
        """Things that a body would run into: below head height, and higher than a rug."""
        doors = [o for o in house.openings if o.kind == "door" and o.rooms[0] == room.id]
        self.leaves = [leaf for o in doors for leaf in leaves(house, o)]

    def stand(self, figures: Sequence[Asset], rng: np.random.Generator) -> Placement | None:
        """The first figure that finds free floor beside the ways; it looks at the node."""
        free = self.open.difference(shapely.union_all([*map(footprint, self.things), *self.leaves, *self.others]))
        too_wide = math.inf
        for asset in figures:
            body = max(asset.size[:2]) / 2
            if body >= too_wide:
                continue
            stopped = self.edges.buffer(body + AGENT_RADIUS, quad_segs=4)  # where a walker would be
            where = free.buffer(-body, quad_segs=4).intersection(self.ring).difference(stopped)
            if where.area >= ROOM:
                away = where.intersection(self.polite)
                where = away if away.area >= ROOM else where
                break
            too_wide = body
        else:
            return None
        spot = _drawn(where, rng)
        direction = math.atan2(self.eye[1] - spot[1], self.eye[0] - spot[0])
        return self._placed(asset, spot, self.floor, yaw_facing(direction))

    def sit(self, figures: Sequence[Asset], seats: Sequence[_Seat]) -> Placement | None:
        """The first figure that finds a seat with nothing on it and nothing where its legs go."""
        choices = [(seat, asset) for seat in seats if seat.room == self.room.id for asset in figures]
        for seat, asset in choices:
            yaw = seat.placement.yaw
            lean = LEAN if seat.deep and asset.size[1] > GROWN else 0.0
            spot = seat.spot + rotation(yaw) @ np.array([0.0, lean - asset.size[1] / 2])
            body = shapely.Polygon(rectangle(spot[0], spot[1], asset.size[0], asset.size[1], yaw))
            below = self.floor + asset.elevation + asset.size[2]
            taken = [
                *self.leaves,
                *self.others,
                *(footprint(p) for p in self.things if p is not seat.placement and p.position[2] < below),
            ]
            if (
                self.ring.contains(shapely.Point(spot))
                and self.open.buffer(0.02).contains(body)
                and self.edges.distance(body) >= AGENT_RADIUS
                and not any(body.intersects(x) for x in taken)
            ):
                return self._placed(asset, spot, self.floor + seat.lift + asset.elevation, yaw)
        return None

    def _placed(self, asset: Asset, spot: Sequence[float], z: float, yaw: float) -> Placement:
        return Placement(
            id=CLASS,
            asset=asset.key,
            object_class=CLASS,
            room=self.room.id,
            position=rounded((spot[0], spot[1], z)),
            yaw=rounded(yaw),
            size=asset.size,
        )


def _seats(house: House, catalogue: Catalogue) -> list[_Seat]:
    """All places of the height people sit at: one to a chair, three to a sofa."""
    seats = []
    for p in house.placements:
        asset = catalogue.assets.get(p.asset)
        seat = next((s for s in asset.surfaces if s.name == "seat"), None) if asset else None
        if asset is None or seat is None:
            continue
        scale = np.divide(p.size, asset.size)
        lift = seat.z * scale[2] - LAP
        if -SOFT <= lift <= HARD:
            left, right = seat.x0 * scale[0], seat.x1 * scale[0]
            middle, wide = (left + right) / 2, right - left > 2.5 * ELBOWS
            for x in (middle, left + ELBOWS, right - ELBOWS) if wide else (middle,):
                back = np.asarray(p.position[:2]) + rotation(p.yaw) @ np.array([x, seat.y1 * scale[1] + BACK])
                seats.append(_Seat(placement=p, room=p.room, spot=back, deep=p.size[1] > DEEP, lift=max(lift, 0.0)))
    return seats


def _nearest(people: Sequence[Placement], room: Room, eye: np.ndarray) -> Placement | None:
    """Who of a room is nearest to a spot of it, within FARTHEST_PERSON."""
    near = [
        p for p in people if p.room == room.id and NEAREST_PERSON <= math.dist(p.position[:2], eye) <= FARTHEST_PERSON
    ]
    return min(near, key=lambda p: math.dist(p.position[:2], eye), default=None)


def _passable(house: House, people: list[Placement]) -> list[Placement]:
    """Those people who, one after the other, shut nobody off from a room."""
    shut_before = set(unreachable_rooms(house))

    def open_with(some: list[Placement]) -> bool:
        full = dataclasses.replace(house, placements=(*house.placements, *some))
        return set(unreachable_rooms(full)) <= shut_before

    if open_with(people):
        return people
    kept: list[Placement] = []
    while people:  # the longest run that shuts nobody off, and whoever follows it would: more people never open a way
        run = bisect.bisect_left(range(1, len(people) + 1), True, key=lambda n: not open_with([*kept, *people[:n]]))
        kept, people = [*kept, *people[:run]], people[run + 1 :]
    return kept


def _drawn(spots: shapely.Geometry, rng: np.random.Generator) -> tuple[float, float]:
    """A point of an area, drawn evenly; of a very thin one, some point."""
    x0, y0, x1, y1 = spots.bounds
    drawn = shapely.points(rng.uniform((x0, y0), (x1, y1), (256, 2)))
    x, y = next(iter(drawn[shapely.contains(spots, drawn)]), spots.representative_point()).coords[0]
    return float(x), float(y)


def _disc(middle: Sequence[float] | np.ndarray, radius: float) -> shapely.Polygon:
    return shapely.Point(middle).buffer(radius, quad_segs=8)


GONE, MOVED = 0.3, 0.7
"""Share of the small things that are put away, and share of the others that lie elsewhere on the same surface."""
SMALL_THING = 0.6
"""Longest side of small things, metres."""
EDGE, SPOT_TRIES = 0.01, 12


def rearranged(house: House, graph: NavGraph, catalogue: Catalogue, starts: Iterable[int], *, day: int) -> House:
    """The same rooms and furniture, as they look on another day.

    Args:
      starts: nodes where assistants may be met, as those of `embodied.generate.people.add_people`.
      day: which day; 0 is the house itself.
    """
    if day == 0:
        return house
    rng = stream(house.seed, "another day", house.name, day)
    removed = {p.id for p in _small(house) if rng.random() < GONE}
    left = dataclasses.replace(house, placements=tuple(p for p in house.placements if p.id not in removed))
    tidied = _moved(left, catalogue, rng)
    empty = dataclasses.replace(tidied, placements=tuple(p for p in tidied.placements if p.object_class != CLASS))
    if len(empty.placements) == len(tidied.placements):
        return tidied  # nobody was there
    met = place_people(empty, graph, catalogue, seed=int(rng.integers(2**31)))
    return add_people(empty, met, starts)


def _small(house: House) -> list[Placement]:
    """Things that lie about: nothing rests on them, they give no light, and they rest on furniture or on the floor."""
    carry = {p.parent for p in house.placements} | {light.placement for light in house.lights}
    return [
        p
        for p in house.placements
        if p.id not in carry and max(p.size) <= SMALL_THING and p.surface and p.object_class != CLASS
    ]


def _moved(house: House, catalogue: Catalogue, rng: np.random.Generator) -> House:
    """Small things elsewhere on their surface, turned; those that find no free spot stay."""
    there: dict[str, Placement] = {p.id: p for p in house.placements}
    for thing in _small(house):
        top = _surface(there[thing.parent], thing.surface, catalogue) if thing.parent in there else None
        if top is None or rng.random() >= MOVED:
            continue
        others = [
            footprint(p)
            for p in there.values()
            if p.parent == thing.parent and p.surface == thing.surface and p.id != thing.id
        ]
        taken = shapely.union_all(others).buffer(EDGE)
        low, high = np.array(top.bounds[:2]), np.array(top.bounds[2:])
        for _ in range(SPOT_TRIES):
            x, y = rng.uniform(low, high)
            elsewhere = dataclasses.replace(
                thing, position=rounded((x, y, thing.position[2])), yaw=rounded(thing.yaw + rng.uniform(-0.6, 0.6))
            )
            base = footprint(elsewhere)
            if top.contains(base) and not taken.intersects(base):
                there[thing.id] = elsewhere
                break
    return dataclasses.replace(house, placements=tuple(there.values()))


def _surface(carrier: Placement, name: str | None, catalogue: Catalogue) -> shapely.Polygon | None:
    """The part of a carrier's surface that things may lie on, world; None where the catalogue does not know it."""
    asset = catalogue.assets.get(carrier.asset)
    surfaces = [s for s in asset.surfaces if s.name == name] if asset else []
    if asset is None or not surfaces:
        return None
    s, (kx, ky, _) = surfaces[0], np.array(carrier.size) / np.array(asset.size)
    corners = np.array([(s.x0, s.y0), (s.x1, s.y0), (s.x1, s.y1), (s.x0, s.y1)]) * (kx, ky)
    return shapely.Polygon(corners @ rotation(carrier.yaw).T + carrier.position[:2]).buffer(-EDGE)
