"""Furnishing: a House with rooms and openings becomes one with objects and lights.

Room by room: groups of furniture claim their place in order of importance (rooms.toml and groups.toml), then what a
user's own classes add (room.py), then what hangs on ceilings and walls (hanging.py), then
small things on all of it (smalls.toml), then lights. docs/houses.md tells more.
"""

import dataclasses
from collections import Counter
from collections.abc import Sequence

import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.generate.config import RETRIES
from embodied.generate.furnish.context import Context, Stock
from embodied.generate.furnish.hanging import hang_all
from embodied.generate.furnish.room import furnish_room, place_own, shortage
from embodied.generate.furnish.smalls import clutter
from embodied.generate.furnish.space import RoomSpace, Thing, room_space
from embodied.generate.furnish.tables import tables_of
from embodied.geometry import wrap
from embodied.house.house import House, Light, Placement, Room, rounded
from embodied.house.household import household_of
from embodied.seeds import stream


def furnish(draft: House, catalogue: Catalogue, *, seed: int) -> House:
    """Put furniture, wall things, small things and lights into every room.

    Args:
      draft: a house whose rooms, openings and stairs are settled; placements and lights it
        already has are replaced.
      catalogue: only its records are used, never a mesh.
      seed: the same seed gives the same furniture.

    Raises:
      RecordError: a table of groups beside a user's own models is none.
    """
    known = tables_of(catalogue)
    style = known.style(draft.style, draft.disorder, rng=stream(seed, "furnish", "style"))
    stock = Stock(catalogue, style, known)
    used: Counter[str] = Counter()
    furnished: list[RoomSpace] = []
    for room in draft.rooms:
        ctx = _arranged(draft, room, stock, used, seed)
        own = dataclasses.replace(ctx, rng=stream(seed, "furnish", room.id, "own"))
        place_own(own)
        ctx = dataclasses.replace(own, rng=ctx.rng)  # the rest is drawn as without own classes
        hang_all(ctx)
        clutter(ctx)
        furnished.append(ctx.space)
        used = ctx.used
    placements = _placements(furnished)
    shining = lights(placements, stock, rng=stream(seed, "furnish", "lights"))
    return dataclasses.replace(draft, placements=placements, lights=shining)


def _arranged(draft: House, room: Room, stock: Stock, used: Counter[str], seed: int) -> Context:
    """The room with its furniture: the first of a few attempts that lacks nothing, or the best of them."""
    empty, best = room_space(draft, room), None
    for attempt in range(RETRIES.room):
        ctx = Context(
            space=empty,
            stock=stock,
            rng=stream(seed, "furnish", room.id, attempt),
            kinds=tuple(r.kind for r in draft.rooms),
            household=household_of(draft),
            attempt=attempt,
            used=used.copy(),
        )
        furnish_room(ctx)
        short = shortage(ctx)
        if best is None or short < best[0]:
            best = short, ctx
        if not short:
            break
    assert best is not None  # RETRIES.room is positive
    return best[1]


def _placements(rooms: list[RoomSpace]) -> tuple[Placement, ...]:
    """Things with ids, in the order in which they were placed."""
    numbers: Counter[str] = Counter()
    ids: dict[Thing, str] = {}
    placements = []
    for space in rooms:
        room = space.room.id
        for t in space.things:
            name = t.asset.object_class.replace(" ", "_")
            numbers[name] += 1
            ids[t] = f"{name}_{numbers[name]}"
            placements.append(
                Placement(
                    id=ids[t],
                    asset=t.asset.key,
                    object_class=t.asset.object_class,
                    room=room,
                    position=rounded((t.x, t.y, t.z)),
                    yaw=rounded(float(wrap(t.yaw))),
                    size=rounded(t.size),
                    parent=ids[t.parent] if t.parent is not None else None,
                    surface=t.surface,
                    params=tuple(sorted(t.params)),
                    group=f"{room}/{t.group}" if t.group else None,
                )
            )
    return tuple(placements)


WARM, NEUTRAL = (1.0, 0.72, 0.44), (1.0, 0.9, 0.78)
"""Linear colours of about 2700 K and 4000 K."""


def lights(placements: Sequence[Placement], stock: Stock, *, rng: np.random.Generator) -> tuple[Light, ...]:
    """One light per lamp, at its bulb; some table lamps are off."""
    shining: list[Light] = []
    share = 0.35 * (1 - stock.style.warmth)
    red, green, blue = (round((1 - share) * w + share * n, 3) for w, n in zip(WARM, NEUTRAL))
    for p in placements:
        lumens = stock.tables.lumens.get(p.object_class)
        if lumens is None:
            continue
        x, y, z = p.position
        main = p.object_class in stock.tables.alike["main lamps"]
        hanging = main or p.object_class == "ceiling fan"
        bulb = z + (0.35 * p.size[2] if hanging else 0.78 * p.size[2])
        cool = p.object_class == "fluorescent lamp"
        on = True if main else bool(rng.random() < 0.7)
        scale = min(max(p.size[0] / 0.5, 0.6), 1.6) if hanging else 1.0
        shining.append(
            Light(
                id=f"light_{len(shining) + 1}",
                room=p.room,
                placement=p.id,
                position=rounded((x, y, bulb)),
                color=NEUTRAL if cool else (red, green, blue),
                power=round(lumens * scale, 0),
                on=on,
            )
        )
    return tuple(shining)
