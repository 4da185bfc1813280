"""Stairs of a plan: which flight fits a stairwell, where it runs, and where one walks beside it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import shapely

from embodied.generate.footprint import Rect
from embodied.generate.modules import Cell
from embodied.house.house import HouseError, Stair, Storey, rounded

RISERS, SLAB, TALLEST = 16, 0.3, 2.7
"""Risers of every stair, metres from a ceiling to the floor above, and the largest clear height of storeys that stairs
join: risers of 0.17 to 0.19 m."""
GOINGS, WIDTHS = (0.28, 0.25), (1.2, 1.1, 1.0, 0.9)
"""Largest and smallest depth of a tread, and widths of flights, the best first, metres."""
GALLERY, LEAST_VOID = 1.1, 1.4
"""Width of a gallery, and shortest side of the opening that it goes around, metres."""
LANDING, INNER = 1.0, 0.06
"""Shortest floor before a stair's foot and after its head, and half an inner wall, metres."""


@dataclass(frozen=True)
class Flights:
    """A stair in a rectangle: u runs along the side where one comes and goes, v away from it; metres from its walls."""

    path: tuple[tuple[float, float, int], ...]
    """u, v and the number of risers below, from foot to head."""
    well: tuple[tuple[float, float], ...]
    """Corners of the opening in the floor above; below, of what the flights stand on."""
    width: float
    approach: float
    """v up to which all of the floor is free on both storeys."""


def fitting(wide: float, deep: float, least: float) -> Flights | None:
    """The stair for a stairwell of these sides, with a floor in front of `least`, metres between the middles of walls.

    A straight flight along the far wall where there is room, else one that turns in a corner, else two beside each
    other, else None. The rest of the rectangle is floor on both storeys.
    """
    w, d, front = wide - 2 * INNER, deep - 2 * INNER, max(least, LANDING)
    for flights in (_straight, _cornered, _halved):
        for width in WIDTHS:
            if (fitted := flights(w, d, front, width)) is not None:
                return fitted
    return None


def _going(room: float, treads: int) -> float | None:
    going = min(room / treads + 1e-9, GOINGS[0])
    return going if going >= GOINGS[1] else None


def _straight(w: float, d: float, front: float, f: float) -> Flights | None:
    going = _going(w - 2 * LANDING, RISERS - 1)
    if going is None or d < f + front:
        return None
    foot, head = LANDING, LANDING + (RISERS - 1) * going
    well = ((foot, d - f), (head, d - f), (head, d), (foot, d))
    return Flights(((foot, d - f / 2, 0), (head, d - f / 2, RISERS)), well, f, d - f)


def _cornered(w: float, d: float, front: float, f: float) -> Flights | None:
    for first in (9, 8, 7, 6, 5):
        second = RISERS - first
        one, other = _going(d - f - front, first - 1), _going(w - f - LANDING, second - 1)
        if one is None or other is None:
            continue
        going = min(one, other)
        turn, head, near = d - f / 2, f + (second - 1) * going, d - f - (first - 1) * going
        path = ((f / 2, near, 0), (f / 2, d - f, first), (f / 2, turn, first), (f, turn, first), (head, turn, RISERS))
        well = ((0.0, near), (f, near), (f, d - f), (head, d - f), (head, d), (0.0, d))
        return Flights(path, well, f, near)
    return None


def _halved(w: float, d: float, front: float, f: float) -> Flights | None:
    half = RISERS // 2
    going = _going(d - f - front, half - 1)
    if going is None or w < 2 * f + 0.08:
        return None
    near, turn, left, right = d - f - (half - 1) * going, d - f / 2, f / 2, w - f / 2
    us, vs = (left, left, left, right, right, right), (near, d - f, turn, turn, d - f, near)
    path = tuple(zip(us, vs, (0, half, half, half, half, RISERS)))
    return Flights(path, ((0.0, near), (w, near), (w, d), (0.0, d)), f, near)


def stairwell(rect: Rect, toward: tuple[int, int], least: int) -> Cell | None:
    """The cell of a stairwell whose floor in front, at least so many decimetres deep, lies on the side `toward` (unit
    x, y); None where no stair fits."""
    x0, y0, x1, y1 = rect
    wide, deep = (x1 - x0, y1 - y0) if toward[1] else (y1 - y0, x1 - x0)
    flights = fitting(wide / 10, deep / 10, least / 10)
    if flights is None:
        return None
    way, floor = sum(toward), [*rect]
    far = abs(toward[1]) + 2 * (way < 0)  # the side of the floor in front that lies at the stairs
    floor[far] = rect[far - 2] - way * int(10 * (flights.approach + INNER))
    return Cell("stairwell", rect, wide * deep / 100, floor=cast(Rect, tuple(floor)), least=least)


def stairwells(rect: Rect) -> list[Cell]:
    """The ways to put a stair into a rectangle of a plan of one's own.

    Raises:
      HouseError: no stair fits.
    """
    cells = [c for t in ((0, -1), (0, 1), (-1, 0), (1, 0)) if (c := stairwell(rect, t, 10)) is not None]
    if not cells:
        size = f"{(rect[2] - rect[0]) / 10:g} x {(rect[3] - rect[1]) / 10:g}"
        raise HouseError(f"no stair fits a stairwell of {size} m; the smallest is 2 x 3.9 m from wall to wall")
    return cells


def stair_of(cell: Cell, names: tuple[str, str], storeys: Sequence[Storey], mirrored: bool, gallery: bool) -> Stair:
    """The stair of a stairwell.

    Args:
      names: ids of the room at its foot and of the room at its head.
      storeys: the two that it joins.
      gallery: whether the room at its foot is open to that at its head, where there is room for it.
    """
    assert cell.floor is not None
    (x0, y0, x1, y1), floor = (tuple(v / 10 for v in r) for r in (cell.rect, cell.floor))
    upright = floor[0] == x0 and floor[2] == x1  # v runs along y
    back = floor[3 if upright else 2] == (y1 if upright else x1)
    wide, deep = (x1 - x0, y1 - y0) if upright else (y1 - y0, x1 - x0)
    flights = fitting(wide, deep, cell.least / 10)
    assert flights is not None

    def world(u: float, v: float) -> tuple[float, float]:
        u, v = INNER + u, INNER + v
        u, v = (wide - u if mirrored else u), (deep - v if back else v)
        return (x0 + u, y0 + v) if upright else (x0 + v, y0 + u)

    low, high = storeys[0].elevation, storeys[1].elevation
    path = tuple((*world(u, v), low + (high - low) * risers / RISERS) for u, v, risers in flights.path)
    ring = lambda uv: shapely.orient_polygons(shapely.Polygon([world(*p) for p in uv])).exterior.coords[:-1]
    void = _void(flights, wide - 2 * INNER) if gallery else ()
    name, well = f"stair_{names[0].rpartition('_')[2]}", rounded(ring(flights.well))
    return Stair(name, names, rounded(path), flights.width, RISERS, well, rounded(ring(void)) if void else ())


def _void(flights: Flights, wide: float) -> tuple[tuple[float, float], ...]:
    """Corners (u, v) of the opening before a stair, with a gallery around it; none where it would be small."""
    (end, _, _), (before, _, _) = flights.path[-1], flights.path[-2]
    arrival = end if end > before else end - flights.width / 2  # one comes up along u, or along v
    left, far = (GALLERY, flights.approach) if len(flights.well) == 4 else flights.well[2]  # up to all flights
    right, near = min(wide - GALLERY, arrival), GALLERY
    if min(right - left, far - near) < LEAST_VOID:
        return ()
    return ((left, near), (right, near), (right, far), (left, far))
