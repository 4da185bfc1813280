"""Doors, passages and windows of a plan: where they sit in their walls, how wide, which way they swing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from embodied.generate.access import Wall, outer_stretches, walls_between
from embodied.generate.kinds import BEDROOMS
from embodied.generate.layout import Plan
from embodied.generate.modules import Cell
from embodied.house.house import Opening, rounded

NIB = 0.16
"""From a wall's centre-line corner to the jamb: half an inner wall and 0.1 m, metres."""
DOOR = {"bathroom": 0.8, "toilet": 0.75, "closet": 0.75, "pantry": 0.75, "laundry_room": 0.8}
"""Clear width of a room's door, metres; 0.85 for the others."""
OPEN_KINDS = ("living_room", "dining_room", "kitchen", "family_room", "sun_room", "library")
GLASS = {
    "living_room": 0.2,
    "family_room": 0.18,
    "dining_room": 0.17,
    "sun_room": 0.4,
    "kitchen": 0.13,
    "study": 0.15,
    "library": 0.14,
    "gym": 0.14,
    "playroom": 0.15,
    "workshop": 0.1,
    "garage": 0.03,
    "laundry_room": 0.1,
    "bathroom": 0.1,
    "toilet": 0.15,
    "hall": 0.08,
    "corridor": 0.1,
    **{k: 0.14 for k in BEDROOMS},
}
"""Window area as a share of the floor area."""


@dataclass(frozen=True)
class OuterWall:
    """A stretch of a cell's edge that looks outdoors, metres."""

    cell: int
    axis: str
    across: float
    low: float
    high: float
    side: int
    """Sense of the outward normal across: +1 or -1."""


def outer_walls(cells: tuple[Cell, ...], walls: dict[tuple[int, int], Wall]) -> list[list[OuterWall]]:
    """For each cell its stretches of outer wall, longest first."""
    return [
        [
            OuterWall(i, w[0], w[1] / 10, w[2] / 10, w[3] / 10, side)
            for w, side in outer_stretches(list(cells), walls, i)
        ]
        for i in range(len(cells))
    ]


@dataclass
class _Draft:
    """The openings so far and the floor that their leaves sweep."""

    openings: list[Opening]
    swings: list[tuple[float, float, float, float]]
    leaves: list[tuple[float, float, float, float]]
    """Where leaves stand open."""
    zones: list[tuple[float, float, float, float]]
    """Floor before and behind every way through, which no leaf should stand in."""
    counts: dict[str, int]
    names: tuple[str, ...]
    leaf: str
    outer_leaf: str
    window_leaf: str

    def name(self, kind: str) -> str:
        self.counts[kind] = self.counts.get(kind, 0) + 1
        return f"{kind}_{self.counts[kind]}"


def draw_openings(
    plan: Plan,
    names: tuple[str, ...],
    leaves: tuple[str, str, str],
    height: float,
    open_plan: bool,
    *,
    rng: np.random.Generator,
) -> tuple[Opening, ...]:
    """All openings of a plan.

    Args:
      names: room id of each cell.
      leaves: material keys of inner doors, the front door and window frames.
      height: clear storey height, metres.
      open_plan: whether living, dining and kitchen join through wide openings.
    """
    walls = walls_between(list(plan.cells))
    outside = outer_walls(plan.cells, walls)
    draft = _Draft([], [], [], [], {}, names, *leaves)
    free = {(i, k): [(w.low, w.high)] for i, ws in enumerate(outside) for k, w in enumerate(ws)}
    _front_door(plan, outside, free, draft, rng)
    wide = [k for k in plan.links if _is_wide(plan, k)]
    for link in wide:
        _passage(plan, link, draft, height, open_plan, rng)
    doors = sorted((k for k in plan.links if k not in wide), key=lambda k: _is_tiny(plan.cells[k.child]))
    for link in doors:
        if not (_is_tiny(plan.cells[link.child]) and _folded_door(plan, link, draft, rng)):
            _door(plan, link, draft, rng)
    _outer_doors(plan, outside, free, draft, rng)
    for i in range(len(plan.cells)):
        _windows(plan, i, outside[i], free, draft, height, rng)
    return tuple(draft.openings)


def _is_wide(plan: Plan, link) -> bool:
    kinds = {plan.cells[link.child].kind, plan.cells[link.parent].kind}
    return kinds <= {*OPEN_KINDS, "hall", "corridor"} and (
        kinds <= set(OPEN_KINDS) or kinds <= {"hall", "corridor"} or kinds == {"hall", "living_room"}
    )


def _jambs(cell: Cell, axis: str, across: float, low: float, high: float) -> tuple[tuple, tuple]:
    """The two jambs, in the sense that leaves `cell` on the left of a -> b."""
    _, y0, x1, _ = (v / 10 for v in cell.rect)
    forward = abs(across - y0) < 1e-6 if axis == "x" else abs(across - x1) < 1e-6
    p, q = ((low, across), (high, across)) if axis == "x" else ((across, low), (across, high))
    return (p, q) if forward else (q, p)


def _passage(plan: Plan, link, draft: _Draft, height: float, open_plan: bool, rng: np.random.Generator) -> None:
    axis, across, low, high = link.wall[0], *(v / 10 for v in link.wall[1:])
    a, b = plan.cells[link.child], plan.cells[link.parent]
    kinds = {a.kind, b.kind}
    room = high - low - 2 * NIB
    if kinds <= {"hall", "corridor"}:
        width = min(room, 1.4)
    elif "hall" in kinds:
        width = min(room, float(rng.choice([1.0, 1.4, 1.8])))
    elif "library" in kinds or "sun_room" in kinds:
        width = min(room, float(rng.choice([1.4, 1.8])))
    else:
        width = min(
            room,
            max(1.4, round(float(rng.uniform(0.65, 0.95)) * room, 1))
            if open_plan
            else float(rng.choice([0.9, 1.2, 1.6])),
        )
    tight = any(c.kind == "kitchen" and _area(c) < 9.5 for c in (a, b))  # its units need the wall
    if tight:
        width = min(width, 1.2)
    slack = room - width
    where = float(rng.choice([0, 0.5, 1]))
    middle = (kinds <= {"hall", "corridor"} or open_plan) and not tight
    start = low + NIB + slack * (0.5 if middle else round(where) if tight else where)
    p, q = _jambs(a, axis, across, start, start + width)
    head = round(min(height - 0.15, float(rng.choice([2.2, 2.3, 2.4]))), 2)
    draft.zones += _fronts(axis, across, start, start + width)
    draft.openings.append(
        Opening(
            draft.name("passage"),
            "passage",
            (draft.names[link.child], draft.names[link.parent]),
            rounded(p),
            rounded(q),
            0.0,
            head,
            None,
        )
    )


def _area(cell) -> float:
    """Of a cell of the plan, square metres."""
    x0, y0, x1, y1 = (v / 10 for v in cell.rect)
    return (x1 - x0) * (y1 - y0)


def _swing(axis: str, across: float, low: float, high: float, side: int) -> tuple[float, float, float, float]:
    """x0, y0, x1, y1 of the square a leaf sweeps on `side` of its wall."""
    c, d = sorted((across, across + side * (high - low)))
    return (low, c, high, d) if axis == "x" else (c, low, d, high)


def _fronts(axis: str, across: float, low: float, high: float) -> list[tuple[float, float, float, float]]:
    """The floor half a metre before and behind a way through."""
    low, high = low + 0.12, high - 0.12
    c, d = across - 0.55, across + 0.55
    return [(low, c, high, d) if axis == "x" else (c, low, d, high)]


def _open_leaf(axis: str, across: float, low: float, high: float, side: int, at_low: bool) -> tuple:
    """Where the leaf stands when open at a right angle, with a little air."""
    a, b = (low - 0.05, low + 0.1) if at_low else (high - 0.1, high + 0.05)
    c, d = sorted((across + side * 0.06, across + side * (high - low + 0.3)))
    return (a, c, b, d) if axis == "x" else (c, a, d, b)


def _overlap(a: tuple, b: tuple) -> float:
    return max(0.0, min(a[2], b[2]) - max(a[0], b[0])) * max(0.0, min(a[3], b[3]) - max(a[1], b[1]))


def _door(plan: Plan, link, draft: _Draft, rng: np.random.Generator) -> None:
    """A leaf door near the corner of the room it swings into, clear of the other leaves."""
    axis, across, low, high = link.wall[0], *(v / 10 for v in link.wall[1:])
    cell = plan.cells[link.child]
    x0, y0, x1, y1 = (v / 10 for v in cell.rect)
    own = (x0, x1) if axis == "x" else (y0, y1)
    middle = (y0 + y1) / 2 if axis == "x" else (x0 + x1) / 2
    side = 1 if middle > across else -1
    ends = (draft.names[link.child], draft.names[link.parent])
    width = min(DOOR.get(cell.kind, 0.85), high - low - 2 * NIB)
    best = None
    for start in (low + NIB, high - NIB - width, (low + high - width) / 2):
        corner = min(start - own[0], own[1] - start - width)
        swing = _swing(axis, across, start, start + width, side)
        fronts = _fronts(axis, across, start, start + width)
        crowd = sum(_overlap(swing, s) for s in draft.swings)
        shut = sum(_overlap(f, s) for f in fronts for s in draft.leaves)
        near_low = start - own[0] <= own[1] - start - width
        for at_low in (True, False):
            leaf = _open_leaf(axis, across, start, start + width, side, at_low)
            block = shut + sum(_overlap(leaf, z) for z in draft.zones)
            cost = 60.0 * block + 2.0 * crowd + 0.8 * max(0.0, corner - 0.2) + 0.5 * (at_low != near_low)
            cost += float(rng.uniform(0, 0.15))
            if best is None or cost < best[0]:
                best = (cost, start, at_low, swing, leaf, fronts)
    _, start, at_low, swing, leaf, fronts = best
    draft.swings.append(swing)
    draft.leaves.append(leaf)
    draft.zones += fronts
    p, q = _jambs(cell, axis, across, start, start + width)
    hinge = "a" if (p[0] + p[1] < q[0] + q[1]) == at_low else "b"
    open_by = math.radians(float(rng.uniform(82, 95)) if rng.random() < 0.8 else float(rng.uniform(60, 80)))
    draft.openings.append(
        Opening(
            draft.name("door"), "door", ends, rounded(p), rounded(q), 0.0, 2.05, draft.leaf, hinge, rounded(open_by)
        )
    )


def _is_tiny(cell: Cell) -> bool:
    """Whether a leaf inside would leave no room to stand."""
    x0, y0, x1, y1 = cell.rect
    return cell.kind == "toilet" and (x1 - x0) * (y1 - y0) < 300


def _folded_door(plan: Plan, link, draft: _Draft, rng: np.random.Generator) -> bool:
    """A leaf that opens outwards and folds back on the wall beside it; False where other doors leave no place."""
    axis, across, low, high = link.wall[0], *(v / 10 for v in link.wall[1:])
    outer = plan.cells[link.parent]
    x0, y0, x1, y1 = (v / 10 for v in outer.rect)
    own = (x0, x1) if axis == "x" else (y0, y1)
    side = 1 if ((y0 + y1) / 2 if axis == "x" else (x0 + x1) / 2) > across else -1
    width = min(DOOR[plan.cells[link.child].kind], high - low - 2 * NIB)
    k = 0 if axis == "x" else 1
    taken = [
        sorted((o.a[k], o.b[k]))
        for o in draft.openings
        if abs(o.a[1 - k] - across) < 0.01 and abs(o.b[1 - k] - across) < 0.01
    ]
    spots = []
    for start in (low + NIB, high - NIB - width):
        for at_low in (True, False):
            a, b = (start - width - 0.05, start) if at_low else (start + width, start + 2 * width + 0.05)
            if a < own[0] + 0.08 or b > own[1] - 0.08 or any(a < q and p < b for p, q in taken):
                continue
            swept = _swing(axis, across, a, b, side)
            spots.append((sum(_overlap(swept, s) for s in draft.swings), float(rng.uniform(0, 0.1)), start, at_low))
    if not spots:
        return False
    _, _, start, at_low = min(spots)
    p, q = _jambs(outer, axis, across, start, start + width)
    hinge = "a" if (p[0] + p[1] < q[0] + q[1]) == at_low else "b"
    draft.swings.append(_swing(axis, across, start, start + width, side))
    draft.zones += _fronts(axis, across, start, start + width)
    draft.openings.append(
        Opening(
            draft.name("door"),
            "door",
            (draft.names[link.parent], draft.names[link.child]),
            rounded(p),
            rounded(q),
            0.0,
            2.05,
            draft.leaf,
            hinge,
            rounded(math.radians(float(rng.uniform(164, 174)))),
        )
    )
    return True


def _take(free: list[tuple[float, float]], low: float, high: float, margin: float = 0.25) -> list[tuple[float, float]]:
    """`free` intervals without (low, high) and a margin on both sides."""
    low, high = low - margin, high + margin
    kept = [(max(a, p), min(b, q)) for a, b in free for p, q in ((a, low), (high, b)) if min(b, q) > max(a, p)]
    return kept


def _add_outer(plan, i, k, w: OuterWall, kind, start, width, sill, head, leaf, free, draft: _Draft, **more) -> None:
    p, q = _jambs(plan.cells[i], w.axis, w.across, start, start + width)
    free[i, k] = _take(free[i, k], start, start + width)
    draft.openings.append(
        Opening(
            draft.name(kind),
            kind,
            (draft.names[i], None),
            rounded(p),
            rounded(q),
            rounded(sill),
            rounded(head),
            leaf,
            **more,
        )
    )
    if kind in ("front_door", "back_door"):
        draft.swings.append(_swing(w.axis, w.across, start, start + width, -w.side))


def _front_door(plan, outside, free, draft: _Draft, rng: np.random.Generator) -> None:
    i = next(k for k, c in enumerate(plan.cells) if c.kind == "hall")
    x0, y0, x1, y1 = (v / 10 for v in plan.cells[i].rect)
    walls = [(k, w) for k, w in enumerate(outside[i]) if w.high - w.low >= 1.25]
    k, w = min(walls, key=lambda kw: (abs((kw[1].high - kw[1].low) - min(x1 - x0, y1 - y0)), kw[0]))
    width = 1.0 if w.high - w.low > 1.5 else 0.9
    slack = w.high - w.low - 2 * 0.2 - width
    start = round(w.low + 0.2 + slack * (0.5 if slack < 0.6 else float(rng.choice([0.15, 0.5, 0.85]))), 2)
    _add_outer(
        plan,
        i,
        k,
        w,
        "front_door",
        start,
        width,
        0.0,
        2.1,
        draft.outer_leaf,
        free,
        draft,
        hinge=str(rng.choice(["a", "b"])),
    )


def _outer_doors(plan, outside, free, draft: _Draft, rng: np.random.Generator) -> None:
    """Garage doors, French windows to the garden, a back door from kitchen or utility."""
    back = False
    for i, c in enumerate(plan.cells):
        x0, y0, x1, y1 = (v / 10 for v in c.rect)
        if c.kind == "garage":
            wide = 4.8 if min(x1 - x0, y1 - y0) > 5.4 else 2.5
            fits = [(k, w) for k, w in enumerate(outside[i]) if w.high - w.low > 2.5]
            if fits:
                k, w = min(fits, key=lambda kw: (kw[1].high - kw[1].low < wide + 0.3, kw[1].high - kw[1].low, kw[0]))
                width = min(wide, w.high - w.low - 0.4)
                _add_outer(
                    plan,
                    i,
                    k,
                    w,
                    "garage_door",
                    (w.low + w.high - width) / 2,
                    width,
                    0.0,
                    2.2,
                    draft.window_leaf,
                    free,
                    draft,
                )
        elif c.kind in ("living_room", "sun_room", "family_room", "dining_room", "library", "main_bedroom"):
            chance = {"living_room": 1.0, "sun_room": 1.0, "family_room": 0.8, "dining_room": 0.35}.get(c.kind, 0.12)
            if c.kind == "main_bedroom" and (x1 - x0) * (y1 - y0) < 15.0:
                chance = 0.0
            if rng.random() < chance and outside[i] and outside[i][0].high - outside[i][0].low > 2.2:
                w = outside[i][0]
                room = w.high - w.low - 0.8
                width = min(room, float(rng.choice([1.6, 1.8, 2.4, 3.0] if c.kind != "main_bedroom" else [1.4, 1.6])))
                two = room > 2 * width + 1.0
                at = float(rng.choice([0.18, 0.5, 0.82])) if two else 0.5
                _add_outer(
                    plan,
                    i,
                    0,
                    w,
                    "french_window",
                    round(w.low + 0.4 + (room - width) * at, 2),
                    width,
                    0.0,
                    2.2,
                    draft.window_leaf,
                    free,
                    draft,
                )
        elif c.kind in ("kitchen", "laundry_room", "workshop") and not back and rng.random() < 0.3:
            fits = [(k, w) for k, w in enumerate(outside[i]) if w.high - w.low > 2.4]
            if fits:
                back = True
                k, w = fits[-1]
                start = w.low + 0.3 if rng.random() < 0.5 else w.high - 1.2
                _add_outer(
                    plan,
                    i,
                    k,
                    w,
                    "back_door",
                    start,
                    0.9,
                    0.0,
                    2.1,
                    draft.outer_leaf,
                    free,
                    draft,
                    hinge=str(rng.choice(["a", "b"])),
                )


def _sill_head(kind: str, low_sill: bool) -> tuple[float, float]:
    if kind in ("bathroom", "toilet"):
        return 1.35, 2.1
    if kind in ("garage", "workshop", "gym"):
        return (1.5, 2.1) if kind == "garage" else (1.0, 2.1)
    if kind in ("kitchen", "laundry_room"):
        return 1.05, 2.1
    if kind == "sun_room":
        return 0.4, 2.2
    return (0.45 if low_sill and kind in OPEN_KINDS else 0.9), 2.15


def _windows(
    plan, i: int, walls: list[OuterWall], free, draft: _Draft, height: float, rng: np.random.Generator
) -> None:
    """Windows for one room: as much glass as its floor asks for, centred on the free stretches of outer wall."""
    c = plan.cells[i]
    share = GLASS.get(c.kind)
    if share is None:
        return
    x0, y0, x1, y1 = (v / 10 for v in c.rect)
    wanted = share * (x1 - x0) * (y1 - y0) * float(rng.uniform(0.85, 1.2))
    glazed = sum(
        o.head * math.dist(o.a, o.b)
        for o in draft.openings
        if o.rooms[0] == draft.names[i] and o.kind == "french_window"
    )
    sill, head = _sill_head(c.kind, bool(rng.random() < 0.4))
    widest = {"bathroom": 0.9, "toilet": 0.6, "hall": 0.8, "corridor": 0.9, "garage": 1.2}.get(c.kind, 2.4)
    most = {"bathroom": 1, "toilet": 1, "hall": 1, "corridor": 2, "garage": 2, "laundry_room": 1}.get(c.kind, 5)
    left = wanted - 0.6 * glazed
    stretches = sorted(
        ((b - a, k, a, b) for k, _ in enumerate(walls) for a, b in free[i, k] if b - a > 1.0),
        key=lambda s: (-s[0], s[1], s[2]),
    )
    placed = 0
    for length, k, a, b in stretches:
        if left < 0.25 * wanted and placed or placed >= most or (left < 0.1 * wanted and glazed):
            break
        room = length - 0.6
        if room < 0.5:
            continue
        count = max(1, min(most - placed, math.ceil(length / 3.6)))
        width = min(room / count - 0.4 * (count > 1), left / (head - sill) / count, widest)
        width = round(max(width, min(0.6, room)) * 10) / 10
        for n in range(count):
            start = round(a + length * (n + 0.5) / count - width / 2, 2)
            _add_outer(
                plan,
                i,
                k,
                walls[k],
                "window",
                start,
                width,
                sill,
                min(head, height - 0.15),
                draft.window_leaf,
                free,
                draft,
            )
            left -= width * (head - sill)
            placed += 1
