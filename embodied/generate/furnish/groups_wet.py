"""Rooms with water: baths, basins, toilets."""

from __future__ import annotations

from assets.records import Asset
from embodied.generate.furnish.arrange import WALL_GAP, Item, Thing, wall_poses
from embodied.generate.furnish.context import Context, at_corner, at_window, centred, door_distance
from embodied.generate.furnish.space import Wall


def toilet(ctx: Context) -> list[Thing] | None:
    """A toilet with paper beside it and a brush."""
    tiny = ctx.space.area < 3.0
    asset = ctx.pick("toilet", most=(0.42, 0.6, 1.2)) if tiny else ctx.pick("toilet")
    if asset is None:
        return None
    w, d = asset.size[:2]
    paper, brush = ctx.pick("toilet paper holder"), ctx.pick("toilet brush")
    sign = 1 if ctx.chance(0.5) else -1
    found = None
    for margin, clear in ((0.2, 0.55), (0.12, 0.4), (0.05, 0.3)):
        items = [Item(asset, 0.0, -d / 2 + WALL_GAP - 0.002, clear=clear, role="toilet")]
        if paper is not None:
            items.append(
                Item(
                    paper,
                    sign * (w / 2 + 0.08 + paper.size[0] / 2),
                    WALL_GAP - paper.size[1] / 2,
                    z=0.62,
                    optional=True,
                    role="toilet paper holder",
                )
            )
        if brush is not None:
            items.append(
                Item(
                    brush,
                    -sign * (w / 2 + 0.06 + brush.size[0] / 2),
                    -brush.size[1] / 2 - 0.02,
                    optional=True,
                    role="toilet brush",
                )
            )

        def score(wall: Wall, s: float) -> float:
            x, y = wall.point(s, 0.4)
            return (
                (1.2 if tiny else 0.4) * door_distance(ctx.space, x, y)
                - 0.5 * at_window(wall, s, w)
                + 0.4 * ctx.rng.random()
            )

        found = ctx.put(items, wall_poses(ctx.space, w + 2 * margin, score=score, step=0.15), "toilet", tries=40)
        if found:
            return found
    return found


def basin(ctx: Context, role: str = "wash place") -> list[Thing] | None:
    """A basin or vanity, with a mirror above it where it has none of its own."""
    limits = [(1.0, 0.6, 0.55), (0.62, 0.5, 0.55), (0.62, 0.5, 0.4), (0.62, 0.48, 0.25)]
    if ctx.space.area > 5:
        limits = [(1.95, 0.75, 0.6), (1.1, 0.75, 0.6), *limits]
    for width, depth, free in limits:
        for name in (role, "wall washbasin"):
            asset = ctx.pick(name, most=(width, depth, 2.3))
            if asset is None:
                continue
            items = _basin_items(ctx, asset, free)
            w = items[0].extent[0]

            def score(wall: Wall, s: float, w: float = w) -> float:
                return 0.5 * centred(wall, s) - 1.5 * at_window(wall, s, w) + 0.5 * ctx.rng.random()

            found = ctx.put(items, wall_poses(ctx.space, w + 0.04, step=0.15, score=score), "washing", tries=40)
            if found:
                return found
    return None


def _basin_items(ctx: Context, asset: Asset, free: float) -> list[Item]:
    """The basin with a mirror and a lamp above it; `free` metres stay clear before it."""
    w, d, h = asset.size
    if ctx.space.area < 3.0 and d > 0.35:
        w, d, h = 0.8 * w, 0.8 * d, 0.8 * h
    z = 0.0
    if asset.support == "wall":
        z = 0.86 - h if h < 0.6 else 0.3
    items = [Item(asset, 0.0, -d / 2 + WALL_GAP - 0.002, z=z, size=(w, d, h), clear=free, role="basin")]
    mirror = ctx.pick("mirror", most=(1.2, 0.2, 1.4))
    if mirror is None or z + h >= 1.2:
        return items
    wide = min(max(0.75 * w, 0.45), 1.1)
    size = (wide, mirror.size[1], wide if "round" in mirror.tags else 0.8)
    items.append(Item(mirror, 0.0, WALL_GAP - size[1] / 2, z=1.2, size=size, optional=True, role="mirror"))
    lamp = ctx.pick("wall lamp", most=(0.6, 0.3, 0.6))
    if lamp is not None and ctx.chance(0.5):
        x, y = size[0] / 2 + 0.08 + lamp.size[0] / 2, WALL_GAP - lamp.size[1] / 2
        items.append(Item(lamp, x, y, z=1.55, optional=True, role="wall lamp"))
    return items


def bathroom_fixtures(ctx: Context) -> None:
    """Bath or shower, toilet and basin; in later attempts the bath takes what the others leave."""
    area = ctx.space.area
    first = "bathtub" if area > 4.6 and ctx.chance(0.7 - 0.25 * ctx.attempt) else "shower"
    vanity = "double vanity" if area > 9 and ctx.chance(0.5) else "wash place" if ctx.attempt < 2 else "small basin"

    def some_bath() -> list[Thing] | None:
        return bathing(ctx, first) or bathing(ctx, "shower") or bathing(ctx, "bathtub")

    done = some_bath() if ctx.attempt < 2 else None
    toilet(ctx)
    basin(ctx, vanity)
    done = done or some_bath()
    if done and area > 6.5 and first == "bathtub":
        bathing(ctx, "shower")


def bathing(ctx: Context, role: str) -> list[Thing] | None:
    """A bath along a wall or a shower in a corner, with a mat before it."""
    for _ in range(3):
        asset = ctx.pick(role, most=(1.9, 1.7, ctx.space.height))
        if asset is None:
            return None
        w, d, h = asset.size
        mat = ctx.pick("bath mat")
        items = [
            Item(asset, 0.0, -d / 2 + WALL_GAP - 0.002, clear=0.5 if ctx.attempt < 2 else 0.3, role=asset.object_class)
        ]
        if mat is not None:
            items.append(Item(mat, 0.0, -d - 0.08 - mat.size[1] / 2, optional=True, role="bath mat"))

        def score(wall: Wall, s: float, w: float = w, h: float = h) -> float:
            return (
                2.0 * at_corner(wall, s, w) - (0.2 if h < 1.2 else 3.0) * at_window(wall, s, w) + 0.4 * ctx.rng.random()
            )

        found = ctx.put(items, wall_poses(ctx.space, w, score=score), "bathing", tries=40)
        if found:
            return found
    return None
