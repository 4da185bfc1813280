"""Groups of furniture as small rigid arrangements, and the packer that finds room for them.

An arrangement has its own frame, the frame of the asset at its heart: x to the right of
somebody facing the group, the front toward -y. A group that stands at a wall has the wall at
y = 0. A pose puts that frame into the room.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from embodied.assets.records import Asset
from embodied.generate.furnish.space import Box, Params, RoomSpace, Thing, Wall, box, overlap, same_box

WALL_GAP = 0.02
"""Free strip between a wall and furniture, for the skirting, metres."""
RUG_HEIGHT = 0.012
"""Metres."""
TRIES_PER_THING = 6.0
"""Poses tried in vain for one more thing of an arrangement."""


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
    params: Params = ()
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
    """True if it may reach into keep-outs (rugs and curtains)."""
    aside: bool = False
    """True if it may lie where one stands to use something else: shoes before the wardrobe."""
    role: str = ""
    """Its name in the group, so that later stages find it again."""

    @property
    def extent(self) -> tuple[float, float, float]:
        """Width, depth and height, metres."""
        return self.size or self.asset.size


@dataclass(frozen=True, slots=True)
class ScoredPose:
    """Pose of an arrangement's frame; the best score is tried first."""

    score: float
    x: float
    y: float
    yaw: float
    wall: Wall | None = None


def is_flat(size: tuple[float, float, float], z: float = 0.0) -> bool:
    """True if a thing on the floor is a rug or mat that furniture may stand on."""
    return size[2] <= 0.03 and z < 0.01


def pack(
    space: RoomSpace, items: Sequence[Item], poses: Iterable[ScoredPose], group: str, tries: int = 40
) -> RoomSpace | None:
    """The room with the arrangement at the first pose that takes all of it, or at one that takes most of it.

    A worse pose must make up for its rank by more things (TRIES_PER_THING poses for one thing). None where no pose
    takes what is not optional, or where it would cut the room apart.
    """
    best: tuple[float, RoomSpace] | None = None
    for rank, pose in enumerate(sorted(poses, key=lambda p: -p.score)[:tries]):
        if best is not None and len(items) - rank / TRIES_PER_THING <= best[0]:
            break
        fit = _fit(space, items, pose, group)
        if fit is None:
            continue
        added = len(fit.things) - len(space.things)
        if best is None or added - rank / TRIES_PER_THING > best[0]:
            best = added - rank / TRIES_PER_THING, fit
        if added == len(items):
            break
    return best[1] if best else None


def _fit(space: RoomSpace, items: Sequence[Item], pose: ScoredPose, group: str) -> RoomSpace | None:
    """The room with the arrangement at a pose."""
    trial = _Trial(space, pose, group)
    for item in items:
        if not trial.place(item):
            return None
    things, solids = trial.things, trial.solids()
    plan = space.walkable(solids, trial.reach)
    if plan is None:
        things = _without_optional(items, things)
        solids = [b for b, t in zip(trial.boxes, things) if b is not None and t is not None]
        plan = space.walkable(solids, trial.reach)
        if plan is None:
            return None
    resting, kept = _resting(space, items, things)
    return space.holding(kept, (*solids, *resting), trial.zones.values(), plan)


@dataclass
class _Trial:
    """An arrangement that is being put at a pose, item by item."""

    space: RoomSpace
    pose: ScoredPose
    group: str
    things: list[Thing | None] = field(default_factory=list)
    """One for each item so far; None where an optional one was left out."""
    boxes: list[Box | None] = field(default_factory=list)
    """Of what stands; None for rugs, for what rests on something and for what was left out."""
    zones: dict[int, Box] = field(default_factory=dict)
    """Zones that must stay clear before the fronts of items; what goes under an item may be in its zone."""
    reach: list[tuple[float, float]] = field(default_factory=list)
    """Zones in which somebody must be able to stand."""

    def solids(self) -> list[Box]:
        return [b for b in self.boxes if b is not None]

    def place(self, item: Item) -> bool:
        """Add the next item; False where it finds no room and is not optional."""
        if item.on is not None:
            self._keep(_rest(self.space, item, self.things[item.on], self.group), None)
            return True
        thing = self._thing(item)
        b, flat = thing.box, is_flat(item.extent, item.z)
        zone = _clear_zone(item, thing) if item.clear else None
        if not self._stands(item, b, flat) or (
            zone is not None and not (self.space.inside(zone) and not any(overlap(zone, q) for q in self.space.solids))
        ):
            self._keep(None, None)
            return item.optional
        if zone is not None:
            self.zones[len(self.things)] = zone
            if item.clear >= 0.5:
                self.reach.append(thing.local(0.0, -(item.extent[1] / 2 + self.space.radius + 0.06)))
        self._keep(thing, None if flat else b)
        return True

    def _keep(self, thing: Thing | None, b: Box | None) -> None:
        self.things.append(thing)
        self.boxes.append(b)

    def _thing(self, item: Item) -> Thing:
        pose, c, s = self.pose, math.cos(self.pose.yaw), math.sin(self.pose.yaw)
        x, y = pose.x + c * item.x - s * item.y, pose.y + s * item.x + c * item.y
        z, yaw = self.space.bottom + item.z, pose.yaw + item.yaw
        return _thing_of(item, x=x, y=y, z=z, yaw=yaw, group=self.group, wall=pose.wall)

    def _stands(self, item: Item, b: Box, flat: bool) -> bool:
        """True if an item finds room among what stands in the room and in the arrangement."""
        if item.needs is not None and self.things[item.needs] is None:
            return False
        if flat:  # rugs lie inside the room and not on one another or on tall built-ins' feet
            low = (q for q in self.space.solids if q.top - self.space.bottom <= 0.03)
            return self.space.inside(b) and not any(overlap(replace(b, top=b.bottom + 0.02), q) for q in low)
        allowed = [q for i in item.under if (q := self.boxes[i]) is not None]
        return (
            self.space.fits(b, ignore=allowed, passage=item.passage, aside=item.aside)
            and not any(overlap(b, q) and not any(q is a for a in allowed) for q in self.solids())
            and not any(overlap(b, z) for i, z in self.zones.items() if i not in item.under)
        )


def _clear_zone(item: Item, thing: Thing) -> Box:
    """The zone that must stay clear before an item's front, or behind its back."""
    w, d, h = item.extent
    fx, fy = thing.front
    if item.clear < 0:
        fx, fy = -fx, -fy
    depth = abs(item.clear)
    away = d / 2 + depth / 2
    return box(
        thing.x + fx * away, thing.y + fy * away, w * 0.9, depth - 0.01, thing.yaw, thing.z, thing.z + max(h, 0.5)
    )


def _resting(space: RoomSpace, items: Sequence[Item], things: Sequence[Thing | None]) -> tuple[list[Box], list[Thing]]:
    """Boxes of what rests on surfaces, and all things less those that would touch more than what carries them."""
    kept: list[Thing] = []
    boxes: list[Box] = []
    own = [t.box for i, t in zip(items, things) if t is not None and i.on is None and not is_flat(i.extent, i.z)]
    for thing in things:
        if thing is None:
            continue
        if thing.parent is not None:
            b, carrier = thing.box, thing.parent.box
            others = (*space.solids, *own, *boxes)
            if any(overlap(b, q) and not same_box(q, carrier) for q in others) or not space.inside(b):
                continue
            boxes.append(b)
        kept.append(thing)
    return boxes, kept


def _without_optional(items: Sequence[Item], things: Sequence[Thing | None]) -> list[Thing | None]:
    """The arrangement stripped of its optional standing things, and of what rests on them."""
    kept: list[Thing | None] = []
    for item, thing in zip(items, things):
        left_out = (
            (item.optional and item.on is None and not is_flat(item.extent))
            or (item.on is not None and kept[item.on] is None)
            or (item.needs is not None and kept[item.needs] is None)
        )
        kept.append(None if left_out else thing)
    return kept


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
    (x, y), z, yaw = parent.local(u, v), parent.z + surface.z * scale[2] + item.z, parent.yaw + item.yaw
    on = {"parent": parent, "surface": surface.name, "wall": parent.wall}
    return _thing_of(item, x=x, y=y, z=z, yaw=yaw, group=group, **on)


def _thing_of(item: Item, **place: Any) -> Thing:
    return Thing(asset=item.asset, size=item.extent, params=item.params, role=item.role, **place)


def wall_poses(
    space: RoomSpace, width: float, *, score: Callable[[Wall, float], float], gap: float = WALL_GAP, step: float = 0.25
) -> list[ScoredPose]:
    """Poses of a group `width` wide with its back to a wall, clear of doors.

    Tried along each wall are both ends, the middle, the middles of its free stretches, before
    its windows, and every `step` metres.
    """
    poses: list[ScoredPose] = []
    for wall in space.walls:
        half = width / 2 + 0.01
        doors = [(s0 - 0.1, s1 + 0.1) for s0, s1, o in wall.openings if o.kind != "window"]
        if wall.length < 2 * half:
            continue
        low, high = half, wall.length - half
        spots = [low, high, wall.length / 2]
        edges = [0.0, *(e for d in doors for e in d), wall.length]
        spots += [(a + b) / 2 for a, b in zip(edges[::2], edges[1::2])]
        spots += [e + half if i % 2 else e - half for i, e in enumerate(edges[1:-1], start=1)]
        spots += [(s0 + s1) / 2 for s0, s1, o in wall.openings if o.kind == "window"]
        spots += list(np.arange(low, high, step))
        for s in sorted({round(float(s), 3) for s in spots}):
            if not low - 1e-3 <= s <= high + 1e-3:
                continue
            if any(s - half < b - 0.01 and s + half > a + 0.01 for a, b in doors):
                continue
            x, y = wall.point(s, gap)
            poses.append(ScoredPose(score(wall, s), x, y, wall.yaw, wall))
    return poses


def floor_poses(
    space: RoomSpace, *, score: Callable[[float, float, float], float], yaws: Sequence[float], step: float = 0.3
) -> list[ScoredPose]:
    """Poses on a grid over the floor, at each of `yaws`."""
    x0, y0, x1, y1 = space.polygon.bounds
    nx = max(int((x1 - x0 - 0.6) / step), 1) + 1
    ny = max(int((y1 - y0 - 0.6) / step), 1) + 1
    centre = ((x0 + x1) / 2, (y0 + y1) / 2)
    poses: list[ScoredPose] = []
    for i in range(nx):
        for j in range(ny):
            x = centre[0] + (i - (nx - 1) / 2) * step
            y = centre[1] + (j - (ny - 1) / 2) * step
            poses.extend(ScoredPose(score(x, y, yaw), x, y, yaw) for yaw in yaws)
    return poses
