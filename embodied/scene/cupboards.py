"""Furniture with moving parts in MJCF: bodies, joints, handles and regions with the names that readers of other houses
in MJCF expect.

A thing is the body '<id>' with a body '<id>_<part>' for each door, drawer and lid, and with its handle, the body
'<id>_<part>_handle', as a leaf of the tree. RoboCasa looks for the joints '<id>_doorhinge', '_leftdoorhinge',
'_rightdoorhinge', '_slidejoint' and '_microjoint', and for the regions '<id>_reg_main' and '_reg_int'.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from embodied.assets.moving_parts import FIXED, TakenApart, cut_open, drawer_boards, openness_of, shelf_boards
from embodied.house.house import House, Placement
from embodied.scene import collision
from embodied.scene.collision import CollisionBox
from embodied.scene.doors import LEAF_DENSITY, Hung
from embodied.scene.house_meshes import Meshes, apart
from embodied.scene.lit_pages import LitMesh
from embodied.scene.part import Part

PHYSICS = {
    "door": {"damping": 2.0, "frictionloss": 0.3},
    "flap": {"damping": 10.0, "frictionloss": 10.0},
    "drawer": {"damping": 10.0, "frictionloss": 2.0},
    "lid": {"damping": 1.0, "frictionloss": 1.0},
}
"""Of joints by kind: RoboCasa's damping of cabinets and drawers, MolmoSpaces' friction, and its numbers of ovens."""
GAP = 0.002
"""Metres between a front and what is around it."""
THIN = 0.004
"""Side of a box, metres, below which it is left out."""


def openable(house: House, catalogue: Meshes, without: frozenset[str] = frozenset()) -> dict[str, TakenApart]:
    """Furniture with moving parts by placement id, taken apart."""
    return {p.id: x for p in house.placements if p.id not in without and (x := apart(catalogue, p)) is not None}


def hang(spec: mujoco.MjSpec, house: House, things: Mapping[str, TakenApart]) -> dict[tuple[str, str], Hung]:
    """Add the bodies, joints and regions of furniture to a spec that counts in degrees; by placement id and part, and
    by id and '' for what stands still."""
    out: dict[tuple[str, str], Hung] = {}
    for thing, whole in things.items():
        p = house.placement_by_id[thing]
        still = spec.worldbody.add_body(
            name=thing, pos=p.position, quat=[math.cos(p.yaw / 2), 0, 0, math.sin(p.yaw / 2)]
        )
        out[thing, ""] = Hung(still, (0.0, 0.0, 0.0))
        w, d, h = p.size
        _region(still, f"{thing}_reg_main", np.array([[-w / 2, -d / 2, 0], [w / 2, d / 2, h]]))
        hollow = [m for m in whole.moving if np.ptp(m.inside, axis=0).all()]
        for m in whole.moving:
            value = openness_of(p.params).get(m.name, 0.0)
            turn, shift = m.turn(value)
            x, y, z, w_ = Rotation.from_matrix(turn).as_quat()
            body = still.add_body(name=f"{thing}_{m.name}", pos=turn @ m.origin + shift, quat=[w_, x, y, z])
            body.gravcomp = float(m.kind in ("flap", "lid"))  # springs hold them
            scale = 1.0 if m.slides else math.degrees(1)
            joint = body.add_joint(
                name=joint_name(thing, p.object_class, m.name),
                type=mujoco.mjtJoint.mjJNT_SLIDE if m.slides else mujoco.mjtJoint.mjJNT_HINGE,
                axis=m.axis,
                range=[0, m.reach * scale],
                limited=True,
                ref=value * m.reach * scale,
                **PHYSICS[m.kind],
            )
            joint.userdata = [m.reach]
            at = tuple((-m.origin).tolist())
            out[thing, m.name] = Hung(body, at)
            if m in hollow:
                name = f"{thing}_reg_int" + (f"_{m.name}" if len(hollow) > 1 else "")
                _region(body if m.slides else still, name, m.inside - (m.origin if m.slides else 0))
            handle = body.add_body(name=f"{thing}_{m.name}_handle", pos=at)
            handle.gravcomp = body.gravcomp
            out[thing, f"{m.name}_handle"] = Hung(handle, (0.0, 0.0, 0.0))
    return out


def _region(body: mujoco.MjsBody, name: str, corners: np.ndarray) -> None:
    """A box that is not drawn and touches nothing."""
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=corners.mean(0),
        size=np.ptp(corners, axis=0) / 2,
        rgba=[0, 0, 0, 0],
        group=4,
        contype=0,
        conaffinity=0,
        mass=0,
    )


def joint_name(thing: str, object_class: str, part: str) -> str:
    """The name of the joint of a part."""
    if object_class == "microwave":
        return f"{thing}_microjoint"
    if part.startswith("drawer"):
        return f"{thing}_{part.replace('_', '')}_slidejoint" if part != "drawer" else f"{thing}_slidejoint"
    return f"{thing}_lid_joint" if part == "lid" else f"{thing}_{part.replace('_', '')}hinge"


def furniture_parts(
    house: House, things: Mapping[str, TakenApart], *, within: bool = False
) -> Iterator[tuple[Part, str]]:
    """The meshes of furniture in its own frame, closed, each with the name of its moving part or ''.

    Args:
      within: those alone that a closed thing does not show: insides and drawers' boxes.
    """
    for thing, whole in things.items():
        p = house.placement_by_id[thing]
        shown = {"": whole.within if within else (*whole.fixed, *whole.within)}
        for k, m in enumerate(whole.moving):
            seen = sum(bool((of == k).any()) for of in whole.labels) if within else 0
            shown[m.name] = whole.parts[m.name][seen:]
        for name, meshes in shown.items():
            for k, mesh in enumerate(meshes):
                key = f"{p.asset}/{p.size}/{p.params}/{name}/{within}#{k}"
                yield Part(thing, "object", p.room, mesh, key), name


def lit_apart(m: LitMesh, p: Placement, whole: TakenApart) -> tuple[LitMesh, np.ndarray, np.ndarray]:
    """What stands still of a lit mesh of furniture, cut open, in the thing's frame, its own vertices first; of its
    faces, the numbers that they had; and the labels of all faces that there were."""
    c, s = math.cos(p.yaw), math.sin(p.yaw)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], np.float32)
    local = (m.vertices - np.asarray(p.position, np.float32)) @ turn
    label = whole.label_at(local[m.faces].mean(1), openness_of(p.params))
    fixed = np.flatnonzero(label == FIXED)
    rows, faces, source = cut_open(whole.holes, np.concatenate([local, m.uv], axis=1), m.faces[fixed])
    return dataclasses.replace(m, vertices=rows[:, :3].copy(), faces=faces, uv=rows[:, 3:].copy()), fixed[source], label


def lit_parts(m: LitMesh, p: Placement, whole: TakenApart) -> Iterator[tuple[LitMesh, str]]:
    """A lit mesh of furniture by moving part, closed, in the thing's frame; '' is what stands still."""
    still, _, label = lit_apart(m, p, whole)
    yield still, ""
    for k, part in enumerate(whole.moving):
        back, shift = part.turn(openness_of(p.params).get(part.name, 0.0))
        vertices = ((still.vertices - shift) @ back).astype(np.float32)
        yield dataclasses.replace(still, vertices=vertices, faces=m.faces[label == k]), part.name


def boxes_of(
    catalogue: Meshes, p: Placement, whole: TakenApart, solid: tuple[CollisionBox, ...]
) -> Iterator[tuple[str, CollisionBox, float]]:
    """Collision boxes with the part that has them and their density, kg per cubic metre: what is left of those of the
    closed thing around its openings, shelves, fronts, handles, drawers' boxes."""
    density = collision.density_of(catalogue.assets[p.asset])
    left = [(np.subtract(b.centre, b.half), np.add(b.centre, b.half)) for b in solid]
    for m in whole.moving:
        front = m.box + np.array([[-GAP, -1.0, -GAP], [GAP, GAP, GAP]])
        if m.kind == "lid":
            front = m.box + np.array([[-GAP, -GAP, -GAP], [GAP, GAP, 1.0]])
        for hole in (front, m.inside):
            left = [piece for b in left for piece in collision.without(b, (hole[0], hole[1]))]
        yield m.name, _box(m.box + np.array([[GAP], [-GAP]]) * [1, 0, 1]), LEAF_DENSITY
        yield f"{m.name}_handle", _box(m.handle), LEAF_DENSITY
        if m.slides:
            yield from ((m.name, _box(np.array(b)), LEAF_DENSITY) for b in drawer_boards(m))
        elif m.kind == "door":
            left += shelf_boards(m, p.object_class)
    for b in left:
        if np.ptp(b, axis=0).min() > THIN:
            yield "", _box(np.array(b)), density


def _box(corners: np.ndarray) -> CollisionBox:
    half = np.maximum(np.ptp(corners, axis=0) / 2, 1e-3)
    return CollisionBox(tuple(corners.mean(0).tolist()), tuple(half.tolist()))
