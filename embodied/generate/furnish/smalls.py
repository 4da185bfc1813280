"""Small things on tables, shelves and worktops, where people put them."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from assets.records import Asset, SupportSurface
from embodied.generate.furnish.arrange import Thing, same_box
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.looks import looks
from embodied.generate.furnish.recipes import CLUTTER, MOST_ALIKE, RECIPES
from embodied.generate.furnish.space import Box, box, overlap
from embodied.generate.furnish.stock import Size

EDGE, APART = 0.012, 0.008
"""Free strip at the edge of a surface, and between two things on it, metres."""
GRID, MOST_STEPS = 0.03, 16
"""Between places that are looked at for a gap, metres, and how many are along one side."""
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
STORING = ("pantry", "closet", "garage", "workshop", "laundry_room", "bathroom", "kitchen", "gym")
"""Room kinds whose shelves hold what is kept there instead of books."""
CENTREPIECES = (
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
"""Roles of what stands in the middle of dining tables."""


@dataclass(frozen=True)
class Board:
    """One surface of a thing that stands in the room, in the thing's own frame, metres."""

    carrier: Thing
    surface: SupportSurface

    @property
    def scale(self) -> Size:
        """By how much the carrier is larger than its asset, along each axis."""
        kx, ky, kz = (a / b for a, b in zip(self.carrier.size, self.carrier.asset.size))
        return kx, ky, kz

    @property
    def area(self) -> tuple[float, float, float, float]:
        """x0, x1, y0, y1 of what things may lie on: off the arms, backs and pillows of seats."""
        s, (kx, ky, _), parent = self.surface, self.scale, self.carrier
        x0, x1, y0, y1 = s.x0 * kx, s.x1 * kx, s.y0 * ky, s.y1 * ky
        if parent.asset.object_class in SEATS:
            arm, back = SEATS[parent.asset.object_class]
            x0, x1 = max(x0, arm - parent.size[0] / 2), min(x1, parent.size[0] / 2 - arm)
            y1 = min(y1, (0.5 - back) * parent.size[1])
        return x0, x1, y0, y1

    @property
    def top(self) -> float:
        """World z, metres."""
        return self.carrier.z + self.surface.z * self.scale[2]

    @property
    def headroom(self) -> float:
        """Metres."""
        return self.surface.headroom * self.scale[2]

    @property
    def key(self) -> tuple[int, str]:
        return id(self.carrier), self.surface.name


@dataclass
class Tops:
    """What already lies on the surfaces of one room."""

    ctx: Context
    taken: dict[tuple[int, str], list[tuple[float, float, float, float]]] = field(default_factory=dict)
    """For each Board.key, x0, y0, x1, y1 of what lies there, in the carrier's frame."""
    alike: Counter[str] = field(default_factory=Counter)

    def start(self) -> None:
        """Take note of what the groups have put on surfaces."""
        for thing in self.ctx.things:
            self.alike[thing.asset.object_class] += 1
            if thing.parent is not None:
                self._occupy(thing, thing.parent)

    def _occupy(self, thing: Thing, parent: Thing) -> None:
        dx, dy = thing.x - parent.x, thing.y - parent.y
        c, s = math.cos(parent.yaw), math.sin(parent.yaw)
        u, v = c * dx + s * dy, -s * dx + c * dy
        a, b = _reach(thing.size, thing.yaw - parent.yaw)
        key = (id(parent), thing.surface or "")
        self.taken.setdefault(key, []).append((u - a, v - b, u + a, v + b))

    def put(
        self,
        asset: Asset | None,
        board: Board,
        spot: str = "any",
        turn: float = 0.2,
        size: Size | None = None,
        tries: int = 7,
    ) -> Thing | None:
        """Rest `asset` on a board, near `spot`; None where there is no free place.

        Args:
          turn: how far it may be turned either way, radians; 3 or more for any way.
        """
        if asset is None:
            return None
        ctx, rng = self.ctx, self.ctx.rng
        w, d, h = size or asset.size
        x0, x1, y0, y1 = board.area
        z = board.top
        if h > board.headroom - 0.01 or z + h > ctx.space.bottom + ctx.space.height:
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
            taken = (u - a, v - b, u + a, v + b)
            if self._is_taken(board, taken, APART):
                continue
            x, y = board.carrier.local(u, v)
            own = box(x, y, w, d, board.carrier.yaw + yaw, z, z + h)
            if not ctx.space.inside(own) or self._meets_others(own, board.carrier):
                continue
            self.alike[asset.object_class] += 1
            ctx.stock.note([asset])
            return self._lay(asset, board, taken, yaw, own, (w, d, h))
        return None

    def put_in_gap(self, asset: Asset, board: Board, spot: str, turn: float, size: Size | None = None) -> Thing | None:
        """Rest `asset` on a board wherever there is a gap for it, near `spot` if it can be; None where there is none.

        Args:
          turn: how far it may be turned either way, radians; 3 or more for any way.
        """
        ctx, rng = self.ctx, self.ctx.rng
        w, d, h = size or asset.size
        if h > board.headroom - 0.01 or board.top + h > ctx.space.bottom + ctx.space.height:
            return None
        x0, x1, y0, y1 = board.area
        drawn = float(rng.uniform(-turn, turn)) if turn < 3 else float(rng.uniform(-math.pi, math.pi))
        for yaw in (drawn, 0.0) if drawn else (0.0,):
            a, b = _reach((w, d, h), yaw)
            gaps = self._gaps(board, (x0 + a, x1 - a, y0 + b, y1 - b), a, b)
            if not len(gaps):
                continue
            rank = rng.random(len(gaps))
            if spot in ("back", "front"):
                rank += 3.0 * (gaps[:, 1] if spot == "front" else -gaps[:, 1]) / max(y1 - y0, 1e-6)
            elif spot in ("side", "centre"):
                off = np.abs(gaps[:, 0] - (x0 + x1) / 2) / max(x1 - x0, 1e-6)
                rank += -3.0 * off if spot == "side" else 3.0 * off
            for k in np.argsort(rank)[:3]:
                u, v = (float(c) for c in gaps[k])
                x, y = board.carrier.local(u, v)
                own = box(x, y, w, d, board.carrier.yaw + yaw, board.top, board.top + h)
                if ctx.space.inside(own) and not self._meets_others(own, board.carrier):
                    self.alike[asset.object_class] += 1
                    ctx.stock.note([asset])
                    return self._lay(asset, board, (u - a, v - b, u + a, v + b), yaw, own, (w, d, h))
        return None

    def _gaps(self, board: Board, within: tuple[float, float, float, float], a: float, b: float) -> np.ndarray:
        """(n, 2) middles, in the carrier's frame, at which something a, b metres half wide and deep would lie free."""
        low_x, high_x, low_y, high_y = within
        if low_x > high_x or low_y > high_y:
            return np.zeros((0, 2))
        us, vs = _steps(low_x, high_x), _steps(low_y, high_y)
        taken = np.array(self.taken.setdefault(board.key, [])).reshape(-1, 4)
        beside = (us[:, None] >= taken[:, 2] + a + APART) | (us[:, None] <= taken[:, 0] - a - APART)  # (columns, n)
        before = (vs[:, None] >= taken[:, 3] + b + APART) | (vs[:, None] <= taken[:, 1] - b - APART)  # (rows, n)
        columns, rows = np.nonzero(np.all(beside[:, None] | before[None], axis=2))
        return np.stack([us[columns], vs[rows]], axis=1)

    def put_exactly(self, asset: Asset, board: Board, at: tuple[float, float], turn: float) -> None:
        """Rest `asset` at a point of a board, moved inwards where it would stick out, if the place is free."""
        x0, x1, y0, y1 = board.surface.x0, board.surface.x1, board.surface.y0, board.surface.y1
        (u, v), (a, b) = at, _reach(asset.size, turn)
        u0, v0 = min(max(u - a, x0), x1 - 2 * a), min(max(v - b, y0), y1 - 2 * b)
        if u0 < x0 - 1e-6 or v0 < y0 - 1e-6:
            return
        u, v = u0 + a, v0 + b
        taken = (u - a, v - b, u + a, v + b)
        if self._is_taken(board, taken, 0.0):
            return
        (x, y), (w, d, h), z = board.carrier.local(u, v), asset.size, board.top
        own = box(x, y, w, d, board.carrier.yaw + turn, z, z + h)
        if self._meets_others(own, board.carrier):
            return
        self._lay(asset, board, taken, turn, own, asset.size)

    def _is_taken(self, board: Board, place: tuple[float, float, float, float], apart: float) -> bool:
        """Whether something lies closer than `apart` to a rectangle of a board."""
        x0, y0, x1, y1 = place
        return any(
            x0 < t[2] + apart and x1 > t[0] - apart and y0 < t[3] + apart and y1 > t[1] - apart
            for t in self.taken.setdefault(board.key, [])
        )

    def _meets_others(self, own: Box, carrier: Thing) -> bool:
        support = carrier.box
        return any(overlap(own, q) and not same_box(q, support) for q in self.ctx.space.solids)

    def _lay(
        self, asset: Asset, board: Board, taken: tuple[float, float, float, float], turn: float, own: Box, size: Size
    ) -> Thing:
        carrier = board.carrier
        thing = Thing(
            asset=asset,
            x=own.x,
            y=own.y,
            z=own.bottom,
            yaw=carrier.yaw + turn,
            size=size,
            params=looks(self.ctx, asset),
            parent=carrier,
            surface=board.surface.name,
            group=carrier.group,
            role="small",
        )
        self.taken[board.key].append(taken)
        self.ctx.space.add([own])
        self.ctx.things.append(thing)
        return thing

    def allows(self, asset: Asset, most: int = 2) -> bool:
        """Whether the room may hold one more of its class, of which `most` are few."""
        return self.alike[asset.object_class] < max(MOST_ALIKE.get(asset.object_class, 2), most)


def _steps(low: float, high: float) -> np.ndarray:
    """Places from `low` to `high`, about GRID apart, MOST_STEPS at most."""
    count = max(1, min(MOST_STEPS, int((high - low) / GRID) + 1))
    return low + (high - low) / max(count - 1, 1) * np.arange(count)


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
                any(tops.put(asset, main_board(thing), spot, turn) for thing in places)
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


def main_board(thing: Thing) -> Board:
    """The surface that one puts things on first: large and open to above."""
    surfaces = thing.asset.surfaces
    return Board(thing, max(surfaces, key=lambda s: (min(s.headroom, 0.6), (s.x1 - s.x0) * (s.y1 - s.y0))))


def _set_table(tops: Tops, table: Thing) -> None:
    """Something in the middle, and now and then places laid before the chairs."""
    ctx = tops.ctx
    top = main_board(table)
    for role in ctx.rng.permutation(len(CENTREPIECES))[: 1 + int(ctx.chance(0.3))]:
        asset = ctx.pick(CENTREPIECES[int(role)], most=(0.5, 0.5, 0.6))
        if asset is not None and ctx.chance(0.85):
            tops.put(asset, top, "centre", 3.2)
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
        tops.put_exactly(asset, top, place, turn)


def _shelves(tops: Tops, thing: Thing, density: float) -> None:
    """Fill the boards of a shelf: rows of books, or what one keeps in that room."""
    ctx = tops.ctx
    surfaces = [s for s in thing.asset.surfaces if 0.1 < s.headroom < 1.2] or (
        list(thing.asset.surfaces) if thing.asset.object_class == "shelving unit" else []
    )
    if not surfaces or thing.asset.object_class not in SHELVES:
        return
    books = ctx.pick("row of books", avoid=())
    bookish = ctx.kind not in STORING
    for board in (Board(thing, s) for s in surfaces):
        if books is not None and bookish and board.surface.headroom < 0.45 and ctx.chance(0.8):
            _book_row(tops, board, ctx.pick("row of books", avoid=()) or books)
        if bookish:
            count, share = int(ctx.rng.integers(1, 4)), 0.75 * density
        else:  # storage is there to be filled
            count, share = 3 + int(ctx.rng.integers(3) + 3 * (board.surface.x1 - board.surface.x0)), 0.95
        for _ in range(count):
            if not ctx.chance(share):
                continue
            asset, size = None, None
            if not bookish and ctx.chance(0.4):
                asset, size = _box_for(ctx, board)
            if asset is None:
                asset = _resident(tops, board, 2 if bookish else 5)
            tops.put(asset, board, "any", 0.2, size=size, tries=5)


def _book_row(tops: Tops, board: Board, books: Asset) -> None:
    """A row of books on one board, from one end, rarely full."""
    ctx, s, (kx, ky, kz) = tops.ctx, board.surface, board.scale
    width, depth, free = (s.x1 - s.x0) * kx, (s.y1 - s.y0) * ky, s.headroom * kz
    h = min(0.3, free - 0.03) * float(ctx.rng.uniform(0.85, 1.0))
    w = width * float(ctx.rng.uniform(0.35, 0.95)) - 2 * EDGE
    d = min(0.22, depth - 0.03)
    if h < 0.14 or w < 0.12 or d < 0.1:
        return
    side = 1 if ctx.chance(0.5) else -1
    middle = (s.x0 + s.x1) / 2 * kx + side * (width / 2 - w / 2 - EDGE)
    back = s.y1 * ky - d - 0.02
    at = dataclasses.replace(
        s,
        x0=(middle - w / 2) / kx - 2 * EDGE,
        y0=back / ky - 2 * EDGE,
        x1=(middle + w / 2) / kx + 2 * EDGE,
        y1=(back + d) / ky + 2 * EDGE,
    )
    tops.put(books, Board(board.carrier, at), "centre", 0.0, size=(w, d, h), tries=2)


def _box_for(ctx: Context, board: Board) -> tuple[Asset | None, Size | None]:
    """A box or basket for a board of a storage shelf, somewhat smaller than its model where it must be."""
    asset = ctx.pick("storage box" if ctx.chance(0.5) else "box", avoid=())
    if asset is None:
        return None, None
    s, (kx, ky, kz) = board.surface, board.scale
    room = ((s.x1 - s.x0) * kx, (s.y1 - s.y0) * ky, s.headroom * kz)
    shrink = min(1.0, *(0.92 * r / side for r, side in zip(room, asset.size)))
    w, d, h = asset.size
    return (asset, (shrink * w, shrink * d, shrink * h)) if shrink > 0.55 else (None, None)


def _resident(tops: Tops, board: Board, most_alike: int) -> Asset | None:
    """Something that is kept on such a board in such a room, of which there are fewer than `most_alike`."""
    ctx, s = tops.ctx, board.surface
    most = ((s.x1 - s.x0) * 0.8, s.y1 - s.y0, s.headroom - 0.01)
    fitting = [
        (a, w)
        for a, w in resting_on(ctx, board.carrier.asset.object_class)
        if a.object_class != "row of books" and all(side <= m for side, m in zip(a.size, most))
    ]
    if fitting and ctx.chance(0.45):
        asset: Asset | None = _weighted(ctx, fitting)
    else:
        roles = CLUTTER.get(ctx.kind) or CLUTTER["any"]
        asset = ctx.pick(roles[int(ctx.rng.integers(len(roles)))], most=most)
    return asset if asset is not None and tops.allows(asset, most_alike) else None


def _weighted(ctx: Context, options: list[tuple[Asset, float]]) -> Asset:
    """One of the (asset, weight), what the house has already the less likely."""
    weights = np.array([w / (1 + 2 * ctx.stock.used[a.key]) for a, w in options])
    return options[int(ctx.rng.choice(len(options), p=weights / weights.sum()))][0]


def _more(tops: Tops, thing: Thing, density: float) -> None:
    """A few more things that the catalogue says lie on this class of object in this kind of room."""
    ctx = tops.ctx
    if thing.asset.object_class in SHELVES or thing.role in ("bed", "dining chair", "bedside table", "bench"):
        return
    top = main_board(thing)
    area = (top.surface.x1 - top.surface.x0) * (top.surface.y1 - top.surface.y0)
    count = int(ctx.rng.poisson(min(area * 1.6, 2.0) * density))
    if not count:
        return
    fitting = resting_on(ctx, thing.asset.object_class)
    for _ in range(min(count, 4)):
        options = [(a, w) for a, w in fitting if tops.allows(a)]
        if not options:
            return
        asset = _weighted(ctx, options)
        tops.put(asset, top, "any", 0.4 if asset.size[0] > 0.12 else 3.2, tries=5)


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
