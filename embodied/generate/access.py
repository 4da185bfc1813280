"""Who opens into whom: the doors and open joins that make a plan walkable without crossing private rooms; and how well
a plan would please an architect: one number from areas, proportions, daylight and neighbours."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from embodied.generate.footprint import Rect, shared_area
from embodied.generate.modules import Cell
from embodied.generate.program import NEIGHBOUR_VALUES, ROOM_TABLE

MOVING = {"hall", "corridor", "stairwell"}
"""Kinds of room that are there to be walked through."""

LOW = 12
"""Depth of what is too low under a slope for doors and windows, decimetres."""
Pair = tuple[int, int]


class SharedWall(NamedTuple):
    """A wall between two cells, or between a cell and the outdoors, decimetres."""

    axis: str
    """'x' or 'y': the axis it runs along."""
    across: int
    """Its coordinate on the other axis."""
    low: int
    high: int
    """Its interval on its own axis."""

    @property
    def length(self) -> int:
        """Decimetres."""
        return self.high - self.low


@dataclass(frozen=True)
class Link:
    """A way between two cells."""

    child: int
    parent: int
    wall: SharedWall


def shared_wall(a: tuple[int, int, int, int], b: tuple[int, int, int, int]) -> SharedWall | None:
    """The wall two rectangles share, None where they do not touch along more than a point."""
    if a[2] == b[0] or b[2] == a[0]:
        low, high = max(a[1], b[1]), min(a[3], b[3])
        return SharedWall("y", a[2] if a[2] == b[0] else a[0], low, high) if high > low else None
    if a[3] == b[1] or b[3] == a[1]:
        low, high = max(a[0], b[0]), min(a[2], b[2])
        return SharedWall("x", a[3] if a[3] == b[1] else a[1], low, high) if high > low else None
    return None


def walls_between(cells: list[Cell]) -> dict[tuple[int, int], SharedWall]:
    """(i, j) with i < j to the wall they share."""
    shared = {}
    for i, a in enumerate(cells):
        x0, y0, x1, y1 = a.rect
        for j in range(i + 1, len(cells)):
            p0, q0, p1, q1 = cells[j].rect
            if p0 <= x1 and p1 >= x0 and q0 <= y1 and q1 >= y0 and (wall := shared_wall(a.rect, cells[j].rect)):
                shared[i, j] = wall
    return shared


def ways_between(cells: Sequence[Cell], walls: Mapping[Pair, SharedWall]) -> dict[Pair, SharedWall]:
    """The walls, or the parts of them, in which a way may be: of a stairwell those beside its floor."""
    ways: dict[Pair, SharedWall | None] = dict(walls)
    for i, c in enumerate(cells):
        if c.floor is not None:
            ways |= {pair: w and beside_floor(c.floor, w) for pair, w in ways.items() if i in pair}
    return {pair: w for pair, w in ways.items() if w is not None}


def beside_floor(floor: Rect, wall: SharedWall) -> SharedWall | None:
    """The part of a stairwell's wall that its floor touches."""
    axis, across, low, high = wall
    along, sides = (floor[::2], floor[1::2]) if axis == "x" else (floor[1::2], floor[::2])
    low, high = max(low, along[0]), min(high, along[1])
    return SharedWall(axis, across, low, high) if across in sides and high > low else None


def beside_slopes(cell: Cell, wall: SharedWall) -> SharedWall:
    """The part of a cell's wall that is high enough for doors and windows; of no length under a slope."""
    axis, across, low, high = wall
    for side in cell.slopes:
        edge = (cell.rect[1:] + cell.rect[:1])[side]
        if "xy"[side % 2] == axis:
            high = low if across == edge else high
        elif side in (1, 2):
            high = min(high, edge - LOW)
        else:
            low = max(low, edge + LOW)
    return SharedWall(axis, across, low, high)


def outer_stretches(
    cells: list[Cell], walls: dict[tuple[int, int], SharedWall], i: int
) -> list[tuple[SharedWall, int]]:
    """Stretches of the edges of cell i that look outdoors, without what is low under slopes, each with the sense of its
    outward normal, longest first."""
    x0, y0, x1, y1 = cells[i].rect
    taken = [w for pair, w in walls.items() if i in pair]
    stretches = []
    for axis, across, low, high, side in (
        ("x", y0, x0, x1, -1),
        ("y", x1, y0, y1, 1),
        ("x", y1, x0, x1, 1),
        ("y", x0, y0, y1, -1),
    ):
        at = low
        for _, _, p, q in sorted(w for w in taken if w.axis == axis and w.across == across):
            if p > at:
                stretches.append((SharedWall(axis, across, at, p), side))
            at = max(at, q)
        if high > at:
            stretches.append((SharedWall(axis, across, at, high), side))
    upright = ((beside_slopes(cells[i], wall), side) for wall, side in stretches)
    return sorted((f for f in upright if f[0].length > 0), key=lambda f: (-f[0].length, f[0]))


def has_outer_doors(cells: list[Cell], walls: dict[tuple[int, int], SharedWall]) -> bool:
    """True if the hall has room for a front door and every garage for a car to drive in."""
    need = {"hall": 14, "garage": 29}
    for i, c in enumerate(cells):
        if c.kind in need:
            stretches = outer_stretches(cells, walls, i)
            if not stretches or stretches[0][0].length < need[c.kind]:
                return False
    return True


def connect(cells: list[Cell], walls: dict[tuple[int, int], SharedWall]) -> tuple[list[Link], float] | None:
    """The cheapest set of entrances that reaches every cell from the hall, upstairs from the stairwell, and its cost.

    Grows a tree from there (Prim's algorithm) over the permitted entrances, then adds joins.

    Returns:
      None where some cell cannot be reached.
    """
    start = next((i for kind in ("hall", "stairwell") for i, c in enumerate(cells) if c.kind == kind), None)
    if start is None:
        return None
    walls = ways_between(cells, walls)
    options: list[list[tuple[float, int, SharedWall]]] = [[] for _ in cells]
    for (i, j), wall in walls.items():
        for child, parent in ((i, j), (j, i)):
            cost, kinds = _cost(cells, child, parent), {cells[child].kind, cells[parent].kind}
            needed = 9 if kinds <= MOVING else 0 if cells[i].is_with(cells[j]) else ROOM_TABLE[cells[child].kind].wall
            if cost is not None and wall.length >= needed:
                options[parent].append((cost, child, wall))
    links: list[Link] = []
    reached = {start}
    frontier = [(cost, child, start, wall) for cost, child, wall in options[start]]
    total = 0.0
    while frontier:
        best = min(frontier, key=lambda f: (f[0], f[1], f[2]))
        frontier.remove(best)
        cost, child, parent, wall = best
        if child in reached:
            continue
        reached.add(child)
        total += cost
        links.append(Link(child, parent, wall))
        frontier += [(c, k, child, w) for c, k, w in options[child] if k not in reached]
    if len(reached) < len(cells):
        return None
    tree = {(min(k.child, k.parent), max(k.child, k.parent)) for k in links}
    for (i, j), wall in walls.items():
        a, b = cells[i].kind, cells[j].kind
        least = ROOM_TABLE[a].joins.get(b) or ROOM_TABLE[b].joins.get(a)
        if least and (i, j) not in tree and wall.length >= least:
            links.append(Link(i, j, wall))
    links += _second_doors(cells, walls, links)
    return links, total


def _second_doors(cells: list[Cell], walls: dict[tuple[int, int], SharedWall], links: list[Link]) -> list[Link]:
    """A door to hall or corridor for living rooms and kitchens that are entered through each other only."""
    doors = []
    for i, c in enumerate(cells):
        if c.kind not in ("living_room", "kitchen", "family_room"):
            continue
        ways = [k.parent if k.child == i else k.child for k in links if i in (k.child, k.parent)]
        if any(cells[k].kind in ("hall", "corridor") for k in ways):
            continue
        beside = [
            (cells[j + k - i].kind != "hall", -w.length, j + k - i, w)
            for (j, k), w in walls.items()
            if i in (j, k) and cells[j + k - i].kind in ("hall", "corridor") and w.length >= 12
        ]
        if beside:
            _, _, other, wall = min(beside)
            doors.append(Link(i, other, wall))
    return doors


def _cost(cells: list[Cell], child: int, parent: int) -> float | None:
    c, p = cells[child], cells[parent]
    if c.is_with(p):
        return -1.0
    if c.owner is not None:
        return 0.0 if c.owner == parent else None
    if not ROOM_TABLE[p.kind].leads_on and c.kind not in ROOM_TABLE[p.kind].leads_to:
        return None
    return ROOM_TABLE[c.kind].entered_from.get("corridor" if p.kind == "stairwell" else p.kind)


WET = ("bathroom", "toilet", "laundry_room", "kitchen")


def score(cells: list[Cell], walls: dict[tuple[int, int], SharedWall]) -> float:
    """Higher is better; entrances are judged by access.connect."""
    inner = [0] * len(cells)
    value = 0.0
    joined: dict[int, float] = {}
    for (i, j), (_, _, low, high) in walls.items():
        n = high - low
        inner[i] += n
        inner[j] += n
        a, b = cells[i].kind, cells[j].kind
        worth = NEIGHBOUR_VALUES.get(frozenset((a, b)))
        if worth and n >= 12:
            value += worth
        if a in WET and b in WET:
            joined[i] = joined[j] = 0.3
    value += sum(joined.values())
    total = moving = 0.0
    for i, c in enumerate(cells):
        x0, y0, x1, y1 = c.rect
        w, h = x1 - x0, y1 - y0
        area = w * h / 100
        total += area
        short, long = min(w, h), max(w, h)
        outer = 2 * (w + h) - inner[i]
        if c.kind == "corridor":
            moving += area
            value -= 0.07 * max(0, long - 80) + 0.15 * (long / 10 > 3)
            continue
        kind = ROOM_TABLE[c.kind]
        least, most = kind.area
        if c.kind in ("hall", "stairwell"):
            moving += 0.5 * area
        value -= 0.3 * max(0.0, kind.side * 10 - short) if c.kind != "hall" else 0.5 * max(0, 14 - short)
        if area < least:
            value -= (15.0 if kind.is_tight else 5.0) * math.log(least / area)
        elif area > most:
            value -= 5.0 * math.log(area / most)
        value -= 0.7 * abs(math.log(area / c.area))
        value -= (4.0 if area > 15 else 3.0) * max(0.0, long / short - kind.longest)
        if kind.needs_daylight and outer < max(16, (0.7 if c.kind == "sun_room" else 0.26) * (w + h)):
            value -= 12.0 if outer < 16 else 5.0
        if c.kind in ("hall", "garage") and outer < (13 if c.kind == "hall" else 26):
            value -= 12.0
        if c.kind == "garage" and outer > 0.45 * 2 * (w + h):
            value += 0.8
        if c.kind == "bathroom" and outer >= 10:
            value += 0.3
        if c.kind in ("living_room", "family_room", "sun_room"):
            value += 0.4 * min(outer / 60, 2.0)
    return value - 18.0 * max(0.0, moving / total - 0.1)


def worth_above(cells: list[Cell], wet: tuple[Rect, ...]) -> float:
    """Worth of the bathrooms that lie above rooms with water, whose pipes they share."""
    baths = [c.rect for c in cells if c.kind in ("bathroom", "toilet")] if wet else []
    return 1.5 * sum(any(shared_area(a, b) > 100 for b in wet) for a in baths)
