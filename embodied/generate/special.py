"""Rooms of a plan that are no boxes: living and dining room as one in the shape of an L, and bays."""

from dataclasses import replace

import numpy as np
import shapely

from embodied.generate.access import MOVING, WET, SharedWall, beside_slopes, connect, outer_stretches, walls_between
from embodied.generate.footprint import Rect, shared_area
from embodied.generate.layout import FloorPlan
from embodied.generate.modules import Cell
from embodied.generate.program import ROOM_TABLE

CHANCES = {"L": 0.6, "bay": 0.4}
"""How often a house has each of them where its seed decides."""
OPEN_BORDER, L_SIDE = 24, 10
"""Shortest border along which two rooms become one, and shortest side of the L that they make, decimetres."""
BAY_DEPTH, BAY_WIDTHS, BAY_ALONE = 12, (20, 28), 12
"""Depth of a bay, its smallest and largest width, and free ground around it, decimetres."""
NOT_IN_ATTIC = ("hall", "stairwell", "garage", "kitchen")
"""Kinds of room that do not lie under the roof."""
SLOPE, FLAT, FLAT_WET = 16, 7, 14
"""Depth of the highest slope, and least depths of what is flat beside slopes, also in bathrooms, decimetres."""
BAY_KINDS = ("living_room", "dining_room", "family_room", "library")


def with_special_rooms(plan: FloorPlan, words: tuple[str, ...] | None, *, rng: np.random.Generator) -> FloorPlan:
    """The plan with those of `words` that its ground floor has a place for; None: as the seed has it."""
    drawn = tuple(word for word, chance in CHANCES.items() if rng.random() < chance)
    for word in drawn if words is None else [w for w in CHANCES if w in words]:
        cells = {"L": _joined, "bay": _with_bay}[word](list(plan.cells), rng)
        linked = connect(cells, walls_between(cells))
        if linked is not None:
            plan = replace(plan, cells=tuple(cells), links=tuple(linked[0]))
    return under_roof(plan, all_rooms=True) if words and "attic" in words else plan


def under_roof(plan: FloorPlan, all_rooms: bool = False) -> FloorPlan:
    """The plan with slopes in those rooms of its highest storey that are to have some, or in all that can: over outer
    walls along the ridge, which runs along the storey, where doors keep their height."""
    if plan.above:
        return replace(plan, above=(*plan.above[:-1], under_roof(plan.above[-1], all_rooms)))
    cells, walls = list(plan.cells), walls_between(list(plan.cells))
    x0, y0, x1, y1 = shapely.union_all([shapely.box(*c.rect) for c in cells]).bounds
    first = int(y1 - y0 > x1 - x0)
    for i, c in enumerate(plan.cells):
        if (all_rooms or c.attic) and c.room is None and c.kind not in NOT_IN_ATTIC:
            edges = c.rect[1:] + c.rect[:1]
            deep, wide = (abs(edges[k] - edges[k + 2]) for k in (first, 1 - first))
            whole = {
                w.across for w, _ in outer_stretches(cells, walls, i) if w.axis == "xy"[first] and w.length == wide
            }
            sides = [k for k in (first, first + 2) if edges[k] in whole]
            most = max(0, (deep - (FLAT_WET if c.kind in WET else FLAT)) // SLOPE)
            cells[i] = replace(c, slopes=tuple(sides[:most]))
    upright = lambda k: replace(k, wall=beside_slopes(cells[k.child], beside_slopes(cells[k.parent], k.wall)))
    for k in plan.links:
        kinds = {cells[n].kind for n in (k.child, k.parent)}
        if upright(k).wall.length < (9 if kinds <= MOVING else ROOM_TABLE[cells[k.child].kind].wall):
            cells = [replace(c, slopes=()) if i in (k.child, k.parent) else c for i, c in enumerate(cells)]
    return replace(plan, cells=tuple(cells), links=tuple(map(upright, plan.links)))


def _joined(cells: list[Cell], rng: np.random.Generator) -> list[Cell]:
    """Living and dining room as one where they make an L."""
    for (i, j), wall in walls_between(cells).items():
        if {cells[i].kind, cells[j].kind} == {"living_room", "dining_room"} and wall.length >= OPEN_BORDER:
            whole = shapely.union(shapely.box(*cells[i].rect), shapely.box(*cells[j].rect)).normalize().simplify(0)
            ring = np.asarray(whole.exterior.coords)
            if len(ring) == 7 and np.abs(np.diff(ring, axis=0)).sum(1).min() >= L_SIDE:
                one = {k: replace(cells[k], kind="living_room", room=i) for k in (i, j)}
                return [one.get(k, c) for k, c in enumerate(cells)]
    return cells


def _with_bay(cells: list[Cell], rng: np.random.Generator) -> list[Cell]:
    """A bay in the middle of the longest outer wall that has ground for one before it."""
    width, walls = int(rng.integers(*BAY_WIDTHS)), walls_between(cells)
    places = [(w.length, k, w, side) for k, c in enumerate(cells) for w, side in outer_stretches(cells, walls, k)]
    for length, k, wall, side in sorted(places, key=lambda p: (-p[0], p[1])):
        low = (wall.low + wall.high - width) // 2
        around = [_before(wall, side, low - grow, low + width + grow, BAY_DEPTH + grow) for grow in (0, BAY_ALONE)]
        alone = not any(shared_area(around[1], c.rect) for c in cells)
        if cells[k].kind in BAY_KINDS and length >= width + 2 * L_SIDE and alone:
            room = k if cells[k].room is None else cells[k].room
            bay = replace(cells[k], rect=around[0], room=room)
            return [*(replace(c, room=room) if i == k else c for i, c in enumerate(cells)), bay]
    return cells


def _before(wall: SharedWall, side: int, low: int, high: int, depth: int) -> Rect:
    """The rectangle from low to high along a wall, on one side of it."""
    near, far = sorted((wall.across, wall.across + side * depth))
    return (low, near, high, far) if wall.axis == "x" else (near, low, far, high)
