"""Benchmarks of houses, pictures, light and play, and of what agents see: steps with pixels, live pictures, the body on
wheels, a robot with arms, and views of a panorama.

With OMP_NUM_THREADS=1 rates are of one core; threads that draw together take more processor time in all.
"""

import functools
import itertools
import math
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import mujoco
import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.assistants.route_system import build_routes
from embodied.bench.timing import Measure, from_values, measure, one_core
from embodied.datasets.build import DatasetConfig, make_dataset_house
from embodied.datasets.store import StoredPlace
from embodied.envs.base import HelpEnv
from embodied.generate import HouseConfig, generate_house
from embodied.gym.driving import DriveSettings, Driving, expert_action
from embodied.gym.env import HelpGymEnv
from embodied.gym.robot import RobotEnv, RobotSettings
from embodied.gym.sensors import CameraSensor, PanoramaStore, Sensor, ViewSettings
from embodied.gym.spaces import SpaceLayout
from embodied.house.house import House
from embodied.interface import Action, Ask, Intention, Move, Observation, Task
from embodied.kinds.task_kind import EnvInputs, TaskInputs, kind_named
from embodied.language.plain_language import PlainLanguage
from embodied.light.baking.house import bake_all, forget, lightings_of
from embodied.mattersim.pictures import Skyboxes, skybox_folder, write_skybox
from embodied.render.camera import Camera, face_cameras
from embodied.render.classic import Renderer
from embodied.render.panorama import VFOV36, Panorama, perspective_grid
from embodied.scene.house_meshes import house_parts
from embodied.scene.model import compile_scene
from embodied.seeds import stream
from embodied.tasks.goals import find_pool, find_task
from embodied.world import World, open_world

LARGE_HOUSE = HouseConfig(area=(400.0, 440.0), storeys=1)
"""A house of about 125 viewpoints; Matterport3D has 117 per building."""


def houses(catalogue: Catalogue, seed: int) -> Iterator[Measure]:
    """Layout and furnishing of a 125-node house."""
    seeds = iter(range(seed, seed + 10_000))
    make = lambda: generate_house(next(seeds), LARGE_HOUSE, catalogue)
    yield measure("layout and furnishing, 125-node house", make, "s", repeats=7)
    house = generate_house(seed, LARGE_HOUSE, catalogue)
    yield measure("to a ready MjModel, assets cached", lambda: compile_scene(house, catalogue), "s", repeats=5)


def pictures(catalogue: Catalogue, cache: Path, seed: int, kind: str) -> Iterator[Measure]:
    """Cube faces, panoramas and resampled views."""
    house = generate_house(seed, LARGE_HOUSE, catalogue)
    with open_world(house, catalogue, cache, size=256, pictures=kind) as world:
        renderer, eyes = world.renderer, world.graph.positions
        nodes = np.linspace(0, len(eyes) - 1, 12).astype(int)
        cameras = [c for n in nodes for c in face_cameras(eyes[n])]
        yield _face(renderer, cameras, kind)
        of_nodes = functools.partial(measure, per=len(nodes), repeats=3)
        faces = lambda: [[renderer.rgb(c, (256, 256)) for c in face_cameras(eyes[n])] for n in nodes]
        yield of_nodes(f"256 panorama, six faces of rgb, {kind}", faces)
        yield of_nodes(f"256 panorama with depth and ids, {kind}", lambda: [renderer.panorama(eyes[n]) for n in nodes])
        panorama = renderer.panorama(eyes[0])
        yield measure("36 views at 224 px from a panorama", lambda: panorama.views36(224), repeats=15)
    if kind != "unlit":
        with open_world(house, catalogue, cache, size=256, pictures="unlit") as plain:
            yield _face(plain.renderer, cameras, "unlit")


def _face(renderer: Renderer, cameras: Sequence[Camera], kind: str) -> Measure:
    name, draw = f"256x256 cube face, rgb, {kind}", lambda: [renderer.rgb(c, (256, 256)) for c in cameras]
    return measure(name, draw, per=len(cameras), repeats=5)


LIT_FLAT = HouseConfig(area=(60.0, 70.0), hour=10.5, weather="clear")
"""The flat that is lit."""
HOUSE = HouseConfig(area=(97.0, 103.0), hour=10.5, weather="clear")
"""The house that is made from its seed on."""
QUALITIES = ("fast", "normal")
TIMED_BAKES = 3
LIGHTINGS = 3


def bakes(catalogue: Catalogue, cache: Path, seed: int) -> Iterator[Measure]:
    """Light a flat again and again, its furniture imported and unwrapped before."""
    house = generate_house(seed, LIT_FLAT, catalogue=catalogue)
    house_parts(house, catalogue)  # imports the furniture
    took: dict[str, list[float]] = {q: [] for q in QUALITIES}
    for repeat in range(TIMED_BAKES + 1):
        for quality in QUALITIES:
            seconds = _seconds((house,), catalogue, cache, quality)
            if repeat:  # the first compiles and unwraps
                took[quality] += seconds
    for quality, seconds in took.items():
        yield from_values(f"bake, {quality}, processor time", seconds, "s")
    several = lightings_of(house, LIGHTINGS)
    rounds = [_seconds(several, catalogue, cache, "fast") for _ in range(TIMED_BAKES)]
    for k in range(1, LIGHTINGS):
        shares = [one[k] / one[0] for one in rounds]
        yield from_values(f"bake, fast, lighting {k + 1} of lighting 1", shares, "share")
    body = functools.partial(_panoramas, catalogue, cache, seed)
    name = "house of 100 m², from its seed to its lit panoramas, processor time"
    yield measure(name, body, "s", repeats=TIMED_BAKES, clock=time.process_time)


def _panoramas(catalogue: Catalogue, cache: Path, seed: int) -> None:
    """Make a house and its light anew, and look around at every node."""
    house = generate_house(seed, HOUSE, catalogue=catalogue)
    forget(cache, house, catalogue, "fast")
    with open_world(house, catalogue, cache, pictures="fast") as world:
        for position in world.graph.positions:
            world.renderer.panorama(position)


def _seconds(lightings: Sequence[House], catalogue: Catalogue, cache: Path, quality: str) -> list[float]:
    """Processor seconds of every lighting of one house, made anew, without unwrapping: that is the furniture's."""
    for house in lightings:
        forget(cache, house, catalogue, quality)
    start = time.process_time()
    made = bake_all(lightings, catalogue, cache, quality)
    whole = time.process_time() - start
    parts = [b.manifest["processor_seconds"] for b in made]
    parts[0] += whole - sum(parts)  # what comes before the first
    parts[0] -= made[0].manifest["unwrap_seconds"]
    return parts


KINDS_PLAYED = ("find", "hanna")
"""HANNA's steps include the assistant's replies."""
TASKS_PLAYED = 60


def plays(catalogue: Catalogue, seed: int) -> Iterator[Measure]:
    """Environment steps per second of every kind of task, with caches warm, no pixels."""
    language = PlainLanguage()
    for kind in KINDS_PLAYED:
        known = kind_named(kind)
        house, graph = make_dataset_house(seed, "bench", HouseConfig(area=DatasetConfig(kind).area), catalogue)
        place = StoredPlace(house, graph)
        routes = build_routes(place, seed=seed, language=language, house_split="test") if known.routes else ()
        (tasks,) = known.tasks(TaskInputs(place, routes, seed, language), [(known.unseen_part, TASKS_PLAYED)]).values()
        env = known.environments(EnvInputs({"bench": place}, {"bench": routes}.__getitem__))()
        counts = walk(env, tasks)
        name = f"{kind} steps, {100 * counts[1] / counts[0]:.0f} % requests"
        yield measure(name, functools.partial(walk, env, tasks), "1/s", repeats=7, per=counts[0])


def walk(env: HelpEnv, tasks: list[Task]) -> tuple[int, int]:
    """Play tasks by a fixed rule that asks at every fifth step where it can; (steps, requests) taken."""
    steps = requests = 0
    for task in tasks:
        o: Observation | None = env.reset(task)
        while o is not None:
            help_wanted = o.can_ask and o.time % 5 == 4 and o.time_on_task
            choice = o.time % len(o.candidates)
            action: Action = Move(choice if o.candidates.allowed[choice] else 1)
            if help_wanted:
                action = Ask(o.can_ask[0] if o.can_ask[0] is Intention.HELP else o.can_ask[-1])
            requests += isinstance(action, Ask)
            o = env.step(action)
            steps += 1
    return steps, requests


FLAT = HouseConfig(area=(70.0, 110.0))
"""The flat that the agent walks in."""
STEPS = 200
"""Of one timed call."""
LINES = (
    ("rgb, 128 x 128", ("rgb",), ViewSettings()),
    ("rgb, depth and ids, 128 x 128", ("rgb", "depth", "ids"), ViewSettings()),
    ("rgb, the 36 views at 128 x 128", ("rgb",), ViewSettings("views36")),
)
"""Channels that are seen, and how."""


def seen(catalogue: Catalogue, cache: Path, seed: int, kind: str) -> Iterator[Measure]:
    """Random walks through one flat whose panoramas are in memory, on one core."""
    with one_core():
        house = generate_house(seed, FLAT, catalogue)
        with open_world(house, catalogue, cache, pictures=kind) as world:
            yield from _measures(world, seed)


def _measures(world: World, seed: int) -> Iterator[Measure]:
    world.render_all()
    store, pool = PanoramaStore({world.name: world}), find_pool(world, seed=seed)
    tasks = [find_task(pool, i, seed=seed, language=PlainLanguage()) for i in range(50)]
    for name, channels, view in LINES:
        env = _env(world, tasks, CameraSensor(store, channels, view))
        steps = 40 if view.frame == "views36" else STEPS
        walk = functools.partial(_walk, env, steps, seed)
        yield measure(f"steps, {name}", walk, "1/s", per=steps)
    plain = _env(world, tasks, CameraSensor(store, ("rgb",), ViewSettings()))
    draw = functools.partial(_draw, plain, world)
    yield measure("the naive way: a picture drawn per step", lambda: _walk(plain, 40, seed, draw), "1/s", per=40)


def _env(world: World, tasks: list[Task], sensor: Sensor) -> HelpGymEnv:
    return HelpGymEnv(lambda: HelpEnv({world.name: world}), tasks, sensor, layout=SpaceLayout())


def _walk(env: HelpGymEnv, steps: int, seed: int, look: Callable[[], object] = lambda: None) -> None:
    """Random moves, a `look` after each, a new task when one ends; never stops of its own."""
    rng = stream(seed, "bench", "walk")
    o, _ = env.reset(seed=seed)
    for _ in range(steps):
        possible = np.flatnonzero(o["action_mask"][: SpaceLayout().candidates])
        o, _, terminated, truncated, _ = env.step(int(rng.choice(possible)))
        look()
        if terminated or truncated:
            o, _ = env.reset()


def _draw(env: HelpGymEnv, world: World) -> None:
    """The agent's view, drawn from the model."""
    pose = env._env.pose
    world.renderer.view(world.graph.positions[pose.node], pose.yaw, pose.pitch, ViewSettings().vfov, (128, 128))


DRIVE_STEPS = 60
"""Of one timed call; a command is held for a tenth of a second."""
LIVE_SIZES = ((128, 128), (480, 640))
"""Height and width of live pictures."""


def drive(catalogue: Catalogue, cache: Path, seed: int, pictures: str) -> Iterator[Measure]:
    """Guided drives through one flat; whoever draws with the CPU has all of that counted."""
    with one_core(), open_world(generate_house(seed, FLAT, catalogue), catalogue, cache, pictures=pictures) as world:
        driving = Driving({world.name: world}, DriveSettings(observations=()))
        commands, cameras = recorded(driving, seed)
        rate = functools.partial(measure, unit="1/s", per=DRIVE_STEPS, clock=time.process_time)
        for size in LIVE_SIZES:
            name = f"frames of {size[1]} x {size[0]}"
            yield rate(f"{name}, rgb", functools.partial(_film, world.renderer, cameras, size, False))
            yield rate(f"{name}, rgb, depth and ids", functools.partial(_film, world.renderer, cameras, size, True))
        driving = Driving({world.name: world}, DriveSettings(observations=("rgb",)))
        yield rate("drive, rgb, 128 x 128", functools.partial(replay, driving, commands, seed))


def recorded(driving: Driving, seed: int) -> tuple[list[tuple[int, np.ndarray]], list[Camera]]:
    """Episode and command of DRIVE_STEPS steps of whoever knows the way, and where its eye was then."""
    commands: list[tuple[int, np.ndarray]] = []
    cameras = []
    episode = 0
    while len(commands) < DRIVE_STEPS:
        driving.reset(stream(seed, "bench", "drive", episode))
        while driving.ended is None and len(commands) < DRIVE_STEPS:
            commands.append((episode, expert_action(driving)))
            cameras.append(driving.camera())
            driving.step(commands[-1][1])
        episode += 1
    return commands, cameras


def replay(driving: Driving, commands: list[tuple[int, np.ndarray]], seed: int) -> None:
    """The same drives again, looking after every command."""
    begun = -1
    for episode, command in commands:
        if episode != begun:
            driving.reset(stream(seed, "bench", "drive", episode))
            begun = episode
        driving.step(command)
        driving.look()


def _film(renderer: Renderer, cameras: Sequence[Camera], size: tuple[int, int], whole: bool) -> None:
    for camera in cameras:
        if whole:
            renderer.through(camera, size)
        else:
            renderer.rgb(camera, size)


ARM = 10
"""Joints of each of the robot's two arms."""


def robots(catalogue: Catalogue, cache: Path, seed: int, pictures: str) -> Iterator[Measure]:
    """Steps of Robot-v0, a tenth of a second each, of a robot that drives and waves two arms before its eyes."""
    with one_core(), open_world(generate_house(seed, FLAT, catalogue), catalogue, cache, pictures=pictures) as world:
        rate = functools.partial(measure, unit="1/s", per=DRIVE_STEPS, clock=time.process_time)
        every = [((), True), (("rgb",), False), *((channels, True) for _, channels, _ in LINES[:2])]
        for seen, shadows in every:
            settings = RobotSettings(two_arms(), f"link_1_{ARM - 1}", "pick", observations=seen, shadows=shadows)
            env = RobotEnv({world.name: world}, settings)
            env.reset(seed=seed)
            shown = " and ".join(seen) + ("" if shadows else " without its shadow") or "without pictures"
            name = f"robot of {2 * ARM} joints, {shown}, 128 x 128"
            yield rate(name, functools.partial(_wave, env))


def two_arms() -> mujoco.MjSpec:
    """A cart with a mast, a camera and two arms of ARM hinges, all driven."""
    spec, kinds = mujoco.MjSpec(), mujoco.mjtGeom
    spec.option.timestep = 0.004
    cart = spec.worldbody.add_body(name="cart")
    cart.add_geom(type=kinds.mjGEOM_BOX, size=[0.2, 0.18, 0.15], pos=[0, 0, 0.18], mass=40)
    cart.add_geom(type=kinds.mjGEOM_CYLINDER, size=[0.05, 0.35, 0], pos=[0, 0, 0.65], mass=5)
    cart.add_camera(name="head", pos=[0.1, 0, 1.25], xyaxes=[0, -1, 0, 0.3, 0, 1], fovy=70)
    for side in (-1, 1):
        link = cart
        for k in range(ARM):
            name, at = f"link_{side}_{k}", [0.06, 0, 0] if k else [0.1, 0.2 * side, 0.95]
            link = link.add_body(name=name, pos=at, gravcomp=1)
            link.add_joint(name=name, axis=[0, k % 2, 1 - k % 2], damping=2, armature=0.05)
            link.add_geom(type=kinds.mjGEOM_CAPSULE, fromto=[0, 0, 0, 0.06, 0, 0], size=[0.03, 0, 0], mass=0.2)
            spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT).set_to_position(kp=20)
    return spec


def _wave(env: RobotEnv) -> None:
    """DRIVE_STEPS actions."""
    for k in range(DRIVE_STEPS):
        waves = 0.2 * np.sin(k / 8 + np.arange(len(env.commands)))
        env.step(np.clip([0.7 * math.sin(k / 20), 0.0, 0.4 * math.cos(k / 15), *waves[3:]], -1, 1))


SKYBOX_SIDE = 512
"""Side of a face, pixels."""
HEADINGS = 12
"""Headings of one timed call."""
VIEW_SIZES = ((480, 640), (224, 224))
"""Height and width."""
SHOWN = {"rgb": ("rgb",), "rgb, depth and ids": ("rgb", "depth", "ids")}


def views(catalogue: Catalogue, cache: Path, seed: int) -> Iterator[Measure]:
    """Views per second of processor time of one viewpoint of a flat, on one core."""
    with open_world(
        generate_house(seed, FLAT, catalogue), catalogue, cache, size=SKYBOX_SIDE, pictures="unlit"
    ) as world:
        panorama = world.renderer.panorama(world.graph.positions[0])
    with one_core(), tempfile.TemporaryDirectory() as folder:
        for height, width in VIEW_SIZES:
            size, name = (height, width), f"views of {width} x {height}"
            for shown, channels in SHOWN.items():
                again = functools.partial(_look, panorama, channels, size, itertools.cycle(range(HEADINGS)))
                yield _rate(f"{name}, {shown}", again)
                anew = functools.partial(_look, panorama, channels, size, itertools.count(0.01, 1.01))
                yield _rate(f"{name}, {shown}, new angles", anew)
        write_skybox(panorama, "here", skybox_folder(folder, "scan"))
        skyboxes = Skyboxes(folder, 1)
        for shown, depth in (("rgb", False), ("rgb and depth", True)):
            for height, width in VIEW_SIZES:
                again = functools.partial(_open, skyboxes, depth, (height, width))
                yield _rate(f"skyboxes of {SKYBOX_SIDE} in memory, {width} x {height}, {shown}", again)


def _rate(name: str, body: Callable[[], object]) -> Measure:
    return measure(name, body, "1/s", per=HEADINGS, clock=time.process_time)


def _look(panorama: Panorama, channels: tuple[str, ...], size: tuple[int, int], turns: Iterator[float]) -> None:
    """HEADINGS level views, so many `turns` of 30 degrees to the left."""
    for turn in itertools.islice(turns, HEADINGS):
        grid = perspective_grid(panorama.size, turn * math.pi / 6 % math.tau, 0.0, VFOV36, *size)
        for channel in channels:
            panorama.through(grid, channel)


def _open(skyboxes: Skyboxes, depth: bool, size: tuple[int, int]) -> None:
    """HEADINGS times a picture of a skybox."""
    for _ in range(HEADINGS):
        skyboxes.rgb("scan", "here", 0.0, 0.0, VFOV36, size)
        if depth:
            skyboxes.metres("scan", "here", 0.0, 0.0, VFOV36, size)
