"""Modules: what stands between two party walls of a row, a room alone or with the small rooms it owns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from embodied.generate.footprint import Rect, Strip
from embodied.generate.kinds import BEDROOMS, SIZES
from embodied.generate.program import Space

FILLERS = {"kitchen": "pantry", **{k: "closet" for k in (*BEDROOMS, "hall", "study", "laundry_room")}}
"""What a leftover niche beside such a room becomes."""
LEAST = {kind: round(sides[2] * 10) for kind, sides in SIZES.items()}
"""Smallest usual side of each kind, decimetres."""
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


@dataclass(frozen=True)
class Module:
    main: Space
    owned: tuple[Space, ...] = ()
    """Small rooms entered from `main`."""
    guest: Space | None = None
    """A small room entered from the corridor that shares a column with the owned ones."""

    @property
    def area(self) -> float:
        return self.main.area + sum(s.area for s in self.owned) + (self.guest.area if self.guest else 0.0)


def draw_modules(spaces: tuple[Space, ...], *, rng: np.random.Generator) -> list[Module]:
    """Group `spaces`: owned rooms with their owners, some wet rooms into the columns between rooms."""
    owned: dict[int, list[Space]] = {}
    for s in spaces:
        if s.owner is not None:
            owned.setdefault(s.owner, []).append(s)
    pool = [i for i, s in enumerate(spaces) if s.owner is None and s.kind in ("bathroom", "toilet", "laundry_room")]
    pool = [pool[k] for k in rng.permutation(len(pool))]
    taken: dict[int, Space] = {}
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
    deep = depth + (corridor if module.main.kind == "hall" else 0)
    least = LEAST[module.main.kind]
    items = (*module.owned, *((module.guest,) if module.guest else ()))
    if not items:
        return max(least, round(module.main.area * 100 / deep))
    main = max(least, round(module.main.area * 100 / deep))
    return main + _column(items, depth)


def _column(items: tuple[Space, ...], depth: int) -> int:
    if depth >= 34:
        return max(max(LEAST[s.kind] for s in items), round(sum(s.area for s in items) * 100 / depth))
    return sum(max(LEAST[s.kind], round(s.area * 100 / depth)) for s in items)


def arrange(
    module: Module,
    strip: Strip,
    u0: int,
    u1: int,
    corridor: int,
    wanted: int,
    *,
    mirrored: bool,
    inner: int = 0,
    first: int = 0,
) -> list[Cell] | None:
    """The module's cells between u0 and u1 of `strip`; None where it does not fit.

    Args:
      wanted: its width(), decimetres, which u1 - u0 may exceed or fall short of.
      inner: how far the main room reaches into the corridor (v = -inner).
      first: index that the first returned cell will have; owners refer to it.
    """
    h = strip.depth
    v0 = -corridor if module.main.kind == "hall" else -inner

    def cell(space: Space, a: int, b: int, v0: int, v1: int, owner: int | None = None) -> Cell:
        if mirrored:
            a, b = u0 + u1 - b, u0 + u1 - a
        return Cell(space.kind, strip.rect(a, b, v0, v1), space.area, owner)

    items = list(module.owned)
    if not items and module.guest is None:
        return [cell(module.main, u0, u1, v0, h)]
    total = (*items, *((module.guest,) if module.guest else ()))
    column = round(_column(total, h) * min(1.0, (u1 - u0) / wanted) ** 0.5)
    edge = u1 - column
    if edge - u0 < 0.9 * LEAST[module.main.kind]:
        return None
    cells = [cell(module.main, u0, edge, v0, h)]
    if h < 34:
        return _side_by_side(module, cells, cell, edge, u1, h, first)
    if len(items) == 2 and module.guest is None:
        cut = round(h * items[1].area / (items[0].area + items[1].area))
        cut = min(max(cut, NICHE), h - 17)
        return [*cells, cell(items[0], edge, u1, cut, h, first), cell(items[1], edge, u1, 0, cut, first)]
    if items and module.guest:
        if len(items) == 2:
            return None
        cut = round(h * module.guest.area / (items[0].area + module.guest.area))
        cut = min(max(cut, LEAST[module.guest.kind]), h - LEAST[items[0].kind])
        return [*cells, cell(items[0], edge, u1, cut, h, first), cell(module.guest, edge, u1, 0, cut)]
    alone = items[0] if items else module.guest
    deep = max(round(alone.area * 100 / column), LEAST[alone.kind])
    rest = h - deep
    filler = "closet" if alone.kind == "pantry" else FILLERS.get(module.main.kind)
    if rest < NICHE or filler is None:
        deep, rest = h, 0
    niche = Space(filler or "closet", rest * column / 100)
    if items:
        cells.append(cell(alone, edge, u1, rest, h, first))
        if rest:
            cells.append(cell(niche, edge, u1, 0, rest, None if alone.kind == "pantry" else first))
    else:
        cells.append(cell(alone, edge, u1, 0, deep))
        if rest:
            cells.append(cell(niche, edge, u1, deep, h, first))
    return cells


def _side_by_side(module: Module, cells: list[Cell], cell, edge: int, u1: int, h: int, first: int) -> list[Cell] | None:
    """Owned rooms and the guest beside the main room in a shallow row; only one of them can touch it."""
    if len(module.owned) > 1:
        return None
    items = (*module.owned, *((module.guest,) if module.guest else ()))
    wanted = np.array([max(LEAST[s.kind], s.area * 100 / h) for s in items])
    cuts = np.round(np.cumsum(wanted) / wanted.sum() * (u1 - edge)).astype(int).tolist()
    a = edge
    for s, b in zip(items, cuts):
        cells.append(cell(s, a, edge + b, 0, h, first if s in module.owned else None))
        a = edge + b
    return cells
