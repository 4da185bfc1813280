"""A body with wheels in the physics of a house, which is the collision boxes of embodied.scene.model."""

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
from embodied.geometry import rotation
from embodied.house.moment import WIDEST, Moment
from embodied.navigation.free_space import ajar_doors
from embodied.scene.doors import HINGE, set_openness
from embodied.scene.joinery import leaf_poses
from embodied.scene.model import build_spec, owner_of_name, yaw_quat
from embodied.scene.people import add_person, stand_people

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
