"""What a user's own classes add to a room: no group asks for them, so each is placed by its weight for the room."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping

from assets.records import Asset
from embodied.generate.furnish.arrange import Item, floor_poses
from embodied.generate.furnish.ceilings import hang_from_ceiling
from embodied.generate.furnish.context import Context, Liking
from embodied.generate.furnish.mounting import Hanging, about_the_middle, along_stretches, hang_first, longest_first

LIKINGS = {
    "corner": Liking(corner=1.0, window=-0.2),
    "against_wall": Liking(corner=0.4, centre=0.3, window=-1.0),
    "floor": Liking(corner=0.1, centre=0.2, window=0.1, gap=0.06),
}
GROUP = "own"
ASIDE = 0.8
"""Metres from the middle of the ceiling, where its lamp hangs."""


def place_own(ctx: Context) -> None:
    """One thing of each own class whose weight for this kind of room is 1, or with that probability where it is less;
    what rests on surfaces is placed with the other small things."""
    for name in ctx.stock.catalogue.own_classes:
        weights = {a.key: a.rooms.get(ctx.kind, 0.0) for a in ctx.stock.of_role(name) if a.support != "surface"}
        if ctx.chance(min(max(weights.values(), default=0.0), 1.0)):
            asset = ctx.pick(name, where=functools.partial(_belongs, weights))
            if asset is not None:
                _place(ctx, asset)


def _belongs(weights: Mapping[str, float], asset: Asset) -> bool:
    return weights.get(asset.key, 0.0) > 0


def _place(ctx: Context, asset: Asset) -> None:
    if asset.support == "wall":
        spots = along_stretches(longest_first(ctx.space), about_the_middle(ctx.rng))
        hang_first(ctx, Hanging(asset, asset.elevation, GROUP, role=asset.object_class), spots)
        return
    centre = ctx.space.polygon.representative_point()
    if asset.support == "ceiling":
        turns = (k * math.pi / 2 for k in range(4))
        any(
            hang_from_ceiling(ctx, asset, centre.x + ASIDE * math.cos(t), centre.y + ASIDE * math.sin(t)) for t in turns
        )
        return
    stands = ctx.against_wall(
        asset, GROUP, liking=LIKINGS[asset.support], clear=asset.clearance, role=asset.object_class
    )
    if stands is None and asset.support == "floor":
        poses = floor_poses(
            ctx.space,
            yaws=(0.0, math.pi / 2),
            score=lambda x, y, yaw: -math.hypot(x - centre.x, y - centre.y) + 0.3 * ctx.rng.random(),
        )
        ctx.put([Item(asset, role=asset.object_class)], poses, GROUP)
