"""Modules: what stands between two party walls of a row, a room alone or with the small rooms it owns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from embodied.generate.footprint import Rect, Strip
from embodied.generate.program import BEDROOMS, ROOM_TABLE, WantedRoom

FILLERS = {"kitchen": "pantry", **dict.fromkeys((*BEDROOMS, "hall", "study", "laundry_room"), "closet")}
"""Kind of room that a leftover niche beside such a room becomes."""
THROUGH = ("hall", "stairwell")
"""Kinds that take the corridor's width where they lie along it."""
NICHE = 12
"""Shortest side of a niche worth a door, decimetres."""


@dataclass(frozen=True)
class Cell:
    """A rectangle of the plan that becomes a room, decimetres."""

    kind: str
    rect: Rect
    area: float
    """Wanted area, square metres."""
    owner: int | None = None
    """Index of the cell it is entered from."""
    floor: Rect | None = None
    """Of a stairwell: its part along one side where one walks on both storeys."""
    least: int = 0
    """Of a stairwell: the depth that this part was asked to have, decimetres."""
    room: int | None = None
    """Cells of one number are one room, of a shape that is no rectangle."""

    attic: bool = False
    """True for a room that is asked to lie under the roof."""
    slopes: tuple[int, ...] = ()
    """Sides over which its ceiling slopes, counted counter-clockwise from the one of the smallest y."""

    def is_with(self, other: Cell) -> bool:
        """True if both are of one room."""
        return self.room is not None and self.room == other.room


@dataclass(frozen=True)
class Module:
    main: WantedRoom
    owned: tuple[WantedRoom, ...] = ()
    """Small rooms entered from `main`."""
    guest: WantedRoom | None = None
    """A small room entered from the corridor that shares a column with the owned ones."""


@dataclass(frozen=True)
class Slot:
    """The place of a module in its row, decimetres."""

    strip: Strip
    start: int
    end: int
    corridor: int
    """Width of the corridor before it."""
    mirrored: bool
    inner: int = 0
    """How far the main room reaches into the corridor."""

    def cell(self, space: WantedRoom, a: int, b: int, v0: int, v1: int, owner: int | None = None) -> Cell:
        """The cell from a to b along the row and from v0 to v1 away from the corridor."""
        if self.mirrored:
            a, b = self.start + self.end - b, self.start + self.end - a
        return Cell(space.kind, self.strip.rect(a, b, v0, v1), space.area, owner)


def draw_modules(spaces: tuple[WantedRoom, ...], *, rng: np.random.Generator) -> list[Module]:
    """Group `spaces`: owned rooms with their owners, some wet rooms into the columns between rooms."""
    owned: dict[int, list[WantedRoom]] = {}
    for s in spaces:
        if s.owner is not None:
            owned.setdefault(s.owner, []).append(s)
    pool = [i for i, s in enumerate(spaces) if s.owner is None and s.kind in ("bathroom", "toilet", "laundry_room")]
    pool = [pool[k] for k in rng.permutation(len(pool))]
    taken: dict[int, WantedRoom] = {}
    hosts = [
        i
        for i, s in enumerate(spaces)
        if s.owner is None and s.kind in (*BEDROOMS, "kitchen", "hall", "study") and len(owned.get(i, ())) < 2
    ]
    for k in rng.permutation(len(hosts)):
        host = hosts[k]
        if pool and rng.random() < (0.75 if owned.get(host) else 0.25):
            fit = [p for p in pool if not (spaces[p].kind == "bathroom" and spaces[host].kind == "kitchen")]
            if fit:
                pool.remove(fit[0])
                taken[host] = spaces[fit[0]]
    guests = {id(s) for s in taken.values()}
    return [
        Module(s, tuple(owned.get(i, ())), taken.get(i))
        for i, s in enumerate(spaces)
        if s.owner is None and id(s) not in guests
    ]


def width(module: Module, depth: int, corridor: int) -> int:
    """The wanted width, decimetres, in a row of `depth`."""
    deep = depth + (corridor if module.main.kind in THROUGH else 0)
    least = _least(module.main.kind)
    main, small = max(least, round(module.main.area * 100 / deep)), _small_rooms(module)
    return main + _column(small, depth) if small else main


def _column(items: tuple[WantedRoom, ...], depth: int) -> int:
    if depth >= 34:
        return max(max(_least(s.kind) for s in items), round(sum(s.area for s in items) * 100 / depth))
    return sum(max(_least(s.kind), round(s.area * 100 / depth)) for s in items)


def arrange(module: Module, slot: Slot, wanted: int, *, first: int = 0) -> list[Cell] | None:
    """The module's cells in its slot; None where it does not fit.

    Args:
      wanted: its width(), decimetres, which the slot may exceed or fall short of.
      first: index that the first returned cell will have; owners refer to it.
    """
    h, v0 = slot.strip.depth, -slot.corridor if module.main.kind in THROUGH else -slot.inner
    small = _small_rooms(module)
    if not small:
        return [slot.cell(module.main, slot.start, slot.end, v0, h)]
    column = round(_column(small, h) * min(1.0, (slot.end - slot.start) / wanted) ** 0.5)
    edge = slot.end - column
    if edge - slot.start < 0.9 * _least(module.main.kind):
        return None
    main = slot.cell(module.main, slot.start, edge, v0, h)
    beside = _side_by_side(module, slot, edge, first) if h < 34 else _column_cells(module, slot, edge, first)
    return None if beside is None else [main, *beside]


def _least(kind: str) -> int:
    """Smallest usual side of a kind, decimetres."""
    return round(ROOM_TABLE[kind].side * 10)


def _small_rooms(module: Module) -> tuple[WantedRoom, ...]:
    return (*module.owned, *((module.guest,) if module.guest else ()))


def _column_cells(module: Module, slot: Slot, edge: int, first: int) -> list[Cell] | None:
    """The small rooms behind one another in the column beside the main room, the owned ones away from the corridor."""
    owned, guest, h, end = module.owned, module.guest, slot.strip.depth, slot.end
    if len(owned) == 2 and guest is None:
        cut = round(h * owned[1].area / (owned[0].area + owned[1].area))
        cut = min(max(cut, NICHE), h - 17)
        return [slot.cell(owned[0], edge, end, cut, h, first), slot.cell(owned[1], edge, end, 0, cut, first)]
    if owned and guest is not None:
        if len(owned) == 2:
            return None
        cut = round(h * guest.area / (owned[0].area + guest.area))
        cut = min(max(cut, _least(guest.kind)), h - _least(owned[0].kind))
        return [slot.cell(owned[0], edge, end, cut, h, first), slot.cell(guest, edge, end, 0, cut)]
    return _with_niche(module, slot, edge, first)


def _with_niche(module: Module, slot: Slot, edge: int, first: int) -> list[Cell]:
    """One small room in the column, and a closet or pantry in what it leaves."""
    alone, h, end = _small_rooms(module)[0], slot.strip.depth, slot.end
    deep = max(round(alone.area * 100 / (end - edge)), _least(alone.kind))
    filler = "closet" if alone.kind == "pantry" else FILLERS.get(module.main.kind)
    if h - deep < NICHE or filler is None:
        deep = h
    rest = h - deep
    niche = WantedRoom(filler or "closet", rest * (end - edge) / 100)
    if module.owned:
        owner = None if alone.kind == "pantry" else first
        cells = [slot.cell(alone, edge, end, rest, h, first), slot.cell(niche, edge, end, 0, rest, owner)]
    else:
        cells = [slot.cell(alone, edge, end, 0, deep), slot.cell(niche, edge, end, deep, h, first)]
    return cells if rest else cells[:1]


def _side_by_side(module: Module, slot: Slot, edge: int, first: int) -> list[Cell] | None:
    """Owned rooms and the guest beside the main room in a shallow row; only one of them can touch it."""
    if len(module.owned) > 1:
        return None
    small, h, cells = _small_rooms(module), slot.strip.depth, []
    wanted = np.array([max(_least(s.kind), s.area * 100 / h) for s in small])
    cuts = np.round(np.cumsum(wanted) / wanted.sum() * (slot.end - edge)).astype(int).tolist()
    a = edge
    for s, b in zip(small, cuts):
        cells.append(slot.cell(s, a, edge + b, 0, h, first if s in module.owned else None))
        a = edge + b
    return cells
