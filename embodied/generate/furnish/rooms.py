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
    Wish,
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
from embodied.generate.furnish.stock import AssetLimits

BEDS = ("bed", "child bed", "bunk bed", "loft bed", "day bed", "sofa bed", "crib", "cradle")
"""Object classes that one can sleep in."""


def furnish_room(ctx: Context) -> None:
    """Put the furniture of its kind into the room."""
    carry_out(PROGRAMMES[ctx.kind], ctx)


def missing(ctx: Context) -> int:
    """How much the room lacks of what makes it what it is, 0 for nothing."""
    return shortage(PROGRAMMES[ctx.kind].needs, ctx)


# Single pieces, by role --------------------------------------------------------------------------


def piece(role: str, clear: float = 0.6, **limits: Unpack[AssetLimits]) -> Group:
    """One piece of storage or a machine at a wall, with `clear` metres free before it."""
    return lambda ctx: work.storage(ctx, role, clear=clear, **limits)


def corner(role: str, **limits: Unpack[AssetLimits]) -> Group:
    """One thing in a corner or at a wall."""
    return lambda ctx: work.corner_thing(ctx, role, **limits)


def beside(role: str, *anchors: str, **limits: Unpack[AssetLimits]) -> Group:
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
    Wish(first_of(living.seating, living.sofa_group, living.lone_sofa, living.conversation), name="seats"),
    Wish(living.dining, above=20, when=(house_lacks("dining_room"), room_is("living_room"))),
    Wish(SHELVES),
    Wish(SHELVES, above=22),
    Wish(SHELVES, above=32),
    Wish(living.reading_corner, 0.75, above=18),
    Wish(living.conversation, above=26, upto=34),
    Wish(living.sofa_group, above=34),
    Wish(piece("upright piano", clear=0.8), 0.35, above=24),
    Wish(living.reading_corner, unless="seats"),
    Wish(work.corner_plant),
    Wish(work.corner_plant, above=18),
    Wish(work.corner_plant, above=30),
    Wish(beside("firewood", "fireplace"), when=(has("fireplace"),)),
    Wish(corner("bean bag"), 0.3),
    Wish(corner("floor vase"), 0.25),
    Wish(corner("pet", most=(0.5, 1.0, 0.9)), 0.12),
    Wish(beside("basket", "sofa", "fireplace", "armchair", most=(0.6, 0.6, 0.7)), 0.35),
    Wish(open_floor("grand piano"), 0.3, above=30),
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
        Wish(living.dining),
        Wish(piece("display storage")),
        Wish(piece("display storage"), above=14),
        Wish(piece("cupboard"), 0.4, above=15),
        Wish(work.corner_plant),
        Wish(work.corner_plant, above=13),
        Wish(living.reading_corner, 0.4, above=18),
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
        Wish(either(0.6, living.seating, two_chairs("reading chair")), above=16),
        Wish(two_chairs("reading chair"), upto=16),
        Wish(work.bookshelf, times=per_area(3, 5)),
        Wish(work.desk, above=12),
        Wish(living.reading_corner),
        Wish(work.corner_plant),
        Wish(work.middle_rug, when=(lacks("rug"),)),
        Wish(piece("chest", clear=0.4), 0.3),
    ),
    fill=0.26,
    fillers=SITTING,
)
SUN_ROOM = Programme(
    (
        Wish(first_of(living.low_table_seat, two_chairs("sun seat"))),
        Wish(table("bistro table", "bistro chair", 1.0), 0.6, above=12),
        Wish(living.reading_corner, above=12),
        Wish(work.corner_plant, times=per_area(3, 5)),
        Wish(open_floor("sun lounger", clear=0.0), 0.4),
        Wish(work.middle_rug),
    ),
    fill=0.24,
    fillers=SITTING,
)
STUDY = Programme(
    (
        Wish(work.desk),
        Wish(work.bookshelf),
        Wish(work.bookshelf, above=8),
        Wish(work.bookshelf, above=12),
        Wish(piece("office storage", most=(3.1, 0.7, 2.2))),
        Wish(corner("side chair", most=(0.7, 0.7, 1.2)), 0.5, above=9),
        Wish(living.reading_corner, above=8),
        Wish(open_floor("drafting table"), 0.4, above=10),
        Wish(beside("bin", "desk", most=(0.35, 0.35, 0.45))),
        Wish(work.corner_plant),
        Wish(work.middle_rug, 0.6),
        Wish(corner("safe", most=(0.6, 0.6, 0.7)), 0.3),
        Wish(beside("briefcase", "desk"), 0.3),
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
        Wish(kitchen.kitchen_units),
        Wish(kitchen.island, 0.6, above=13),
        Wish(KITCHEN_TABLE, above=11),
        Wish(KITCHEN_TABLE, above=5.5, upto=11, when=(house_lacks("dining_room"),)),
        Wish(KITCHEN_TABLE, 0.6, above=5.5, upto=11, when=(house_has("dining_room"),)),
        Wish(piece("cupboard"), 0.4, above=11),
        Wish(first_of(corner("kitchen bin", most=(0.5, 0.5, 0.9)), corner("kitchen bin", most=(0.35, 0.35, 0.7)))),
        Wish(corner("high chair", most=(0.7, 0.7, 1.3)), 0.4, when=(house_has("kids_room"),)),
        Wish(corner("plant", most=(0.7, 0.7, 1.3)), 0.4, when=(house_lacks("kids_room"),)),
        Wish(corner("broom"), 0.3),
        Wish(work.corner_plant, 0.3),
    ),
    needs=(
        Need(("kitchen sink",), ("kitchen sink",)),
        Need(("cooker",), ("cooker", "cooktop")),
        Need(("fridge",), ("fridge",)),
        Need(("counter",), ("base cabinet", "drawer cabinet", "kitchen island")),
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
        Wish(wet.bathroom_fixtures),
        Wish(piece("bidet", clear=0.45), 0.3, above=5.5),
        Wish(work.machines, 0.7, above=5, when=(house_lacks("laundry_room"),)),
        Wish(corner("laundry basket", most=(0.6, 0.6, 0.8))),
        Wish(beside("bin", "basin", "toilet", most=(0.32, 0.32, 0.4)), 0.6),
        Wish(in_rooms_above(6, work.corner_plant), 0.4),
        Wish(corner("stool", most=(0.45, 0.45, 0.6)), 0.25),
    ),
    needs=(
        Need(("toilet",), ("toilet",)),
        Need(("basin",), ("washbasin", "wall washbasin", "basin", "bathroom vanity", "double vanity")),
        Need(("bathtub", "corner bathtub", "shower"), ("bathtub", "corner bathtub", "shower")),
    ),
)
TOILET = Programme(
    (
        Wish(wet.toilet),
        Wish(basin("wall washbasin")),
        Wish(beside("bin", "toilet", "basin", most=(0.3, 0.3, 0.4)), 0.5),
    ),
    needs=(Need(("toilet",), ("toilet",)), Need(("basin",))),
)
LAUNDRY_ROOM = Programme(
    (
        Wish(work.machines),
        Wish(piece("rough storage", clear=0.5)),
        Wish(basin("small basin"), above=4.5),
        Wish(either(0.5, piece("tall cabinet", clear=0.5), piece("cupboard", clear=0.5)), above=4.5),
        Wish(open_floor("clothes horse", clear=0.0), above=5),
        Wish(corner("laundry basket", most=(0.6, 0.6, 0.8))),
        Wish(open_floor("ironing board", clear=0.0), 0.7),
        Wish(corner("broom"), 0.7),
        Wish(corner("basin", most=(0.8, 0.7, 0.4)), 0.5),
        Wish(corner("step ladder", where=lambda a: a.size[2] < 1.2), 0.5),
        Wish(corner("dustpan"), 0.4),
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
    Wish(sleep.wardrobe, when=(tried_before(2),)),
    Wish(WIDE_BED, when=(room_is("main_bedroom"),)),
    Wish(either(0.6, WIDE_BED, SOME_BED), above=10.5, when=(room_is("bedroom"),)),
    Wish(SOME_BED, upto=10.5, when=(room_is("bedroom"),)),
    Wish(either(0.6, WIDE_BED, GUEST_BED), above=10.5, when=(room_is("guest_room"),)),
    Wish(GUEST_BED, upto=10.5, when=(room_is("guest_room"),)),
    Wish(narrow_bed("child bed"), when=(lacks("bed"),)),
    Wish(sleep.wardrobe_unless_closet, when=(lacks("wardrobe"),)),
    Wish(sleep.wardrobe, 0.5, above=17),
    Wish(work.desk, 0.75, above=9, when=(room_is("bedroom", "guest_room"),)),
    Wish(sleep.dresser),
    Wish(either(0.7, sleep.bedroom_chair, living.reading_corner), above=12),
    Wish(work.desk, 0.3, above=14),
    Wish(work.bookshelf, 0.35),
    Wish(living.conversation, 0.6, above=18),
    Wish(work.corner_plant, 0.75),
    Wish(beside("bin", "desk", most=(0.35, 0.35, 0.45)), when=(has("desk"),)),
    Wish(corner("laundry basket"), 0.3),
    Wish(beside("slippers", "bed"), 0.5),
    Wish(piece("folding screen", clear=0.0), 0.15, above=16),
    Wish(corner("suitcase"), 0.5, when=(room_is("guest_room"),)),
    Wish(corner("electric guitar"), 0.2, when=(room_is("bedroom"),)),
    Wish(piece("trunk", clear=0.4), 0.4, above=16),
)
MAIN_BEDROOM = Programme(SLEEPING, needs=(BED, Need(("wardrobe",))), fill=0.34, fillers=RESTING)
BEDROOM = Programme(SLEEPING, needs=(BED, Need(("wardrobe",))), fill=0.36, fillers=RESTING)
GUEST_ROOM = Programme(SLEEPING, needs=(BED,), fill=0.34, fillers=RESTING)
KIDS_ROOM = Programme(
    (
        Wish(first_of(narrow_bed("kid bed"), sleep.single_bed)),
        Wish(each_of(sleep.cot, piece("changing table")), 0.25, above=12),
        Wish(either(0.7, work.desk, sleep.child_table)),
        Wish(either(0.7, sleep.wardrobe, sleep.dresser)),
        Wish(piece("shelving unit", where=lambda a: "child" in a.tags or a.size[2] < 1.9), 0.8),
        Wish(sleep.toys),
        Wish(sleep.child_table, above=11),
        Wish(corner("bean bag", most=(1.0, 1.0, 0.9)), 0.5),
        Wish(open_floor("big toy", clear=0.0, group="toy"), 0.6),
        Wish(corner("backpack"), 0.4),
        Wish(beside("bin", "desk", most=(0.35, 0.35, 0.45))),
        Wish(work.corner_plant, 0.35),
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
        Wish(work.doormat),
        Wish(work.console, 0.85),
        Wish(work.hall_bench, 0.8),
        Wish(piece("shoe rack", clear=0.3), 0.7),
        Wish(
            either(0.5, piece("wardrobe", most=(1.3, 0.65, 2.4)), piece("cupboard", most=(1.3, 0.65, 2.4))),
            0.6,
            above=7,
        ),
        Wish(corner("umbrella stand"), 0.6),
        Wish(beside("shoes", "bench", "console", "doormat"), times=between(0, 2)),
        Wish(work.corner_plant, 0.6, above=5),
        Wish(work.middle_rug, above=9),
        Wish(living.conversation, 0.5, above=9),
        Wish(work.runner, 0.4, upto=9),
        Wish(either(0.5, corner("kick scooter"), corner("stroller")), 0.25, when=(house_has("kids_room"),)),
    ),
    fill=0.14,
    fillers=(work.console, work.corner_plant, work.hall_bench, piece("cupboard"), living.reading_corner),
)
CORRIDOR = Programme(
    (
        Wish(work.runner, 0.75),
        Wish(work.console, 0.8, when=(wider_than(1.25),)),
        Wish(corner("floor decoration", most=(0.5, 0.5, 1.3)), 0.5),
    )
)
STAIRWELL = Programme((Wish(work.corner_plant, 0.6), Wish(work.console, 0.4)))

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
        Wish(piece("shelving unit", clear=0.45, avoid=()), times=2),
        Wish(piece("shelving unit", clear=0.45, avoid=()), above=2.5),
        Wish(piece("chest freezer", clear=0.5), 0.5),
        Wish(corner("box", most=(0.62, 0.62, 0.7)), times=between(1, 3)),
        Wish(corner("shopping trolley"), 0.5),
        Wish(corner("broom"), 0.5),
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
        Wish(sleep.clothes, times=3),
        Wish(sleep.clothes, above=4),
        Wish(sleep.clothes, above=6),
        Wish(open_floor("bench", clear=0.3), 0.6, above=4),
        Wish(piece("shoe rack", clear=0.3), 0.6),
        Wish(corner("shoes"), times=between(2, 4)),
        Wish(corner("suitcase"), 0.6),
        Wish(corner("laundry basket"), 0.4),
        Wish(work.middle_rug, 0.5),
    ),
    fill=0.36,
    fillers=(sleep.clothes, sleep.clothes, corner("shoes"), corner("box", most=(0.6, 0.6, 0.5)), corner("basket")),
)
GARAGE = Programme(
    (
        Wish(work.workbench),
        Wish(piece("rough storage", clear=0.5, avoid=()), times=2),
        Wish(piece("rough storage", clear=0.5, avoid=()), above=18),
        Wish(open_floor("bicycle", clear=0.2)),
        Wish(open_floor("bicycle", clear=0.2), above=16),
        Wish(open_floor("lawn mower", clear=0.0), 0.6),
        *(Wish(corner(role, most=(1.7, 1.2, 2.2)), 0.5) for role in GARAGE_THINGS),
        Wish(corner("box", avoid=()), times=between(2, 5)),
        Wish(corner("barrel"), 0.4),
    ),
    fill=0.24,
    fillers=ROUGH,
)
WORKSHOP = Programme(
    (
        Wish(work.workbench),
        Wish(work.workbench, 0.5, above=11),
        Wish(piece("rough storage", clear=0.5, avoid=()), times=2),
        Wish(piece("rough storage", clear=0.5, avoid=()), above=12),
        Wish(open_floor("drafting table"), 0.5),
        Wish(piece("folding table", clear=0.5)),
        *(Wish(corner(role, most=(1.0, 1.0, 2.2)), 0.6) for role in WORKSHOP_THINGS),
        Wish(corner("box", avoid=()), times=between(2, 4)),
    ),
    fill=0.28,
    fillers=ROUGH,
)
PLAYROOM = Programme(
    (
        Wish(either(0.7, open_floor("game table"), open_floor("foosball table")), above=15),
        Wish(open_floor("foosball table"), upto=15),
        Wish(sleep.toys),
        Wish(sleep.child_table),
        Wish(piece("shelving unit", clear=0.5, where=lambda a: a.size[2] < 1.95), times=2),
        Wish(open_floor("big toy", clear=0.0, group="toy")),
        Wish(open_floor("pinball machine"), 0.5),
        Wish(corner("bean bag"), times=2),
        Wish(sleep.toys, 0.5),
        Wish(piece("whiteboard", clear=0.4), 0.6),
        Wish(work.corner_plant),
        Wish(living.conversation, above=13),
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
            Wish(open_floor(role, clear=0.3))
            for role in ("treadmill", "exercise bike", "abdominal bench", "punching bag")
        ),
        Wish(open_floor("multi-gym", clear=0.5), above=16),
        Wish(piece("bench", clear=0.4, most=(1.5, 0.6, 0.6))),
        Wish(either(0.5, piece("locker", clear=0.4), piece("shelving unit", clear=0.4)), 0.6),
        Wish(piece("water cooler", clear=0.4), 0.6),
        *(Wish(corner(role), 0.6) for role in ("sneakers", "basketball", "laundry basket")),
        Wish(work.corner_plant),
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
