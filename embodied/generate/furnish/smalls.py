"""Small things on tables, shelves and worktops, where people put them."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from assets.records import Asset, SupportSurface
from embodied.generate.furnish.arrange import Thing, same_box
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.looks import looks
from embodied.generate.furnish.recipes import CLUTTER, MOST_ALIKE, RECIPES
from embodied.generate.furnish.space import box, overlap

EDGE = 0.012
"""Free strip at the edge of a surface, metres."""
SEATS = {
    "sofa": (0.16, 0.36),
    "corner sofa": (0.3, 0.3),
    "armchair": (0.14, 0.34),
    "rattan sofa": (0.1, 0.3),
    "bed": (0.05, 0.24),
    "child bed": (0.05, 0.24),
    "day bed": (0.05, 0.24),
    "bunk bed": (0.1, 0.24),
    "lounge chair": (0.14, 0.4),
    "sofa bed": (0.16, 0.36),
}
"""Object class to the width of its arms in metres and the share of its depth that back or pillows take."""
BOWLS = ("bathtub", "corner bathtub", "washbasin", "wall washbasin", "shower", "kitchen sink")
"""Object classes whose middle is hollow: only their rims carry things."""


@dataclass
class Tops:
    """What already lies on the surfaces of one room."""

    ctx: Context
    taken: dict[tuple[int, str], list[tuple[float, float, float, float]]] = field(default_factory=dict)
    alike: Counter = field(default_factory=Counter)

    def start(self) -> None:
        """Take note of what the groups have put on surfaces."""
        for thing in self.ctx.things:
            self.alike[thing.asset.object_class] += 1
            if thing.parent is not None:
                self._occupy(thing)

    def _occupy(self, thing: Thing) -> None:
        parent = thing.parent
        dx, dy = thing.x - parent.x, thing.y - parent.y
        c, s = math.cos(parent.yaw), math.sin(parent.yaw)
        u, v = c * dx + s * dy, -s * dx + c * dy
        a, b = _reach(thing.size, thing.yaw - parent.yaw)
        key = (id(parent), thing.surface or "")
        self.taken.setdefault(key, []).append((u - a, v - b, u + a, v + b))

    def put(
        self,
        asset: Asset | None,
        parent: Thing,
        surface: SupportSurface,
        spot: str = "any",
        turn: float = 0.2,
        size: tuple[float, float, float] | None = None,
        tries: int = 7,
    ) -> Thing | None:
        """Rest `asset` on a surface of `parent`, near `spot`; None where there is no free place."""
        if asset is None:
            return None
        ctx, rng = self.ctx, self.ctx.rng
        kx, ky, kz = (a / b for a, b in zip(parent.size, parent.asset.size))
        x0, x1, y0, y1 = surface.x0 * kx, surface.x1 * kx, surface.y0 * ky, surface.y1 * ky
        if parent.asset.object_class in SEATS:  # keep off arms, back and pillows
            arm, back = SEATS[parent.asset.object_class]
            x0, x1 = max(x0, arm - parent.size[0] / 2), min(x1, parent.size[0] / 2 - arm)
            y1 = min(y1, (0.5 - back) * parent.size[1])
        w, d, h = size or asset.size
        if h > surface.headroom * kz - 0.01:
            return None
        key = (id(parent), surface.name)
        taken = self.taken.setdefault(key, [])
        z = parent.z + surface.z * kz
        if z + h > ctx.space.bottom + ctx.space.height:
            return None
        for _ in range(tries):
            yaw = float(rng.uniform(-turn, turn)) if turn < 3 else float(rng.uniform(-math.pi, math.pi))
            a, b = _reach((w, d, h), yaw)
            if 2 * a > x1 - x0 - 2 * EDGE or 2 * b > y1 - y0 - 2 * EDGE:
                yaw = 0.0
                a, b = w / 2, d / 2
                if 2 * a > x1 - x0 or 2 * b > y1 - y0:
                    return None
            u, v = _spot(spot, x0 + a + EDGE, x1 - a - EDGE, y0 + b + EDGE, y1 - b - EDGE, rng)
            if any(
                u - a < t[2] + 0.008 and u + a > t[0] - 0.008 and v - b < t[3] + 0.008 and v + b > t[1] - 0.008
                for t in taken
            ):
                continue
            x, y = parent.local(u, v)
            own = box(x, y, w, d, parent.yaw + yaw, z, z + h)
            support = parent.box
            if not ctx.space.inside(own) or any(overlap(own, q) and not same_box(q, support) for q in ctx.space.solids):
                continue
            thing = Thing(
                asset,
                x,
                y,
                z,
                parent.yaw + yaw,
                (w, d, h),
                looks(ctx, asset),
                parent,
                surface.name,
                parent.group,
                "small",
                None,
            )
            taken.append((u - a, v - b, u + a, v + b))
            self.alike[asset.object_class] += 1
            ctx.space.add([own])
            ctx.things.append(thing)
            ctx.stock.note([asset])
            return thing
        return None

    def allows(self, asset: Asset, most: int = 2) -> bool:
        """Whether the room may hold one more of its class, of which `most` are few."""
        return self.alike[asset.object_class] < max(MOST_ALIKE.get(asset.object_class, 2), most)


def _reach(size: tuple[float, float, float], yaw: float) -> tuple[float, float]:
    c, s = abs(math.cos(yaw)), abs(math.sin(yaw))
    return (c * size[0] + s * size[1]) / 2, (s * size[0] + c * size[1]) / 2


def _spot(spot: str, x0: float, x1: float, y0: float, y1: float, rng: np.random.Generator) -> tuple[float, float]:
    """A point of the rectangle near the named spot; the back is +y."""
    fx, fy = rng.random(), rng.random()
    if spot == "centre":
        fx, fy = 0.5 + 0.16 * (fx - 0.5), 0.5 + 0.16 * (fy - 0.5)
    elif spot == "back":
        fy = 1.0 - 0.25 * fy
    elif spot == "front":
        fy = 0.3 * fy
    elif spot == "side":
        fx = 0.12 * fx if fx < 0.5 else 1.0 - 0.12 * (1 - fx)
        fy = 0.4 + 0.6 * fy
    return x0 + fx * max(x1 - x0, 0.0), y0 + fy * max(y1 - y0, 0.0)


def clutter(ctx: Context) -> None:
    """Put the small things of daily life onto everything in the room that can carry them."""
    tops = Tops(ctx)
    tops.start()
    density = 1.3 - 0.75 * ctx.stock.style.tidiness
    carriers = [t for t in ctx.things if t.asset.surfaces and not _hollow(t.asset)]
    for thing in carriers:
        if thing.role == "dining table":
            _set_table(tops, thing)
    for name, recipe in RECIPES.items():
        group = [t for t in carriers if t.role == name or t.asset.object_class == name]
        if not group:
            continue
        for role, chance, spot, turn in recipe:
            repeats = 1 if name in ("counter",) else len(group)
            for k in range(repeats):
                if not ctx.chance(min(chance * (max(density, 0.9) if name == "counter" else density), 0.97)):
                    continue
                asset = ctx.pick(role, most=(1.2, 0.9, 0.9))
                if asset is None or not tops.allows(asset):
                    continue
                places = [group[k]] if repeats > 1 else [group[int(i)] for i in ctx.rng.permutation(len(group))[:3]]
                any(tops.put(asset, thing, _main(thing), spot, turn) for thing in places)
    for thing in carriers:
        _shelves(tops, thing, density)
    for thing in carriers:
        _more(tops, thing, density)


def _hollow(asset: Asset) -> bool:
    """Whether its one surface is the opening of a bowl rather than a rim."""
    return (
        asset.object_class in BOWLS
        and max((s.x1 - s.x0) * (s.y1 - s.y0) for s in asset.surfaces) > 0.5 * asset.size[0] * asset.size[1]
    )


def _main(thing: Thing) -> SupportSurface:
    """The surface that one puts things on first: large and open to above."""
    return max(thing.asset.surfaces, key=lambda s: (min(s.headroom, 0.6), (s.x1 - s.x0) * (s.y1 - s.y0)))


def _set_table(tops: Tops, table: Thing) -> None:
    """Something in the middle, and now and then places laid before the chairs."""
    ctx = tops.ctx
    top = _main(table)
    roles = (
        "fruit bowl",
        "vase",
        "bouquet",
        "tulips",
        "candlestick",
        "bowl of apples",
        "lilies",
        "salad bowl",
        "orchid",
    )
    for role in ctx.rng.permutation(len(roles))[: 1 + int(ctx.chance(0.3))]:
        asset = ctx.pick(roles[int(role)], most=(0.5, 0.5, 0.6))
        if asset is not None and ctx.chance(0.85):
            tops.put(asset, table, top, "centre", 3.2)
    laid = ctx.chance(0.3)
    cup = ctx.pick("mug") if ctx.chance(0.5) else ctx.pick("glass")
    plate = ctx.pick("place setting") if laid else None
    for chair in [t for t in ctx.things if t.group == table.group and t.role == "dining chair"]:
        dx, dy = chair.x - table.x, chair.y - table.y
        c, s = math.cos(table.yaw), math.sin(table.yaw)
        u, v = c * dx + s * dy, -s * dx + c * dy
        asset = plate if laid else (cup if ctx.chance(0.15) else None)
        if asset is None:
            continue
        w, d = table.size[:2]
        if abs(u) / w > abs(v) / d:
            place, turn = (math.copysign(w / 2 - 0.24, u), v), -math.copysign(math.pi / 2, u)
        else:
            place, turn = (u, math.copysign(d / 2 - 0.24, v)), (0.0 if v < 0 else math.pi)
        fixed = SupportSurface(
            top.name, top.z, place[0] - 0.26, place[1] - 0.26, place[0] + 0.26, place[1] + 0.26, top.headroom
        )
        _put_exactly(tops, asset, table, top, fixed, turn)


def _put_exactly(tops: Tops, asset: Asset, parent: Thing, top: SupportSurface, at: SupportSurface, turn: float) -> None:
    """Like Tops.put, with the middle of `at` and the turn given."""
    u, v = (at.x0 + at.x1) / 2, (at.y0 + at.y1) / 2
    a, b = _reach(asset.size, turn)
    x0, y0 = min(max(u - a, top.x0), top.x1 - 2 * a), min(max(v - b, top.y0), top.y1 - 2 * b)
    if x0 < top.x0 - 1e-6 or y0 < top.y0 - 1e-6:
        return
    u, v = x0 + a, y0 + b
    taken = tops.taken.setdefault((id(parent), top.name), [])
    if any(u - a < t[2] and u + a > t[0] and v - b < t[3] and v + b > t[1] for t in taken):
        return
    x, y = parent.local(u, v)
    z = parent.z + top.z * parent.size[2] / parent.asset.size[2]
    thing = Thing(
        asset,
        x,
        y,
        z,
        parent.yaw + turn,
        asset.size,
        looks(tops.ctx, asset),
        parent,
        top.name,
        parent.group,
        "small",
        None,
    )
    if any(overlap(thing.box, q) and not same_box(q, parent.box) for q in tops.ctx.space.solids):
        return
    taken.append((u - a, v - b, u + a, v + b))
    tops.ctx.space.add([thing.box])
    tops.ctx.things.append(thing)


def _shelves(tops: Tops, thing: Thing, density: float) -> None:
    """Fill the boards of a shelf: rows of books, or what one keeps in that room."""
    ctx = tops.ctx
    boards = [s for s in thing.asset.surfaces if 0.1 < s.headroom < 1.2] or (
        list(thing.asset.surfaces) if thing.asset.object_class in ("shelving unit",) else []
    )
    if not boards or thing.asset.object_class not in SHELVES:
        return
    books = ctx.pick("row of books", avoid=())
    bookish = ctx.kind not in ("pantry", "closet", "garage", "workshop", "laundry_room", "bathroom", "kitchen", "gym")
    kx, ky, kz = (a / b for a, b in zip(thing.size, thing.asset.size))
    for board in boards:
        if books is not None and bookish and board.headroom < 0.45 and ctx.chance(0.8):
            _book_row(tops, thing, board, ctx.pick("row of books", avoid=()), (kx, ky, kz))
        if bookish:
            count, share = int(ctx.rng.integers(1, 4)), 0.75 * density
        else:  # storage is there to be filled
            count, share = 3 + int(ctx.rng.integers(3) + 3 * (board.x1 - board.x0)), 0.95
        for _ in range(count):
            if not ctx.chance(share):
                continue
            asset, size = None, None
            if not bookish and ctx.chance(0.4):
                asset, size = _box_for(ctx, board, (kx, ky, kz))
            if asset is None:
                asset = _resident(tops, thing, board, 2 if bookish else 5)
            tops.put(asset, thing, board, "any", 0.2, size=size, tries=5)


SHELVES = (
    "bookcase",
    "shelving unit",
    "wall unit",
    "storage shelf",
    "open wall shelf",
    "clothes rack",
    "cupboard",
    "media cabinet",
    "workbench",
)


def _book_row(tops: Tops, thing: Thing, board: SupportSurface, books: Asset, scale) -> None:
    """A row of books on one board, from one end, rarely full."""
    ctx = tops.ctx
    width = (board.x1 - board.x0) * scale[0]
    depth = (board.y1 - board.y0) * scale[1]
    free = board.headroom * scale[2]
    h = min(0.3, free - 0.03) * float(ctx.rng.uniform(0.85, 1.0))
    w = width * float(ctx.rng.uniform(0.35, 0.95)) - 2 * EDGE
    d = min(0.22, depth - 0.03)
    if h < 0.14 or w < 0.12 or d < 0.1:
        return
    side = 1 if ctx.chance(0.5) else -1
    middle = (board.x0 + board.x1) / 2 * scale[0] + side * (width / 2 - w / 2 - EDGE)
    back = board.y1 * scale[1] - d - 0.02
    at = SupportSurface(
        board.name,
        board.z,
        (middle - w / 2) / scale[0] - 2 * EDGE,
        back / scale[1] - 2 * EDGE,
        (middle + w / 2) / scale[0] + 2 * EDGE,
        (back + d) / scale[1] + 2 * EDGE,
        board.headroom,
    )
    tops.put(books, thing, at, "centre", 0.0, size=(w, d, h), tries=2)


def _box_for(ctx: Context, board: SupportSurface, scale) -> tuple[Asset | None, tuple[float, float, float] | None]:
    """A box or basket for a board of a storage shelf, somewhat smaller than its model where it must be."""
    asset = ctx.pick("storage box" if ctx.chance(0.5) else "box", avoid=())
    if asset is None:
        return None, None
    room = ((board.x1 - board.x0) * scale[0], (board.y1 - board.y0) * scale[1], board.headroom * scale[2])
    shrink = min(1.0, *(0.92 * r / s for r, s in zip(room, asset.size)))
    return (asset, tuple(shrink * s for s in asset.size)) if shrink > 0.55 else (None, None)


def _resident(tops: Tops, thing: Thing, board: SupportSurface, most_alike: int) -> Asset | None:
    """Something that is kept on such a board in such a room, of which there are fewer than `most_alike`."""
    ctx = tops.ctx
    most = ((board.x1 - board.x0) * 0.8, board.y1 - board.y0, board.headroom - 0.01)
    fitting = [
        (a, w)
        for a, w in resting_on(ctx, thing.asset.object_class)
        if a.object_class != "row of books" and all(s <= m for s, m in zip(a.size, most))
    ]
    if fitting and ctx.chance(0.45):
        weights = np.array([w / (1 + 2 * ctx.stock.used[a.key]) for a, w in fitting])
        asset = fitting[int(ctx.rng.choice(len(fitting), p=weights / weights.sum()))][0]
        return asset if tops.allows(asset, most_alike) else None
    roles = CLUTTER.get(ctx.kind) or CLUTTER["any"]
    role = roles[int(ctx.rng.integers(len(roles)))]
    asset = ctx.pick(role, most=most)
    return asset if asset is not None and tops.allows(asset, most_alike) else None


def _more(tops: Tops, thing: Thing, density: float) -> None:
    """A few more things that the catalogue says lie on this class of object in this kind of room."""
    ctx = tops.ctx
    if thing.asset.object_class in SHELVES or thing.role in ("bed", "dining chair", "bedside table", "bench"):
        return
    top = _main(thing)
    area = (top.x1 - top.x0) * (top.y1 - top.y0)
    count = int(ctx.rng.poisson(min(area * 1.6, 2.0) * density))
    if not count:
        return
    fitting = resting_on(ctx, thing.asset.object_class)
    for _ in range(min(count, 4)):
        options = [(a, w) for a, w in fitting if tops.allows(a)]
        if not options:
            return
        weights = np.array([w / (1 + 2 * ctx.stock.used[a.key]) for a, w in options])
        asset = options[int(ctx.rng.choice(len(options), p=weights / weights.sum()))][0]
        tops.put(asset, thing, top, "any", 0.4 if asset.size[0] > 0.12 else 3.2, tries=5)


def resting_on(ctx: Context, object_class: str) -> list[tuple[Asset, float]]:
    """Assets that rest on this class, with their weight in this kind of room."""
    memo = ctx.stock.resting
    key = (object_class, ctx.kind)
    if key not in memo:
        memo[key] = [
            (a, a.rooms[ctx.kind])
            for a in ctx.stock.catalogue.assets.values()
            if object_class in a.on and a.rooms.get(ctx.kind, 0.0) > 0 and max(a.size[:2]) < 0.6 and a.size[2] < 0.6
        ]
    return memo[key]
