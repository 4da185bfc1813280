"""The table of room kinds: what an architect knows of each, from its usual size to its windows.

The table is kinds.toml beside this module, furniture is furnish/rooms.toml. docs/houses.md says how to add a kind.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from embodied.assets.json_file import from_plain, read_toml


@dataclass(frozen=True)
class Extra:
    """When a house has a room of this kind besides what every house has."""

    house: float
    """Area from which a house may have one, square metres."""
    size: float
    """Wanted area of the room, square metres; larger houses stretch it."""
    likely: float
    """Weight among the kinds that could come next."""


@dataclass(frozen=True)
class RoomKind:
    """Usual properties of rooms of one kind."""

    area: tuple[float, float]
    """Smallest and largest usual area, square metres."""
    side: float
    """Smallest usual side, metres."""
    privacy: float
    """0 at the public end of the house, 4 at the private one."""
    entered_from: Mapping[str, float] = field(default_factory=dict)
    """Kinds of room it may be entered from, with a cost; a room that another owns is entered from its owner."""
    joins: Mapping[str, int] = field(default_factory=dict)
    """Kinds it is joined with wherever their shared wall is at least so long, decimetres; said at either of the two."""
    leads_to: tuple[str, ...] = ()
    """Kinds that it may be crossed on the way to, where it does not lead on in general."""
    beside: Mapping[str, float] = field(default_factory=dict)
    """Worth of a shared wall with a room of another kind; said at either of the two."""
    is_main: bool = True
    """True if advertisements of flats count it."""
    is_bedroom: bool = False
    is_open: bool = False
    """True if wide openings may join it to others of the sort."""
    leads_on: bool = False
    """True if one may cross it on the way to another room."""
    is_tight: bool = False
    """True if its furniture does not fit below the usual size."""
    longest: float = 1.65
    """Longest side over shortest, before it costs."""
    door: float = 0.85
    """Clear width of its door, metres."""
    wall: int = 12
    """Shortest shared wall that holds its door, decimetres."""
    needs_daylight: bool = False
    glass: float | None = None
    """Window area as a share of the floor area; None: it has no windows."""
    sills: tuple[float, float] = (0.9, 0.9)
    """Height of the window sill, metres: usual, and in the four of ten rooms whose windows are low."""
    head: float = 2.15
    """Height of the window's top, metres."""
    widest: float = 2.4
    """Of one window, metres."""
    most: int = 5
    """Windows."""
    extra: Extra | None = None
    """None: the programme decides by itself whether a house has one."""


ROOM_TABLE: dict[str, RoomKind] = from_plain(
    dict[str, RoomKind], read_toml(Path(__file__).with_name("kinds.toml")), "kinds.toml"
)
"""Room kind to what is usual for it. The order of the kinds with an `extra` is that in which they are drawn."""
NEIGHBOUR_VALUES = {frozenset((a, b)): worth for a, kind in ROOM_TABLE.items() for b, worth in kind.beside.items()}
"""Worth of a shared wall between two kinds."""
BEDROOMS = tuple(name for name, kind in ROOM_TABLE.items() if kind.is_bedroom)
