"""A floor plan of your own: a JSON file of rooms, from which the usual stages make a furnished house.

    {"rooms": [{"kind": "hall", "polygon": [[0, 0], [1.6, 0], [1.6, 6], [0, 6]]}, ...]}

Polygons are metres, on a grid of 0.1 m, along the middle of the walls. Each is a rectangle along x and y, or an L or
another polygon with right angles. A house has at least one hall, where one enters. Rooms upstairs have `"storey": 1`;
a stair is a room of kind 'stairwell' on each of the storeys that it joins, with the same polygon. Rooms of the highest
storey with `"attic": true` lie under the roof.
"""

import dataclasses
import itertools
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import shapely

from embodied.assets.catalogue import Catalogue
from embodied.assets.json_file import RecordError, load_json
from embodied.generate.access import connect, has_outer_doors, walls_between
from embodied.generate.config import HouseConfig
from embodied.generate.footprint import Rect, shared_area
from embodied.generate.layout import FloorPlan
from embodied.generate.modules import Cell
from embodied.generate.program import ROOM_TABLE
from embodied.generate.special import under_roof
from embodied.generate.stages import DEFAULT, STAGES, generate_house, with_plan
from embodied.generate.stairwell import stairwells
from embodied.house.house import House, HouseError

GRID = 10
"""Steps of the grid in a metre."""
NOISE = 1e-3
"""How far a corner may lie from the grid, metres."""
MOST_ROOMS, MOST_STOREYS = 200, 3
MOST_FLOOR, WIDEST_PLAN, FARTHEST_CORNER = 1500.0, 120.0, 1000.0
"""Largest plan: square metres, metres across, and metres from the origin."""
UNITS = {"feet": 0.3048, "centimetres": 0.01, "inches": 0.0254, "millimetres": 0.001}
"""Units that other programs write plans in, metres."""
OVERSIZE, USUAL = 3.0, 0.6
"""Times the largest usual area of its kind that the median room may have, and has."""
DECIDED = ("area", "rooms", "bedrooms", "shape", "storeys")
"""Fields of HouseConfig that a plan leaves no choice of."""
RECTANGULAR = ("hall", "stairwell", "garage")
"""Kinds of room that are rectangles."""
Corners = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class PlannedRoom:
    kind: str
    polygon: Corners
    """Metres, along the middle of the walls; the first corner may be repeated at the end."""
    storey: int = 0
    attic: bool = False
    """The ceiling slopes over outer walls along the ridge; on the highest storey."""


@dataclass(frozen=True)
class PlanFile:
    rooms: tuple[PlannedRoom, ...]


def load_plan(path: Path) -> FloorPlan:
    """Read a plan; doors are placed as in generated houses.

    Raises:
      HouseError: not such a file, a plan that is not in metres, rooms that overlap, or one that cannot be entered; says
        which.

    Examples:
      >>> plan = embodied.load_plan(Path('plan.json'))
    """
    try:
        rooms = load_json(path, PlanFile).rooms
    except RecordError as e:
        raise HouseError(f'{e}; a plan is {{"rooms": [{{"kind": ..., "polygon": [[x, y], ...]}}, ...]}}') from e
    if len(rooms) > MOST_ROOMS:
        raise HouseError(f"{path} has {len(rooms)} rooms, a plan may have {MOST_ROOMS}")
    if astray := [(n, r.storey) for n, r in enumerate(rooms) if not 0 <= r.storey < MOST_STOREYS]:
        number, storey = astray[0]
        raise HouseError(f"room {number} is on storey {storey}; a plan may have the storeys 0 to {MOST_STOREYS - 1}")
    if unknown := [(n, r.kind) for n, r in enumerate(rooms) if r.kind not in ROOM_TABLE]:
        number, kind = unknown[0]
        raise HouseError(f"room {number} has the kind {kind!r}; use one of {', '.join(ROOM_TABLE)}")
    _check_size(rooms)
    parts = [_cells(number, room) for number, room in enumerate(rooms)]
    for (i, a), (j, b) in itertools.combinations(enumerate(rooms), 2):
        if a.storey == b.storey and any(shared_area(p.rect, q.rect) for p in parts[i] for q in parts[j]):
            raise HouseError(f"rooms {i} ({a.kind}) and {j} ({b.kind}) overlap; let them share an edge instead")
    storeys: list[list[Cell]] = [[] for _ in range(max(r.storey for r in rooms) + 1)]
    for room, cells in zip(rooms, parts, strict=True):
        storeys[room.storey] += cells
    plan = under_roof(plan_of(storeys[0]) if len(storeys) == 1 else _plan_of_storeys(storeys))
    low = [c for p in plan.storeys for c in p.cells if c.slopes]
    if len(low) < sum(r.attic for r in rooms):
        kinds = [r.kind for r in rooms if r.attic]
        raise HouseError(
            f"of the attic rooms {', '.join(kinds)} {len(low)} can have a slope: each needs a whole outer wall along "
            "the longer side of the highest storey, a depth of 2.3 m (bathrooms 3 m), and 1 m of wall for its door at "
            "full height; halls, kitchens, stairwells and garages have none"
        )
    return plan


def _plan_of_storeys(storeys: Sequence[list[Cell]]) -> FloorPlan:
    wells = [[c.rect for c in cells if c.kind == "stairwell"] for cells in storeys]
    if any(len(rects) != 1 or rects != wells[0] for rects in wells):
        raise HouseError(
            f"each of {len(storeys)} storeys needs one room of kind 'stairwell', with one polygon, got {wells} (dm)"
        )
    for well in stairwells(wells[0][0]):
        own = [[well if c.kind == "stairwell" else c for c in cells] for cells in storeys]
        try:
            ground, *above = (plan_of(cells, upstairs=k > 0) for k, cells in enumerate(own))
        except HouseError as e:
            wrong = e
        else:
            return dataclasses.replace(ground, above=tuple(above))
    raise wrong


def _check_size(rooms: Sequence[PlannedRoom]) -> None:
    """Refuse plans in another unit than metres, and those that no house has."""
    boxes = [(r, _box(r.polygon)) for r in rooms if r.polygon]
    if not boxes:
        return
    sides = [(x1 - x0, y1 - y0) for _, (x0, y0, x1, y1) in boxes]
    ratio = statistics.median(w * h / ROOM_TABLE[r.kind].area[1] for (r, _), (w, h) in zip(boxes, sides, strict=True))
    if ratio > OVERSIZE:
        (room, _), (w, h) = boxes[0], sides[0]
        unit = min(UNITS, key=lambda u: abs(math.log(ratio * UNITS[u] ** 2 / USUAL)))
        raise HouseError(
            f"polygons are in metres, but most rooms are over {OVERSIZE:.0f} times as large as usual (room 0, "
            f"{room.kind}: {w:g} x {h:g}); these look like {unit}: multiply all numbers by {UNITS[unit]}"
        )
    x0, y0, x1, y1 = _box([corner for _, (a, b, c, d) in boxes for corner in ((a, b), (c, d))])
    area = sum(w * h for w, h in sides)
    if area > MOST_FLOOR or max(x1 - x0, y1 - y0) > WIDEST_PLAN:
        raise HouseError(
            f"a plan may have {MOST_FLOOR:.0f} m2 and be {WIDEST_PLAN:.0f} m across, got {area:.0f} m2 on "
            f"{x1 - x0:.1f} x {y1 - y0:.1f} m; take rooms away"
        )
    if max(abs(v) for v in (x0, y0, x1, y1)) > FARTHEST_CORNER:
        raise HouseError(
            f"a plan should lie within {FARTHEST_CORNER:.0f} m of (0, 0), it begins at ({x0:.1f}, {y0:.1f}); subtract "
            "these from all corners"
        )


def _box(corners: Sequence[tuple[float, float]]) -> tuple[float, float, float, float]:
    """Smallest x and y, largest x and y."""
    xs, ys = zip(*corners, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def plan_of(cells: list[Cell], *, upstairs: bool = False) -> FloorPlan:
    """The cells of a storey with the ways between them.

    Raises:
      HouseError: no hall, no room for the front door, cells that cannot be reached.
    """
    if not upstairs and not any(c.kind == "hall" for c in cells):
        raise HouseError("a plan needs a room of kind 'hall', where the front door is")
    walls = walls_between(cells)
    if not upstairs and not has_outer_doors(cells, walls):
        raise HouseError("a hall needs 1.4 m of outer wall for the front door, a garage 2.9 m for its own")
    linked = connect(cells, walls)
    if linked is None:
        raise HouseError(
            "some room cannot be entered: it needs a shared wall of about 1 m with a hall, a corridor or a room that "
            "may be crossed on the way to it"
        )
    return FloorPlan(tuple(cells), tuple(linked[0]), 0.0)


def house_of_plan(
    plan: FloorPlan, seed: int = 0, config: HouseConfig = DEFAULT, catalogue: Catalogue | None = None
) -> House:
    """A furnished house on a plan of your own; the seed draws doors, windows, materials and furniture.

    Raises:
      HouseError: no doors leave every room open, or `config` sets what the plan decides.

    Examples:
      >>> mine = embodied.house_of_plan(plan, seed=3)
    """
    if given := [name for name in DECIDED if getattr(config, name) != getattr(DEFAULT, name)]:
        raise HouseError(f"a floor plan decides {', '.join(DECIDED)}; leave out {', '.join(given)}")
    return generate_house(seed, config, catalogue, {**STAGES, "rooms": with_plan(plan)})


def _cells(number: int, room: PlannedRoom) -> list[Cell]:
    """The rectangles that a room is made of."""
    rects, plain = _rectangles(room.polygon), room.kind in RECTANGULAR
    if not rects or (plain and len(rects) > 1):
        raise HouseError(
            f"room {number} ({room.kind}) should be a rectangle{'' if plain else ' or an L'} along x and y, corners "
            f"on a grid of 0.1 m, at least 0.8 m wide, got {[list(corner) for corner in room.polygon]}; cut other "
            "shapes into rectangles"
        )
    part = number if len(rects) > 1 else None
    return [Cell(room.kind, r, (r[2] - r[0]) * (r[3] - r[1]) / GRID**2, room=part, attic=room.attic) for r in rects]


def _rectangles(polygon: Corners) -> list[Rect]:
    """(x0, y0, x1, y1) in decimetres of the strips along y of a polygon of right angles; none where it is no such
    polygon, or one is too narrow."""
    corners = [(round(x * GRID), round(y * GRID)) for x, y in polygon]
    if any(math.dist(p, (x / GRID, y / GRID)) > NOISE for p, (x, y) in zip(polygon, corners, strict=True)):
        return []
    corners = [c for c, before in zip(corners, corners[-1:] + corners) if c != before]
    corners = [c for k, c in enumerate(corners) if not _between(corners[k - 1], c, corners[(k + 1) % len(corners)])]
    if len(corners) < 4 or not (shape := shapely.Polygon(corners)).is_valid:
        return []
    cuts, (_, low, _, high) = sorted({x for x, _ in corners}), shape.bounds
    strips = [shape.intersection(shapely.box(a, low, b, high)) for a, b in itertools.pairwise(cuts)]
    rects = [cast(Rect, tuple(map(round, p.bounds))) for p in shapely.get_parts(strips).tolist() if p.area]
    whole = sum((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in rects) == shape.area
    return rects if whole and all(min(x1 - x0, y1 - y0) >= 8 for x0, y0, x1, y1 in rects) else []


def _between(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> bool:
    """True if b lies on the way straight from a to c."""
    (ux, uy), (vx, vy) = (b[0] - a[0], b[1] - a[1]), (c[0] - b[0], c[1] - b[1])
    return ux * vy == uy * vx and ux * vx + uy * vy > 0
