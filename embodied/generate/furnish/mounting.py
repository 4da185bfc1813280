"""Hanging things on walls: whether one fits at a spot, and which spots are tried in which order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from embodied.assets.records import Asset, Size
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.space import Thing, Wall, box, overlap

DEEP, THIN = 0.12, 0.07
"""Things that come farther out of the wall must leave room to walk past: as furniture must, and narrowly, metres."""
Spot = tuple[Wall, float]
"""A wall and a position along it, metres."""
Shares = Callable[[], Iterable[float]]
"""Positions to try along a wall or a stretch of it, from 0 to 1."""


@dataclass(frozen=True)
class Hanging:
    """Something to hang on a wall, and how."""

    asset: Asset | None
    """None, where the catalogue has nothing suitable, hangs nowhere."""
    z: float
    """Of its underside above the floor, metres."""
    group: str
    role: str = ""
    """The group's name if empty."""
    size: Size | None = None
    """The asset's own if None."""
    margin: float = 0.0
    """Free strip that it wants around it, metres."""
    passage: bool = False
    """True if it may hang before openings."""
    away: float = 0.0
    """Gap to the wall, metres."""


def mount(ctx: Context, hanging: Hanging, wall: Wall, s: float) -> Thing | None:
    """Hang it on the wall with the middle of its back at `s`, if it fits there."""
    asset = hanging.asset
    if asset is None:
        return None
    w, d, h = hanging.size or asset.size
    x, y = wall.point(s, hanging.away + d / 2 + 0.001)
    base, margin = ctx.space.bottom + hanging.z, hanging.margin
    if s - w / 2 < 0.01 or s + w / 2 > wall.length - 0.01:
        return None
    wide = box(x, y, w + 2 * margin, d, wall.yaw, base - margin, base + h + margin)
    exact = box(x, y, w, d, wall.yaw, base, base + h)
    if not ctx.space.fits(exact, passage=hanging.passage) or any(overlap(wide, q) for q in ctx.space.solids):
        return None
    plan: np.ndarray | None = ctx.space.walk
    if d > DEEP and not hanging.passage:
        plan = ctx.space.walkable([exact], ())
    elif d > THIN and not ctx.space.leaves_a_way_past(exact):
        plan = None
    if plan is None:
        return None
    role, looks = hanging.role or hanging.group, ctx.looks(asset)
    thing = Thing(asset, x, y, base, wall.yaw, (w, d, h), looks, group=hanging.group, role=role, wall=wall)
    return ctx.add(thing, exact, plan)


def hang_first(ctx: Context, hanging: Hanging, spots: Iterable[Spot]) -> Thing | None:
    """Hang it at the first of the spots where it fits."""
    return next((thing for wall, s in spots if (thing := mount(ctx, hanging, wall, s)) is not None), None)


def along_walls(walls: Iterable[Wall], shares: Shares) -> Iterator[Spot]:
    """Spots at the given shares of the length of each wall."""
    for wall in walls:
        for share in shares():
            yield wall, wall.length * share


def along_stretches(walls: Iterable[Wall], shares: Shares) -> Iterator[Spot]:
    """Spots at the given shares of each stretch of wall without openings."""
    for wall in walls:
        for a, b in stretches(wall):
            for share in shares():
                yield wall, a + share * (b - a)


def at(*shares: float) -> Shares:
    """These shares, everywhere."""
    return lambda: shares


def stretches(wall: Wall) -> list[tuple[float, float]]:
    """(from, to) of the stretches without openings, metres."""
    edges = [0.0, *(e for s0, s1, _ in wall.openings for e in (s0, s1)), wall.length]
    return list(zip(edges[::2], edges[1::2]))


def spot_behind(ctx: Context, thing: Thing) -> Spot | None:
    """The wall a thing has at its back, and where along it; None if it stands free."""
    bx, by = -thing.front[0], -thing.front[1]
    for wall in ctx.space.walls:
        if bx * wall.inward[0] + by * wall.inward[1] > -0.98:
            continue
        dx, dy = thing.x - wall.start[0], thing.y - wall.start[1]
        away = dx * wall.inward[0] + dy * wall.inward[1] - thing.size[1] / 2
        s = wall.along_of(thing.x, thing.y)
        if -0.05 < away < 0.3 and 0 < s < wall.length:
            return wall, s
    return None
