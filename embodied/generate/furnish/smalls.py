"""Small things on tables, shelves, walls and floors: what stands there, and what the household leaves there.

smalls.toml says what there is: kettles on worktops, shoes at the door, dishes by the sink, clothes on a chair.
"""

import dataclasses
import itertools
import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from embodied.assets.records import Asset, Size, SupportSurface
from embodied.generate.furnish.arrange import Item, ScoredPose, floor_poses, wall_poses
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.likes import door_distance, nearest
from embodied.generate.furnish.mounting import Hanging, Spot, along_stretches, hang_first
from embodied.generate.furnish.space import WALK_CELL, Box, Thing, Wall, box, overlap, same_box
from embodied.generate.furnish.tables import SmallObject

EDGE, THING_GAP = 0.012, 0.008
"""Free strip at the edge of a surface, and between two things on it, metres."""
GRID, MOST_STEPS = 0.03, 16
"""Between places that are looked at for a gap, metres, and how many are along one side."""
MOST_FLOOR_TAKEN = 0.25
"""Most of the floor that one can walk on which a thing left on it takes from it, square metres."""
Rect = tuple[float, float, float, float]


@dataclass(frozen=True)
class CarrierSurface:
    """One surface of a thing that stands in the room, in the thing's own frame, metres."""

    carrier: Thing
    surface: SupportSurface

    @property
    def scale(self) -> Size:
        """By how much the carrier is larger than its asset, along each axis."""
        kx, ky, kz = (a / b for a, b in zip(self.carrier.size, self.carrier.asset.size))
        return kx, ky, kz

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
class SurfaceOccupancy:
    """Things that already lie on the surfaces of one room."""

    ctx: Context
    taken: dict[tuple[int, str], list[Rect]] = field(default_factory=dict)
    """For each CarrierSurface.key, x0, y0, x1, y1 of what lies there, in the carrier's frame."""
    alike: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        for thing in self.ctx.things:
            self.alike[thing.asset.object_class] += 1
            if (parent := thing.parent) is not None:
                (u, v), (a, b) = _in_frame(parent, thing), _reach(thing.size, thing.yaw - parent.yaw)
                self.taken.setdefault((id(parent), thing.surface or ""), []).append((u - a, v - b, u + a, v + b))

    def area(self, board: CarrierSurface) -> Rect:
        """x0, x1, y0, y1 of what things may lie on: off the arms, backs and pillows of seats."""
        s, (kx, ky, _), (w, d, _) = board.surface, board.scale, board.carrier.size
        x0, x1, y0, y1 = s.x0 * kx, s.x1 * kx, s.y0 * ky, s.y1 * ky
        if seat := self.ctx.tables.seats.get(board.carrier.asset.object_class):
            arm, back = seat
            x0, x1, y1 = max(x0, arm - w / 2), min(x1, w / 2 - arm), min(y1, (0.5 - back) * d)
        return x0, x1, y0, y1

    def put(
        self, asset: Asset | None, board: CarrierSurface, spot: str = "any", turn: float = 0.2, size: Size | None = None
    ) -> Thing | None:
        """Rest `asset` on a board wherever there is a gap for it, near `spot` if it can be; None where there is none.

        Args:
          turn: how far it may be turned either way, radians; 3 or more for any way.
        """
        if asset is None:
            return None
        ctx, rng = self.ctx, self.ctx.rng
        w, d, h = size or asset.size
        if h > board.headroom - 0.01 or board.top + h > ctx.space.bottom + ctx.space.height:
            return None
        x0, x1, y0, y1 = self.area(board)
        drawn = float(rng.uniform(-turn, turn)) if turn < 3 else float(rng.uniform(-math.pi, math.pi))
        for yaw in (drawn, 0.0) if drawn else (0.0,):
            a, b = _reach((w, d, h), yaw)
            gaps = self._gaps(board, (x0 + a, x1 - a, y0 + b, y1 - b), a, b)
            if not len(gaps):
                continue
            off = np.abs(gaps - ((x0 + x1) / 2, (y0 + y1) / 2)) / np.maximum((x1 - x0, y1 - y0), 1e-6)
            back = (gaps[:, 1] - y0) / max(y1 - y0, 1e-6)
            far = {"back": 1 - back, "front": back, "side": 0.5 - off[:, 0], "centre": 2 * off.sum(axis=1)}
            for k in np.argsort(rng.random(len(gaps)) + 3.0 * far.get(spot, 0.0))[:3]:
                u, v = (float(c) for c in gaps[k])
                x, y = board.carrier.local(u, v)
                own = box(x, y, w, d, board.carrier.yaw + yaw, board.top, board.top + h)
                if ctx.space.inside(own) and not self._meets_others(own, board.carrier):
                    return self._lay(asset, board, (u - a, v - b, u + a, v + b), yaw, own, (w, d, h))
        return None

    def _gaps(self, board: CarrierSurface, within: Rect, a: float, b: float) -> np.ndarray:
        """(n, 2) middles, in the carrier's frame, at which something a, b metres half wide and deep would lie free."""
        low_x, high_x, low_y, high_y = within
        if low_x > high_x or low_y > high_y:
            return np.zeros((0, 2))
        us, vs = _steps(low_x, high_x), _steps(low_y, high_y)
        taken = np.array(self.taken.setdefault(board.key, [])).reshape(-1, 4)
        # (columns, n) and (rows, n)
        beside = (us[:, None] >= taken[:, 2] + a + THING_GAP) | (us[:, None] <= taken[:, 0] - a - THING_GAP)
        before = (vs[:, None] >= taken[:, 3] + b + THING_GAP) | (vs[:, None] <= taken[:, 1] - b - THING_GAP)
        columns, rows = np.nonzero(np.all(beside[:, None] | before[None], axis=2))
        return np.stack([us[columns], vs[rows]], axis=1)

    def put_exactly(self, asset: Asset, board: CarrierSurface, at: tuple[float, float], turn: float) -> None:
        """Rest `asset` at a point of a board, moved inwards where it would stick out, if the place is free."""
        x0, x1, y0, y1 = board.surface.x0, board.surface.x1, board.surface.y0, board.surface.y1
        (u, v), (a, b) = at, _reach(asset.size, turn)
        u0, v0 = min(max(u - a, x0), x1 - 2 * a), min(max(v - b, y0), y1 - 2 * b)
        if u0 < x0 - 1e-6 or v0 < y0 - 1e-6:
            return
        u, v = u0 + a, v0 + b
        taken = (u - a, v - b, u + a, v + b)
        if any(u0 < t[2] and u + a > t[0] and v0 < t[3] and v + b > t[1] for t in self.taken.get(board.key, [])):
            return
        (x, y), (w, d, h), z = board.carrier.local(u, v), asset.size, board.top
        own = box(x, y, w, d, board.carrier.yaw + turn, z, z + h)
        if not self._meets_others(own, board.carrier):
            self._lay(asset, board, taken, turn, own, asset.size)

    def _meets_others(self, own: Box, carrier: Thing) -> bool:
        return any(overlap(own, q) and not same_box(q, carrier.box) for q in self.ctx.space.solids)

    def _lay(self, asset: Asset, board: CarrierSurface, taken: Rect, turn: float, own: Box, size: Size) -> Thing:
        carrier, looks = board.carrier, self.ctx.looks(asset)
        (x, y, z), yaw, name = (own.x, own.y, own.bottom), carrier.yaw + turn, board.surface.name
        thing = Thing(asset, x, y, z, yaw, size, looks, carrier, name, carrier.group, role="small")
        self.taken.setdefault(board.key, []).append(taken)
        self.alike[asset.object_class] += 1
        return self.ctx.add(thing, own)

    def allows(self, asset: Asset, most: int = 2) -> bool:
        """True if the room may hold one more of its class, of which `most` are few."""
        return self.alike[asset.object_class] < max(self.ctx.tables.at_most.get(asset.object_class, 2), most)


def _steps(low: float, high: float) -> np.ndarray:
    """Places from `low` to `high`, about GRID apart, MOST_STEPS at most."""
    count = max(1, min(MOST_STEPS, int((high - low) / GRID) + 1))
    return low + (high - low) / max(count - 1, 1) * np.arange(count)


def _reach(size: tuple[float, float, float], yaw: float) -> tuple[float, float]:
    c, s = abs(math.cos(yaw)), abs(math.sin(yaw))
    return (c * size[0] + s * size[1]) / 2, (s * size[0] + c * size[1]) / 2


def _in_frame(carrier: Thing, thing: Thing) -> tuple[float, float]:
    """Position of a thing in the frame of another, metres."""
    dx, dy = thing.x - carrier.x, thing.y - carrier.y
    c, s = math.cos(carrier.yaw), math.sin(carrier.yaw)
    return c * dx + s * dy, -s * dx + c * dy


def clutter(ctx: Context) -> None:
    """Put the small things of daily life onto everything in the room that can carry them."""
    occupancy = SurfaceOccupancy(ctx)
    carriers = [t for t in ctx.things if t.asset.surfaces and not _hollow(ctx, t.asset)]
    for thing in carriers:
        if thing.role == "dining table":
            _set_table(occupancy, thing)
    for thing in carriers:
        _shelves(occupancy, thing)
    small = ctx.tables.smalls
    leave(ctx, [s for name in ("everywhere", *ctx.tables.lies_in.get(ctx.kind, ())) for s in small[name]], occupancy)
    for thing in carriers:
        _more(occupancy, thing)


def _hollow(ctx: Context, asset: Asset) -> bool:
    """True if its one surface is the opening of a bowl rather than a rim."""
    return (
        ctx.fits(asset, "bowls")
        and max((s.x1 - s.x0) * (s.y1 - s.y0) for s in asset.surfaces) > 0.5 * asset.size[0] * asset.size[1]
    )


def main_board(thing: Thing) -> CarrierSurface:
    """The surface that one puts things on first: large and open to above."""
    surfaces = thing.asset.surfaces
    return CarrierSurface(thing, max(surfaces, key=lambda s: (min(s.headroom, 0.6), (s.x1 - s.x0) * (s.y1 - s.y0))))


def _set_table(occupancy: SurfaceOccupancy, table: Thing) -> None:
    """Something in the middle, and now and then places laid before the chairs."""
    ctx = occupancy.ctx
    top = main_board(table)
    for role in ctx.rng.permutation(ctx.tables.centrepieces)[: 1 + int(ctx.chance(0.3))]:
        asset = ctx.pick(str(role), most=(0.5, 0.5, 0.6))
        if asset is not None and ctx.chance(0.85):
            occupancy.put(asset, top, "centre", 3.2)
    laid = ctx.chance(0.3)
    cup = ctx.pick("mug") if ctx.chance(0.5) else ctx.pick("glass")
    plate = ctx.pick("place setting") if laid else None
    for chair in [t for t in ctx.things if t.group == table.group and t.role == "dining chair"]:
        u, v = _in_frame(table, chair)
        asset = plate if laid else (cup if ctx.chance(0.15) else None)
        if asset is None:
            continue
        w, d = table.size[:2]
        if abs(u) / w > abs(v) / d:
            place, turn = (math.copysign(w / 2 - 0.24, u), v), -math.copysign(math.pi / 2, u)
        else:
            place, turn = (u, math.copysign(d / 2 - 0.24, v)), (0.0 if v < 0 else math.pi)
        occupancy.put_exactly(asset, top, place, turn)


def _shelves(occupancy: SurfaceOccupancy, thing: Thing) -> None:
    """Fill the boards of a shelf: rows of books, or what one keeps in that room."""
    ctx = occupancy.ctx
    surfaces = [s for s in thing.asset.surfaces if 0.1 < s.headroom < 1.2] or (
        list(thing.asset.surfaces) if thing.asset.object_class == "shelving unit" else []
    )
    if not surfaces or not ctx.fits(thing.asset, "shelves"):
        return
    books = ctx.pick("row of books", avoid=())
    bookish = not ctx.has("stores")
    for board in (CarrierSurface(thing, s) for s in surfaces):
        if books is not None and bookish and board.surface.headroom < 0.45 and ctx.chance(0.8):
            _book_row(occupancy, board, ctx.pick("row of books", avoid=()) or books)
        if bookish:
            count, share = int(ctx.rng.integers(1, 4)), 0.75 * _density(ctx)
        else:  # storage is there to be filled
            count, share = 3 + int(ctx.rng.integers(3) + 3 * (board.surface.x1 - board.surface.x0)), 0.95
        for _ in range(count):
            if not ctx.chance(share):
                continue
            asset, size = None, None
            if not bookish and ctx.chance(0.4):
                asset, size = _box_for(ctx, board)
            if asset is None:
                asset = _resident(occupancy, board, 2 if bookish else 5)
            occupancy.put(asset, board, "any", 0.2, size)


def _book_row(occupancy: SurfaceOccupancy, board: CarrierSurface, books: Asset) -> None:
    """A row of books on one board, from one end, rarely full."""
    ctx, s, (kx, ky, kz) = occupancy.ctx, board.surface, board.scale
    width, depth, free = (s.x1 - s.x0) * kx, (s.y1 - s.y0) * ky, s.headroom * kz
    h = min(0.3, free - 0.03) * float(ctx.rng.uniform(0.85, 1.0))
    w = width * float(ctx.rng.uniform(0.35, 0.95)) - 2 * EDGE
    d = min(0.22, depth - 0.03)
    if h < 0.14 or w < 0.12 or d < 0.1:
        return
    side = 1 if ctx.chance(0.5) else -1
    middle = (s.x0 + s.x1) / 2 * kx + side * (width / 2 - w / 2 - EDGE)
    back = s.y1 * ky - d - 0.02
    (x0, x1), (y0, y1) = (middle - w / 2, middle + w / 2), (back, back + d)
    at = dataclasses.replace(s, x0=x0 / kx, y0=y0 / ky, x1=x1 / kx + 1e-6, y1=y1 / ky + 1e-6)
    occupancy.put(books, CarrierSurface(board.carrier, at), "centre", 0.0, (w, d, h))


def _box_for(ctx: Context, board: CarrierSurface) -> tuple[Asset | None, Size | None]:
    """A box or basket for a board of a storage shelf, somewhat smaller than its model where it must be."""
    asset = ctx.pick("storage box" if ctx.chance(0.5) else "box", avoid=())
    if asset is None:
        return None, None
    s, (kx, ky, kz) = board.surface, board.scale
    room = ((s.x1 - s.x0) * kx, (s.y1 - s.y0) * ky, s.headroom * kz)
    shrink = min(1.0, *(0.92 * r / side for r, side in zip(room, asset.size)))
    w, d, h = asset.size
    return (asset, (shrink * w, shrink * d, shrink * h)) if shrink > 0.55 else (None, None)


def _resident(occupancy: SurfaceOccupancy, board: CarrierSurface, most_alike: int) -> Asset | None:
    """Something that is kept on such a board in such a room, of which there are fewer than `most_alike`."""
    ctx, s = occupancy.ctx, board.surface
    most = ((s.x1 - s.x0) * 0.8, s.y1 - s.y0, s.headroom - 0.01)
    fitting = [
        (a, w)
        for a, w in ctx.stock.resting_on(board.carrier.asset.object_class, ctx.kind)
        if a.object_class != "row of books" and all(side <= m for side, m in zip(a.size, most))
    ]
    if fitting and ctx.chance(0.45):
        asset: Asset | None = _weighted(ctx, fitting)
    else:
        roles = ctx.tables.shelves.get(ctx.kind) or ctx.tables.shelves["any"]
        asset = ctx.pick(roles[int(ctx.rng.integers(len(roles)))], most=most)
    return asset if asset is not None and occupancy.allows(asset, most_alike) else None


def _weighted(ctx: Context, options: list[tuple[Asset, float]]) -> Asset:
    """One of the (asset, weight), what the house has already the less likely."""
    weights = np.array([w / (1 + 2 * ctx.used[a.key]) for a, w in options])
    return options[int(ctx.rng.choice(len(options), p=weights / weights.sum()))][0]


def _more(occupancy: SurfaceOccupancy, thing: Thing) -> None:
    """A few more things that the catalogue says lie on this class of object in this kind of room."""
    ctx = occupancy.ctx
    if ctx.fits(thing.asset, "shelves") or thing.role in ("bed", "dining chair", "bedside table", "bench"):
        return
    top = main_board(thing)
    area = (top.surface.x1 - top.surface.x0) * (top.surface.y1 - top.surface.y0)
    count = int(ctx.rng.poisson(min(area * 1.6, 2.0) * _density(ctx)))
    fitting = ctx.stock.resting_on(thing.asset.object_class, ctx.kind)
    for _ in range(min(count, 4)):
        options = [(a, w) for a, w in fitting if occupancy.allows(a)]
        if not options:
            return
        asset = _weighted(ctx, options)
        occupancy.put(asset, top, "any", 0.4 if asset.size[0] > 0.12 else 3.2)


def _density(ctx: Context) -> float:
    """How much lies about, as a share of what lies about in houses of middling tidiness."""
    return 1.5 - 0.87 * ctx.stock.style.tidiness


def leave(ctx: Context, smalls: Iterable[SmallObject], occupancy: SurfaceOccupancy | None = None) -> None:
    """Put small things of the table where they go, as many as its people have or leave there."""
    occupancy = occupancy or SurfaceOccupancy(ctx)
    for small in smalls:
        if (small.kinds and ctx.kind not in small.kinds) or (ctx.has("children") and small.put in ctx.tables.grown_up):
            continue
        carriers = [t for t in ctx.called(*small.on) if t.asset.surfaces]
        if small.on and not carriers:
            continue
        for some in [[t] for t in carriers] if small.per == "carrier" else [carriers]:
            for _ in range(_number(ctx, small)):
                _leave(occupancy, small, some)


def _number(ctx: Context, small: SmallObject) -> int:
    """How many of it there are: the whole part of the mean, and one more with the rest as its chance."""
    household = ctx.household
    if small.habit and small.habit not in household.habits:
        return 0
    users = household.residents(ctx.kind, ctx.kinds.count(ctx.kind))
    of = {
        "person": users,
        "adult": float(min(users, household.adults)),
        "child": float(len(household.children)),
        "young": float(sum(age < 7 for age in household.children)),
    }
    untidy = 1.0 - ctx.stock.style.tidiness
    mean = small.count * of.get(small.per, 1.0)
    if small.wall is None:
        mean *= 0.25 + 1.9 * untidy if small.mess else _density(ctx)
    return int(mean) + int(ctx.chance(mean - int(mean)))


def _leave(occupancy: SurfaceOccupancy, small: SmallObject, carriers: list[Thing]) -> None:
    """One of it, if there is a place for it."""
    ctx = occupancy.ctx
    asset = ctx.pick(small.put, most=(1.6, 1.6, 1.6), avoid=())
    if asset is None or not occupancy.allows(asset, small.most):
        return
    if small.on:
        _lay_on(occupancy, small, asset, carriers)
    elif small.wall is not None:
        z = min(small.wall, ctx.space.height - 0.1) - asset.size[2]
        hanging = Hanging(asset, z, "left", asset.object_class, margin=0.012)
        occupancy.alike[asset.object_class] += hang_first(ctx, hanging, _wall_spots(ctx, small, asset)) is not None
    else:
        occupancy.alike[asset.object_class] += _put_down(ctx, small, asset)


def _lay_on(occupancy: SurfaceOccupancy, small: SmallObject, asset: Asset, carriers: list[Thing]) -> None:
    """On one of the carriers: the nearest ones where it keeps close to something, else any."""
    rng, anchors = occupancy.ctx.rng, occupancy.ctx.called(*small.near)
    if anchors:
        carriers = sorted(carriers, key=lambda t: nearest(t.x, t.y, anchors) + 0.5 * rng.random())
    elif len(carriers) > 1:
        carriers = [carriers[int(k)] for k in rng.permutation(len(carriers))]
    for carrier in carriers[:3]:
        boards = [main_board(carrier)]
        if occupancy.ctx.fits(carrier.asset, "shelves") or carrier.asset.object_class == "shoe rack":
            surfaces = [CarrierSurface(carrier, s) for s in carrier.asset.surfaces]
            boards = [surfaces[int(k)] for k in rng.permutation(len(surfaces))[:4]]
        for board in boards:
            if occupancy.put(asset, board, small.spot, small.turn, _fitting(occupancy, asset, board)) is not None:
                return


def _fitting(occupancy: SurfaceOccupancy, asset: Asset, board: CarrierSurface) -> tuple[float, float, float] | None:
    """The size of cloth and boxes that come in the size of what they lie on; None for what keeps its own."""
    x0, x1, y0, y1 = occupancy.area(board)
    w, d, h = asset.size
    if asset.object_class == "duvet":
        return min(w, 0.96 * (x1 - x0)), min(d, 0.7 * (y1 - y0)), h
    if not occupancy.ctx.fits(asset, "cut to size"):
        return None
    shrink = min(1.0, 0.92 * (x1 - x0) / w, 0.96 * (y1 - y0) / d, 0.92 * board.headroom / h)
    return (shrink * w, shrink * d, shrink * h) if shrink > 0.55 else None


def _wall_spots(ctx: Context, small: SmallObject, asset: Asset) -> Iterator[Spot]:
    """Spots on the walls: beside what it keeps close to, the nearest first, else about the middles of free walls."""
    anchors = ctx.called(*small.near)
    if not anchors:
        yield from along_stretches(ctx.space.longest_walls, lambda: ctx.rng.uniform(0.12, 0.88, 5).tolist())
        return
    spots: list[tuple[float, int, float]] = []
    for k, wall in enumerate(ctx.space.walls):
        for s in np.arange(0.06, wall.length, 0.12).tolist():
            away = nearest(*wall.point(s, asset.size[1] / 2), anchors)
            if away < 1.6:
                spots.append((away + 0.25 * ctx.rng.random(), k, s))
    yield from ((ctx.space.walls[k], s) for _, k, s in sorted(spots))


def _put_down(ctx: Context, small: SmallObject, asset: Asset) -> bool:
    """On the floor: at a wall close to something, or anywhere out of the way."""
    w, d = asset.size[:2]
    anchors = ctx.called(*small.near)
    if small.near and not anchors:
        return False
    turn = float(ctx.rng.uniform(-small.turn, small.turn))
    if anchors:

        def close(wall: Wall, s: float) -> float:
            return -nearest(*wall.point(s, d / 2), anchors) + 0.3 * ctx.rng.random()

        wide, deep = (2 * half for half in _reach(asset.size, turn))
        poses = wall_poses(ctx.space, wide, score=close, step=0.12)
        item = Item(asset, 0.0, -deep / 2, turn, role=asset.object_class, aside=True)
    else:
        standing = [t for t in ctx.things if t.parent is None]

        def aside(x: float, y: float, yaw: float) -> float:
            return min(door_distance(ctx.space, x, y), 1.5) - nearest(x, y, standing) + 0.8 * ctx.rng.random()

        poses = floor_poses(ctx.space, score=aside, yaws=(turn,), step=0.35)
        item = Item(asset, role=asset.object_class, aside=True)
    free = ctx.space.walk.sum() * WALK_CELL**2
    boxes = ((p, _where(item, p, ctx.space.bottom)) for p in sorted(poses, key=lambda p: -p.score))
    likely = itertools.islice(((p, b) for p, b in boxes if ctx.space.fits(b, aside=True)), 12)
    chosen = [p for p, b in likely if ctx.space.taken(b) < min(MOST_FLOOR_TAKEN, 0.1 * free)]
    return bool(ctx.put([item], chosen, "left"))


def _where(item: Item, pose: ScoredPose, z: float) -> Box:
    """The box of an arrangement's only item at a pose."""
    w, d, h = item.extent
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return box(pose.x - s * item.y, pose.y + c * item.y, w, d, pose.yaw + item.yaw, z, z + h)
