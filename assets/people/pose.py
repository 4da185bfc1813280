"""Poses: the angles of a skeleton's joints, the same for all people."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np

from embodied.assets.json_file import from_plain, read_toml

Vector = tuple[float, float, float]
_SIDE = {
    "clavicle": "chest", "upper_arm": "clavicle", "forearm": "upper_arm", "hand": "forearm", "fingers": "hand",
    "fingertips": "fingers", "thigh": "pelvis", "shin": "thigh", "foot": "shin", "toes": "foot", "eye": "head",
}  # fmt: skip
JOINTS: Mapping[str, str | None] = MappingProxyType(
    {"pelvis": None, "spine": "pelvis", "chest": "spine", "neck": "chest", "head": "neck"}
    | {
        f"{side}_{joint}": above if above in ("chest", "pelvis", "head") else f"{side}_{above}"
        for side in ("left", "right")
        for joint, above in _SIDE.items()
    }
)
"""Every joint and the one above it."""
EYES = 0.5
"""How far eyes turn in their sockets before the head follows, radians."""


@dataclass(frozen=True)
class BodyPose:
    """The angles of a body's joints.

    The frame: that of a Placement, metres, z up, origin on the floor below the pelvis. **A person faces -y**; +x is to
    the person's left, +y behind the back. At rest (no joints) a person stands upright, feet on z = 0, arms hanging.

    A positive turn about x bends forward (spine, neck, head), swings arms and thighs *backward* and bends knees; elbows
    bend by a negative one. A positive turn about z turns to the person's left; about y, it leans to the left.
    """

    joints: Mapping[str, Vector] = field(default_factory=lambda: MappingProxyType({}))
    """Rotation vectors by joint, radians, about x, y and z of the frame at rest: the turn of what hangs on the joint
    against what it hangs on. A name of JOINTS; those left out are at rest."""
    lift: float = 0.0
    """How far the pelvis is above its height at rest, metres."""

    def __post_init__(self) -> None:
        if unknown := sorted(set(self.joints) - set(JOINTS)):
            raise ValueError(f"unknown joints {unknown}; joints are {', '.join(JOINTS)}")

    def with_joints(self, **turns: Vector) -> BodyPose:
        """The same pose but for some joints."""
        return dataclasses.replace(self, joints={**self.joints, **turns})


def gaze(pose: BodyPose, yaw: float, pitch: float = 0.0) -> BodyPose:
    """The pose with eyes and head turned to a direction, as seen from the chest.

    Args:
      yaw: to the person's left, radians; a head turns by up to 1.2.
      pitch: upward, radians.
    """
    eyes = float(np.clip(yaw, -EYES, EYES)) * 0.5
    side = float(np.clip(yaw - eyes, -1.2, 1.2))
    up = float(np.clip(pitch, -0.8, 0.8))
    half, eye = (-0.35 * up, 0.0, side / 2), (-0.3 * up, 0.0, eyes)
    return pose.with_joints(neck=half, head=half, left_eye=eye, right_eye=eye)


@dataclass(frozen=True)
class _Row:
    """A pose of poses.toml; turns in degrees, metres."""

    joints: Mapping[str, tuple[float, float, float]]
    lift: float = 0.0
    like: str = ""


def _read() -> Mapping[str, BodyPose]:
    rows = from_plain(dict[str, _Row], read_toml(Path(__file__).with_name("data") / "poses.toml"))
    out: dict[str, BodyPose] = {}
    for name, row in rows.items():
        turns = {j: (math.radians(x), math.radians(y), math.radians(z)) for j, (x, y, z) in row.joints.items()}
        out[name] = BodyPose({**(out[row.like].joints if row.like else {}), **turns}, row.lift)
    return MappingProxyType(out)


POSES = _read()
"""Poses of people who stay where they are, by name: data/poses.toml."""
STANDING, SITTING = POSES["standing"], POSES["sitting"]
