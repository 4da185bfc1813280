"""Robots of any MJCF in a house: put on free floor, with names, options, masses and keyframes taken care of."""

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

warnings.filterwarnings("ignore", "Attaching a child without asset dict")  # its files are read all the same
At: TypeAlias = int | str | Sequence[float] | None
"""A node, a room's id, (x, y), (x, y, yaw) or (x, y, z, yaw); None for the first room with space."""
Pose: TypeAlias = tuple[float, float, float, float]  # x, y, z in metres and yaw in radians, world
HOUSE = "embodied_house"  # text of a spec that has the JSON of its house
CLEARANCE, LOOKED_AROUND, GRID, TURNS = 0.002, 2.5, 0.1, 12
"""Metres from a robot's lowest point to the floor, around a node in which floor is looked for, and between the places
that are tried; and directions at each."""
SLIDE, HINGE_JOINT = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
ROLLING = {"x": (SLIDE, (1, 0, 0), 2e3), "y": (SLIDE, (0, 1, 0), 2e3), "yaw": (HINGE_JOINT, (0, 0, 1), 8e2)}
"""Joints of a base that rolls: axis, in the world, and gain of the velocity actuator of the same name."""
FINER = {"timestep": min, "impratio": max, "iterations": max, "ls_iterations": max, "noslip_iterations": max}
"""Which of two options holds; of the others, the house's."""


@dataclass(frozen=True, eq=False)
class PlacedRobot:
    """A robot in a spec; its names begin with `name` and a slash."""

    name: str
    pose: Pose
    """Of its own frame."""
    changes: tuple[str, ...]
    """All that is not as in its file."""


def place(
    spec: mujoco.MjSpec, robot: str | Path | mujoco.MjSpec, at: At = None, *, rolling: bool = False, name: str = "robot"
) -> PlacedRobot:
    """Attach a robot to the spec of a house (`scene_spec`); what was changed is in `PlacedRobot.changes`.

    Its names get `name` and a slash before them. Floors, lights and skies of its file are left out, masses stay as in
    a model of its own, the finer time step and the more exact solver hold, gravity is the house's, and its geoms meet
    the house's. The keyframe 'robot/start' is the house at rest, and in it the robot as in its first keyframe, or file.

    Args:
      robot: an MJCF or URDF file, an MjSpec, or a name of mujoco-menagerie (extra 'robots').
      at: where on free floor; (x, y, z, yaw) is taken as it is.
      rolling: it glides over the floor, by three velocity actuators 'robot/x', 'robot/y' and 'robot/yaw', metres and
        radians per second along the axes of the world: for arms, and for robots whose wheels or legs are not driven.

    Examples:
      >>> import mujoco
      >>> ball = '<mujoco><worldbody><body><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
      >>> spec = embodied.scene_spec(house, pictures=None)
      >>> placed = embodied.place(spec, mujoco.MjSpec.from_string(ball))
      >>> model = spec.compile()
    """
    child, start, known = _loaded(robot), f"{name}/", [t.data for t in spec.texts if t.name == HOUSE]
    if not known or any(b.name.startswith(start) for b in spec.bodies):
        raise ValueError(f"a robot {name!r} needs a spec of embodied.scene_spec(house), and a name of its own there")
    changes = [*_without_surroundings(child)]
    alone = child.compile()
    data = mujoco.MjData(alone)
    if alone.nkey:
        mujoco.mj_resetDataKeyframe(alone, data, 0)
        changes.append(f"of its {alone.nkey} keyframes the start is the first, {alone.key(0).name!r}")
    mujoco.mj_forward(alone, data)
    pose = _pose(House.from_json(known[0]), at, _touching(alone, data))
    changes += [*_options(spec, child), *_contacts(spec, child, alone), *_weights(child, alone)]
    changes += _begin(child, alone, data, pose, rolling)
    holder = spec.worldbody.add_body(name=f"{start}rolling", pos=pose[:3]) if rolling else spec.worldbody
    frame = holder.add_frame(pos=[0, 0, 0] if rolling else pose[:3], quat=yaw_quat(pose[3]))
    spec.attach(child, frame=frame, prefix=start)
    for joint, (kind, axis, gain) in ROLLING.items() if rolling else ():
        holder.mass, holder.inertia, holder.explicitinertial = 1.0, [0.1] * 3, True
        holder.add_joint(name=start + joint, type=kind, axis=axis)
        actuator = spec.add_actuator(name=start + joint, target=start + joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_velocity(kv=gain)
    return PlacedRobot(name, pose, tuple(changes))


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
    known = mujoco_menagerie.get(str(robot))
    return known.spec(next(e.name for e in known.entry_points if not e.is_mjx and "scene" not in e.name))


def _begin(
    child: mujoco.MjSpec, alone: mujoco.MjModel, data: mujoco.MjData, pose: Pose, rolling: bool
) -> Iterator[str]:
    """Give the child one keyframe, in the world, and take the free joints of what rolls away."""
    qpos, free = data.qpos.copy(), [j for j in child.joints if j.type == mujoco.mjtJoint.mjJNT_FREE]
    for joint in reversed(free):
        first = int(alone.jnt_qposadr[joint.id])
        at, quat = qpos[first : first + 3], qpos[first + 3 : first + 7]
        if rolling:
            yield f"free joint of {joint.parent.name!r} taken away, as its base rolls"
            joint.parent.pos, joint.parent.quat = at, quat
            qpos = np.delete(qpos, range(first, first + 7))
            child.delete(joint)
        else:
            posed = RigidPose.upright(pose[:3], pose[3]).then(RigidPose((0, 0, 0), tuple(quat)).rotation, at)
            qpos[first : first + 7] = *posed.position, *posed.quat
    for known in list(child.keys):
        child.delete(known)
    child.add_key(name="start", qpos=qpos, ctrl=data.ctrl)


def _weights(child: mujoco.MjSpec, alone: mujoco.MjModel) -> Iterator[str]:
    """Give the child the masses that it has alone, which depend on options of its compiler."""
    floats = not np.any(alone.opt.gravity)
    for body in child.bodies[1:]:
        for field in ("mass", "ipos", "iquat", "inertia"):
            setattr(body, field, getattr(alone, f"body_{field}")[body.id])
        body.explicitinertial, body.gravcomp = True, 1 if floats else body.gravcomp
    if floats:
        yield "gravity compensation of all its bodies, as its file has no gravity"


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
    if stray := [g for g in child.geoms if masks[g.id] and not masks[g.id] & 1]:
        bit = next(1 << k for k in range(1, 31) if not np.any(masks & (1 << k)))
        for g in (g for g in spec.geoms if g.contype or g.conaffinity):
            g.conaffinity |= bit
        for g in stray:
            g.contype = int(alone.geom_contype[g.id]) | bit
        yield f"{len(stray)} geoms touch the house by contype {bit}, which their own masks would not"


def _touching(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """(n, 3) points around what touches, metres, in the robot's frame."""
    points = []
    for g in np.flatnonzero(model.geom_contype | model.geom_conaffinity):
        if (shape := shape_of(model, int(g))) is not None:
            points.append(shape[0] @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g])
    return np.concatenate(points or [np.zeros((1, 3))])


def _pose(house: House, at: At, points: np.ndarray) -> Pose:
    """Pose in which what touches, (n, 3) of the robot's frame, is on free floor."""
    storey, wanted, rooms = 0, None, {r.id: r for r in house.rooms}
    turns = [2 * math.pi * k / TURNS for k in range(TURNS)]
    if isinstance(at, str):
        if at not in rooms:
            raise ValueError(f"house {house.name!r} has no room {at!r}; it has {sorted(rooms)}")
        storey, region = rooms[at].storey, shapely.Polygon(rooms[at].polygon)
    elif at is None:
        region = free_floor(house, storey)
    elif isinstance(at, int):
        x, y, z = build_graph(house).positions[at].tolist()
        storey, wanted = int(np.argmin([abs(s.elevation - (z - EYE)) for s in house.storeys])), (x, y)
    elif len(at) == 4:
        return float(at[0]), float(at[1]), float(at[2]), float(at[3])
    else:
        wanted, turns = (float(at[0]), float(at[1])), [float(at[2])] if len(at) == 3 else turns
    region = shapely.Point(wanted).buffer(LOOKED_AROUND) if wanted else region
    space, outline = free_floor(house, storey), shapely.MultiPoint(points[:, :2]).convex_hull.buffer(0.01)
    shapely.prepare(space)
    west, south, east, north = region.bounds
    grid = np.stack(np.meshgrid(np.arange(west, east, GRID), np.arange(south, north, GRID)), -1).reshape(-1, 2)
    grid = grid[shapely.contains_xy(region, *grid.T)]
    room = shapely.distance(space.boundary, shapely.points(grid))
    for x, y in grid[np.argsort(-room if wanted is None else np.linalg.norm(grid - wanted, axis=1), kind="stable")]:
        for yaw in turns:
            c, s = math.cos(yaw), math.sin(yaw)
            if space.contains(shapely.affinity.affine_transform(outline, [c, -s, s, c, x, y])):
                floor = house.storeys[storey].elevation + CLEARANCE
                return float(x), float(y), floor - float(points[:, 2].min()), yaw
    size = " x ".join(f"{x:.2f}" for x in np.ptp(points[:, :2], axis=0))
    raise ValueError(f"no free floor for a robot of {size} m at {at!r}; choose a larger room, or (x, y, z, yaw)")
