"""Groups of furniture as small rigid arrangements, and the packer that finds room for them.

An arrangement has its own frame, the frame of the asset at its heart: x to the right of
somebody facing the group, the front toward -y. A group that stands at a wall has the wall at
y = 0. A pose puts that frame into the room.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from assets.records import Asset
from embodied.generate.furnish.space import Box, RoomSpace, Wall, box, overlap

WALL_GAP = 0.02
"""Free strip between a wall and furniture, for the skirting, metres."""


@dataclass(frozen=True, slots=True)
class Item:
    """One asset of an arrangement."""

    asset: Asset
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    z: float = 0.0
    """Height of its base above the floor, or above the surface it is `on`, metres."""
    size: tuple[float, float, float] | None = None
    params: tuple[tuple[str, str | float], ...] = ()
    clear: float = 0.0
    """Depth before its front that nothing else may fill, metres; negative: behind its back."""
    optional: bool = False
    """Left out where it does not fit, instead of giving the arrangement up."""
    under: tuple[int, ...] = ()
    """Items of the arrangement that it may be pushed under."""
    needs: int | None = None
    """Item without which this one is left out as well."""
    on: int | None = None
    """Item whose surface carries it."""
    surface: str | None = None
    passage: bool = False
    """Whether it may reach into keep-outs (rugs and curtains)."""
    role: str = ""
    """What the group calls it, so that later stages find it again."""

    @property
    def extent(self) -> tuple[float, float, float]:
        return self.size or self.asset.size


@dataclass(frozen=True, slots=True)
class Pose:
    """Where an arrangement's frame goes; the best score is tried first."""

    score: float
    x: float
    y: float
    yaw: float
    wall: Wall | None = None


@dataclass(frozen=True, eq=False)
class Thing:
    """An object that has found its place; becomes a Placement once it has an id."""

    asset: Asset
    x: float
    y: float
    z: float
    yaw: float
    size: tuple[float, float, float]
    params: tuple[tuple[str, str | float], ...] = ()
    parent: Thing | None = None
    surface: str | None = None
    group: str | None = None
    role: str = ""
    wall: Wall | None = None

    @property
    def box(self) -> Box:
        w, d, h = self.size
        return box(self.x, self.y, w, d, self.yaw, self.z, self.z + h)

    @property
    def front(self) -> tuple[float, float]:
        """Unit vector toward which its front looks."""
        return math.sin(self.yaw), -math.cos(self.yaw)

    def local(self, u: float, v: float) -> tuple[float, float]:
        """World point of (u, v) in its own frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return self.x + c * u - s * v, self.y + s * u + c * v


def same_box(p: Box, q: Box) -> bool:
    """Whether two boxes are the box of one thing."""
    return abs(p.x - q.x) < 1e-9 and abs(p.y - q.y) < 1e-9 and p.bottom == q.bottom and p.top == q.top


def is_flat(size: tuple[float, float, float], z: float = 0.0) -> bool:
    """Whether a thing on the floor is a rug or mat that furniture may stand on."""
    return size[2] <= 0.03 and z < 0.01


@dataclass(frozen=True, eq=False)
class Fit:
    """An arrangement at a pose, with what it would add to the room."""

    things: tuple[Thing, ...]
    solids: tuple[Box, ...]
    clearances: tuple[Box, ...]
    walk: np.ndarray


def pack(
    space: RoomSpace, items: Sequence[Item], poses: Iterable[Pose], group: str, tries: int = 40
) -> list[Thing] | None:
    """Put the arrangement at the first pose that takes all of it, or at one that takes most of it.

    A worse pose must make up for its rank by more things (PATIENCE poses for one thing).
    """
    best: tuple[float, Fit] | None = None
    for rank, pose in enumerate(sorted(poses, key=lambda p: -p.score)[:tries]):
        if best is not None and len(items) - rank / PATIENCE <= best[0]:
            break
        fit = _fit(space, items, pose, group)
        if fit is None:
            continue
        value = len(fit.things) - rank / PATIENCE
        if best is None or value > best[0]:
            best = value, fit
        if len(fit.things) == len(items):
            break
    if best is None:
        return None
    fit = best[1]
    space.add(fit.solids, fit.clearances, fit.walk)
    return list(fit.things)


PATIENCE = 6.0


def _fit(space: RoomSpace, items: Sequence[Item], pose: Pose, group: str) -> Fit | None:
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    things: list[Thing | None] = []
    boxes: list[Box | None] = []
    zones: list[Box] = []
    reach: list[tuple[float, float]] = []
    for item in items:
        if item.on is not None:
            things.append(_rest(space, item, things[item.on], group))
            boxes.append(None)
            continue
        w, d, h = item.extent
        thing = Thing(
            item.asset,
            pose.x + c * item.x - s * item.y,
            pose.y + s * item.x + c * item.y,
            space.bottom + item.z,
            pose.yaw + item.yaw,
            item.extent,
            item.params,
            None,
            None,
            group,
            item.role,
            pose.wall,
        )
        b = thing.box
        flat = is_flat(item.extent, item.z)
        allowed = [boxes[i] for i in item.under if boxes[i] is not None]
        good = (item.needs is None or things[item.needs] is not None) and (
            _flat_fits(space, b)
            if flat
            else space.fits(b, ignore=allowed, passage=item.passage)
            and not any(q is not None and overlap(b, q) and not any(q is a for a in allowed) for q in boxes)
            and not any(overlap(b, z) for z in zones)
        )
        zone = None
        if good and item.clear:
            fx, fy = thing.front
            if item.clear < 0:
                fx, fy = -fx, -fy
            depth = abs(item.clear)
            away = d / 2 + depth / 2
            zone = box(
                thing.x + fx * away,
                thing.y + fy * away,
                w * 0.9,
                depth - 0.01,
                thing.yaw,
                thing.z,
                thing.z + max(h, 0.5),
            )
            good = space.inside(zone) and space.is_clear(zone)
        if not good:
            if not item.optional:
                return None
            things.append(None)
            boxes.append(None)
            continue
        if zone is not None:
            zones.append(zone)
            if item.clear >= 0.5:
                away = d / 2 + space.radius + 0.06
                reach.append((thing.x + fx * away, thing.y + fy * away))
        things.append(thing)
        boxes.append(None if flat else b)
    solids = [b for b in boxes if b is not None]
    plan = space.walkable(solids, reach)
    if plan is None:
        solids, things = _without_optional(items, things, boxes)
        plan = space.walkable(solids, reach)
        if plan is None:
            return None
    resting, kept = _resting(space, items, things)
    return Fit(tuple(kept), (*solids, *resting), tuple(zones), plan)


def _resting(space: RoomSpace, items, things) -> tuple[list[Box], list[Thing]]:
    """Boxes of what rests on surfaces, and all things less those that would touch more than what carries them."""
    kept, boxes = [], []
    own = [t.box for i, t in zip(items, things) if t is not None and i.on is None and not is_flat(i.extent, i.z)]
    for item, thing in zip(items, things):
        if thing is None:
            continue
        if item.on is not None:
            b, carrier = thing.box, thing.parent.box
            others = (*space.solids, *own, *boxes)
            if any(overlap(b, q) and not same_box(q, carrier) for q in others) or not space.inside(b):
                continue
            boxes.append(b)
        kept.append(thing)
    return boxes, kept


def _without_optional(items, things, boxes):
    """The arrangement stripped of its optional standing things, and of what rests on them."""
    kept: list[Thing | None] = []
    for item, thing in zip(items, things):
        gone = (
            (item.optional and item.on is None and not is_flat(item.extent))
            or (item.on is not None and kept[item.on] is None)
            or (item.needs is not None and kept[item.needs] is None)
        )
        kept.append(None if gone else thing)
    solids = [b for b, t in zip(boxes, kept) if b is not None and t is not None]
    return solids, kept


def _flat_fits(space: RoomSpace, b: Box) -> bool:
    """Rugs lie inside the room and not on one another or on tall built-ins' feet."""
    grown = replace(b, top=b.bottom + 0.02)
    return space.inside(b) and not any(overlap(grown, q) for q in space.solids if q.top - space.bottom <= 0.03)


def _rest(space: RoomSpace, item: Item, parent: Thing | None, group: str) -> Thing | None:
    if parent is None:
        return None
    surfaces = {s.name: s for s in parent.asset.surfaces}
    surface = surfaces.get(item.surface or "") or max(
        parent.asset.surfaces, key=lambda s: (s.headroom > 1.0, (s.x1 - s.x0) * (s.y1 - s.y0)), default=None
    )
    if surface is None:
        return None
    scale = [a / b for a, b in zip(parent.size, parent.asset.size)]
    x0, x1, y0, y1 = surface.x0 * scale[0], surface.x1 * scale[0], surface.y0 * scale[1], surface.y1 * scale[1]
    w, d, h = item.extent
    if h > surface.headroom * scale[2] or w > x1 - x0 + 0.05 or d > y1 - y0 + 0.05:
        return None
    u = min(max(item.x, x0 + w / 2), x1 - w / 2) if w < x1 - x0 else (x0 + x1) / 2
    v = min(max(item.y, y0 + d / 2), y1 - d / 2) if d < y1 - y0 else (y0 + y1) / 2
    x, y = parent.local(u, v)
    return Thing(
        item.asset,
        x,
        y,
        parent.z + surface.z * scale[2] + item.z,
        parent.yaw + item.yaw,
        item.extent,
        item.params,
        parent,
        surface.name,
        group,
        item.role,
        parent.wall,
    )


def wall_poses(
    space: RoomSpace,
    width: float,
    *,
    score: Callable[[Wall, float], float],
    gap: float = WALL_GAP,
    step: float = 0.25,
    walls: Sequence[Wall] | None = None,
) -> list[Pose]:
    """Poses of a group `width` wide with its back to a wall, clear of doors.

    Tried along each wall are both ends, the middle, the middles of its free stretches, before
    its windows, and every `step` metres.
    """
    poses = []
    for wall in space.walls if walls is None else walls:
        half = width / 2 + 0.01
        doors = [(s0 - 0.1, s1 + 0.1) for s0, s1, o in wall.openings if o.kind != "window"]
        if wall.length < 2 * half:
            continue
        low, high = half, wall.length - half
        spots = [low, high, wall.length / 2]
        edges = [0.0, *(e for d in doors for e in d), wall.length]
        spots += [(a + b) / 2 for a, b in zip(edges[::2], edges[1::2])]
        spots += [e + half if i % 2 else e - half for i, e in enumerate(edges[1:-1], start=1) for e in (e,)]
        spots += [(s0 + s1) / 2 for s0, s1, o in wall.openings if o.kind == "window"]
        spots += list(np.arange(low, high, step))
        for s in sorted({round(float(s), 3) for s in spots}):
            if not low - 1e-3 <= s <= high + 1e-3:
                continue
            if any(s - half < b - 0.01 and s + half > a + 0.01 for a, b in doors):
                continue
            x, y = wall.point(s, gap)
            poses.append(Pose(score(wall, s), x, y, wall.yaw, wall))
    return poses


def floor_poses(
    space: RoomSpace,
    *,
    score: Callable[[float, float, float], float],
    yaws: Sequence[float],
    step: float = 0.3,
    margin: float = 0.3,
) -> list[Pose]:
    """Poses on a grid over the floor, at each of `yaws`."""
    x0, y0, x1, y1 = space.polygon.bounds
    nx = max(int((x1 - x0 - 2 * margin) / step), 1) + 1
    ny = max(int((y1 - y0 - 2 * margin) / step), 1) + 1
    centre = ((x0 + x1) / 2, (y0 + y1) / 2)
    poses = []
    for i in range(nx):
        for j in range(ny):
            x = centre[0] + (i - (nx - 1) / 2) * step
            y = centre[1] + (j - (ny - 1) / 2) * step
            poses.extend(Pose(score(x, y, yaw), x, y, yaw) for yaw in yaws)
    return poses


def facing_point(x: float, y: float, tx: float, ty: float) -> float:
    """Yaw of a thing at (x, y) that looks at (tx, ty)."""
    return math.atan2(ty - y, tx - x) + math.pi / 2
