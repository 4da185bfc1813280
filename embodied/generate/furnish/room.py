"""Rooms are furnished by their rules one after the other, then by fillers; what a room still lacks is counted."""

from __future__ import annotations

import dataclasses

from embodied.generate.config import RETRIES
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.groups import put_group, sides
from embodied.generate.furnish.kitchen import kitchen_line
from embodied.generate.furnish.tables import FurnitureGroup, PlacementRule, RuleCondition


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


def _is_tried(rule: RuleCondition, ctx: Context) -> bool:
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
