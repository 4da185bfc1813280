"""The words of the table of rooms: steps that are tried in turn, under conditions, and how groups combine."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from embodied.generate.furnish.context import Context

Group = Callable[[Context], object]
"""Tries to put a group of things into the room; its answer is true where it found a place."""
Test = Callable[[Context], bool]


@dataclass(frozen=True)
class Wish:
    """One line of a room's programme."""

    group: Group
    chance: float = 1.0
    """Probability that it is tried; drawn only where all that follows allows it, and only if below 1."""
    above: float = 0.0
    """Tried only in rooms with a larger floor, square metres."""
    upto: float = math.inf
    """Tried only in rooms with no larger floor, square metres."""
    when: tuple[Test, ...] = ()
    """Tried only where all of these hold."""
    unless: str | None = None
    """Tried only if the step of this name found no place."""
    name: str | None = None
    """By which a later step's `unless` refers to it."""
    times: int | Callable[[Context], int] = 1


@dataclass(frozen=True)
class Need:
    """What a room should not lack."""

    roles: tuple[str, ...]
    """Things placed under any of these roles meet it."""
    classes: tuple[str, ...] = ()
    """Object classes that meet it in a finished house; a house is drawn anew over it only where some are named."""


@dataclass(frozen=True)
class Programme:
    """How one kind of room is furnished."""

    steps: tuple[Wish, ...]
    """In the order in which they claim their place: what makes the room what it is comes first."""
    needs: tuple[Need, ...] = ()
    """Most important first: a room is tried again, in its house, while it lacks one."""
    fill: float = 0.0
    """Share of the floor that furniture should stand on."""
    fillers: tuple[Group, ...] = ()
    """What is drawn from, evenly, until `fill` is reached."""


FILLS = 8
"""Most fillers that are tried in one room."""


def carry_out(programme: Programme, ctx: Context) -> None:
    """Put the furniture of a programme into the room, and more where it would look bare."""
    found_place: dict[str, bool] = {}
    for step in programme.steps:
        if not _is_tried(step, ctx, found_place):
            continue
        for _ in range(step.times if isinstance(step.times, int) else step.times(ctx)):
            found = step.group(ctx)
            if step.name is not None:
                found_place[step.name] = bool(found)
    for _ in range(FILLS if programme.fillers else 0):
        if coverage(ctx) >= programme.fill:
            return
        programme.fillers[int(ctx.rng.integers(len(programme.fillers)))](ctx)


def _is_tried(step: Wish, ctx: Context, found_place: dict[str, bool]) -> bool:
    if not step.above < ctx.space.area <= step.upto or not all(test(ctx) for test in step.when):
        return False
    if step.unless is not None and found_place[step.unless]:
        return False
    return step.chance >= 1.0 or ctx.chance(step.chance)


def coverage(ctx: Context) -> float:
    """Share of the floor that furniture stands on."""
    standing = (t for t in ctx.things if t.parent is None and t.z < ctx.space.bottom + 0.1 and t.size[2] > 0.05)
    return sum(t.size[0] * t.size[1] for t in standing) / ctx.space.area


def shortage(needs: Sequence[Need], ctx: Context) -> int:
    """How much the room lacks of its needs, 0 for nothing; each counts more than all that follow it."""
    return sum(2 ** (len(needs) - 1 - k) for k, need in enumerate(needs) if not ctx.roles(*need.roles))


# How groups combine ------------------------------------------------------------------------------


def nothing(ctx: Context) -> None:
    """The group of no things."""


def first_of(*groups: Group) -> Group:
    """The first of the groups that finds a place."""
    return lambda ctx: any(group(ctx) for group in groups)


def each_of(*groups: Group) -> Group:
    """All of the groups, one after the other."""
    return lambda ctx: [group(ctx) for group in groups]


def either(chance: float, group: Group, other: Group) -> Group:
    """`group` with this probability, else `other`."""
    return lambda ctx: group(ctx) if ctx.chance(chance) else other(ctx)


def in_rooms_above(area: float, group: Group, other: Group = nothing) -> Group:
    """`group` where the floor is larger than `area` square metres, else `other`."""
    return lambda ctx: group(ctx) if ctx.space.area > area else other(ctx)


# What a step may depend on -----------------------------------------------------------------------


def room_is(*kinds: str) -> Test:
    """The room is of one of these kinds, which share a programme."""
    return lambda ctx: ctx.kind in kinds


def house_has(kind: str) -> Test:
    """There is a room of this kind somewhere in the house."""
    return lambda ctx: kind in ctx.kinds


def house_lacks(kind: str) -> Test:
    """There is no room of this kind in the house."""
    return lambda ctx: kind not in ctx.kinds


def has(*roles: str) -> Test:
    """Something that plays one of these roles stands in the room by now."""
    return lambda ctx: bool(ctx.roles(*roles))


def lacks(*roles: str) -> Test:
    """Nothing that plays one of these roles stands in the room so far."""
    return lambda ctx: not ctx.roles(*roles)


def wider_than(metres: float) -> Test:
    """The narrower side of the floor is longer than this."""

    def is_wider(ctx: Context) -> bool:
        x0, y0, x1, y1 = ctx.space.polygon.bounds
        return bool(min(x1 - x0, y1 - y0) > metres)

    return is_wider


def tried_before(times: int) -> Test:
    """The room has been tried at least so often without success."""
    return lambda ctx: ctx.attempt >= times


# How often a step is repeated --------------------------------------------------------------------


def between(fewest: int, most: int) -> Callable[[Context], int]:
    """A number drawn evenly from fewest..most."""
    return lambda ctx: int(ctx.rng.integers(fewest, most + 1))


def per_area(fewest: int, square_metres: float) -> Callable[[Context], int]:
    """`fewest`, and one more for every so many square metres of floor."""
    return lambda ctx: fewest + int(ctx.space.area / square_metres)
