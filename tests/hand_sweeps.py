"""Truths about what opens in a house: each joint is swept by MuJoCo, and loose things rest for ten seconds.

python tests/hand_sweeps.py 0 200    prints what is untrue of the default houses of one storey of seeds 0 to 199
"""

from __future__ import annotations

import math
import re
import sys
from collections import Counter
from dataclasses import dataclass

import mujoco
import numpy as np
from test_scene import Unpainted

from embodied.assets.cache import default_cache
from embodied.assets.catalogue import Catalogue, load_catalogue
from embodied.generate import HouseConfig, generate_house
from embodied.house.contents import contents, gives_way, part_of
from embodied.house.house import HINGED, House
from embodied.scene.doors import openness
from embodied.scene.model import build_spec, takeable

DEGREES = (10, 20, 30, 40, 50, 60, 70)
"""Angles that are tried, of drawers likewise shares of 90."""


@dataclass(frozen=True)
class Sweeps:
    """What is found in one house."""

    joints: Counter[str]
    """How many there are: 'door', 'front_door', 'back_door', 'window' and 'furniture', 'holds' of furniture in which
    something lies."""
    narrow: dict[str, tuple[str, float, str]]
    """Joints that do not open by 70 degrees: kind, at how many degrees they meet something, and what."""
    loose: int
    astray: list[str]
    """Loose things that have moved by more than 2 cm after ten seconds."""
    awake: int
    crept: list[str]
    """What has opened or closed by itself."""


def sweeps(house: House, catalogue: Catalogue) -> Sweeps:
    """Blinds are up and what gives way is out of the way (embodied.house.contents), of windows and furniture also
    doors."""
    away = {p.id for p in house.placements if gives_way(p, catalogue)}
    free = takeable(house, catalogue)
    model = build_spec(house, Unpainted(catalogue), hinged=True, free=free, parts=()).compile()
    owner = [re.split("[#/]", model.geom(g).name)[0] for g in range(model.ngeom)]
    kept = model.geom_contype.copy(), model.geom_conaffinity.copy()
    for touches in (model.geom_contype, model.geom_conaffinity):
        touches[np.isin(owner, [*away])] = 0
    data, rest, names = mujoco.MjData(model), model.qpos0.copy(), [model.joint(j).name for j in range(model.njnt)]
    for j in (j for j, name in enumerate(names) if name.startswith("window_blind")):
        rest[model.jnt_qposadr[j]] = model.jnt_user[j, 0]
    doors = {o.id for o in house.openings if o.kind in HINGED}
    full, joints, narrow = {part_of(c.id) for c in contents(house, catalogue, hidden=True)}, Counter[str](), {}
    for j, name in enumerate(names):
        if "_handle" in name or name.startswith("window_blind") or name in free:
            continue
        body, root = (model.body(int(b)).name for b in (model.jnt_bodyid[j], model.body_rootid[model.jnt_bodyid[j]]))
        holds = f"{root}/{body.removeprefix(root + '_')}" in full
        kinds = r"(door|front_door|back_door|window|french_window)_\d+_\w*hinge(_\d+)?"
        kind = m[1].replace("french_", "") if (m := re.fullmatch(kinds, name)) else "holds" if holds else "furniture"
        joints[kind] += 1
        passes = doors if kind in ("window", "furniture", "holds") else set()
        if (met := _met(model, data, rest, j, owner, passes)) is not None:
            narrow[name] = (kind, *met)
    model.geom_contype[:], model.geom_conaffinity[:] = kept
    mujoco.mj_resetData(model, data)
    mujoco.mj_forward(model, data)
    start, shut = data.xpos.copy(), openness(model, data)
    for _ in range(round(10 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    far, now = np.linalg.norm(data.xpos - start, axis=1), openness(model, data)
    astray = [f"{name} {far[model.body(name).id]:.2f} m" for name in sorted(free) if far[model.body(name).id] > 0.02]
    crept = [name for name, x in shut.items() if abs(now[name] - x) > 1e-3]
    return Sweeps(joints, narrow, len(free), astray, int((data.tree_asleep < 0).sum()), crept)


def _met(model, data, rest: np.ndarray, joint: int, owner: list[str], passes: set[str]) -> tuple[float, str] | None:
    """At how many degrees what turns about a joint meets something, and what."""
    turns = {int(model.jnt_bodyid[joint])}
    turns |= {b for b in range(model.nbody) if int(model.body_parentid[b]) in turns}
    inside = np.isin(model.geom_bodyid, [*turns])
    reach = model.jnt_user[joint, 0] or math.pi / 2
    for degrees in DEGREES:
        data.qpos[:] = rest
        data.qpos[model.jnt_qposadr[joint]] = degrees / 90 * reach
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        sides = data.contact.geom
        met = np.flatnonzero((inside[sides[:, 0]] != inside[sides[:, 1]]) & (data.contact.dist < -0.002))
        others = [owner[b if inside[a] else a] for a, b in sides[met]]
        if stops := [other for other in others if other not in passes]:
            return degrees, stops[0]
    return None


if __name__ == "__main__":
    catalogue, total, untrue = load_catalogue(default_cache()), Counter[str](), Counter[str]()
    for seed in range(int(sys.argv[1]), int(sys.argv[2])):
        found = sweeps(generate_house(seed, HouseConfig(storeys=1), catalogue=catalogue), catalogue)
        total += found.joints + Counter(loose=found.loose)
        untrue += Counter(kind for kind, *_ in found.narrow.values()) + Counter(loose=len(found.astray))
        print(seed, found.narrow, found.astray, found.awake, found.crept, dict(found.joints), found.loose, flush=True)
    print({kind: f"{untrue[kind]} of {n}" for kind, n in total.items()})
