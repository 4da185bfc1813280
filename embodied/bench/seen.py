"""Benchmarks of environments with pixels: steps per second on one core, and the naive way beside them."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from assets.catalogue import Catalogue
from embodied.bench.timing import Measure, measure, one_core, ratio
from embodied.envs.base import HelpEnv
from embodied.generate import HouseConfig, generate_house
from embodied.gym.env import HelpGymEnv
from embodied.gym.eyes import CameraSensor, PanoramaStore, Sensor, ViewSettings
from embodied.gym.spaces import SpaceLayout
from embodied.interface import Task
from embodied.language.plain import PlainLanguage
from embodied.seeds import stream
from embodied.tasks.find import find_pool, find_task
from embodied.world import World, open_world

FLAT = HouseConfig(area=(70.0, 110.0))
"""Where the agent walks."""
STEPS = 200
"""Of one timed call."""
LINES = (
    ("rgb, 128 x 128", ("rgb",), ViewSettings(), 4000.0),
    ("rgb, depth and ids, 128 x 128", ("rgb", "depth", "ids"), ViewSettings(), 2000.0),
    ("rgb, the 36 views at 128 x 128", ("rgb",), ViewSettings("views36"), 60.0),
)
"""What is seen, and how many steps per second the project promises with it."""


def seen(catalogue: Catalogue, cache: Path, seed: int, kind: str) -> Iterator[Measure]:
    """Random walks through one flat whose panoramas are in memory."""
    house = generate_house(seed, FLAT, catalogue)
    with one_core(), open_world(house, catalogue, cache, pictures=kind) as world:
        yield from _measures(world, seed)


def _measures(world: World, seed: int) -> Iterator[Measure]:
    world.render_all()
    store, pool = PanoramaStore({world.name: world}), find_pool(world, seed=seed)
    tasks = [find_task(pool, i, seed=seed, language=PlainLanguage()) for i in range(50)]
    for name, channels, view, aim in LINES:
        env = _env(world, tasks, CameraSensor(store, channels, view))
        steps = 40 if view.frame == "views36" else STEPS
        walk = functools.partial(_walk, env, steps, seed)
        yield measure(f"steps, {name}", walk, "1/s", per=steps, aim=aim)
    plain = _env(world, tasks, CameraSensor(store, ("rgb",), ViewSettings()))
    resampled = measure("steps, rgb, 128 x 128, again", lambda: _walk(plain, STEPS, seed), "1/s", per=STEPS)
    naive = measure("the naive way: a picture drawn per step", lambda: _walk(plain, 40, seed, world), "1/s", per=40)
    yield naive
    yield ratio("resampled against drawn", resampled, naive)


def _env(world: World, tasks: list[Task], sensor: Sensor) -> HelpGymEnv:
    return HelpGymEnv(lambda: HelpEnv({world.name: world}), tasks, sensor, layout=SpaceLayout())


def _walk(env: HelpGymEnv, steps: int, seed: int, drawn: World | None = None) -> None:
    """Random moves, a new task when one ends; never stops of its own. `drawn`: a world that draws every view."""
    rng = stream(seed, "bench", "walk")
    o, _ = env.reset(seed=seed)
    for _ in range(steps):
        possible = np.flatnonzero(o["action_mask"][: SpaceLayout().candidates])
        o, _, terminated, truncated, _ = env.step(int(rng.choice(possible)))
        if drawn is not None:
            at, pose = drawn.graph.positions[env.pose.node], env.pose
            drawn.renderer.view(at, pose.yaw, pose.pitch, ViewSettings().vfov, (128, 128))
        if terminated or truncated:
            o, _ = env.reset()
