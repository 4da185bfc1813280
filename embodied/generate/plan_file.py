"""A floor plan of your own: a JSON file of rooms, from which the usual stages make a furnished house.

    {"rooms": [{"kind": "hall", "polygon": [[0, 0], [1.6, 0], [1.6, 6], [0, 6]]},
               {"kind": "living_room", "polygon": [[1.6, 0], [7, 0], [7, 6], [1.6, 6]]}]}

Polygons are metres, on a grid of 0.1 m, along the middle of the walls. Each is a rectangle along x and y; an L-shaped
room is two rectangles of its kind. A house has exactly one storey and at least one hall, where one enters.
"""

from __future__ import annotations

import itertools
from pathlib import Path

from embodied.assets.catalogue import Catalogue
from embodied.assets.json_file import read_json
from embodied.assets.records import ROOM_KINDS
from embodied.generate.access import connect, has_outer_doors, walls_between
from embodied.generate.config import HouseConfig
from embodied.generate.footprint import Rect
from embodied.generate.layout import Plan
from embodied.generate.modules import Cell
from embodied.generate.program import WantedRoom
from embodied.generate.stages import DEFAULT, STAGES, Draft, with_plan
from embodied.house.house import House, HouseError

GRID = 10
"""Steps of the grid in a metre."""
MOST_ROOMS = 200


def load_plan(path: Path) -> Plan:
    """Read a plan; doors are placed as in generated houses.

    Raises:
      HouseError: not such a file, rooms that overlap, or one that cannot be entered; says which.

    Examples:
      >>> plan = embodied.load_plan(Path('plan.json'))
    """
    try:
        body = read_json(path)
        rooms = [(str(room["kind"]), room["polygon"]) for room in body["rooms"]]
    except (ValueError, KeyError, TypeError) as e:
        raise HouseError(
            f'{path} should hold {{"rooms": [{{"kind": ..., "polygon": [[x, y], ...]}}, ...]}}; {type(e).__name__}: {e}'
        ) from e
    if len(rooms) > MOST_ROOMS:
        raise HouseError(f"{path} has {len(rooms)} rooms, a plan may have {MOST_ROOMS}")
    return plan_of([_cell(number, kind, polygon) for number, (kind, polygon) in enumerate(rooms)])


def plan_of(cells: list[Cell]) -> Plan:
    """The cells with the ways between them.

    Raises:
      HouseError: no hall, no room for the front door, cells that overlap or cannot be reached.
    """
    for (i, a), (j, b) in itertools.combinations(enumerate(cells), 2):
        if min(a.rect[2], b.rect[2]) > max(a.rect[0], b.rect[0]) and min(a.rect[3], b.rect[3]) > max(
            a.rect[1], b.rect[1]
        ):
            raise HouseError(f"rooms {i} ({a.kind}) and {j} ({b.kind}) overlap; let them share an edge instead")
    if not any(c.kind == "hall" for c in cells):
        raise HouseError("a plan needs a room of kind 'hall', where the front door is")
    walls = walls_between(cells)
    if not has_outer_doors(cells, walls):
        raise HouseError("a hall needs 1.4 m of outer wall for the front door, a garage 2.9 m for its own")
    linked = connect(cells, walls)
    if linked is None:
        raise HouseError(
            "some room cannot be entered: it needs a shared wall of about 1 m with a hall, a corridor or a room that "
            "may be crossed on the way to it"
        )
    return Plan(tuple(cells), tuple(linked[0]), 0.0)


def house_of_plan(
    plan: Plan, seed: int = 0, config: HouseConfig = DEFAULT, catalogue: Catalogue | None = None
) -> House:
    """A furnished house on a plan of your own; the seed draws doors, windows, materials and furniture.

    Raises:
      HouseError: no doors leave every room open.

    Examples:
      >>> mine = embodied.house_of_plan(plan, seed=3)
    """
    area = sum(c.area for c in plan.cells)
    spaces = tuple(WantedRoom(c.kind, c.area) for c in plan.cells)
    stages = {
        "rooms": with_plan(plan),
        **{name: s for name, s in STAGES.items() if name not in ("footprint", "program", "rooms")},
    }
    draft = Draft(seed, config, catalogue, area=area, spaces=spaces)
    for stage in stages.values():
        draft = stage(draft)
    assert draft.house is not None, "the openings stage makes it"
    return draft.house


def _cell(number: int, kind: str, polygon: object) -> Cell:
    if kind not in ROOM_KINDS:
        raise HouseError(f"room {number} has the kind {kind!r}; use one of {', '.join(ROOM_KINDS)}")
    rect = _rectangle(polygon)
    if rect is None:
        raise HouseError(
            f"room {number} ({kind}) should be a rectangle along x and y with corners on a grid of 0.1 m, at least "
            f"0.8 m wide, got {polygon}; cut other shapes into rectangles"
        )
    return Cell(kind, rect, (rect[2] - rect[0]) * (rect[3] - rect[1]) / GRID**2)


def _rectangle(polygon: object) -> Rect | None:
    """(x0, y0, x1, y1) in decimetres; None where it is no such rectangle."""
    try:
        corners = [(float(x), float(y)) for x, y in polygon]  # type: ignore[attr-defined]  # whatever JSON holds
    except (TypeError, ValueError):
        return None
    steps = [(round(x * GRID), round(y * GRID)) for x, y in corners if abs(x) < 1e4 and abs(y) < 1e4]
    on_grid = len(steps) == len(corners) and all(
        abs(v * GRID - s) < 1e-6
        for corner, step in zip(corners, steps, strict=True)
        for v, s in zip(corner, step, strict=True)
    )
    xs, ys = sorted({x for x, _ in steps}), sorted({y for _, y in steps})
    if not on_grid or len(xs) != 2 or len(ys) != 2 or len(steps) != 4 or len(set(steps)) != 4:
        return None
    if min(xs[1] - xs[0], ys[1] - ys[0]) < 8:
        return None
    return xs[0], ys[0], xs[1], ys[1]
