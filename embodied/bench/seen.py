"""Benchmarks of environments with pixels: steps per second on one core, and the naive way beside them."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.bench.timing import Measure, measure, one_core
from embodied.envs.base import HelpEnv
from embodied.generate import HouseConfig, generate_house
from embodied.gym.env import HelpGymEnv
from embodied.gym.sensors import CameraSensor, PanoramaStore, Sensor, ViewSettings
from embodied.gym.spaces import SpaceLayout
from embodied.interface import Task
from embodied.language.plain_language import PlainLanguage
from embodied.seeds import stream
from embodied.tasks.find import find_pool, find_task
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
