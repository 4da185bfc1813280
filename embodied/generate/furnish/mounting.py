"""Hanging things on walls and from ceilings: where one fits, and which spots are tried in which order."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely

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


def ceiling_lamps(ctx: Context) -> None:
    """A lamp over the table or the middle of the room, several in large rooms, rows in long ones."""
    space = ctx.space
    lamp = _ceiling_lamp(ctx)
    if lamp is None:
        return
    tables = ctx.roles("dining table", "kitchen island")
    x0, y0, x1, y1 = space.ceiling.bounds
    wx, wy = x1 - x0, y1 - y0
    nx = max(1, round(wx / 3.6)) if wx > 4.6 else 1
    ny = max(1, round(wy / 3.6)) if wy > 4.6 else 1
    if ctx.kind in ("corridor", "hall"):
        nx, ny = max(1, round(wx / 3.0)), max(1, round(wy / 3.0))
    spots = []
    for table in tables:
        pendant = ctx.pick("fine pendant", most=(1.4, 1.4, 1.8)) or lamp
        if hang_from_ceiling(ctx, pendant, table.x, table.y, table.z + table.size[2] + 0.7):
            spots.append((table.x, table.y))
    centre = space.ceiling.centroid
    if not space.ceiling.contains(centre):
        centre = space.ceiling.representative_point()
    for i in range(nx):
        for j in range(ny):
            x, y = x0 + (i + 0.5) * wx / nx, y0 + (j + 0.5) * wy / ny
            if nx * ny == 1:
                x, y = centre.x, centre.y
            is_free = space.ceiling.contains(shapely.Point(x, y)) and all(
                math.hypot(x - a, y - b) >= 1.5 for a, b in spots
            )
            if is_free and hang_from_ceiling(ctx, lamp, x, y):
                spots.append((x, y))
    if not spots:
        flat = sorted(ctx.stock.of_role("ceiling lamp"), key=lambda a: a.size[2])
        any(hang_from_ceiling(ctx, lamp, centre.x, centre.y) for lamp in flat)


def detectors(ctx: Context) -> None:
    """A smoke detector on the ceiling of halls, corridors and bedrooms; now and then a fan between the lamps."""
    if ctx.has("fans") and ctx.chance(0.12) and (fan := ctx.pick("ceiling fan")):
        hang_from_ceiling(ctx, fan, ctx.space.ceiling.centroid.x, ctx.space.ceiling.centroid.y)
    if not ctx.has("smoke detectors") or not ctx.chance(0.6):
        return
    asset = ctx.pick("smoke detector")
    c = ctx.space.ceiling.representative_point()
    if asset is not None:
        for dx, dy in ((0.6, 0.0), (0.0, 0.6), (-0.6, 0.0)):
            if hang_from_ceiling(ctx, asset, c.x + dx, c.y + dy):
                return


def _ceiling_lamp(ctx: Context) -> Asset | None:
    """One model for the whole room; flat ones where people walk close beneath."""
    if ctx.has("fluorescent tubes") and (lamp := ctx.pick("fluorescent lamp", avoid=())):
        return lamp
    if (
        ctx.has("track lights")
        and ctx.chance(0.12)
        and (lamp := ctx.pick("track light", most=(1.3, 1.3, 0.45), avoid=()))
    ):
        return lamp
    if ctx.has("flat lamps") or ctx.chance(0.45):
        return ctx.pick("ceiling lamp", most=(0.9, 0.9, 0.35), avoid=())
    return ctx.pick("ceiling light", most=(0.9, 0.9, ctx.space.height - 2.0), avoid=()) or ctx.pick(
        "ceiling lamp", avoid=()
    )


def hang_from_ceiling(ctx: Context, asset: Asset, x: float, y: float, underside: float | None = None) -> bool:
    """Hang a thing from the ceiling over (x, y), `elevation` below it, if it fits there.

    Args:
      underside: z that the lowest point of a hanging lamp should have.
    """
    w, d, h = asset.size
    flat = asset.object_class == "ceiling lamp"
    hangs_low = asset.support == "ceiling" and asset.object_class not in ctx.tables.lumens
    top = ctx.space.bottom + ctx.space.height - asset.elevation * hangs_low
    if underside is not None and not flat:
        scale = min(max((top - underside) / h, 0.6), 1.35)
        if scale < 1 or asset.object_class != "chandelier":
            h = h * scale
            w, d = w * min(scale, 1.0), d * min(scale, 1.0)
    filled = box(x, y, w, d, 0.0, top - h, top)
    low = not flat and any(overlap(filled, k) for k in ctx.space.keepouts)  # before a window or in a doorway
    if low or not ctx.space.fits(filled, passage=True):
        return False
    role = "ceiling lamp" if ctx.fits(asset, "main lamps") else asset.object_class
    thing = Thing(asset, x, y, top - h, 0.0, (w, d, h), ctx.looks(asset), group="ceiling", role=role)
    ctx.add(thing, filled)
    return True
