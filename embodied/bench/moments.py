"""Houses at a moment with five movers each, and what a path tracer shows of them; and pictures of the people of lit
houses, as those see them who meet them."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import cv2
import mujoco
import numpy as np
import shapely

from embodied.assets.catalogue import Catalogue
from embodied.assets.records import Finish, MeshPart
from embodied.bench.light import VIEW_ANGLE
from embodied.generate import HouseConfig, generate_house
from embodied.generate.people import add_people, place_people
from embodied.geometry import rotation
from embodied.house.house import House, Placement
from embodied.house.moment import Moment, RigidPose
from embodied.house.shapes import footprint, room_at
from embodied.light.baking.house import bake
from embodied.light.pages.files import Bake
from embodied.light.tracing.reference import Tracer
from embodied.navigation.graph import NavGraph, build_graph
from embodied.render.camera import Camera, camera_at
from embodied.render.classic import Renderer
from embodied.render.film import light_of, shown_of
from embodied.scene.bodies import body_parts, body_poses
from embodied.scene.house_meshes import house_parts
from embodied.scene.part import Part
from embodied.seeds import stream
from embodied.world import gloss_of, open_world

MOVING_HOURS = (
    *((10.0, "clear"), (13.0, "overcast"), (16.5, "clear"), (21.5, "clear")),
    *((9.0, "clear"), (12.0, "clear"), (15.0, "overcast"), (18.5, "clear")),
)
"""Hour and weather of the houses."""
MOVING_AREA = (34.0, 48.0)
"""Square metres of the houses."""
DOOR_OPENNESS = (0.0, 0.35, 0.65)
"""Openness of the doors, which all stand open at rest."""
FLOOR_AROUND, LOOKED_FROM = 0.6, 1.9
"""Metres around a mover within which the floor is judged, and from which it is looked at."""
MOVABLE = ("floor", "against_wall", "corner")
"""Supports of furniture that moves."""
MOVER_SIZE = (128, 128)
"""Height and width of the pictures, pixels."""
TRUTH_RAYS = 48
"""Of a pixel of the path tracer."""
BENCH_ROBOT = "robot"


@dataclass(frozen=True)
class Staged:
    """A house at rest, and two moments of it: one with four movers, one with a door turned. The robot is no part of the
    house."""

    house: House
    graph: NavGraph
    """Of the house without the person, who may stand in the way."""
    moments: tuple[Moment, Moment]
    movers: tuple[Mapping[str, str], Mapping[str, str]]
    """Kind by placement or opening id, of each."""
    robot: Placement

    def carried(self, name: str) -> set[str]:
        """Owners of what moves with a mover."""
        return {p.id for p in self.house.placements if self.moments[0].carrier(self.house, p) == name} | {name}


@dataclass(frozen=True)
class WithRobot:
    """A catalogue that knows the robot, too, standing still."""

    catalogue: Catalogue
    bodies: Mapping[str, tuple[Part, ...]]
    poses: Mapping[str, RigidPose]

    def mesh(self, key: str, size: tuple[float, float, float], params: tuple = ()) -> tuple[MeshPart, ...]:
        if key != BENCH_ROBOT:
            return self.catalogue.mesh(key, size, params)
        placed = lambda m, pose: dataclasses.replace(
            m, vertices=pose.points(m.vertices), normals=m.normals @ pose.rotation.T.astype(np.float32)
        )
        return tuple(placed(p.mesh, self.poses[name]) for name, parts in self.bodies.items() for p in parts)

    def finish(self, material_key: str) -> Finish:
        return self.catalogue.finish(material_key)


def robot_model() -> mujoco.MjModel:
    """A cart on four wheels with an arm: 15 bodies of plain shapes."""
    spec, kinds = mujoco.MjSpec(), mujoco.mjtGeom
    link = cart = spec.worldbody.add_body(name=f"{BENCH_ROBOT}_0")
    cart.add_freejoint()
    cart.add_geom(type=kinds.mjGEOM_BOX, size=[0.26, 0.2, 0.12], pos=[0, 0, 0.19], rgba=[0.85, 0.85, 0.88, 1])
    cart.add_geom(type=kinds.mjGEOM_CYLINDER, size=[0.05, 0.15, 0], pos=[-0.1, 0, 0.46], rgba=[0.1, 0.1, 0.12, 1])
    for k, (x, y) in enumerate(((-0.17, -0.2), (-0.17, 0.2), (0.17, -0.2), (0.17, 0.2))):
        wheel = cart.add_body(name=f"{BENCH_ROBOT}_{k + 1}", pos=[x, y, 0.07], quat=[0.7071, 0.7071, 0, 0])
        wheel.add_geom(type=kinds.mjGEOM_CYLINDER, size=[0.07, 0.025, 0], rgba=[0.08, 0.08, 0.08, 1])
    for k in range(10):
        place = [-0.1, 0.0, 0.62] if k == 0 else [0.0, 0.0, 0.1]
        link = link.add_body(name=f"{BENCH_ROBOT}_{k + 5}", pos=place, quat=[math.cos(0.17), 0, math.sin(0.17), 0])
        link.add_joint(axis=[0, 1, 0] if k % 2 else [1, 0, 0])
        paint = [0.75, 0.75, 0.75, 1] if k % 2 else [0.8, 0.35, 0.1, 1]
        link.add_geom(type=kinds.mjGEOM_CAPSULE, fromto=[0, 0, 0, 0, 0, 0.09], size=[0.045, 0, 0], rgba=paint)
    return spec.compile()


def with_robot(catalogue: Catalogue, cache: Path) -> WithRobot:
    """The catalogue and the robot, its arm at rest."""
    model = robot_model()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    parts = body_parts(model, cache / "bodies")
    return WithRobot(catalogue, parts, body_poses(model, data, parts))


def staged(catalogue: WithRobot, seed: int, k: int) -> Staged:
    """House k and its movers: the robot, a person, two pieces of furniture and a door."""
    hour, weather = MOVING_HOURS[k % len(MOVING_HOURS)]
    config = HouseConfig(area=MOVING_AREA, hour=hour, weather=weather)
    house = generate_house(seed + k, config, catalogue=catalogue.catalogue)
    graph, rng = build_graph(house), stream(seed + k, "bench", "moving")
    asset = (people := catalogue.catalogue.of_class("person"))[int(rng.integers(len(people)))]
    person = _elsewhere(house, Placement("person_1", asset.key, "person", "", (0, 0, 0), 0.0, asset.size), [], rng)
    assert person is not None  # some floor is free in every house
    house = dataclasses.replace(house, placements=(*house.placements, person))
    support = {key: a.support for key, a in catalogue.catalogue.assets.items()}
    fits = lambda size: min(size) > 0.25 and max(size[:2]) < 1.3
    furniture = [p for p in house.placements if support[p.asset] in MOVABLE and fits(p.size)]
    robot = Placement(BENCH_ROBOT, BENCH_ROBOT, BENCH_ROBOT, "", (0, 0, 0), 0.0, (0.6, 0.5, 1.4))
    placed: list[Placement] = []
    for p in (person, robot, *(furniture[i] for i in rng.permutation(len(furniture)))):
        there = _elsewhere(house, p, placed, rng) if len(placed) < 4 else None
        placed += [there] if there is not None else []
    door = [o for o in house.openings if o.kind == "door" and o.leaf_finish is not None][k % 2]
    base = next(p for p in placed if p.id == BENCH_ROBOT)
    others = [p for p in placed if p is not base]
    bodies = {name: _on(base, pose) for name, pose in catalogue.poses.items()}
    moved = {p.id: RigidPose.upright(p.position, p.yaw) for p in others}
    movers = {p.id: p.id if p.id == BENCH_ROBOT else "person" if p.id == "person_1" else "furniture" for p in placed}
    moments = Moment(moved, {}, bodies), Moment({}, {door.id: DOOR_OPENNESS[k % 3]})
    return Staged(house, graph, moments, (movers, {door.id: "door"}), base)


def _on(base: Placement, pose: RigidPose) -> RigidPose:
    """A pose given in the frame of a placement, in the world."""
    c, s, (w, x, y, z) = math.cos(base.yaw / 2), math.sin(base.yaw / 2), pose.quat
    at = np.array([*(rotation(base.yaw) @ pose.position[:2]), pose.position[2]]) + base.position
    return RigidPose(tuple(at.tolist()), (c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w))


def _elsewhere(house: House, p: Placement, taken: Sequence[Placement], rng: np.random.Generator) -> Placement | None:
    """`p` on free floor elsewhere, turned; None where there is none to be found."""
    stand = [*taken, *(q for q in house.placements if q.id != p.id and q.parent is None and q.size[2] > 0.03)]
    floor = shapely.union_all([house.floor(r) for r in house.rooms])
    floor = floor.difference(shapely.union_all([footprint(q) for q in stand])).buffer(-0.03)
    shapely.prepare(floor)
    low, high = np.split(np.array(floor.bounds), 2)
    for x, y in rng.uniform(low, high, (4000, 2)):
        at, yaw = (float(x), float(y), p.position[2]), p.yaw + float(rng.uniform(0, 6.28))
        there = dataclasses.replace(p, position=at, yaw=yaw, room=str(room_at(house, (x, y, 0.05))))
        if floor.contains(footprint(there)) and math.dist((x, y), p.position[:2]) > 0.5:
            return there
    return None


def truth(s: Staged, catalogue: WithRobot, cache: Path, path: Path) -> dict[str, np.ndarray]:
    """Of every mover, by name and word: an eye, what the path tracer and a bake of the moment itself show, and which
    pixels count. Kept in a file."""
    if not path.exists():
        some, door = s.moments
        moved = dataclasses.replace(some, bodies={}).applied(s.house)
        moved = dataclasses.replace(moved, placements=(*moved.placements, s.robot))
        seen = _truth(s, 0, moved, catalogue, cache) | _truth(s, 1, door.applied(s.house), catalogue, cache)
        arrays = {f"{name}/{key}": a for name, facts in seen.items() for key, a in facts.items()}
        np.savez_compressed(path, **arrays)  # type: ignore[arg-type]  # its options are no arrays
    with np.load(path) as known:
        return dict(known)


def _truth(s: Staged, which: int, moved: House, catalogue: WithRobot, cache: Path) -> dict[str, dict[str, np.ndarray]]:
    at_rest, own = (bake(h, cast(Catalogue, catalogue), cache, "fast") for h in (s.house, moved))
    same = Bake(own.folder, own.manifest | {"exposure": at_rest.manifest["exposure"]})
    ratio = dict(zip((r.id for r in moved.rooms), same.exposure.gains / own.exposure.gains, strict=True))
    rooms = {m.page: m.room for m in own.lit.meshes if m.room in ratio}
    pages = [
        shown_of((light_of(page) * ratio[rooms[i]]).astype(np.float32)) if i in rooms else page
        for i, page in enumerate(own.lit.pages)
    ]
    same.__dict__["lit"] = dataclasses.replace(own.lit, pages=tuple(pages))
    tracer = Tracer(same, moved, quality="reference", rays=TRUTH_RAYS)
    with Renderer(moved, cast(Catalogue, catalogue), lit=same.lit, overlay=gloss_of(same)) as renderer:
        return {name: _seen(s, name, moved, catalogue, renderer, tracer) for name in s.movers[which]}


def _seen(
    s: Staged, name: str, moved: House, catalogue: WithRobot, renderer: Renderer, tracer: Tracer
) -> dict[str, np.ndarray]:
    carried = s.carried(name)
    moves = lambda p: p.kind == "object" or p.mesh_key.startswith("leaf/")
    parts = [p for p in house_parts(moved, catalogue) if p.owner.partition("/")[0] in carried and moves(p)]
    points = np.concatenate([RigidPose.upright(p.position, p.yaw).points(p.mesh.vertices) for p in parts])
    middle = (points.min(0) + points.max(0)) / 2
    numbers = [i + 1 for i, o in enumerate(renderer.owners) if o in {p.owner for p in parts}]
    eyes = sorted(s.graph.positions, key=lambda e: abs(math.dist(e[:2], middle[:2]) - LOOKED_FROM))[:8]
    pitch_from = lambda e: math.atan2(middle[2] - e[2], math.dist(e[:2], middle[:2]))
    views = [(e, math.atan2(*(middle - e)[1::-1]), pitch_from(e)) for e in eyes]
    static = [renderer.view(*v, VIEW_ANGLE, MOVER_SIZE) for v in views]
    best = int(np.argmax([np.isin(v.ids, numbers).sum() for v in static]))
    eye, yaw, pitch = views[best]
    camera = camera_at(eye, yaw, pitch, VIEW_ANGLE)
    rgb, depth, ids = tracer.picture(eye, camera.forward, camera.up, VIEW_ANGLE, MOVER_SIZE)
    ids, there = np.where(ids == static[best].ids, ids, 0), _places(camera, depth)
    floors = [i + 1 for i, o in enumerate(renderer.owners) if o.endswith("/floor")]
    outline = shapely.MultiPoint(points[:, :2]).convex_hull
    near = shapely.distance(outline, shapely.points(there[..., :2])) < FLOOR_AROUND
    return {
        "eye": np.array([*eye, yaw, pitch]),
        "reference": rgb,
        "static": static[best].rgb,
        "mover": np.isin(ids, numbers),
        "floor": np.isin(ids, floors) & near,
    }


def _places(camera: Camera, depth: np.ndarray) -> np.ndarray:
    """(h, w, 3) world metres of what a picture shows; far away where it shows nothing."""
    h, w = depth.shape
    t, far = math.tan(camera.vfov / 2), np.where(np.isfinite(depth), depth, 1e3)[..., None]
    x, y = ((np.arange(w) + 0.5) / w * 2 - 1) * t * w / h, (1 - (np.arange(h) + 0.5) / h * 2) * t
    across, up = x[None, :, None] * camera.right, y[:, None, None] * np.array(camera.up)
    return np.array(camera.position) + far * (np.array(camera.forward) + across + up)


PEOPLE_HOUSES, PEOPLE_AREA = 6, (44.0, 60.0)
"""Houses, and their square metres."""
CROP, CROP_ANGLE = (400, 300), math.radians(66)
"""Height and width of a picture, pixels, and its vertical field of view."""
ROW = 6


def people_pictures(
    catalogue: Catalogue, cache: Path, out: Path, *, seed: int, progress: Callable[[str], None]
) -> dict[str, object]:
    """Draws everybody whom one meets in six houses from where one meets them: out/people/K_ID.png, and a sheet."""
    folder, crops = out / "people", []
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(PEOPLE_HOUSES):
        hour, weather = MOVING_HOURS[k]
        house = generate_house(seed + k, HouseConfig(area=PEOPLE_AREA, hour=hour, weather=weather), catalogue)
        graph = build_graph(house)
        met = place_people(house, graph, catalogue, seed=seed)
        house = add_people(house, met, met)
        with open_world(house, catalogue, cache, pictures="fast") as world:
            for person in (p for p in house.placements if p.object_class == "person"):
                node = next(n for n in met if met[n].position == person.position)
                eye = graph.positions[node]
                x, y, z = np.array([*person.position[:2], person.position[2] + 0.72 * person.size[2]]) - eye
                yaw, pitch = math.atan2(y, x), math.atan2(z, math.hypot(x, y))
                rgb = world.renderer.view(eye, yaw, pitch, CROP_ANGLE, CROP).rgb
                cv2.imwrite(str(folder / f"{k}_{person.id}.png"), rgb[..., ::-1])
                crops.append(rgb)
        progress(f"house {k + 1} of {PEOPLE_HOUSES}: {len(crops)} people so far")
    crops += [np.zeros_like(crops[0])] * (-len(crops) % ROW)
    sheet = np.vstack([np.hstack(crops[i : i + ROW]) for i in range(0, len(crops), ROW)])
    cv2.imwrite(str(out / "people.png"), sheet[..., ::-1])
    return {"sheet": str(out / "people.png"), "people": len(list(folder.glob("*.png")))}
