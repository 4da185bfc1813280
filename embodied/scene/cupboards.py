"""Furniture with moving parts in MJCF: bodies, joints, handles and regions with the names that readers of other houses
in MJCF expect.

A thing is the body '<id>' with a body '<id>_<part>' for each door, drawer and lid, and with its handle, the body
'<id>_<part>_handle', as a leaf of the tree. RoboCasa looks for the joints '<id>_doorhinge', '_leftdoorhinge',
'_rightdoorhinge', '_slidejoint' and '_microjoint', and for the regions '<id>_reg_main' and '_reg_int'.
"""

import dataclasses
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from embodied.assets.moving_parts import FIXED, MovingPart, TakenApart, boards_of, cut_open, openness_of, part_without
from embodied.assets.records import MeshPart
from embodied.house.house import House, Placement
from embodied.house.moment import RigidPose, apart
from embodied.scene import collision
from embodied.scene.collision import CollisionBox
from embodied.scene.doors import LEAF_DENSITY, Hung
from embodied.scene.house_meshes import Meshes
from embodied.scene.lit_pages import LitMesh
from embodied.scene.part import Part

_DAMPED = {"door": (2.0, 0.3), "flap": (10.0, 10.0), "drawer": (10.0, 2.0), "lid": (1.0, 1.0)}
_DAMPED |= {"curtain": (4.0, 2.0), "blind": (4.0, 2.0)}
PHYSICS = {kind: {"damping": d, "frictionloss": f} for kind, (d, f) in _DAMPED.items()}
"""Of joints by kind: RoboCasa's damping of cabinets and drawers, MolmoSpaces' friction, and its numbers of ovens."""
GAP = 0.002
"""Metres between a front and what is around it."""
THICK = 0.04
"""Metres of a front that touch: the inner edge of a thicker one meets its neighbour as it turns."""
FOLDS = 6
"""Strips of a blind, which rise before each other: nothing shortens in MuJoCo."""
THIN, CEILING = 0.004, 0.02
"""Side of a box, metres, below which it is left out, and the least height of what is above shelves."""


@dataclass(frozen=True, eq=False)
class Case:
    """Furniture with moving parts, and the bodies of them; '' is what stands still, '<part>_handle' a handle."""

    placement: Placement
    whole: TakenApart
    bodies: Mapping[str, Hung]


def hang(spec: mujoco.MjSpec, house: House, catalogue: Meshes, without: frozenset[str]) -> dict[str, Case]:
    """Add bodies, joints and regions of all furniture but some to a spec that counts in degrees; by placement id."""
    known = ((p, apart(catalogue.mesh, p)) for p in house.placements if p.id not in without)
    return {p.id: _case(spec, p, whole) for p, whole in known if whole is not None}


def _case(spec: mujoco.MjSpec, p: Placement, whole: TakenApart) -> Case:
    half, (w, d, h) = p.yaw / 2, p.size
    still = spec.worldbody.add_body(name=p.id, pos=p.position, quat=[math.cos(half), 0, 0, math.sin(half)])
    _region(still, f"{p.id}_reg_main", np.array([[-w / 2, -d / 2, 0], [w / 2, d / 2, h]]))
    bodies = {"": Hung(still, (0.0, 0.0, 0.0))}
    hollow = sum(m.kind not in ("lid", "curtain", "blind") for m in whole.moving)
    for m in whole.moving:
        is_drawer, value = m.slides, openness_of(p.params).get(m.name, 0.0)
        scale, (turn, shift) = 1.0 if is_drawer else math.degrees(1), m.turn(value)
        quat, at = Rotation.from_matrix(turn).as_quat()[[3, 0, 1, 2]], tuple((-m.origin).tolist())
        body = still.add_body(name=f"{p.id}_{m.name}", pos=turn @ m.origin + shift, quat=quat)
        handle = body.add_body(name=f"{p.id}_{m.name}_handle", pos=at)
        body.gravcomp = handle.gravcomp = float(m.kind in ("flap", "lid", "blind"))  # springs hold them
        kind = mujoco.mjtJoint.mjJNT_SLIDE if is_drawer else mujoco.mjtJoint.mjJNT_HINGE
        span = {"range": [0, m.reach * scale], "limited": True, "ref": value * m.reach * scale}
        joint = body.add_joint(name=joint_name(p, m.name), type=kind, axis=m.axis, **span, **PHYSICS[m.kind])
        joint.userdata = [m.reach]  # openness 1
        bodies |= {m.name: Hung(body, at), f"{m.name}_handle": Hung(handle, (0.0, 0.0, 0.0))}
        if m.kind in ("curtain", "blind"):
            body.mass, body.inertia, body.ipos, body.explicitinertial = 1.0, [0.2, 0.2, 0.01], [0, 0, 0], True
            for name, far, _ in _strips(m)[:-1]:
                strip = still.add_body(name=f"{p.id}_{name}", pos=m.origin + far * shift, gravcomp=1.0, mass=0.1)
                strip.inertia, strip.ipos, strip.explicitinertial = [0.02, 0.02, 0.001], [0, 0, 0], True
                strip.add_joint(name=strip.name, type=kind, axis=m.axis, ref=far * joint.ref, damping=1.0)
                both = {"name1": strip.name, "name2": joint.name, "objtype": mujoco.mjtObj.mjOBJ_JOINT}
                spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, **both, data=[0, far, *[0] * 10])
                bodies[name] = Hung(strip, at)
        elif m.kind != "lid":
            name = f"{p.id}_reg_int" + (f"_{m.name}" if hollow > 1 else "")
            _region(*((body, name, m.inside - m.origin) if is_drawer else (still, name, m.inside)))
    return Case(p, whole, bodies)


def _strips(m: MovingPart) -> list[tuple[str, float, list[Any]]]:
    """Bodies of a moving part, itself last: names, how far they go when it goes 1, and what to cut from its meshes; of
    a blind FOLDS strips."""
    if m.kind != "blind":
        return [(m.name, 1.0, [])]
    edges, up, out = np.linspace(m.box[1, 2], m.box[0, 2], FOLDS + 1), np.array([[0, 0, 1.0]]), []
    for k, (high, low) in enumerate(itertools.pairwise(edges), 1):
        cut = [(-up, np.array([-high])), (up, np.array([low]))]
        out.append((f"{m.name}_{k}", max(1 - (low - edges[-1]) / m.reach, 0.0), cut))
    return [*out[:-1], (m.name, 1.0, cut[:1])]


def _region(body: mujoco.MjsBody, name: str, corners: np.ndarray) -> None:
    """A box that is not drawn and touches nothing."""
    box = {"type": mujoco.mjtGeom.mjGEOM_BOX, "pos": corners.mean(0), "size": np.ptp(corners, axis=0) / 2}
    body.add_geom(name=name, **box, rgba=[0, 0, 0, 0], group=4, contype=0, conaffinity=0, mass=0)


def joint_name(p: Placement, part: str) -> str:
    """The name of the joint of a part."""
    word = part.replace("_", "")
    if p.object_class == "microwave":
        return f"{p.id}_microjoint"
    if part.startswith(("drawer", "cloth")) or part.endswith("half"):
        return f"{p.id}_slidejoint" if part in ("drawer", "cloth") else f"{p.id}_{word}_slidejoint"
    return f"{p.id}_lid_joint" if part == "lid" else f"{p.id}_{word}hinge"


def parts_of(case: Case, *, hidden: bool = False) -> Iterator[tuple[Part, Hung]]:
    """The meshes of furniture in its own frame, closed, with the bodies that carry them.

    Args:
      hidden: those alone that a closed thing does not show: its inside, drawers' boxes and the backs of fronts.
    """
    p, whole = case.placement, case.whole
    shown = {"": whole.within if hidden else (*whole.fixed, *whole.within)}
    for k, m in enumerate(whole.moving):
        seen = sum(bool((of == k).any()) for of in whole.labels)
        if hidden and m.name in openness_of(p.params):
            continue
        backs = [dataclasses.replace(x, faces=x.faces[_looks_back(x)]) for x in whole.parts[m.name][:seen]]
        shown[m.name] = (
            (*(x for x in backs if len(x.faces)), *whole.parts[m.name][seen:]) if hidden else whole.parts[m.name]
        )
    strips = {"": [("", 1.0, [])]} | {m.name: _strips(m) for m in whole.moving}
    for name, meshes in shown.items():
        for body, _, holes in strips[name]:
            for k, mesh in enumerate(part_without(x, holes) if holes else x for x in meshes):
                yield Part(p.id, "object", p.room, mesh, f"{p.asset}/{p.size}/{p.params}/{body}/{k}"), case.bodies[body]


def lying(cases: Mapping[str, Case], things: Sequence[Placement], catalogue: Meshes) -> Iterator[tuple[Part, Hung]]:
    """The meshes of what lies in closed furniture (embodied.house.contents), with the bodies that carry them."""
    for c in (c for c in things if c.parent in cases):
        case, name = cases[c.parent or ""], (c.group or "").partition("/")[2]
        p, m = case.placement, next(m for m in case.whole.moving if m.name == name)
        x, y, z = RigidPose.upright(p.position, p.yaw).local(np.array([c.position]))[0] - m.slides * m.origin
        hung = Hung(case.bodies[name if m.slides else ""].body, (x, y, z))
        for k, mesh in enumerate(catalogue.mesh(c.asset, c.size)):
            yield Part(c.id, "object", c.room, mesh, f"{c.asset}/{c.size}#{k}"), hung


def lit_apart(m: LitMesh, p: Placement, whole: TakenApart) -> tuple[LitMesh, np.ndarray, np.ndarray]:
    """The part of a lit mesh of furniture that stands still, cut open, in the thing's frame, with its old vertices
    first; of its faces, the numbers that they had; and the labels of all faces that there were."""
    c, s = math.cos(p.yaw), math.sin(p.yaw)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], np.float32)
    local = (m.vertices - np.asarray(p.position, np.float32)) @ turn
    label = whole.label_at(local[m.faces].mean(1), openness_of(p.params))
    fixed = np.flatnonzero(label == FIXED)
    rows, faces, source = cut_open(whole.holes, np.concatenate([local, m.uv], axis=1), m.faces[fixed])
    return dataclasses.replace(m, vertices=rows[:, :3].copy(), faces=faces, uv=rows[:, 3:].copy()), fixed[source], label


def lit_parts(m: LitMesh, case: Case) -> Iterator[tuple[LitMesh, Hung]]:
    """A lit mesh of furniture by moving part, closed, in the thing's frame, with the bodies that carry it."""
    p, whole = case.placement, case.whole
    still, _, label = lit_apart(m, p, whole)
    yield still, case.bodies[""]
    for k, part in enumerate(whole.moving):
        back, shift = part.turn(openness_of(p.params).get(part.name, 0.0))
        vertices = ((still.vertices - shift) @ back).astype(np.float32)
        closed = dataclasses.replace(still, vertices=vertices, faces=m.faces[label == k])
        dark = _looks_back(closed) & (part.name not in openness_of(p.params))
        for body, _, holes in _strips(part):
            rows, faces, _ = cut_open(holes, np.concatenate([vertices, closed.uv], axis=1), closed.faces[~dark])
            own = dataclasses.replace(closed, vertices=rows[:, :3].copy(), faces=faces, uv=rows[:, 3:].copy())
            yield own, case.bodies[body]


def _looks_back(m: MeshPart | LitMesh) -> np.ndarray:
    """(m,) bool: faces of a closed front that look into the thing, where it is dark."""
    corners = m.vertices[m.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(normal[:, 1] > 0.5 * np.linalg.norm(normal, axis=1))


def boxes_of(case: Case, density: float, solid: Sequence[CollisionBox]) -> Iterator[tuple[Hung, CollisionBox, float]]:
    """Collision boxes with the bodies that have them and their density, kg per cubic metre: what is left of those of
    the closed thing around its openings, shelves, fronts, handles, drawers' boxes."""
    left = [(np.subtract(b.centre, b.half), np.add(b.centre, b.half)) for b in solid]
    for m in case.whole.moving:
        body = case.bodies[m.name]
        free = [[-GAP, -GAP, -GAP], [GAP, GAP, 1.0]] if m.kind == "lid" else [[-GAP, -1.0, -GAP], [GAP, GAP, GAP]]
        free = [[-1.0, -1.0, -1.0], [1.0, 1.0, 0.0]] if m.kind == "blind" else free
        for hole in (m.box + free, m.inside - np.array([[0], [0 if m.slides else CEILING]]) * [0, 0, 1]):
            left = [piece for b in left for piece in collision.without(b, (hole[0], hole[1]))]
        leaf = m.box + np.array([[GAP], [-GAP]]) * [1, 0, 1]
        if m.kind != "lid":
            leaf[1, 1] = min(leaf[1, 1], leaf[0, 1] + THICK)
        yield from [(body, _box(leaf), LEAF_DENSITY)] * (m.kind != "blind")
        yield case.bodies[f"{m.name}_handle"], _box(m.handle), LEAF_DENSITY
        boards = boards_of(m) if m.cut else []
        if m.kind == "drawer":
            yield from ((body, _box(np.array(b)), LEAF_DENSITY) for b in boards)
        else:
            left += boards
    for b in left:
        if np.ptp(b, axis=0).min() > THIN:
            yield case.bodies[""], _box(np.array(b)), density


def _box(corners: np.ndarray) -> CollisionBox:
    half = np.maximum(np.ptp(corners, axis=0) / 2, 1e-3)
    return CollisionBox(tuple(corners.mean(0).tolist()), tuple(half.tolist()))
