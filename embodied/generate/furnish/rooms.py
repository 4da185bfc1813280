"""The table of rooms: which groups of furniture each kind gets, and in which order they claim their place.

To add a kind of room, add an entry to PROGRAMMES; docs/houses.md says what else it wants.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Unpack

from embodied.generate.furnish import groups_kitchen as kitchen
from embodied.generate.furnish import groups_living as living
from embodied.generate.furnish import groups_sleep as sleep
from embodied.generate.furnish import groups_wet as wet
from embodied.generate.furnish import groups_work as work
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.programme import (
    Group,
    Need,
    Programme,
    Step,
    between,
    carry_out,
    each_of,
    either,
    first_of,
    has,
    house_has,
    house_lacks,
    in_rooms_above,
    lacks,
    per_area,
    room_is,
    shortage,
    tried_before,
    wider_than,
)
from embodied.generate.furnish.stock import Limits

BEDS = ("bed", "child bed", "bunk bed", "loft bed", "day bed", "sofa bed", "crib", "cradle")
"""Object classes that one can sleep in."""


def furnish_room(ctx: Context) -> None:
    """Put the furniture of its kind into the room."""
    carry_out(PROGRAMMES[ctx.kind], ctx)


def missing(ctx: Context) -> int:
    """How much the room lacks of what makes it what it is, 0 for nothing."""
    return shortage(PROGRAMMES[ctx.kind].needs, ctx)


# Single pieces, by role --------------------------------------------------------------------------


def piece(role: str, clear: float = 0.6, **limits: Unpack[Limits]) -> Group:
    """One piece of storage or a machine at a wall, with `clear` metres free before it."""
    return lambda ctx: work.storage(ctx, role, clear=clear, **limits)


def corner(role: str, **limits: Unpack[Limits]) -> Group:
    """One thing in a corner or at a wall."""
    return lambda ctx: work.corner_thing(ctx, role, **limits)


def beside(role: str, *anchors: str, **limits: Unpack[Limits]) -> Group:
    """One thing on the floor close to something of the roles `anchors`."""
    return lambda ctx: work.beside(ctx, role, anchors, **limits)


def open_floor(role: str, clear: float = 0.5, group: str = "machine") -> Group:
    """One machine, toy or game table that stands free or at a wall."""
    return lambda ctx: work.in_the_open(ctx, role, clear=clear, group=group)


def table(role: str, chairs: str, longest: float) -> Group:
    """A table of at most `longest` metres with its chairs."""
    return lambda ctx: living.dining(ctx, role, chairs, longest)


def two_chairs(role: str) -> Group:
    """Two chairs of this role turned to one another over a small table."""
    return lambda ctx: living.conversation(ctx, role)


def narrow_bed(role: str) -> Group:
    """A narrow bed of this role."""
    return lambda ctx: sleep.single_bed(ctx, role)


def basin(role: str) -> Group:
    """A basin of this role."""
    return lambda ctx: wet.basin(ctx, role)


# Living ------------------------------------------------------------------------------------------

SHELVES = either(0.55, work.bookshelf, piece("living storage"))
SITTING = (
    living.conversation,
    living.reading_corner,
    work.bookshelf,
    piece("living storage"),
    work.corner_plant,
    piece("display storage"),
    work.console,
    work.corner_plant,
    living.sofa_group,
    corner("floor vase"),
)
LIVING = (
    Step(first_of(living.seating, living.sofa_group, living.lone_sofa, living.conversation), name="seats"),
    Step(living.dining, above=20, when=(house_lacks("dining_room"), room_is("living_room"))),
    Step(SHELVES),
    Step(SHELVES, above=22),
    Step(SHELVES, above=32),
    Step(living.reading_corner, 0.75, above=18),
    Step(living.conversation, above=26, upto=34),
    Step(living.sofa_group, above=34),
    Step(piece("upright piano", clear=0.8), 0.35, above=24),
    Step(living.reading_corner, unless="seats"),
    Step(work.corner_plant),
    Step(work.corner_plant, above=18),
    Step(work.corner_plant, above=30),
    Step(beside("firewood", "fireplace"), when=(has("fireplace"),)),
    Step(corner("bean bag"), 0.3),
    Step(corner("floor vase"), 0.25),
    Step(corner("pet", most=(0.5, 1.0, 0.9)), 0.12),
    Step(beside("basket", "sofa", "fireplace", "armchair", most=(0.6, 0.6, 0.7)), 0.35),
    Step(open_floor("grand piano"), 0.3, above=30),
)
LIVING_ROOM = Programme(
    LIVING,
    needs=(Need(("sofa",), ("sofa", "sofa bed", "corner sofa", "armchair", "lounge chair")),),
    fill=0.26,
    fillers=SITTING,
)
FAMILY_ROOM = Programme(LIVING, needs=(Need(("sofa",)),), fill=0.26, fillers=SITTING)
DINING_ROOM = Programme(
    (
        Step(living.dining),
        Step(piece("display storage")),
        Step(piece("display storage"), above=14),
        Step(piece("cupboard"), 0.4, above=15),
        Step(work.corner_plant),
        Step(work.corner_plant, above=13),
        Step(living.reading_corner, 0.4, above=18),
    ),
    needs=(Need(("dining table",)),),
    fill=0.26,
    fillers=(
        piece("display storage"),
        work.corner_plant,
        living.reading_corner,
        work.console,
        work.corner_plant,
        piece("cupboard"),
        work.bookshelf,
    ),
)
LIBRARY = Programme(
    (
        Step(either(0.6, living.seating, two_chairs("reading chair")), above=16),
        Step(two_chairs("reading chair"), upto=16),
        Step(work.bookshelf, times=per_area(3, 5)),
        Step(work.desk, above=12),
        Step(living.reading_corner),
        Step(work.corner_plant),
        Step(work.middle_rug, when=(lacks("rug"),)),
        Step(piece("chest", clear=0.4), 0.3),
    ),
    fill=0.26,
    fillers=SITTING,
)
SUN_ROOM = Programme(
    (
        Step(first_of(living.low_table_seat, two_chairs("sun seat"))),
        Step(table("bistro table", "bistro chair", 1.0), 0.6, above=12),
        Step(living.reading_corner, above=12),
        Step(work.corner_plant, times=per_area(3, 5)),
        Step(open_floor("sun lounger", clear=0.0), 0.4),
        Step(work.middle_rug),
    ),
    fill=0.24,
    fillers=SITTING,
)
STUDY = Programme(
    (
        Step(work.desk),
        Step(work.bookshelf),
        Step(work.bookshelf, above=8),
        Step(work.bookshelf, above=12),
        Step(piece("office storage", most=(3.1, 0.7, 2.2))),
        Step(corner("side chair", most=(0.7, 0.7, 1.2)), 0.5, above=9),
        Step(living.reading_corner, above=8),
        Step(open_floor("drafting table"), 0.4, above=10),
        Step(beside("bin", "desk", most=(0.35, 0.35, 0.45))),
        Step(work.corner_plant),
        Step(work.middle_rug, 0.6),
        Step(corner("safe", most=(0.6, 0.6, 0.7)), 0.3),
        Step(beside("briefcase", "desk"), 0.3),
    ),
    needs=(Need(("desk",)),),
    fill=0.3,
    fillers=(work.bookshelf, work.corner_plant, living.reading_corner, piece("office storage"), work.console),
)

# Kitchen and wet rooms ---------------------------------------------------------------------------

KITCHEN_TABLE = in_rooms_above(
    14,
    table("dining table", "kitchen chair", 1.9),
    in_rooms_above(8.5, table("small table", "kitchen chair", 1.3), table("small table", "kitchen chair", 0.85)),
)


def table_for_two(ctx: Context) -> object:
    """A small table with its chairs, where the kitchen has none yet."""
    seated = ctx.roles("dining table", "dining chair")
    return None if seated else living.dining(ctx, "small table", "kitchen chair", 1.15)


KITCHEN = Programme(
    (
        Step(kitchen.kitchen_units),
        Step(kitchen.island, 0.6, above=13),
        Step(KITCHEN_TABLE, above=11),
        Step(KITCHEN_TABLE, above=5.5, upto=11, when=(house_lacks("dining_room"),)),
        Step(KITCHEN_TABLE, 0.6, above=5.5, upto=11, when=(house_has("dining_room"),)),
        Step(piece("cupboard"), 0.4, above=11),
        Step(first_of(corner("kitchen bin", most=(0.5, 0.5, 0.9)), corner("kitchen bin", most=(0.35, 0.35, 0.7)))),
        Step(corner("high chair", most=(0.7, 0.7, 1.3)), 0.4, when=(house_has("kids_room"),)),
        Step(corner("plant", most=(0.7, 0.7, 1.3)), 0.4, when=(house_lacks("kids_room"),)),
        Step(corner("broom"), 0.3),
        Step(work.corner_plant, 0.3),
    ),
    needs=(
        Need(("kitchen sink",), ("kitchen sink",)),
        Need(("cooker",), ("cooker", "cooktop")),
        Need(("fridge",), ("fridge",)),
        Need(("counter",)),
    ),
    fill=0.27,
    fillers=(
        piece("cupboard", clear=0.5),
        work.corner_plant,
        table_for_two,
        piece("shelving unit", clear=0.4),
        corner("basket", most=(0.5, 0.5, 0.6)),
        piece("display storage", clear=0.5),
        work.corner_plant,
    ),
)
BATHROOM = Programme(
    (
        Step(wet.bathroom_fixtures),
        Step(piece("bidet", clear=0.45), 0.3, above=5.5),
        Step(work.machines, 0.7, above=5, when=(house_lacks("laundry_room"),)),
        Step(corner("laundry basket", most=(0.6, 0.6, 0.8))),
        Step(beside("bin", "basin", "toilet", most=(0.32, 0.32, 0.4)), 0.6),
        Step(in_rooms_above(6, work.corner_plant), 0.4),
        Step(corner("stool", most=(0.45, 0.45, 0.6)), 0.25),
    ),
    needs=(
        Need(("toilet",), ("toilet",)),
        Need(("basin",), ("washbasin", "wall washbasin", "basin", "bathroom vanity", "double vanity")),
        Need(("bathtub", "corner bathtub", "shower"), ("bathtub", "corner bathtub", "shower")),
    ),
)
TOILET = Programme(
    (
        Step(wet.toilet),
        Step(basin("wall washbasin")),
        Step(beside("bin", "toilet", "basin", most=(0.3, 0.3, 0.4)), 0.5),
    ),
    needs=(Need(("toilet",), ("toilet",)), Need(("basin",))),
)
LAUNDRY_ROOM = Programme(
    (
        Step(work.machines),
        Step(piece("rough storage", clear=0.5)),
        Step(basin("small basin"), above=4.5),
        Step(either(0.5, piece("tall cabinet", clear=0.5), piece("cupboard", clear=0.5)), above=4.5),
        Step(open_floor("clothes horse", clear=0.0), above=5),
        Step(corner("laundry basket", most=(0.6, 0.6, 0.8))),
        Step(open_floor("ironing board", clear=0.0), 0.7),
        Step(corner("broom"), 0.7),
        Step(corner("basin", most=(0.8, 0.7, 0.4)), 0.5),
        Step(corner("step ladder", where=lambda a: a.size[2] < 1.2), 0.5),
        Step(corner("dustpan"), 0.4),
    ),
    needs=(Need(("washing machine",)),),
    fill=0.34,
    fillers=(piece("rough storage", clear=0.4), corner("laundry basket"), corner("box"), piece("cupboard", clear=0.4)),
)

# Sleeping ----------------------------------------------------------------------------------------

WIDE_BED = first_of(sleep.double_bed, sleep.single_bed)
SOME_BED = first_of(sleep.single_bed, sleep.double_bed)
GUEST_BED = either(0.35, first_of(narrow_bed("sofa to sleep on"), sleep.single_bed), SOME_BED)
BED = Need(("bed",), BEDS)
RESTING = (
    sleep.dresser,
    sleep.bedroom_chair,
    work.corner_plant,
    work.bookshelf,
    living.reading_corner,
    sleep.wardrobe,
    work.desk,
    piece("bench", clear=0.3),
    corner("basket", most=(0.6, 0.6, 0.7)),
)
SLEEPING = (
    Step(sleep.wardrobe, when=(tried_before(2),)),
    Step(WIDE_BED, when=(room_is("main_bedroom"),)),
    Step(either(0.6, WIDE_BED, SOME_BED), above=10.5, when=(room_is("bedroom"),)),
    Step(SOME_BED, upto=10.5, when=(room_is("bedroom"),)),
    Step(either(0.6, WIDE_BED, GUEST_BED), above=10.5, when=(room_is("guest_room"),)),
    Step(GUEST_BED, upto=10.5, when=(room_is("guest_room"),)),
    Step(narrow_bed("child bed"), when=(lacks("bed"),)),
    Step(sleep.wardrobe_unless_closet, when=(lacks("wardrobe"),)),
    Step(sleep.wardrobe, 0.5, above=17),
    Step(work.desk, 0.75, above=9, when=(room_is("bedroom", "guest_room"),)),
    Step(sleep.dresser),
    Step(either(0.7, sleep.bedroom_chair, living.reading_corner), above=12),
    Step(work.desk, 0.3, above=14),
    Step(work.bookshelf, 0.35),
    Step(living.conversation, 0.6, above=18),
    Step(work.corner_plant, 0.75),
    Step(beside("bin", "desk", most=(0.35, 0.35, 0.45)), when=(has("desk"),)),
    Step(corner("laundry basket"), 0.3),
    Step(beside("slippers", "bed"), 0.5),
    Step(piece("folding screen", clear=0.0), 0.15, above=16),
    Step(corner("suitcase"), 0.5, when=(room_is("guest_room"),)),
    Step(corner("electric guitar"), 0.2, when=(room_is("bedroom"),)),
    Step(piece("trunk", clear=0.4), 0.4, above=16),
)
MAIN_BEDROOM = Programme(SLEEPING, needs=(BED, Need(("wardrobe",))), fill=0.34, fillers=RESTING)
BEDROOM = Programme(SLEEPING, needs=(BED, Need(("wardrobe",))), fill=0.36, fillers=RESTING)
GUEST_ROOM = Programme(SLEEPING, needs=(BED,), fill=0.34, fillers=RESTING)
KIDS_ROOM = Programme(
    (
        Step(first_of(narrow_bed("kid bed"), sleep.single_bed)),
        Step(each_of(sleep.cot, piece("changing table")), 0.25, above=12),
        Step(either(0.7, work.desk, sleep.child_table)),
        Step(either(0.7, sleep.wardrobe, sleep.dresser)),
        Step(piece("shelving unit", where=lambda a: "child" in a.tags or a.size[2] < 1.9), 0.8),
        Step(sleep.toys),
        Step(sleep.child_table, above=11),
        Step(corner("bean bag", most=(1.0, 1.0, 0.9)), 0.5),
        Step(open_floor("big toy", clear=0.0, group="toy"), 0.6),
        Step(corner("backpack"), 0.4),
        Step(beside("bin", "desk", most=(0.35, 0.35, 0.45))),
        Step(work.corner_plant, 0.35),
    ),
    needs=(BED,),
    fill=0.34,
    fillers=(
        sleep.toys,
        sleep.child_table,
        work.bookshelf,
        corner("big toy"),
        piece("shelving unit", clear=0.4),
        corner("bean bag"),
        sleep.dresser,
    ),
)

# Ways through ------------------------------------------------------------------------------------

HALL = Programme(
    (
        Step(work.doormat),
        Step(work.console, 0.85),
        Step(work.hall_bench, 0.8),
        Step(
            either(0.5, piece("wardrobe", most=(1.3, 0.65, 2.4)), piece("cupboard", most=(1.3, 0.65, 2.4))),
            0.6,
            above=7,
        ),
        Step(corner("umbrella stand"), 0.6),
        Step(beside("shoes", "bench", "console", "doormat"), times=between(0, 2)),
        Step(work.corner_plant, 0.6, above=5),
        Step(work.middle_rug, above=9),
        Step(living.conversation, 0.5, above=9),
        Step(work.runner, 0.4, upto=9),
        Step(either(0.5, corner("kick scooter"), corner("stroller")), 0.25, when=(house_has("kids_room"),)),
    ),
    fill=0.14,
    fillers=(work.console, work.corner_plant, work.hall_bench, piece("cupboard"), living.reading_corner),
)
CORRIDOR = Programme(
    (
        Step(work.runner, 0.75),
        Step(work.console, 0.8, when=(wider_than(1.25),)),
        Step(corner("floor decoration", most=(0.5, 0.5, 1.3)), 0.5),
    )
)
STAIRWELL = Programme((Step(work.corner_plant, 0.6), Step(work.console, 0.4)))

# Storing, working, playing -----------------------------------------------------------------------

ROUGH = (
    piece("rough storage", clear=0.5, avoid=()),
    corner("box", avoid=()),
    corner("box", avoid=()),
    piece("shelving unit", clear=0.5, avoid=()),
    corner("step ladder"),
    corner("trash can"),
)
GARAGE_THINGS = (
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
)
WORKSHOP_THINGS = ("step ladder", "stool", "fire extinguisher", "broom", "kitchen bin", "shovel", "barrel")
PANTRY = Programme(
    (
        Step(piece("shelving unit", clear=0.45, avoid=()), times=2),
        Step(piece("shelving unit", clear=0.45, avoid=()), above=2.5),
        Step(piece("chest freezer", clear=0.5), 0.5),
        Step(corner("box", most=(0.62, 0.62, 0.7)), times=between(1, 3)),
        Step(corner("shopping trolley"), 0.5),
        Step(corner("broom"), 0.5),
    ),
    fill=0.36,
    fillers=(
        piece("shelving unit", clear=0.4, avoid=()),
        corner("box", avoid=()),
        piece("cupboard", clear=0.4),
        corner("basket", most=(0.6, 0.6, 0.7)),
    ),
)
CLOSET = Programme(
    (
        Step(sleep.clothes, times=3),
        Step(sleep.clothes, above=4),
        Step(sleep.clothes, above=6),
        Step(open_floor("bench", clear=0.3), 0.6, above=4),
        Step(corner("shoes"), times=between(2, 4)),
        Step(corner("suitcase"), 0.6),
        Step(corner("laundry basket"), 0.4),
        Step(work.middle_rug, 0.5),
    ),
    fill=0.36,
    fillers=(sleep.clothes, sleep.clothes, corner("shoes"), corner("box", most=(0.6, 0.6, 0.5)), corner("basket")),
)
GARAGE = Programme(
    (
        Step(work.workbench),
        Step(piece("rough storage", clear=0.5, avoid=()), times=2),
        Step(piece("rough storage", clear=0.5, avoid=()), above=18),
        Step(open_floor("bicycle", clear=0.2)),
        Step(open_floor("bicycle", clear=0.2), above=16),
        Step(open_floor("lawn mower", clear=0.0), 0.6),
        *(Step(corner(role, most=(1.7, 1.2, 2.2)), 0.5) for role in GARAGE_THINGS),
        Step(corner("box", avoid=()), times=between(2, 5)),
        Step(corner("barrel"), 0.4),
    ),
    fill=0.24,
    fillers=ROUGH,
)
WORKSHOP = Programme(
    (
        Step(work.workbench),
        Step(work.workbench, 0.5, above=11),
        Step(piece("rough storage", clear=0.5, avoid=()), times=2),
        Step(piece("rough storage", clear=0.5, avoid=()), above=12),
        Step(open_floor("drafting table"), 0.5),
        Step(piece("folding table", clear=0.5)),
        *(Step(corner(role, most=(1.0, 1.0, 2.2)), 0.6) for role in WORKSHOP_THINGS),
        Step(corner("box", avoid=()), times=between(2, 4)),
    ),
    fill=0.28,
    fillers=ROUGH,
)
PLAYROOM = Programme(
    (
        Step(either(0.7, open_floor("game table"), open_floor("foosball table")), above=15),
        Step(open_floor("foosball table"), upto=15),
        Step(sleep.toys),
        Step(sleep.child_table),
        Step(piece("shelving unit", clear=0.5, where=lambda a: a.size[2] < 1.95), times=2),
        Step(open_floor("big toy", clear=0.0, group="toy")),
        Step(open_floor("pinball machine"), 0.5),
        Step(corner("bean bag"), times=2),
        Step(sleep.toys, 0.5),
        Step(piece("whiteboard", clear=0.4), 0.6),
        Step(work.corner_plant),
        Step(living.conversation, above=13),
    ),
    fill=0.26,
    fillers=(
        sleep.toys,
        corner("bean bag"),
        piece("shelving unit", clear=0.4),
        corner("big toy"),
        living.reading_corner,
        sleep.child_table,
    ),
)
GYM = Programme(
    (
        *(
            Step(open_floor(role, clear=0.3))
            for role in ("treadmill", "exercise bike", "abdominal bench", "punching bag")
        ),
        Step(open_floor("multi-gym", clear=0.5), above=16),
        Step(piece("bench", clear=0.4, most=(1.5, 0.6, 0.6))),
        Step(either(0.5, piece("locker", clear=0.4), piece("shelving unit", clear=0.4)), 0.6),
        Step(piece("water cooler", clear=0.4), 0.6),
        *(Step(corner(role), 0.6) for role in ("sneakers", "basketball", "laundry basket")),
        Step(work.corner_plant),
    ),
    fill=0.26,
    fillers=(piece("bench", clear=0.3), work.corner_plant, piece("shelving unit", clear=0.4), corner("basketball")),
)

PROGRAMMES: Mapping[str, Programme] = {
    "living_room": LIVING_ROOM,
    "family_room": FAMILY_ROOM,
    "dining_room": DINING_ROOM,
    "kitchen": KITCHEN,
    "main_bedroom": MAIN_BEDROOM,
    "bedroom": BEDROOM,
    "guest_room": GUEST_ROOM,
    "kids_room": KIDS_ROOM,
    "bathroom": BATHROOM,
    "toilet": TOILET,
    "hall": HALL,
    "corridor": CORRIDOR,
    "study": STUDY,
    "laundry_room": LAUNDRY_ROOM,
    "pantry": PANTRY,
    "closet": CLOSET,
    "library": LIBRARY,
    "playroom": PLAYROOM,
    "gym": GYM,
    "garage": GARAGE,
    "workshop": WORKSHOP,
    "sun_room": SUN_ROOM,
    "stairwell": STAIRWELL,
}
"""Room kind (one of assets.records.ROOM_KINDS) to its furniture."""
