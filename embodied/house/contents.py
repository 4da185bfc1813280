"""Contents of furniture: small things behind its doors and in its drawers, drawn from the house's seed when asked for;
how far doors, drawers and lids can open in a house, and which of them its household has left open.

Contents are no part of a house's JSON; `stocked` adds those that lie in what is open, as placements of their own.
"""

import dataclasses
import itertools
from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from embodied.assets.catalogue import Asset, Catalogue
from embodied.assets.moving_parts import OPENING_CLASSES, OPENING_ROWS, MovingPart, openness_of
from embodied.geometry import rotation
from embodied.house.house import WINDOWS, House, Opening, Placement
from embodied.house.household import household_of
from embodied.house.moment import WIDEST, Moment, RigidPose, apart
from embodied.house.shapes import footprint, inward
from embodied.seeds import stream

STORED = "in/"
"""Start of Placement.group of what lies in furniture; the name of its part follows."""
AROUND_THINGS, SMALLEST, EMPTY_SHARE, REACHED = 0.02, 0.6, 0.2, 0.85
"""Metres around things, the least share of its size that one is folded to, how likely a row ends early, and how far a
part can open at least in which something lies, by boxes around what stands near."""


def part_of(thing: str) -> str:
    """Name of the part of furniture in which a thing lies, 'dresser_1/drawer_2', by its id."""
    return "/".join(thing.split(".")[:2])


def kept_in(object_class: str, part: str) -> list[str]:
    """Classes of what may lie in a part of furniture, 'board game:plays' where only in households with that habit."""
    row = OPENING_ROWS.get(object_class, {})
    return list(row.get("drawers" if part.startswith("drawer") else "holds", row.get("holds", [])))


def contents(house: House, catalogue: Catalogue, *, hidden: bool = False) -> tuple[Placement, ...]:
    """Things in the open parts of furniture, where they lie now; an id begins with those of furniture and part:
    'dresser_1.drawer_2.towel_1'. Nothing lies where a part cannot be opened.

    Args:
      hidden: also what lies in closed ones.
    """
    household, out = household_of(house), list[Placement]()
    is_open = hidden or any(openness_of(p.params) for p in house.placements)
    free = free_openness(house, catalogue, cleared=True) if is_open else {}
    has = {"", *household.habits, *(["children"] if household.children else [])}
    for p in house.placements:
        openness = openness_of(p.params)
        whole = apart(catalogue.mesh, p) if hidden or openness else None
        for m in whole.moving if whole is not None else ():
            if (hidden or m.name in openness) and free[f"{p.id}/{m.name}"] > REACHED:
                words = (word.partition(":") for word in kept_in(p.object_class, m.name))
                classes = [some for w, _, habit in words if habit in has and (some := catalogue.of_class(w))]
                way = m.turn(openness.get(m.name, 0.0))[1] if m.slides else np.zeros(3)
                out += _lying(p, m, classes, way, rng=stream(house.seed, "contents", p.id, m.name))
    return tuple(out)


def _lying(
    p: Placement, m: MovingPart, classes: Sequence[Sequence[Asset]], way: np.ndarray, *, rng: np.random.Generator
) -> Iterator[Placement]:
    """Things in one part that has come out by `way`, (3,) metres, in rows at the front of its floors."""
    count, frame, (x0, y0, _), (x1, y1, _) = dict[str, int](), RigidPose.upright(p.position, p.yaw), *m.inside
    for low, high in itertools.pairwise(m.floors):
        x = x0 + AROUND_THINGS
        while True:
            room = np.array([x1 - x, y1 - y0, high - low]) - AROUND_THINGS
            sized = ([(a, min(1.0, *(room / a.size).tolist())) for a in some] for some in classes)
            fitting = [fit for some in sized if (fit := [x for x in some if x[1] >= SMALLEST])]
            if not fitting or (x > x0 + AROUND_THINGS and rng.random() < EMPTY_SHARE):
                break
            some = fitting[rng.integers(len(fitting))]
            asset, share = some[rng.integers(len(some))]
            w, d, h = (share * side for side in asset.size)
            n = count[asset.object_class] = count.get(asset.object_class, 0) + 1
            a, b, c = frame.points(np.array([[x + w / 2, y0 + AROUND_THINGS + d / 2, low]]) + way)[0].tolist()
            where = p.room, (a, b, c), p.yaw, (w, d, h), p.id, None, (), STORED + m.name
            name = f"{p.id}.{m.name}.{asset.object_class.replace(' ', '_')}_{n}"
            yield Placement(name, asset.key, asset.object_class, *where)
            x += w + AROUND_THINGS


def stocked(house: House, catalogue: Catalogue) -> House:
    """The house with what lies in its open furniture; itself where nothing is open."""
    inside = contents(house, catalogue)
    own = [p for p in house.placements if not (p.group or "").startswith(STORED)]
    return dataclasses.replace(house, placements=(*own, *inside)) if inside else house


OPENNESS_STEPS = np.linspace(0, 1, 19)[1:]
"""Openness that is tried; of doors, every 5 degrees."""
NEAR, TOUCH = 0.02, 0.004
"""Metres that things may stand in the way, as boxes around them are larger than they are, and where that counts."""
HANGS, PUSHED, ROLL = ("curtain", "sheer curtain", "pendant lamp", "note", "child's drawing"), 0.6, 0.08
"""Classes that give way, longest side of what is pushed along its wall, and height of a raised blind, metres."""
LEFT = {"door": (0.1, 0.05, 0.5), "drawer": (0.12, 0.1, 0.6), "lid": (0.8, 1.0, 1.0)}
"""Share of the parts of furniture that a household leaves open at disorder 1, and how far, from and to."""
BATHS, BATH_DOORS = ("bathroom", "toilet"), (0.6, 0.1, 0.4)
"""Kinds of room whose doors stand ajar, and likewise how many of them, and how far."""


def gives_way(p: Placement, catalogue: Catalogue) -> bool:
    """True for what somebody who opens a thing moves first: curtains, what stands free or is small, what lies about."""
    support, small = catalogue.assets[p.asset].support, max(p.size[:2]) <= PUSHED
    stands = support in ("floor", "surface") or (support in ("against_wall", "corner") and small)
    return p.object_class in HANGS or (stands and (p.parent is not None or p.object_class not in OPENING_CLASSES))


def free_openness(house: House, catalogue: Catalogue, *, cleared: bool = False) -> dict[str, float]:
    """How far every part of furniture and every window can open, 0 to 1 by placement id and part, or by opening, until
    it meets a wall or the box around another thing; handles may touch.

    Args:
      cleared: what gives way has been moved away, and blinds are up.
    """
    rooms = {r.id: house.floor(r).buffer(NEAR) for r in house.rooms}
    still = (p for p in house.placements if not (cleared and gives_way(p, catalogue)))
    low = lambda p: p.position[2] + (p.size[2] - ROLL) * (cleared and p.object_class == "window blind")
    boxes = [(p, footprint(p), low(p), p.position[2] + p.size[2]) for p in still]
    out, by = {}, TOUCH if cleared else NEAR
    for p in house.placements:
        whole = apart(catalogue.mesh, p)
        others = [b for b in boxes if b[0].room == p.room and b[0].id != p.id and b[0].parent != p.id]
        for m in whole.moving if whole is not None else ():
            met = (k for k, front in enumerate(_swept(p, m, by)) if _meets(front, rooms[p.room], others, by))
            out[f"{p.id}/{m.name}"] = float(([0.0, *OPENNESS_STEPS])[next(met, len(OPENNESS_STEPS))])
    return out | {o.id: _window(house, o, boxes) for o in house.openings if o.kind in WINDOWS}


def _window(house: House, o: Opening, boxes: list[tuple]) -> float:
    """How far the casements of a window can open into their room; what hangs there gives way."""
    a, b, floor = np.asarray(o.a, float), np.asarray(o.b, float), house.floor_height(o)
    wide, wall = float(np.linalg.norm(b - a)) / o.casements, shapely.LineString([a, b])
    before = shapely.Polygon([a, b, *(end + wide * inward(house, o) for end in (b, a))])
    there = lambda p: p.room == o.rooms[0] and p.object_class not in ("curtain", "window blind")
    level = [(p, x) for p, x, low, high in boxes if low < floor + o.head - NEAR and high > floor + o.sill + NEAR]
    met = [x.distance(wall) for p, x in level if there(p) and x.intersects(before)]
    return float(np.arcsin(min([wide, *met]) / wide) / WIDEST)


def _swept(p: Placement, m: MovingPart, by: float) -> Iterator[tuple[shapely.Geometry, float, float]]:
    """Outline on the floor of a part as it opens, shrunk by so many metres, and its lowest and highest point."""
    corners = np.array(np.meshgrid(*m.box.T)).reshape(3, -1).T
    for openness in OPENNESS_STEPS:
        turn, shift = m.turn(openness)
        there = corners @ turn.T + shift
        outline = shapely.MultiPoint(there[:, :2] @ rotation(p.yaw).T + p.position[:2]).convex_hull
        low, high = p.position[2] + there[:, 2].min(), p.position[2] + min(there[:, 2].max(), m.top)
        yield outline.buffer(-min(by, 0.4 * float(np.ptp(m.box[:, 1])))), low, high


def _meets(front: tuple, room: shapely.Polygon, others: list[tuple], by: float) -> bool:
    outline, low, high = front
    over = (b for _, b, bottom, top in others if low + by < top and high - by > bottom)
    return not room.contains(outline) or any(outline.intersects(b) for b in over)


def left_open(house: House, catalogue: Catalogue) -> Moment:
    """All that the household has left open, by the house's seed: windows, doors and drawers of furniture, more where it
    is untidy, and bathroom doors ajar; where a window is open, blinds are up. `Moment.applied` makes such a house."""
    kinds = {r.id: r.kind for r in house.rooms}
    baths = [o for o in house.openings if o.kind == "door" and {kinds.get(r or "") for r in o.rooms} & {*BATHS}]
    shares = {o.id: (*BATH_DOORS, o.angle / WIDEST) for o in baths if o.leaf_finish is not None}
    for name, free in free_openness(house, catalogue).items():
        share, least, most = LEFT[next((k for k in LEFT if k in name.rpartition("/")[2]), "door")]
        shares[name] = (share * house.disorder, least, most, free)
    openness = {}
    for name, (share, least, most, free) in shares.items():
        rng = stream(house.seed, "left open", name)
        if rng.random() < share and free > 0 and not name.endswith("/cloth"):
            openness[name] = round(min(float(rng.uniform(least, most)), free), 3)
    aired = {o.rooms[0] for o in house.openings if o.kind in WINDOWS and o.id in openness}
    raised = (p.id for p in house.placements if p.object_class == "window blind" and p.room in aired)
    return Moment(openness=openness | {f"{blind}/cloth": 1.0 for blind in raised})
