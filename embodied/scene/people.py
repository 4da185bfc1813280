"""Bodies of people in MuJoCo models: capsules around their bones, which go where a moment has them (mocap bodies)."""

import functools
from collections.abc import Mapping

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from embodied.assets.people import JOINTS, Person, people
from embodied.assets.people.bodies import mesh_of, transforms
from embodied.house.moment import Moment

LEFT_OUT = ("neck", "clavicle", "eye", "toes", "fingers", "fingertips")
"""Ends of the names of joints whose flesh has no capsule of its own."""
SKIN = 80.0
"""Percentile of the flesh's distances from a bone's line that is the radius of its capsule."""
AWAY = -100.0
"""Height at which the capsules of who is not there wait, metres."""


@functools.cache
def capsules(person: str) -> Mapping[str, tuple[np.ndarray, float]]:
    """By joint: (2, 3) the ends of the line of its capsule, of the body at rest, and the radius, metres."""
    mesh, out = mesh_of(person, 2), {}
    bone = mesh.weights.argmax(1)
    for k, name in enumerate(JOINTS):
        flesh = mesh.vertices[bone == k, :3].astype(float)
        if name.endswith(LEFT_OUT) or len(flesh) < 4:
            continue
        middle = flesh.mean(0)
        along = np.linalg.svd(flesh - middle, full_matrices=False)[2][0]
        at = (flesh - middle) @ along
        radius = float(np.percentile(np.linalg.norm(flesh - middle - np.outer(at, along), axis=1), SKIN))
        half = max(np.ptp(at) / 2 - radius, 1e-3)
        out[name] = np.array([middle + ((at.min() + at.max()) / 2 + x) * along for x in (-half, half)]), radius
    return out


def add_person(spec: mujoco.MjSpec, name: str, person: Person) -> None:
    """Capsules of somebody in a spec (`scene_spec`): mocap bodies 'name/chest' and so on, away until `stand_people`."""
    for joint, ((a, b), radius) in capsules(person.id).items():
        body = spec.worldbody.add_body(name=f"{name}/{joint}", mocap=True, pos=[0.0, 0.0, AWAY])
        kind = mujoco.mjtGeom.mjGEOM_CAPSULE
        how = {"size": [radius, 0.0, 0.0], "fromto": [*a, *b], "group": 3}  # that viewers hide
        body.add_geom(type=kind, name=f"{name}#{joint}", **how)


def stand_people(model: mujoco.MjModel, data: mujoco.MjData, moment: Moment, share: float = 1.0) -> None:
    """Move the capsules of everybody that `add_person` added a share of the way to where a moment has them, and away
    who is not there."""
    turned = {n: transforms(people()[p.person], p.pose).astype(float) for n, p in moment.people.items()}
    for body in np.flatnonzero(model.body_mocapid >= 0):
        name, slash, joint = model.body(body).name.rpartition("/")
        if not slash or joint not in JOINTS:
            continue
        k, figure = model.body_mocapid[body], moment.people.get(name)
        if figure is None:
            data.mocap_pos[k] = (0.0, 0.0, AWAY)
            continue
        turn, part = turned[name][[*JOINTS].index(joint)], share if data.mocap_pos[k, 2] > AWAY else 1.0
        x, y, z, w = Rotation.from_matrix(figure.place.rotation @ turn[:, :3]).as_quat()
        quat = np.array([w, x, y, z]) * (1.0 if data.mocap_quat[k] @ (w, x, y, z) > 0 else -1.0)
        data.mocap_pos[k] += part * (figure.place.points(turn[None, :, 3])[0] - data.mocap_pos[k])
        data.mocap_quat[k] += part * (quat - data.mocap_quat[k])
