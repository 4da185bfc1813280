"""Working, storing and playing: desks, shelves, laundry, workshop, gym, hall."""

from __future__ import annotations

import math
from typing import Unpack

from assets.records import Asset
from embodied.generate.furnish.arrange import RUG_HEIGHT, Item, ScoredPose, Thing, floor_poses, wall_poses
from embodied.generate.furnish.context import Context, Liking, at_corner, at_window, centred, door_distance, wobble
from embodied.generate.furnish.space import Wall
from embodied.generate.furnish.stock import AssetLimits, Size


def desk(ctx: Context) -> list[Thing] | None:
    """A desk at a wall or window with its chair, lamp and computer."""
    kid = ctx.kind == "kids_room"
    small = ctx.kind in ("bedroom", "guest_room", "main_bedroom")
    for limit in ((1.3 if small else 2.0), 1.25, 1.05):
        asset = ctx.pick(
            "writing desk",
            most=(limit, 0.95, 1.5),
            where=(lambda a: "child" in a.tags) if kid else (lambda a: "child" not in a.tags),
        )
        asset = asset or ctx.pick("desk", most=(limit, 0.95, 1.5))
        chair = ctx.pick("office chair", where=lambda a: ("child" in a.tags) == kid) or ctx.pick("dining chair")
        if asset is None or chair is None:
            continue
        items, w = _desk_items(ctx, asset, chair), asset.size[0]

        def score(wall: Wall, s: float, w: float = w) -> float:
            liking = 0.9 * at_window(wall, s, w) + 0.4 * at_corner(wall, s, w) + 0.3 * centred(wall, s)
            return liking + 0.5 * ctx.rng.random()

        found = ctx.put(items, wall_poses(ctx.space, w, score=score), "desk", tries=36)
        if found:
            return found
    return None


def _desk_items(ctx: Context, asset: Asset, chair: Asset) -> list[Item]:
    """The desk with its back at the wall, the chair before it, computer and lamp on it."""
    w, d = asset.size[:2]
    items = [
        Item(asset, 0.0, -d / 2, role="desk"),
        Item(
            chair,
            wobble(ctx.rng, 5),
            -d - chair.size[1] / 2 - 0.03,
            math.pi + wobble(ctx.rng, 20),
            under=(0,),
            clear=-0.2,
            role="desk chair",
        ),
    ]
    computer = ctx.pick("laptop") if ctx.chance(0.75) else ctx.pick("computer", most=(0.6, 0.5, 0.6))
    if computer is not None:
        back = min(d / 2 - computer.size[1] / 2 - 0.04, 0.08)
        y = max(back, computer.size[1] / 2 + 0.13 - d / 2)
        items.append(Item(computer, 0.0, y, wobble(ctx.rng, 5), on=0, role="computer"))
    lamp = ctx.pick("desk lamp")
    if lamp is not None:
        sign = 1 if ctx.chance(0.5) else -1
        items.append(Item(lamp, sign * w * 0.36, d * 0.2, wobble(ctx.rng, 20), on=0, role="desk lamp"))
    return items


def bookshelf(ctx: Context) -> list[Thing] | None:
    """A bookcase on a free wall, beside the last one where there is one."""
    before = ctx.roles("bookcase")
    same = before[-1].asset if before and ctx.chance(0.7) else None
    asset = same or ctx.pick(
        "bookcase" if ctx.kind in ("library", "study") else "book storage",
        least=(0, 0, 1.0),
        most=(2.0, 0.6, ctx.space.height - 0.05),
    )

    def beside(wall: Wall, s: float) -> float:
        if not before:
            return 0.0
        x, y = wall.point(s, 0.2)
        near = min(math.hypot(x - t.x, y - t.y) - t.size[0] / 2 for t in before)
        return 1.2 if near < (asset.size[0] / 2 + 0.1 if asset else 0.0) else 0.0

    liking = Liking(corner=0.5, window=-3.0, more=beside)
    return ctx.against_wall(asset, "bookcase", liking=liking, clear=0.5, tries=36)


def storage(ctx: Context, role: str, *, clear: float = 0.6, **limits: Unpack[AssetLimits]) -> list[Thing] | None:
    """One piece of storage or a machine at a wall."""
    limits.setdefault("most", (2.6, 0.8, ctx.space.height - 0.03))
    asset = ctx.pick(role, **limits)
    low = asset is not None and asset.size[2] < 0.95
    return ctx.against_wall(
        asset,
        "storage",
        liking=Liking(corner=0.4, centre=0.3, window=-0.3 if low else -3.0),
        clear=clear,
        role=asset.object_class if asset else "",
        tries=30,
    )


def corner_plant(ctx: Context) -> list[Thing] | None:
    """A plant in a corner near a window."""
    asset = ctx.pick("plant" if ctx.chance(0.85) else "floor decoration", most=(1.1, 1.1, 2.0))
    if asset is None:
        return None
    w, d = asset.size[:2]
    items = [
        Item(asset, 0.0, -d / 2 - 0.04, ctx.rng.uniform(-math.pi, math.pi) if abs(w - d) < 0.03 else 0.0, role="plant")
    ]

    def score(wall: Wall, s: float) -> float:
        x, y = wall.point(s, d / 2)
        near = min((math.hypot(x - wx, y - wy) for wx, wy in _window_points(ctx)), default=3.0)
        return 2.0 * at_corner(wall, s, w + 0.06) - 0.35 * near + 0.3 * ctx.rng.random()

    return ctx.put(items, wall_poses(ctx.space, w + 0.06, score=score), "plant", tries=20)


def _window_points(ctx: Context) -> list[tuple[float, float]]:
    return [
        wall.point((s0 + s1) / 2)
        for wall in ctx.space.walls
        for s0, s1, o in wall.openings
        if o.kind in ("window", "french_window")
    ]


def corner_thing(ctx: Context, role: str, **limits: Unpack[AssetLimits]) -> list[Thing] | None:
    """A small thing that stands in a corner or at a wall: bin, basket, ladder, broom."""
    asset = ctx.pick(role, **limits)
    if asset is None:
        return None
    liking = Liking(corner=1.0, window=-0.2)
    return ctx.against_wall(asset, "corner", liking=liking, clear=0.0, role=asset.object_class, tries=24)


def beside(ctx: Context, role: str, anchors: tuple[str, ...], **limits: Unpack[AssetLimits]) -> list[Thing] | None:
    """A small thing on the floor close to one that stands already: a bin beside the desk."""
    asset = ctx.pick(role, **limits)
    targets = ctx.roles(*anchors)
    if asset is None or not targets:
        return None
    w, d = asset.size[:2]

    def score(wall: Wall, s: float) -> float:
        x, y = wall.point(s, d / 2)
        return -min(math.hypot(x - t.x, y - t.y) for t in targets)

    poses = wall_poses(ctx.space, w, score=score, step=0.1)
    return ctx.put([Item(asset, 0.0, -d / 2, role=asset.object_class)], poses, "beside", tries=16)


def in_the_open(ctx: Context, role: str, *, clear: float = 0.5, group: str = "machine") -> list[Thing] | None:
    """A machine or game table that stands free or at a wall."""
    asset = ctx.pick(role, most=(3.0, 3.0, 2.3))
    if asset is None:
        return None
    w, d = asset.size[:2]
    if w * d > 2.0:
        c = ctx.space.polygon.centroid
        return ctx.put(
            [Item(asset, role=asset.object_class)],
            floor_poses(
                ctx.space,
                yaws=(0.0, math.pi / 2),
                score=lambda x, y, yaw: -math.hypot(x - c.x, y - c.y) + 0.3 * ctx.rng.random(),
            ),
            group,
            tries=50,
        )
    liking = Liking(corner=0.1, centre=0.2, window=0.1, gap=0.06)
    return ctx.against_wall(asset, group, liking=liking, clear=clear, role=asset.object_class, tries=36)


def machines(ctx: Context) -> list[Thing] | None:
    """Washing machine and dryer side by side."""
    washer, dryer = ctx.pick("washing machine"), ctx.pick("tumble dryer")
    if washer is None:
        return None
    items = [Item(washer, 0.0, -washer.size[1] / 2, clear=0.6, role="washing machine")]
    if dryer is not None and ctx.kind == "laundry_room":
        x = (washer.size[0] + dryer.size[0]) / 2 + 0.02
        items.append(Item(dryer, x, -dryer.size[1] / 2, clear=0.6, optional=True, role="tumble dryer"))
        items = [Item(i.asset, i.x - x / 2, i.y, clear=i.clear, optional=i.optional, role=i.role) for i in items]
    span = 1.25 if len(items) > 1 else washer.size[0]
    return ctx.put(
        items,
        wall_poses(
            ctx.space,
            span,
            score=lambda w, s: at_corner(w, s, span) - 0.3 * at_window(w, s, span) + 0.3 * ctx.rng.random(),
        ),
        "laundry",
        tries=30,
    )


def workbench(ctx: Context) -> list[Thing] | None:
    """A bench to work at, with its tools near it."""
    return ctx.against_wall(ctx.pick("workbench"), "workbench", liking=Liking(centre=0.6, window=0.4), clear=0.8)


def console(ctx: Context) -> list[Thing] | None:
    """A narrow table on the wall of a hall."""
    deep = 0.62 if ctx.space.area > 6 else 0.42
    asset = ctx.pick("console table", most=(1.6, deep, 1.1)) or ctx.pick("display storage", most=(1.7, deep, 1.3))
    return ctx.against_wall(asset, "console", liking=Liking(corner=0.0, centre=0.6))


def hall_bench(ctx: Context) -> list[Thing] | None:
    """A bench to put on shoes, near the front door, with shoes beside it."""
    asset = ctx.pick("bench", most=(1.4, 0.5, 0.9)) or ctx.pick("stool", most=(0.6, 0.6, 0.6))

    def near_door(wall: Wall, s: float) -> float:
        x, y = wall.point(s)
        return -0.5 * door_distance(ctx.space, x, y)

    liking = Liking(centre=0.3, window=-0.5, more=near_door)
    return ctx.against_wall(asset, "entry", liking=liking, clear=0.4, role="bench")


def doormat(ctx: Context) -> list[Thing] | None:
    """A mat inside the front or back door."""
    asset = ctx.pick("doormat")
    if asset is None:
        return None
    d = asset.size[1]
    for wall in ctx.space.walls:
        for s0, s1, o in wall.openings:
            if o.kind in ("front_door", "back_door"):
                x, y = wall.point((s0 + s1) / 2, 0.12)
                return ctx.put(
                    [Item(asset, 0.0, -d / 2, passage=True, role="doormat")],
                    [ScoredPose(0.0, x, y, wall.yaw, wall)],
                    "entry",
                )
    return None


def runner(ctx: Context) -> list[Thing] | None:
    """A long rug down the middle of a corridor or hall."""
    rug = ctx.pick("carpet")
    if rug is None:
        return None
    length, width, _ = _sides(ctx)
    size = (min(length - 0.8, 4.0), min(max(width - 0.4, 0.5), 0.9), RUG_HEIGHT)
    if size[0] < 0.9 or size[1] > width - 0.1:
        return None
    return _in_the_middle(ctx, rug, size, "runner")


def middle_rug(ctx: Context) -> list[Thing] | None:
    """A rug in the middle of a room that has none."""
    rug = ctx.pick("carpet")
    if rug is None or ctx.roles("rug"):
        return None
    long, short, _ = _sides(ctx)
    return _in_the_middle(ctx, rug, (min(0.55 * long, 2.6), min(0.5 * short, 1.8), RUG_HEIGHT), "rug")


def _sides(ctx: Context) -> tuple[float, float, bool]:
    """Longer and shorter side of the floor, metres, and whether the longer one runs along x."""
    x0, y0, x1, y1 = ctx.space.polygon.bounds
    return max(x1 - x0, y1 - y0), min(x1 - x0, y1 - y0), x1 - x0 >= y1 - y0


def _in_the_middle(ctx: Context, rug: Asset, size: Size, group: str) -> list[Thing] | None:
    """A rug in the middle of the floor, its width along the longer side."""
    c = ctx.space.polygon.centroid
    pose = ScoredPose(0.0, c.x, c.y, 0.0 if _sides(ctx)[2] else math.pi / 2)
    return ctx.put([Item(rug, size=size, passage=True, role="rug")], [pose], group)
