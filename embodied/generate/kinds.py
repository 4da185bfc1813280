"""The table of room kinds: what an architect knows of each, from its usual size to its windows.

Its furniture stands in furnish/rooms.py. docs/houses.md says how to add a kind.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


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
    """What is usual for rooms of one kind."""

    area: tuple[float, float]
    """Smallest and largest usual area, square metres."""
    side: float
    """Smallest usual side, metres."""
    privacy: float
    """0 at the public end of the house, 4 at the private one."""
    entered_from: Mapping[str, float] = field(default_factory=dict)
    """Kinds of room it may be entered from, with a cost; a room that another owns is entered from its owner."""
    is_main: bool = True
    """Whether advertisements of flats count it."""
    is_bedroom: bool = False
    is_open: bool = False
    """Whether wide openings may join it to others of the sort."""
    leads_on: bool = False
    """Whether one may cross it on the way to another room."""
    is_tight: bool = False
    """Whether its furniture does not fit below the usual size."""
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


LOW = (0.9, 0.45)
BEDROOM_DOORS = {"corridor": 0.0, "hall": 0.4, "living_room": 5.0, "family_room": 6.0, "dining_room": 7.0}
OTHER_DOORS = {"corridor": 0.0, "hall": 0.0, "living_room": 0.8, "family_room": 0.8, "dining_room": 1.6, "kitchen": 3.0}
"""Costs of entering bedrooms, and rooms for hobbies, from these kinds."""

KINDS: dict[str, RoomKind] = {
    "living_room": RoomKind(
        (15, 54),
        3.4,
        0.0,
        {"hall": 0.0, "corridor": 0.3, "dining_room": 1.2, "family_room": 1.5, "kitchen": 3.0},
        is_open=True,
        leads_on=True,
        is_tight=True,
        needs_daylight=True,
        glass=0.2,
        sills=LOW,
    ),
    "kitchen": RoomKind(
        (6, 20),
        2.1,
        0.9,
        {"dining_room": 0.0, "living_room": 0.3, "family_room": 0.6, "hall": 0.8, "corridor": 1.0},
        is_main=False,
        is_open=True,
        leads_on=True,
        is_tight=True,
        needs_daylight=True,
        glass=0.13,
        sills=(1.05, 1.05),
        head=2.1,
    ),
    "dining_room": RoomKind(
        (9, 21),
        2.7,
        0.5,
        {"living_room": 0.0, "kitchen": 0.4, "hall": 0.6, "family_room": 0.6, "corridor": 0.8},
        is_open=True,
        leads_on=True,
        needs_daylight=True,
        glass=0.17,
        sills=LOW,
    ),
    "main_bedroom": RoomKind(
        (11, 24), 2.9, 3.7, BEDROOM_DOORS, is_bedroom=True, is_tight=True, needs_daylight=True, glass=0.14
    ),
    "bedroom": RoomKind(
        (8.5, 16), 2.5, 3.1, BEDROOM_DOORS, is_bedroom=True, is_tight=True, needs_daylight=True, glass=0.14
    ),
    "kids_room": RoomKind(
        (9, 16), 2.5, 3.2, BEDROOM_DOORS, is_bedroom=True, is_tight=True, needs_daylight=True, glass=0.14
    ),
    "guest_room": RoomKind(
        (9, 16), 2.6, 2.5, BEDROOM_DOORS, is_bedroom=True, is_tight=True, needs_daylight=True, glass=0.14
    ),
    "bathroom": RoomKind(
        (4, 9.5),
        1.7,
        3.0,
        {"corridor": 0.0, "hall": 0.4, "living_room": 6.0, "dining_room": 8.0, "family_room": 7.0},
        is_main=False,
        is_tight=True,
        longest=1.8,
        door=0.8,
        glass=0.1,
        sills=(1.35, 1.35),
        head=2.1,
        widest=0.9,
        most=1,
    ),
    "toilet": RoomKind(
        (1.7, 3),
        1.1,
        1.4,
        {"hall": 0.0, "corridor": 0.2, "living_room": 6.0, "family_room": 6.0, "dining_room": 8.0},
        is_main=False,
        longest=2.2,
        door=0.75,
        wall=11,
        glass=0.15,
        sills=(1.35, 1.35),
        head=2.1,
        widest=0.6,
        most=1,
    ),
    "hall": RoomKind(
        (3, 14),
        1.3,
        1.2,
        {"corridor": 0.0, "living_room": 1.0},
        is_main=False,
        leads_on=True,
        longest=2.4,
        glass=0.08,
        widest=0.8,
        most=1,
    ),
    "corridor": RoomKind(
        (1.5, 14),
        1.1,
        1.2,
        {"hall": 0.0, "corridor": 0.0, "living_room": 1.5, "family_room": 2.0, "dining_room": 2.5, "kitchen": 5.0},
        is_main=False,
        leads_on=True,
        glass=0.1,
        widest=0.9,
        most=2,
    ),
    "laundry_room": RoomKind(
        (3.5, 9),
        1.6,
        1.7,
        {"corridor": 0.0, "kitchen": 0.2, "hall": 0.4, "dining_room": 4.0},
        is_main=False,
        longest=1.8,
        door=0.8,
        glass=0.1,
        sills=(1.05, 1.05),
        head=2.1,
        most=1,
    ),
    "pantry": RoomKind(
        (1.8, 4.5),
        1.1,
        1.0,
        {"kitchen": 0.0, "corridor": 1.0, "hall": 1.5, "dining_room": 2.5},
        is_main=False,
        longest=2.2,
        door=0.75,
        wall=11,
    ),
    "closet": RoomKind(
        (2.2, 7),
        1.3,
        3.0,
        {"hall": 0.0, "corridor": 0.0, "living_room": 3.0, "study": 2.0, "family_room": 3.0},
        is_main=False,
        longest=2.2,
        door=0.75,
        wall=11,
    ),
    "study": RoomKind(
        (6.5, 15), 2.2, 1.9, OTHER_DOORS, needs_daylight=True, glass=0.15, extra=Extra(house=80, size=9, likely=3.0)
    ),
    "garage": RoomKind(
        (17, 38),
        3.0,
        1.2,
        {"laundry_room": 0.1, "hall": 0.2, "corridor": 0.2, "kitchen": 0.8, "workshop": 0.5},
        is_main=False,
        glass=0.03,
        sills=(1.5, 1.5),
        head=2.1,
        widest=1.2,
        most=2,
        extra=Extra(house=105, size=19, likely=1.6),
    ),
    "sun_room": RoomKind(
        (8.5, 18),
        2.5,
        0.2,
        {
            "living_room": 0.0,
            "dining_room": 0.2,
            "family_room": 0.2,
            "kitchen": 0.8,
            "corridor": 0.8,
            "hall": 1.0,
            "library": 1.0,
        },
        is_open=True,
        needs_daylight=True,
        glass=0.4,
        sills=(0.4, 0.4),
        head=2.2,
        extra=Extra(house=120, size=11, likely=0.8),
    ),
    "family_room": RoomKind(
        (13, 28),
        3.2,
        0.6,
        {"corridor": 0.3, "hall": 0.3, "kitchen": 0.4, "dining_room": 0.4, "living_room": 0.5},
        is_open=True,
        leads_on=True,
        needs_daylight=True,
        glass=0.18,
        sills=LOW,
        extra=Extra(house=150, size=17, likely=1.0),
    ),
    "workshop": RoomKind(
        (8.5, 18),
        2.4,
        1.5,
        {"garage": 0.3, "corridor": 0.0, "hall": 0.3, "laundry_room": 0.3, "kitchen": 2.0, "family_room": 2.0},
        needs_daylight=True,
        glass=0.1,
        sills=(1.0, 1.0),
        head=2.1,
        extra=Extra(house=130, size=11, likely=0.6),
    ),
    "playroom": RoomKind(
        (11, 20), 2.8, 2.6, OTHER_DOORS, needs_daylight=True, glass=0.15, extra=Extra(house=150, size=13, likely=0.8)
    ),
    "library": RoomKind(
        (11, 22),
        2.8,
        1.3,
        OTHER_DOORS,
        is_open=True,
        needs_daylight=True,
        glass=0.14,
        sills=LOW,
        extra=Extra(house=165, size=14, likely=0.8),
    ),
    "gym": RoomKind(
        (11, 24),
        2.8,
        2.2,
        OTHER_DOORS,
        needs_daylight=True,
        glass=0.14,
        sills=(1.0, 1.0),
        head=2.1,
        extra=Extra(house=175, size=14, likely=0.7),
    ),
}
"""Room kind to what is usual for it. The order of the kinds with an `extra` is that in which they are drawn."""
BEDROOMS = tuple(name for name, kind in KINDS.items() if kind.is_bedroom)
