"""What a group knows while it looks for its place: the room, the stock, what already stands."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Unpack

import numpy as np

from assets.records import Asset
from embodied.generate.furnish.arrange import WALL_GAP, Item, ScoredPose, Thing, pack, wall_poses
from embodied.generate.furnish.space import RoomSpace, Wall
from embodied.generate.furnish.stock import AssetLimits, Stock
from embodied.generate.household import Household


@dataclass(frozen=True)
class Liking:
    """Where along the walls a piece likes to stand."""

    corner: float = 0.5
    """For standing in a corner."""
    centre: float = 0.0
    """For the middle of a free stretch."""
    window: float = -1.0
    """For standing under a window."""
    more: Callable[[Wall, float], float] | None = None
    """What else counts, of a wall and a position on it."""
    gap: float = WALL_GAP
    """Free strip behind it, metres."""


@dataclass
class Context:
    """One room being furnished."""

    space: RoomSpace
    stock: Stock
    rng: np.random.Generator
    kinds: tuple[str, ...]
    """Those of all rooms of the house, so that a living room knows whether there is a dining room."""
    household: Household
    """Who lives in the house."""
    attempt: int = 0
    """How often this room has been tried before; later attempts ask for less."""
    things: list[Thing] = field(default_factory=list)
    _groups: dict[str, int] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """Of the room."""
        return self.space.kind

    def chance(self, probability: float) -> bool:
        """True with this probability; draws one number."""
        return bool(self.rng.random() < probability)

    def pick(self, role: str, **limits: Unpack[AssetLimits]) -> Asset | None:
        """An asset for `role` that is not in the room yet, if there is one (see Stock.pick)."""
        limits.setdefault("avoid", tuple(t.asset.key for t in self.things))
        return self.stock.pick(role, rng=self.rng, kind=self.kind, **limits)

    def put(
        self, items: Sequence[Item], poses: Iterable[ScoredPose], group: str, tries: int = 40
    ) -> list[Thing] | None:
        """Pack the arrangement; what found its place joins the room."""
        name = f"{group}_{self._groups.get(group, 0) + 1}"
        things = pack(self.space, items, poses, name, tries)
        if things is None:
            return None
        self._groups[group] = self._groups.get(group, 0) + 1
        self.things.extend(things)
        self.stock.note([t.asset for t in things])
        return things

    def roles(self, *names: str) -> list[Thing]:
        """Things in the room that a group placed under one of these roles."""
        return [t for t in self.things if t.role in names]

    def against_wall(
        self,
        asset: Asset | None,
        group: str,
        *,
        liking: Liking,
        clear: float = 0.6,
        role: str = "",
        extra: Callable[[Asset], Sequence[Item]] = lambda asset: (),
        tries: int = 30,
    ) -> list[Thing] | None:
        """One piece with its back to a wall, where it likes it best.

        Args:
          clear: depth before it that nothing else may fill, metres.
          extra: further items of the arrangement, on it or beside it.
        """
        if asset is None:
            return None
        width, depth, _ = asset.size

        def score(wall: Wall, s: float) -> float:
            value = liking.corner * at_corner(wall, s, width) + liking.centre * centred(wall, s)
            value += liking.window * at_window(wall, s, width)
            return value + (liking.more(wall, s) if liking.more else 0.0) + 0.35 * self.rng.random()

        poses = wall_poses(self.space, width, score=score, gap=liking.gap)
        item = Item(asset, 0.0, -depth / 2, clear=clear, role=role or group)
        return self.put([item, *extra(asset)], poses, group, tries)


def at_corner(wall: Wall, s: float, width: float) -> float:
    """1 where a thing `width` wide at `s` stands in a corner, else 0."""
    near_start = s - width / 2 < 0.06 and wall.corners[0]
    near_end = wall.length - s - width / 2 < 0.06 and wall.corners[1]
    return float(near_start or near_end)


def at_window(wall: Wall, s: float, width: float) -> float:
    """How much of the width is before a window, 0 to 1."""
    shared = 0.0
    for s0, s1, o in wall.openings:
        if o.kind in ("window", "french_window"):
            shared += max(0.0, min(s + width / 2, s1) - max(s - width / 2, s0))
    return shared / width


def centred(wall: Wall, s: float) -> float:
    """1 in the middle of the free stretch (between doors and corners) around `s`, 0 at its ends."""
    a, b = free_stretch(wall, s)
    return 1.0 - abs(2 * s - a - b) / max(b - a, 1e-6)


def free_stretch(wall: Wall, s: float, windows: bool = False) -> tuple[float, float]:
    """The stretch of wall around `s` free of doors (and of windows if asked), metres."""
    a, b = 0.0, wall.length
    for s0, s1, o in wall.openings:
        if o.kind == "window" and not windows:
            continue
        if s1 <= s:
            a = max(a, s1)
        elif s0 >= s:
            b = min(b, s0)
        else:
            return s, s
    return a, b


def has_door(wall: Wall) -> bool:
    """Whether one can walk through it somewhere."""
    return any(o.kind != "window" for _, _, o in wall.openings)


def has_window(wall: Wall) -> bool:
    """Whether light falls in through it."""
    return any(o.kind in ("window", "french_window") for _, _, o in wall.openings)


def depth_before(space: RoomSpace, wall: Wall, s: float) -> float:
    """Distance from the wall at `s` straight across to the opposite wall, metres."""
    px, py = wall.point(s)
    ix, iy = wall.inward
    best = 99.0
    for other in space.walls:
        nx, ny = other.inward
        against = ix * nx + iy * ny
        if against > -1e-6:
            continue
        t = ((other.start[0] - px) * nx + (other.start[1] - py) * ny) / against
        hx, hy = px + t * ix - other.start[0], py + t * iy - other.start[1]
        along = hx * other.along[0] + hy * other.along[1]
        if t > 1e-3 and -1e-3 <= along <= other.length + 1e-3:
            best = min(best, t)
    return best


def door_distance(space: RoomSpace, x: float, y: float) -> float:
    """Distance to the nearest entry, metres."""
    return min((math.hypot(x - ex, y - ey) for ex, ey in space.entries), default=9.0)


def window_distance(space: RoomSpace, x: float, y: float) -> float:
    """Distance to the middle of the nearest window, metres."""
    best = 9.0
    for wall in space.walls:
        for s0, s1, o in wall.openings:
            if o.kind in ("window", "french_window"):
                wx, wy = wall.point((s0 + s1) / 2)
                best = min(best, math.hypot(x - wx, y - wy))
    return best


def wobble(rng: np.random.Generator, degrees: float) -> float:
    """A small turn left by people, radians."""
    return float(np.radians(rng.uniform(-degrees, degrees)))
