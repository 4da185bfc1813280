"""A body with wheels in the physics of a house, driven by velocities (dm_control's composer).

The house is its arena: the collision boxes of embodied.scene.model.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

try:
    from dm_control import composer, mjcf
except ImportError as e:
    raise ImportError(f"a driven body needs dm-control ({e}); pip install --no-deps dm-control") from e

from embodied.geometry import rotation
from embodied.house.moment import WIDEST
from embodied.navigation.free_space import EYE, ajar_doors
from embodied.scene.doors import HINGE
from embodied.scene.joinery import leaf_poses
from embodied.scene.model import build_spec, owner_of_name, yaw_quat

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.house.house import House

RADIUS, HEIGHT = 0.19, 1.4
"""Of the body, metres: the graph keeps 0.2 m free around every edge."""
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


SLIPPERY = {"friction": [0.02, 0.001, 0.0001], "priority": 1}
"""Priority makes the friction of casters and hull count, not the floor's."""
TYRE = {"type": "cylinder", "size": [WHEEL, 0.02], "euler": [math.pi / 2, 0, 0], "friction": [1.4, 0.01, 0.0005]}
MOTOR = {"kv": 6.0, "ctrlrange": [-40, 40], "forcerange": [-12, 12]}
CASTER = {"type": "sphere", "size": [0.03], "mass": 0.3, **SLIPPERY}


class RollingBody(composer.Entity):
    """A slim cylinder on two driven wheels and two casters, with a camera at eye height."""

    def _build(self) -> None:
        root = mjcf.RootElement(model="robot")
        root.default.geom.friction = [1.0, 0.005, 0.0001]
        root.default.geom.contype = root.default.geom.conaffinity = 3  # the house, and leaves on hinges
        body = root.worldbody.add("body", name="chassis", pos=[0, 0, WHEEL])
        body.add("geom", name="base", type="cylinder", size=[RADIUS, 0.04], pos=[0, 0, 0.04], mass=18, **SLIPPERY)
        size = [RADIUS * 0.8, (HEIGHT - 0.3) / 2]
        body.add("geom", name="mast", type="cylinder", size=size, pos=[0, 0, 0.2 + size[1]], mass=2, **SLIPPERY)
        body.add("camera", name="eye", pos=[0, 0, EYE - WHEEL], xyaxes=[0, -1, 0, 0, 0, 1], fovy=60)
        for side, y in (("left", TRACK / 2), ("right", -TRACK / 2)):
            wheel = body.add("body", name=f"{side}_wheel", pos=[0, y, 0])
            wheel.add("joint", name=f"{side}_axle", type="hinge", axis=[0, 1, 0], damping=0.02)
            wheel.add("geom", name=f"{side}_tyre", mass=0.8, **TYRE)
            root.actuator.add("velocity", name=side, joint=f"{side}_axle", **MOTOR)
        for where, x in (("front", RADIUS * 0.8), ("back", -RADIUS * 0.8)):
            body.add("geom", name=f"{where}_caster", pos=[x, 0, 0.032 - WHEEL], **CASTER)
        root.compiler.angle = "radian"
        self._root = root

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        return self._root


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
    """Owns the physics of one house with the body in it.

    The model is put together with dm_control and stepped by MuJoCo itself: dm_control's own Physics
    (1.0.50) asks MuJoCo 4.0 for fields it no longer has.
    """

    def __init__(self, house: House, catalogue: Catalogue) -> None:
        arena, self._owners = house_arena(house, catalogue)
        robot = RollingBody()
        arena.add_free_entity(robot)
        root = arena.mjcf_model
        self.model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
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
        self._command(float(np.clip(speed, -FASTEST, FASTEST)), float(np.clip(turn, -TURNING, TURNING)))
        metres, collisions, touched = 0.0, list[str](), False
        for _ in range(periods):
            before = self.position
            mujoco.mj_step(self.model, self.data, self.substeps)
            now, time = self._owners_met(), self.data.time
            metres += float(np.linalg.norm(self.position - before))
            collisions += sorted(t for t in now if time - self._last_touch.get(t, -math.inf) > APART)
            touched |= bool(now)
            self._last_touch |= dict.fromkeys(now, time)
        return Roll(metres, tuple(collisions), touched)

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

    def _owners_met(self) -> set[str]:
        """Owners, floors apart, of what the body touches."""
        contacts = zip(self.data.contact.geom1, self.data.contact.geom2, strict=True)
        met = (b if self._mine[a] else a for a, b in contacts if self._mine[a] != self._mine[b])
        owners = (self._owners.get(self._names[geom], "") for geom in met)
        return {owner for owner in owners if not owner.endswith("/floor")}


def house_arena(house: House, catalogue: Catalogue) -> tuple[composer.Arena, dict[str, str]]:
    """The house's collision boxes as a composer arena, and the owner of each geom by its name there."""
    model = build_spec(house, catalogue, parts=()).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    arena = composer.Arena(name="house")
    root = arena.mjcf_model
    root.option.timestep, root.option.integrator = 0.004, "implicitfast"
    root.compiler.angle = "radian"
    owners, floors = {}, [s.elevation for s in house.storeys]
    leaves = _leaves_ajar(house, catalogue)
    for g in range(model.ngeom):
        if model.geom_type[g] != mujoco.mjtGeom.mjGEOM_BOX:
            continue
        middle, half = data.geom_xpos[g][2], float(np.abs(data.geom_xmat[g][6:]) @ model.geom_size[g])
        if is_overhead(middle - half, middle + half, floors):
            continue
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, data.geom_xmat[g])
        owner = owners[f"box{g}"] = owner_of_name(model.geom(g).name)
        box = {"name": f"box{g}", "type": "box", "size": model.geom_size[g]}
        if f"{owner}#0" in leaves:
            _hang(root, owner, *leaves[f"{owner}#0"], {**box, "pos": data.geom_xpos[g], "mass": LEAF_MASS})
        else:
            root.worldbody.add("geom", pos=data.geom_xpos[g], quat=quat, **box)
    return arena, owners


def _leaves_ajar(house: House, catalogue: Catalogue) -> dict[str, tuple[np.ndarray, float, float]]:
    """Hinge, metres, yaw, radians, and how far it turned from being closed, of the leaves that stand ajar."""
    poses, ajar = {}, ajar_doors(house)
    for o in house.openings:
        if o.id in ajar:
            shut = leaf_poses(house, dataclasses.replace(o, angle=0.0), catalogue.finish)
            for name, (hinge, yaw) in leaf_poses(house, o, catalogue.finish).items():
                poses[name] = np.array(hinge), yaw, yaw - shut[name][1]
    return poses


def _hang(root: mjcf.RootElement, owner: str, hinge: np.ndarray, yaw: float, turn: float, box: dict[str, Any]) -> None:
    """Put the box of a leaf on hinges; it meets bodies alone."""
    opening, _, piece = owner.partition("/")
    leaf = root.worldbody.add("body", name=owner.replace("/", "_"), pos=hinge, quat=yaw_quat(yaw))
    joint = f"{opening}_{'right' if piece == 'leaf_2' else ''}doorhinge"
    limits = {"range": [0, WIDEST], "limited": True, "ref": abs(turn), "axis": [0, 0, math.copysign(1.0, turn)]}
    leaf.add("joint", name=joint, type="hinge", **limits, **HINGE)
    pos = [*(rotation(-yaw) @ (box["pos"] - hinge)[:2]), box["pos"][2] - hinge[2]]
    leaf.add("geom", **{**box, "pos": pos}, contype=2, conaffinity=2)


def is_overhead(low: float, high: float, floors: Sequence[float]) -> bool:
    """True of a thing between two heights that hangs above a body on any of the floors, and under the next."""
    above = [*floors[1:], math.inf]
    return any(low > floor + HEIGHT + 0.1 and high < upper - 0.05 for floor, upper in zip(floors, above, strict=True))
