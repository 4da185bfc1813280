"""Rooms are furnished by their rules one after the other, then by fillers; what a room still lacks is counted.

Things of a user's own classes, which no group asks for, are each placed by their weight for the room.
"""

import dataclasses
import math

from embodied.assets.records import Asset
from embodied.generate.config import RETRIES
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.groups import put_group, sides
from embodied.generate.furnish.kitchen import kitchen_line
from embodied.generate.furnish.mounting import Hanging, along_stretches, hang_first, hang_from_ceiling
from embodied.generate.furnish.tables import FurnitureGroup, GroupPart, PlacementRule


def furnish_room(ctx: Context) -> None:
    """Put the furniture of its kind into the room, and more where it would look bare."""
    spec = ctx.tables.rooms[ctx.kind]
    fulfilled: dict[str, bool] = {}
    for rule in (*spec.rules, *spec.extras):
        if not (rule.unless and fulfilled.get(rule.unless, False)):
            has_place = apply_rule(rule, ctx)
            if rule.name:
                fulfilled[rule.name] = has_place
    for _ in range(RETRIES.fillers if spec.fillers else 0):
        if coverage(ctx) >= spec.fill:
            return
        apply_rule(spec.fillers[int(ctx.rng.integers(len(spec.fillers)))], ctx)


def apply_rule(rule: PlacementRule, ctx: Context) -> bool:
    """Try a rule, as often as it says; whether something found its place the last time."""
    has_place = False
    for role in rule.roles or ("",):
        if not _is_tried(rule, ctx):
            continue
        low, high = rule.times
        times = low if low == high else int(ctx.rng.integers(low, high + 1))
        for _ in range(times + (int(ctx.space.area / rule.per_area) if rule.per_area else 0)):
            has_place = _once(dataclasses.replace(rule, role=role) if role else rule, ctx)
    return has_place


def _is_tried(rule: PlacementRule, ctx: Context) -> bool:
    return (
        rule.above < ctx.space.area <= rule.upto
        and rule.from_attempt <= ctx.attempt <= rule.upto_attempt
        and (not rule.kinds or ctx.kind in rule.kinds)
        and ctx.kind not in rule.not_kinds
        and (not rule.with_rooms or any(k in ctx.kinds for k in rule.with_rooms))
        and not any(k in ctx.kinds for k in rule.without_rooms)
        and (not rule.has or bool(ctx.roles(*rule.has)))
        and not ctx.roles(*rule.lacks)
        and sides(ctx.space.polygon)[1] > rule.wider
        and (rule.chance >= 1.0 or ctx.chance(rule.chance))
    )


def _once(rule: PlacementRule, ctx: Context) -> bool:
    if rule.first:
        return any(apply_rule(other, ctx) for other in rule.first)
    if rule.all:
        return sum(apply_rule(other, ctx) for other in rule.all) > 0
    if rule.either:
        return apply_rule(rule.either[0 if ctx.chance(rule.odds) else 1], ctx)
    if rule.group in ctx.tables.choices:
        return apply_rule(ctx.tables.choices[rule.group], ctx)
    if rule.group == "kitchen_line":
        return kitchen_line(ctx)
    return bool(put_group(ctx, _adjusted(ctx.tables.groups[rule.group], rule), rule.group))


def _adjusted(group: FurnitureGroup, rule: PlacementRule) -> FurnitureGroup:
    """The group with what the rule says of its first part."""
    own = group.parts[0]
    first = dataclasses.replace(
        own,
        role=rule.role or own.role,
        clear=own.clear if rule.clear is None else (rule.clear,),
        most=rule.most or own.most,
        allow_duplicate=rule.allow_duplicate or own.allow_duplicate,
    )
    return dataclasses.replace(group, parts=(first, *group.parts[1:]), near=rule.near or group.near)


def coverage(ctx: Context) -> float:
    """Share of the floor that furniture stands on."""
    standing = (t for t in ctx.things if t.parent is None and t.z < ctx.space.bottom + 0.1 and t.size[2] > 0.05)
    return sum(t.size[0] * t.size[1] for t in standing) / ctx.space.area


def shortage(ctx: Context) -> int:
    """How much the room lacks of its needs, 0 for nothing; each counts more than all that follow it."""
    needs = ctx.tables.rooms[ctx.kind].needs
    return sum(2 ** (len(needs) - 1 - k) for k, need in enumerate(needs) if not ctx.roles(*need.roles))


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
