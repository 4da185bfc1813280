"""Contents of furniture: small things behind its doors and in its drawers, drawn from the house's seed when asked for.

They are no part of a house's JSON; `stocked` adds those that lie in what is open, as placements of their own.
"""

import dataclasses
import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from embodied.assets.catalogue import Asset, Catalogue
from embodied.assets.moving_parts import OPENING_ROWS, MovingPart, openness_of
from embodied.house.house import House, Placement
from embodied.house.household import household_of
from embodied.house.left_open import free_openness
from embodied.house.moment import RigidPose, apart
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
