"""The room program: which rooms a house of a given area has, how large each, and who owns whom; and the table of room
kinds: what an architect knows of each, from its usual size to its windows.

The table is kinds.toml beside this module, furniture is furnish/rooms.toml. docs/houses.md says how to add a kind.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from embodied.assets.json_file import from_plain, read_toml
from embodied.generate.config import HouseConfig


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


FURTHER = {name: kind.extra for name, kind in ROOM_TABLE.items() if kind.extra is not None}
HIGHER = ((110.0, 0.35), (220.0, 0.1))
"""Area, square metres, above which a house may have a second and a third storey, and the share of houses that do."""
DOUBLE_KINDS = ("study", "family_room", "workshop", "playroom", "sun_room", "library")
"""Kinds with an `extra` of which large houses may have two."""


@dataclass(frozen=True)
class WantedRoom:
    """One room that a house should have."""

    kind: str
    area: float
    """Wanted area, square metres."""
    owner: int | None = None
    """Index of the room it belongs to and is entered from: an ensuite's bedroom, a pantry's kitchen."""


def draw_area(config: HouseConfig, *, rng: np.random.Generator) -> float:
    """Total area, square metres: flats, a broad hump at 110-160, a tail of large houses."""
    if config.area is not None:
        low, high = config.area
        low = min(max(low, config.least_area()), high)
        return float(rng.uniform(low, high))
    area = float(np.exp(rng.normal(np.log(135.0), 0.45)))
    if rng.random() < 0.12:
        area = float(rng.uniform(35, 75))
    if rng.random() < 0.08:
        area = float(rng.uniform(280, 600))
    if config.rooms is not None:
        area = float(np.clip(area, 23.0 * config.rooms, 34.0 * config.rooms))
    elif config.bedrooms is not None:
        area = float(np.clip(area, 36.0 * config.bedrooms, 90.0 * config.bedrooms))
    return float(np.clip(area, max(35.0, config.least_area()), 600.0))


def draw_storeys_of(area: float, config: HouseConfig, *, rng: np.random.Generator) -> int:
    """Number of storeys of a house of `area` square metres that leaves it to the seed."""
    chance = rng.random()
    storeys = 1 + sum(area > least and chance < share for least, share in HIGHER)
    while storeys > 1 and area < replace(config, storeys=storeys, area=None).least_area():
        storeys -= 1
    return storeys


def draw_program(area: float, config: HouseConfig, *, rng: np.random.Generator) -> tuple[WantedRoom, ...]:
    """The rooms of a house of `area` square metres (corridors come with the layout).

    Returns:
      Spaces whose areas sum to `area` less the circulation that a corridor will take.
    """
    storeys = config.storeys or 1
    area -= 9.0 * storeys * (storeys > 1)  # stairs
    bedrooms = config.bedrooms or _bedrooms(area, config, rng)
    spaces = [WantedRoom("hall", float(np.clip(0.045 * area, 3.0, 13.0)))]
    living = float(np.clip(rng.normal(0.2, 0.025) * area, 14, np.interp(area, (260, 500), (38, 52))))
    spaces.append(WantedRoom("living_room", living))
    spaces.append(WantedRoom("kitchen", float(np.clip(rng.normal(0.1, 0.012) * area, 5.2, 18))))
    if area > rng.uniform(78, 105) and (config.rooms is None or config.rooms > bedrooms + 1):
        spaces.append(WantedRoom("dining_room", float(np.clip(0.105 * area, 9.5, 18))))
    spaces += _sleeping(bedrooms, area, rng)
    usual = float(np.interp(area, (60, 85, 120, 200, 300, 600), (1, 1.2, 1.9, 2.5, 3.4, 5.2)))
    wet = max(1, min(round(usual + rng.normal(0, 0.3)), bedrooms + 1))
    beds = [i for i, s in enumerate(spaces) if s.kind in BEDROOMS]
    suites = min(max(wet - 1 - (bedrooms > 4), 0), len(beds))
    for k in range(wet):
        owner = beds[k] if k < suites else None
        size = float(np.clip(rng.normal(5.6, 0.5) + (area - 100) * 0.006, 4.0, 9.0))
        spaces.append(WantedRoom("bathroom", min(size, 0.12 * area), owner))
    if area > rng.uniform(70, 140):
        spaces.append(WantedRoom("toilet", 1.9, 0 if rng.random() < 0.7 else None))
    if area > rng.uniform(95, 190) and beds:
        spaces.append(WantedRoom("closet", float(np.clip(0.03 * area, 3.0, 6.5)), beds[0]))
    if area > rng.uniform(90, 230):
        spaces.append(WantedRoom("pantry", 2.6, 2))
    if area > rng.uniform(75, 150):
        spaces.append(WantedRoom("laundry_room", float(np.clip(0.04 * area, 3.8, 8))))
    spaces = _extras(spaces, area, config, rng)
    return scaled(spaces, 0.925 * area if area > 62 else area)


def _bedrooms(area: float, config: HouseConfig, rng: np.random.Generator) -> int:
    wanted = float(np.interp(area, (35, 60, 85, 115, 160, 240, 350, 600), (1, 1.2, 2, 2.8, 3.5, 4.3, 5.4, 7.5)))
    count = max(1, min(round(wanted + rng.normal(0, 0.35)), int((area - 20) / 20)))
    if config.rooms is not None:
        count = min(count, config.rooms - 1)
    return count


def _sleeping(count: int, area: float, rng: np.random.Generator) -> list[WantedRoom]:
    main = float(np.clip(rng.normal(0.11, 0.01) * area, 11.0, 20.0)) if area > 45 else 0.3 * area
    spaces = [WantedRoom("main_bedroom", main)]
    for k in range(1, count):
        kind = str(
            rng.choice(["bedroom", "kids_room", "guest_room"], p=[0.45, 0.4, 0.15] if k < 3 else [0.4, 0.3, 0.3])
        )
        spaces.append(WantedRoom(kind, float(np.clip(rng.normal(11.0, 0.8) + (area - 120) * 0.008, 9.0, 15.0))))
    return spaces


def _extras(spaces: list[WantedRoom], area: float, config: HouseConfig, rng: np.random.Generator) -> list[WantedRoom]:
    """`spaces` and further rooms until the area is used (or the asked number of main rooms is there)."""
    asked, grow = config.rooms is not None, float(np.clip((area - 150) / 450, 0, 1))
    left = list(FURTHER)
    while True:
        if config.rooms is not None and sum(ROOM_TABLE[s.kind].is_main for s in spaces) >= config.rooms:
            return spaces
        free = 0.925 * area - sum(s.area for s in spaces)
        if not asked and free < 7.0:
            return spaces
        fits = [
            k
            for k in left
            if (asked or area >= FURTHER[k].house) and (FURTHER[k].size * 0.8 <= free or (asked and k != "garage"))
        ]
        if fits:
            p = np.array([FURTHER[k].likely for k in fits])
            kind = str(rng.choice(fits, p=p / p.sum()))
            size = FURTHER[kind].size * (1 + 0.35 * grow)
            if kind == "garage" and area > 220 and rng.random() < 0.6:
                size = 33.0
            spaces.append(WantedRoom(kind, size))
            left.remove(kind)
            continue
        if not asked and free < 0.12 * area:
            return spaces
        another = _another(spaces, area, config, grow, rng)
        if another is None:
            return spaces
        spaces.append(another)


def _another(
    spaces: list[WantedRoom], area: float, config: HouseConfig, grow: float, rng: np.random.Generator
) -> WantedRoom | None:
    """One more bedroom, or a second study or the like; None where the house has enough of them."""
    asked = config.rooms is not None
    beds = sum(s.kind in BEDROOMS for s in spaces)
    most = 0.5 * config.rooms if config.rooms is not None else area / 62
    seconds = [
        k for k in DOUBLE_KINDS if sum(s.kind == k for s in spaces) < 2 and (asked or area > 2 * FURTHER[k].house)
    ]
    if (beds < most and config.bedrooms is None) or (not seconds and asked):
        return WantedRoom("guest_room" if rng.random() < 0.5 else "bedroom", 11.0 + 3.0 * grow)
    if not seconds:
        return None
    kind = str(rng.choice(seconds))
    return WantedRoom(kind, FURTHER[kind].size * (1 + 0.35 * grow))


def scaled(spaces: list[WantedRoom], total: float) -> tuple[WantedRoom, ...]:
    """The same rooms stretched to sum to `total`, none more than a tenth beyond what is usual while that can be met."""
    factor, usual = 1.0, [(s.area, *ROOM_TABLE[s.kind].area) for s in spaces]
    for _ in range(12):
        areas = [float(np.clip(area * factor, 0.9 * least, 1.1 * most)) for area, least, most in usual]
        factor *= (total / sum(areas)) ** 1.2
    rest = total / sum(areas)
    return tuple(replace(s, area=a * rest) for s, a in zip(spaces, areas))
