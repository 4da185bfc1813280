"""Gait: how a body walks, turns, climbs stairs, sits down, reaches and looks.

Feet are put down and stay where they are; legs follow by two-bone inverse kinematics. Trunk, arms and the way of a foot
through the air are those of a recorded walk.

Source: humanoid3d_walk of DeepMimic (X. B. Peng et al., 2018), a walk of the CMU motion capture database, as PyPI's
pybullet 3.2.7 ships it: 38 frames, a cycle of 1.27 s, by least squares.
"""

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from embodied.assets.json_file import read_toml
from embodied.assets.people import Person, Pose, gaze, joint_positions, people
from embodied.assets.people.bodies import rotation_of, transforms
from embodied.geometry import rotation, wrap, yaw_facing
from embodied.house.moment import MovingPerson, RigidPose

CYCLE: Any = read_toml(Path(__file__).with_suffix(".toml"))
"""Rows of Fourier series over a cycle, by name (gait.toml)."""
STRIDE, STANCE = 1.405, 0.55
"""Leg lengths of a cycle of two steps, and the share of it that a foot is on the ground."""
PACE, EASE = 1.15, 0.5
"""Leg lengths a second (a grown person: 1 m/s), and seconds from standing to walking and back."""
TURN_METRES, TURN_STEP, TURN_PACE = 0.35, 0.8, 0.45
"""Metres that a radian of turning on the spot counts as, radians of one step of it, and metres a second."""
SWAY = 0.012
"""Metres that the pelvis sways from its way at most (recorded: 0.02), so that who walks keeps to the free floor."""
FLAT_FOOT, FOOT_CLEARANCE = 0.05, 0.025
"""Pitch of a foot, radians, below which it stands flat, and leg lengths of its sole above the ground in the air."""
BALL, HEEL = 0.15, 0.055
"""Leg lengths from below the ankle to the ball of the foot and to the heel."""
NOTICED, BEHIND, CHEST = 2.5, 2.6, 2
"""Metres and radians from straight ahead beyond which nobody looks at somebody; number of a joint."""
SIDES = ("right", "left")
UP, FRONT = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])
Foot: TypeAlias = np.ndarray
"""(5,) x, y and z of the ankle, metres, world; heading; pitch, toes down."""
Posed: TypeAlias = tuple[RigidPose, Pose]
"""The place of a body, and the turns of its joints."""


def cycle(name: str, phase: float) -> np.ndarray:
    """The rows of CYCLE at a phase, 0 to 1."""
    k = np.arange(1, 6) * (2 * math.pi * phase)
    waves = np.column_stack([np.cos(k), np.sin(k)]).ravel()
    return np.array([row[0] + np.dot(row[1:], waves[: len(row) - 1]) for row in CYCLE[name]])


def smooth(t: float) -> float:
    """From 0 to 1, slow at both ends."""
    t = min(max(t, 0.0), 1.0)
    return t * t * (3 - 2 * t)


@dataclass(frozen=True, eq=False)
class Bearing:
    """A body at an instant, before its joints are known: metres, world, on the ground below the pelvis; right and left
    foot; metres of the pelvis above where it stands; rotation vectors by joint, arms from hanging down; and what hands
    reach for, by side, and eyes look at, metres, world."""

    position: np.ndarray
    heading: float
    feet: tuple[Foot, ...]
    lift: float
    turns: Mapping[str, np.ndarray]
    hands: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)
    look: np.ndarray | None = None


class Limbs:
    """A body, as far as its gait depends on it."""

    def __init__(self, person: Person) -> None:
        self.joints = {name: np.array(at) for name, at in person.joints.items()}
        self.leg, self.ankle, self.seat = person.leg_length, float(self.joints["left_foot"][2]), person.seat

    def length(self, *names: str) -> float:
        """Metres along joints."""
        return float(sum(np.linalg.norm(self.joints[b] - self.joints[a]) for a, b in pairwise(names)))

    def planted(self, ground: np.ndarray, heading: float, pitch: float = 0.0) -> Foot:
        """A foot whose ankle is above (3,) `ground` when it is flat, rolled over its heel or its ball."""
        pivot, s, c = (BALL if pitch > 0 else -HEEL) * self.leg, math.sin(pitch), math.cos(pitch)
        along, up = pivot * (1 - c) + self.ankle * s, pivot * s + self.ankle * c
        return np.array([*(ground + (along * math.cos(heading), along * math.sin(heading), up)), heading, pitch])

    def beside(self, position: np.ndarray, heading: float, side: int) -> np.ndarray:
        """(3,) the place of a foot of a body that stands, 0 right, 1 left."""
        apart = float(self.joints["left_thigh"][0]) * (2 * side - 1)
        return position + (-apart * math.sin(heading), apart * math.cos(heading), 0.0)

    def standing(self, position: np.ndarray, heading: float) -> Bearing:
        """Both feet side by side."""
        feet = tuple(self.planted(self.beside(position, heading, k), heading) for k in (0, 1))
        return self.swinging(position, heading, feet, 0.0, 0.0)

    def swinging(self, position: np.ndarray, heading: float, feet: tuple[Foot, ...], phase: float, w: float) -> Bearing:
        """The bearing at a phase of the cycle, whose trunk and arms swing with a share `w` of the recorded vigour."""
        turns = {"pelvis": w * cycle("pelvis", phase)}
        turns["spine"] = turns["chest"] = w / 2 * cycle("chest", phase)
        for k, side in enumerate(SIDES):
            for bone, still in (("upper_arm", (0.05, 0.12, 0.0)), ("forearm", (-0.2, 0.0, 0.0))):
                turned = w * cycle(bone, (phase + k / 2) % 1) + (1 - w) * np.array(still)
                turns[f"{side}_{bone}"] = turned * (1, 1 - 2 * k, 1 - 2 * k)
        *flat, up = w * self.leg * cycle("offset", phase)
        away = rotation(yaw_facing(heading)) @ flat * min(1.0, SWAY / max(math.hypot(*flat), 1e-9))
        return Bearing(position + [*away, 0.0], heading, feet, float(up), turns)


@dataclass(frozen=True, eq=False)
class Course:
    """A walk from standing to standing, or a turn on the spot: along (m, 5) metres walked, x, y, z and heading, feet
    put down in turn at (k, 2) metres walked and heights of the ground there, so many metres a second."""

    limbs: Limbs
    line: np.ndarray
    plants: np.ndarray
    speed: float

    @functools.cached_property
    def seconds(self) -> float:
        return float(self.line[-1, 0]) / self.speed + EASE

    def walked(self, seconds: float) -> float:
        """Metres walked; a short way is all starting and stopping."""
        whole = float(self.line[-1, 0])
        ease = min(whole / self.speed, EASE)
        top, t = whole / (self.seconds - ease), min(max(seconds, 0.0), self.seconds)
        rise = lambda x: top * x * x / (2 * ease) if x < ease else top * (x - ease / 2)
        return rise(t) if t <= self.seconds - ease else whole - rise(self.seconds - t)

    def body(self, walked: float) -> tuple[np.ndarray, float]:
        """(3,) where the body is, and its heading."""
        *at, heading = (float(np.interp(walked, self.line[:, 0], c)) for c in self.line[:, 1:].T)
        return np.array(at), heading

    def at(self, seconds: float) -> Bearing:
        p, walked = self.plants[:, 0], self.walked(seconds)
        strikes = np.concatenate([[0.0], (p[1:] + p[:-1]) / 2])  # the body is half way from the last footfall
        step, beat = p[-1] / (len(p) - 2), float(np.interp(walked, strikes, np.arange(len(p))))
        vigour = (
            min(2 * step / (STRIDE * self.limbs.leg), 1.0) * smooth(walked / step) * smooth((p[-1] - walked) / step)
        )
        feet = tuple(self._foot(beat, side, vigour) for side in (0, 1))
        return self.limbs.swinging(*self.body(walked), feet, (beat - 1) / 2 % 1, vigour)

    def _foot(self, beat: float, side: int, vigour: float) -> Foot:
        """A foot at a beat: footfall k comes down at beat k, first the right."""
        before = side + 1 + 2 * math.floor((beat - side - 1) / 2)
        turned, ends = (beat - before) / 2, []
        pitch = float(cycle("foot", turned)[2])
        pitch = vigour * math.copysign(max(abs(pitch) - FLAT_FOOT, 0.0), pitch)
        for number in (before, before + 2):
            walked, height = self.plants[min(max(number, 0), len(self.plants) - 1)]
            (x, y, _), heading = self.body(float(walked))
            place = self.limbs.beside(np.array([x, y, height]), heading, side)
            ends.append(self.limbs.planted(place, heading, pitch))
        a, b = ends
        if turned <= STANCE or before + 2 >= len(self.plants):
            return a
        lift_off, strike = cycle("foot", STANCE), cycle("foot", 1.0)
        t, air = (turned - STANCE) / (1 - STANCE), STRIDE * (1 - STANCE)
        ahead, up, _ = cycle("foot", turned) - lift_off
        u = float((ahead + air * t) / (strike[0] - lift_off[0] + air))
        up = float(up - (strike - lift_off)[1] * t) * max(vigour, 0.4) * self.limbs.leg
        early = min(t * 2, 1.0) if b[2] > a[2] else max(t * 2 - 1, 0.0)  # up before the edge of a tread, down behind it
        x, y, _ = a[:3] + (b - a)[:3] * u
        return np.array(
            [
                x,
                y,
                a[2] + (b[2] - a[2]) * early + max(up, FOOT_CLEARANCE * self.limbs.leg * math.sin(math.pi * t)),
                a[3] + (b[3] - a[3]) * t,
                pitch,
            ]
        )


def walk(limbs: Limbs, points: np.ndarray, headings: np.ndarray, treads: Sequence[tuple[float, float]] = ()) -> Course:
    """A walk along a line.

    Args:
      points: (m, 3) metres, world, on the ground.
      headings: (m,) radians, without jumps.
      treads: of stairs on the way: metres walked at the middle of each tread, and its height.
    """
    walked = np.cumsum([0.0, *np.maximum(np.hypot(*np.diff(points[:, :2], axis=0).T), 1e-6)])
    plants = [(0.0, points[0, 2])]
    for b, high in (*treads, (walked[-1], points[-1, 2])):
        a, low = plants[-1]
        parts = max(1, math.ceil((b - a) / (STRIDE / 2 * limbs.leg) - 1e-6))
        plants += [(a + (b - a) * k / parts, low if 2 * k < parts else high) for k in range(1, parts + 1)]
    line, speed = np.column_stack([walked, points, headings]), PACE * limbs.leg * (0.6 if len(treads) else 1.0)
    return Course(limbs, line, np.array([*plants, plants[-1]]), speed)


def turn(limbs: Limbs, position: np.ndarray, begin: float, end: float) -> Course:
    """A turn on the spot, from one heading to another, the shorter way."""
    by = float(wrap(end - begin))
    metres, parts = max(abs(by), 1e-3) * TURN_METRES, math.ceil(abs(by) / TURN_STEP + 1e-6)
    line = np.array([[0.0, *position, begin], [metres, *position, begin + by]])
    walked = np.append(np.linspace(0, metres, parts + 1), metres)
    return Course(limbs, line, np.column_stack([walked, np.full(len(walked), position[2])]), TURN_PACE)


def sitting(limbs: Limbs, begin: Bearing, seat: np.ndarray, heading: float, share: float) -> Bearing:
    """The bearing of who sits down; backwards, of who gets up.

    Args:
      begin: standing beside or before the seat.
      seat: (3,) metres, world: the middle of what is sat on, on its surface.
      share: 0 standing, 1 sitting.
    """
    goes, down, ground = smooth(share / 0.7), smooth((share - 0.35) / 0.65), float(begin.position[2])
    by, below, leg = float(wrap(heading - begin.heading)), np.array([*seat[:2], ground]), limbs.leg
    knee = 0.95 * limbs.length("left_thigh", "left_shin") * np.array([math.cos(heading), math.sin(heading), 0.0])
    lift, feet = float(seat[2]) - ground + limbs.seat - float(limbs.joints["pelvis"][2]), []
    hip = ground + float(limbs.joints["left_thigh"][2]) + lift
    for k, foot in enumerate(begin.feet):
        u, end = smooth((share - 0.05 - 0.3 * k) / 0.3), limbs.planted(limbs.beside(below + knee, heading, k), heading)
        end[2:4] = max(end[2], hip - 0.97 * limbs.length("left_shin", "left_foot")), foot[3] + by
        feet.append(foot + (end - foot) * u + [0, 0, 0.06 * leg * math.sin(math.pi * u), 0, 0])
    lean = 0.35 * math.sin(math.pi * down)
    turns = {**begin.turns, "pelvis": np.array([lean - 0.15 * down, 0, 0]), "chest": np.array([lean, 0, 0])}
    at = begin.position * (1 - goes) ** 2 + (below + knee) * 2 * goes * (1 - goes) + below * goes**2
    return Bearing(at, begin.heading + by * goes, tuple(feet), down * lift, turns)


def between(a: Posed, b: Posed, share: float) -> Posed:
    """A body on its way from one pose to another, each joint the shorter way."""
    none, joints = np.zeros(3), {}
    for name in {**a[1].joints, **b[1].joints}:
        first, last = (Rotation.from_rotvec(p.joints.get(name, none)) for _, p in (a, b))
        x, y, z = (first * Rotation.from_rotvec(share * (first.inv() * last).as_rotvec())).as_rotvec().tolist()
        joints[name] = x, y, z
    mix = lambda p, q: p + share * (q - p)
    x, y, z = mix(np.array(a[0].position), np.array(b[0].position)).tolist()
    yaw = a[0].yaw + share * float(wrap(b[0].yaw - a[0].yaw))
    return RigidPose.upright((x, y, z), yaw), Pose(joints, mix(a[1].lift, b[1].lift))


def solved(limbs: Limbs, b: Bearing) -> Posed:
    """The place of a body and the turns of its joints; the pelvis comes down where the legs do not reach."""
    j, yaw, lift = limbs.joints, yaw_facing(b.heading), b.lift
    back = rotation_of((0.0, 0.0, -yaw))
    local = lambda p: back @ (np.asarray(p) - b.position)
    out = {name: rotation_of(v) for name, v in b.turns.items()}
    of = lambda name: out.get(name, np.eye(3))
    pelvis = chest = of("pelvis")
    legs = [(f"{n}_thigh", f"{n}_shin", f"{n}_foot") for n in SIDES]
    hips = [j["pelvis"] + pelvis @ (j[n] - j["pelvis"]) for n, _, _ in legs]
    for hip, names, f in zip(hips, legs, b.feet):
        away, reach = local(f[:3]) - hip, 0.998 * limbs.length(*names)
        lift = min(lift, float(away[2]) + math.sqrt(max(reach**2 - away[:2] @ away[:2], 0.0)))
    for hip, names, f in zip(hips, legs, b.feet):
        outwards = f[3] - b.heading
        knee = rotation_of(UP * outwards / 2) @ FRONT + 0.5 * UP  # up, too: it rises where one sits
        thigh, shin = _bent(limbs, names, hip + UP * lift, local(f[:3]), knee, FRONT)
        foot = rotation_of(UP * outwards) @ rotation_of((f[4], 0.0, 0.0))
        out |= dict(zip(names, (pelvis.T @ thigh, thigh.T @ shin, shin.T @ foot)))
    at = j["pelvis"] + UP * lift
    for below, name in (("pelvis", "spine"), ("spine", "chest")):
        at, chest = at + chest @ (j[name] - j[below]), chest @ of(name)
    point = lambda name: at + chest @ (j[name] - j["chest"])
    for n in SIDES:
        upper, lower, hand = names = f"{n}_upper_arm", f"{n}_forearm", f"{n}_hand"
        if n in b.hands:
            elbow = np.array([0.5 if n == "left" else -0.5, 0.3, -1.0])
            arm, forearm = _bent(limbs, names, point(upper), local(b.hands[n]), elbow, -FRONT)
            out |= {upper: chest.T @ arm, lower: arm.T @ forearm}
        else:
            hang, hang_lower = (_hanging(j[y] - j[x]) for x, y in pairwise(names))
            out |= {upper: of(upper) @ hang, lower: hang.T @ of(lower) @ hang_lower}
    if b.look is not None:
        x, y, z = chest.T @ (local(b.look) - point("head"))
        turned, nod = np.clip([math.atan2(x, -y), math.atan2(z, math.hypot(x, y))], (-1.2, -0.6), (1.2, 0.6)) / 2
        out |= dict.fromkeys(("neck", "head"), rotation_of((0.0, 0.0, turned)) @ rotation_of((-nod, 0.0, 0.0)))
    x, y, z = b.position.tolist()
    vectors = zip(out, Rotation.from_matrix(np.array([*out.values()])).as_rotvec().tolist())
    return RigidPose.upright((x, y, z), yaw), Pose({name: (a, b, c) for name, (a, b, c) in vectors}, lift)


def looking(figure: MovingPerson, eye: np.ndarray) -> MovingPerson:
    """Somebody who turns eyes and head, as far as the neck lets them, to (3,) an eye, metres, world: wholly within 2 m,
    not beyond NOTICED; nor who lies, or has it behind."""
    person, place = people()[figure.person], figure.place
    chest = place.rotation @ transforms(person, figure.pose)[CHEST, :, :3]
    x, y, z = chest.T @ (eye - place.points(joint_positions(person, figure.pose)["head"][None])[0])
    yaw, far = math.atan2(x, -y), math.hypot(x, y, z)
    share = smooth(2 * (NOTICED - far)) * smooth(2 * (BEHIND - abs(yaw))) * (chest[2, 2] > 0.5)
    seen = gaze(figure.pose, yaw, math.atan2(z, math.hypot(x, y)))
    return dataclasses.replace(figure, pose=between((place, figure.pose), (place, seen), share)[1]) if share else figure


def _hanging(bone: np.ndarray) -> np.ndarray:
    """(3, 3) the shortest turn of a bone (3,) until it hangs down."""
    axis = np.cross(bone, -UP)
    sine = float(np.linalg.norm(axis))
    return rotation_of(axis * (math.atan2(sine, -float(bone[2])) / max(sine, 1e-12)))


def _bent(
    limbs: Limbs, names: tuple[str, str, str], root: np.ndarray, target: np.ndarray, bend: np.ndarray, rest: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(3, 3) turns of the two bones of a limb whose end is at `target`, or as near as it reaches.

    Args:
      bend, rest: (3,) where the joint between them goes, now and in the body that stands.
    """
    first, second = (limbs.joints[b] - limbs.joints[a] for a, b in pairwise(names))
    upper, lower, away = limbs.length(*names[:2]), limbs.length(*names[1:]), target - root
    far = float(np.clip(np.linalg.norm(away), abs(upper - lower) + 1e-3, upper + lower - 1e-4))
    ahead = away / max(float(np.linalg.norm(away)), 1e-9)
    side = np.cross(ahead, bend)
    cos = (upper**2 + far**2 - lower**2) / (2 * upper * far)
    over = np.cross(side, ahead) / max(float(np.linalg.norm(side)), 1e-9)
    middle = upper * (cos * ahead + math.sqrt(max(1 - cos * cos, 0.0)) * over)
    still = np.cross(first + second, rest)
    turned = lambda new, old: _frame(new, side) @ _frame(old, still).T
    return turned(middle, first), turned(ahead * far - middle, second)


def _frame(along: np.ndarray, side: np.ndarray) -> np.ndarray:
    """(3, 3) orthonormal columns: the first along (3,), the second as near to `side` as that allows."""
    across = np.cross(along, side)
    frame = np.array([along, np.cross(across, along), across])
    return np.asarray(frame / np.sqrt((frame * frame).sum(1, keepdims=True))).T
