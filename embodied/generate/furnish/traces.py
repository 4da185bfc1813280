"""What its people leave about in a room, and where: shoes at the door, dishes by the sink, clothes on a chair."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from assets.records import Asset
from embodied.generate.furnish.arrange import Item, ScoredPose, Thing, floor_poses, wall_poses
from embodied.generate.furnish.context import Context, door_distance
from embodied.generate.furnish.mounting import Hanging, Spot, along_stretches, hang_first, longest_first
from embodied.generate.furnish.smalls import SHELVES, Board, Tops, main_board
from embodied.generate.furnish.space import CELL, Box, Wall, box


@dataclass(frozen=True)
class Trace:
    """One kind of thing that people leave in a room."""

    role: str
    on: tuple[str, ...] = ()
    """Roles or object classes of what carries it; on none it lies on the floor."""
    count: float = 1.0
    """How many, in the mean."""
    per: str = "room"
    """What `count` is of: 'room', 'person' who uses it, 'adult', 'child', 'young' (a child under seven)."""
    mess: bool = False
    """Left where it was used: more of it in untidy houses, none in the tidiest."""
    habit: str | None = None
    """Only who has this habit leaves it."""
    spot: str = "any"
    turn: float = 0.4
    near: tuple[str, ...] = ()
    """Roles or classes that it keeps close to; on the floor nothing lies without them."""
    wall: float | None = None
    """It hangs, its upper edge so high, metres."""
    most: int = 4
    """Of its class in one room."""


LARGEST = 0.25
"""Most of the floor that one can walk on which a thing left on it takes from it, square metres."""
CUT_TO_FIT = ("storage box", "folded clothes", "towel", "row of folders", "cushion", "heap of clothes")
"""Object classes that come in many sizes."""
COUNTERS = ("counter", "kitchen sink")
TABLES = ("dining table", "bistro table")
SHELF = "open wall shelf"
SEATS = ("sofa", "corner sofa", "sofa bed", "armchair", "lounge chair")
BOOKS = ("bookcase", "wall unit", "shelving unit", SHELF, "media cabinet")
LOW = ("tv stand", "media unit", "sideboard", "dresser", "console", "console table", "cupboard", "office cabinet")
BEDSIDE = ("bedside table",)
DESKS = ("desk", "office table")
BASINS = ("basin", "bathroom vanity", "washbasin", "double vanity", "bathroom cabinet", "washing machine", SHELF)
STORE = ("shelving unit", "cupboard", "storage shelf", "chest freezer", "pantry shelf", "workbench")
ENTRY = ("console", "console table", "bench", "cupboard", "dresser", "sideboard", SHELF)

TABLE_LIFE = (
    Trace("mug", TABLES, 0.4, "person", mess=True, turn=3.2),
    Trace("glass", TABLES, 0.4, "person", mess=True, turn=3.2),
    Trace("newspaper", TABLES, 0.56, mess=True),
    Trace("mail", TABLES, 0.56, mess=True),
    Trace("crayons", TABLES, 0.96, "young", mess=True),
    Trace("candle", TABLES, 0.8, spot="centre"),
    Trace("salt shaker", TABLES, 0.64, spot="centre"),
    Trace("water bottle", TABLES, 0.48),
    Trace("glasses", TABLES, 0.32, "adult"),
    Trace("charging cable", TABLES, 0.4, mess=True),
    Trace("bowl", TABLES, 0.5, spot="centre", turn=3.2),
    Trace("plate", TABLES, 0.3, "person", mess=True, turn=3.2),
    Trace("magazine", TABLES, 0.4, mess=True),
)
LIVING = (
    Trace(SHELF, (), 1.5, wall=1.6, most=3),
    *TABLE_LIFE,
    Trace("mug", ("coffee table", "side table"), 0.4, "person", mess=True, turn=3.2),
    Trace("glass", ("coffee table", "side table"), 0.3, "adult", mess=True, turn=3.2),
    Trace("magazine", ("coffee table", "side table", "sofa"), 1.0, most=5),
    Trace("book", ("coffee table", "side table", *SEATS), 1.5, "adult", habit="reads", most=8),
    Trace("candle", ("coffee table", SHELF, *LOW), 2.5, most=6),
    Trace("charging cable", ("coffee table", "side table", *LOW), 0.8, spot="back"),
    Trace("mobile phone", ("coffee table", "side table", "sofa"), 0.2, "person", mess=True),
    Trace("glasses", ("coffee table", "side table"), 0.25, "adult"),
    Trace("tissue box", ("coffee table", "side table", *LOW), 0.4),
    Trace("playing cards", ("coffee table", *TABLES), 0.8, habit="plays"),
    Trace("game controller", ("coffee table", "sofa", *LOW), 1.6, habit="plays"),
    Trace("board game", (*BOOKS, *LOW), 1.3, habit="plays"),
    Trace("blanket", SEATS, 0.5, mess=True),
    Trace("cushion", SEATS, 1.5, spot="back", most=9),
    Trace("teddy bear", ("sofa", "corner sofa", "armchair"), 0.3, "young", mess=True),
    Trace("book", BOOKS, 4.0, turn=0.2, most=10),
    Trace("stack of books", BOOKS, 2.0, turn=0.2, most=6),
    Trace("photo frame", (*BOOKS, *LOW), 0.9, "person", spot="back", most=7),
    Trace("vase", (*BOOKS, *LOW), 1.6, most=5),
    Trace("small plant", (*BOOKS, *LOW, "side table", "coffee table"), 2.0, turn=3.2, most=6),
    Trace("storage box", BOOKS, 1.2, turn=0.05, most=5),
    Trace("speaker", (*BOOKS, *LOW), 0.5),
    Trace("camera", BOOKS, 0.3),
    Trace("wine glass", (*BOOKS, *LOW), 0.6, "adult", most=5),
    Trace("floor toy", (), 1.0, "child", mess=True, turn=3.2),
    Trace("building blocks", (), 0.5, "young", mess=True, turn=3.2),
    Trace("slippers", (), 0.3, "person", mess=True, near=("sofa", "armchair", "corner sofa")),
    Trace("shoes", (), 0.25, mess=True, near=("sofa",)),
    Trace("basket", (), 0.5, near=("sofa", "armchair", "bookcase")),
    Trace("potted plant", (), 0.5, near=("sofa", "tv stand", "armchair", "bookcase"), most=5),
    Trace("child's drawing", (), 0.35, "young", wall=1.6),
)
KITCHEN = (
    Trace(SHELF, (), 0.7, wall=1.7, most=1),
    *TABLE_LIFE,
    Trace("dish rack", COUNTERS, 0.65, near=("kitchen sink",), spot="back", turn=0.05, most=1),
    Trace("plate", COUNTERS, 0.35, "person", mess=True, near=("kitchen sink",), turn=3.2, most=5),
    Trace("mug", COUNTERS, 0.4, "person", mess=True, near=("kitchen sink",), turn=3.2, most=6),
    Trace("glass", COUNTERS, 0.4, "person", mess=True, near=("kitchen sink",), turn=3.2, most=6),
    Trace("bowl", COUNTERS, 0.25, "person", mess=True, near=("kitchen sink",), turn=3.2),
    Trace("towel", COUNTERS, 0.7, most=2),
    Trace("storage jar", COUNTERS, 2.0, spot="back", turn=3.2, most=6),
    Trace("storage jar", COUNTERS, 2.0, spot="back", turn=3.2, habit="cooks", most=6),
    Trace("cooking pot", ("cooker", *COUNTERS), 0.8, habit="cooks"),
    Trace("oil bottle", COUNTERS, 0.8, spot="back", habit="cooks"),
    Trace("kitchen knife", COUNTERS, 0.5, mess=True),
    Trace("wine bottle", COUNTERS, 0.4, "adult", spot="back"),
    Trace("food packet", COUNTERS, 0.8, mess=True, spot="back", turn=0.3),
    Trace("food tin", COUNTERS, 0.6, mess=True, turn=3.2),
    Trace("bread", COUNTERS, 0.4, mess=True),
    Trace("milk carton", COUNTERS, 0.35, mess=True),
    Trace("medicine box", COUNTERS, 0.25, spot="back"),
    Trace("mail", COUNTERS, 0.35, mess=True),
    Trace("charging cable", COUNTERS, 0.35, spot="back"),
    Trace("keys", COUNTERS, 0.3, mess=True, turn=3.2),
    Trace("baby bottle", COUNTERS, 0.4, "young"),
    Trace("food packet", ("fridge", "cupboard"), 1.5, spot="back", turn=0.2, most=5),
    Trace("basket", ("fridge", "cupboard"), 0.5, turn=0.1),
    Trace("storage jar", ("shelving unit", "cupboard", "open wall shelf"), 4.0, turn=3.2, most=12),
    Trace("stack of plates", ("shelving unit", "cupboard", "open wall shelf"), 1.0),
    Trace("book", ("shelving unit", "cupboard"), 1.5, habit="cooks", most=6),
    Trace("notice board", (), 0.35, wall=1.85, most=1),
    Trace("wall calendar", (), 0.5, wall=1.8, most=1),
    Trace("child's drawing", (), 0.5, "child", wall=1.6),
    Trace("note", (), 1.2, wall=1.6),
    Trace("floor toy", (), 0.3, "young", mess=True, turn=3.2),
)
SLEEPING = (
    Trace(SHELF, (), 1.4, wall=1.6, near=("bed", "desk"), most=3),
    Trace("small plant", (SHELF, "dresser"), 1.0, spot="side", turn=3.2),
    Trace("candle", (SHELF, "dresser"), 1.0, turn=3.2),
    Trace("vase", (SHELF, "dresser"), 0.7, turn=3.2),
    Trace("row of books", (SHELF,), 0.7, spot="side", turn=0.0),
    Trace("hanging coat", (), 0.35, "person", mess=True, wall=1.75),
    Trace("duvet", ("bed", "child bed", "day bed"), 0.55, mess=True, spot="front", turn=0.12, most=1),
    Trace("heap of clothes", ("armchair", "desk chair", "chair", "bench", "trunk", "chest"), 0.5, "person", mess=True),
    Trace("heap of clothes", (), 0.35, "person", mess=True, near=("bed", "wardrobe")),
    Trace("socks", (), 0.3, "person", mess=True, near=("bed",), turn=3.2),
    Trace("slippers", (), 0.6, "person", near=("bed",)),
    Trace("shoes", (), 0.35, "person", near=("wardrobe", "bed")),
    Trace("book", BEDSIDE, 0.6, "person", most=5),
    Trace("book", BEDSIDE, 0.8, "person", habit="reads", most=5),
    Trace("glass", BEDSIDE, 0.4, "person", turn=3.2),
    Trace("charging cable", (*BEDSIDE, *DESKS), 0.6, "person", spot="back"),
    Trace("tissue box", BEDSIDE, 0.3, spot="back"),
    Trace("medicine bottle", BEDSIDE, 0.2, "person", turn=3.2),
    Trace("watch", (*BEDSIDE, "dresser"), 0.3, "person"),
    Trace("lotion bottle", (*BEDSIDE, "dresser", "dressing table"), 0.5, "person", turn=3.2),
    Trace("perfume bottle", ("dresser", "dressing table"), 0.6, "person", spot="back"),
    Trace("folded clothes", ("dresser", "chest", "bench", "shelving unit"), 0.7, "person", turn=0.2),
    Trace("photo frame", ("dresser", *BOOKS), 1.5, spot="back"),
    Trace("cushion", ("bed", "day bed"), 0.8, spot="back", turn=0.15, most=5),
    Trace("storage box", ("wardrobe", *BOOKS), 1.4, turn=0.05, most=5),
    Trace("board game", ("wardrobe", *BOOKS), 0.5, habit="plays"),
    Trace("stack of books", (*BOOKS, *DESKS), 1.2, turn=0.2),
    Trace("book", (*BOOKS, *DESKS), 3.0, turn=0.4, most=8),
    Trace("mug", (*DESKS, *BEDSIDE), 0.5, "person", mess=True, turn=3.2),
    Trace("stack of paper", DESKS, 0.6),
    Trace("pencil holder", DESKS, 0.4, spot="back"),
    Trace("headphones", DESKS, 0.3),
    Trace("handbag", (), 0.25, "adult", near=("wardrobe", "bed")),
    Trace("wicker basket", (), 0.2, near=("wardrobe",)),
)
PLAYING = (
    Trace(SHELF, (), 0.8, wall=1.5, most=2),
    Trace("floor toy", (), 3.0, mess=True, turn=3.2, most=3),
    Trace("building blocks", (), 1.3, mess=True, turn=3.2, most=2),
    Trace("crayons", ("child table", *DESKS), 1.2, mess=True),
    Trace("wooden toy", ("child table", *BOOKS), 1.2, turn=3.2),
    Trace("toy airplane", ("child table", *BOOKS), 0.8, turn=3.2),
    Trace("puzzle", ("child table", *BOOKS), 0.8),
    Trace("doll", ("bed", "child bed", *BOOKS), 0.6),
    Trace("teddy bear", ("bed", "child bed", "bunk bed", *BOOKS), 0.9, spot="back"),
    Trace("board game", BOOKS, 1.6, turn=0.1),
    Trace("book", BOOKS, 3.0, turn=0.3, most=8),
    Trace("storage box", BOOKS, 1.5, turn=0.05, most=6),
    Trace("plastic cup", ("child table", *DESKS), 0.6, turn=3.2),
    Trace("child's drawing", (), 2.6, wall=1.5, most=5),
    Trace("backpack", (), 0.5, near=("desk", "bed", "wardrobe")),
)
BATHING = (
    Trace(SHELF, (), 0.7, wall=1.5, near=("basin", "toilet"), most=1),
    Trace("small plant", (SHELF,), 0.4, turn=3.2),
    Trace("candle", (SHELF, "bathtub"), 0.4, turn=3.2),
    Trace("toilet roll", (), 1.3, near=("toilet",), turn=0.0, most=3),
    Trace("toothbrush cup", BASINS, 0.3, "person", spot="back", turn=3.2, most=3),
    Trace("lotion bottle", BASINS, 0.45, "person", spot="back", turn=3.2, most=5),
    Trace("cosmetics jar", BASINS, 0.5, "adult", turn=3.2),
    Trace("perfume bottle", BASINS, 0.5, "adult", spot="back"),
    Trace("hairbrush", BASINS, 0.35, "person", turn=3.2),
    Trace("medicine bottle", BASINS, 0.4, spot="back", turn=3.2),
    Trace("glass", BASINS, 0.4, turn=3.2),
    Trace("towel", (*BASINS, "laundry basket", "stool", "tumble dryer"), 0.3, "person", most=5),
    Trace("tissue box", BASINS, 0.3, spot="side"),
    Trace("shampoo bottle", ("bathtub", "corner bathtub"), 0.6, "person", turn=3.2, most=5),
    Trace("rubber duck", ("bathtub", "corner bathtub", *BASINS), 1.0, "young", turn=3.2),
    Trace("sponge", ("bathtub", "corner bathtub"), 0.6, turn=3.2),
    Trace("heap of clothes", (), 0.5, mess=True, near=("laundry basket", "washing machine", "bathtub")),
    Trace("slippers", (), 0.3, near=("basin", "bathtub", "shower")),
    Trace("spray bottle", (*BASINS, "cupboard", "shelving unit"), 0.5, spot="back"),
    Trace("hanging towel", (), 0.35, "person", wall=1.5, near=("basin", "bathtub", "shower"), most=4),
)
ARRIVING = (
    Trace("shoes", ("shoe rack",), 1.6, "person", turn=0.05, most=9),
    Trace("sneakers", ("shoe rack",), 0.5, "person", turn=0.05),
    Trace(SHELF, (), 0.35, wall=1.6, most=1),
    Trace("hanging coat", (), 0.85, "person", wall=1.72, near=("coat hooks", "hanging coat"), most=6),
    Trace("shoes", (), 1.0, "person", near=("doormat", "bench", "coat hooks", "console"), turn=0.15, most=6),
    Trace("sneakers", (), 0.3, "person", near=("doormat", "bench"), turn=0.15),
    Trace("backpack", (), 0.4, "child", near=("bench", "coat hooks"), mess=True),
    Trace("mail", ENTRY, 0.9),
    Trace("keys", ENTRY, 0.5, "adult", turn=3.2),
    Trace("handbag", ENTRY, 0.5, "adult"),
    Trace("hat", ENTRY, 0.3, "adult"),
    Trace("cap", ENTRY, 0.3, "child"),
    Trace("gloves", ENTRY, 0.3, "person"),
    Trace("sunglasses", ENTRY, 0.3, "adult"),
    Trace("charging cable", ENTRY, 0.3),
    Trace("photo frame", ENTRY, 0.5, spot="back"),
    Trace("helmet", ENTRY, 0.5, habit="does sports"),
    Trace("football", (), 0.3, "child", near=("bench", "doormat")),
    Trace("cardboard box", (), 0.3, mess=True, near=("doormat", "console")),
    Trace("wall calendar", (), 0.2, wall=1.8, most=1),
    Trace("note", (), 0.4, wall=1.6),
)
WORKING = (
    Trace(SHELF, (), 0.8, wall=1.6, near=("desk",), most=2),
    Trace("stack of paper", (*DESKS, "filing cabinet", *BOOKS), 2.0, turn=0.3),
    Trace("mug", DESKS, 0.7, mess=True, turn=3.2),
    Trace("pen", DESKS, 1.5, turn=3.2),
    Trace("book", (*DESKS, *BOOKS), 3.0, turn=0.4, most=8),
    Trace("stack of books", (*DESKS, *BOOKS), 1.5, turn=0.3),
    Trace("charging cable", (*DESKS, *LOW), 1.0, spot="back"),
    Trace("row of folders", (*BOOKS, "office cabinet", "cupboard"), 2.0, turn=0.0, most=4),
    Trace("row of folders", (*BOOKS, "office cabinet", "cupboard"), 2.0, habit="works at home", turn=0.0, most=6),
    Trace("storage box", BOOKS, 1.0, turn=0.05),
    Trace("mail", DESKS, 0.6),
    Trace("glasses", DESKS, 0.3),
    Trace("tissue box", (*DESKS, *BOOKS), 0.3),
    Trace("photo frame", BOOKS, 1.0, spot="back"),
    Trace("note", (), 2.2, wall=1.55, near=("desk",)),
    Trace("notice board", (), 0.5, wall=1.85, near=("desk",), most=1),
    Trace("wall calendar", (), 0.4, wall=1.8, near=("desk",), most=1),
    Trace("cardboard box", (), 0.3, mess=True),
)
KEEPING = (
    Trace("food tin", STORE, 9.0, turn=3.2, most=12),
    Trace("food packet", STORE, 6.0, turn=0.2, most=8),
    Trace("storage jar", STORE, 6.0, turn=3.2, most=10),
    Trace("wine bottle", STORE, 2.0, turn=3.2, most=8),
    Trace("toilet roll", STORE, 2.0, turn=0.0),
    Trace("bread", STORE, 0.4),
)
WASHING = (
    Trace("folded clothes", ("washing machine", "tumble dryer", *STORE), 1.5, turn=0.2, most=6),
    Trace("spray bottle", ("washing machine", "tumble dryer", *STORE), 2.0, turn=3.2, most=5),
    Trace("towel", ("washing machine", "tumble dryer", *STORE), 2.0, turn=0.2, most=6),
    Trace("heap of clothes", (), 1.0, mess=True, near=("laundry basket", "washing machine"), most=2),
    Trace("storage box", STORE, 1.5, turn=0.05, most=6),
)
DRESSING = (
    Trace("shoes", (), 0.8, "person", near=("wardrobe", "clothes rack", "shelving unit"), turn=0.1, most=6),
    Trace("folded clothes", ("shelving unit", "dresser", "clothes rack", "wardrobe"), 3.0, turn=0.15, most=8),
    Trace("storage box", ("shelving unit", "wardrobe", "clothes rack"), 1.5, turn=0.05, most=6),
    Trace("hat", ("shelving unit", "dresser"), 0.8),
    Trace("handbag", ("shelving unit", "dresser", "bench"), 0.5, "adult"),
    Trace("hanging coat", (), 0.8, wall=1.75),
)
MAKING = (
    *(
        Trace(role, STORE, 0.8, turn=1.0, most=3)
        for role in ("hammer", "screwdriver", "drill", "tape measure", "adhesive tape", "spray bottle", "gloves")
    ),
    Trace("storage box", STORE, 2.5, turn=0.05, most=8),
    Trace("cardboard box", (), 0.8, near=("shelving unit", "storage shelf", "workbench")),
    Trace("water bottle", STORE, 0.5, mess=True),
    Trace("helmet", STORE, 0.5, "child"),
    Trace("football", (), 0.4, "child"),
)
READING = (
    Trace("book", (*BOOKS, *DESKS, *SEATS, "side table", "coffee table"), 4.0, turn=0.4, most=10),
    Trace("stack of books", (*BOOKS, *DESKS, "side table", "coffee table"), 3.0, turn=0.3, most=8),
    Trace("mug", ("side table", "coffee table", *DESKS), 0.8, mess=True, turn=3.2),
    Trace("photo frame", (*BOOKS, *LOW), 1.0, spot="back"),
    Trace("vase", (*BOOKS, *LOW), 0.8),
    Trace("glasses", ("side table", "coffee table", *DESKS), 0.4),
)
MOVING = (
    Trace("water bottle", ("bench", "shelving unit", "locker"), 1.0, turn=3.2),
    Trace("towel", ("bench", "shelving unit", "locker"), 1.5, most=4),
    Trace("sneakers", (), 0.8, near=("bench", "locker")),
    Trace("basketball", (), 0.4),
)
SUNNING = (
    Trace("small plant", (*TABLES, *LOW, "rattan table", "side table", "coffee table"), 2.0, turn=3.2, most=5),
    Trace("magazine", (*TABLES, "rattan table", "sun lounger", "coffee table"), 1.0),
    Trace("coffee cup", (*TABLES, "rattan table", "side table", "coffee table"), 0.8, mess=True, turn=3.2),
    Trace("book", ("rattan sofa", "rattan table", *SEATS, "side table"), 1.0),
    Trace("cushion", ("rattan sofa", "rattan armchair", *SEATS), 1.0, spot="back"),
    Trace("slippers", (), 0.5, mess=True),
)
PASSING = (*(t for t in ARRIVING if t.on and t.role != "shoes"), Trace("child's drawing", (), 0.4, "child", wall=1.6))
GROWN_UP = ("candle", "vase", "perfume bottle", "lotion bottle", "medicine bottle", "handbag", "watch", "glass")
"""What children's rooms lack."""
TRACES: Mapping[str, tuple[Trace, ...]] = {
    "living_room": LIVING,
    "family_room": LIVING,
    "dining_room": (*TABLE_LIFE, *(t for t in LIVING if t.on and "sofa" not in t.on and t.role != "magazine")),
    "kitchen": KITCHEN,
    "main_bedroom": SLEEPING,
    "bedroom": SLEEPING,
    "guest_room": SLEEPING,
    "kids_room": (*(t for t in SLEEPING if t.role not in GROWN_UP), *PLAYING),
    "playroom": PLAYING,
    "bathroom": BATHING,
    "toilet": BATHING,
    "hall": ARRIVING,
    "corridor": PASSING,
    "study": WORKING,
    "library": READING,
    "laundry_room": WASHING,
    "pantry": KEEPING,
    "closet": DRESSING,
    "garage": MAKING,
    "workshop": MAKING,
    "gym": MOVING,
    "sun_room": SUNNING,
}
"""Room kind to what is left there."""


def leave_traces(ctx: Context) -> None:
    """Put into the furnished room what its household leaves there."""
    tops = Tops(ctx)
    tops.start()
    for trace in TRACES.get(ctx.kind, ()):
        for _ in range(_number(ctx, trace)):
            _leave(ctx, tops, trace)


def _number(ctx: Context, trace: Trace) -> int:
    """How many of it there are: the whole part of the mean, and one more with the rest as its chance."""
    household = ctx.household
    if trace.habit is not None and trace.habit not in household.habits:
        return 0
    rooms = ctx.kinds.count(ctx.kind)
    users = household.residents(ctx.kind, rooms)
    of = {
        "room": 1.0,
        "person": users,
        "adult": float(min(users, household.adults)),
        "child": float(len(household.children)),
        "young": float(sum(age < 7 for age in household.children)),
    }[trace.per]
    untidy = 1.0 - ctx.stock.style.tidiness
    mean = trace.count * of * (0.25 + 1.9 * untidy if trace.mess else 1.0)
    return int(mean) + int(ctx.chance(mean - int(mean)))


def _leave(ctx: Context, tops: Tops, trace: Trace) -> None:
    """One of it, if there is a place for it."""
    asset = ctx.pick(trace.role, avoid=())
    if asset is None or not tops.allows(asset, trace.most):
        return
    if trace.on:
        _lay_on(ctx, tops, trace, asset)
    elif trace.wall is not None:
        z = min(trace.wall, ctx.space.height - 0.1) - asset.size[2]
        hanging = Hanging(asset, z, "left", asset.object_class, margin=0.012)
        if hang_first(ctx, hanging, _wall_spots(ctx, trace, asset)) is not None:
            tops.alike[asset.object_class] += 1
    elif _put_down(ctx, trace, asset):
        tops.alike[asset.object_class] += 1


def _lay_on(ctx: Context, tops: Tops, trace: Trace, asset: Asset) -> None:
    """On one of the carriers it may lie on: the nearest ones where it keeps close to something, else any."""
    carriers = [t for t in ctx.things if _is(t, trace.on) and t.asset.surfaces]
    if not carriers:
        return
    carriers = [carriers[int(k)] for k in ctx.rng.permutation(len(carriers))[:6]] if not trace.near else carriers
    if anchors := [t for t in ctx.things if _is(t, trace.near)]:
        carriers.sort(key=lambda t: min(math.hypot(t.x - a.x, t.y - a.y) for a in anchors) + 0.5 * ctx.rng.random())
    for carrier in carriers[:3]:
        boards = [main_board(carrier)]
        if carrier.asset.object_class in (*SHELVES, "shoe rack"):
            found = [Board(carrier, s) for s in carrier.asset.surfaces]
            boards = [found[int(k)] for k in ctx.rng.permutation(len(found))[:4]]
        for board in boards:
            if tops.put_in_gap(asset, board, trace.spot, trace.turn, size=_fitting(asset, board)) is not None:
                return


def _fitting(asset: Asset, board: Board) -> tuple[float, float, float] | None:
    """The size of cloth and boxes that come in the size of what they lie on; None for what keeps its own."""
    x0, x1, y0, y1 = board.area
    w, d, h = asset.size
    if asset.object_class == "duvet":
        return min(w, 0.96 * (x1 - x0)), min(d, 0.7 * (y1 - y0)), h
    if asset.object_class not in CUT_TO_FIT:
        return None
    shrink = min(1.0, 0.92 * (x1 - x0) / w, 0.96 * (y1 - y0) / d, 0.92 * board.headroom / h)
    return (shrink * w, shrink * d, shrink * h) if shrink > 0.55 else None


def _is(thing: Thing, names: tuple[str, ...]) -> bool:
    return thing.role in names or thing.asset.object_class in names


def _wall_spots(ctx: Context, trace: Trace, asset: Asset) -> Iterator[Spot]:
    """Spots on the walls: beside what it keeps close to, the nearest first, else about the middles of free walls."""
    anchors = [t for t in ctx.things if _is(t, trace.near)]
    if not anchors:
        yield from along_stretches(longest_first(ctx.space), lambda: ctx.rng.uniform(0.12, 0.88, 5).tolist())
        return
    spots: list[tuple[float, int, float]] = []
    for k, wall in enumerate(ctx.space.walls):
        for n in range(int(wall.length / 0.12)):
            x, y = wall.point(0.06 + 0.12 * n, asset.size[1] / 2)
            away = min(math.hypot(x - t.x, y - t.y) for t in anchors)
            if away < 1.6:
                spots.append((away + 0.25 * ctx.rng.random(), k, 0.06 + 0.12 * n))
    for _, k, s in sorted(spots):
        yield ctx.space.walls[k], s


def _put_down(ctx: Context, trace: Trace, asset: Asset) -> bool:
    """On the floor: at a wall close to something, or anywhere out of the way."""
    w, d = asset.size[:2]
    anchors = [t for t in ctx.things if _is(t, trace.near)]
    if trace.near and not anchors:
        return False
    turn = float(ctx.rng.uniform(-trace.turn, trace.turn))
    poses: list[ScoredPose]
    if anchors:

        def close(wall: Wall, s: float) -> float:
            x, y = wall.point(s, d / 2)
            return -min(math.hypot(x - t.x, y - t.y) for t in anchors) + 0.3 * ctx.rng.random()

        reach = abs(math.cos(turn)) * w + abs(math.sin(turn)) * d
        back = (abs(math.sin(turn)) * w + abs(math.cos(turn)) * d) / 2
        poses = wall_poses(ctx.space, reach, score=close, step=0.12)
        item = Item(asset, 0.0, -back, turn, role=asset.object_class, aside=True)
    else:

        def aside(x: float, y: float, yaw: float) -> float:
            return min(door_distance(ctx.space, x, y), 1.5) - _to_furniture(ctx, x, y) + 0.8 * ctx.rng.random()

        poses = floor_poses(ctx.space, score=aside, yaws=(turn,), step=0.35)
        item = Item(asset, role=asset.object_class, aside=True)
    free = ctx.space.walk.sum() * CELL**2
    likely = sorted(poses, key=lambda p: -p.score)[:24]
    chosen = [p for p in likely if ctx.space.taken(_where(item, p, ctx.space.bottom)) < min(LARGEST, 0.1 * free)]
    return ctx.put([item], chosen, "left") is not None


def _where(item: Item, pose: ScoredPose, z: float) -> Box:
    """The box of an arrangement's only item at a pose."""
    w, d, h = item.extent
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return box(pose.x - s * item.y, pose.y + c * item.y, w, d, pose.yaw + item.yaw, z, z + h)


def _to_furniture(ctx: Context, x: float, y: float) -> float:
    """Distance to the nearest thing that stands, metres."""
    return min((math.hypot(x - t.x, y - t.y) for t in ctx.things if t.parent is None), default=0.0)
