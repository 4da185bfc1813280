"""Benchmarks of environments with pixels: steps per second on one core, and the naive way beside them."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.bench.timing import Measure, measure, one_core, share
from embodied.envs.base import HelpEnv
from embodied.generate import HouseConfig, generate_house
from embodied.gym.env import HelpGymEnv, make
from embodied.gym.eyes import CameraSensor, PanoramaStore, Sensor, ViewSettings
from embodied.gym.in_step import make_vec
from embodied.gym.playground import Asked, flat_playground
from embodied.gym.spaces import SpaceLayout
from embodied.interface import Task
from embodied.language.plain_language import PlainLanguage
from embodied.render.panorama_file import PanoramaFile
from embodied.render.pictures import parse_pictures
from embodied.seeds import stream
from embodied.tasks.find import find_pool, find_task
from embodied.world import World, open_world

FLAT = HouseConfig(area=(70.0, 110.0))
"""The flat that the agent walks in."""
STEPS = 200
"""Of one timed call."""
ROUND = 20
"""Of one timed call of a batch."""
ROUNDS = 40
"""Untimed calls before, in which every process decodes the panoramas that it meets."""
READ = 20
"""Viewpoints that one timed call reads from the disk."""
BATCH = 64
"""Environments of the vectorised line."""
LINES = (
    ("rgb, 128 x 128", ("rgb",), ViewSettings(), 4000.0),
    ("rgb, depth and ids, 128 x 128", ("rgb", "depth", "ids"), ViewSettings(), 2000.0),
    ("rgb, the 36 views at 128 x 128", ("rgb",), ViewSettings("views36"), 60.0),
)
"""Channels that are seen, and how many steps per second the project promises with it."""


def seen(catalogue: Catalogue, cache: Path, seed: int, kind: str) -> Iterator[Measure]:
    """Random walks through one flat whose panoramas are in memory: on one core, and a batch that looks on all."""
    with one_core():
        house = generate_house(seed, FLAT, catalogue)
        with open_world(house, catalogue, cache, pictures=kind) as world:
            yield from _measures(world, seed)
        yield from _batches(seed, cache, kind)


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
    yield from _from_disk(world)
    resampled = measure("steps, rgb, 128 x 128, again", lambda: _walk(plain, STEPS, seed), "1/s", per=STEPS)
    draw = functools.partial(_draw, plain, world)
    naive = measure("the naive way: a picture drawn per step", lambda: _walk(plain, 40, seed, draw), "1/s", per=40)
    yield naive
    yield share("resampled against drawn", resampled, naive, "x")


def _from_disk(world: World) -> Iterator[Measure]:
    """Views of viewpoints that are not in memory."""
    view, nodes = ViewSettings(), range(min(READ, len(world.graph.ids)))
    with PanoramaFile(world.path) as file:
        look = lambda: [file.read(n).view_rgb(0.0, 0.0, view.vfov, (view.height, view.width)) for n in nodes]
        yield measure("views of viewpoints on the disk, rgb, 128 x 128", look, "1/s", per=len(nodes))


def _batches(seed: int, cache: Path, kind: str) -> Iterator[Measure]:
    """One environment against batches of them, all in the flat that `make` generates from `seed`."""
    drawn = parse_pictures(kind)
    asked: dict[str, Any] = {"seed": seed, "cache": cache, "sees": "rgb", "pictures": drawn}
    for world in flat_playground("find", seed, Asked(cache, pictures=drawn, sees=("rgb",))).worlds.values():
        assert isinstance(world, World), "generated, so it can be drawn"
        with world:
            world.render_all()
    walk = _alone(make("find", **asked))
    alone = measure("steps of one environment, rgb, 128 x 128", walk, "1/s", per=STEPS, warm=ROUNDS)
    yield alone
    envs = make_vec("find", BATCH, **asked)
    name = f"steps of {BATCH} environments in one process"
    together = measure(name, _together(envs), "1/s", per=ROUND * BATCH, warm=ROUNDS)
    envs.close()
    yield together
    yield share(f"{name} against one", together, alone, "x")


def _alone(env: HelpGymEnv) -> Callable[[], None]:
    """Goes STEPS steps on at each call: the first move there is, again and again."""
    seen = env.reset(seed=0)[0]

    def walk() -> None:
        nonlocal seen
        for _ in range(STEPS):
            seen, _, terminated, truncated, _ = env.step(int(seen["action_mask"].argmax()))
            if terminated or truncated:
                seen, _ = env.reset()

    return walk


def _together(envs: Any) -> Callable[[], None]:
    """The same in every slot, ROUND steps on."""
    seen = envs.reset(seed=0)[0]

    def walk() -> None:
        nonlocal seen
        for _ in range(ROUND):
            seen, *_ = envs.step(seen["action_mask"].argmax(1))

    return walk


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
