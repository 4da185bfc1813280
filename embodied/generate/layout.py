"""The rooms: many candidate plans per house, drawn along the corridors, scored, the best one kept."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from embodied.assets.json_file import from_plain, read_toml
from embodied.generate.access import Link, connect, has_outer_doors, score, walls_between, ways_between, worth_above
from embodied.generate.footprint import Band, Cap, Footprint, Rect, Strip, shared_area
from embodied.generate.modules import THROUGH, Cell, Module, Slot, arrange, draw_modules, width
from embodied.generate.program import ROOM_TABLE, WantedRoom
from embodied.generate.stairwell import stairwell

LONG = 95
"""Corridors longer than this, decimetres, are divided."""
BESIDE_STAIRS = 16
"""Least length of a row that a stairwell leaves on either side, decimetres."""
PARENTS = 6
"""Candidates kept as parents."""
MAIN_SUITE = ("main_bedroom", "bathroom")
CAPS = from_plain(dict[str, tuple[tuple[str, ...], ...]], read_toml(Path(__file__).with_name("caps.toml")))
"""Rooms that may fill the ends of a wing; MAIN_SUITE takes all rooms of the main bedroom."""


Rows = list[list[tuple[Module, int]]]
"""For each strip of a footprint its modules with their wanted widths, decimetres."""


@dataclass(frozen=True)
class FloorPlan:
    """A plan on the 0.1 m grid: cells, the walls they share, and the ways between them."""

    cells: tuple[Cell, ...]
    links: tuple[Link, ...]
    score: float
    above: tuple[FloorPlan, ...] = ()
    """The storeys above, from the lowest to the highest; stairwells lie above each other."""

    @property
    def storeys(self) -> tuple[FloorPlan, ...]:
        """All storeys, this one first."""
        return (self, *self.above)


@dataclass(frozen=True)
class Genome:
    """The choices that make one candidate; a small change of it makes a similar plan."""

    footprint: int
    modules: int
    """Seeds of the grouping into modules, of the assignment to rows and of the cutting."""
    rows: int
    cuts: int
    privacy: tuple[float, ...]
    """Addition to the privacy of each space's kind."""


@dataclass(frozen=True)
class Ends:
    """Rows as they are when the rooms at the ends of corridors are chosen."""

    footprint: Footprint
    rows: Rows
    cuts: list[list[tuple[int, int]]]
    reach: dict[tuple[int, int], int]
    """(strip, place in its row) to how far that room reaches into the corridor, decimetres; filled in."""


def draw_plan(
    footprints: Sequence[Footprint], spaces: tuple[WantedRoom, ...], tries: int, *, rng: np.random.Generator
) -> tuple[Footprint, FloorPlan] | None:
    """The best of `tries` candidates: random ones first, then changes of the best so far.

    Returns:
      None where no candidate can be walked without crossing a private room.
    """
    best: list[tuple[float, Genome, FloorPlan]] = []
    for k in range(tries):
        if k < 0.45 * tries or not best:
            modules, rows, cuts = rng.integers(2**31, size=3).tolist()
            which, privacy = int(rng.integers(len(footprints))), tuple(rng.normal(0, 0.45, len(spaces)).tolist())
            genome = Genome(which, modules, rows, cuts, privacy)
        else:
            genome = _changed(best[int(rng.integers(len(best)))][1], len(footprints), rng)
        plan = _realised(footprints[genome.footprint], spaces, genome, best[-1][0] if len(best) == PARENTS else -np.inf)
        if plan is not None and all(plan.score != other for other, _, _ in best):
            best = sorted([*best, (plan.score, genome, plan)], key=lambda b: -b[0])[:PARENTS]
    return (footprints[best[0][1].footprint], best[0][2]) if best else None


def _changed(genome: Genome, footprints: int, rng: np.random.Generator) -> Genome:
    what = rng.random()
    if what < 0.15:
        return replace(genome, footprint=int(rng.integers(footprints)))
    if what < 0.25:
        return replace(genome, modules=int(rng.integers(2**31)))
    if what < 0.4:
        return replace(genome, rows=int(rng.integers(2**31)))
    if what < 0.5:
        return replace(genome, cuts=int(rng.integers(2**31)))
    privacy = list(genome.privacy)
    for k in rng.integers(len(privacy), size=int(rng.integers(1, 4))):
        privacy[k] = float(rng.normal(0, 0.8))
    return replace(genome, privacy=tuple(privacy))


def _realised(footprint: Footprint, spaces: tuple[WantedRoom, ...], genome: Genome, floor: float) -> FloorPlan | None:
    """The genome's plan, None where it cannot be built or scores below `floor`."""
    cells = _candidate(footprint, spaces, genome)
    if cells is None:
        return None
    walls = walls_between(cells)
    value = score(cells, walls) + worth_above(cells, footprint.wet)
    if value <= floor or not has_outer_doors(cells, walls):
        return None
    linked = connect(cells, walls)
    return None if linked is None else FloorPlan(tuple(cells), tuple(linked[0]), value - linked[1])


def with_short_corridors(plan: FloorPlan) -> FloorPlan:
    """The plan with corridors beyond LONG cut in two or three by a cased opening, where every door keeps its place."""
    cells = list(plan.cells)
    for i, c in enumerate(plan.cells):
        x0, y0, x1, y1 = c.rect
        along = max(x1 - x0, y1 - y0)
        if c.kind != "corridor" or along <= LONG:
            continue
        pieces = math.ceil(along / LONG)
        flat = x1 - x0 > y1 - y0
        walls = [w for pair, w in walls_between(cells).items() if i in pair and w[0] == ("x" if flat else "y")]
        low = x0 if flat else y0
        cuts = [low]
        for k in range(1, pieces):
            ideal = low + along * k / pieces
            options = [
                at
                for at in range(int(ideal) - 12, int(ideal) + 13)
                if all(at - a >= 13 or b - at >= 13 for _, _, a, b in walls if a < at < b)
            ]
            if options:
                cuts.append(min(options, key=lambda at: abs(at - ideal)))
        edges = [*cuts, low + along]
        parts = [(a, y0, b, y1) if flat else (x0, a, x1, b) for a, b in itertools.pairwise(edges)]
        cells[i] = replace(c, rect=parts[0], area=0.0)
        cells += [replace(c, rect=r, area=0.0) for r in parts[1:]]
    linked = connect(cells, walls_between(cells))
    plan = plan if linked is None else replace(plan, cells=tuple(cells), links=tuple(linked[0]))
    return replace(plan, above=tuple(with_short_corridors(p) for p in plan.above))


def turned(plan: FloorPlan, *, rng: np.random.Generator) -> FloorPlan:
    """The plan mirrored and turned at random, with the storeys above; its lower left corner at the origin."""
    flip_x, flip_y, swap = (bool(b) for b in rng.integers(0, 2, 3))

    def move(r: Rect) -> Rect:
        x0, y0, x1, y1 = r
        if flip_x:
            x0, x1 = -x1, -x0
        if flip_y:
            y0, y1 = -y1, -y0
        return (y0, x0, y1, x1) if swap else (x0, y0, x1, y1)

    rects = [move(c.rect) for c in plan.cells]
    dx, dy = min(r[0] for r in rects), min(r[1] for r in rects)
    moved = lambda r: (r[0] - dx, r[1] - dy, r[2] - dx, r[3] - dy)

    def of(plan: FloorPlan) -> FloorPlan:
        cells = tuple(replace(c, rect=moved(move(c.rect)), floor=c.floor and moved(move(c.floor))) for c in plan.cells)
        walls = ways_between(cells, walls_between(list(cells)))
        between = ((min(k.child, k.parent), max(k.child, k.parent)) for k in plan.links)
        links = tuple(replace(k, wall=walls[pair]) for k, pair in zip(plan.links, between))
        return FloorPlan(cells, links, plan.score, tuple(of(p) for p in plan.above))

    return of(plan)


def _candidate(footprint: Footprint, spaces: tuple[WantedRoom, ...], genome: Genome) -> list[Cell] | None:
    rng = np.random.default_rng(genome.modules)
    modules = draw_modules(spaces, rng=rng)
    cells: list[Cell] = [] if footprint.stair is None else [footprint.stair]
    for cap in footprint.caps:
        chosen = _fill_cap(cap, modules, cells, rng)
        if chosen is None:
            return None
        modules = [m for m in modules if m not in chosen]
    privacy = {id(s): p for s, p in zip(spaces, genome.privacy)}
    rows = _assign(footprint, modules, privacy, np.random.default_rng(genome.rows))
    if rows is None:
        return None
    return _lay(footprint, rows, cells, np.random.default_rng(genome.cuts))


def _fill_cap(cap: Cap, modules: list[Module], cells: list[Cell], rng: np.random.Generator) -> list[Module] | None:
    """Fill a wing's end with living rooms (start) or a main suite (end); returns the modules used."""
    x0, y0, x1, y1 = cap.rect
    area = (x1 - x0) * (y1 - y0) / 100
    by_kind = {m.main.kind: m for m in reversed(modules)}
    fits: list[tuple[float, list[WantedRoom], list[Module]]] = []
    for option in CAPS["starts" if cap.at_start else "ends"]:
        used, parts = _cap_rooms(option, by_kind)
        if parts:
            ratio = area / sum(s.area for s in parts)
            if 0.7 < ratio < 1.45:
                fits.append((abs(np.log(ratio)) + rng.exponential(0.2), parts, used))
    if not fits:
        return None
    _, parts, used = min(fits, key=lambda f: f[0])
    cells += _stack(cap, parts, bool(used[0].owned), len(cells), rng)
    return used


def _cap_rooms(option: tuple[str, ...], by_kind: dict[str, Module]) -> tuple[list[Module], list[WantedRoom]]:
    """The modules that an option takes and their rooms; no rooms where the house has not all of them to give."""
    if option == MAIN_SUITE:
        main = by_kind.get("main_bedroom")
        return ([main], [main.main, *main.owned]) if main is not None and main.owned else ([], [])
    used = [by_kind[k] for k in option if k in by_kind and not by_kind[k].owned and by_kind[k].guest is None]
    return used, [m.main for m in used] if len(used) == len(option) else []


def _stack(cap: Cap, parts: list[WantedRoom], owned: bool, first: int, rng: np.random.Generator) -> list[Cell]:
    """`parts` side by side across the wing's end, the first one where the corridor arrives if it owns the rest."""
    x0, y0, x1, y1 = cap.rect
    low, high = (y0, y1) if cap.axis == "y" else (x0, x1)
    across = (x1 - x0) if cap.axis == "y" else (y1 - y0)
    total = sum(s.area for s in parts)

    def rect(a: int, b: int) -> Rect:
        return (x0, a, x1, b) if cap.axis == "y" else (a, y0, b, y1)

    if len(parts) == 1:
        return [Cell(parts[0].kind, cap.rect, parts[0].area)]
    deep = round((high - low) * parts[0].area / total)
    below = rng.random() < 0.5
    cut = low + deep if below else high - deep
    cut = max(cut, cap.passage[1]) if below else min(cut, cap.passage[0])
    main = rect(low, cut) if below else rect(cut, high)
    rest = (cut, high) if below else (low, cut)
    cells = [Cell(parts[0].kind, main, parts[0].area)]
    owner = first if owned else None
    if len(parts) == 2:
        return [*cells, Cell(parts[1].kind, rect(*rest), parts[1].area, owner)]
    a, b = (x0, x1) if cap.axis == "y" else (y0, y1)
    mid = a + round(across * parts[1].area / (parts[1].area + parts[2].area))
    for s, (p, q) in zip(parts[1:], ((a, mid), (mid, b))):
        beside = (p, rest[0], q, rest[1]) if cap.axis == "y" else (rest[0], p, rest[1], q)
        cells.append(Cell(s.kind, beside, s.area, owner))
    return cells


def _assign(
    footprint: Footprint, modules: list[Module], privacy: dict[int, float], rng: np.random.Generator
) -> Rows | None:
    """Modules with their wanted widths to rows, from the public end to the private one."""
    keys = [ROOM_TABLE[m.main.kind].privacy + privacy[id(m.main)] for m in modules]
    order = sorted(range(len(modules)), key=lambda k: keys[k])
    strips, corridor = footprint.strips, footprint.corridor
    depths = sorted({s.depth for s in strips})
    rows: Rows = [[] for _ in strips]
    used = [0] * len(rows)
    noise = rng.exponential(14.0, (len(modules), len(rows))).tolist()
    for k in order:
        m = modules[k]
        by_depth = {d: (width(m, d, corridor), _slimness(m, d)) for d in depths}
        best: int | None = None
        least = 1e9
        for i, s in enumerate(strips):
            w, slim = by_depth[s.depth]
            left = s.length - used[i]
            if left >= 0.7 * w:
                cost = s.rank + used[i] + noise[k][i] + slim + (w - left if w > left else 0)
                if cost < least:
                    best, least = i, cost
        if best is None:
            best = max(range(len(rows)), key=lambda i: strips[i].length - used[i])
            if strips[best].length - used[best] < 8:
                return None
        w = by_depth[strips[best].depth][0]
        rows[best].append((m, w))
        used[best] += w
    for s, row, u in zip(strips, rows, used):
        if (not row and s.length > 0) or (row and not 0.68 < s.length / u < 1.5):
            return None
    return rows


def _slimness(m: Module, depth: int) -> float:
    """Cost, in decimetres of spine, of the fact that the module's main room would be narrow at this depth."""
    if m.main.kind in THROUGH:
        return 0.0
    own = m.main.area * 100 / depth
    return 45 * max(0.0, max(depth / own, own / depth) - 1.7)


def _lay(footprint: Footprint, rows: Rows, cells: list[Cell], rng: np.random.Generator) -> list[Cell] | None:
    """Cut the rows into rooms, let end rooms take the corridor's ends, and cut the corridor by the hall."""
    corridor, rooms_of = footprint.corridor, _cut(footprint, rows)
    flips = rng.random(2 * len(footprint.bands) + sum(map(len, rows))).tolist()
    reach: dict[tuple[int, int], int] = {}
    limits = [[0, band.length] for band in footprint.bands]
    for b, band in enumerate(footprint.bands):
        for end in (0, 1):
            if band.free[end] and flips.pop() > 0.1:
                _take_end(Ends(footprint, rows, rooms_of, reach), b, end, limits[b])
    halls = [
        (b, *_along_band(band, c.rect, band.axis))
        for c in cells
        for b, band in enumerate(footprint.bands)
        if c.floor is not None and shared_area(c.rect, band.rect(0, band.length))
    ]
    if any(p < limits[b][0] or q > limits[b][1] for b, p, q in halls):
        return None
    for i, (s, row) in enumerate(zip(footprint.strips, rows)):
        for k, (m, wanted) in enumerate(row):
            slot = Slot(s, *rooms_of[i][k], corridor, mirrored=flips.pop() < 0.5, inner=reach.get((i, k), 0))
            made = arrange(m, slot, wanted, first=len(cells))
            if made is not None and m.main.kind == "stairwell":
                made = _with_stairs(made[0].rect, s, rooms_of[i][k], corridor)
            if made is None:
                return None
            if m.main.kind in THROUGH and corridor:
                p, q = _along_band(footprint.bands[s.band], made[0].rect, s.axis)
                if p < limits[s.band][0] or q > limits[s.band][1]:
                    return None
                halls.append((s.band, p, q))
            cells += made
    if any(b == c and min(q, s) > max(p, r) for (b, p, q), (c, r, s) in itertools.combinations(halls, 2)):
        return None
    corridors = _corridors(footprint, limits, halls)
    return None if corridors is None else cells + corridors


def _with_stairs(rect: Rect, s: Strip, place: tuple[int, int], corridor: int) -> list[Cell] | None:
    """The stairwell at a place of its row; None where no stair fits, or no room would fit beside it upstairs."""
    if any(0 < rest < BESIDE_STAIRS for rest in (place[0], s.length - place[1])):
        return None
    cell = stairwell(rect, (0, -s.out) if s.axis == "x" else (-s.out, 0), corridor)
    return None if cell is None else [cell]


def _cut(footprint: Footprint, rows: Rows) -> list[list[tuple[int, int]]]:
    """From where to where in its row each module goes, decimetres, for each strip."""
    cuts = []
    for s, row in zip(footprint.strips, rows):
        scale = s.length / max(1, sum(w for _, w in row))
        edges = [0, *(round(x * scale) for x in itertools.accumulate(w for _, w in row))]
        cuts.append(list(itertools.pairwise(edges)))
    return cuts


def _along_band(band: Band, rect: Rect, axis: str) -> tuple[int, int]:
    """The interval of a rectangle along a corridor, decimetres from the corridor's start."""
    a, b = (rect[0], rect[2]) if axis == "x" else (rect[1], rect[3])
    p, q = (a - band.start) * band.way, (b - band.start) * band.way
    return min(p, q), max(p, q)


def _corridors(footprint: Footprint, limits: list[list[int]], halls: list[tuple[int, int, int]]) -> list[Cell] | None:
    """The rest of each corridor beside end rooms and halls (band, from, to); None if a piece is too short."""
    cells = []
    for b, band in enumerate(footprint.bands):
        pieces = [(limits[b][0], limits[b][1])]
        for hall_band, p, q in halls:
            if hall_band == b:
                pieces = [x for s, e in pieces for x in ((s, min(e, p)), (max(s, q), e)) if x[1] > x[0]]
        for s, e in pieces:
            if e - s < 9:
                return None
            cells.append(Cell("corridor", band.rect(s, e), (e - s) * footprint.corridor / 100))
    return cells


def _take_end(ends: Ends, b: int, end: int, limits: list[int]) -> None:
    """Let the shorter of the two rooms at a free corridor end reach across it, if the other keeps its door."""
    footprint, rows = ends.footprint, ends.rows
    band = footprint.bands[b]
    at_end = []
    for i, s in enumerate(footprint.strips):
        at = s.u_band == 0 if end == 0 else s.u_band + s.length == band.length
        if s.band == b and at:
            k = 0 if end == 0 else len(rows[i]) - 1
            a, z = ends.cuts[i][k]
            at_end.append((z - a, i, k))
    if len(at_end) < 2 or any(rows[i][k][0].main.kind in THROUGH for _, i, k in at_end):
        return
    at_end.sort()
    (short, i, k), (long, _, _) = at_end[0], at_end[1]
    m = rows[i][k][0]
    if long - short < 12 or m.owned or m.guest or m.main.kind in ("toilet", "closet"):
        return
    ends.reach[i, k] = footprint.corridor
    limits[end] = short if end == 0 else band.length - short
