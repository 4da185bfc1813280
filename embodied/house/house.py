"""The House: rooms, openings, placements and lights as plain data, with a JSON round trip.

World frame: metres, right-handed, z up, the ground floor's floor at z = 0. Rooms tile the
footprint: a room's polygon runs along the centre lines of its walls, and what one can walk on
is `house.floor(room)`, the polygon shrunk by half an inner wall. Outer walls grow outwards.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import itertools
import json
import math
import re
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from embodied.assets.cache import write_bytes
from embodied.assets.json_file import RecordError, from_plain, parse, shown
from embodied.assets.records import ROOM_KINDS

SCHEMA = 1
"""Version of house.json; a file of another version is refused."""

OPENING_KINDS = ("door", "passage", "front_door", "back_door", "window", "french_window", "garage_door", "roof_window")
WEATHERS = ("clear", "hazy", "overcast")
LANDSCAPES = ("suburb", "village", "street", "roofs", "lake", "fields", "forest")
SEASONS = ("spring", "summer", "autumn", "winter")
HINGED = ("door", "front_door", "back_door")
WINDOWS = ("window", "french_window")
GLAZED = (*WINDOWS, "roof_window")
DOORS = ("door", "passage", "front_door", "back_door", "french_window", "garage_door")
"""Opening kinds that a person can walk through."""


SHORTEST_SIDE, LONGEST_SIDE = 1e-4, 30.0
"""Shortest and longest side an object may have, metres."""
ID = re.compile(r"[\w'.-]+")
"""Form of an id; walls and leaves are named '<id>/<part>', so that it holds no slash."""


class HouseError(RecordError):
    """A house that cannot be: says what was expected, what came and what to do."""


@dataclass(frozen=True)
class Sky:
    """The outdoors seen and felt through the windows."""

    hour: float = 11.0
    """Local solar time, hours in [0, 24)."""
    weather: str = "clear"
    """'clear', 'hazy' or 'overcast'."""
    north: float = math.pi / 2
    """World direction of north, radians counter-clockwise from +x."""
    landscape: str | None = None
    """One of LANDSCAPES; None is drawn from the house's seed, as is the season (embodied.scene.landscapes)."""
    season: str | None = None
    """One of SEASONS."""


@dataclass(frozen=True)
class Storey:
    elevation: float
    """z of its floor, metres."""
    height: float
    """Clear height from floor to ceiling, metres."""


@dataclass(frozen=True)
class Room:
    id: str
    """'<kind>_<number>', unique in the house: 'bedroom_2'."""
    kind: str
    """One of embodied.assets.records.ROOM_KINDS."""
    polygon: tuple[tuple[float, float], ...]
    """Corners counter-clockwise along wall centre lines, metres."""
    floor_finish: str
    """Material key of the catalogue, e.g. 'oak_planks/1'; the same for the next three."""
    wall_finish: str
    ceiling_finish: str
    skirting_finish: str
    accent_wall: int | None = None
    """Index of the polygon edge (corner i to i+1) that has `accent_finish`."""
    accent_finish: str | None = None
    storey: int = 0
    slopes: tuple[tuple[int, float], ...] = ()
    """Edges of the polygon from which the ceiling rises inwards by 45 degrees up to the storey's height, and its height
    over each, metres."""

    @property
    def slope_lines(self) -> list[tuple[np.ndarray, np.ndarray, float]]:
        """A point on the edge under each slope, (2,) metres, the unit way inwards, and the height over it."""
        ring = np.asarray(self.polygon, float)
        ways = np.roll(ring, -1, axis=0) - ring
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        return [(ring[k], np.array([-ways[k, 1], ways[k, 0]]), knee) for k, knee in self.slopes]

    def clear_height(self, most: float, points: np.ndarray) -> np.ndarray:
        """(...,) height of the ceiling over points (..., 2), up to its storey's, metres; slopes run on beyond walls."""
        rising = (knee + (points - at) @ way for at, way, knee in self.slope_lines)
        return functools.reduce(np.minimum, rising, np.full(np.shape(points)[:-1], most))


@dataclass(frozen=True)
class Opening:
    id: str
    kind: str
    """One of OPENING_KINDS."""
    rooms: tuple[str, str | None]
    """The room a door leaf swings into first; None stands for the outdoors."""
    a: tuple[float, float]
    b: tuple[float, float]
    """The two jambs on the wall's centre line, metres."""
    sill: float
    head: float
    """Bottom and top of the hole above the storey's floor, metres; a roof window's are in the slope over its wall."""
    leaf_finish: str | None = None
    """Material key of leaf and frame; None for a bare passage."""
    hinge: str = "a"
    """The jamb, 'a' or 'b', that carries the hinges."""
    angle: float = 0.0
    """How far its leaves, or the casements of a window, stand open, radians; 0 is closed."""

    @property
    def opens(self) -> bool:
        """True for what turns on hinges: doors with leaves, and windows."""
        return self.kind in WINDOWS or (self.kind in HINGED and self.leaf_finish is not None)

    @property
    def casements(self) -> int:
        """How many a window has."""
        wide = 0.85 if self.kind == "french_window" or self.sill < 0.05 else 0.95
        return max(1, min(6, round(math.dist(self.a, self.b) / wide)))


@dataclass(frozen=True)
class Placement:
    """One object in the house."""

    id: str
    """'<object class with underscores>_<number>', unique in the house: 'coffee_table_1'."""
    asset: str
    """Key into the catalogue."""
    object_class: str
    room: str
    position: tuple[float, float, float]
    """World position of the asset's origin (centre of its base), metres."""
    yaw: float
    """Radians counter-clockwise; the front looks along yaw - pi/2 (geometry.facing_of)."""
    size: tuple[float, float, float]
    """Width, depth, height in metres; a uniform or modest rescale of the asset's own size, or
    what a maker of built things is asked for."""
    parent: str | None = None
    """Id of the placement it rests on; None for floor, wall or ceiling."""
    surface: str | None = None
    """Name of the parent's SupportSurface it rests on."""
    params: tuple[tuple[str, str | float], ...] = ()
    """Arguments for built assets, sorted by name: finishes, patterns, seeds."""
    group: str | None = None
    """The functional group that placed it: 'seating_1'."""


@dataclass(frozen=True)
class Light:
    id: str
    room: str
    placement: str | None
    """The lamp it belongs to; None for a bare point light."""
    position: tuple[float, float, float]
    color: tuple[float, float, float]
    """Linear RGB, largest component 1."""
    power: float
    """Lumens."""
    on: bool = True


@dataclass(frozen=True)
class Stair:
    """A straight or turned flight between two storeys."""

    id: str
    rooms: tuple[str, str]
    """The room at its foot and the room at its head."""
    path: tuple[tuple[float, float, float], ...]
    """Centre line from foot to head, metres, world."""
    width: float
    risers: int
    well: tuple[tuple[float, float], ...] = ()
    """Corners, counter-clockwise, of the opening in the floor above, metres; below it, nobody walks. Empty: what the
    flight covers."""
    void: tuple[tuple[float, float], ...] = ()
    """Corners of a further opening in the floor above, around which there is a gallery; below it, one walks."""


@dataclass(frozen=True)
class House:
    """A furnished house as data; immutable, and written to JSON.

    Examples:
      >>> sorted({room.kind for room in house.rooms})
      ['bathroom', 'hall', 'kitchen', 'living_room', 'main_bedroom']
      >>> house.save(Path('house.json'))
    """

    seed: int
    name: str
    storeys: tuple[Storey, ...]
    rooms: tuple[Room, ...]
    openings: tuple[Opening, ...]
    placements: tuple[Placement, ...]
    lights: tuple[Light, ...]
    stairs: tuple[Stair, ...] = ()
    sky: Sky = Sky()
    inner_wall: float = 0.12
    outer_wall: float = 0.32
    """Wall thicknesses, metres."""
    style: str = "light"
    """The palette and style of its furnishing: one of embodied.house.validation.STYLES."""
    disorder: float = 0.4
    """0 is tidy, 1 is thoroughly lived in."""

    def __repr__(self) -> str:
        rooms, things = len(self.rooms), len(self.placements)
        return f"<House {self.name!r}: {rooms} rooms, {self.area:.0f} m2, {things} objects, seed {self.seed}>"

    @functools.cached_property
    def digest(self) -> str:
        """Hex SHA-256 of the canonical JSON: two houses with one digest are the same house."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()

    @functools.cached_property
    def room_by_id(self) -> dict[str, Room]:
        """The rooms by their ids."""
        return {r.id: r for r in self.rooms}

    @functools.cached_property
    def placement_by_id(self) -> dict[str, Placement]:
        """The placements by their ids."""
        return {p.id: p for p in self.placements}

    def storey_of(self, room: Room) -> Storey:
        """The storey that a room is on."""
        return self.storeys[room.storey]

    def floor_height(self, opening: Opening) -> float:
        """z of the floor that an opening is on, metres."""
        return self.storey_of(self.room_by_id[opening.rooms[0]]).elevation

    def floor(self, room: Room) -> shapely.Polygon:
        """Floor between the bare walls of `room`, metres, world."""
        return shapely.Polygon(room.polygon).buffer(-self.inner_wall / 2, join_style="mitre")

    @functools.cached_property
    def area(self) -> float:
        """Sum of the rooms' polygon areas, square metres."""
        return float(sum(shapely.Polygon(r.polygon).area for r in self.rooms))

    def to_json(self) -> str:
        """Canonical JSON: sorted keys, no blanks; without landscape and season if left to the seed, empty voids and
        slopes."""
        body = {"schema": SCHEMA, **dataclasses.asdict(self)}
        body["sky"] = {k: v for k, v in body["sky"].items() if v is not None}
        body["stairs"] = [{k: v for k, v in s.items() if k != "void" or v} for s in body["stairs"]]
        body["rooms"] = [{k: v for k, v in r.items() if k != "slopes" or v} for r in body["rooms"]]
        return json.dumps(body, sort_keys=True, separators=(",", ":"), allow_nan=False)

    @staticmethod
    def from_json(text: str | bytes) -> House:
        """Read what `to_json` wrote.

        Raises:
          HouseError: not JSON, another schema version, unknown or missing fields, wrong types,
            numbers that are not finite, or a house that fails `check`.
        """
        try:
            body = parse(text, "a house")
        except RecordError as e:
            raise HouseError(f"{e}; write it with House.save") from e
        if not isinstance(body, dict) or "schema" not in body:
            raise HouseError("house file has no 'schema' field; write it with House.save")
        if (schema := body.pop("schema")) != SCHEMA:
            raise HouseError(
                f"house file has schema {shown(schema)}, this version reads {SCHEMA}; "
                "generate the house again from its seed"
            )
        try:
            house = from_plain(House, body, "house")
        except RecordError as e:
            raise HouseError(str(e)) from e
        check(house)
        return house

    def save(self, path: Path) -> None:
        """Write to `path` atomically, indented for people."""
        text = json.dumps(json.loads(self.to_json()), indent=1)
        write_bytes(Path(path), (text + "\n").encode())

    @staticmethod
    def load(path: Path) -> House:
        """Read a house.json; raises HouseError with the file's name."""
        try:
            return House.from_json(Path(path).read_bytes())
        except FileNotFoundError as e:
            raise FileNotFoundError(
                f"{path} does not exist; make one with `embodied house --seed 7 --out {Path(path).parent}`"
            ) from e
        except HouseError as e:
            raise HouseError(f"{path}: {e}") from e


def check(house: House) -> None:
    """Refuse a house that cannot be.

    Raises:
      HouseError: duplicate or dangling ids, unknown kinds, numbers out of range, overlapping rooms,
        a room without a door or cut off from the others, an opening that is on no shared wall, a
        window between rooms, overlapping openings, an object outside its room.
    """
    for wrong in _complaints(house):
        raise HouseError(wrong)


def _complaints(house: House) -> Iterator[str]:
    """Complaints about a house. Each check assumes that the earlier ones found nothing: only the first complaint may
    be used."""
    yield from _check_numbers(house)
    yield from _check_ids(house)
    yield from _check_storeys(house)
    polygons = {}
    for room in house.rooms:
        polygon = shapely.Polygon(room.polygon if len(room.polygon) > 2 else ())
        if not polygon.is_valid or polygon.area < 0.5 or not shapely.is_ccw(polygon.exterior):
            yield f"room {room.id!r} needs a simple counter-clockwise polygon of at least 0.5 m2, got {room.polygon}"
        polygons[room.id] = polygon
    yield from _check_slopes(house)
    yield from _check_overlaps(house, polygons)
    yield from _check_openings(house, polygons)
    yield from _check_walls(house, polygons)
    yield from _check_reach(house)
    for p in house.placements:
        yield from _check_place(house, polygons, f"object {p.id!r} stands", p.room, p.position)
        yield from _check_size(house, polygons, p)
    for x in house.lights:
        yield from _check_place(house, polygons, f"light {x.id!r} shines", x.room, x.position)


def _check_place(
    house: House, polygons: dict[str, shapely.Polygon], what: str, room: str, position: tuple[float, float, float]
) -> Iterator[str]:
    """Refuse what is outside its room, by more than a wall or half a metre of height."""
    storey, above = house.storey_of(house.room_by_id[room]), 0.5
    if not storey.elevation - above <= position[2] <= storey.elevation + storey.height + above:
        yield f"{what} at {position} below or above its room {room!r}; change its height"
    if polygons[room].distance(shapely.Point(position[:2])) > house.outer_wall:
        yield f"{what} at {position} outside its room {room!r}; move it inside or name the room it is in"


def _check_size(house: House, polygons: dict[str, shapely.Polygon], p: Placement) -> Iterator[str]:
    """Refuse an object that no placing would fit into its room."""
    x0, y0, x1, y1 = polygons[p.room].bounds
    longest, height = math.hypot(x1 - x0, y1 - y0), house.storey_of(house.room_by_id[p.room]).height
    if max(p.size[:2]) > longest + house.outer_wall or p.size[2] > height + 0.5:
        yield (
            f"object {p.id!r} of {p.size} m does not fit into its room {p.room!r}, {longest:.1f} m from corner to "
            f"corner and {height:.2f} m high; make it smaller"
        )


def _check_storeys(house: House) -> Iterator[str]:
    if not house.storeys or any(not 1.8 <= s.height <= 20 for s in house.storeys):
        yield f"a house needs storeys of 1.8 to 20 m clear height, got {house.storeys}"
    for k, (below, above) in enumerate(itertools.pairwise(house.storeys)):
        if above.elevation < below.elevation + below.height - 1e-6:
            yield (
                f"storey {k + 1} begins at {above.elevation} m, below the ceiling of storey {k} at "
                f"{below.elevation + below.height} m; list storeys from the ground up, each above the one before"
            )
    if empty := sorted(set(range(len(house.storeys))) - {r.storey for r in house.rooms}):
        yield f"the storeys {empty} have no room; put a room on each (Room.storey) or drop them"


def _check_slopes(house: House) -> Iterator[str]:
    for room in (r for r in house.rooms if r.slopes):
        edges, high = sorted(k for k, _ in room.slopes), house.storey_of(room).height
        below, pairs = room.storey + 1 < len(house.storeys), ([0], [1], [2], [3], [0, 2], [1, 3])
        if below or len(room.polygon) != 4 or edges not in pairs:
            yield (
                f"room {room.id!r} has slopes over its edges {edges}; it should be a rectangle on the highest storey, "
                "with one or two opposite ones"
            )
        at, way, _ = room.slope_lines[0]
        deep = np.max((np.array(room.polygon) - at) @ way)
        if not all(0 < k < high for _, k in room.slopes) or sum(high - k for _, k in room.slopes) > deep:
            yield f"slopes of room {room.id!r} should begin below {high} m and not meet, got {room.slopes}"


def _check_numbers(house: House) -> Iterator[str]:
    sky = house.sky
    if not 0 <= house.disorder <= 1:
        yield f"disorder should lie between 0 and 1, got {house.disorder}"
    if not 0 < house.inner_wall < 1 or not house.inner_wall <= house.outer_wall < 2:
        yield f"walls should be 0 < inner <= outer metres thick, got {house.inner_wall} and {house.outer_wall}"
    if sky.weather not in WEATHERS or not 0 <= sky.hour < 24:
        yield f"sky should have a weather of {WEATHERS} and an hour in [0, 24), got {sky}"
    if sky.landscape not in (None, *LANDSCAPES) or sky.season not in (None, *SEASONS):
        yield f"sky should have a landscape of {LANDSCAPES} and a season of {SEASONS}, or leave them out, got {sky}"
    numbers = [(p.id, (*p.position, p.yaw, *p.size)) for p in house.placements]
    numbers += [(x.id, (*x.position, *x.color, x.power)) for x in house.lights]
    numbers += [(o.id, (*o.a, *o.b, o.sill, o.head, o.angle)) for o in house.openings]
    for name, values in numbers:
        if not all(map(math.isfinite, values)):
            yield f"{name!r} has a number that is not finite: {values}"
    for p in house.placements:
        if not all(SHORTEST_SIDE <= s <= LONGEST_SIDE for s in p.size):
            yield (
                f"object {p.id!r} has the size {p.size}; all three must be positive, at least {SHORTEST_SIDE} and "
                f"at most {LONGEST_SIDE:.0f} m"
            )
    for x in house.lights:
        if x.power < 0 or not all(0 <= c <= 1 for c in x.color):
            yield f"light {x.id!r} should have a power of at least 0 and a colour in [0, 1], got {x.power}, {x.color}"


def _check_ids(house: House) -> Iterator[str]:
    for what in ("rooms", "openings", "placements", "lights", "stairs"):
        ids = [x.id for x in getattr(house, what)]
        if len(set(ids)) < len(ids):
            twice = sorted({i for i in ids if ids.count(i) > 1})
            yield f"{what} share the ids {twice}; every id must be unique"
        if bad := [i for i in ids if not ID.fullmatch(i)]:
            yield f"{what} have the ids {bad}; an id is made of letters, digits and _ - . '"
    if not house.rooms:
        yield "a house needs at least one room, got none"
    rooms = set(house.room_by_id)
    for r in house.rooms:
        if not 0 <= r.storey < len(house.storeys):
            yield f"room {r.id!r} is on storey {r.storey}, the house has {len(house.storeys)}"
        if r.kind not in ROOM_KINDS:
            yield f"room {r.id!r} has the unknown kind {r.kind!r}; use one of {ROOM_KINDS}"
        if r.accent_wall is not None and len(r.polygon) > 2 and not 0 <= r.accent_wall < len(r.polygon):
            yield f"room {r.id!r} has the accent wall {r.accent_wall}; its walls are 0 to {len(r.polygon) - 1}"
    places = [*((p.id, p.room) for p in house.placements), *((x.id, x.room) for x in house.lights)]
    for name, room in places:
        if room not in rooms:
            yield f"{name!r} names the unknown room {room!r}; rooms are {sorted(rooms)}"
    for x in house.lights:
        if x.placement is not None and x.placement not in house.placement_by_id:
            yield f"light {x.id!r} belongs to the unknown object {x.placement!r}; place that lamp or name none"
    for s in house.stairs:
        if not set(s.rooms) <= rooms or len(s.path) < 2 or s.width <= 0 or s.risers < 1:
            yield (
                f"stair {s.id!r} should join two of the rooms {sorted(rooms)} by a path of two points or more, got {s}"
            )
    for p in house.placements:
        if p.parent is not None and p.parent not in house.placement_by_id:
            yield f"object {p.id!r} rests on the unknown object {p.parent!r}"
        seen = {p.id}
        above = p
        while above.parent is not None:
            above = house.placement_by_id.get(above.parent, p)
            if above.id in seen:
                yield f"object {p.id!r} rests on itself, through {sorted(seen)}"
            seen.add(above.id)


def _check_overlaps(house: House, polygons: dict[str, shapely.Polygon]) -> Iterator[str]:
    tree = shapely.STRtree([polygons[r.id] for r in house.rooms])
    for i, room in enumerate(house.rooms):
        for j in sorted(tree.query(polygons[room.id])):
            other = house.rooms[j]
            if j <= i or other.storey != room.storey:
                continue
            shared = polygons[room.id].intersection(polygons[other.id]).area
            if shared > 1e-3:
                yield f"rooms {room.id!r} and {other.id!r} overlap by {shared:.3f} m2"


def _check_openings(house: House, polygons: dict[str, shapely.Polygon]) -> Iterator[str]:
    has_door = {end for s in house.stairs for end in s.rooms}
    for o in house.openings:
        if o.kind not in OPENING_KINDS:
            yield f"opening {o.id!r} has the unknown kind {o.kind!r}; use one of {OPENING_KINDS}"
        segment = shapely.LineString([o.a, o.b])
        for name in o.rooms:
            if name is None:
                continue
            if name not in polygons:
                yield f"opening {o.id!r} names the unknown room {name!r}"
            if not polygons[name].exterior.buffer(1e-3).covers(segment):
                yield f"opening {o.id!r} does not lie on a wall of room {name!r}"
            if o.kind in DOORS:
                has_door.add(name)
        if not 0 <= o.sill < o.head:
            yield f"opening {o.id!r} needs 0 <= sill < head, got {o.sill} and {o.head}"
    for room in house.rooms:
        if room.id not in has_door:
            yield f"room {room.id!r} has no door; every room needs one, add an Opening or drop the room"


def _check_walls(house: House, polygons: dict[str, shapely.Polygon]) -> Iterator[str]:
    """Openings to the outdoors on outer walls only, doors between two rooms of one storey, none through another."""
    tree = shapely.STRtree([polygons[r.id] for r in house.rooms])
    lines = [shapely.LineString([o.a, o.b]) for o in house.openings]
    for o, line in zip(house.openings, lines):
        first = house.room_by_id[o.rooms[0]]
        if line.length < 0.2:
            yield f"opening {o.id!r} is {line.length:.2f} m wide; at least 0.2 m is needed"
        high, rooms = house.storey_of(first).height, (house.room_by_id[r] for r in o.rooms if r is not None)
        over = min(r.clear_height(high, np.array([o.a, o.b])).min() for r in rooms)
        if o.kind == "roof_window" and not over < o.sill < o.head < high:
            yield f"roof window {o.id!r} should lie within a slope over its wall, got heights {o.sill} to {o.head}"
        if o.kind != "roof_window" and o.head > over + 1e-6:
            yield f"opening {o.id!r} reaches {o.head} m, its storey is {over:.2f} m high there"
        if o.hinge not in ("a", "b") or not 0 <= o.angle <= math.pi:
            yield f"opening {o.id!r} needs a hinge 'a' or 'b' and an angle in [0, pi], got {o.hinge!r}, {o.angle}"
        if o.rooms[1] is not None:
            if o.rooms[0] == o.rooms[1] or house.room_by_id[o.rooms[1]].storey != first.storey:
                yield f"opening {o.id!r} should join two rooms of one storey, got {o.rooms}"
            if o.kind not in ("door", "passage"):
                yield f"{o.kind} {o.id!r} should lead outdoors, it lies between the rooms {o.rooms}"
            continue
        for j in sorted(tree.query(line.buffer(1e-3))):
            other = house.rooms[j]
            if (
                other.id != first.id
                and other.storey == first.storey
                and polygons[other.id].buffer(1e-3).intersection(line).length > 0.01
            ):
                yield f"{o.kind} {o.id!r} should lead outdoors, behind its wall lies room {other.id!r}"
    near = shapely.STRtree(lines)
    for i, o in enumerate(house.openings):
        for j in sorted(near.query(lines[i].buffer(1e-3))):
            other = house.openings[j]
            same = house.room_by_id[o.rooms[0]].storey == house.room_by_id[other.rooms[0]].storey
            if (
                j > i
                and same
                and lines[i].buffer(1e-3).intersection(lines[j]).length > 0.01
                and (min(o.head, other.head) > max(o.sill, other.sill))
            ):
                yield f"openings {o.id!r} and {other.id!r} overlap; move one along the wall"


def _check_reach(house: House) -> Iterator[str]:
    """Every room can be reached from the first one through doors and stairs."""
    ways = [{*o.rooms} - {None} for o in house.openings if o.kind in DOORS] + [{*s.rooms} for s in house.stairs]
    reached: set[str | None] = {house.rooms[0].id}
    while new := {room for way in ways if way & reached for room in way - reached}:
        reached |= new
    if lost := [r.id for r in house.rooms if r.id not in reached]:
        yield f"rooms {lost} cannot be reached from {house.rooms[0].id!r} through doors; add one"


def rounded(value: typing.Any, digits: int = 4) -> typing.Any:
    """`value` (number, tuple, array) with floats rounded, so that digests agree across machines."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return tuple(rounded(v, digits) for v in value)
    if isinstance(value, (float, np.floating)):
        return round(float(value), digits) + 0.0
    return value
