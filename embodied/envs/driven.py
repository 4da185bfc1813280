"""A body with wheels in the physics of a house, which is the collision boxes of embodied.scene.model; and a robot
there: what it feels, how it rolls, what it holds, opens and touches."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from embodied.assets.people import people as everybody
from embodied.geometry import rotation, wrap
from embodied.house.house import House
from embodied.house.moment import WIDEST, Moment
from embodied.navigation.free_space import ajar_doors
from embodied.scene.bodies import add_person, stand_people
from embodied.scene.doors import HINGE, set_openness
from embodied.scene.joinery import leaf_poses
from embodied.scene.model import COLLISION, build_spec, owner_of_name, yaw_quat
from embodied.scene.robots import ROLLING, PlacedRobot

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.house.house import House


WHEELS = Path(__file__).parent / "wheels.xml"
"""The body; the graph keeps 0.2 m free around every edge, and its radius is 0.19."""
WHEEL, TRACK = 0.08, 0.28
"""Wheel radius and distance between the wheels, metres."""
FASTEST, TURNING = 1.0, 2.5
"""Metres per second and radians per second."""
CONTROL = 0.02
"""Seconds between two commands."""
LEAF_MASS = 14.0
"""Of a leaf on hinges, kg: of wood around a light core."""
APART = 0.5
"""Seconds without touch after which touching the same thing is another collision (Driver.roll): bodies rebound."""


@dataclass(frozen=True)
class Roll:
    """Outcome of a command."""

    metres: float
    """Way of the body's centre."""
    collisions: tuple[str, ...]
    """Things that it began to touch, besides floors, in order."""
    touched: bool
    """It touched something meanwhile."""


class Driver:
    """Owns the physics of one house with the body in it."""

    def __init__(
        self, house: House, catalogue: Catalogue, people: Sequence[str] = (), doors: Collection[str] = ()
    ) -> None:
        """`people`, of assets.people, may walk about and open `doors`, which the body cannot."""
        spec, self._doors = build_spec(house, catalogue, parts=()), dict.fromkeys(doors, 0.0)
        for name in people:
            add_person(spec, name, everybody()[name])
        for name, hinged in _leaves_on_hinges(house, catalogue, ajar_doors(house) | {*doors}).items():
            for g in [g for g in spec.geoms if owner_of_name(g.name) == name]:
                _hang(spec, g, *hinged)
        robot = mujoco.MjSpec.from_file(str(WHEELS))
        for field in ("timestep", "integrator", "cone", "noslip_iterations", "noslip_tolerance"):
            setattr(spec.option, field, getattr(robot.option, field))
        spec.attach(robot, frame=spec.worldbody.add_frame(), prefix="robot/")
        self.model = spec.compile()
        """For pictures through the camera 'robot/eye', together with `data`."""
        self.data = mujoco.MjData(self.model)
        joint = next(j for j in range(self.model.njnt) if self.model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE)
        self._free = slice(self.model.jnt_qposadr[joint], self.model.jnt_qposadr[joint] + 7)
        self._moves = slice(self.model.jnt_dofadr[joint], self.model.jnt_dofadr[joint] + 6)
        self._camera = self.model.camera("robot/eye").id
        self._last_touch: dict[str, float] = {}
        self._motors = [self.model.actuator(f"robot/{side}").id for side in ("left", "right")]
        self._is_own = np.array([self.model.geom(g).name.startswith("robot/") for g in range(self.model.ngeom)])
        self.substeps = max(1, round(CONTROL / self.model.opt.timestep))
        """Steps of the physics in a control period."""

    @property
    def position(self) -> np.ndarray:
        """(2,) where the body's centre is, metres, world."""
        return self.data.qpos[self._free][:2].copy()

    @property
    def yaw(self) -> float:
        w, x, y, z = self.data.qpos[self._free][3:]
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    def place(self, position: np.ndarray, yaw: float) -> None:
        """Put the body down at (x, y, z of the eye) and let it settle."""
        mujoco.mj_resetData(self.model, self.data)
        height = position[2] - 1.5 + 0.005
        self.data.qpos[self._free] = [position[0], position[1], height, math.cos(yaw / 2), 0, 0, math.sin(yaw / 2)]
        self._command(0.0, 0.0)
        mujoco.mj_step(self.model, self.data, 10 * self.substeps)
        self._last_touch = {}

    def roll(self, speed: float, turn: float, periods: int = 1, moment: Moment | None = None) -> Roll:
        """Hold a command for so many control periods.

        Args:
          speed, turn: metres and radians per second, as far as the motors can.
          moment: where people are at the end, and how far doors are open.
        """
        self._command(float(np.clip(speed, -FASTEST, FASTEST)), float(np.clip(turn, -TURNING, TURNING)))
        metres, collisions, touched = 0.0, [], False
        for k in range(periods):
            before = self.position
            self.stand(moment or Moment(), 1 / (periods - k))
            mujoco.mj_step(self.model, self.data, self.substeps)
            metres, time = metres + float(np.linalg.norm(self.position - before)), self.data.time
            now = {owner for _, owner in touches(self.model, self.data, self._is_own)}
            collisions += sorted(t for t in now if time - self._last_touch.get(t, -math.inf) > APART)
            self._last_touch |= dict.fromkeys(now, time)
            touched = touched or bool(now)
        return Roll(metres, tuple(collisions), touched)

    def stand(self, moment: Moment, share: float = 1.0) -> None:
        """Move people a share of the way to where a moment has them, and the doors that they open."""
        if self.model.nmocap:
            stand_people(self.model, self.data, moment, share)
            set_openness(self.model, self.data, {**self._doors, **moment.openness})

    @property
    def eye(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) where the camera is, metres, and (3, 3) its axes as columns (right, up, backward), world."""
        mujoco.mj_camlight(self.model, self.data)
        return self.data.cam_xpos[self._camera].copy(), self.data.cam_xmat[self._camera].reshape(3, 3).copy()

    @property
    def motion(self) -> tuple[float, float]:
        """Metres per second ahead, and radians per second to the left."""
        velocity = self.data.qvel[self._moves]
        return float(velocity[0] * math.cos(self.yaw) + velocity[1] * math.sin(self.yaw)), float(velocity[5])

    def _command(self, speed: float, turn: float) -> None:
        for motor, side in zip(self._motors, (-1.0, 1.0), strict=True):
            self.data.ctrl[motor] = (speed + side * turn * TRACK / 2) / WHEEL


def touches(model: mujoco.MjModel, data: mujoco.MjData, is_own: np.ndarray) -> Iterator[tuple[int, str]]:
    """Number and owner of each contact with anything but floors of a body that has some geoms, (ngeom,) bool."""
    for k, (a, b) in enumerate(data.contact.geom if data.ncon else ()):
        if is_own[a] != is_own[b]:
            owner = owner_of_name(model.geom(b if is_own[a] else a).name)
            if not owner.endswith("/floor"):
                yield k, owner


def _leaves_on_hinges(
    house: House, catalogue: Catalogue, doors: Collection[str]
) -> dict[str, tuple[np.ndarray, float, float, float]]:
    """Hinge, metres, yaw, radians, and how far it is open and opens, signed, of the leaves of doors, by owner."""
    out = {}
    for o in (o for o in house.openings if o.id in doors):
        poses = lambda angle, o=o: leaf_poses(house, dataclasses.replace(o, angle=angle), catalogue.finish)
        shut, wide = poses(0.0), poses(WIDEST)
        for name, (hinge, yaw) in poses(o.angle).items():
            out[owner_of_name(name)] = np.array(hinge), yaw, yaw - shut[name][1], wide[name][1] - shut[name][1]
    return out


def _hang(spec: mujoco.MjSpec, box: mujoco.MjsGeom, hinge: np.ndarray, yaw: float, turn: float, opens: float) -> None:
    """Put the box of a leaf on hinges; it meets bodies alone."""
    opening, _, piece = owner_of_name(box.name).partition("/")
    leaf = spec.worldbody.add_body(name=f"{opening}_{piece}", pos=hinge, quat=yaw_quat(yaw))
    limits = {"range": np.degrees([0, WIDEST]), "limited": True, "ref": math.degrees(abs(turn))}
    joint = f"{opening}_{'right' if piece == 'leaf_2' else ''}doorhinge"
    leaf.add_joint(name=joint, axis=[0, 0, math.copysign(1.0, opens)], **limits, **HINGE)
    pos = [*(rotation(-yaw) @ (box.pos - hinge)[:2]), box.pos[2] - hinge[2]]
    facts = {"name": box.name, "type": box.type, "size": box.size.copy(), "pos": pos, "mass": LEAF_MASS}
    spec.delete(box)
    leaf.add_geom(**facts, contype=2, conaffinity=2)


GRASP, LETS_GO = 0.15, 0.3
"""Metres from the hand within which an assisted grasp takes hold, and at which a handle slips away: Habitat's rule, in
which a thing that is held touches nothing and a handle follows the hand."""
PERIOD = 0.02
"""Seconds after which velocities are set and what is held is brought to the hand."""
UNITS = {int(mujoco.mjtJoint.mjJNT_SLIDE): "m", int(mujoco.mjtJoint.mjJNT_HINGE): "rad"}
FETCHER = Path(__file__).parent / "fetcher.xml"
"""A mobile manipulator of our own, to be placed rolling; its hand is the site 'grip'."""


class RobotBody:
    """Owns the physics of one house with a robot in it."""

    def __init__(self, house: House, spec: mujoco.MjSpec, placed: PlacedRobot, *, hand: str, assisted: bool) -> None:
        """`hand`: site or body of the robot; `assisted`: it holds what is within GRASP, not by its fingers alone."""
        self.house, self.placed, self.assisted, self.model = house, placed, assisted, spec.compile()
        m, start = self.model, f"{placed.name}/"
        self.data = mujoco.MjData(m)
        bodies, sites = ({of(k).name: k for k in range(n)} for n, of in ((m.nbody, m.body), (m.nsite, m.site)))
        self.root = min(b for name, b in bodies.items() if name.startswith(start))  # its base
        if start + hand not in {*bodies, *sites}:
            known = sorted(n.removeprefix(start) for n in {*bodies, *sites} if n.startswith(start))
            raise ValueError(f"the robot has no site or body {hand!r} for a hand; it has {known}")
        self._hand = self.data.site(start + hand).xpos if start + hand in sites else self.data.body(start + hand).xpos
        wrist = m.site_bodyid[sites[start + hand]] if start + hand in sites else bodies[start + hand]
        rolls = f"{start}rolling" in bodies
        self._base = [m.joint(start + k).qposadr[0] for k in ROLLING] if rolls else []
        self._wheels = [m.actuator(start + k).id for k in ROLLING] if rolls else []
        self.arm = [a for a in range(m.nu) if m.actuator(a).name.startswith(start) and a not in self._wheels]
        own = [j for j in range(m.njnt) if m.joint(j).name.startswith(start) and m.jnt_qposadr[j] not in self._base]
        self._joints = [j for j in own if m.jnt_type[j] in UNITS]
        under = {int(wrist)}  # bodies that hang on it
        for b in range(wrist + 1, m.nbody):
            under |= {b} if m.body_parentid[b] in under else set()
        self._wrist, self._fingers = int(wrist), np.isin(m.jnt_bodyid[self._joints], sorted(under - {wrist}))
        words = [f"{m.joint(j).name} {UNITS[m.jnt_type[j]]}" for j in self._joints]
        self.feels = (*words, *(f"{x}/s" for x in words), "ahead m/s", "left m/s", "turn rad/s", "holds")
        """Names and units of `proprioception`."""
        self._is_own = np.array([m.body(b).name.startswith(start) for b in m.geom_bodyid])
        self.things = {n: b for n, b in bodies.items() if n in house.placement_by_id and m.body_jntnum[b]}
        self.handles = {n.removesuffix("_handle"): b for n, b in bodies.items() if "_handle" in n and "/" not in n}
        """Bodies of what can be taken, by placement id, and of handles, by what they open."""
        self.held: str | None = None
        """The thing, or what it opens, that an assisted hand holds."""
        self.reset()

    def reset(self) -> None:
        """Everything at rest, and the robot at its start."""
        self._let_go()
        mujoco.mj_resetDataKeyframe(self.model, self.data, self.model.key(f"{self.placed.name}/start").id)
        self.metres, self.met, self.rolling = 0.0, dict[str, float](), np.zeros(3)
        """Metres of its way; the largest force, N, by owner of what it touched in the last step; and velocities of a
        rolling base, ahead, to the left and around, metres and radians per second."""
        mujoco.mj_forward(self.model, self.data)

    def stand(self, xy: np.ndarray, yaw: float) -> None:
        """Put a robot that rolls elsewhere on its floor; any other stays."""
        if self._base:
            self.data.qpos[self._base] = np.subtract((*xy, yaw), (*self.placed.pose[:2], self.placed.pose[3]))
            mujoco.mj_forward(self.model, self.data)

    @property
    def position(self) -> np.ndarray:
        """(2,) metres, world."""
        return self.data.xpos[self.root][:2].copy()

    @property
    def yaw(self) -> float:
        turned = self.data.xmat[self.root]
        return float(wrap(math.atan2(turned[3], turned[0]) + (self.placed.pose[3] if self._base else 0.0)))

    @property
    def hand(self) -> np.ndarray:
        """(3,) metres, world."""
        return self._hand.copy()

    def step(self, seconds: float, *, holding: bool = False) -> None:
        """Let time pass while `rolling` and the controls are held; `holding` is whether an assisted hand is closed."""
        before, force, self.met = self.position, np.zeros(6), {}
        for _ in range(max(1, round(seconds / PERIOD))):
            if self._wheels:
                self.data.ctrl[self._wheels] = *(rotation(self.yaw) @ self.rolling[:2]), self.rolling[2]
            mujoco.mj_step(self.model, self.data, max(1, round(PERIOD / self.model.opt.timestep)))
            if self.assisted:
                self._hold() if holding else self._let_go()
            for k, owner in touches(self.model, self.data, self._is_own):
                mujoco.mj_contactForce(self.model, self.data, k, force)
                self.met[owner] = max(self.met.get(owner, 0.0), float(force[0]))
        self.metres += float(np.linalg.norm(self.position - before))

    def proprioception(self) -> np.ndarray:
        """(len(feels),) float32: joints, their speeds, motion of the base, and 1 where a hand holds something."""
        adr, dof, v = self.model.jnt_qposadr[self._joints], self.model.jnt_dofadr[self._joints], np.zeros(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, self.root, v, 0)
        motion = *(rotation(-self.yaw) @ v[3:5]), v[2], float(self.held is not None)
        return np.concatenate([self.data.qpos[adr], self.data.qvel[dof], motion]).astype(np.float32)

    def robosuite(self) -> dict[str, np.ndarray]:
        """float32, by robosuite's names: joints of the arm and of the gripper, and the hand in the world, x y z w."""
        q, v = self.data.qpos[self.model.jnt_qposadr[self._joints]], self.data.qvel[self.model.jnt_dofadr[self._joints]]
        arm, hand = ~self._fingers, np.roll(self.data.xquat[self._wrist], -1)
        values = {"joint_pos": q[arm], "joint_vel": v[arm], "gripper_qpos": q[~arm], "gripper_qvel": v[~arm]}
        values |= {"eef_pos": self._hand, "eef_quat": hand, "base_pos": self.data.xpos[self.root]}
        return {f"robot0_{name}": value.astype(np.float32) for name, value in values.items()}

    def thing(self, name: str) -> np.ndarray:
        """(3,) centre of mass of a thing, metres, world."""
        return self.data.xipos[self.things[name]].copy()

    def _let_go(self) -> None:
        if self.held is not None and self.held in self.things:
            self._be_solid(self.held, True)
        self.held = None

    def _hold(self) -> None:
        if self.held is None:
            self._take()
        if self.held in self.things:
            joint = self.model.body_jntadr[self.things[self.held]]
            adr, dof = self.model.jnt_qposadr[joint], self.model.jnt_dofadr[joint]
            self.data.qpos[adr : adr + 3] = self.hand + self._offset
            self.data.qvel[dof : dof + 6] = 0.0
        elif self.held is not None:
            self._pull(self.handles[self.held])

    def _take(self) -> None:
        """Take hold of what is within GRASP and has its middle nearest to the hand."""
        hand, near = self.hand, {}
        for name, b in {**self.handles, **self.things}.items():
            away = float(np.linalg.norm(hand - self.data.xipos[b]))
            if (p := self.house.placement_by_id.get(name)) is not None:
                local = self.data.xmat[b].reshape(3, 3).T @ (hand - self.data.xpos[b]) - (0, 0, p.size[2] / 2)
                outside = float(np.linalg.norm(np.maximum(np.abs(local) - np.array(p.size) / 2, 0)))
            if (away if p is None else outside) <= GRASP:
                near[name] = away
        if near:
            self.held = min(near, key=lambda n: near[n])
            if self.held in self.things:
                self._offset = self.data.xpos[self.things[self.held]] - hand
                self._be_solid(self.held, False)

    def _be_solid(self, thing: str, solid: bool) -> None:
        own = np.flatnonzero(self.model.geom_bodyid == self.things[thing])
        touches = solid * (self.model.geom_group[own] == COLLISION)
        self.model.geom_contype[own] = self.model.geom_conaffinity[own] = touches

    def _pull(self, handle: int) -> None:
        """Bring a joint to where its handle is nearest to the hand."""
        joint, at = self.model.body_jntadr[self.model.body_parentid[handle]], self.data.xipos[handle]
        error, way = self.hand - at, self.data.xaxis[joint]
        if np.linalg.norm(error) > LETS_GO:
            self.held = None
            return
        if self.model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE:
            way = np.cross(way, at - self.data.xanchor[joint])
        adr = self.model.jnt_qposadr[joint]
        turned = self.data.qpos[adr] + np.clip(way @ error / (way @ way), -0.1, 0.1)
        self.data.qpos[adr] = np.clip(turned, *self.model.jnt_range[joint])
        self.data.qvel[self.model.jnt_dofadr[joint]] = 0.0
