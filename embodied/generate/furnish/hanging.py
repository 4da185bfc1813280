"""What hangs in a room besides pictures: curtains, radiators, clocks, switches, sockets, hooks, towels."""

from __future__ import annotations

import math
from dataclasses import dataclass

from assets.records import Asset
from embodied.generate.furnish.arrange import Thing
from embodied.generate.furnish.ceilings import ceiling_lamps, detectors
from embodied.generate.furnish.context import Context, has_window
from embodied.generate.furnish.mounting import (
    Hanging,
    about_the_middle,
    along_stretches,
    along_walls,
    at,
    hang_first,
    longest_first,
    mount,
    spot_behind,
    stretches,
)
from embodied.generate.furnish.pictures import above_furniture, mirrors, pictures
from embodied.generate.furnish.space import Wall
from embodied.house.house import Opening

WET = ("bathroom", "toilet")
UNCURTAINED = ("garage", "workshop", "pantry", "closet", "laundry_room", "stairwell", "toilet", "gym")
ONLY_BLINDS = ("kitchen", "bathroom")
UNHEATED = ("garage", "pantry", "closet", "corridor", "stairwell", "toilet")
CLOCKED = ("kitchen", "living_room", "study", "hall", "dining_room", "family_room", "kids_room", "gym")
SCONCED = ("corridor", "hall", "living_room", "stairwell", "family_room", "library")
"""Room kinds that may have lamps on their walls."""


@dataclass(frozen=True)
class Rarity:
    """Something that hangs in some rooms of some kinds."""

    role: str
    kinds: tuple[str, ...]
    chance: float
    z: float
    """Of its underside, metres above the floor; negative: below the ceiling."""
    margin: float


RARITIES = (
    Rarity("air conditioner", ("living_room", "main_bedroom", "study", "gym"), 0.2, -0.45, 0.05),
    Rarity("water heater", ("laundry_room",), 0.7, 1.3, 0.05),
    Rarity("dartboard", ("playroom", "garage"), 0.5, 1.5, 0.3),
    Rarity("utensil rack", ("kitchen",), 0.4, 1.1, 0.03),
    Rarity("knife rack", ("kitchen",), 0.3, 1.1, 0.03),
    Rarity("hanging clothes", ("closet",), 0.8, 0.55, 0.02),
    Rarity("suit", ("closet",), 0.5, 1.2, 0.02),
    Rarity("hanging clothes", ("closet",), 0.5, 0.55, 0.02),
    Rarity("security camera", ("garage",), 0.2, -0.4, 0.1),
    Rarity("network socket", ("study",), 0.7, 0.26, 0.0),
    Rarity("aerial socket", ("living_room",), 0.7, 0.26, 0.0),
    Rarity("thermometer", ("dining_room", "living_room", "study"), 0.05, 1.4, 0.1),
)
"""In the order in which they are hung."""


def hang_all(ctx: Context) -> None:
    """Everything on walls and ceiling, after the furniture stands."""
    ceiling_lamps(ctx)
    detectors(ctx)
    switches(ctx)
    if ctx.chance(0.5):
        radiators(ctx)
        curtains(ctx)
    else:
        curtains(ctx)
        radiators(ctx)
    above_furniture(ctx)
    if ctx.kind == "hall":
        hooks(ctx)
        intercom(ctx)
    if ctx.kind in WET:
        towels(ctx)
    mirrors(ctx)
    pictures(ctx)
    clock(ctx)
    wall_lamps(ctx)
    sockets(ctx)
    rarities(ctx)


def curtains(ctx: Context) -> None:
    """Curtains at the windows of rooms one lives in, blinds where curtains do not fit."""
    if ctx.kind in UNCURTAINED:
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
            if curtain is not None and ctx.kind not in ONLY_BLINDS:
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
    if ctx.kind in UNHEATED or ctx.roles("towel radiator"):
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


def clock(ctx: Context) -> None:
    """A wall clock in rooms where one looks at it."""
    if ctx.kind not in CLOCKED or not ctx.chance(0.45):
        return
    asset = ctx.pick("wall clock")
    if asset is None:
        return
    z = min(2.0, ctx.space.height - 0.2) - asset.size[2] / 2
    spots = along_stretches(longest_first(ctx.space), about_the_middle(ctx.rng))
    hang_first(ctx, Hanging(asset, z, "clock", margin=0.1), spots)


def wall_lamps(ctx: Context) -> None:
    """Sconces in halls, corridors and living rooms."""
    if ctx.kind not in SCONCED or not ctx.chance(0.45):
        return
    hanging = Hanging(ctx.pick("wall lamp", most=(0.5, 0.35, 0.7)), 1.75, "wall_lamp", "wall lamp", margin=0.15)
    for wall, s in along_walls(longest_first(ctx.space)[:2], at(0.25, 0.75)):
        mount(ctx, hanging, wall, s)


def switches(ctx: Context) -> None:
    """A light switch beside the latch of each door, 1.1 m high."""
    asset = ctx.stock.pick("switch", rng=ctx.rng)
    if asset is None:
        return
    double = ctx.stock.pick("dimmer switch" if ctx.chance(0.3) else "double light switch", rng=ctx.rng)
    if double is not None and ctx.chance(0.25) and ctx.space.area > 12:
        asset = double
    hanging = Hanging(asset, 1.06, "electric", "light switch")
    left = 2 if ctx.kind not in ("hall", "corridor") else 3
    for wall in ctx.space.walls:
        for s0, s1, o in wall.openings:
            if o.kind in ("window", "french_window", "passage") or not left:
                continue
            hinge_at_s0 = abs(_along(wall, o.a if o.hinge == "a" else o.b) - s0) < 1e-6
            sides = (s1 + 0.2, s0 - 0.2) if hinge_at_s0 else (s0 - 0.2, s1 + 0.2)
            left -= hang_first(ctx, hanging, ((wall, s) for s in sides)) is not None


def _along(wall: Wall, point: tuple[float, float]) -> float:
    return (point[0] - wall.start[0]) * wall.along[0] + (point[1] - wall.start[1]) * wall.along[1]


def sockets(ctx: Context) -> None:
    """Sockets 0.3 m above the floor on free wall, over the worktop in kitchens."""
    asset = ctx.stock.pick("socket", rng=ctx.rng)
    if asset is None or ctx.kind in (*WET, "closet"):
        return
    z = 1.1 if ctx.kind == "kitchen" else 0.26
    if ctx.kind == "kitchen" and ctx.chance(0.5):
        asset = ctx.stock.pick("double socket", rng=ctx.rng) or asset
    hanging = Hanging(asset, z, "electric", "wall socket")
    left = 1 + (ctx.space.area > 9) + (ctx.space.area > 20)
    for wall, s in along_walls(longest_first(ctx.space), at(0.12, 0.88)):
        if left and wall.length > 1.2:
            left -= mount(ctx, hanging, wall, s) is not None


def hooks(ctx: Context) -> None:
    """Coat hooks at shoulder height near the entry."""
    asset = ctx.pick("coat hooks") or ctx.pick("coat rack")
    if asset is None or asset.support != "wall":
        return
    hanging = Hanging(asset, 1.62, "entry", "coat hooks", margin=0.05)
    over_benches = (spot for bench in ctx.roles("bench") if (spot := spot_behind(ctx, bench)) is not None)
    if hang_first(ctx, hanging, over_benches) is None:
        hang_first(ctx, hanging, along_stretches(longest_first(ctx.space), at(0.3, 0.7, 0.5)))


def intercom(ctx: Context) -> None:
    """A door phone beside the front door."""
    if not ctx.chance(0.5):
        return
    hanging = Hanging(ctx.pick("intercom"), 1.35, "entry", "intercom")
    beside = (
        (wall, s)
        for wall in ctx.space.walls
        for s0, s1, o in wall.openings
        if o.kind == "front_door"
        for s in (s0 - 0.35, s1 + 0.35)
    )
    hang_first(ctx, hanging, beside)


def towels(ctx: Context) -> None:
    """Towel rails and hanging towels, near the basin or the bath."""
    anchors = ctx.roles("basin", "bathtub", "shower", "corner bathtub")
    left = 1 if ctx.kind == "toilet" else 2
    if ctx.kind == "bathroom":
        asset = ctx.pick("towel radiator", most=(0.7, 0.25, 1.7))
        if asset is not None and ctx.chance(0.7) and _near(ctx, asset, anchors, 0.35 if asset.size[2] > 1.2 else 0.7):
            left -= 1
    for _ in range(left):
        asset = ctx.pick("towel holder", most=(0.8, 0.25, 0.8))
        if asset is not None:
            _near(ctx, asset, anchors, 1.35 - asset.size[2] if asset.size[2] > 0.3 else 1.1)


def _near(ctx: Context, asset: Asset, anchors: list[Thing], z: float) -> Thing | None:
    """Hang `asset` as close to one of the anchors as the walls allow."""
    spots = []
    for wall in ctx.space.walls:
        for k in range(1, int(wall.length / 0.2)):
            x, y = wall.point(0.2 * k, 0.1)
            spots.append((min((math.hypot(x - t.x, y - t.y) for t in anchors), default=1.0), wall, 0.2 * k))
    hanging = Hanging(asset, z, "towels", asset.object_class, margin=0.04)
    return hang_first(ctx, hanging, ((wall, s) for _, wall, s in sorted(spots, key=lambda p: p[0])))


def rarities(ctx: Context) -> None:
    """Rarer things on walls: air conditioner, water heater, dartboard, tool racks, clothes on hangers."""
    height = ctx.space.height
    for rarity in RARITIES:
        if ctx.kind not in rarity.kinds or not ctx.chance(rarity.chance):
            continue
        z = rarity.z if rarity.z >= 0 else height + rarity.z
        asset = ctx.pick(rarity.role, most=(3.0, 0.8, height - z - 0.02), where=lambda a: a.support == "wall")
        walls = sorted(ctx.space.walls, key=lambda w: (has_window(w), -w.length))
        hanging = Hanging(asset, z, "wall", rarity.role, margin=rarity.margin)
        hang_first(ctx, hanging, along_walls(walls, about_the_middle(ctx.rng)))
