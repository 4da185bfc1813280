"""Rooms with water: kitchen lines with sink, cooker and fridge; baths, basins, toilets."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from assets.records import Asset
from embodied.generate.furnish.arrange import WALL_GAP, Item, Pose, Thing, floor_poses, wall_poses
from embodied.generate.furnish.context import Context, at_corner, at_window, centred, door_distance
from embodied.generate.furnish.space import RoomSpace, Wall, box

UPPER = 1.45
"""Height of the underside of wall cabinets, metres: 0.5 above the worktop."""


@dataclass(frozen=True)
class KitchenSet:
    """Units that belong together; widths are multiples of `unit`, stretched a little to fill a wall."""

    unit: float
    base: tuple[Asset, ...]
    sink: Asset
    cooker: Asset
    hob: Asset | None
    """Lies on `cooker` where that is only a cabinet."""
    upper: tuple[Asset, ...]
    hood: Asset | None
    depth: float

    def units(self, asset: Asset) -> int:
        return max(1, round(asset.size[0] / self.unit))


def kitchen_sets(ctx: Context) -> list[KitchenSet]:
    """The matching sets of kitchen units in the catalogue, in random order."""
    tags = [t for a in ctx.stock.of_role("kitchen sink") for t in a.tags if t.startswith("line_")]
    tags = list(dict.fromkeys(tags)) or [""]
    sets = [_kitchen_set(ctx, tags[int(k)]) for k in ctx.rng.permutation(len(tags))]
    return [s for s in sets if s is not None]


def _kitchen_set(ctx: Context, tag: str) -> KitchenSet | None:
    def of(*classes: str) -> tuple[Asset, ...]:
        return tuple(a for c in classes for a in ctx.stock.of_role(c) if not tag or tag in a.tags)

    base, sinks = of("base cabinet", "drawer cabinet"), of("kitchen sink")
    upper = tuple(a for a in of("wall cabinet", "glass-door cabinet") if "over_hood" not in a.tags)
    if not base or not sinks:
        return None
    cookers = [a for a in of("cooker")] or [a for a in ctx.stock.of_role("cooker") if a.size[0] < 0.7]
    cooker = cookers[int(ctx.rng.integers(len(cookers)))] if cookers else None
    hob = None
    unit = 0.6 if min(a.size[0] for a in base) > 0.5 else 0.488
    if cooker is None:
        hob = ctx.pick("cooktop", most=(0.6, 0.56, 0.1), avoid=())
        cooker = next((a for a in base if a.object_class == "base cabinet" and a.size[0] > 0.55), base[0])
    hood = ctx.pick("range hood", where=lambda a: tag in a.tags, avoid=()) or ctx.pick("range hood", avoid=())
    return KitchenSet(unit, base, sinks[0], cooker, hob, upper, hood, max(a.size[1] for a in (*base, sinks[0])))


def free_runs(space: RoomSpace, wall: Wall, depth: float, height: float) -> list[tuple[float, float]]:
    """Stretches of a wall along which a thing `depth` deep and `height` tall may stand, metres."""
    step = 0.05
    runs: list[tuple[float, float]] = []
    start = None
    count = int(wall.length / step)
    for i in range(count + 1):
        free = False
        if i < count:
            x, y = wall.point((i + 0.5) * step, depth / 2 + 0.005)
            probe = box(x, y, step, depth, wall.yaw, space.bottom, space.bottom + height)
            free = space.fits(probe)
        if free and start is None:
            start = i * step
        if not free and start is not None:
            runs.append((_edge(space, wall, start, -1, depth, height), _edge(space, wall, i * step, 1, depth, height)))
            start = None
    return runs


def _edge(space: RoomSpace, wall: Wall, s: float, sign: int, depth: float, height: float) -> float:
    """The end of a free run, moved outwards by centimetres as far as it stays free."""
    for _ in range(5):
        x, y = wall.point(s + sign * 0.005, depth / 2 + 0.005)
        if not space.fits(box(x, y, 0.0098, depth, wall.yaw, space.bottom, space.bottom + height)):
            break
        s += sign * 0.01
    return min(max(s, 0.0), wall.length)


def kitchen_line(ctx: Context, fridge: bool = True) -> list[Thing] | None:
    """One run of units with sink, cooker and fridge, wall cabinets above; a second run in large kitchens.

    Args:
      fridge: whether the kitchen still needs one.
    """
    kits = kitchen_sets(ctx)
    for clear, spare, aside in ((0.6, 1, 0.0), (0.5, 0, 0.0), (0.35, 0, 0.0), (0.5, 0, 0.2), (0.5, 0, 0.4)):
        for with_fridge in (True, False) if fridge else (False,):
            found = _line_at_a_wall(ctx, kits, with_fridge, clear, spare, aside)
            if found is None:
                continue
            kit, things = found
            if fridge and not with_fridge:
                lone_fridge(ctx)
            _more_runs(ctx, kit, things)
            return things
    return None


def _line_at_a_wall(
    ctx: Context, kits: list[KitchenSet], with_fridge: bool, clear: float, spare: int, aside: float
) -> tuple[KitchenSet, list[Thing]] | None:
    """The first kit that finds a wall; `aside` metres of it stay free at one end or both, for a door beside it."""
    ends = ((aside, 0.0), (0.0, aside), (aside, aside)) if aside else ((0.0, 0.0),)
    for kit in kits:
        for wall, a, b in _best_runs(ctx, kit):
            for left, right in ends:
                things = _run(ctx, kit, wall, a + left, b - right, with_fridge, clear, spare)
                if things is not None:
                    return kit, things
    return None


def _best_runs(ctx: Context, kit: KitchenSet) -> list[tuple[Wall, float, float]]:
    runs = []
    for wall in ctx.space.walls:
        for a, b in free_runs(ctx.space, wall, kit.depth, 0.9):
            if b - a > 1.15:
                windows = sum(min(b, s1) - max(a, s0) > 0.5 for s0, s1, o in wall.openings if o.kind == "window")
                runs.append((min(b - a, 4.4) + 0.7 * windows + 0.4 * ctx.rng.random(), a, b, wall))
    return [(wall, a, b) for _, a, b, wall in sorted(runs, key=lambda r: -r[0])]


def lone_fridge(ctx: Context) -> list[Thing] | None:
    """A fridge that found no place in the line."""
    for width, clear in ((0.95 if ctx.space.area > 8 else 0.65, 0.6), (0.65, 0.4), (0.65, 0.2)):
        fridge = ctx.pick("fridge", most=(width, 1.0, 2.1), avoid=())
        found = ctx.against_wall(fridge, "kitchen", clear=clear, corner=0.8, window=-3.0, role="fridge")
        if found:
            return found
    return None


def _run(
    ctx: Context, kit: KitchenSet, wall: Wall, a: float, b: float, with_fridge: bool, free: float, spare: int
) -> list[Thing] | None:
    """Sink, cooker and at least `spare` cabinets between `a` and `b` of a wall, the fridge at an end without window.

    Args:
      free: depth that stays free before the units, metres.
    """
    need = kit.units(kit.sink) + (1 if kit.hob else kit.units(kit.cooker)) + spare
    small = 0.95 if b - a > 3.2 and ctx.space.area > 8 else 0.65
    fridge = ctx.pick("fridge", most=(small, 1.0, 2.1), avoid=()) if with_fridge else None
    room = b - a - (fridge.size[0] + 0.02 if fridge else 0.0)
    count = min(int(room / kit.unit + 0.15), int(4.0 / kit.unit))
    if count < need:
        return None
    width = min(max(room / count, 0.88 * kit.unit), 1.12 * kit.unit)
    windows = [(s0, s1) for s0, s1, o in wall.openings if o.kind == "window"]
    view = next(((s0 + s1) / 2 for s0, s1 in windows if a < (s0 + s1) / 2 < b), None)
    ends = [False, True]  # fridge at the end `b`?
    if fridge is not None:
        span = fridge.size[0]
        clear = [
            all(s1 < a - 0.05 or s0 > a + span + 0.05 for s0, s1 in windows),
            all(s1 < b - span - 0.05 or s0 > b + 0.05 for s0, s1 in windows),
        ]
        ends = [e for e in ends if clear[int(e)]]
        if ctx.chance(0.5):
            ends.reverse()
    for at_end in ends:
        start = a if at_end or fridge is None else a + fridge.size[0] + 0.02
        if at_end and fridge is not None:
            start = b - fridge.size[0] - 0.02 - count * width
        slots = _slots(ctx, kit, count, width, start, view)
        items = _run_items(ctx, kit, slots, width, windows, wall.length, free)
        if fridge is not None:
            s = (b - fridge.size[0] / 2 - 0.005) if at_end else (a + fridge.size[0] / 2 + 0.005)
            items.append((s, Item(fridge, 0.0, -fridge.size[1] / 2, clear=free - 0.05, role="fridge")))
        placed = [_moved(item, -s) for s, item in items]
        x, y = wall.point(0.0, 0.005)
        found = ctx.put(placed, [Pose(0.0, x, y, wall.yaw, wall)], "kitchen")
        if found:
            return found
    return None


def _moved(item: Item, x: float) -> Item:
    return item if item.on is not None else replace(item, x=item.x + x)


def _slots(ctx: Context, kit: KitchenSet, count: int, width: float, start: float, view: float | None):
    """(kind, first unit, units, s of its centre) for each module of a run."""
    sink, cook = kit.units(kit.sink), 1 if kit.hob else kit.units(kit.cooker)
    best = None
    for i in range(count - sink + 1):
        for j in range(count - cook + 1):
            if i < j + cook and j < i + sink:
                continue
            gap = (max(i, j) - (i + sink if i < j else j + cook)) * width
            value = -abs(gap - 0.9) if gap > 0 else -2.5
            if view is not None:
                value -= 2.0 * abs(start + (i + sink / 2) * width - view)
            value -= 0.4 * (j == 0 or j + cook == count) + 0.2 * (i == 0 or i + sink == count)
            value += 0.3 * ctx.rng.random()
            if best is None or value > best[0]:
                best = (value, i, j)
    _, i, j = best
    slots = [("sink", i, sink), ("cooker", j, cook)]
    k = 0
    while k < count:
        if k == i:
            k += sink
        elif k == j:
            k += cook
        else:
            n = 1
            while n < 2 and k + n < count and k + n not in (i, j):
                n += 1
            slots.append(("base", k, n))
            k += n
    return [(kind, first, n, start + (first + n / 2) * width) for kind, first, n in sorted(slots, key=lambda s: s[1])]


def _run_items(
    ctx: Context, kit: KitchenSet, slots, width: float, windows, length: float, free: float
) -> list[tuple[float, Item]]:
    """(s, item) of all modules, the hob, the hood and the wall cabinets of a run."""
    items: list[tuple[float, Item]] = []
    top = max(a.size[2] for a in kit.base)

    def unit(asset: Asset, s: float, w: float, role: str) -> None:
        size = (w, asset.size[1], asset.size[2])
        cornered = role == "counter" and (s - w / 2 < 0.12 or s + w / 2 > length - 0.12)  # another run may meet it
        items.append((s, Item(asset, 0.0, -asset.size[1] / 2, size=size, clear=0.0 if cornered else free, role=role)))

    for kind, _, n, s in slots:
        if kind == "sink":
            unit(kit.sink, s, n * width, "kitchen sink")
        elif kind == "cooker":
            unit(kit.cooker, s, n * width, "base cabinet" if kit.hob else "cooker")
            if kit.hob is not None:
                items.append((s, Item(kit.hob, 0.0, 0.0, on=len(items) - 1, role="cooker")))
        else:
            wide = [a for a in kit.base if kit.units(a) == n]
            if wide and n > 1 and ctx.chance(0.7):
                unit(wide[0], s, n * width, "counter")
            else:
                single = [a for a in kit.base if kit.units(a) == 1] or list(kit.base)
                for k in range(n):
                    asset = single[int(ctx.rng.integers(len(single)))]
                    unit(asset, s + (k - (n - 1) / 2) * width, width, "counter")
    for kind, _, n, s in slots:
        covered = any(s0 - 0.02 < s + n * width / 2 and s - n * width / 2 < s1 + 0.02 for s0, s1 in windows)
        if kind == "cooker":
            if kit.hood is not None and not covered:
                hood = kit.hood
                w = min(hood.size[0], n * width)
                z = min(max(hood.elevation, top + 0.62), ctx.space.height - hood.size[2])
                items.append(
                    (
                        s,
                        Item(
                            hood,
                            0.0,
                            -hood.size[1] / 2,
                            z=z,
                            size=(w, *hood.size[1:]),
                            optional=True,
                            role="range hood",
                        ),
                    )
                )
            continue
        if covered or not kit.upper:
            continue
        single = [a for a in kit.upper if kit.units(a) == 1] or list(kit.upper)
        pair = [a for a in kit.upper if kit.units(a) == 2]
        blocks = (
            [(pair[0], s, n * width)]
            if n == 2 and pair and ctx.chance(0.6)
            else [(single[int(ctx.rng.integers(len(single)))], s + (k - (n - 1) / 2) * width, width) for k in range(n)]
        )
        for asset, at, w in blocks:
            h = min(asset.size[2], ctx.space.height - UPPER - 0.02)
            items.append(
                (
                    at,
                    Item(
                        asset,
                        0.0,
                        -asset.size[1] / 2,
                        z=UPPER,
                        size=(w, asset.size[1], h),
                        optional=True,
                        role="wall cabinet",
                    ),
                )
            )
    return items


def _more_runs(ctx: Context, kit: KitchenSet, done: list[Thing]) -> None:
    """More cabinets, round the corner or opposite, until the kitchen has the worktop its size deserves."""
    want = min(max(0.36 * ctx.space.area, 2.4), 6.5) - sum(
        t.size[0] for t in done if t.role != "fridge" and _on_floor(ctx, t)
    )
    for _ in range(3):
        if want < 0.8 * kit.unit:
            return
        runs = []
        for wall in ctx.space.walls:
            for a, b in free_runs(ctx.space, wall, kit.depth, 0.9):
                if b - a > 0.95 * kit.unit:
                    near = min(_gap(wall.point(s), t) for t in done if _on_floor(ctx, t) for s in (a, b))
                    runs.append((near > 0.35, -min(b - a, want), a, b, wall))
        for far, _, a, b, wall in sorted(runs, key=lambda r: r[:2]):
            length = _add_run(ctx, kit, wall, a, b, want, done, least=2 if far else 1)
            if length:
                want -= length
                break
        else:
            return


def _on_floor(ctx: Context, thing: Thing) -> bool:
    return thing.z < ctx.space.bottom + 0.1


def _gap(point: tuple[float, float], thing: Thing) -> float:
    return math.hypot(thing.x - point[0], thing.y - point[1]) - thing.size[0] / 2


def _add_run(
    ctx: Context, kit: KitchenSet, wall: Wall, a: float, b: float, want: float, done: list[Thing], least: int
) -> float:
    """Cabinets along part of a..b, from the end that is nearer to what stands already; returns their length."""
    starts_at_a = min(_gap(wall.point(a), t) for t in done) <= min(_gap(wall.point(b), t) for t in done)
    windows = [(s0, s1) for s0, s1, o in wall.openings if o.kind == "window"]
    most = min(int((b - a) / kit.unit + 0.1), max(round(want / kit.unit), 1), 5)
    for n in range(most, least - 1, -1):
        width = min((b - a) / n, kit.unit) - 0.002
        at = a + 0.004 if starts_at_a else b - 0.004 - n * width
        slots = [("base", k, 1, at + (k + 0.5) * width) for k in range(n)]
        items = [_moved(i, -s) for s, i in _run_items(ctx, kit, slots, width, windows, wall.length, 0.55)]
        x, y = wall.point(0.0, 0.005)
        found = ctx.put(items, [Pose(0.0, x, y, wall.yaw, wall)], "kitchen")
        if found:
            done.extend(found)
            return n * width
    return 0.0


def island(ctx: Context) -> list[Thing] | None:
    """A kitchen island with stools, parallel to the line."""
    line = ctx.roles("kitchen sink", "counter")
    asset = ctx.pick("kitchen island")
    if asset is None or not line:
        return None
    face = line[0].yaw
    long_y = asset.size[1] > asset.size[0]
    stool = ctx.pick("bar stool", most=(0.6, 0.6, 1.2))
    w, d = (asset.size[1], asset.size[0]) if long_y else asset.size[:2]
    items = [Item(asset, 0.0, 0.0, math.pi / 2 if long_y else 0.0, role="kitchen island")]
    if stool is not None:
        count = max(1, int(w / 0.55))
        for k in range(count):
            x = (k + 0.5) * w / count - w / 2
            items.append(
                Item(
                    stool,
                    x,
                    -d / 2 - stool.size[1] / 2 + 0.05,
                    math.pi + float(ctx.rng.normal(0, 0.15)),
                    optional=True,
                    under=(0,),
                    role="bar stool",
                )
            )
    cx = sum(t.x for t in line) / len(line)
    cy = sum(t.y for t in line) / len(line)
    fx, fy = line[0].front

    def score(x: float, y: float, yaw: float) -> float:
        ahead = (x - cx) * fx + (y - cy) * fy
        aside = abs(-(x - cx) * fy + (y - cy) * fx)
        return -abs(ahead - (0.31 + 1.05 + d / 2)) - 0.5 * aside

    return ctx.put(items, floor_poses(ctx.space, score=score, yaws=(face,), step=0.2), "island", tries=20)


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
            w, d, h = asset.size
            if ctx.space.area < 3.0 and d > 0.35:
                w, d, h = 0.8 * w, 0.8 * d, 0.8 * h
            z = asset.elevation if asset.support == "wall" else 0.0
            if asset.support == "wall":
                z = 0.86 - h if h < 0.6 else 0.3
            items = [Item(asset, 0.0, -d / 2 + WALL_GAP - 0.002, z=z, size=(w, d, h), clear=free, role="basin")]
            top = z + h
            mirror = ctx.pick("mirror", most=(1.2, 0.2, 1.4))
            if mirror is not None and top < 1.2:
                wide = min(max(0.75 * w, 0.45), 1.1)
                size = (wide, mirror.size[1], wide if "round" in mirror.tags else 0.8)
                items.append(Item(mirror, 0.0, WALL_GAP - size[1] / 2, z=1.2, size=size, optional=True, role="mirror"))
                lamp = ctx.pick("wall lamp", most=(0.6, 0.3, 0.6))
                if lamp is not None and ctx.chance(0.5):
                    items.append(
                        Item(
                            lamp,
                            size[0] / 2 + 0.08 + lamp.size[0] / 2,
                            WALL_GAP - lamp.size[1] / 2,
                            z=1.55,
                            optional=True,
                            role="wall lamp",
                        )
                    )
            poses = wall_poses(
                ctx.space,
                w + 0.04,
                step=0.15,
                score=lambda wall, s, w=w: (
                    0.5 * centred(wall, s) - 1.5 * at_window(wall, s, w) + 0.5 * ctx.rng.random()
                ),
            )
            found = ctx.put(items, poses, "washing", tries=40)
            if found:
                return found
    return None


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
