"""Curtains, radiators, lamps, switches and sockets of a room; what else hangs is in smalls.toml."""

from __future__ import annotations

from embodied.assets.records import Asset
from embodied.generate.furnish.ceilings import ceiling_lamps, detectors
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.likes import has_window
from embodied.generate.furnish.mounting import Hanging, along_walls, at, hang_first, mount, stretches
from embodied.generate.furnish.pictures import above_furniture, mirrors, pictures
from embodied.generate.furnish.smalls import leave
from embodied.generate.furnish.space import Thing, Wall
from embodied.house.house import Opening


def hang_all(ctx: Context) -> None:
    """Everything on walls and ceiling, after the furniture stands."""
    ceiling_lamps(ctx)
    detectors(ctx)
    switches(ctx)
    for hang in (radiators, curtains) if ctx.chance(0.5) else (curtains, radiators):
        hang(ctx)
    above_furniture(ctx)
    leave(ctx, ctx.tables.hung)
    mirrors(ctx)
    pictures(ctx)
    wall_lamps(ctx)
    sockets(ctx)


def curtains(ctx: Context) -> None:
    """Curtains at the windows of rooms one lives in, blinds where curtains do not fit."""
    if ctx.has("bare windows"):
        return
    curtain = ctx.pick("curtain", most=(9.0, 0.2, 9.0), avoid=())
    blind = ctx.pick("window blind", avoid=())
    if ctx.chance(0.12):
        return
    for wall in ctx.space.walls:
        for s0, s1, o in wall.openings:
            if o.kind not in ("window", "french_window"):
                continue
            done = None
            if curtain is not None and not ctx.has("blinds only"):
                done = _curtain(ctx, curtain, wall, s0, s1, o)
            if done is None and blind is not None and o.kind == "window" and ctx.chance(0.8):
                drop = (o.head - o.sill) * ctx.rng.uniform(0.35, 1.0)
                size = (s1 - s0 + 0.06, blind.size[1], drop)
                hanging = Hanging(blind, o.head + 0.04 - drop, "blind", size=size, passage=True)
                mount(ctx, hanging, wall, (s0 + s1) / 2)


def _curtain(ctx: Context, asset: Asset, wall: Wall, s0: float, s1: float, o: Opening) -> Thing | None:
    """A curtain down to the floor, or to the sill where something stands before the window."""
    middle, width = (s0 + s1) / 2, s1 - s0
    top = min(o.head + 0.16, ctx.space.height - 0.02)
    grow = min(0.25, middle - width / 2 - 0.03, wall.length - middle - width / 2 - 0.03)
    if grow < 0.03:
        return None
    for bottom in (0.015, max(o.sill - 0.12, 0.02)):
        size = (width + 2 * grow, asset.size[1], top - bottom)
        done = mount(ctx, Hanging(asset, bottom, "curtain", size=size, passage=True), wall, middle)
        if done:
            return done
    return None


def radiators(ctx: Context) -> None:
    """A radiator under a window, else on what is free of an outer wall."""
    if ctx.has("no radiators") or ctx.roles("towel radiator"):
        return
    left = 1 + (ctx.space.area > 16)
    outer = [w for w in ctx.space.walls if has_window(w)]
    for wall in outer:
        for s0, s1, o in wall.openings:
            if left and o.kind == "window" and o.sill >= 0.75:
                asset = ctx.pick("radiator", most=(s1 - s0 + 0.2, 0.3, o.sill - 0.14), avoid=())
                left -= _radiator(ctx, asset, wall, (s0 + s1) / 2)
    for wall in outer:
        for a, b in stretches(wall):
            if left and b - a > 0.7:
                asset = ctx.pick("radiator", most=(min(b - a - 0.2, 1.5), 0.25, 1.0), avoid=())
                left -= _radiator(ctx, asset, wall, (a + b) / 2)


def _radiator(ctx: Context, asset: Asset | None, wall: Wall, s: float) -> bool:
    return mount(ctx, Hanging(asset, 0.1, "heating", "radiator", away=0.015), wall, s) is not None


def wall_lamps(ctx: Context) -> None:
    """Sconces in halls, corridors and living rooms."""
    if not ctx.has("wall lamps") or not ctx.chance(0.45):
        return
    hanging = Hanging(ctx.pick("wall lamp", most=(0.5, 0.35, 0.7)), 1.75, "wall_lamp", "wall lamp", margin=0.15)
    for wall, s in along_walls(ctx.space.longest_walls[:2], at(0.25, 0.75)):
        mount(ctx, hanging, wall, s)


def switches(ctx: Context) -> None:
    """A light switch beside the latch of each door, 1.1 m high."""
    asset = ctx.pick("switch", avoid=())
    if asset is None:
        return
    double = ctx.pick("dimmer switch" if ctx.chance(0.3) else "double light switch", avoid=())
    if double is not None and ctx.chance(0.25) and ctx.space.area > 12:
        asset = double
    hanging = Hanging(asset, 1.06, "electric", "light switch")
    left = 2 if ctx.kind not in ("hall", "corridor") else 3
    for wall in ctx.space.walls:
        for s0, s1, o in wall.openings:
            if o.kind in ("window", "french_window", "passage") or not left:
                continue
            hinge_at_s0 = abs(wall.along_of(*(o.a if o.hinge == "a" else o.b)) - s0) < 1e-6
            sides = (s1 + 0.2, s0 - 0.2) if hinge_at_s0 else (s0 - 0.2, s1 + 0.2)
            left -= hang_first(ctx, hanging, ((wall, s) for s in sides)) is not None


def sockets(ctx: Context) -> None:
    """Sockets 0.3 m above the floor on free wall, over the worktop in kitchens."""
    asset = ctx.pick("socket", avoid=())
    if asset is None or ctx.has("no sockets"):
        return
    z = 1.1 if ctx.kind == "kitchen" else 0.26
    if ctx.kind == "kitchen" and ctx.chance(0.5):
        asset = ctx.pick("double socket", avoid=()) or asset
    hanging = Hanging(asset, z, "electric", "wall socket")
    left = 1 + (ctx.space.area > 9) + (ctx.space.area > 20)
    for wall, s in along_walls(ctx.space.longest_walls, at(0.12, 0.88)):
        if left and wall.length > 1.2:
            left -= mount(ctx, hanging, wall, s) is not None
