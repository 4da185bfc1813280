"""Doors, passages and windows of a plan: where they sit in their walls, how wide, which way they swing."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from embodied.generate.access import MOVING, Link, Pair, SharedWall, beside_floor, outer_stretches, walls_between
from embodied.generate.layout import FloorPlan
from embodied.generate.modules import Cell
from embodied.generate.program import ROOM_TABLE
from embodied.geometry import rotation
from embodied.house.house import Opening, rounded

Point = tuple[float, float]
KNEE = 1.1
"""Height of the walls that slopes begin from, metres."""
ROOF_WINDOW, ROOF_WINDOWS_APART = (0.78, 0.94, 1.14), 1.5
"""Widths of roof windows, and metres of wall that each has."""
NIB = 0.16
"""From a wall's centre-line corner to the jamb: half an inner wall and 0.1 m, metres."""
FRENCH = {"living_room": 1.0, "sun_room": 1.0, "family_room": 0.8, "dining_room": 0.35, "library": 0.12}
"""Room kind to the chance of a French window to the garden."""
FRENCH_BEDROOM, LARGE_BEDROOM = 0.12, 15.0
"""The same for main bedrooms, if they are at least so large, square metres."""
UTILITY = ("kitchen", "laundry_room", "workshop")
"""Room kinds that may have the back door."""
Rectangle = tuple[float, float, float, float]
"""x0, y0, x1, y1, metres."""


@dataclass(frozen=True)
class OuterWall:
    """A stretch of a cell's edge that looks outdoors, metres."""

    cell: int
    index: int
    """Among the cell's outer walls, the longest first."""
    axis: str
    across: float
    low: float
    high: float
    side: int
    """Sense of the outward normal across: +1 or -1."""

    @property
    def length(self) -> float:
        """Metres."""
        return self.high - self.low


@dataclass(frozen=True)
class Leaves:
    """Material keys of what closes openings."""

    door: str
    front_door: str
    frame: str
    """Of windows and garage doors."""

    def of(self, kind: str) -> str | None:
        """The key for an opening kind; None for bare passages."""
        if kind == "passage":
            return None
        return {"door": self.door, "front_door": self.front_door, "back_door": self.front_door}.get(kind, self.frame)


@dataclass
class _Openings:
    """The openings of a plan so far, and the floor that their leaves sweep."""

    plan: FloorPlan
    names: tuple[str, ...]
    """Room id of each cell."""
    leaves: Leaves
    outside: list[list[OuterWall]]
    free: dict[tuple[int, int], list[tuple[float, float]]]
    """(cell, index of its outer wall) to the intervals of it without openings, metres."""
    storey: int = 0
    found: list[Opening] = field(default_factory=list)
    swings: list[Rectangle] = field(default_factory=list)
    stands: list[Rectangle] = field(default_factory=list)
    """Areas of leaves that stand open."""
    zones: list[Rectangle] = field(default_factory=list)
    """Floor before and behind every way through, which no leaf should stand in."""
    counts: Counter[str] = field(default_factory=Counter)

    def add(
        self,
        kind: str,
        rooms: tuple[str, str | None],
        jambs: tuple[Point, Point],
        sill: float,
        head: float,
        hinge: str = "a",
        angle: float = 0.0,
    ) -> None:
        self.counts[kind] += 1
        name, leaf = f"{kind}_{self.counts[kind]}", self.leaves.of(kind)
        a, b, sill, head, angle = rounded((*jambs, sill, head, angle))
        self.found.append(Opening(name, kind, rooms, a, b, sill, head, leaf, hinge, angle))

    def add_outer(
        self,
        w: OuterWall,
        kind: str,
        start: float,
        width: float,
        *,
        sill: float = 0.0,
        head: float = 2.1,
        hinge: str = "a",
    ) -> None:
        """An opening to the outdoors from `start` along a wall, metres."""
        jambs = _jambs(self.plan.cells[w.cell], w.axis, w.across, start, start + width)
        low, high = start - 0.25, start + width + 0.25  # a quarter of a metre on both sides
        cut = ((a, b, p, q) for a, b in self.free[w.cell, w.index] for p, q in ((a, low), (high, b)))
        self.free[w.cell, w.index] = [(max(a, p), min(b, q)) for a, b, p, q in cut if min(b, q) > max(a, p)]
        self.add(kind, (self.names[w.cell], None), jambs, sill, head, hinge)
        if kind in ("front_door", "back_door"):
            self.swings.append(_swing(w.axis, w.across, start, start + width, -w.side))


def outer_walls(cells: tuple[Cell, ...], walls: dict[Pair, SharedWall], climbs: bool) -> list[list[OuterWall]]:
    """For each cell its stretches of outer wall, longest first; of a stairwell that `climbs` those beside its floor."""
    outer: list[list[OuterWall]] = []
    for i, c in enumerate(cells):
        stretches = outer_stretches(list(cells), walls, i)
        if c.floor is not None and climbs:
            stretches = [(part, side) for w, side in stretches if (part := beside_floor(c.floor, w)) is not None]
        metres = ((k, w.axis, w.across / 10, w.low / 10, w.high / 10, side) for k, (w, side) in enumerate(stretches))
        outer.append([OuterWall(i, *m) for m in metres])
    return outer


def draw_openings(
    plans: Sequence[FloorPlan],
    names: Sequence[tuple[str, ...]],
    leaves: Leaves,
    height: float,
    open_plan: bool,
    *,
    rng: np.random.Generator,
) -> tuple[Opening, ...]:
    """All openings of the storeys of a plan.

    Args:
      names: for each storey the room id of each cell.
      height: clear storey height, metres.
      open_plan: whether living, dining and kitchen join through wide openings.
    """
    openings: list[Opening] = []
    counts: Counter[str] = Counter()
    for storey, (plan, own) in enumerate(zip(plans, names, strict=True)):
        outside = outer_walls(plan.cells, walls_between(list(plan.cells)), climbs=storey + 1 < len(plans))
        free = {(w.cell, w.index): [(w.low, w.high)] for walls in outside for w in walls}
        made = _Openings(plan, own, leaves, outside, free, storey, counts=counts)
        _draw_storey(made, height, open_plan, rng)
        openings += made.found
    return tuple(openings)


def _draw_storey(made: _Openings, height: float, open_plan: bool, rng: np.random.Generator) -> None:
    plan = made.plan
    if made.storey == 0:
        _front_door(made, rng)
    between = lambda k: frozenset((made.names[k.child], made.names[k.parent]))
    links = list({between(k): k for k in reversed(plan.links) if len(between(k)) == 2}.values())[::-1]
    wide = [k for k in links if _is_wide(plan, k)]
    for link in wide:
        _passage(made, link, height, open_plan, rng)
    doors = sorted((k for k in links if k not in wide), key=lambda k: _is_tiny(plan.cells[k.child]))
    for link in doors:
        if not (_is_tiny(plan.cells[link.child]) and _folded_door(made, link, rng)):
            _door(made, link, rng)
    _outer_doors(made, rng)
    for i in range(len(plan.cells)):
        _windows(made, i, height, rng)
        for side in plan.cells[i].slopes:
            _roof_windows(made, i, side, height, rng)


def _is_wide(plan: FloorPlan, link: Link) -> bool:
    """True if a way through is a passage without a leaf."""
    kinds = {plan.cells[link.child].kind, plan.cells[link.parent].kind}
    return all(ROOM_TABLE[k].is_open for k in kinds) or kinds <= MOVING or kinds == {"hall", "living_room"}


def _jambs(cell: Cell, axis: str, across: float, low: float, high: float) -> tuple[Point, Point]:
    """The two jambs, in the sense that leaves `cell` on the left of a -> b."""
    _, y0, x1, _ = _metres(cell)
    forward = abs(across - y0) < 1e-6 if axis == "x" else abs(across - x1) < 1e-6
    p, q = ((low, across), (high, across)) if axis == "x" else ((across, low), (across, high))
    return (p, q) if forward else (q, p)


def _metres(cell: Cell) -> Rectangle:
    x0, y0, x1, y1 = cell.rect
    return x0 / 10, y0 / 10, x1 / 10, y1 / 10


def _passage(made: _Openings, link: Link, height: float, open_plan: bool, rng: np.random.Generator) -> None:
    """A way without a leaf, wide where rooms flow into each other."""
    plan, axis, (across, low, high) = made.plan, link.wall.axis, _wall_metres(link)
    a, b = plan.cells[link.child], plan.cells[link.parent]
    kinds = {a.kind, b.kind}
    room = high - low - 2 * NIB
    width = min(room, _passage_width(kinds, room, open_plan, rng))
    tight = any(c.kind == "kitchen" and _area(c) < 9.5 for c in (a, b))  # its units need the wall
    if tight:
        width = min(width, 1.2)
    slack = room - width
    where = float(rng.choice([0, 0.5, 1]))
    middle = (kinds <= MOVING or open_plan) and not tight
    start = low + NIB + slack * (0.5 if middle else round(where) if tight else where)
    head = round(min(height - 0.15, float(rng.choice([2.2, 2.3, 2.4]))), 2)
    made.zones.append(_front(axis, across, start, start + width))
    ends = (made.names[link.child], made.names[link.parent])
    made.add("passage", ends, _jambs(a, axis, across, start, start + width), 0.0, head)


def _passage_width(kinds: set[str], room: float, open_plan: bool, rng: np.random.Generator) -> float:
    """Wanted width of a passage between two kinds in `room` metres of wall."""
    if kinds <= MOVING:
        return 1.4
    if "hall" in kinds:
        return float(rng.choice([1.0, 1.4, 1.8]))
    if "library" in kinds or "sun_room" in kinds:
        return float(rng.choice([1.4, 1.8]))
    if open_plan:
        return max(1.4, round(float(rng.uniform(0.65, 0.95)) * room, 1))
    return float(rng.choice([0.9, 1.2, 1.6]))


def _wall_metres(link: Link) -> tuple[float, float, float]:
    """Coordinate across and interval of the wall of a link, metres."""
    w = link.wall
    return w.across / 10, w.low / 10, w.high / 10


def _area(cell: Cell) -> float:
    """Of a cell of the plan, square metres."""
    x0, y0, x1, y1 = _metres(cell)
    return (x1 - x0) * (y1 - y0)


def _beside(axis: str, low: float, high: float, across: float, other: float) -> Rectangle:
    """From low to high along a wall, between two coordinates across it."""
    c, d = sorted((across, other))
    return (low, c, high, d) if axis == "x" else (c, low, d, high)


def _swing(axis: str, across: float, low: float, high: float, side: int) -> Rectangle:
    """The square a leaf sweeps on `side` of its wall."""
    return _beside(axis, low, high, across, across + side * (high - low))


def _front(axis: str, across: float, low: float, high: float) -> Rectangle:
    """The floor half a metre before and behind a way through."""
    return _beside(axis, low + 0.12, high - 0.12, across - 0.55, across + 0.55)


def _open_leaf(axis: str, across: float, low: float, high: float, side: int, at_low: bool) -> Rectangle:
    """Area of the leaf when open at a right angle, with a little air."""
    a, b = (low - 0.05, low + 0.1) if at_low else (high - 0.1, high + 0.05)
    return _beside(axis, a, b, across + side * 0.06, across + side * (high - low + 0.3))


def _overlap(a: Rectangle, b: Rectangle) -> float:
    return max(0.0, min(a[2], b[2]) - max(a[0], b[0])) * max(0.0, min(a[3], b[3]) - max(a[1], b[1]))


def _door(made: _Openings, link: Link, rng: np.random.Generator) -> None:
    """A leaf door near the corner of the room it swings into, clear of the other leaves."""
    axis, (across, low, high) = link.wall.axis, _wall_metres(link)
    cell = made.plan.cells[link.child]
    own, side = _span_and_side(cell, axis, across)
    width = min(ROOM_TABLE[cell.kind].door, high - low - 2 * NIB)
    places = []
    for start in (low + NIB, high - NIB - width, (low + high - width) / 2):
        corner = min(start - own[0], own[1] - start - width)
        crowd = sum(_overlap(_swing(axis, across, start, start + width, side), s) for s in made.swings)
        front = _front(axis, across, start, start + width)
        shut = sum(_overlap(front, s) for s in made.stands)
        near_low = start - own[0] <= own[1] - start - width
        for at_low in (True, False):
            leaf = _open_leaf(axis, across, start, start + width, side, at_low)
            block = shut + sum(_overlap(leaf, z) for z in made.zones)
            cost = 60.0 * block + 2.0 * crowd + 0.8 * max(0.0, corner - 0.2) + 0.5 * (at_low != near_low)
            cost += float(rng.uniform(0, 0.15))
            places.append((cost, start, at_low))
    _, start, at_low = min(places, key=lambda place: place[0])
    end = start + width
    made.swings.append(_swing(axis, across, start, end, side))
    made.stands.append(_open_leaf(axis, across, start, end, side, at_low))
    made.zones.append(_front(axis, across, start, end))
    jambs = _jambs(cell, axis, across, start, end)
    open_by = math.radians(float(rng.uniform(82, 95)) if rng.random() < 0.8 else float(rng.uniform(60, 80)))
    ends = (made.names[link.child], made.names[link.parent])
    made.add("door", ends, jambs, 0.0, 2.05, _hinge(jambs, at_low), open_by)


def _span_and_side(cell: Cell, axis: str, across: float) -> tuple[tuple[float, float], int]:
    """The interval of a cell along one of its walls, metres, and on which side of the wall it lies."""
    x0, y0, x1, y1 = _metres(cell)
    if axis == "x":
        return (x0, x1), 1 if (y0 + y1) / 2 > across else -1
    return (y0, y1), 1 if (x0 + x1) / 2 > across else -1


def _hinge(jambs: tuple[Point, Point], at_low: bool) -> str:
    """The jamb that carries a leaf which hangs at the lower end of its hole, or at the upper one."""
    p, q = jambs
    return "a" if (p[0] + p[1] < q[0] + q[1]) == at_low else "b"


def _is_tiny(cell: Cell) -> bool:
    """True if a leaf inside would leave no room to stand."""
    x0, y0, x1, y1 = cell.rect
    return cell.kind == "toilet" and (x1 - x0) * (y1 - y0) < 300


def _folded_door(made: _Openings, link: Link, rng: np.random.Generator) -> bool:
    """A leaf that opens outwards and folds back on the wall beside it; False where other doors leave no place."""
    axis, (across, low, high) = link.wall.axis, _wall_metres(link)
    outer = made.plan.cells[link.parent]
    if outer.kind == "stairwell":
        return False
    own, side = _span_and_side(outer, axis, across)
    width = min(ROOM_TABLE[made.plan.cells[link.child].kind].door, high - low - 2 * NIB)
    k = 0 if axis == "x" else 1
    taken = [
        sorted((o.a[k], o.b[k]))
        for o in made.found
        if abs(o.a[1 - k] - across) < 0.01 and abs(o.b[1 - k] - across) < 0.01
    ]
    spots = []
    for start in (low + NIB, high - NIB - width):
        for at_low in (True, False):
            a, b = (start - width - 0.05, start) if at_low else (start + width, start + 2 * width + 0.05)
            if a < own[0] + 0.08 or b > own[1] - 0.08 or any(a < q and p < b for p, q in taken):
                continue
            swept = _swing(axis, across, a, b, side)
            spots.append((sum(_overlap(swept, s) for s in made.swings), float(rng.uniform(0, 0.1)), start, at_low))
    if not spots:
        return False
    _, _, start, at_low = min(spots)
    jambs = _jambs(outer, axis, across, start, start + width)
    made.swings.append(_swing(axis, across, start, start + width, side))
    made.zones.append(_front(axis, across, start, start + width))
    open_by = math.radians(float(rng.uniform(164, 174)))
    ends = (made.names[link.parent], made.names[link.child])
    made.add("door", ends, jambs, 0.0, 2.05, _hinge(jambs, at_low), open_by)
    return True


def _front_door(made: _Openings, rng: np.random.Generator) -> None:
    """In an outer wall of the hall, the one that suits its narrow side best."""
    i = next(k for k, c in enumerate(made.plan.cells) if c.kind == "hall")
    x0, y0, x1, y1 = _metres(made.plan.cells[i])
    walls = [w for w in made.outside[i] if w.length >= 1.25]
    w = min(walls, key=lambda w: (abs(w.length - min(x1 - x0, y1 - y0)), w.index))
    width = 1.0 if w.length > 1.5 else 0.9
    slack = w.high - w.low - 2 * 0.2 - width
    start = round(w.low + 0.2 + slack * (0.5 if slack < 0.6 else float(rng.choice([0.15, 0.5, 0.85]))), 2)
    made.add_outer(w, "front_door", start, width, hinge=str(rng.choice(["a", "b"])))


def _outer_doors(made: _Openings, rng: np.random.Generator) -> None:
    """Garage doors, French windows to the garden, a back door from kitchen or utility."""
    back = False
    for i, c in enumerate(made.plan.cells):
        if c.kind == "garage":
            _garage_door(made, i)
        elif c.kind in FRENCH or c.kind == "main_bedroom":
            _french_window(made, i, rng)
        elif c.kind in UTILITY and not back and made.storey == 0 and rng.random() < 0.3:
            back = _back_door(made, i, rng)


def _garage_door(made: _Openings, i: int) -> None:
    x0, y0, x1, y1 = _metres(made.plan.cells[i])
    wide = 4.8 if min(x1 - x0, y1 - y0) > 5.4 else 2.5
    fits = [w for w in made.outside[i] if w.length > 2.5]
    if fits:
        w = min(fits, key=lambda w: (w.length < wide + 0.3, w.length, w.index))
        width = min(wide, w.length - 0.4)
        made.add_outer(w, "garage_door", (w.low + w.high - width) / 2, width, head=2.2)


def _french_window(made: _Openings, i: int, rng: np.random.Generator) -> None:
    cell = made.plan.cells[i]
    is_bedroom = cell.kind == "main_bedroom"
    chance = FRENCH[cell.kind] if not is_bedroom else FRENCH_BEDROOM if _area(cell) >= LARGE_BEDROOM else 0.0
    if rng.random() >= chance or not made.outside[i] or made.outside[i][0].length <= 2.2:
        return
    w = made.outside[i][0]
    room = w.high - w.low - 0.8
    width = min(room, float(rng.choice([1.4, 1.6] if is_bedroom else [1.6, 1.8, 2.4, 3.0])))
    at = float(rng.choice([0.18, 0.5, 0.82])) if room > 2 * width + 1.0 else 0.5
    made.add_outer(w, "french_window", round(w.low + 0.4 + (room - width) * at, 2), width, head=2.2)


def _back_door(made: _Openings, i: int, rng: np.random.Generator) -> bool:
    """True if there was an outer wall for it. It is hung elsewhere where it would meet a leaf that stands open."""
    fits = [w for w in made.outside[i] if w.length > 2.4]
    if fits:
        places = [(w, start) for w in reversed(fits) for start in (w.low + 0.3, w.high - 1.2)]
        place = places[rng.random() >= 0.5]
        drawn = (*place, str(rng.choice(["a", "b"])))
        every = (drawn, *((*place, hinge) for place in places for hinge in "ab"))
        w, start, hinge = next((x for x in every if not _meets_open_leaf(made, *x)), drawn)
        made.add_outer(w, "back_door", start, 0.9, hinge=hinge)
    return bool(fits)


def _meets_open_leaf(made: _Openings, w: OuterWall, start: float, hinge: str) -> bool:
    """True if a back door would meet a leaf that stands open, or its handle."""
    post = _jambs(made.plan.cells[w.cell], w.axis, w.across, start, start + 0.9)["ab".index(hinge)]
    swept = shapely.Point(post).buffer(0.9) & shapely.box(*_swing(w.axis, w.across, start, start + 0.9, -w.side))
    sides = ((o, 1 if o.hinge == "a" else -1) for o in made.found if o.angle)
    leaves = ((*np.array((o.a, o.b)[::side]), side * o.angle) for o, side in sides)
    return any(swept.intersects(shapely.LineString([p, p + rotation(t) @ (q - p)]).buffer(0.07)) for p, q, t in leaves)


def _windows(made: _Openings, i: int, height: float, rng: np.random.Generator) -> None:
    """Windows for one room: as much glass as its floor asks for, centred on the free stretches of outer wall."""
    c = made.plan.cells[i]
    kind = ROOM_TABLE[c.kind]
    if kind.glass is None:
        return
    x0, y0, x1, y1 = _metres(c)
    floor = (x1 - x0) * (y1 - y0)
    is_bay = c.room is not None and c.area > 2 * floor
    wanted = kind.glass * (c.area if is_bay else floor) * float(rng.uniform(0.85, 1.2))
    french = [o for o in made.found if o.rooms[0] == made.names[i] and o.kind == "french_window" and not is_bay]
    glazed = sum(o.head * math.dist(o.a, o.b) for o in french)
    sill, head = kind.sills[bool(rng.random() < 0.4)], kind.head
    left = wanted - 0.6 * glazed
    stretches = sorted(
        ((b - a, w, a, b) for w in made.outside[i] for a, b in made.free[i, w.index] if b - a > 1.0),
        key=lambda s: (-s[0], s[1].index, s[2]),
    )
    placed = 0
    for length, w, a, _ in stretches:
        if left < 0.25 * wanted and placed or placed >= kind.most or (left < 0.1 * wanted and glazed):
            break
        room = length - 0.6
        if room < 0.5:
            continue
        count = max(1, min(kind.most - placed, math.ceil(length / 3.6)))
        width = min(room / count - 0.4 * (count > 1), left / (head - sill) / count, kind.widest)
        width = round(max(width, min(0.6, room)) * 10) / 10
        for n in range(count):
            start = round(a + length * (n + 0.5) / count - width / 2, 2)
            made.add_outer(w, "window", start, width, sill=sill, head=min(head, height - 0.15))
            left -= width * (head - sill)
            placed += 1


def _roof_windows(made: _Openings, i: int, side: int, height: float, rng: np.random.Generator) -> None:
    """Windows in the slope over one side of a room, evenly along it."""
    c = made.plan.cells[i]
    glass, (x0, y0, x1, y1) = ROOM_TABLE[c.kind].glass, _metres(c)
    if glass is None:
        return
    axis, across = ("x" if side % 2 == 0 else "y"), (y0, x1, y1, x0)[side]
    low, high = (x0, x1) if axis == "x" else (y0, y1)
    width = min(float(rng.choice(ROOF_WINDOW)), high - low - 2 * NIB)
    sill, head = KNEE + 0.1, round(min(height - 0.1, KNEE + 1.1), 2)
    wanted = glass * _area(c) / len(c.slopes) / (width * (head - sill) * math.sqrt(2))
    count = int(np.clip(round(wanted), 1, max(1, (high - low) // ROOF_WINDOWS_APART)))
    for n in range(count):
        start = round(low + (high - low) * (n + 0.5) / count - width / 2, 2)
        made.add("roof_window", (made.names[i], None), _jambs(c, axis, across, start, start + width), sill, head)
