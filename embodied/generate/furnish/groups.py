"""Groups of the table find their place: which models, where each stands in the group, which poses are tried."""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from embodied.assets.records import Asset, Size
from embodied.generate.furnish.arrange import RUG_HEIGHT, Item, ScoredPose, floor_poses, is_flat, wall_poses
from embodied.generate.furnish.context import NO_LEAST_SIZE, NO_MOST_SIZE, Context
from embodied.generate.furnish.likes import LIKES, CandidateSpot, depth_before
from embodied.generate.furnish.space import Thing, Wall
from embodied.generate.furnish.tables import FurnitureGroup, GroupPart

LARGE_BASE = 2.0
"""A thing with a larger base stands in the middle of the room if its group is placed in the open, square metres."""
ASIDE = (0.0, 0.35, -0.35)
"""How far aside a part that faces another is tried, metres."""
AT_WALL = 0.5
"""Distance from the wall up to which things count in the width of a group, metres."""
NO_LIMIT = 99.0


def put_group(ctx: Context, group: FurnitureGroup, name: str, asset: Asset | None = None) -> tuple[Thing, ...]:
    """The things of a group, placed; nothing if it found none.

    Args:
      name: what placements call the group, if it does not say so.
      asset: its first part, instead of one that is picked.
    """
    for k in range(group.rounds):
        chosen = _choose(ctx, group, k, asset)
        if not chosen:
            continue
        for distance, aside in _distances(ctx, group, chosen):
            plan = _Plan(ctx, k, group.place == "wall", distance, aside)
            for part, model in chosen:
                plan.add(part, model)
            plan.centre()
            if things := ctx.put(plan.items, _poses(ctx, group, plan, k), group.name or name, group.tries):
                return things
    return ()


def at_round(values: Sequence[float], k: int, default: float) -> float:
    """The value of round `k`."""
    return values[min(k, len(values) - 1)] if values else default


def _choose(ctx: Context, group: FurnitureGroup, k: int, first: Asset | None) -> list[tuple[GroupPart, Asset]]:
    """The parts of a group that it has in round `k`, each with a model; none where one lacks that it must have."""
    chosen: list[tuple[GroupPart, Asset]] = []
    models: dict[str, Asset] = {}
    for n, part in enumerate(group.parts):
        of = models.get(part.of) if part.of else chosen[0][1] if chosen else None
        left_out = (
            (n and of is None)
            or (part.needs and part.needs not in models)
            or part.instead_of in models
            or (part.kinds and ctx.kind not in part.kinds)
            or (of is not None and of.size[2] + of.elevation * (of.support == "wall") >= part.lower_than)
            or at_round(part.count, k, 1) < 1
            or (part.chance < 1 and not ctx.chance(part.chance))
        )
        if left_out:
            continue
        model = first if n == 0 and first is not None else _model(ctx, part, k, of)
        if model is None:
            if n == 0 or not (part.optional or part.at in ("on", "over")):
                return []
            continue
        chosen.append((part, model))
        models[part.called] = model
    return chosen


def _model(ctx: Context, part: GroupPart, k: int, of: Asset | None) -> Asset | None:
    low, high = list(part.least), list(part.most)
    low[0] = max(low[0], at_round(part.narrowest, k, 0.0))
    high[0] = min(high[0], at_round(part.widest, k, NO_LIMIT), of.size[0] if part.fits and of is not None else NO_LIMIT)
    high[1] = min(high[1], at_round(part.deepest, k, NO_LIMIT))
    high[2] = min(high[2], ctx.space.height - 0.03)
    stretched = part.wider is not None or part.width is not None or part.of_room is not None
    limits = ((low[0], low[1], low[2]), (high[0], high[1], high[2]))
    least, most = (NO_LEAST_SIZE, NO_MOST_SIZE) if stretched else limits
    before = ctx.roles(part.name) if part.same else []
    if before and ctx.chance(part.same):
        return before[-1].asset
    for role in (part.role, *part.other):
        tagged = (lambda a: any(t in a.tags for t in part.tags)) if part.tags else None
        avoid = {"avoid": ()} if part.allow_duplicate else {}
        asset = ctx.pick(role, least=least, most=most, where=tagged, **avoid)
        if asset is not None:
            return asset
    return None


@dataclass(frozen=True)
class _Spot:
    """One thing of a group, in the group's frame (see arrange.py)."""

    index: int
    asset: Asset
    size: Size
    x: float
    y: float
    yaw: float

    def local(self, u: float, v: float) -> tuple[float, float]:
        """The point (u, v) of its own frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return self.x + c * u - s * v, self.y + s * u + c * v


@dataclass
class _Plan:
    """A group while its parts are being arranged."""

    ctx: Context
    round: int
    at_wall: bool
    distance: float
    """Of the back of a part that faces the first one from the wall, metres."""
    aside: float
    hand: int = 0
    """1 or -1: on which side "right" is; drawn."""
    items: list[Item] = field(default_factory=list)
    spots: dict[str, list[_Spot]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.hand = 1 if self.ctx.chance(0.5) else -1

    def add(self, part: GroupPart, asset: Asset) -> None:
        """The things of one part, by those of the part that it goes by."""
        if not self.items:
            self._first(part, asset)
            return
        anchors = self.spots.get(part.of, []) if part.of else next(iter(self.spots.values()))
        if part.needs and part.needs not in self.spots:
            return
        for anchor in anchors if part.at in ("on", "over") else anchors[:1]:
            size = _size(self.ctx, part, asset, anchor)
            beyond = -anchor.local(0.0, -part.gap - anchor.size[1] / 2 - size[1])[1] - self.items[0].extent[1]
            if part.aisle and beyond < part.aisle:
                continue
            for n, (u, v, turn) in enumerate(AROUND[part.at](self, part, anchor, asset, size)):
                self._put(part, asset, anchor, size, (u, v, turn), n)

    def _first(self, part: GroupPart, asset: Asset) -> None:
        w, d, h = size = _size(self.ctx, part, asset, None)
        yaw = self._turn(part, asset) + self.hand * math.radians(part.turn)
        turned = part.long and d > w
        y = -(w if turned else d) / 2 - part.forward
        z = part.z if part.z is not None else asset.elevation * (asset.support == "wall")
        item = Item(asset, 0.0, y, yaw + turned * math.pi / 2, z, size, self.ctx.looks(asset), passage=part.passage)
        self._keep(part, dataclasses.replace(item, clear=at_round(part.clear, self.round, 0.0)))
        if turned:
            self.spots[part.called] = [_Spot(0, asset, (d, w, h), 0.0, y, yaw)]

    def _put(
        self, part: GroupPart, asset: Asset, anchor: _Spot, size: Size, place: tuple[float, float, float], n: int
    ) -> None:
        u, v, turn = place
        rng = self.ctx.rng
        if part.position_jitter:
            u, v = (c + rng.uniform(-part.position_jitter, part.position_jitter) for c in (u, v))
        turn += self._turn(part, asset)
        mounted = asset.support == "wall" and part.at != "on"
        z = part.z if part.z is not None else asset.elevation * mounted
        many = self.spots.get(part.called, [])
        item = Item(
            asset,
            z=z,
            size=size,
            params=self.ctx.looks(asset),
            clear=at_round(part.clear, self.round, 0.0),
            optional=part.optional or (bool(part.must) and len(many) >= at_round(part.must, self.round, 0)),
            under=(anchor.index,) if part.under or part.at == "seats" else (),
            needs=self.spots[part.needs][0].index if part.needs else anchor.index if part.at == "over" else None,
            passage=part.passage,
        )
        if part.at == "on":
            self._keep(part, dataclasses.replace(item, x=u, y=v, yaw=turn, on=anchor.index))
            return
        if part.at == "about" and is_flat(anchor.size):
            item = dataclasses.replace(item, z=RUG_HEIGHT)
        x, y = anchor.local(u, v)
        if part.look:
            turn += _facing_point(x, y, anchor.x, anchor.y) - anchor.yaw
        yaw = turn if part.straight else anchor.yaw + turn
        self._keep(part, dataclasses.replace(item, x=x, y=y, yaw=yaw))

    def _turn(self, part: GroupPart, asset: Asset) -> float:
        rng, (w, d, _) = self.ctx.rng, asset.size
        if part.turn_any and (part.at == "about" or abs(w - d) < 0.03):
            return float(rng.uniform(-math.pi, math.pi))
        return jitter(rng, part.angle_jitter)

    def _keep(self, part: GroupPart, item: Item) -> None:
        spot = _Spot(len(self.items), item.asset, item.extent, item.x, item.y, item.yaw)
        self.items.append(dataclasses.replace(item, role=part.name or item.asset.object_class))
        self.spots.setdefault(part.called, []).append(spot)

    def span(self) -> tuple[float, float]:
        """From where to where along x the things stand that must find a place at the wall, metres."""
        ends = []
        for n, i in enumerate(self.items):
            c, d = abs(math.cos(i.yaw)), abs(math.sin(i.yaw))
            wide, deep = (i.extent[0], i.extent[1]) if c > d else (i.extent[1], i.extent[0])
            free = i.on is not None or i.optional or is_flat(i.extent, i.z) or i.y + deep / 2 < -AT_WALL
            if n == 0 or not free:
                ends += [i.x - wide / 2, i.x + wide / 2]
        return min(ends), max(ends)

    def centre(self) -> None:
        """Move the arrangement so that the middle of what must find a place is at x = 0."""
        middle = sum(self.span()) / 2
        self.items = [i if i.on is not None else dataclasses.replace(i, x=i.x - middle) for i in self.items]


Places = Iterable[tuple[float, float, float]]
"""(x, y, yaw) in the frame of what a part goes by: x to the right of who faces it, its front toward -y."""


def _about(plan: _Plan, part: GroupPart, anchor: _Spot, asset: Asset, size: Size) -> Places:
    rng, (w, d, _) = plan.ctx.rng, anchor.size
    for _ in range(int(at_round(part.count, plan.round, 1)) + int(rng.integers(part.more + 1))):
        yield rng.uniform(-0.4, 0.4) * w, rng.uniform(-0.4, 0.4) * d, 0.0


def _beside(plan: _Plan, part: GroupPart, anchor: _Spot, asset: Asset, size: Size) -> Places:
    deep = size[1] if part.look else size[0]
    x = anchor.size[0] / 2 + part.gap + deep / 2
    y = ((anchor.size[1] - size[1]) / 2 if part.flush else 0.0) - part.forward
    sides = {"right": (1,), "left": (-1,), "both": (1, -1)}[part.side]
    for sign in sides[: int(at_round(part.count, plan.round, 2))]:
        yield plan.hand * sign * x, y, -plan.hand * sign * math.radians(part.turn)


def _row(plan: _Plan, part: GroupPart, anchor: _Spot, asset: Asset, size: Size) -> Places:
    count = max(1, int(anchor.size[0] / part.every))
    for k in range(count):
        yield ((k + 0.5) / count - 0.5) * anchor.size[0], -anchor.size[1] / 2 - part.gap - size[1] / 2, 0.0


def _facing_point(x: float, y: float, tx: float, ty: float) -> float:
    """Yaw of a thing at (x, y) that looks at (tx, ty)."""
    return math.atan2(ty - y, tx - x) + math.pi / 2


def _seats(plan: _Plan, part: GroupPart, anchor: _Spot, asset: Asset, size: Size) -> Places:
    """Chairs around a table, tucked in and a little askew: in a circle, or along its sides and now and then its ends.

    Those that must find a place come first: one on each long side.
    """
    ctx, (w, d), (cw, cd) = plan.ctx, anchor.size[:2], size[:2]
    tuck = 0.0 if "arms" in asset.tags or cw > 0.495 else min(0.18, cd * 0.3)  # wide chairs have arms
    is_round = "round" in anchor.asset.tags
    if (is_round or abs(w - d) < 0.08) and not plan.at_wall:
        count = 4 if w > 0.75 else 2
        start = ctx.rng.uniform(0, math.pi) if is_round else 0.0
        for k in range(count):
            angle = start + 2 * math.pi * ((k * 2) % count + (k * 2) // count) / count
            r = w / 2 + cd / 2 - tuck * (0.8 if is_round else 1.0) + _pulled(ctx.rng)
            x, y = r * math.cos(angle), r * math.sin(angle)
            yield x, y, _facing_point(x, y, 0, 0)
        return
    per_side = max(1, int((w - 0.06) / max(cw + 0.12, 0.6)))
    for k, sign in itertools.product(range(per_side), (-1,) if plan.at_wall else (-1, 1)):
        x, y = ((k + 0.5) / per_side - 0.5) * w, sign * (d / 2 + cd / 2 - tuck + _pulled(ctx.rng))
        yield x, y, 0.0 if sign > 0 else math.pi
    if d > 0.7 and (plan.at_wall or w > 1.35) and ctx.chance(0.6):
        for sign in (-1, 1):
            yield sign * (w / 2 + cd / 2 - tuck + _pulled(ctx.rng)), 0.0, -sign * math.pi / 2


AROUND: dict[str, Callable[[_Plan, GroupPart, _Spot, Asset, Size], Places]] = {
    "on": lambda plan, part, at, *_: [(plan.hand * part.off_middle * at.size[0], -part.forward, 0.0)],
    "under": lambda plan, part, at, *_: [(plan.hand * part.off_middle * at.size[0], -part.forward, 0.0)],
    "about": _about,
    "before": lambda _, part, at, __, size: [(0.0, -at.size[1] / 2 - part.gap - size[1] / 2 - part.forward, 0.0)],
    "beside": _beside,
    "over": lambda _, __, at, ___, size: [(0.0, (at.size[1] - size[1]) / 2, 0.0)],
    "facing": lambda plan, _, at, __, size: [(plan.aside, -(plan.distance - size[1] / 2) - at.y, math.pi)],
    "seats": _seats,
    "row": _row,
}


def _pulled(rng: np.random.Generator) -> float:
    """How far a chair was left pulled out, metres: mostly not at all."""
    return float(rng.uniform(0.12, 0.3)) if rng.random() < 0.12 else float(rng.uniform(0.0, 0.06))


def jitter(rng: np.random.Generator, degrees: float) -> float:
    """A small turn left by people, radians."""
    return float(np.radians(rng.uniform(-degrees, degrees))) if degrees else 0.0


def _size(ctx: Context, part: GroupPart, asset: Asset, of: _Spot | None) -> Size:
    """Size of a thing: its model's size, or what the part or the room asks for."""
    w, d, h = asset.size
    if part.of_room is not None:
        long, short = sides(ctx.space.polygon)
        w, d, h = part.of_room[0] * long, part.of_room[1] * short, RUG_HEIGHT
    if of is not None and part.wider is not None:
        w = of.size[0] + part.wider
    if of is not None and part.deeper is not None:
        d = of.size[1] + part.deeper
    fixed = zip((part.width, part.depth, part.height), (w, d, h))
    w, d, h = (side if value is None else value for value, side in fixed)
    if (w, d, h) == asset.size:
        return asset.size
    w, d = (min(max(side, lo), hi) for side, lo, hi in zip((w, d), part.least, part.most))
    if asset.object_class.endswith("rug"):
        h = RUG_HEIGHT
    return w, d, (w if "round" in asset.tags and part.height is not None else h)


def sides(floor: shapely.Polygon) -> tuple[float, float]:
    """Longer and shorter side of a floor, metres."""
    x0, y0, x1, y1 = floor.bounds
    return max(x1 - x0, y1 - y0), min(x1 - x0, y1 - y0)


def _distances(
    ctx: Context, group: FurnitureGroup, chosen: list[tuple[GroupPart, Asset]]
) -> Iterator[tuple[float, float]]:
    """From the wall of the first part to the back of one that faces it, and how far that one stands aside, metres."""
    facing = next((asset for part, asset in chosen if part.at == "facing"), None)
    if facing is None:
        yield 0.0, 0.0
        return
    first = chosen[0][1]
    walls = [w for w in ctx.space.walls if w.length > first.size[0]]
    depths = sorted({round(depth_before(ctx.space, w, w.length / 2), 2) for w in walls})
    near, far = (first.size[1] + free + facing.size[1] for free in group.distance)
    at_wall = [d - 0.04 for d in depths if near <= d - 0.04 <= far]
    floating = [d for d in (near + 1.0, near + 0.5) if d < max(depths, default=0.0) - 0.75]
    distances = [*at_wall, *floating] or [d - 0.04 for d in depths if d > near - 0.5][:2]
    yield from ((d, aside) for aside in ASIDE for d in distances)


def _poses(ctx: Context, group: FurnitureGroup, plan: _Plan, k: int) -> list[ScoredPose]:
    low, high = plan.span()
    first, width = plan.items[0], high - low + 2 * at_round(group.margin, k, 0.0)
    place, terms = group.place, {"noise": 0.35, **group.likes}
    near, distance = ctx.called(*group.near), plan.distance
    yaws = tuple(n * math.pi / 2 for n in range(group.turns))
    if place == "open" and first.extent[0] * first.extent[1] > LARGE_BASE:
        place, terms = "floor", {"middle": 1.0, "noise": 0.3}
    elif place == "ahead":
        if not near:
            return []
        deep = plan.spots[group.parts[0].called][0].size[1]
        yaws, terms, distance = (near[0].yaw,), {"ahead": 1.0}, (near[0].size[1] + deep) / 2 + group.gap

    def score(x: float, y: float, yaw: float, wall: Wall | None = None, s: float = 0.0) -> float:
        spot = CandidateSpot(ctx, x, y, yaw, wall, s, width, first, near, distance)
        return sum(weight * LIKES[term](spot) for term, weight in terms.items() if weight)

    def at_wall(wall: Wall, s: float) -> float:
        return score(*wall.point(s, 0.4), wall.yaw, wall, s)

    if place in ("wall", "open"):
        return wall_poses(ctx.space, width, score=at_wall, gap=group.gap, step=group.step)
    if place == "middle":
        c, (x0, y0, x1, y1) = ctx.space.polygon.centroid, ctx.space.polygon.bounds
        return [_moved(ScoredPose(0.0, c.x, c.y, 0.0 if x1 - x0 >= y1 - y0 else math.pi / 2), first)]
    if place == "door":
        return [
            ScoredPose(0.0, *wall.point((s0 + s1) / 2, 0.12), wall.yaw, wall)
            for wall in ctx.space.walls
            for s0, s1, o in wall.openings
            if o.kind in ("front_door", "back_door")
        ]
    return [_moved(pose, first) for pose in floor_poses(ctx.space, score=score, yaws=yaws, step=group.step)]


def _moved(pose: ScoredPose, first: Item) -> ScoredPose:
    """The pose with the middle of the first part where its frame was."""
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return dataclasses.replace(pose, x=pose.x - c * first.x + s * first.y, y=pose.y - s * first.x - c * first.y)
