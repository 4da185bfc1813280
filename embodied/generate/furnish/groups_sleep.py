"""Sleeping and dressing: beds with what flanks them, wardrobes, dressers, closets."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from assets.records import Asset
from embodied.generate.furnish.arrange import RUG_HEIGHT, Item, Thing, wall_poses
from embodied.generate.furnish.context import (
    Context,
    Liking,
    at_corner,
    at_window,
    centred,
    depth_before,
    has_window,
    wobble,
)
from embodied.generate.furnish.space import Wall
from embodied.house.house import Opening


def double_bed(ctx: Context) -> list[Thing] | None:
    """A wide bed, headboard at the wall, flanked by bedside tables with lamps."""
    for limit in (9.0, 1.75, 1.5):
        bed = ctx.pick("big bed", least=(1.3, 1.7, 0.0), most=(limit, 2.5, 1.6), avoid=())
        if bed is None:
            continue
        for flank in (2, 1):
            found = _bed(ctx, bed, flank)
            if found:
                return found
    return None


def single_bed(ctx: Context, role: str = "single bed") -> list[Thing] | None:
    """A narrow bed against a wall, in a corner where possible, with one bedside table."""
    for widest in (1.25, 1.25, 1.5):
        bed = ctx.pick(role, most=(widest, 2.7, 2.2))
        if bed is None:
            continue
        found = _bed(ctx, bed, 1 if bed.size[2] < 1.3 else 0, corner=1.0)
        if found:
            return found
    return None


def _bed(ctx: Context, bed: Asset, flank: int, corner: float = -0.6) -> list[Thing] | None:
    rng = ctx.rng
    roomy = ctx.space.area > 13
    w, d = bed.size[:2]
    night = ctx.pick("bedside table", most=(0.65, 0.6, 0.8), avoid=()) if flank else None
    lamp = ctx.pick("table lamp", most=(0.42, 0.42, 0.75))
    items = [Item(bed, 0.0, -d / 2, role="bed")]
    signs = (1, -1) if ctx.chance(0.5) else (-1, 1)
    span = w
    if night is not None:
        for n, sign in enumerate(signs):
            x = sign * (w / 2 + 0.05 + night.size[0] / 2)
            must = n < flank
            items.append(
                Item(
                    night,
                    x,
                    -night.size[1] / 2,
                    clear=0.45 if w > 1.2 else 0.0,
                    optional=not must,
                    role="bedside table",
                )
            )
            if lamp is not None:
                items.append(Item(lamp, 0.0, 0.06, on=len(items) - 1, role="table lamp"))
        span = w + flank * (night.size[0] + 0.05)
    shift = 0.0 if flank != 1 or night is None else -signs[0] * (span - w) / 2
    rug = ctx.pick("carpet")
    if rug is not None and ctx.chance(0.6):
        size = (w + (1.1 if w > 1.2 else 0.9), rng.uniform(1.2, 1.6), RUG_HEIGHT)
        items.append(Item(rug, 0.0, -d * 0.72, size=size, optional=True, role="rug"))
    bench = ctx.pick("bench", most=(w, 0.5, 0.6))
    if bench is not None and w > 1.4 and ctx.chance(0.3):
        items.append(Item(bench, 0.0, -d - 0.05 - bench.size[1] / 2, optional=True, role="bench"))

    def score(wall: Wall, s: float) -> float:
        free_side = depth_before(ctx.space, wall, s) - d
        doors = sum(abs((s0 + s1) / 2 - s) < w / 2 + 0.4 for s0, s1, o in _facing_doors(ctx, wall))
        return (
            -1.6 * at_window(wall, s, w)
            + (corner if roomy else abs(corner)) * at_corner(wall, s, span)
            + (0.8 if roomy else 0.1) * centred(wall, s)
            + 0.5 * min(free_side, 1.2)
            - 0.8 * doors
            + 0.4 * rng.random()
        )

    items = [i if i.on is not None else replace(i, x=i.x + shift) for i in items]
    poses = wall_poses(ctx.space, span, score=score)
    return ctx.put(items, poses, "sleeping", tries=40)


def _facing_doors(ctx: Context, wall: Wall) -> Iterator[tuple[float, float, Opening]]:
    """Doors on the opposite wall, as (from, to, opening) measured along `wall`."""
    for other in ctx.space.walls:
        if other.inward[0] * wall.inward[0] + other.inward[1] * wall.inward[1] > -0.9:
            continue
        for s0, s1, o in other.openings:
            if o.kind == "window":
                continue
            a, b = other.point(s0), other.point(s1)
            spans = sorted(
                (p[0] - wall.start[0]) * wall.along[0] + (p[1] - wall.start[1]) * wall.along[1] for p in (a, b)
            )
            yield spans[0], spans[1], o


def wardrobe(ctx: Context) -> list[Thing] | None:
    """A wardrobe in a corner of an inner wall, away from the window."""
    for limit in (9.0, 1.8, 1.2):
        asset = ctx.pick("wardrobe", most=(limit, 0.75, ctx.space.height - 0.05), avoid=())
        liking = Liking(corner=0.8, window=-3.0, more=lambda w, s: -0.7 * has_window(w))
        found = ctx.against_wall(asset, "wardrobe", liking=liking, clear=0.65, tries=36)
        if found:
            return found
    return None


def wardrobe_unless_closet(ctx: Context) -> list[Thing] | None:
    """A wardrobe; every other main bedroom of a house with a closet does without, if all else finds its place."""
    does_without = not ctx.attempt and "closet" in ctx.kinds and ctx.kind == "main_bedroom" and ctx.chance(0.5)
    return None if does_without else wardrobe(ctx)


def dresser(ctx: Context) -> list[Thing] | None:
    """A chest of drawers or dressing table on a free wall."""
    role = "dressing table" if ctx.kind == "main_bedroom" and ctx.chance(0.35) else "dresser"
    asset = ctx.pick(role)

    def extra(a: Asset) -> list[Item]:
        if role != "dressing table":
            return []
        stool = ctx.pick("stool", most=(0.5, 0.5, 0.6))
        if stool is None:
            return []
        return [
            Item(
                stool,
                wobble(ctx.rng, 3),
                -a.size[1] - 0.1,
                wobble(ctx.rng, 20),
                optional=True,
                under=(0,),
                role="stool",
            )
        ]

    return ctx.against_wall(asset, "dressing", liking=Liking(corner=0.1, centre=0.5, window=-0.4), extra=extra)


def bedroom_chair(ctx: Context) -> list[Thing] | None:
    """A chair in a corner, for clothes and for reading."""
    chair = ctx.pick("armchair", most=(0.95, 0.95, 1.2)) or ctx.pick("side chair")
    if chair is None:
        return None
    items = [Item(chair, 0.0, -chair.size[1] / 2 - 0.1, wobble(ctx.rng, 20), role="armchair")]
    return ctx.put(
        items,
        wall_poses(
            ctx.space,
            chair.size[0] + 0.2,
            score=lambda w, s: (
                at_corner(w, s, chair.size[0] + 0.2) + 0.6 * at_window(w, s, 1.0) + 0.4 * ctx.rng.random()
            ),
        ),
        "chair",
        tries=24,
    )


def clothes(ctx: Context) -> list[Thing] | None:
    """A rack, wardrobe or shelves of a walk-in closet."""
    roles = ("wardrobe", "clothes rack", "shelving unit", "dresser")
    for k in ctx.rng.permutation(len(roles)):
        for widest in (2.2, 1.05):
            asset = ctx.pick(roles[int(k)], most=(widest, 0.7, ctx.space.height - 0.05), avoid=())
            liking = Liking(corner=0.6, window=-2.0)
            found = ctx.against_wall(asset, "clothes", liking=liking, clear=0.45, role="storage", tries=36)
            if found:
                return found
    return None


def cot(ctx: Context) -> list[Thing] | None:
    """A crib or cradle."""
    return ctx.against_wall(ctx.pick("baby bed"), "sleeping", liking=Liking(corner=0.8), clear=0.5, role="bed")


def toys(ctx: Context) -> list[Thing] | None:
    """A rug with toys about it, beside a wall or in the middle."""
    rng = ctx.rng
    rug = ctx.pick("round rug") if ctx.chance(0.4) else ctx.pick("carpet")
    big = ctx.pick("big toy")
    items = []
    width, depth = 1.5, 1.2
    if rug is not None:
        if "round" in rug.object_class:
            width = depth = 1.3
        items.append(Item(rug, 0.0, -depth / 2 - 0.15, size=(width, depth, RUG_HEIGHT), role="rug"))
    if big is not None:
        items.append(
            Item(big, rng.uniform(-0.3, 0.3), -big.size[1] / 2 - 0.06, wobble(rng, 12), optional=True, role="toy")
        )
    for _ in range(int(rng.integers(2, 5))):
        toy = ctx.pick("floor toy", avoid=tuple(i.asset.key for i in items))
        if toy is not None:
            z = RUG_HEIGHT if rug is not None else 0.0
            items.append(
                Item(
                    toy,
                    rng.uniform(-0.45, 0.45) * width * 0.8,
                    -rng.uniform(0.35, 0.9) * depth,
                    rng.uniform(-math.pi, math.pi),
                    z=z,
                    optional=True,
                    role="toy",
                )
            )
    if not items:
        return None
    return ctx.put(
        items,
        wall_poses(ctx.space, width, score=lambda w, s: 0.5 * at_window(w, s, width) + ctx.rng.random()),
        "play",
        tries=16,
    )


def child_table(ctx: Context) -> list[Thing] | None:
    """A small table with small chairs."""
    table, chair = ctx.pick("child table"), ctx.pick("child chair", most=(0.4, 0.4, 0.7))
    if table is None or chair is None:
        return None
    w, d = table.size[:2]
    items = [Item(table, 0.0, -d / 2 - 0.35, wobble(ctx.rng, 6), role="child table")]
    for sign in (-1, 1):
        x = sign * (w / 2 + chair.size[1] / 2 + 0.01)
        items.append(
            Item(
                chair,
                x,
                -d / 2 - 0.35,
                -sign * math.pi / 2 + wobble(ctx.rng, 15),
                under=(0,),
                optional=True,
                role="child chair",
            )
        )
    return ctx.put(
        items,
        wall_poses(ctx.space, w + 0.9, score=lambda wall, s: 0.6 * at_window(wall, s, w) + ctx.rng.random()),
        "play_table",
        tries=20,
    )
