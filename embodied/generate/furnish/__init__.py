"""Furnishing: a House with rooms and openings becomes one with objects and lights.

Room by room: groups of furniture claim their place in order of importance (rooms.py, the table of
what each kind of room gets), then what a user's own classes add (own.py), then what hangs on ceilings and walls
(ceilings.py, hanging.py, pictures.py), then small things on surfaces (smalls.py), then what the household leaves about
(traces.py), then lights.
docs/houses.md tells more.
"""

from __future__ import annotations

import dataclasses
from collections import Counter

from assets.catalogue import Catalogue
from embodied.generate.furnish.arrange import Thing
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.hanging import hang_all
from embodied.generate.furnish.lights import lights
from embodied.generate.furnish.own import place_own
from embodied.generate.furnish.rooms import furnish_room, missing
from embodied.generate.furnish.smalls import clutter
from embodied.generate.furnish.space import room_space
from embodied.generate.furnish.stock import Stock
from embodied.generate.furnish.style import house_style
from embodied.generate.furnish.traces import leave_traces
from embodied.generate.household import Household, household_of
from embodied.geometry import wrap
from embodied.house.house import House, Placement, Room, rounded
from embodied.seeds import stream

ATTEMPTS = 6


def furnish(draft: House, catalogue: Catalogue, *, seed: int) -> House:
    """Put furniture, wall things, small things and lights into every room.

    Args:
      draft: a house whose rooms, openings and stairs are settled; placements and lights it
        already has are replaced.
      catalogue: only its records are used, never a mesh.
      seed: the same seed gives the same furniture.
    """
    style = house_style(draft.style, draft.disorder, rng=stream(seed, "furnish", "style"))
    stock = Stock(catalogue, style)
    kinds, household = tuple(r.kind for r in draft.rooms), household_of(draft)
    rooms: list[Context] = []
    for room in draft.rooms:
        ctx = _arranged(draft, room, stock, kinds, household, seed)
        drawn, ctx.rng = ctx.rng, stream(seed, "furnish", room.id, "own")  # others draw what they drew without
        place_own(ctx)
        ctx.rng = drawn
        hang_all(ctx)
        clutter(ctx)
        rooms.append(ctx)
    for ctx in rooms:
        ctx.rng = stream(seed, "furnish", ctx.space.room.id, "traces")
        leave_traces(ctx)
    placements = _placements([(ctx.space.room.id, ctx.things) for ctx in rooms])
    shining = lights(placements, style, rng=stream(seed, "furnish", "lights"))
    return dataclasses.replace(draft, placements=placements, lights=shining)


def _arranged(
    draft: House, room: Room, stock: Stock, kinds: tuple[str, ...], household: Household, seed: int
) -> Context:
    """The room with its furniture: the first of a few attempts that lacks nothing, or the best of them."""
    best: tuple[int, Context, Counter[str]] | None = None
    before = stock.used.copy()
    for attempt in range(ATTEMPTS):
        stock.used = before.copy()
        ctx = Context(
            space=room_space(draft, room),
            stock=stock,
            rng=stream(seed, "furnish", room.id, attempt),
            kinds=kinds,
            household=household,
            attempt=attempt,
        )
        furnish_room(ctx)
        short = missing(ctx)
        if best is None or short < best[0]:
            best = short, ctx, stock.used
        if not short:
            break
    assert best is not None  # ATTEMPTS is positive
    stock.used = best[2]
    return best[1]


def _placements(rooms: list[tuple[str, list[Thing]]]) -> tuple[Placement, ...]:
    """Things with ids, in the order in which they were placed."""
    numbers: Counter[str] = Counter()
    ids: dict[int, str] = {}
    placements = []
    for room, things in rooms:
        for t in things:
            name = t.asset.object_class.replace(" ", "_")
            numbers[name] += 1
            ids[id(t)] = f"{name}_{numbers[name]}"
            placements.append(
                Placement(
                    id=ids[id(t)],
                    asset=t.asset.key,
                    object_class=t.asset.object_class,
                    room=room,
                    position=rounded((t.x, t.y, t.z)),
                    yaw=rounded(float(wrap(t.yaw))),
                    size=rounded(t.size),
                    parent=ids[id(t.parent)] if t.parent is not None else None,
                    surface=t.surface,
                    params=tuple(sorted(t.params)),
                    group=f"{room}/{t.group}" if t.group else None,
                )
            )
    return tuple(placements)
