"""Kitchens: lines of units with sink, cooker and fridge, cabinets above them, islands."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from embodied.assets.records import Asset
from embodied.generate.furnish.arrange import Item, ScoredPose, wall_poses
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.groups import put_group
from embodied.generate.furnish.likes import at_corner
from embodied.generate.furnish.space import RoomSpace, Thing, Wall, box

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


@dataclass(frozen=True)
class UnitSlot:
    """One module of a run of units."""

    kind: str
    """'sink', 'cooker' or 'base'."""
    units: int
    s: float
    """Of its middle along the wall, metres."""


@dataclass(frozen=True)
class UnitLine:
    """A run of units along a wall, before it is known what stands in it."""

    kit: KitchenSet
    wall: Wall
    width: float
    """Of one unit, metres."""
    free: float
    """Depth that stays free before the units, metres."""

    @property
    def windows(self) -> list[tuple[float, float]]:
        """(from, to) along the wall, metres."""
        return [(s0, s1) for s0, s1, o in self.wall.openings if o.kind == "window"]


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
    cookers = list(of("cooker")) or [a for a in ctx.stock.of_role("cooker") if a.size[0] < 0.7]
    cooker = cookers[int(ctx.rng.integers(len(cookers)))] if cookers else None
    hob = None
    unit = 0.6 if min(a.size[0] for a in base) > 0.5 else 0.488
    if cooker is None:
        hob = ctx.pick("cooktop", most=(0.6, 0.56, 0.1), avoid=())
        cooker = next((a for a in base if a.object_class == "base cabinet" and a.size[0] > 0.55), base[0])
    hood = ctx.pick("range hood", where=lambda a: tag in a.tags, avoid=()) or ctx.pick("range hood", avoid=())
    depth = max(a.size[1] for a in (*base, sinks[0]))
    return KitchenSet(unit, base, sink=sinks[0], cooker=cooker, hob=hob, upper=upper, hood=hood, depth=depth)


def free_runs(space: RoomSpace, wall: Wall, depth: float, height: float) -> list[tuple[float, float]]:
    """Stretches of a wall along which a thing `depth` deep and `height` tall may stand, metres."""
    step, start = 0.05, None
    runs: list[tuple[float, float]] = []
    count = int(wall.length / step)
    for i in range(count + 1):
        x, y = wall.point((i + 0.5) * step, depth / 2 + 0.005)
        free = i < count and space.fits(box(x, y, step, depth, wall.yaw, space.bottom, space.bottom + height))
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


def kitchen_line(ctx: Context) -> bool:
    """The line of units and the fridge; in some later attempts the fridge chooses its place first."""
    if first := ctx.attempt in (3, 5):
        _lone_fridge(ctx)
    has_line = _line(ctx, fridge=not first)
    if not ctx.roles("fridge"):
        _lone_fridge(ctx)
    return has_line


def _line(ctx: Context, fridge: bool) -> bool:
    """One run of units with sink, cooker and fridge, wall cabinets above; a second run in large kitchens.

    Args:
      fridge: whether the kitchen still needs one.
    """
    kits = kitchen_sets(ctx)
    for with_fridge in (True, False) if fridge else (False,):
        for clear, spare, aside in ((0.6, 1, 0.0), (0.5, 0, 0.0), (0.35, 0, 0.0), (0.5, 0, 0.2), (0.5, 0, 0.4)):
            line = _line_at_a_wall(ctx, kits, with_fridge, clear, spare, aside)
            if line is None:
                continue
            kit, things = line
            if fridge and not with_fridge and not _tall_block(ctx, kit, things):
                _lone_fridge(ctx)
            _more_runs(ctx, kit, list(things))
            return True
    return False


def _line_at_a_wall(
    ctx: Context, kits: list[KitchenSet], with_fridge: bool, clear: float, spare: int, aside: float
) -> tuple[KitchenSet, tuple[Thing, ...]] | None:
    """The first kit that finds a wall; `aside` metres of it stay free at one end or both, for a door beside it."""
    ends = ((aside, 0.0), (0.0, aside), (aside, aside)) if aside else ((0.0, 0.0),)
    for kit in kits:
        for wall, a, b in _best_runs(ctx, kit):
            for left, right in ends:
                things = _run(ctx, kit, wall, a + left, b - right, with_fridge, clear, spare)
                if things:
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


def _fridge(ctx: Context, widest: float) -> Asset | None:
    """A fridge as tall as people are, if there is one; at most so wide, metres."""
    most = (widest, 1.0, 2.1)
    return ctx.pick("fridge", most=most, least=(0.0, 0.0, 1.5), avoid=()) or ctx.pick("fridge", most=most, avoid=())


def _tall_block(ctx: Context, kit: KitchenSet, done: Sequence[Thing]) -> tuple[Thing, ...]:
    """The fridge between tall cabinets or beside base units, on another stretch of wall than the line."""
    fridge = _fridge(ctx, 0.65)
    if fridge is None:
        return ()
    line = next((t for t in kit.sink.tags if t.startswith("line_")), "")
    tall = [a for a in ctx.stock.of_role("tall cabinet") if line in a.tags] or list(ctx.stock.of_role("tall cabinet"))
    low = [a for a in kit.base if kit.units(a) == 1]
    beside_low: list[tuple[list[Asset], list[Asset]]] = [(low[:1], []), ([], low[:1])]
    beside_tall: list[tuple[list[Asset], list[Asset]]] = [(tall[:1], tall[:1]), (tall[:1], [])] if tall else []
    blocks = beside_tall + beside_low if _has_worktop(done) else beside_low + beside_tall
    for left, right in blocks:
        row = [*left, fridge, *right]
        width = sum(a.size[0] for a in row) + 0.004 * (len(row) - 1)
        items, x = [], -width / 2
        for asset in row:
            role = "fridge" if asset is fridge else "counter" if asset in low else "tall cabinet"
            (w, d, _), looks = asset.size, ctx.looks(asset) if asset is fridge else ()
            items.append(Item(asset, x + w / 2, -d / 2, params=looks, clear=0.5, role=role))
            x += w + 0.004

        def near(wall: Wall, s: float, width: float = width) -> float:
            return -min(_gap(wall.point(s), t) for t in done) + 1.5 * at_corner(wall, s, width)

        poses = wall_poses(ctx.space, width, score=near, gap=0.005, step=0.1)
        things = ctx.put(items, [p for p in poses if not _darkens(p, width)], "kitchen", tries=40)
        if things:
            return things
    return ()


def _has_worktop(done: Sequence[Thing]) -> bool:
    return any(t.role == "counter" for t in done)


def _darkens(pose: ScoredPose, width: float) -> bool:
    """True if something tall and `width` wide would stand before a window there."""
    wall = pose.wall
    if wall is None:
        return False
    s = wall.along_of(pose.x, pose.y)
    return any(s - width / 2 < s1 and s0 < s + width / 2 for s0, s1, o in wall.openings if o.kind == "window")


def _lone_fridge(ctx: Context) -> None:
    """A fridge that found no place in the line: at its end if it can be, else anywhere at a wall."""
    slim = _fridge(ctx, 0.65)
    if slim is not None:
        for clear in (0.5, 0.35, 0.2):
            item = Item(slim, 0.0, -slim.size[1] / 2, params=ctx.looks(slim), clear=clear, role="fridge")
            if ctx.put([item], _line_ends(ctx, slim.size[0]), "kitchen"):
                return
    put_group(ctx, ctx.tables.groups["fridge"], "kitchen")


def _line_ends(ctx: Context, width: float) -> list[ScoredPose]:
    """Poses of something tall and `width` wide beside each unit on the floor."""
    poses = []
    for unit in ctx.roles("kitchen sink", "cooker", "counter", "base cabinet"):
        wall = unit.wall
        if wall is None or not _on_floor(ctx, unit):
            continue
        s = wall.along_of(unit.x, unit.y)
        for side in (-1, 1):
            at = s + side * (unit.size[0] + width + 0.008) / 2
            x, y = wall.point(at, 0.005)
            pose = ScoredPose(ctx.rng.random(), x, y, wall.yaw, wall)
            if width / 2 <= at <= wall.length - width / 2 and not _darkens(pose, width):
                poses.append(pose)
    return poses


def _run(
    ctx: Context, kit: KitchenSet, wall: Wall, a: float, b: float, with_fridge: bool, free: float, spare: int
) -> tuple[Thing, ...]:
    """Sink, cooker and at least `spare` cabinets between `a` and `b` of a wall, the fridge at an end without window.

    Args:
      free: depth that stays free before the units, metres.
    """
    need = kit.units(kit.sink) + (1 if kit.hob else kit.units(kit.cooker)) + spare
    small = 0.95 if b - a > 3.2 and ctx.space.area > 8 else 0.65
    fridge = _fridge(ctx, small) if with_fridge else None
    room = b - a - (fridge.size[0] + 0.02 if fridge else 0.0)
    count = min(int(room / kit.unit + 0.15), int(4.0 / kit.unit))
    if count < need:
        return ()
    line = UnitLine(kit, wall, min(max(room / count, 0.88 * kit.unit), 1.12 * kit.unit), free)
    for at_end in _fridge_ends(ctx, line.windows, a, b, fridge):
        start = a if at_end or fridge is None else a + fridge.size[0] + 0.02
        if at_end and fridge is not None:
            start = b - fridge.size[0] - 0.02 - count * line.width
        view = next(((s0 + s1) / 2 for s0, s1 in line.windows if a < (s0 + s1) / 2 < b), None)
        items = _run_items(ctx, line, _slots(ctx, line, count, start, view))
        if fridge is not None:
            s = (b - fridge.size[0] / 2 - 0.005) if at_end else (a + fridge.size[0] / 2 + 0.005)
            looks, clear = ctx.looks(fridge), free - 0.05
            items.append((s, Item(fridge, 0.0, -fridge.size[1] / 2, params=looks, clear=clear, role="fridge")))
        things = _put_line(ctx, wall, items)
        if things:
            return things
    return ()


def _fridge_ends(
    ctx: Context, windows: list[tuple[float, float]], a: float, b: float, fridge: Asset | None
) -> list[bool]:
    """True if the fridge goes to the end `b` of a run, in the order to try: to no end where it hides a window."""
    if fridge is None:
        return [False, True]
    span = fridge.size[0]
    clear = [
        all(s1 < a - 0.05 or s0 > a + span + 0.05 for s0, s1 in windows),
        all(s1 < b - span - 0.05 or s0 > b + 0.05 for s0, s1 in windows),
    ]
    ends = [at_end for at_end in (False, True) if clear[int(at_end)]]
    return ends[::-1] if ctx.chance(0.5) else ends


def _put_line(ctx: Context, wall: Wall, items: list[tuple[float, Item]]) -> tuple[Thing, ...]:
    """Put (s, item) at their places along a wall."""
    x, y = wall.point(0.0, 0.005)
    moved = [item if item.on is not None else replace(item, x=item.x - s) for s, item in items]
    return ctx.put(moved, [ScoredPose(0.0, x, y, wall.yaw, wall)], "kitchen")


def _slots(ctx: Context, line: UnitLine, count: int, start: float, view: float | None) -> list[UnitSlot]:
    """The modules of a run of `count` units from `start`: the sink before a window, the cooker at an arm's length."""
    kit, width = line.kit, line.width
    sink, cook = kit.units(kit.sink), 1 if kit.hob else kit.units(kit.cooker)
    best, i, j = -math.inf, 0, 0
    for at_sink in range(count - sink + 1):
        for at_cook in range(count - cook + 1):
            if at_sink < at_cook + cook and at_cook < at_sink + sink:
                continue
            ends = at_sink + sink if at_sink < at_cook else at_cook + cook
            gap = (max(at_sink, at_cook) - ends) * width
            value = -abs(gap - 0.9) if gap > 0 else -2.5
            if view is not None:
                value -= 2.0 * abs(start + (at_sink + sink / 2) * width - view)
            value -= 0.4 * (at_cook == 0 or at_cook + cook == count) + 0.2 * (at_sink == 0 or at_sink + sink == count)
            value += 0.3 * ctx.rng.random()
            if value > best:
                best, i, j = value, at_sink, at_cook
    slots = [("sink", i, sink), ("cooker", j, cook)]
    k = 0
    while k < count:
        if k == i:
            k += sink
        elif k == j:
            k += cook
        else:
            n = 2 if k + 1 < count and k + 1 not in (i, j) else 1
            slots.append(("base", k, n))
            k += n
    return [UnitSlot(kind, n, start + (first + n / 2) * width) for kind, first, n in sorted(slots, key=lambda s: s[1])]


def _run_items(ctx: Context, line: UnitLine, slots: list[UnitSlot]) -> list[tuple[float, Item]]:
    """(s, item) of all modules, the hob, the hood and the wall cabinets of a run."""
    items: list[tuple[float, Item]] = []
    for slot in slots:
        items += _base_items(ctx, line, slot, len(items))
    for slot in slots:
        half = slot.units * line.width / 2
        if not any(s0 - 0.02 < slot.s + half and slot.s - half < s1 + 0.02 for s0, s1 in line.windows):
            items += _hood(ctx, line, slot) if slot.kind == "cooker" else _upper_items(ctx, line, slot)
    return items


def _base_items(ctx: Context, line: UnitLine, slot: UnitSlot, first: int) -> list[tuple[float, Item]]:
    """The floor units of one module; `first` is the index that the first item will have."""
    kit = line.kit

    def unit(asset: Asset, s: float, w: float, role: str) -> tuple[float, Item]:
        size = (w, asset.size[1], asset.size[2])
        cornered = role == "counter" and (s - w / 2 < 0.12 or s + w / 2 > line.wall.length - 0.12)
        clear = 0.0 if cornered else line.free  # another run may meet it
        return s, Item(asset, 0.0, -asset.size[1] / 2, size=size, clear=clear, role=role)

    s, n = slot.s, slot.units
    if slot.kind == "sink":
        return [unit(kit.sink, s, n * line.width, "kitchen sink")]
    if slot.kind == "cooker":
        below = unit(kit.cooker, s, n * line.width, "base cabinet" if kit.hob else "cooker")
        return [below] if kit.hob is None else [below, (s, Item(kit.hob, on=first, role="cooker"))]
    wide = [a for a in kit.base if kit.units(a) == n]
    if wide and n > 1 and ctx.chance(0.7):
        return [unit(wide[0], s, n * line.width, "counter")]
    single = [a for a in kit.base if kit.units(a) == 1] or list(kit.base)
    places = (s + (k - (n - 1) / 2) * line.width for k in range(n))
    return [unit(single[int(ctx.rng.integers(len(single)))], at, line.width, "counter") for at in places]


def _hood(ctx: Context, line: UnitLine, slot: UnitSlot) -> list[tuple[float, Item]]:
    """The hood over the cooker, if the kit has one."""
    hood = line.kit.hood
    if hood is None:
        return []
    top = max(a.size[2] for a in line.kit.base)
    z = min(max(hood.elevation, top + 0.62), ctx.space.height - hood.size[2])
    size = (min(hood.size[0], slot.units * line.width), hood.size[1], hood.size[2])
    return [(slot.s, Item(hood, 0.0, -hood.size[1] / 2, z=z, size=size, optional=True, role="range hood"))]


def _upper_items(ctx: Context, line: UnitLine, slot: UnitSlot) -> list[tuple[float, Item]]:
    """The wall cabinets over one module: one of double width, or single ones."""
    upper, s, n, width = line.kit.upper, slot.s, slot.units, line.width
    if not upper:
        return []
    single = [a for a in upper if line.kit.units(a) == 1] or list(upper)
    pair = [a for a in upper if line.kit.units(a) == 2]
    if n == 2 and pair and ctx.chance(0.6):
        blocks = [(pair[0], s, n * width)]
    else:
        blocks = [(single[int(ctx.rng.integers(len(single)))], s + (k - (n - 1) / 2) * width, width) for k in range(n)]
    cabinets = []
    for asset, at, w in blocks:
        size = (w, asset.size[1], min(asset.size[2], ctx.space.height - UPPER - 0.02))
        item = Item(asset, 0.0, -asset.size[1] / 2, z=UPPER, size=size, optional=True, role="wall cabinet")
        cabinets.append((at, item))
    return cabinets


def _more_runs(ctx: Context, kit: KitchenSet, done: list[Thing]) -> None:
    """More cabinets, round the corner or opposite, until the kitchen has the worktop its size deserves."""
    there = sum(t.size[0] for t in done if t.role != "fridge" and _on_floor(ctx, t))
    want = min(max(0.36 * ctx.space.area, 2.4), 6.5) - there
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
            length = _add_run(ctx, kit, wall, a, b, want, done, least=2 if far and _has_worktop(done) else 1)
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
    most = min(int((b - a) / kit.unit + 0.1), max(round(want / kit.unit), 1), 5)
    for n in range(most, least - 1, -1):
        width = min((b - a) / n, kit.unit) - 0.002
        at = a + 0.004 if starts_at_a else b - 0.004 - n * width
        slots = [UnitSlot("base", 1, at + (k + 0.5) * width) for k in range(n)]
        things = _put_line(ctx, wall, _run_items(ctx, UnitLine(kit, wall, width, 0.55), slots))
        if things:
            done.extend(things)
            return n * width
    return 0.0
