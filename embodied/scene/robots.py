"""Robots of any MJCF in a house: put on free floor, with names, options, masses and keyframes taken care of."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import mujoco
import numpy as np
import shapely

from embodied.house.house import House
from embodied.house.moment import RigidPose
from embodied.navigation.free_space import EYE, free_floor
from embodied.navigation.graph import build_graph
from embodied.scene.bodies import shape_of
from embodied.scene.model import yaw_quat

At: TypeAlias = int | str | Sequence[float] | None
"""A node, a room's id, (x, y), (x, y, yaw) or (x, y, z, yaw); None for the first room with space."""
HOUSE = "embodied_house"
"""Text of a spec that has the JSON of its house."""
CLEARANCE = 0.002
"""Metres between a robot's lowest point and the floor."""
LOOKED_AROUND = 2.5
"""Metres around a node or a point in which floor is looked for."""
GRID, TURNS = 0.1, 12
"""Metres between the places that are tried, and directions at each."""
ROLLING = {"x": ((1, 0, 0), 2000.0), "y": ((0, 1, 0), 2000.0), "yaw": ((0, 0, 1), 800.0)}
"""Joints of a base that rolls: axis, in the world, and gain of the velocity actuator of the same name."""
FINER = {"timestep": min, "impratio": max, "iterations": max, "ls_iterations": max, "noslip_iterations": max}
"""Which of two options holds; of the others, the house's."""


@dataclass(frozen=True, eq=False)
class PlacedRobot:
    """A robot in a spec; its names begin with `name` and a slash."""

    name: str
    position: tuple[float, float, float]
    """Of its own frame, metres."""
    yaw: float
    changes: tuple[str, ...]
    """All that is not as in its file."""

    def put(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Bring the robot alone to its start, at rest."""
        key, start = model.key(f"{self.name}/start"), f"{self.name}/"
        for j in range(model.njnt):
            if model.joint(j).name.startswith(start):
                kind, at, dof = model.jnt_type[j], model.jnt_qposadr[j], model.jnt_dofadr[j]
                data.qpos[at : at + (7, 4, 1, 1)[kind]] = key.qpos[at : at + (7, 4, 1, 1)[kind]]
                data.qvel[dof : dof + (6, 3, 1, 1)[kind]] = 0.0
        for a in range(model.nu):
            if model.actuator(a).name.startswith(start):
                data.ctrl[a] = key.ctrl[a]
        mujoco.mj_forward(model, data)


def place(
    spec: mujoco.MjSpec,
    robot: str | Path | mujoco.MjSpec,
    at: At = None,
    *,
    rolling: bool = False,
    key: str | None = None,
    name: str = "robot",
) -> PlacedRobot:
    """Attach a robot to the spec of a house (`scene_spec`); what was changed is in `PlacedRobot.changes`.

    Its names get `name` and a slash before them. Floors, lights and skies of its file are left out, masses stay as in
    a model of its own, the finer time step and the more exact solver hold, gravity is the house's, and its geoms meet
    the house's. A keyframe 'robot/start' has its first one, or the pose of the file, where it stands.

    Args:
      robot: an MJCF or URDF file, an MjSpec, or a name of mujoco-menagerie (extra 'robots').
      at: where on free floor; (x, y, z, yaw) is taken as it is.
      rolling: it glides over the floor, by three velocity actuators 'robot/x', 'robot/y' and 'robot/yaw', metres and
        radians per second along the axes of the world: for arms, and for robots whose wheels or legs are not driven.
      key: its keyframe to begin with, instead of the first.

    Raises:
      ValueError: no such robot, place or keyframe, or no floor that is large enough; the spec is not of a house.

    Examples:
      >>> import mujoco
      >>> ball = '<mujoco><worldbody><body><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
      >>> spec = embodied.scene_spec(house, pictures=None)
      >>> placed = embodied.place(spec, mujoco.MjSpec.from_string(ball))
      >>> model = spec.compile()
    """
    house, child, start = _house_of(spec), _loaded(robot), f"{name}/"
    if any(b.name.startswith(start) for b in spec.bodies):
        raise ValueError(f"there is a robot {name!r} already; give this one another name")
    changes = [*_without_surroundings(child)]
    alone = child.compile()
    data = mujoco.MjData(alone)
    keys = [alone.key(k).name for k in range(alone.nkey)]
    if key is not None and key not in keys:
        raise ValueError(f"the robot has no keyframe {key!r}; it has {keys}")
    if keys:
        mujoco.mj_resetDataKeyframe(alone, data, keys.index(key) if key else 0)
        changes.append(f"of its {len(keys)} keyframes the start is {key or keys[0] or 'the first'}")
    mujoco.mj_forward(alone, data)
    if not np.any(alone.opt.gravity):
        changes.append("gravity compensation of all its bodies, as its file has no gravity")
        for body in child.bodies[1:]:
            body.gravcomp = 1
    x, y, z, yaw = _pose(house, at, _touching(alone, data))
    changes += [*_options(spec, child), *_contacts(spec, child, alone)]
    for body in child.bodies[1:]:
        for field in ("mass", "ipos", "iquat", "inertia"):
            setattr(body, field, getattr(alone, f"body_{field}")[body.id])
        body.explicitinertial = True
    qpos, free = data.qpos.copy(), [j for j in child.joints if j.type == mujoco.mjtJoint.mjJNT_FREE]
    for joint in free:
        own = slice(alone.jnt_qposadr[joint.id], alone.jnt_qposadr[joint.id] + 7)
        if rolling:
            joint.parent.pos, joint.parent.quat = qpos[own][:3], qpos[own][3:]
            changes.append(f"free joint of {joint.parent.name!r} taken away, as its base rolls")
        else:
            posed = RigidPose.upright((x, y, z), yaw).then(*_turn_and_shift(qpos[own]))
            qpos[own] = *posed.position, *posed.quat
    if rolling:
        lost = [alone.jnt_qposadr[j.id] + k for j in free for k in range(7)]
        qpos = np.delete(qpos, lost)
    for element in (*child.keys, *(free if rolling else ())):
        child.delete(element)
    child.add_key(name="start", qpos=qpos, ctrl=data.ctrl)
    holder = spec.worldbody
    if rolling:
        holder = holder.add_body(name=f"{start}rolling", pos=[x, y, z], mass=1.0, inertia=[0.1] * 3)
        holder.explicitinertial = True
        for joint, (axis, _) in ROLLING.items():
            kind = mujoco.mjtJoint.mjJNT_HINGE if joint == "yaw" else mujoco.mjtJoint.mjJNT_SLIDE
            holder.add_joint(name=start + joint, type=kind, axis=axis)
    frame = holder.add_frame(pos=[0, 0, 0] if rolling else [x, y, z], quat=yaw_quat(yaw))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Attaching a child without asset dict")  # its files are read all the same
        spec.attach(child, frame=frame, prefix=start)
    for joint, (_, gain) in ROLLING.items() if rolling else ():
        actuator = spec.add_actuator(name=start + joint, target=start + joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_velocity(kv=gain)
    return PlacedRobot(name, (x, y, z), yaw, tuple(changes))


def _house_of(spec: mujoco.MjSpec) -> House:
    text = next((t.data for t in spec.texts if t.name == HOUSE), None)
    if text is None:
        raise ValueError("this spec is of no house; make it by embodied.scene_spec(house)")
    return House.from_json(text)


def _loaded(robot: str | Path | mujoco.MjSpec) -> mujoco.MjSpec:
    if isinstance(robot, mujoco.MjSpec):
        return robot.copy()
    if Path(robot).suffix in (".xml", ".mjcf", ".urdf"):
        if not Path(robot).is_file():
            raise ValueError(f"there is no robot file {str(robot)!r}")
        return mujoco.MjSpec.from_file(str(robot))
    try:
        import mujoco_menagerie  # late: an extra
    except ImportError as e:
        raise ValueError(f"{robot!r} is no file; for robots by name: pip install 'embodied-houses[robots]'") from e
    if str(robot) not in mujoco_menagerie.names():
        raise ValueError(f"mujoco-menagerie has no robot {robot!r}; mujoco_menagerie.names() has all")
    known = mujoco_menagerie.get(str(robot))
    plain = [e.name for e in known.entry_points if not e.is_mjx and "scene" not in e.name]
    return known.spec(plain[0] if plain else None)


def _without_surroundings(child: mujoco.MjSpec) -> Iterator[str]:
    """Take away what a house has itself."""
    flat = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
    skies = [t for t in child.textures if t.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX]
    floors = [g for g in child.worldbody.geoms if g.type in flat]
    for what, elements in (("floors", floors), ("lights", list(child.lights)), ("skies", skies)):
        if elements:
            yield f"{len(elements)} {what} of its file left out"
        for element in elements:
            child.delete(element)


def _options(spec: mujoco.MjSpec, child: mujoco.MjSpec) -> Iterator[str]:
    """Options of both, told where they differ; afterwards the child's are the same, so that nothing is in conflict."""
    ours, theirs, default = spec.option, child.option, mujoco.MjSpec().option
    child.njmax, child.nconmax, child.nkey = spec.njmax, spec.nconmax, spec.nkey
    child.visual.map.znear, child.visual.map.zfar = spec.visual.map.znear, spec.visual.map.zfar
    for field in (f for f in dir(default) if not f.startswith("_")):
        kept, its = getattr(ours, field), getattr(theirs, field)
        if field in FINER and FINER[field](kept, its) != kept:
            setattr(ours, field, its)
            yield f"the house's {field} is {its:g} instead of {kept:g}"
        elif not np.array_equal(kept, its) and not np.array_equal(its, getattr(default, field)):
            yield f"{field} is {kept} instead of its {its}"
        setattr(theirs, field, getattr(ours, field))


def _contacts(spec: mujoco.MjSpec, child: mujoco.MjSpec, alone: mujoco.MjModel) -> Iterator[str]:
    """Let geoms that touch something, but would not touch a house, do so by a bit of their own."""
    masks = alone.geom_contype | alone.geom_conaffinity
    stray = [g for g in child.geoms if masks[g.id] and not masks[g.id] & 1]
    if not stray:
        return
    used = int(np.bitwise_or.reduce(masks))
    bit = next(1 << k for k in range(1, 31) if not used >> k & 1)
    for g in spec.geoms:
        if g.contype or g.conaffinity:
            g.conaffinity |= bit
    for g in stray:
        g.contype = int(alone.geom_contype[g.id]) | bit
    yield f"{len(stray)} geoms touch the house by contype {bit}, which their own masks would not"


def _touching(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """(n, 3) points around what touches, metres, in the robot's frame."""
    points = [np.zeros((1, 3))]
    for g in range(model.ngeom):
        if (model.geom_contype[g] or model.geom_conaffinity[g]) and (shape := shape_of(model, g)) is not None:
            points.append(shape[0] @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g])
    return np.concatenate(points[1:] or points)


def _turn_and_shift(free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3, 3) and (3,) of the seven numbers of a free joint."""
    return RigidPose((0.0, 0.0, 0.0), tuple(free[3:])).rotation, free[:3]


def _pose(house: House, at: At, points: np.ndarray) -> tuple[float, float, float, float]:
    """x, y, z and yaw of the robot's frame where what touches (n, 3) is on free floor."""
    if not isinstance(at, int | str | None) and len(at) == 4:
        x, y, z, yaw = (float(v) for v in at)
        return x, y, z, yaw
    storey, region, wanted = _region(house, at)
    outline = shapely.MultiPoint(points[:, :2]).convex_hull.buffer(0.01)
    space = free_floor(house, storey).intersection(region.buffer(1.0))
    shapely.prepare(space)
    low, high = np.array(region.bounds[:2]), np.array(region.bounds[2:])
    grid = np.stack(np.meshgrid(*(np.arange(a, b, GRID) for a, b in zip(low, high, strict=True))), -1).reshape(-1, 2)
    grid = grid[shapely.contains_xy(region.intersection(space), *grid.T)]
    near = shapely.distance(space.boundary, shapely.points(grid))
    order = np.argsort(-near if wanted is None else np.linalg.norm(grid - wanted, axis=1), kind="stable")
    turns = [2 * math.pi * k / TURNS for k in range(TURNS)]
    if wanted is not None and not isinstance(at, int | str | None):
        grid, order = np.concatenate([wanted[None], grid]), np.concatenate([[0], order + 1])
        turns = [float(at[2])] if len(at) == 3 else turns
    for x, y in grid[order]:
        for yaw in turns:
            c, s = math.cos(yaw), math.sin(yaw)
            if space.contains(shapely.affinity.affine_transform(outline, [c, -s, s, c, x, y])):
                floor = house.storeys[storey].elevation
                return float(x), float(y), floor - float(points[:, 2].min()) + CLEARANCE, yaw
    size = np.ptp(points[:, :2], axis=0)
    raise ValueError(
        f"no free floor for a robot of {size[0]:.2f} x {size[1]:.2f} m at {at!r}; choose a larger room, a keyframe in "
        "which it is smaller, or (x, y, z, yaw)"
    )


def _region(house: House, at: At) -> tuple[int, shapely.Geometry, np.ndarray | None]:
    """Storey, floor where a robot may stand, and the point (2,) that is wanted, if any."""
    rooms = {r.id: r for r in house.rooms}
    if at is None:
        areas = {i: free_floor(house, r.storey).intersection(shapely.Polygon(r.polygon)).area for i, r in rooms.items()}
        at = max(sorted(areas), key=lambda i: areas[i])
    if isinstance(at, str):
        if at not in rooms:
            raise ValueError(f"house {house.name!r} has no room {at!r}; it has {sorted(rooms)}")
        return rooms[at].storey, shapely.Polygon(rooms[at].polygon), None
    if isinstance(at, int):
        positions = build_graph(house).positions
        if not 0 <= at < len(positions):
            raise ValueError(f"house {house.name!r} has the nodes 0 to {len(positions) - 1}, not {at}")
        x, y, z = positions[at].tolist()
        storey = int(np.argmin([abs(s.elevation - (z - EYE)) for s in house.storeys]))
    elif len(at) in (2, 3):
        (x, y), storey = (float(at[0]), float(at[1])), 0
    else:
        raise ValueError(f"at should be a node, a room, (x, y), (x, y, yaw) or (x, y, z, yaw), got {at!r}")
    return storey, shapely.Point(x, y).buffer(LOOKED_AROUND), np.array([x, y])
