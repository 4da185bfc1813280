"""Doors and windows on hinges: bodies, joints and names that readers of other houses in MJCF expect.

A leaf is the body 'doorway_<opening>' (a second one of a pair has '_2' behind it) with the joint '<opening>_doorhinge'
(of a pair '<opening>_leftdoorhinge' and '_rightdoorhinge'), whose value is the angle of the leaf, 0 to pi / 2 or as
wide as it stands; its lever is a leaf body of the tree with the joint '<opening>_handle'. The casements of a window are
'casement_<opening>', '_2', ... with the joints '<opening>_hinge', '_2', ... RoboCasa looks for 'door' in
the names of joints; MolmoSpaces for '_door_' in those of bodies, takes the first joint without 'handle' for the hinge,
and reads house_metadata.json.
"""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from embodied.house.house import House
from embodied.house.moment import WIDEST
from embodied.scene.part import Part

HINGE = {"damping": 10.0, "frictionloss": 10.0}
"""Of a room door: MolmoSpaces has 8 to 12 of both, Infinigen 15 to 25 of damping."""
LEVER = {"damping": 2.0, "frictionloss": 1.0, "stiffness": 5.0}
"""Of a lever, which springs back: as Infinigen's."""
LEVER_RANGE = 0.8
"""How far a lever turns down, radians."""
LEVER_INSET, LEVER_HEIGHT = 0.06, 1.03
"""Metres of a lever's axis from the leaf's free edge and above its lower one."""
LEAF_DENSITY = 380.0
"""Of leaves, kg per cubic metre: frames of wood around a light core."""


LeafKey = tuple[str, tuple[float, float, float]]
"""Owner and place, metres, of a part of a leaf."""


@dataclass(frozen=True, eq=False)
class Hung:
    """A body that carries parts of a leaf, and the place of the leaf's frame in it."""

    body: Any
    origin: tuple[float, float, float]
    """Metres."""


def hang(spec: mujoco.MjSpec, house: House, parts: Sequence[Part]) -> dict[LeafKey, Hung]:
    """Add the bodies and joints of all leaves of `house`, at their angles, to a spec that counts in degrees."""
    out: dict[LeafKey, Hung] = {}
    angles, casements = {o.id: o.angle for o in house.openings}, dict[str, int]()
    leaves = [p for p in parts if is_leaf(p) and p.owner.endswith(("/leaf", "/leaf_2", "/frame"))]
    pairs = {p.owner.partition("/")[0] for p in leaves if p.owner.endswith("/leaf_2")}
    for leaf in leaves:
        opening, _, piece = leaf.owner.partition("/")
        side = 1.0 if "/+1" in leaf.mesh_key else -1.0
        which = {"leaf": "left", "leaf_2": "right"}[piece] if opening in pairs else ""
        suffix, half, name = "_2" if piece == "leaf_2" else "", leaf.yaw / 2, f"doorway_{opening}"
        joint = f"{opening}_{which}doorhinge"
        if piece == "frame":
            casements[opening] = k = casements.get(opening, 0) + 1
            suffix = f"_{k}" if k > 1 else ""
            name, joint = f"casement_{opening}", f"{opening}_hinge{suffix}"
        quat, open_ = [math.cos(half), 0, 0, math.sin(half)], math.degrees(angles[opening])
        body = spec.worldbody.add_body(name=name + suffix, pos=leaf.position, quat=quat)
        span = [0, max(math.degrees(WIDEST), open_)]
        body.add_joint(name=joint, axis=[0, 0, side], range=span, limited=True, ref=open_, **HINGE)
        if piece == "frame":
            pieces = ("frame", "glass", "handle")
            out |= {(f"{opening}/{p}", leaf.position): Hung(body, (0.0, 0.0, 0.0)) for p in pieces}
            continue
        width = float(np.abs(leaf.mesh.vertices[:, 0]).max())
        at = (side * (width - LEVER_INSET), 0.0, LEVER_HEIGHT)
        handle = body.add_body(name=f"{opening}_handle{suffix}", pos=at, gravcomp=1)
        span = [0, math.degrees(LEVER_RANGE)]
        handle.add_joint(name=handle.name, axis=[0, -side, 0], range=span, limited=True, **LEVER)
        out[leaf.owner, leaf.position] = out[f"{opening}/glass", leaf.position] = Hung(body, (0.0, 0.0, 0.0))
        out[f"{opening}/handle", leaf.position] = Hung(handle, (-at[0], -at[1], -at[2]))
    return out


def is_leaf(part: Part) -> bool:
    """True for the parts of an opening that turn on its hinges."""
    return part.mesh_key.startswith("leaf/")


def is_of_house(model: mujoco.MjModel, body: int, house: House) -> bool:
    """True for the bodies of the house's own doors and things."""
    root = model.body(model.body_rootid[body]).name
    stem = root.removeprefix("doorway_").removeprefix("casement_")
    names = {stem, stem.rpartition("_")[0]} & {o.id for o in house.openings}
    return root in house.placement_by_id or (bool(names) and root != stem)


@functools.lru_cache(maxsize=4)
def _ways_open(model: mujoco.MjModel) -> tuple[list[str], np.ndarray, np.ndarray]:
    """All that turns or slides: names, addresses in qpos, and its value when it is open."""
    ways = []
    for j in range(model.njnt):
        body, (stem, hinge, _) = model.jnt_bodyid[j], model.joint(j).name.partition("hinge")
        root, reach = model.body(model.body_rootid[body]).name, model.jnt_user[j, 0] if model.nuser_jnt else 0.0
        if reach > 0:
            ways.append((f"{root}/{model.body(body).name.removeprefix(f'{root}_')}", model.jnt_qposadr[j], reach))
        elif hinge:
            ways.append((stem.rpartition("_")[0], model.jnt_qposadr[j], WIDEST))
    names, adr, reaches = zip(*ways) if ways else ((), (), ())
    return [*names], np.array(adr, int), np.array(reaches)


def openness(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, float]:
    """How far all that turns or slides is open, 0 to 1: by opening, of a pair the wider leaf, and of furniture by
    placement id and part."""
    out: dict[str, float] = {}
    names, adr, reach = _ways_open(model)
    for name, x in zip(names, np.clip(data.qpos[adr] / reach, 0, 1).tolist(), strict=True):
        out[name] = max(out.get(name, 0.0), x)
    return out


def set_openness(model: mujoco.MjModel, data: mujoco.MjData, ways: Mapping[str, float]) -> None:
    """Open what turns or slides, by the names of `openness`, as far."""
    for name, adr, reach in zip(*_ways_open(model)):
        data.qpos[adr] = ways[name] * reach if name in ways else data.qpos[adr]


def metadata(house: House, model: mujoco.MjModel) -> dict[str, Any]:
    """Facts for house_metadata.json, of MolmoSpaces' form: by body, what it is and what its bodies and joints are
    called."""
    things = {p.id: (p.asset, p.object_class) for p in house.placements}
    roots = [b for b in range(1, model.nbody) if model.body_rootid[b] == b]
    objects = {}
    for name in dict.fromkeys([*(model.body(b).name for b in roots), *things]):
        asset, category = things.get(name, ("window",) * 2 if name.startswith("casement") else ("doorway",) * 2)
        body = next((b for b in roots if model.body(b).name == name), -1)
        bodies = [model.body(b).name for b in range(1, model.nbody) if model.body_rootid[b] == body]
        joints = [model.joint(j).name for j in range(model.njnt) if model.body_rootid[model.jnt_bodyid[j]] == body]
        names = {"bodies": {n: n for n in bodies}, "joints": {n: n for n in joints}}
        facts = {"asset_id": asset, "object_id": name, "category": category}
        objects[name] = {**facts, "is_static": not joints, "name_map": names}
    return {"objects": objects}
