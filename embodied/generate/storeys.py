"""Houses of several storeys: which rooms lie on which storey, and plans above each other that share a stairwell."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from embodied.generate.access import WET, shared_wall
from embodied.generate.footprint import Band, Footprint, draw_footprint, shared_area
from embodied.generate.layout import FloorPlan, draw_plan
from embodied.generate.modules import Cell
from embodied.generate.program import BEDROOMS, ROOM_TABLE, WantedRoom, scaled

UPSTAIRS = (*BEDROOMS, "bathroom", "closet", "playroom", "study", "library", "gym")
"""Kinds of room that belong upstairs."""
EITHER = ("study", "library", "gym", "playroom", "guest_room")
"""Kinds that lie where there is room."""
ENOUGH = 0.85
"""Share of the mean of all storeys up to which an upper one gets rooms."""
FOOTPRINTS = 14
"""Footprints among which a storey's plan is drawn."""
STAIRS = ((9.7, 0.0), (16.5, 170.0), (27.0, 330.0))
"""Wanted areas of stairwells, each with the house's area from which it may be, square metres."""


def draw_storeys(
    area: float,
    shape: str,
    spaces: tuple[WantedRoom, ...],
    storeys: int,
    tries: int,
    *,
    gallery: bool,
    rng: np.random.Generator,
) -> FloorPlan | None:
    """The ground floor's plan with those above it; None where a storey finds none. `area` and `spaces` are of all; with
    a `gallery` the stairwell is large enough for one."""
    own = _by_storey(spaces, storeys)
    size = float(rng.choice([size for size, house in STAIRS if area >= house]))
    well = WantedRoom("stairwell", STAIRS[-1][0] if gallery else size)
    footprints = _footprints(area, shape, [well.area + sum(s.area for s in rooms) for rooms in own], rng)
    drawn = draw_plan(footprints, (*_filling(own[0], footprints[0], well.area), well), tries, rng=rng)
    if drawn is None:
        return None
    ground, upper = drawn[1], _upper(drawn[0])
    stair = next(c for c in ground.cells if c.kind == "stairwell")
    above: list[FloorPlan] = []
    for rooms in own[1:]:
        wet = tuple(c.rect for c in (above[-1] if above else ground).cells if c.kind in WET)
        over = replace(_split(upper, stair), wet=wet, stair=stair)
        story = draw_plan((over,), _filling(rooms, upper, well.area), tries, rng=rng)
        if story is None:
            return None
        above.append(story[1])
    return replace(ground, above=tuple(above))


def _by_storey(spaces: tuple[WantedRoom, ...], storeys: int) -> list[list[WantedRoom]]:
    """The rooms of each storey, owners by their place in it; each storey has a bathroom or a toilet."""
    storey = [1 if s.kind in UPSTAIRS else 0 for s in spaces]
    for kind in EITHER:
        for i, s in enumerate(spaces):
            high, low = (sum(x.area for x, k in zip(spaces, storey) if k == up) for up in (1, 0))
            if s.kind == kind and storey[i] and high - low > s.area * (1.0 if storeys == 2 else 3.0):
                storey[i] = 0
    size = lambda i: sum(s.area for k, s in enumerate(spaces) if i in (k, s.owner))
    sizes = [sum(s.area for s, k in zip(spaces, storey) if not k and s.owner is None), *[0.0] * (storeys - 1)]
    upper = [i for i, s in enumerate(spaces) if storey[i] and s.owner is None]
    for i in sorted(upper, key=lambda i: (spaces[i].kind != "main_bedroom", -size(i))):  # the first on the lowest
        storey[i] = 1 + int(np.argmin(sizes[1:]))
        sizes[storey[i]] += size(i)
    storey = [k if s.owner is None else storey[s.owner] for s, k in zip(spaces, storey)]
    own: list[list[WantedRoom]] = []
    kinds, enough = [s.kind for s in spaces], ENOUGH * sum(sizes) / storeys
    for k in range(storeys):
        here = [i for i in range(len(spaces)) if storey[i] == k]
        rooms = [spaces[i] for i in here]
        rooms = [replace(s, owner=here.index(s.owner)) if s.owner is not None else s for s in rooms]
        if not any(s.kind in ("bathroom", "toilet") and (not k or s.owner is None) for s in rooms):
            rooms.append(WantedRoom("bathroom", 4.5) if k else WantedRoom("toilet", 1.9))
        for kind in EITHER if k and storeys > 2 else ():
            if kind not in kinds and sum(s.area for s in rooms) + ROOM_TABLE[kind].area[0] / 2 < enough:
                rooms.append(WantedRoom(kind, ROOM_TABLE[kind].area[0]))
                kinds.append(kind)
        own.append(rooms)
    return own


def _footprints(area: float, shape: str, own: Sequence[float], rng: np.random.Generator) -> tuple[Footprint, ...]:
    """Footprints of the ground floor whose storeys have `area`, those whose upper floors suit best what each
    storey's rooms take (`own`), square metres."""
    wanted = own[1] / own[0]
    drawn: list[tuple[float, int, Footprint]] = []
    for seed in rng.integers(2**31, size=3 * FOOTPRINTS).tolist():
        ground, share = area / len(own), 1.0
        for _ in range(3):
            footprint = draw_footprint(ground, shape, flat=False, rng=np.random.default_rng(seed))
            size, share = _size(footprint), _size(replace(footprint, caps=())) / _size(footprint)
            ground *= area / (size * (1 + share * (len(own) - 1)))
        drawn.append((abs(np.log(share / min(wanted, 1.0))), len(drawn), footprint))
    return tuple(f for _, _, f in sorted(drawn, key=lambda d: d[:2])[:FOOTPRINTS])


def _size(footprint: Footprint) -> float:
    """Of its strips, corridors and caps, square metres."""
    caps = sum((c.rect[2] - c.rect[0]) * (c.rect[3] - c.rect[1]) for c in footprint.caps)
    bands = sum(b.length * footprint.corridor for b in footprint.bands)
    return (sum(s.length * s.depth for s in footprint.strips) + bands + caps) / 100


def _filling(rooms: Sequence[WantedRoom], footprint: Footprint, stairs: float) -> tuple[WantedRoom, ...]:
    """The rooms stretched to fill a footprint beside its corridors and stairs."""
    return scaled(list(rooms), 0.925 * _size(footprint) - stairs)


def _upper(footprint: Footprint) -> Footprint:
    """The footprint of the storeys above: the ends of wings are left out."""

    def is_free(b: Band, end: int) -> bool:
        tip = b.rect(*((b.length - 1, b.length) if end else (0, 1)))
        return b.free[end] or any(shared_wall(tip, c.rect) for c in footprint.caps)

    bands = tuple(replace(b, free=(is_free(b, 0), is_free(b, 1))) for b in footprint.bands)
    return replace(footprint, bands=bands, caps=())


def _split(footprint: Footprint, stair: Cell) -> Footprint:
    """The footprint whose rows leave the stairwell out."""
    strips = []
    for s in footprint.strips:
        if not shared_area(s.rect(0, s.length, 0, s.depth), stair.rect):
            strips.append(s)
            continue
        p, q = sorted((v - s.start) * s.way for v in stair.rect[s.axis == "y" :: 2])
        first = replace(s, length=p)
        rest = replace(s, start=s.start + s.way * q, length=s.length - q, rank=s.rank + q, u_band=s.u_band + q)
        strips += [r for r in (first, rest) if r.length > 0]
    return replace(footprint, strips=tuple(strips))
