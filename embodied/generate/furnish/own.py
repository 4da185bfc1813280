"""Things of a user's own classes: no group asks for them, so each is placed by its weight for the room."""

from __future__ import annotations

import math

from embodied.assets.records import Asset
from embodied.generate.furnish.ceilings import hang_from_ceiling
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.groups import put_group
from embodied.generate.furnish.mounting import Hanging, along_stretches, hang_first
from embodied.generate.furnish.tables import FurnitureGroup, GroupPart

GROUP = "own"
LIKES = {
    "corner": {"corner": 1.0, "window": -0.2},
    "against_wall": {"corner": 0.4, "centre": 0.3, "window": -1.0},
    "floor": {"corner": 0.1, "centre": 0.2, "window": 0.1},
}
ASIDE = 0.8
"""Metres from the middle of the ceiling, where its lamp hangs."""


def place_own(ctx: Context) -> None:
    """One thing of each own class whose weight for this kind of room is 1, or with that probability where it is less;
    what rests on surfaces is placed with the other small things."""
    for name in ctx.stock.catalogue.own_classes:
        weights = {a.key: a.rooms.get(ctx.kind, 0.0) for a in ctx.stock.of_role(name) if a.support != "surface"}
        if ctx.chance(min(max(weights.values(), default=0.0), 1.0)):
            asset = ctx.pick(name, where=lambda a: a.support != "surface" and a.rooms.get(ctx.kind, 0.0) > 0)
            if asset is not None:
                _place(ctx, asset)


def _place(ctx: Context, asset: Asset) -> None:
    if asset.support == "wall":
        spots = along_stretches(ctx.space.longest_walls, lambda: (float(ctx.rng.uniform(0.3, 0.7)),))
        hang_first(ctx, Hanging(asset, asset.elevation, GROUP, role=asset.object_class), spots)
        return
    if asset.support == "ceiling":
        centre = ctx.space.polygon.representative_point()
        turns = (k * math.pi / 2 for k in range(4))
        any(
            hang_from_ceiling(ctx, asset, centre.x + ASIDE * math.cos(t), centre.y + ASIDE * math.sin(t)) for t in turns
        )
        return
    part = GroupPart(asset.object_class, clear=(asset.clearance,))
    at_wall = FurnitureGroup((part,), GROUP, likes=LIKES[asset.support], gap=0.06 if asset.support == "floor" else 0.02)
    if not put_group(ctx, at_wall, GROUP, asset) and asset.support == "floor":
        put_group(ctx, FurnitureGroup((GroupPart(asset.object_class),), GROUP, "floor", {"middle": 1.0}), GROUP, asset)
