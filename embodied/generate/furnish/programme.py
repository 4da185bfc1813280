"""Rooms get what their programme wishes for: wishes one after the other, fillers, and what a room still lacks."""

from __future__ import annotations

import dataclasses

from embodied.generate.config import RETRIES
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.groups import put_group, sides
from embodied.generate.furnish.kitchen import kitchen_line
from embodied.generate.furnish.tables import Group, Wish


def furnish_room(ctx: Context) -> None:
    """Put the furniture of its kind into the room, and more where it would look bare."""
    programme = ctx.tables.rooms[ctx.kind]
    fulfilled: dict[str, bool] = {}
    for wish in (*programme.wishes, *programme.extras):
        if not (wish.unless and fulfilled.get(wish.unless, False)):
            found = fulfil(wish, ctx)
            if wish.name:
                fulfilled[wish.name] = found
    for _ in range(RETRIES.fillers if programme.fillers else 0):
        if coverage(ctx) >= programme.fill:
            return
        fulfil(programme.fillers[int(ctx.rng.integers(len(programme.fillers)))], ctx)


def fulfil(wish: Wish, ctx: Context) -> bool:
    """Try a wish, as often as it says; whether something found its place the last time."""
    found = False
    for role in wish.roles or ("",):
        if not _is_tried(wish, ctx):
            continue
        low, high = wish.times
        times = low if low == high else int(ctx.rng.integers(low, high + 1))
        for _ in range(times + (int(ctx.space.area / wish.per_area) if wish.per_area else 0)):
            found = _once(dataclasses.replace(wish, role=role) if role else wish, ctx)
    return found


def _is_tried(wish: Wish, ctx: Context) -> bool:
    return (
        wish.above < ctx.space.area <= wish.upto
        and wish.from_attempt <= ctx.attempt <= wish.upto_attempt
        and (not wish.kinds or ctx.kind in wish.kinds)
        and ctx.kind not in wish.not_kinds
        and (not wish.with_rooms or any(k in ctx.kinds for k in wish.with_rooms))
        and not any(k in ctx.kinds for k in wish.without_rooms)
        and (not wish.has or bool(ctx.roles(*wish.has)))
        and not ctx.roles(*wish.lacks)
        and sides(ctx.space.polygon)[1] > wish.wider
        and (wish.chance >= 1.0 or ctx.chance(wish.chance))
    )


def _once(wish: Wish, ctx: Context) -> bool:
    if wish.first:
        return any(fulfil(other, ctx) for other in wish.first)
    if wish.all:
        return sum(fulfil(other, ctx) for other in wish.all) > 0
    if wish.either:
        return fulfil(wish.either[0 if ctx.chance(wish.odds) else 1], ctx)
    if wish.group in ctx.tables.choices:
        return fulfil(ctx.tables.choices[wish.group], ctx)
    if wish.group == "kitchen_line":
        return kitchen_line(ctx)
    return bool(put_group(ctx, _as_wished(ctx.tables.groups[wish.group], wish), wish.group))


def _as_wished(group: Group, wish: Wish) -> Group:
    """The group with what the wish says of its first part."""
    own = group.parts[0]
    first = dataclasses.replace(
        own,
        role=wish.role or own.role,
        clear=own.clear if wish.clear is None else (wish.clear,),
        most=wish.most or own.most,
        again=wish.again or own.again,
    )
    return dataclasses.replace(group, parts=(first, *group.parts[1:]), near=wish.near or group.near)


def coverage(ctx: Context) -> float:
    """Share of the floor that furniture stands on."""
    standing = (t for t in ctx.things if t.parent is None and t.z < ctx.space.bottom + 0.1 and t.size[2] > 0.05)
    return sum(t.size[0] * t.size[1] for t in standing) / ctx.space.area


def shortage(ctx: Context) -> int:
    """How much the room lacks of its needs, 0 for nothing; each counts more than all that follow it."""
    needs = ctx.tables.rooms[ctx.kind].needs
    return sum(2 ** (len(needs) - 1 - k) for k, need in enumerate(needs) if not ctx.roles(*need.roles))
