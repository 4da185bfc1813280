"""Things that hang from ceilings: lamps, smoke detectors, fans."""

from __future__ import annotations

import math

import shapely

from embodied.assets.records import Asset
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.space import Thing, box, overlap


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
            below = space.ceiling.contains(shapely.Point(x, y))
            if not below or any(math.hypot(x - a, y - b) < 1.5 for a, b in spots):
                continue
            if hang_from_ceiling(ctx, lamp, x, y):
                spots.append((x, y))
    if not spots:
        for lamp in sorted(ctx.stock.of_role("ceiling lamp"), key=lambda a: a.size[2]):
            if hang_from_ceiling(ctx, lamp, centre.x, centre.y):
                return


def detectors(ctx: Context) -> None:
    """A smoke detector on the ceiling of halls, corridors and bedrooms; now and then a fan between the lamps."""
    if ctx.has("fans") and ctx.chance(0.12):
        fan = ctx.pick("ceiling fan")
        if fan is not None:
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
    height = ctx.space.height
    if ctx.has("fluorescent tubes"):
        lamp = ctx.pick("fluorescent lamp", avoid=())
        if lamp is not None:
            return lamp
    if ctx.has("track lights") and ctx.chance(0.12):
        lamp = ctx.pick("track light", most=(1.3, 1.3, 0.45), avoid=())
        if lamp is not None:
            return lamp
    if ctx.has("flat lamps") or ctx.chance(0.45):
        return ctx.pick("ceiling lamp", most=(0.9, 0.9, 0.35), avoid=())
    return ctx.pick("ceiling light", most=(0.9, 0.9, height - 2.0), avoid=()) or ctx.pick("ceiling lamp", avoid=())


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
