"""A house on another day: other people in it, and small things moved or put away."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import shapely

from embodied.generate.people import CLASS, add_people, place_people
from embodied.geometry import rotation
from embodied.house.house import House, Placement, rounded
from embodied.house.shapes import footprint
from embodied.seeds import stream

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.navigation.graph import NavGraph

GONE, MOVED = 0.3, 0.7
"""Share of the small things that are put away, and share of the others that lie elsewhere on the same surface."""
SMALL_THING = 0.6
"""Longest side of small things, metres."""
EDGE, SPOT_TRIES = 0.01, 12


def rearranged(house: House, graph: NavGraph, catalogue: Catalogue, starts: Iterable[int], *, day: int) -> House:
    """The same rooms and furniture, as they look on another day.

    Args:
      starts: nodes where assistants may be met, as those of `embodied.generate.people.add_people`.
      day: which day; 0 is the house itself.
    """
    if day == 0:
        return house
    rng = stream(house.seed, "another day", house.name, day)
    removed = {p.id for p in _small(house) if rng.random() < GONE}
    left = dataclasses.replace(house, placements=tuple(p for p in house.placements if p.id not in removed))
    tidied = _moved(left, catalogue, rng)
    empty = dataclasses.replace(tidied, placements=tuple(p for p in tidied.placements if p.object_class != CLASS))
    if len(empty.placements) == len(tidied.placements):
        return tidied  # nobody was there
    met = place_people(empty, graph, catalogue, seed=int(rng.integers(2**31)))
    return add_people(empty, met, starts)


def _small(house: House) -> list[Placement]:
    """Things that lie about: nothing rests on them, they give no light, and they rest on furniture or on the floor."""
    carry = {p.parent for p in house.placements} | {light.placement for light in house.lights}
    return [
        p
        for p in house.placements
        if p.id not in carry and max(p.size) <= SMALL_THING and p.surface and p.object_class != CLASS
    ]


def _moved(house: House, catalogue: Catalogue, rng: np.random.Generator) -> House:
    """Small things elsewhere on their surface, turned; those that find no free spot stay."""
    there: dict[str, Placement] = {p.id: p for p in house.placements}
    for thing in _small(house):
        top = _surface(there[thing.parent], thing.surface, catalogue) if thing.parent in there else None
        if top is None or rng.random() >= MOVED:
            continue
        others = [
            footprint(p)
            for p in there.values()
            if p.parent == thing.parent and p.surface == thing.surface and p.id != thing.id
        ]
        taken = shapely.union_all(others).buffer(EDGE)
        low, high = np.array(top.bounds[:2]), np.array(top.bounds[2:])
        for _ in range(SPOT_TRIES):
            x, y = rng.uniform(low, high)
            elsewhere = dataclasses.replace(
                thing, position=rounded((x, y, thing.position[2])), yaw=rounded(thing.yaw + rng.uniform(-0.6, 0.6))
            )
            base = footprint(elsewhere)
            if top.contains(base) and not taken.intersects(base):
                there[thing.id] = elsewhere
                break
    return dataclasses.replace(house, placements=tuple(there.values()))


def _surface(carrier: Placement, name: str | None, catalogue: Catalogue) -> shapely.Polygon | None:
    """The part of a carrier's surface that things may lie on, world; None where the catalogue does not know it."""
    asset = catalogue.assets.get(carrier.asset)
    surfaces = [s for s in asset.surfaces if s.name == name] if asset else []
    if asset is None or not surfaces:
        return None
    s, (kx, ky, _) = surfaces[0], np.array(carrier.size) / np.array(asset.size)
    corners = np.array([(s.x0, s.y0), (s.x1, s.y0), (s.x1, s.y1), (s.x0, s.y1)]) * (kx, ky)
    return shapely.Polygon(corners @ rotation(carrier.yaw).T + carrier.position[:2]).buffer(-EDGE)
