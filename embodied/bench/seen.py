"""Benchmarks of what agents see: steps with pixels, live pictures, the body on wheels, and views of a panorama.

With OMP_NUM_THREADS=1 rates are of one core; threads that draw together take more processor time in all.
"""

from __future__ import annotations

import functools
import itertools
import math
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.bench.timing import Measure, measure, one_core
from embodied.envs.base import HelpEnv
from embodied.generate import HouseConfig, generate_house
from embodied.gym.driving import DriveSettings, Driving, expert_action
from embodied.gym.env import HelpGymEnv
from embodied.gym.sensors import CameraSensor, PanoramaStore, Sensor, ViewSettings
from embodied.gym.spaces import SpaceLayout
from embodied.interface import Task
from embodied.language.plain_language import PlainLanguage
from embodied.mattersim.pictures import Skyboxes, skybox_folder, write_skybox
from embodied.render.camera import Camera
from embodied.render.classic import Renderer
from embodied.render.panorama import VFOV36, Panorama, perspective_grid
from embodied.seeds import stream
from embodied.tasks.goals import find_pool, find_task
from embodied.world import World, open_world

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
