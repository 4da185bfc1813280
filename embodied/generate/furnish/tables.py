"""The tables of furniture: roles, groups, rooms and small things, read from TOML files; a user's own file adds to them.

groups.toml, rooms.toml and smalls.toml beside this module hold what ships; `groups.toml` in a folder of a user's own
models holds more of the same (docs/houses.md).
"""

from __future__ import annotations

import difflib
import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.assets.json_file import RecordError, from_plain, read_toml
from embodied.assets.records import Size
from embodied.generate.furnish.likes import LIKES
from embodied.house.house import HouseError

FILES = ("groups.toml", "rooms.toml", "smalls.toml")
BUILT = ("kitchen_line",)
"""Groups that code arranges (kitchen.py)."""
PLACES = ("wall", "floor", "open", "middle", "door", "ahead")
AT = ("wall", "on", "under", "about", "before", "beside", "over", "facing", "seats", "row")
PER = ("room", "carrier", "person", "adult", "child", "young")


@dataclass(frozen=True)
class GroupPart:
    """One kind of thing in a group. Tuples of numbers have a value for each round, the last one for all that follow."""

    # the thing itself
    role: str
    """A role, or a class of object; empty where the rule says it."""
    name: str = ""
    """Its name for rules and small things, besides its class; its class if empty. Other parts call it so or, if it
    is empty, by its role."""
    other: tuple[str, ...] = ()
    """Roles to choose from where the catalogue has none of `role` that fits."""
    least: Size = (0.0, 0.0, 0.0)
    most: Size = (99.0, 99.0, 99.0)
    narrowest: tuple[float, ...] = ()
    widest: tuple[float, ...] = ()
    deepest: tuple[float, ...] = ()
    fits: bool = False
    """It is no wider than `of`."""
    tags: tuple[str, ...] = ()
    """It has one of these tags."""
    allow_duplicate: bool = False
    """The same model may stand in the room already."""
    same: float = 0.0
    """Chance that it is the model of the last thing of its name in the room."""

    # its size, if that is not its model's own
    width: float | None = None
    """Its width, whatever its model's; so are `depth` and `height`."""
    depth: float | None = None
    height: float | None = None
    wider: float | None = None
    """Its width is that of `of` and so much more; `deeper` likewise. `least` and `most` bound it."""
    deeper: float | None = None
    of_room: tuple[float, float] | None = None
    """Its width and depth, as shares of the longer and the shorter side of the room."""
    long: bool = False
    """Its longer side is its width, however its model is turned."""

    # its place in the group, and its turn
    at: str = "wall"
    """Its place: the first part to the "wall"; others "on", "under", "before", "beside" or "over" (above it, at
    the wall) the part `of`, "about" on its area, "facing" it from across the room, on "seats" around it, or in a
    "row" before it."""
    of: str = ""
    """Name of the part that it goes by; the first if empty."""
    side: str = "right"
    """Of `of`: "right", "left" or "both". Which is which is drawn for every group."""
    gap: float = 0.0
    """Free space between the two, metres."""
    forward: float = 0.0
    """How much nearer to the front of `of` (of a first part: to the room) it is, metres."""
    flush: bool = False
    """Its back is in line with that of `of`, instead of its middle."""
    off_middle: float = 0.0
    """How far aside it stands on a surface, as a share of its width."""
    z: float | None = None
    """Height of its underside above the floor, metres; None for its own."""
    position_jitter: float = 0.0
    """It stands up to so far from its place, metres."""
    turn: float = 0.0
    """Degrees; on the right toward the middle."""
    angle_jitter: float = 0.0
    """It is turned by up to so many degrees more."""
    turn_any: bool = False
    """It is turned anyhow, if its base is about square or it lies about."""
    straight: bool = False
    """It is not turned with `of`."""
    look: bool = False
    """Its front looks at `of`."""

    # conditions under which it is there, and how often
    optional: bool = False
    """It is left out where it does not fit, instead of giving the group up."""
    must: tuple[int, ...] = ()
    """How many of it must find a place; all if empty, none if `optional`."""
    needs: str = ""
    """Part without which it is left out as well."""
    instead_of: str = ""
    """It is only there if the part of this name is not."""
    count: tuple[int, ...] = ()
    """How many at most; one, on both sides two, where empty."""
    more: int = 0
    """Up to so many more, drawn."""
    every: float = 0.6
    """Distance of the things of a row, metres."""
    chance: float = 1.0
    kinds: tuple[str, ...] = ()
    """Only in these kinds of room."""
    lower_than: float = 99.0
    """Only if the upper edge of `of` is lower, metres."""

    # free space around it
    clear: tuple[float, ...] = ()
    """Depth before its front that nothing may fill but what is `under` it, metres; negative: behind its back. From 0.5
    m on, somebody must be able to stand there."""
    aisle: float = 0.0
    """Depth that stays free beyond it, before a part that it faces, metres."""
    under: bool = False
    """It may be pushed under `of`."""
    passage: bool = False
    """It may lie in doorways (mats and rugs)."""

    def __post_init__(self) -> None:
        _one_of("at", self.at, AT)
        _one_of("side", self.side, ("right", "left", "both"))

    @property
    def called(self) -> str:
        return self.name or self.role


@dataclass(frozen=True)
class FurnitureGroup:
    """A small arrangement of things that finds its place as a whole."""

    parts: tuple[GroupPart, ...]
    """The first one is at its heart."""
    name: str = ""
    """Its name in placements; its key in the table if empty."""
    place: str = "wall"
    """Its back to the "wall"; anywhere on the "floor"; "open": in the middle if it is large, else at a wall; in the
    "middle"; inside the front "door"; "ahead" of the things `near`, facing the way they do."""
    likes: Mapping[str, float] = field(default_factory=dict)
    """Reasons for a place, with weights: "corner", "centre" of a free stretch of wall, before a "window", in its
    "shade" (something tall before a window), a "window_wall", a wall with a "door", "near" the things `near`,
    "near_window", "near_door", "far_from_door", a "neighbour" of the same name, the part that faces it "across" the
    room at the opposite wall, much "room_before" it, "facing_door" (a door opposite), the "middle" of the room, along
    its "long" side, and "noise" (0.35 if left out)."""
    near: tuple[str, ...] = ()
    """Names or classes of things in the room."""
    gap: float = 0.02
    """Free strip at the wall, or to what it is ahead of, metres."""
    margin: tuple[float, ...] = (0.0,)
    """Free width on either side, metres."""
    step: float = 0.25
    """Between places that are looked at, metres."""
    turns: int = 2
    """How many ways it may face on the floor: 2 or 4."""
    rounds: int = 1
    """How often it is tried, with the values of each round."""
    tries: int = 30
    """Best places that are tried in a round."""
    distance: tuple[float, float] = (0.0, 0.0)
    """Least and most free space between the first part and one that faces it, metres."""

    def __post_init__(self) -> None:
        _one_of("place", self.place, PLACES)
        for word in self.likes:
            _one_of("likes", word, tuple(w for w in LIKES if w != "ahead"))
        if not self.parts:
            raise RecordError("a group needs at least one part")
        known = {p.called for p in self.parts}
        for p in self.parts:
            for name in filter(None, (p.of, p.needs, p.instead_of)):
                _one_of(f"part {p.called!r} names a part that", name, tuple(known))


@dataclass(frozen=True)
class PlacementRule:
    """One line of what a room gets: a group or choice of that name, or several rules, under conditions."""

    # conditions under which it is tried
    chance: float = 1.0
    """Probability that it is tried, where all that follows allows it."""
    above: float = 0.0
    """Only in rooms with a larger floor, square metres."""
    upto: float = 1e9
    """Only in rooms with no larger floor, square metres."""
    wider: float = 0.0
    """Only in rooms whose shorter side is longer, metres."""
    kinds: tuple[str, ...] = ()
    """Only in these kinds of room."""
    not_kinds: tuple[str, ...] = ()
    with_rooms: tuple[str, ...] = ()
    """Only in houses that have one of these kinds of room."""
    without_rooms: tuple[str, ...] = ()
    """Only in houses that have none of them."""
    has: tuple[str, ...] = ()
    """Only if something of one of these names stands in the room."""
    lacks: tuple[str, ...] = ()
    """Only if nothing of these names does."""
    from_attempt: int = 0
    """Only if the room has been tried so often without success."""
    upto_attempt: int = 99

    # what it gets
    group: str = ""
    role: str = ""
    """Role of the first part."""
    roles: tuple[str, ...] = ()
    """Roles for each of which the rule is made."""
    clear: float | None = None
    """Of the first part, as are `most` and `allow_duplicate`."""
    most: Size | None = None
    allow_duplicate: bool = False
    near: tuple[str, ...] = ()
    """Names or classes that the group is near."""
    first: tuple[PlacementRule, ...] = ()
    """Rules of which the first that finds a place is fulfilled."""
    all: tuple[PlacementRule, ...] = ()
    """Rules that are all tried."""
    either: tuple[PlacementRule, ...] = ()
    """Two rules: the first with the chance `odds`, else the second."""
    odds: float = 0.5
    name: str = ""
    """By which the `unless` of a later rule refers to it."""
    unless: str = ""
    """Only if the rule of this name found no place."""
    times: tuple[int, int] = (1, 1)
    """How often: drawn evenly between the two."""
    per_area: float = 0.0
    """And once more for every so many square metres."""

    def __post_init__(self) -> None:
        if bool(self.group) + bool(self.first) + bool(self.all) + bool(self.either) != 1:
            raise RecordError("a rule has either a group, or first, all or either")
        if self.either and len(self.either) != 2:
            raise RecordError(f"either wants two rules, got {len(self.either)}")


@dataclass(frozen=True)
class Need:
    """A thing that a room should not lack."""

    roles: tuple[str, ...]
    """Things of any of these names meet it."""
    classes: tuple[str, ...] = ()
    """Object classes (or roles) that meet it in a finished house, which is drawn anew over it only where some are
    named."""


@dataclass(frozen=True)
class RoomSpec:
    """How one kind of room is furnished."""

    rules: tuple[PlacementRule, ...] = ()
    """Furniture that makes the room, in the order in which it claims its place; those of a user's own file follow."""
    extras: tuple[PlacementRule, ...] = ()
    """Furniture that it gets after that."""
    needs: tuple[Need, ...] = ()
    """Most important first: a room is tried again, in its house, while it lacks one."""
    fill: float = 0.0
    """Share of the floor that furniture should stand on."""
    fillers: tuple[PlacementRule, ...] = ()
    """Rules of which one is drawn, evenly, until `fill` is reached."""


@dataclass(frozen=True)
class SmallObject:
    """One kind of small thing, and where the people of a house put it or leave it."""

    put: str
    """A role, or a class of object."""
    on: tuple[str, ...] = ()
    """Names or classes of what carries it; on none it lies on the floor."""
    count: float = 1.0
    """How many, in the mean."""
    per: str = "room"
    """Unit of `count`: "room", "carrier", "person" who uses the room, "adult", "child", "young" (under seven)."""
    mess: bool = False
    """Left where it was used: more of it in untidy houses, none in the tidiest."""
    habit: str = ""
    """Only who has this habit has it (embodied.house.household)."""
    spot: str = "any"
    """Place on its carrier: "any", "back", "front", "side" or "centre"."""
    turn: float = 0.4
    """It is turned by up to so much either way, radians; 3 or more for any way."""
    near: tuple[str, ...] = ()
    """Names or classes that it keeps close to; on the floor nothing lies without them."""
    wall: float | None = None
    """It hangs, its upper edge so high, metres, or as high as the ceiling allows."""
    kinds: tuple[str, ...] = ()
    """Only in these kinds of room; in all where its list is used if empty."""
    most: int = 4
    """Of its class in one room, where `at_most` does not allow more."""

    def __post_init__(self) -> None:
        _one_of("per", self.per, PER)
        _one_of("spot", self.spot, ("any", "back", "front", "side", "centre"))


@dataclass(frozen=True)
class Style:
    """One house's style; words are matched against an asset's colours, materials, name and tags."""

    favours: tuple[str, ...]
    shuns: tuple[str, ...]
    tidiness: float = 0.6
    """0 is lived in, 1 is a show flat; scales how many small things lie about."""
    warmth: float = 0.5
    """Colour of its lamps: 0 neutral white, 1 warm white."""


@dataclass(frozen=True)
class Tables:
    """All tables; each is keyed by name."""

    roles: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Role to the object classes that can play it; a class is its own role."""
    groups: Mapping[str, FurnitureGroup] = field(default_factory=dict)
    choices: Mapping[str, PlacementRule] = field(default_factory=dict)
    """Rules that others refer to like groups."""
    rooms: Mapping[str, RoomSpec] = field(default_factory=dict)
    """Kind of room to its furniture."""
    smalls: Mapping[str, tuple[SmallObject, ...]] = field(default_factory=dict)
    """Lists of small things."""
    lies_in: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Kind of room to the lists whose things are there, besides those of the list "everywhere"."""
    shelves: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Kind of room to the roles of what stands on its shelves; "any" for those that are not named."""
    at_most: Mapping[str, int] = field(default_factory=dict)
    """Object class to how many of it one room may hold on its surfaces; 2 for the others."""
    grown_up: tuple[str, ...] = ()
    """Classes that children's rooms lack."""
    hung: tuple[SmallObject, ...] = ()
    """Things that hang on walls before pictures do."""
    centrepieces: tuple[str, ...] = ()
    """Roles of what stands in the middle of dining tables."""
    kinds: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """A word for something to the kinds of room that have it: "curtains", "radiators", "art", ..."""
    alike: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """A word to the object classes and roles that it fits: "shelves", "cut to size", "below pictures", ..."""
    seats: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Object class to the width of its arms in metres and the share of its depth that back or pillows take."""
    lumens: Mapping[str, float] = field(default_factory=dict)
    """Object class to the flux of its bulbs."""
    styles: Mapping[str, Style] = field(default_factory=dict)
    """Name of a style (embodied.house.validation.STYLES) to what its owner prefers."""

    def classes(self, role: str) -> tuple[str, ...]:
        """The object classes that can play a role."""
        return self.roles.get(role, (role,))

    def style(self, name: str, disorder: float, *, rng: np.random.Generator) -> Style:
        """The style called `name` (House.style), for one house of that disorder.

        Raises:
          HouseError: an unknown style.
        """
        if name not in self.styles:
            raise HouseError(f"the house has the unknown style {name!r}; use one of {tuple(self.styles)}")
        return replace(self.styles[name], tidiness=1.0 - disorder, warmth=float(rng.uniform(0.2, 1.0)))


def _one_of(what: str, word: str, known: tuple[str, ...]) -> None:
    if word not in known:
        raise RecordError(f"{what} should be one of {known}, got {word!r}")


@functools.cache
def tables(own: tuple[Path, ...] = ()) -> Tables:
    """The tables that ship, with what the files `own` add.

    Groups, choices and roles of the same name are replaced; rules, extras, fillers, needs and small things go after
    those that are there.

    Raises:
      RecordError: a file is no such table; names the file, the entry, what was expected and what came.
    """
    plain: dict[str, Any] = {}
    for path in (*(Path(__file__).with_name(name) for name in FILES), *own):
        added = read_toml(path)
        try:
            plain = _joined(plain, added)
            plain = {section: _alike(section, entries) for section, entries in plain.items()}
            furniture = from_plain(Tables, plain, "furniture") if path.name == FILES[-1] or path in own else None
            if furniture is not None:
                _check(furniture)
        except (ValueError, OSError) as e:  # what TOML and the decoder find wrong are ValueErrors
            raise RecordError(f"{path}: {e}") from e
    assert furniture is not None  # FILES is not empty
    return furniture


def tables_of(catalogue: Catalogue) -> Tables:
    """The tables that houses of a catalogue are furnished by.

    Raises:
      RecordError: a user's own file is none, or asks for what the catalogue does not have.
    """
    furniture = tables(catalogue.groups)
    for path in catalogue.groups:
        known, plain = {*furniture.roles, *catalogue.classes}, read_toml(path)
        for name in plain.get("groups", {}):
            for role in (r for p in furniture.groups[name].parts for r in (p.role, *p.other) if r):
                if role not in known:
                    near = difflib.get_close_matches(role, sorted(known), 3) or "a role of [roles] or a class"
                    raise RecordError(f"{path}: groups.{name} asks for {role!r}, which is not there; use {near}")
    return furniture


def _joined(plain: dict[str, Any], added: dict[str, Any], depth: int = 0) -> dict[str, Any]:
    """Tables as TOML gives them, and others after them; lists of rooms and of small things are continued."""
    whole = dict(plain)
    for name, value in added.items():
        there = whole.get(name)
        if isinstance(value, list) and isinstance(there, list):
            whole[name] = [*there, *value]
        elif isinstance(value, dict) and isinstance(there, dict):
            continued = name in ("rooms", "smalls") or depth
            whole[name] = _joined(there, value, depth + 1) if continued else there | value
        else:
            whole[name] = value
    return whole


def _check(furniture: Tables) -> None:
    known = tuple(sorted({*furniture.groups, *furniture.choices, *BUILT}))
    if twice := sorted({*furniture.groups} & {*furniture.choices}):
        raise RecordError(f"{twice} are both groups and choices; give them names of their own")
    rules = {f"rooms.{kind}": (*p.rules, *p.extras, *p.fillers) for kind, p in furniture.rooms.items()}
    rules |= {f"choices.{name}": (rule,) for name, rule in furniture.choices.items()}
    for place, some in rules.items():
        for name in (name for rule in some for name in groups_of(rule)):
            _one_of(f"the group of a rule of {place}", name, known)
    for name in furniture.choices:
        _refuse_circle(furniture, name, ())
    for kind, names in furniture.lies_in.items():
        for name in names:
            _one_of(f"a list in lies_in.{kind}", name, tuple(furniture.smalls))


def groups_of(rule: PlacementRule) -> Iterator[str]:
    """Names of all groups and choices of a rule and of those in it."""
    if rule.group:
        yield rule.group
    for other in (*rule.first, *rule.all, *rule.either):
        yield from groups_of(other)


def _refuse_circle(furniture: Tables, name: str, above: tuple[str, ...]) -> None:
    if name in above:
        raise RecordError(f"the choice {name!r} leads back to itself")
    for other in groups_of(furniture.choices[name]) if name in furniture.choices else ():
        _refuse_circle(furniture, other, (*above, name))


def _alike(section: str, entries: Any) -> Any:
    """Groups and rooms that are `like` others, written out."""
    if section not in ("groups", "rooms") or not isinstance(entries, dict):
        return entries
    return {name: _written_out(entries, name, ()) for name in entries}


def _written_out(entries: dict[str, Any], name: str, above: tuple[str, ...]) -> Any:
    entry = entries[name]
    if not isinstance(entry, dict) or "like" not in entry:
        return entry
    like = entry["like"]
    if like in (*above, name) or like not in entries:
        raise RecordError(f"{name!r} is like {like!r}, which is not there or like {name!r} itself")
    base = _written_out(entries, like, (*above, name))
    merged = {"name": like, **base} if "parts" in base else dict(base)
    merged |= {k: v for k, v in entry.items() if k not in ("like", "without", "parts")}
    if "parts" in base:
        merged["parts"] = _parts(base["parts"], entry.get("parts", []), entry.get("without", ()))
    return merged


def _parts(base: list[dict[str, Any]], own: list[dict[str, Any]], without: Sequence[str]) -> list[dict[str, Any]]:
    """Parts of which those of the same name are replaced, and the first one by a first one."""
    new = {_called(p, k): p for k, p in enumerate(own)}
    heart = next((p for p in own if p.get("at", "wall") == "wall"), None)
    kept = [heart or base[0], *(new.pop(_called(p, 1), p) for p in base[1:] if _called(p, 1) not in without)]
    return [*kept, *(p for p in new.values() if p is not heart)]


def _called(part: dict[str, Any], k: int) -> str:
    return str(part.get("name") or part.get("role") or k)
