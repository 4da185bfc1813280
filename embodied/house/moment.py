"""The moment: what differs now from a house at rest. An empty one is the house itself."""

from __future__ import annotations

import dataclasses
import functools
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from embodied.assets.moving_parts import OPEN, OPENING_CLASSES, TakenApart, closed, openness_of, taken_apart
from embodied.assets.people import Pose, people
from embodied.assets.records import MeshPart
from embodied.geometry import rotation
from embodied.house.house import House, HouseError, Light, Placement
from embodied.house.shapes import room_at

Triple: TypeAlias = tuple[float, float, float]
WIDEST = math.pi / 2
"""Angle of a leaf of openness 1, radians."""
UPRIGHT = 1e-3
"""The most that the z axis of a thing may lean that a House can hold: the sine of the angle."""


@dataclass(frozen=True)
class RigidPose:
    """Position and orientation of a thing's own frame, world."""

    position: Triple
    """Metres."""
    quat: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    """w x y z, unit."""
    top: float = math.inf
    """Height above which nothing of it is, metres: a blind is rolled up there."""

    @staticmethod
    def upright(position: Triple, yaw: float) -> RigidPose:
        """A pose turned about z alone, radians counter-clockwise."""
        return RigidPose(position, (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))

    @functools.cached_property
    def rotation(self) -> np.ndarray:
        """(3, 3) from the thing's frame to the world's."""
        norm = math.hypot(*self.quat)
        w, x, y, z = (a / norm for a in self.quat)
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )

    @property
    def yaw(self) -> float:
        """Turn about z, radians."""
        return math.atan2(self.rotation[1, 0], self.rotation[0, 0])

    def apart(self, other: RigidPose) -> float:
        """Metres between two poses, or a third of the radians between their orientations where that is more."""
        cos = abs(sum(map(operator.mul, self.quat, other.quat)))
        angle = 2 * math.acos(min(cos, 1.0)) if cos < 1 - 1e-12 else 0.0
        return max(math.dist(self.position, other.position), angle / 3)

    def then(self, turn: np.ndarray, shift: np.ndarray, top: float = math.inf) -> RigidPose:
        """The pose of a part of the thing that is turned, (3, 3), and shifted, (3,) metres, in the thing's frame."""
        x, y, z, w = Rotation.from_matrix(self.rotation @ turn).as_quat().tolist()
        a, b, c = (self.rotation @ shift + self.position).tolist()
        return RigidPose((a, b, c), (w, x, y, z), self.position[2] + top)

    def points(self, local: np.ndarray) -> np.ndarray:
        """(n, 3) world metres of points (n, 3) of the thing's frame."""
        out = local @ self.rotation.T.astype(local.dtype) + np.asarray(self.position, local.dtype)
        return out if self.top == math.inf else np.minimum(out, np.array([np.inf, np.inf, self.top], local.dtype))

    def local(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) of the thing's frame, of points (n, 3) of the world."""
        return (points - np.asarray(self.position, points.dtype)) @ self.rotation.astype(points.dtype)


@dataclass(frozen=True)
class MovingPerson:
    """A person where they are now."""

    person: str
    """One of assets.people."""
    place: RigidPose
    """Of the person's frame: on the ground, the front along -y."""
    pose: Pose


@dataclass(frozen=True)
class Moment:
    """Poses and openness that are not those of the house at rest.

    Examples:
      >>> Moment() == Moment(moved={})
      True
    """

    moved: Mapping[str, RigidPose] = field(default_factory=dict)
    """By placement id. What stands on a moved thing and is not named goes with it."""
    openness: Mapping[str, float] = field(default_factory=dict)
    """By opening id, or by placement id and part, 'wardrobe_1/left_door': 0 is closed, 1 open, of doors by WIDEST."""
    bodies: Mapping[str, RigidPose] = field(default_factory=dict)
    """By name: things that are no part of the house, such as the links of a robot."""
    people: Mapping[str, MovingPerson] = field(default_factory=dict)
    """By name: who moves about; those who only stand or sit are placements of the house."""
    lamps: Mapping[str, bool] = field(default_factory=dict)
    """By light id: on or off."""

    @property
    def is_rest(self) -> bool:
        """True where nothing differs."""
        return not (self.moved or self.openness or self.bodies or self.people or self.lamps)

    def check(self, house: House) -> None:
        """Refuse a moment of another house.

        Raises:
          ValueError: it names what the house does not have, an openness outside 0 to 1, or no pose.
        """
        doors = {o.id for o in house.openings if o.opens}
        furniture = {o.partition("/")[0] for o in self.openness if "/" in o}
        for kind, names, known in (
            ("things", {*self.moved, *furniture}, house.placement_by_id),
            ("doors or windows that open", {o for o in self.openness if "/" not in o}, doors),
            ("lights", self.lamps, {x.id for x in house.lights}),
        ):
            if unknown := sorted(set(names) - set(known)):
                raise ValueError(f"house {house.name!r} has no {kind} {unknown}; it has {sorted(known)[:8]} ...")
        if wrong := {o: x for o, x in self.openness.items() if not 0 <= x <= 1}:
            raise ValueError(f"openness should lie between 0 (closed) and 1 (open), got {wrong}")
        if unknown := sorted({f.person for f in self.people.values()} - set(people())):
            raise ValueError(f"there are no people {unknown}; embodied.assets.people.people() has {sorted(people())}")
        places = {name: figure.place for name, figure in self.people.items()}
        for name, pose in {**self.moved, **self.bodies, **places}.items():
            if not all(map(math.isfinite, (*pose.position, *pose.quat))) or not any(pose.quat):
                raise ValueError(f"{name!r} needs 3 finite metres and a quaternion w x y z, got {pose}")

    def open_parts(self, house: House) -> dict[str, dict[str, float]]:
        """How far parts of furniture are open that are not as the house has them, by placement id and part."""
        out: dict[str, dict[str, float]] = {}
        for name, openness in self.openness.items():
            thing, slash, part = name.partition("/")
            if slash and openness_of(house.placement_by_id[thing].params).get(part, 0.0) != openness:
                out.setdefault(thing, {})[part] = openness
        return out

    def poses(self, house: House) -> dict[str, RigidPose]:
        """RigidPose of every placement that is not where the house has it: the moved ones and what stands on them."""
        out: dict[str, RigidPose] = {}
        for p in house.placements:
            if (root := self.carrier(house, p)) is not None:
                out[p.id] = carried(house.placement_by_id[root], self.moved[root], p)
        return out

    def switched(self, house: House) -> House:
        """The house at rest, its lamps as they are at this moment."""
        lights = [dataclasses.replace(x, on=self.lamps.get(x.id, x.on)) for x in house.lights]
        return dataclasses.replace(house, lights=tuple(lights))

    def carrier(self, house: House, p: Placement) -> str | None:
        """Id of the moved placement that carries `p`: itself, or the nearest below it; None where it rests."""
        above: Placement | None = p
        while above is not None and above.id not in self.moved:
            above = house.placement_by_id.get(above.parent or "")
        return None if above is None else above.id

    def applied(self, house: House) -> House:
        """The house as it is at this moment, which can be lit, saved and played.

        Raises:
          ValueError: as `check` does, or a thing leans, which a house cannot hold.
          HouseError: something stands outside of every room.
        """
        self.check(house)
        poses = self.poses(house)
        if leaning := sorted(i for i, pose in poses.items() if pose.rotation[2, 2] < 1 - UPRIGHT):
            raise ValueError(f"{leaning} lean; a house holds upright things only: give poses turned about z alone")
        ajar = self.open_parts(house)
        standing = (_opened(p, ajar[p.id]) if p.id in ajar else p for p in house.placements)
        placements = [_placed(house, p, poses[p.id]) if p.id in poses else p for p in standing]
        openings = [
            dataclasses.replace(o, angle=self.openness[o.id] * WIDEST) if o.id in self.openness else o
            for o in house.openings
        ]
        lights = [_shining(house, x, poses) for x in self.switched(house).lights]
        return dataclasses.replace(house, placements=tuple(placements), openings=tuple(openings), lights=tuple(lights))


def carried(root: Placement, pose: RigidPose, p: Placement) -> RigidPose:
    """RigidPose of `p` when `root`, which carries it, has moved to `pose`."""
    if root is p:
        return pose
    x, y, z = np.subtract(p.position, root.position)
    local = np.array([*(rotation(-root.yaw) @ (x, y)), z])
    half = (p.yaw - root.yaw) / 2
    w, a, b, c = pose.quat
    cos, sin = math.cos(half), math.sin(half)
    quat = (w * cos - c * sin, a * cos + b * sin, b * cos - a * sin, c * cos + w * sin)
    at_x, at_y, at_z = pose.points(local[None])[0].tolist()
    return RigidPose((at_x, at_y, at_z), quat)


def apart(mesh: Callable[..., tuple[MeshPart, ...]], p: Placement) -> TakenApart | None:
    """A placement, closed, with its moving parts apart; None where nothing of it moves. `mesh`: Catalogue.mesh."""
    known = p.object_class in OPENING_CLASSES
    return taken_apart(p.object_class, mesh(p.asset, p.size, closed(p.params))) if known else None


def _opened(p: Placement, openness: Mapping[str, float]) -> Placement:
    params = {**dict(p.params), **{OPEN + part: x for part, x in openness.items()}}
    return dataclasses.replace(
        p, params=tuple(sorted((k, v) for k, v in params.items() if v or not k.startswith(OPEN)))
    )


def _shining(house: House, light: Light, poses: Mapping[str, RigidPose]) -> Light:
    """A light, where its lamp is now."""
    if light.placement is None or light.placement not in poses:
        return light
    p, pose = house.placement_by_id[light.placement], poses[light.placement]
    x, y, z = pose.points(RigidPose.upright(p.position, p.yaw).local(np.array([light.position])))[0].tolist()
    return dataclasses.replace(light, position=(x, y, z), room=room_at(house, (x, y, z)) or light.room)


def _placed(house: House, p: Placement, pose: RigidPose) -> Placement:
    room = room_at(house, np.add(pose.position, (0, 0, 0.05)))
    if room is None:
        raise HouseError(f"{p.id!r} at {pose.position} is outside of every room; move it to a place indoors")
    keeps = p.parent is not None and house.placement_by_id[p.parent].room == p.room
    apart = {} if keeps else {"parent": None, "surface": None}
    return dataclasses.replace(p, position=pose.position, yaw=pose.yaw, room=room, **apart)  # type: ignore[arg-type]
