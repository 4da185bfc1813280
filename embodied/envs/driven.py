"""A body with wheels among the collision boxes of a house (embodied.scene.model), driven by velocities."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

import mujoco
import numpy as np

from embodied.scene.model import build_spec, owner_of_name

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.house.house import House

HEIGHT, WHEEL, TRACK = 1.4, 0.08, 0.28
"""Of the body in wheels.xml, metres: its height, the wheels' radius, and how far apart they are."""
FASTEST, TURNING = 1.0, 2.5
"""Metres per second and radians per second."""
CONTROL = 0.02
"""Seconds between two commands."""
APART = 0.5
"""Seconds without touch after which touching the same thing is another collision (Driver.roll): bodies rebound."""


ROBOT = Path(__file__).with_name("wheels.xml")


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

    def __init__(self, house: House, catalogue: Catalogue) -> None:
        spec, self._owners = house_with_robot(house, catalogue)
        self.model = spec.compile()
        """For pictures through the camera 'robot/eye', together with `data`."""
        self.data = mujoco.MjData(self.model)
        joint = next(j for j in range(self.model.njnt) if self.model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE)
        self._free = slice(self.model.jnt_qposadr[joint], self.model.jnt_qposadr[joint] + 7)
        self._moves = slice(self.model.jnt_dofadr[joint], self.model.jnt_dofadr[joint] + 6)
        self._camera = self.model.camera("robot/eye").id
        self._last_touch: dict[str, float] = {}
        self._motors = [self.model.actuator(f"robot/{side}").id for side in ("left", "right")]
        self._names = [self.model.geom(g).name for g in range(self.model.ngeom)]
        self._mine = np.array([name.startswith("robot/") for name in self._names])
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

    def roll(self, speed: float, turn: float, periods: int = 1) -> Roll:
        """Hold a command for so many control periods.

        Args:
          speed, turn: metres and radians per second, as far as the motors can.
        """
        self.command(speed, turn)
        rolled = Roll(0.0, (), False)
        for _ in range(periods):
            before = self.position
            mujoco.mj_step(self.model, self.data, self.substeps)
            rolled = self.noted(rolled, before, self.owners_met(self.data.contact.geom1, self.data.contact.geom2))
        return rolled

    def command(self, speed: float, turn: float) -> None:
        """Set the motors, as far as they go."""
        self._command(float(np.clip(speed, -FASTEST, FASTEST)), float(np.clip(turn, -TURNING, TURNING)))

    def noted(self, rolled: Roll, before: np.ndarray, now: frozenset[str]) -> Roll:
        """`rolled` after one more period that began at `before` (2,), at whose end the body touches `now`."""
        metres, time = float(np.linalg.norm(self.position - before)), self.data.time
        collisions = sorted(t for t in now if time - self._last_touch.get(t, -math.inf) > APART)
        self._last_touch |= dict.fromkeys(now, time)
        return Roll(rolled.metres + metres, (*rolled.collisions, *collisions), rolled.touched or bool(now))

    def take_over(self, qpos: np.ndarray, qvel: np.ndarray, seconds: float) -> None:
        """Be in a state that was computed elsewhere, so many seconds after the last; `eye` follows `update_poses`."""
        self.data.qpos[:], self.data.qvel[:] = qpos, qvel
        self.data.time += seconds

    def update_poses(self) -> None:
        """Compute the poses of all parts from the state."""
        mujoco.mj_kinematics(self.model, self.data)

    def twin(self) -> Self:
        """Another body in the same house; they do not meet."""
        other = copy.copy(self)
        other.data, other._last_touch = mujoco.MjData(self.model), {}
        return other

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

    def owners_met(self, geoms: np.ndarray, others: np.ndarray) -> frozenset[str]:
        """Owners, floors apart, of what the body touches, by pairs of geoms in contact (n,)."""
        touched = set()
        for a, b in zip(geoms, others, strict=True):
            if self._mine[a] != self._mine[b]:
                owner = self._owners.get(self._names[b if self._mine[a] else a], "")
                if not owner.endswith("/floor"):
                    touched.add(owner)
        return frozenset(touched)


def house_with_robot(house: House, catalogue: Catalogue) -> tuple[mujoco.MjSpec, dict[str, str]]:
    """The house's collision boxes with the body among them, and the owner of each box by the name of its geom."""
    model = build_spec(house, catalogue, parts=()).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    spec = mujoco.MjSpec.from_file(str(ROBOT))
    owners, floors = {}, [s.elevation for s in house.storeys]
    for g in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_BOX):
        middle, half = data.geom_xpos[g][2], float(np.abs(data.geom_xmat[g][6:]) @ model.geom_size[g])
        if is_overhead(middle - half, middle + half, floors):
            continue
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, data.geom_xmat[g])
        box = {"name": f"box{g}", "type": mujoco.mjtGeom.mjGEOM_BOX, "size": model.geom_size[g], "quat": quat}
        spec.worldbody.add_geom(pos=data.geom_xpos[g], **box)
        owners[box["name"]] = owner_of_name(model.geom(g).name)
    return spec, owners


def is_overhead(low: float, high: float, floors: Sequence[float]) -> bool:
    """True of a thing between two heights that hangs above a body on any of the floors, and under the next."""
    above = [*floors[1:], math.inf]
    return any(low > floor + HEIGHT + 0.1 and high < upper - 0.05 for floor, upper in zip(floors, above, strict=True))
