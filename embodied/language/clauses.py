"""Meaning of a route instruction, clause by clause, before anybody puts it into words."""

from dataclasses import dataclass

LEFT, RIGHT = "left", "right"
UP, DOWN = "up", "down"


@dataclass(frozen=True)
class Referent:
    """Something that is spoken of: any object of one of `classes` that has all of `words`."""

    classes: tuple[str, ...]
    """Object classes that the noun may stand for, ascending."""
    words: tuple[str, ...] = ()
    """Colour and material words, ascending."""


@dataclass(frozen=True)
class OfRoom:
    """A clause that names a kind of room."""

    kind: str


@dataclass(frozen=True)
class OfThing:
    """A clause that names a thing."""

    thing: Referent


@dataclass(frozen=True)
class Turn:
    """Turn on the spot before the next step."""

    side: str
    """LEFT or RIGHT; either for turning back."""
    angle: int = 90
    """Degrees: 45 slightly, 90, or 180 for turning back."""


class Exit(OfRoom):
    """Walk out of the room one is in."""


@dataclass(frozen=True)
class Enter(OfRoom):
    """Walk into a room of this kind."""

    side: str | None = None
    """LEFT or RIGHT of the way walked, where doors are counted."""
    nth: int = 0
    """Through which of the doors on that side, counted along the way from 1; 0 where nobody counts."""


@dataclass(frozen=True)
class OpenDoor(OfRoom):
    """Open a closed door and walk into the room behind it."""

    side: str | None = None
    """LEFT or RIGHT of the way walked, where one turns to it."""


@dataclass(frozen=True)
class Climb:
    """Walk along the stairs to the next floor."""

    way: str
    """UP or DOWN."""
    half: bool = False
    """Only to where the stairs turn."""


class Cross(OfRoom):
    """Walk on through the room one is in."""


@dataclass(frozen=True)
class Forward:
    """Walk straight on for a while."""


@dataclass(frozen=True)
class Metres:
    """Walk straight on for about this far."""

    count: int


class To(OfThing):
    """Walk up to something."""


@dataclass(frozen=True)
class Past(OfThing):
    """Walk past something."""

    side: str | None = None
    """The side on which it is passed."""


class Avoid(OfRoom):
    """A warning: do not go into a room of this kind."""


class Notice(OfThing):
    """Something one sees on the way; nothing to do about it."""


class StopBy(OfThing):
    """The end is beside something."""


class StopIn(OfRoom):
    """The end is in a room of this kind."""


@dataclass(frozen=True)
class StopHere:
    """The end is where the last clause ended."""


Walking = Turn | Exit | Enter | OpenDoor | Climb | Cross | Forward | Metres | To | Past
Clause = Walking | Avoid | Notice | StopBy | StopIn | StopHere
STOPS = (StopBy, StopIn, StopHere)
REMARKS = (Avoid, Notice)
"""Clauses that ask for nothing to be done."""


def room_of(clause: Clause) -> str | None:
    """The kind of room that a clause names, if it names one."""
    return clause.kind if isinstance(clause, OfRoom) else None


def side_of(clause: Clause) -> str | None:
    """LEFT or RIGHT where a clause names a side."""
    return clause.side if isinstance(clause, Turn | Enter | OpenDoor | Past) else None


@dataclass(frozen=True)
class RouteInstruction:
    """A route instruction as meaning: `grammar.say` puts it into words, `grammar.parse` reads it back,
    `listener.carry_out` walks it."""

    clauses: tuple[Clause, ...]
