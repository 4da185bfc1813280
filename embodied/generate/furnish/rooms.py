"""Which groups each kind of room gets, in the order in which they claim their place."""

from __future__ import annotations

from collections.abc import Callable

from embodied.generate.furnish import groups_living as living
from embodied.generate.furnish import groups_sleep as sleep
from embodied.generate.furnish import groups_wet as wet
from embodied.generate.furnish import groups_work as work
from embodied.generate.furnish.context import Context


def furnish_room(ctx: Context) -> None:
    """Put the furniture of its kind into the room, and more where it would look bare."""
    PROGRAMMES[ctx.kind](ctx)
    if ctx.kind in FILLERS:
        target, fillers = FILLERS[ctx.kind]
        for _ in range(8):
            if coverage(ctx) >= target:
                return
            fillers[int(ctx.rng.integers(len(fillers)))](ctx)


def coverage(ctx: Context) -> float:
    """Share of the floor that furniture stands on."""
    standing = (t for t in ctx.things if t.parent is None and t.z < ctx.space.bottom + 0.1 and t.size[2] > 0.05)
    return sum(t.size[0] * t.size[1] for t in standing) / ctx.space.area


def lacks(ctx: Context) -> int:
    """What is missing of the pieces that make the room what it is; each counts more than all that follow it."""
    needs = NEEDS.get(ctx.kind, ())
    return sum(2 ** (len(needs) - 1 - k) for k, roles in enumerate(needs) if not ctx.roles(*roles))


def living_room(ctx: Context) -> None:
    area = ctx.space.area
    seated = living.seating(ctx) or living.sofa_group(ctx) or living.lone_sofa(ctx) or living.conversation(ctx)
    if "dining_room" not in ctx.kinds and area > 20 and ctx.kind == "living_room":
        living.dining(ctx)
    for _ in range(1 + (area > 22) + (area > 32)):
        role = "book storage" if ctx.chance(0.55) else "living storage"
        work.bookshelf(ctx) if role == "book storage" else work.storage(ctx, role)
    if area > 18 and ctx.chance(0.75):
        living.reading_corner(ctx)
    if area > 26:
        living.sofa_group(ctx) if area > 34 else living.conversation(ctx)
    if area > 24 and ctx.chance(0.35):
        work.storage(ctx, "upright piano", clear=0.8)
    if not seated:
        living.reading_corner(ctx)
    for _ in range(1 + (area > 18) + (area > 30)):
        work.corner_plant(ctx)
    if ctx.roles("fireplace"):
        work.beside(ctx, "firewood", ("fireplace",))
    if ctx.chance(0.3):
        work.corner_thing(ctx, "bean bag")
    if ctx.chance(0.25):
        work.corner_thing(ctx, "floor vase")
    if ctx.chance(0.12):
        work.corner_thing(ctx, "pet", most=(0.5, 1.0, 0.9))
    if ctx.chance(0.35):
        work.beside(ctx, "basket", ("sofa", "fireplace", "armchair"), most=(0.6, 0.6, 0.7))
    if area > 30 and ctx.chance(0.3):
        work.in_the_open(ctx, "grand piano")


def dining_room(ctx: Context) -> None:
    living.dining(ctx)
    for _ in range(1 + (ctx.space.area > 14)):
        work.storage(ctx, "display storage")
    if ctx.space.area > 15 and ctx.chance(0.4):
        work.storage(ctx, "cupboard")
    work.corner_plant(ctx)
    if ctx.space.area > 13:
        work.corner_plant(ctx)
    if ctx.space.area > 18 and ctx.chance(0.4):
        living.reading_corner(ctx)


def kitchen(ctx: Context) -> None:
    area = ctx.space.area
    first = ctx.attempt in (1, 2, 4)
    if first:
        wet.lone_fridge(ctx)
    wet.kitchen_line(ctx, fridge=not first)
    if not ctx.roles("fridge"):
        wet.lone_fridge(ctx)
    if area > 13 and ctx.chance(0.6):
        wet.island(ctx)
    if area > 5.5 and (area > 11 or "dining_room" not in ctx.kinds or ctx.chance(0.6)):
        most = 1.9 if area > 14 else 1.3 if area > 8.5 else 0.85
        living.dining(ctx, "small table" if area < 14 else "dining table", "kitchen chair", most)
    if area > 11 and ctx.chance(0.4):
        work.storage(ctx, "cupboard")
    work.corner_thing(ctx, "kitchen bin", most=(0.5, 0.5, 0.9)) or work.corner_thing(
        ctx, "kitchen bin", most=(0.35, 0.35, 0.7)
    )
    if ctx.chance(0.4):
        work.corner_thing(ctx, "high chair" if "kids_room" in ctx.kinds else "plant", most=(0.7, 0.7, 1.3))
    if ctx.chance(0.3):
        work.corner_thing(ctx, "broom")
    if ctx.chance(0.3):
        work.corner_plant(ctx)


def bedroom(ctx: Context) -> None:
    area = ctx.space.area
    if ctx.attempt >= 2:
        sleep.wardrobe(ctx)
    if ctx.kind == "main_bedroom" or (area > 10.5 and ctx.chance(0.6)):
        sleep.double_bed(ctx) or sleep.single_bed(ctx)
    elif ctx.kind == "guest_room" and ctx.chance(0.35):
        sleep.single_bed(ctx, "sofa to sleep on") or sleep.single_bed(ctx)
    else:
        sleep.single_bed(ctx) or sleep.double_bed(ctx)
    if not ctx.roles("bed"):
        sleep.single_bed(ctx, "child bed")
    if not ctx.roles("wardrobe") and not (
        not ctx.attempt and "closet" in ctx.kinds and ctx.kind == "main_bedroom" and ctx.chance(0.5)
    ):
        sleep.wardrobe(ctx)
    if area > 17 and ctx.chance(0.5):
        sleep.wardrobe(ctx)
    if ctx.kind != "main_bedroom" and area > 9 and ctx.chance(0.75):
        work.desk(ctx)
    sleep.dresser(ctx)
    if area > 12:
        sleep.bedroom_chair(ctx) if ctx.chance(0.7) else living.reading_corner(ctx)
    if area > 14 and ctx.chance(0.3):
        work.desk(ctx)
    if ctx.chance(0.35):
        work.bookshelf(ctx)
    if area > 18 and ctx.chance(0.6):
        living.conversation(ctx)
    if ctx.chance(0.75):
        work.corner_plant(ctx)
    if ctx.roles("desk"):
        work.beside(ctx, "bin", ("desk",), most=(0.35, 0.35, 0.45))
    if ctx.chance(0.3):
        work.corner_thing(ctx, "laundry basket")
    if ctx.chance(0.5):
        work.beside(ctx, "slippers", ("bed",))
    if area > 16 and ctx.chance(0.15):
        work.storage(ctx, "folding screen", clear=0.0)
    if ctx.kind == "guest_room" and ctx.chance(0.5):
        work.corner_thing(ctx, "suitcase")
    if ctx.kind == "bedroom" and ctx.chance(0.2):
        work.corner_thing(ctx, "electric guitar")
    if area > 16 and ctx.chance(0.4):
        work.storage(ctx, "trunk", clear=0.4)


def kids_room(ctx: Context) -> None:
    area = ctx.space.area
    sleep.single_bed(ctx, "kid bed") or sleep.single_bed(ctx)
    if area > 12 and ctx.chance(0.25):
        sleep.cot(ctx)
        work.storage(ctx, "changing table")
    work.desk(ctx) if ctx.chance(0.7) else sleep.child_table(ctx)
    sleep.wardrobe(ctx) if ctx.chance(0.7) else sleep.dresser(ctx)
    if ctx.chance(0.8):
        work.storage(ctx, "shelving unit", where=lambda a: "child" in a.tags or a.size[2] < 1.9)
    sleep.toys(ctx)
    if area > 11:
        sleep.child_table(ctx)
    if ctx.chance(0.5):
        work.corner_thing(ctx, "bean bag", most=(1.0, 1.0, 0.9))
    if ctx.chance(0.6):
        work.in_the_open(ctx, "big toy", clear=0.0, group="toy")
    if ctx.chance(0.4):
        work.corner_thing(ctx, "backpack")
    work.beside(ctx, "bin", ("desk",), most=(0.35, 0.35, 0.45))
    if ctx.chance(0.35):
        work.corner_plant(ctx)


def bathroom(ctx: Context) -> None:
    area = ctx.space.area
    first = "bathtub" if area > 4.6 and ctx.chance(0.7 - 0.25 * ctx.attempt) else "shower"
    vanity = "double vanity" if area > 9 and ctx.chance(0.5) else "wash place" if ctx.attempt < 2 else "small basin"
    done = None
    if ctx.attempt < 2:
        done = wet.bathing(ctx, first) or wet.bathing(ctx, "shower") or wet.bathing(ctx, "bathtub")
    wet.toilet(ctx)
    wet.basin(ctx, vanity)
    done = done or wet.bathing(ctx, first) or wet.bathing(ctx, "shower") or wet.bathing(ctx, "bathtub")
    if done and area > 6.5 and first == "bathtub":
        wet.bathing(ctx, "shower")
    if area > 5.5 and ctx.chance(0.3):
        work.storage(ctx, "bidet", clear=0.45)
    if area > 5 and "laundry_room" not in ctx.kinds and ctx.chance(0.7):
        work.machines(ctx)
    work.corner_thing(ctx, "laundry basket", most=(0.6, 0.6, 0.8))
    if ctx.chance(0.6):
        work.beside(ctx, "bin", ("basin", "toilet"), most=(0.32, 0.32, 0.4))
    if ctx.chance(0.4) and area > 6:
        work.corner_plant(ctx)
    if ctx.chance(0.25):
        work.corner_thing(ctx, "stool", most=(0.45, 0.45, 0.6))


def toilet_room(ctx: Context) -> None:
    wet.toilet(ctx)
    wet.basin(ctx, "wall washbasin")
    if ctx.chance(0.5):
        work.beside(ctx, "bin", ("toilet", "basin"), most=(0.3, 0.3, 0.4))


def hall(ctx: Context) -> None:
    work.doormat(ctx)
    area = ctx.space.area
    if ctx.chance(0.85):
        work.console(ctx)
    if ctx.chance(0.8):
        work.hall_bench(ctx)
    if area > 7 and ctx.chance(0.6):
        work.storage(ctx, "wardrobe" if ctx.chance(0.5) else "cupboard", most=(1.3, 0.65, 2.4))
    if ctx.chance(0.6):
        work.corner_thing(ctx, "umbrella stand")
    for _ in range(int(ctx.rng.integers(0, 3))):
        work.beside(ctx, "shoes", ("bench", "console", "doormat"))
    if area > 5 and ctx.chance(0.6):
        work.corner_plant(ctx)
    if area > 9:
        work.middle_rug(ctx)
        if ctx.chance(0.5):
            living.conversation(ctx)
    elif ctx.chance(0.4):
        work.runner(ctx)
    if "kids_room" in ctx.kinds and ctx.chance(0.25):
        work.corner_thing(ctx, "kick scooter" if ctx.chance(0.5) else "stroller")


def corridor(ctx: Context) -> None:
    if ctx.chance(0.75):
        work.runner(ctx)
    x0, y0, x1, y1 = ctx.space.polygon.bounds
    if min(x1 - x0, y1 - y0) > 1.25 and ctx.chance(0.8):
        work.console(ctx)
    if ctx.chance(0.5):
        work.corner_thing(ctx, "floor decoration", most=(0.5, 0.5, 1.3))


def study(ctx: Context) -> None:
    area = ctx.space.area
    work.desk(ctx)
    for _ in range(1 + (area > 8) + (area > 12)):
        work.bookshelf(ctx)
    work.storage(ctx, "office storage", most=(3.1, 0.7, 2.2))
    if area > 9 and ctx.chance(0.5):
        work.corner_thing(ctx, "side chair", most=(0.7, 0.7, 1.2))
    if area > 8:
        living.reading_corner(ctx)
    if area > 10 and ctx.chance(0.4):
        work.in_the_open(ctx, "drafting table")
    work.beside(ctx, "bin", ("desk",), most=(0.35, 0.35, 0.45))
    work.corner_plant(ctx)
    if ctx.chance(0.6):
        work.middle_rug(ctx)
    if ctx.chance(0.3):
        work.corner_thing(ctx, "safe", most=(0.6, 0.6, 0.7))
    if ctx.chance(0.3):
        work.beside(ctx, "briefcase", ("desk",))


def laundry_room(ctx: Context) -> None:
    work.machines(ctx)
    work.storage(ctx, "rough storage", clear=0.5)
    if ctx.space.area > 4.5:
        wet.basin(ctx, "small basin")
        work.storage(ctx, "tall cabinet" if ctx.chance(0.5) else "cupboard", clear=0.5)
    if ctx.space.area > 5:
        work.in_the_open(ctx, "clothes horse", clear=0.0)
    work.corner_thing(ctx, "laundry basket", most=(0.6, 0.6, 0.8))
    if ctx.chance(0.7):
        work.in_the_open(ctx, "ironing board", clear=0.0)
    if ctx.chance(0.7):
        work.corner_thing(ctx, "broom")
    if ctx.chance(0.5):
        work.corner_thing(ctx, "basin", most=(0.8, 0.7, 0.4))
    if ctx.chance(0.5):
        work.corner_thing(ctx, "step ladder", where=lambda a: a.size[2] < 1.2)
    if ctx.chance(0.4):
        work.corner_thing(ctx, "dustpan")


def pantry(ctx: Context) -> None:
    for _ in range(2 + (ctx.space.area > 2.5)):
        work.storage(ctx, "shelving unit", clear=0.45, avoid=())
    if ctx.chance(0.5):
        work.storage(ctx, "chest freezer", clear=0.5)
    for _ in range(int(ctx.rng.integers(1, 4))):
        work.corner_thing(ctx, "box", most=(0.62, 0.62, 0.7))
    if ctx.chance(0.5):
        work.corner_thing(ctx, "shopping trolley")
    if ctx.chance(0.5):
        work.corner_thing(ctx, "broom")


def closet(ctx: Context) -> None:
    for _ in range(3 + int(ctx.space.area > 4) + int(ctx.space.area > 6)):
        sleep.clothes(ctx)
    if ctx.space.area > 4 and ctx.chance(0.6):
        work.in_the_open(ctx, "bench", clear=0.3)
    for _ in range(int(ctx.rng.integers(2, 5))):
        work.corner_thing(ctx, "shoes")
    if ctx.chance(0.6):
        work.corner_thing(ctx, "suitcase")
    if ctx.chance(0.4):
        work.corner_thing(ctx, "laundry basket")
    if ctx.chance(0.5):
        work.middle_rug(ctx)


def library(ctx: Context) -> None:
    area = ctx.space.area
    if area > 16 and ctx.chance(0.6):
        living.seating(ctx)
    else:
        living.conversation(ctx, "reading chair")
    for _ in range(3 + int(area / 5)):
        work.bookshelf(ctx)
    if area > 12:
        work.desk(ctx)
    living.reading_corner(ctx)
    work.corner_plant(ctx)
    if not ctx.roles("rug"):
        work.middle_rug(ctx)
    if ctx.chance(0.3):
        work.storage(ctx, "chest", clear=0.4)


def playroom(ctx: Context) -> None:
    if ctx.space.area > 15 and ctx.chance(0.7):
        work.in_the_open(ctx, "game table")
    else:
        work.in_the_open(ctx, "foosball table")
    sleep.toys(ctx)
    sleep.child_table(ctx)
    for _ in range(2):
        work.storage(ctx, "shelving unit", clear=0.5, where=lambda a: a.size[2] < 1.95)
    work.in_the_open(ctx, "big toy", clear=0.0, group="toy")
    if ctx.chance(0.5):
        work.in_the_open(ctx, "pinball machine")
    for _ in range(2):
        work.corner_thing(ctx, "bean bag")
    if ctx.chance(0.5):
        sleep.toys(ctx)
    if ctx.chance(0.6):
        work.storage(ctx, "whiteboard", clear=0.4)
    work.corner_plant(ctx)
    if ctx.space.area > 13:
        living.conversation(ctx)


def gym(ctx: Context) -> None:
    for role in ("treadmill", "exercise bike", "abdominal bench", "punching bag"):
        work.in_the_open(ctx, role, clear=0.3)
    if ctx.space.area > 16:
        work.in_the_open(ctx, "multi-gym", clear=0.5)
    work.storage(ctx, "bench", clear=0.4, most=(1.5, 0.6, 0.6))
    if ctx.chance(0.6):
        work.storage(ctx, "locker" if ctx.chance(0.5) else "shelving unit", clear=0.4)
    if ctx.chance(0.6):
        work.storage(ctx, "water cooler", clear=0.4)
    for role in ("sneakers", "basketball", "laundry basket"):
        if ctx.chance(0.6):
            work.corner_thing(ctx, role)
    work.corner_plant(ctx)


def garage(ctx: Context) -> None:
    work.workbench(ctx)
    for _ in range(2 + (ctx.space.area > 18)):
        work.storage(ctx, "rough storage", clear=0.5, avoid=())
    for _ in range(1 + (ctx.space.area > 16)):
        work.in_the_open(ctx, "bicycle", clear=0.2)
    if ctx.chance(0.6):
        work.in_the_open(ctx, "lawn mower", clear=0.0)
    for role in (
        "step ladder",
        "kitchen bin",
        "wheelbarrow",
        "chest freezer",
        "kick scooter",
        "tricycle",
        "fire extinguisher",
        "broom",
        "shovel",
        "traffic cone",
        "furnace",
    ):
        if ctx.chance(0.5):
            work.corner_thing(ctx, role, most=(1.7, 1.2, 2.2))
    for _ in range(int(ctx.rng.integers(2, 6))):
        work.corner_thing(ctx, "box", avoid=())
    if ctx.chance(0.4):
        work.corner_thing(ctx, "barrel")


def workshop(ctx: Context) -> None:
    work.workbench(ctx)
    if ctx.space.area > 11 and ctx.chance(0.5):
        work.workbench(ctx)
    for _ in range(2 + (ctx.space.area > 12)):
        work.storage(ctx, "rough storage", clear=0.5, avoid=())
    if ctx.chance(0.5):
        work.in_the_open(ctx, "drafting table")
    work.storage(ctx, "folding table", clear=0.5)
    for role in ("step ladder", "stool", "fire extinguisher", "broom", "kitchen bin", "shovel", "barrel"):
        if ctx.chance(0.6):
            work.corner_thing(ctx, role, most=(1.0, 1.0, 2.2))
    for _ in range(int(ctx.rng.integers(2, 5))):
        work.corner_thing(ctx, "box", avoid=())


def sun_room(ctx: Context) -> None:
    living.low_table_seat(ctx) or living.conversation(ctx, "sun seat")
    if ctx.space.area > 12:
        if ctx.chance(0.6):
            living.dining(ctx, "bistro table", "bistro chair", 1.0)
        living.reading_corner(ctx)
    for _ in range(3 + int(ctx.space.area / 5)):
        work.corner_plant(ctx)
    if ctx.chance(0.4):
        work.in_the_open(ctx, "sun lounger", clear=0.0)
    work.middle_rug(ctx)


def stairwell(ctx: Context) -> None:
    if ctx.chance(0.6):
        work.corner_plant(ctx)
    if ctx.chance(0.4):
        work.console(ctx)


NEEDS: dict[str, tuple[tuple[str, ...], ...]] = {
    "kitchen": (("kitchen sink",), ("cooker",), ("fridge",), ("counter",)),
    "bathroom": (("toilet",), ("basin",), ("bathtub", "corner bathtub", "shower")),
    "toilet": (("toilet",), ("basin",)),
    "main_bedroom": (("bed",), ("wardrobe",)),
    "bedroom": (("bed",), ("wardrobe",)),
    "guest_room": (("bed",),),
    "kids_room": (("bed",),),
    "living_room": (("sofa",),),
    "family_room": (("sofa",),),
    "dining_room": (("dining table",),),
    "study": (("desk",),),
    "laundry_room": (("washing machine",),),
}
"""Room kind to the roles it should not lack, most important first; any one of a tuple will do.

This orders the attempts at one room; generate/lacking.py says over which of them a finished house is drawn anew.
"""


def _piece(role: str, **limits) -> Callable[[Context], object]:
    """A filler that puts one piece of storage at a wall."""
    return lambda ctx: work.storage(ctx, role, **limits)


def _corner(role: str, **limits) -> Callable[[Context], object]:
    """A filler that puts one thing in a corner or at a wall."""
    return lambda ctx: work.corner_thing(ctx, role, **limits)


def _table_for_two(ctx: Context) -> object:
    """A small table with its chairs, where the kitchen has none yet."""
    return (
        None if ctx.roles("dining table", "dining chair") else living.dining(ctx, "small table", "kitchen chair", 1.15)
    )


SITTING = (
    living.conversation,
    living.reading_corner,
    work.bookshelf,
    _piece("living storage"),
    work.corner_plant,
    _piece("display storage"),
    work.console,
    work.corner_plant,
    living.sofa_group,
    _corner("floor vase"),
)
RESTING = (
    sleep.dresser,
    sleep.bedroom_chair,
    work.corner_plant,
    work.bookshelf,
    living.reading_corner,
    sleep.wardrobe,
    work.desk,
    _piece("bench", clear=0.3),
    _corner("basket", most=(0.6, 0.6, 0.7)),
)
ROUGH = (
    _piece("rough storage", clear=0.5, avoid=()),
    _corner("box", avoid=()),
    _corner("box", avoid=()),
    _piece("shelving unit", clear=0.5, avoid=()),
    _corner("step ladder"),
    _corner("trash can"),
)
FILLERS: dict[str, tuple[float, tuple[Callable[[Context], object], ...]]] = {
    "living_room": (0.26, SITTING),
    "family_room": (0.26, SITTING),
    "library": (0.26, SITTING),
    "sun_room": (0.24, SITTING),
    "dining_room": (
        0.26,
        (
            _piece("display storage"),
            work.corner_plant,
            living.reading_corner,
            work.console,
            work.corner_plant,
            _piece("cupboard"),
            work.bookshelf,
        ),
    ),
    "kitchen": (
        0.27,
        (
            _piece("cupboard", clear=0.5),
            work.corner_plant,
            _table_for_two,
            _piece("shelving unit", clear=0.4),
            _corner("basket", most=(0.5, 0.5, 0.6)),
            _piece("display storage", clear=0.5),
            work.corner_plant,
        ),
    ),
    "main_bedroom": (0.34, RESTING),
    "bedroom": (0.36, RESTING),
    "guest_room": (0.34, RESTING),
    "kids_room": (
        0.34,
        (
            sleep.toys,
            sleep.child_table,
            work.bookshelf,
            _corner("big toy"),
            _piece("shelving unit", clear=0.4),
            _corner("bean bag"),
            sleep.dresser,
        ),
    ),
    "study": (0.3, (work.bookshelf, work.corner_plant, living.reading_corner, _piece("office storage"), work.console)),
    "hall": (0.14, (work.console, work.corner_plant, work.hall_bench, _piece("cupboard"), living.reading_corner)),
    "playroom": (
        0.26,
        (
            sleep.toys,
            _corner("bean bag"),
            _piece("shelving unit", clear=0.4),
            _corner("big toy"),
            living.reading_corner,
            sleep.child_table,
        ),
    ),
    "gym": (
        0.26,
        (_piece("bench", clear=0.3), work.corner_plant, _piece("shelving unit", clear=0.4), _corner("basketball")),
    ),
    "garage": (0.24, ROUGH),
    "workshop": (0.28, ROUGH),
    "pantry": (
        0.36,
        (
            _piece("shelving unit", clear=0.4, avoid=()),
            _corner("box", avoid=()),
            _piece("cupboard", clear=0.4),
            _corner("basket", most=(0.6, 0.6, 0.7)),
        ),
    ),
    "closet": (
        0.36,
        (sleep.clothes, sleep.clothes, _corner("shoes"), _corner("box", most=(0.6, 0.6, 0.5)), _corner("basket")),
    ),
    "laundry_room": (
        0.34,
        (_piece("rough storage", clear=0.4), _corner("laundry basket"), _corner("box"), _piece("cupboard", clear=0.4)),
    ),
}
"""Room kind to the share of floor that should be stood on, and what fills it up."""

PROGRAMMES: dict[str, Callable[[Context], None]] = {
    "living_room": living_room,
    "family_room": living_room,
    "dining_room": dining_room,
    "kitchen": kitchen,
    "main_bedroom": bedroom,
    "bedroom": bedroom,
    "guest_room": bedroom,
    "kids_room": kids_room,
    "bathroom": bathroom,
    "toilet": toilet_room,
    "hall": hall,
    "corridor": corridor,
    "study": study,
    "laundry_room": laundry_room,
    "pantry": pantry,
    "closet": closet,
    "library": library,
    "playroom": playroom,
    "gym": gym,
    "garage": garage,
    "workshop": workshop,
    "sun_room": sun_room,
    "stairwell": stairwell,
}
