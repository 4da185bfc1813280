"""Living, dining and sitting: seating before a television or fire, tables with their chairs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from assets.records import Asset
from embodied.generate.furnish.arrange import RUG_HEIGHT, Item, Thing, facing_point, floor_poses, wall_poses
from embodied.generate.furnish.context import (
    Context,
    Liking,
    at_window,
    centred,
    depth_before,
    door_distance,
    has_door,
    window_distance,
    wobble,
)
from embodied.generate.furnish.space import Wall


@dataclass(frozen=True)
class Suite:
    """What a seating group is made of."""

    stand: Asset
    """A bench for the screen, or a fireplace."""
    screen: Asset | None
    sofa: Asset
    table: Asset | None
    chair: Asset | None
    lamp: Asset | None
    side: Asset | None
    """A side table."""

    @property
    def has_fire(self) -> bool:
        return self.stand.object_class in ("fireplace", "wood stove")


def seating(ctx: Context) -> list[Thing] | None:
    """Sofa before a television or a fireplace, over a coffee table on a rug."""
    fire = ctx.kind in ("living_room", "library") and ctx.chance(0.25)
    heart = ctx.pick("fire") if fire else None
    tall = ctx.pick("media unit", most=(2.2, 0.75, 1.7)) if ctx.chance(0.15) else None  # holds no screen
    stand = heart or tall or ctx.pick("tv bench", most=(2.2, 0.7, 1.0))
    if stand is None:
        return None
    screen = None
    if heart is None and stand.size[2] < 1.0 and ctx.chance(0.92):
        fits = (max(stand.size[0] - 0.05, 0.6), 0.5, 1.2)
        screen = ctx.pick("television", least=(0.7, 0, 0), most=fits) or ctx.pick("television", most=fits)
    for rich in (2, 1, 0):
        for sofa in (ctx.pick("sofa", least=(1.5, 0, 0)), ctx.pick("sofa", most=(1.95, 1.0, 1.2))):
            if sofa is None:
                continue
            suite = Suite(
                stand,
                screen,
                sofa,
                table=ctx.pick("coffee table", most=(1.6, 1.0, 0.6)),
                chair=ctx.pick("easy chair", most=(1.1, 1.1, 1.2)),
                lamp=ctx.pick("floor lamp") if ctx.chance(0.6) else None,
                side=ctx.pick("side table"),
            )
            for distance, shift in _distances(ctx, stand, sofa):
                items = _seating_items(ctx, suite, distance, shift, rich)

                def score(wall: Wall, s: float, distance: float = distance) -> float:
                    return _screen_score(ctx, wall, s, distance, stand.size[0])

                found = ctx.put(items, wall_poses(ctx.space, stand.size[0], score=score), "seating", tries=14)
                if found:
                    return found
    return None


def _distances(ctx: Context, stand: Asset, sofa: Asset) -> list[tuple[float, float]]:
    """Sensible distances from the screen's wall to the back of the sofa, and shifts of the sofa aside."""
    # from 1.5 m (a small screen) to 3.6 m between the screen and who looks at it
    depths = sorted(
        {round(depth_before(ctx.space, w, w.length / 2), 2) for w in ctx.space.walls if w.length > stand.size[0]}
    )
    near = stand.size[1] + 1.55 + sofa.size[1]
    far = stand.size[1] + 3.6 + sofa.size[1]
    at_wall = [d - 0.04 for d in depths if near <= d - 0.04 <= far]
    floating = [d for d in (near + 1.0, near + 0.5) if d < max(depths, default=0.0) - 0.75]
    found = [*at_wall, *floating] or [d - 0.04 for d in depths if d > near - 0.5][:2]
    return [(d, shift) for shift in (0.0, 0.35, -0.35) for d in found]


def _screen_score(ctx: Context, wall: Wall, s: float, distance: float, width: float) -> float:
    depth = depth_before(ctx.space, wall, s)
    back_to_wall = abs(depth - 0.04 - distance) < 0.03
    value = 1.2 * centred(wall, s) - 1.5 * at_window(wall, s, width + 0.4) - 0.4 * has_door(wall)
    return value + 1.5 * back_to_wall - (3.0 if depth < distance - 0.02 else 0.0) + 0.3 * ctx.rng.random()


def _seating_items(ctx: Context, suite: Suite, distance: float, shift: float, rich: int) -> list[Item]:
    """The arrangement in the frame of the screen's wall.

    Args:
      distance: of the sofa's back from the wall, metres.
      shift: of the sofa and what goes with it aside, metres.
      rich: 0 for what must be, 1 with a chair and side tables, 2 with two chairs.
    """
    stand, sofa, side, lamp = suite.stand, suite.sofa, suite.side, suite.lamp
    width, depth = sofa.size[:2]
    front = -(distance - depth)
    fixed = [Item(stand, 0.0, -stand.size[1] / 2, role="fireplace" if suite.has_fire else "tv stand")]
    items = [Item(sofa, 0.0, -(distance - depth / 2), math.pi, role="sofa")]
    if suite.screen is not None:
        items.append(Item(suite.screen, 0.0, 0.0, on=0, role="television"))
    if suite.table is not None:
        items += _before_the_sofa(ctx, suite, suite.table, front, rich)
    sign = 1 if ctx.chance(0.5) else -1
    if side is not None and rich >= 1:
        x = sign * (width / 2 + 0.06 + side.size[0] / 2)
        items.append(Item(side, x, front - 0.35, math.pi, optional=True, role="side table"))
        table_lamp = ctx.pick("table lamp", most=(0.5, 0.5, 0.9))
        if table_lamp is not None and ctx.chance(0.7):
            items.append(Item(table_lamp, 0.0, 0.0, on=len(items), role="table lamp"))
    if lamp is not None:
        x = -sign * (width / 2 + 0.08 + lamp.size[0] / 2)
        items.append(Item(lamp, x, front - depth + lamp.size[1] / 2 + 0.05, math.pi, optional=True, role="floor lamp"))
    return [*fixed, *(i if i.on is not None else replace(i, x=i.x + shift) for i in items)]


def _before_the_sofa(ctx: Context, suite: Suite, table: Asset, front: float, rich: int) -> list[Item]:
    """The coffee table on its rug and a chair or two at its sides, where there is depth enough for them."""
    rng, width, chair = ctx.rng, suite.sofa.size[0], suite.chair
    y = front + 0.4 + table.size[1] / 2
    if -y - table.size[1] / 2 - suite.stand.size[1] <= 0.7:
        return []
    items = [Item(table, 0.0, y, math.pi + wobble(rng, 2), role="coffee table", optional=rich < 1)]
    rug = ctx.pick("carpet")
    if rug is not None and ctx.chance(0.85):
        room = -front - suite.stand.size[1] - 0.3
        size = (min(width + rng.uniform(0.1, 0.5), 3.2), min(rng.uniform(1.7, 2.1), room), RUG_HEIGHT)
        items.append(Item(rug, 0.0, front - 0.25 + size[1] / 2, 0.0, size=size, optional=True, role="rug"))
    if chair is not None and rich >= 1:
        count = 2 if rich == 2 and ctx.chance(0.6) else 1
        reach = max(table.size[0] / 2 + 0.45, width / 2 - 0.25) + chair.size[1] / 2
        sides = [1, -1] if ctx.chance(0.5) else [-1, 1]
        for sign in sides[:count]:
            cx, cy = sign * reach, y + 0.25 + rng.uniform(-0.1, 0.15)
            yaw = facing_point(cx, cy, 0.0, y - 0.1) + wobble(rng, 8)
            items.append(Item(chair, cx, cy, yaw, optional=True, role="armchair"))
    return items


def sofa_group(ctx: Context) -> list[Thing] | None:
    """Where no screen can be seen from a sofa: a sofa at a wall with a table and a chair or two."""
    for role, longest in (("corner sofa", 3.5), ("sofa", 2.4), ("sofa", 1.8)):
        sofa, table = ctx.pick(role, most=(longest, 1.9, 1.2)), ctx.pick("coffee table", most=(1.3, 0.8, 0.6))
        if sofa is None or table is None or (role == "corner sofa" and ctx.space.area < 20):
            continue
        items = _sofa_items(ctx, sofa, table)

        def score(wall: Wall, s: float, w: float = sofa.size[0]) -> float:
            return 1.2 * centred(wall, s) + 0.4 * ctx.rng.random() - 0.5 * at_window(wall, s, w)

        found = ctx.put(items, wall_poses(ctx.space, sofa.size[0], score=score), "seating", tries=40)
        if found:
            return found
    return None


def _sofa_items(ctx: Context, sofa: Asset, table: Asset) -> list[Item]:
    """A sofa with its back at the wall, a table on a rug before it and chairs at the table's sides."""
    chair, rug = ctx.pick("easy chair", most=(1.0, 1.0, 1.2)), ctx.pick("carpet")
    w, d = sofa.size[:2]
    y = -d - 0.4 - table.size[1] / 2
    items = [
        Item(sofa, 0.0, -d / 2, role="sofa"),
        Item(table, 0.0, y, wobble(ctx.rng, 2), optional=True, role="coffee table"),
    ]
    if rug is not None:
        items.append(Item(rug, 0.0, y + 0.15, size=(w + 0.3, 1.6, RUG_HEIGHT), optional=True, role="rug"))
    if chair is None:
        return items
    for sign in (-1, 1):
        x = sign * (table.size[0] / 2 + 0.45 + chair.size[1] / 2)
        yaw = facing_point(x, y - 0.1, 0.0, y) + wobble(ctx.rng, 10)
        items.append(Item(chair, x, y - 0.1, yaw, optional=True, role="armchair"))
    return items


def lone_sofa(ctx: Context) -> list[Thing] | None:
    """Where no group fits: a sofa at a wall, with a table before it if there is room."""
    for longest in (2.3, 1.9, 1.75):
        sofa, table = ctx.pick("sofa", most=(longest, 1.0, 1.2)), ctx.pick("coffee table", most=(1.2, 0.7, 0.6))
        if sofa is not None and table is not None:
            w, d = sofa.size[:2]
            items = [
                Item(sofa, 0.0, -d / 2, role="sofa"),
                Item(table, 0.0, -d - 0.38 - table.size[1] / 2, wobble(ctx.rng, 2), role="coffee table"),
            ]
            found = ctx.put(items, wall_poses(ctx.space, w + 0.1, score=lambda wall, s: centred(wall, s)), "seating")
            if found:
                return found
    for longest in (2.3, 1.9, 1.75):
        sofa = ctx.pick("sofa", most=(longest, 1.0, 1.2))
        found = ctx.against_wall(sofa, "seating", liking=Liking(centre=0.5, window=-0.3), clear=0.5, role="sofa")
        if found:
            return found
    x0, y0, x1, y1 = ctx.space.polygon.bounds
    sofa = ctx.pick("sofa", most=(1.9, 1.0, 1.2))
    if sofa is None:
        return None
    poses = floor_poses(
        ctx.space,
        score=lambda x, y, yaw: -math.hypot(x - (x0 + x1) / 2, y - (y0 + y1) / 2),
        yaws=(0.0, math.pi / 2, math.pi, -math.pi / 2),
        step=0.2,
    )
    return ctx.put([Item(sofa, 0.0, 0.0, clear=0.4, role="sofa")], poses, "seating")


def conversation(ctx: Context, chair_role: str = "easy chair") -> list[Thing] | None:
    """Two chairs turned to one another over a small table."""
    chair = ctx.pick(chair_role, most=(1.1, 1.1, 1.3))
    table = ctx.pick("side table") or ctx.pick("coffee table", most=(0.9, 0.9, 0.6))
    if chair is None or table is None:
        return None
    width, depth = chair.size[:2]
    half = table.size[0] / 2 + 0.12
    items = [
        Item(chair, -(half + width / 2), -depth / 2 - 0.08, -math.radians(-14) + wobble(ctx.rng, 5), role="armchair"),
        Item(chair, half + width / 2, -depth / 2 - 0.08, math.radians(-14) + wobble(ctx.rng, 5), role="armchair"),
        Item(table, 0.0, -table.size[1] / 2 - 0.1, role="side table"),
    ]
    lamp = ctx.pick("table lamp", most=(0.45, 0.45, 0.9))
    if lamp is not None and ctx.chance(0.6):
        items.append(Item(lamp, on=2, role="table lamp"))
    total = 2 * (half + width) + 0.1

    def score(wall: Wall, s: float) -> float:
        x, y = wall.point(s, 0.6)
        return 0.6 * at_window(wall, s, total) + centred(wall, s) - 0.25 * window_distance(ctx.space, x, y)

    return ctx.put(items, wall_poses(ctx.space, total, score=score), "conversation", tries=25)


def reading_corner(ctx: Context) -> list[Thing] | None:
    """A chair in a corner with a lamp behind it, near a window."""
    chair = ctx.pick("reading chair", most=(1.1, 1.7, 1.2))
    lamp = ctx.pick("floor lamp")
    table = ctx.pick("side table", most=(0.6, 0.6, 0.8))
    if chair is None:
        return None
    w, d = chair.size[:2]
    side = 1 if ctx.chance(0.5) else -1
    angle = math.radians(22)
    span = w + 0.5
    items = [Item(chair, 0.0, -d / 2 - 0.14, -side * angle, role="armchair")]
    if lamp is not None:
        items.append(
            Item(
                lamp,
                side * (w / 2 + 0.14 + lamp.size[0] / 2),
                -lamp.size[1] / 2 - 0.03,
                optional=True,
                role="floor lamp",
            )
        )
    if table is not None:
        items.append(
            Item(
                table,
                -side * (w / 2 + 0.12 + table.size[0] / 2),
                -table.size[1] / 2 - 0.1,
                optional=True,
                role="side table",
            )
        )

    def score(wall: Wall, s: float) -> float:
        x, y = wall.point(s, 0.5)
        at_side = (s if side > 0 else wall.length - s) < span / 2 + 0.06 and wall.corners[0 if side > 0 else 1]
        return 1.5 * at_side - 0.3 * window_distance(ctx.space, x, y) + 0.4 * ctx.rng.random()

    return ctx.put(items, wall_poses(ctx.space, span, score=score), "reading", tries=25)


def dining(
    ctx: Context, table_role: str = "dining table", chair_role: str = "dining chair", most: float = 2.5
) -> list[Thing] | None:
    """A table with chairs in pairs around it, tucked in and a little askew; at a wall where it must be small."""
    limits = [most, *(m for m in (1.75, 1.45, 1.15, 0.85) if m < most)]
    for pairs in (True, False):
        for limit in limits:
            table = ctx.pick(table_role, least=(min(0.7 * limit, 1.4), 0, 0.6), most=(limit, 1.25, 0.95), avoid=())
            table = table or ctx.pick(table_role, most=(limit, 1.25, 0.95), avoid=())
            chair = ctx.pick(chair_role, most=(0.62, 0.72, 1.25))
            if table is not None and chair is not None:
                found = _dining(ctx, table, chair, pairs, at_wall=limit < 1.5)
                if found:
                    return found
    return None


def _dining(ctx: Context, table: Asset, chair: Asset, pairs: bool, at_wall: bool) -> list[Thing] | None:
    """The table free on the floor or, failing that, at a wall."""
    free = table_items(ctx, table, chair, pairs=pairs)
    poses = floor_poses(ctx.space, score=lambda x, y, yaw: _table_score(ctx, x, y, yaw), yaws=(0.0, math.pi / 2))
    found = ctx.put(free, poses, "dining", tries=24)
    if found or not at_wall:
        return found
    poses = wall_poses(ctx.space, table.size[0] + 0.3, score=lambda w, s: _table_wall_score(ctx, w, s, table))
    return ctx.put(table_items(ctx, table, chair, wall=True, pairs=pairs), poses, "dining", tries=24)


def _table_score(ctx: Context, x: float, y: float, yaw: float) -> float:
    x0, y0, x1, y1 = ctx.space.polygon.bounds
    along_long = (x1 - x0 >= y1 - y0) == (abs(math.cos(yaw)) > 0.5)
    centre = math.hypot(x - (x0 + x1) / 2, y - (y0 + y1) / 2)
    if ctx.kind == "dining_room":
        return -centre + 0.4 * along_long
    near = window_distance(ctx.space, x, y)
    return (
        0.3 * along_long
        - 0.25 * abs(near - 1.4)
        - 0.1 * centre
        + 0.15 * min(door_distance(ctx.space, x, y), 2.0)
        + 0.3 * ctx.rng.random()
    )


def _table_wall_score(ctx: Context, wall: Wall, s: float, table: Asset) -> float:
    return 0.8 * at_window(wall, s, table.size[0]) + 0.5 * centred(wall, s) + 0.4 * ctx.rng.random()


def table_items(ctx: Context, table: Asset, chair: Asset, *, wall: bool = False, pairs: bool = True) -> list[Item]:
    """Table (at the origin, or with its back to the wall at y = 0) and its chairs.

    Args:
      pairs: whether it must have chairs on both of its free sides.
    """
    w, d = table.size[:2]
    items = [Item(table, 0.0, -d / 2 if wall else 0.0, role="dining table")]
    rug = ctx.pick("carpet")
    if rug is not None and not wall and ctx.kind in ("dining_room", "living_room") and ctx.chance(0.55):
        items.append(Item(rug, 0.0, 0.0, size=(w + 1.3, d + 1.3, RUG_HEIGHT), optional=True, role="rug"))
    if ("round" in table.tags or abs(w - d) < 0.08) and not wall:
        return items + _chairs_around(ctx, table, chair)
    return items + _chairs_along(ctx, table, chair, wall=wall, pairs=pairs)


def _tuck(chair: Asset) -> float:
    """How far a chair goes under its table, metres."""
    width, depth = chair.size[:2]
    return 0.0 if "arms" in chair.tags or width > 0.495 else min(0.18, depth * 0.3)  # wide chairs have arms


def _chairs_around(ctx: Context, table: Asset, chair: Asset) -> list[Item]:
    """Chairs about a round or square table, on a circle."""
    rng, is_round = ctx.rng, "round" in table.tags
    w, tuck = table.size[0], _tuck(chair)
    count = 4 if w > 0.75 else 2
    start = rng.uniform(0, math.pi) if is_round else 0.0
    items = []
    for k in range(count):
        angle = start + 2 * math.pi * k / count
        r = w / 2 + chair.size[1] / 2 - tuck * (0.8 if is_round else 1.0) + _pulled(rng)
        x, y = r * math.cos(angle), r * math.sin(angle)
        yaw = facing_point(x, y, 0, 0) + wobble(rng, 9)
        items.append(Item(chair, x, y, yaw, under=(0,), optional=k > 1, role="dining chair"))
    return items


def _chairs_along(ctx: Context, table: Asset, chair: Asset, *, wall: bool, pairs: bool) -> list[Item]:
    """Chairs along the sides of a table, and now and then at its ends."""
    rng, tuck = ctx.rng, _tuck(chair)
    (w, d), (cw, cd) = table.size[:2], chair.size[:2]
    y0 = -d / 2 if wall else 0.0
    items = []
    per_side = max(1, int((w - 0.06) / max(cw + 0.12, 0.6)))
    for sign in (-1,) if wall else (-1, 1):
        for k in range(per_side):
            x = (k + 0.5) * (w / per_side) - w / 2
            y = y0 + sign * (d / 2 + cd / 2 - tuck + _pulled(rng))
            yaw = (0.0 if sign > 0 else math.pi) + wobble(rng, 7)
            spare = k > 0 or (sign > 0 and not pairs)
            items.append(Item(chair, x, y, yaw, under=(0,), clear=-0.3, optional=spare, role="dining chair"))
    if d > 0.7 and (wall or w > 1.35) and ctx.chance(0.6):
        for sign in (-1, 1):
            x = sign * (w / 2 + cd / 2 - tuck + _pulled(rng))
            yaw = -sign * math.pi / 2 + wobble(rng, 7)
            items.append(Item(chair, x, y0, yaw, under=(0,), clear=-0.25, optional=True, role="dining chair"))
    return items


def _pulled(rng: np.random.Generator) -> float:
    """How far a chair was left pulled out, metres: mostly not at all."""
    return float(rng.uniform(0.12, 0.3)) if rng.random() < 0.12 else float(rng.uniform(0.0, 0.06))


def low_table_seat(ctx: Context) -> list[Thing] | None:
    """Garden furniture indoors: a sofa, two chairs and a low table (sun rooms)."""
    sofa, chair = ctx.pick("sun sofa", most=(1.9, 1.0, 1.2)), ctx.pick("sun seat", most=(1.0, 1.0, 1.2))
    table = ctx.pick("sun table", most=(1.3, 0.8, 0.8))
    if sofa is None or chair is None or table is None:
        return None
    d = sofa.size[1]
    y = -d - 0.4 - table.size[1] / 2
    items = [Item(sofa, 0.0, -d / 2 - 0.02, role="sofa"), Item(table, 0.0, y, wobble(ctx.rng, 3), role="coffee table")]
    for sign in (-1, 1):
        x = sign * (max(table.size[0], 0.9) / 2 + 0.35 + chair.size[1] / 2)
        items.append(
            Item(chair, x, y, facing_point(x, y, 0.0, y) + wobble(ctx.rng, 10), optional=True, role="armchair")
        )
    return ctx.put(
        items,
        wall_poses(
            ctx.space,
            sofa.size[0] + 0.1,
            score=lambda w, s: centred(w, s) + 0.8 * at_window(w, s, 1.5) + 0.3 * ctx.rng.random(),
        ),
        "seating",
        tries=30,
    )
