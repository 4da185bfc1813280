"""Benchmarks on a CUDA device: live pictures by OpenGL and by MuJoCo Warp, features, learning, light.

Where there is no CUDA device a few small pictures are drawn on the CPU, which tells that all parts work and no more.
"""

from __future__ import annotations

import functools
import itertools
import multiprocessing
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from embodied import gl
from embodied.assets.catalogue import Catalogue
from embodied.bench.bakes import QUALITIES
from embodied.bench.seen import FLAT
from embodied.bench.timing import Measure, from_values, measure
from embodied.errors import UnableError
from embodied.generate import HouseConfig, generate_house
from embodied.house.house import House
from embodied.light.backend import device
from embodied.light.baking.house import bake, forget
from embodied.render.camera import camera_at
from embodied.render.classic import Renderer
from embodied.seeds import stream
from embodied.world import World, open_world

CONTEXTS = (1, 4, 16)
"""Processes that draw pictures of LIVE pixels at once by OpenGL, each with a context of its own."""
LIVE = 128
PICTURE_SIDES, WORLDS = (64, 128, 256), (64, 256, 1024)
"""Sides of square pictures, pixels, and how many Warp draws at once."""
CHANNELS_DRAWN = (("rgb",), ("rgb", "depth", "ids"))
CPU_FLAT = HouseConfig(area=(34.0, 44.0))
"""The flat of the check on the CPU."""
DRAWING_SECONDS = 3.0
"""How long a process draws."""
TIMED_CALLS = 5

Works = Callable[[str], Mapping[str, tuple[Callable[[], object], int]]]
"""From a device of PyTorch to what learners do there: by name, one call, and how many things it does."""


def gpu(
    catalogue: Catalogue, cache: Path, seed: int, light: str, works: Works, *, progress: Callable[[str], None]
) -> Iterator[Measure]:
    """By the clock: pictures of one lit flat, what learners do, and light of the flat.

    Args:
      light: by name, 'fast' or 'normal'.

    Raises:
      UnableError: the extra 'warp' is missing, or a process cannot draw.
    """
    from embodied.render import warp  # late: an extra

    card = warp.card()
    if card is None:
        progress("There is no CUDA device here: a small check on the CPU, whose numbers say nothing about a GPU.")
    contexts, sizes, worlds = (CONTEXTS, PICTURE_SIDES, WORLDS) if card else (CONTEXTS[:1], PICTURE_SIDES[:1], (8,))
    house = generate_house(seed, FLAT if card else CPU_FLAT, catalogue)
    with open_world(house, catalogue, cache, pictures=f"{light}-matte") as world:
        assert world.lit is not None
        for count in contexts:
            yield from_values(
                f"classic, {gl.info().device}, {count} contexts, {LIVE} x {LIVE}, rgb",
                _by_processes(count, house, catalogue, cache, light, LIVE, seed),
                "1/s",
            )
        for size in sizes:
            with warp.WarpRenderer(house, catalogue, world.lit, worlds=max(worlds), size=(size, size)) as renderer:
                for count, sees in itertools.product(worlds, CHANNELS_DRAWN):
                    look = functools.partial(_look, renderer, _poses(world, count, seed), sees)
                    name = f"Warp, {card or 'CPU'}, {count} worlds, {size} x {size}, {', '.join(sees)}"
                    yield measure(name, look, "1/s", repeats=TIMED_CALLS, per=count)
        for name, (body, per) in works("cuda" if card else "cpu").items():
            yield measure(f"{name}, {card or 'CPU'}", body, "1/s", repeats=TIMED_CALLS, per=per)
        for quality in QUALITIES if card else ():
            name = f"light of a flat of {house.area:.0f} m², {quality}, {card if device() == 'cuda' else device()}"
            yield measure(name, functools.partial(_light, house, catalogue, cache, quality), "s", repeats=3)


def _poses(world: World, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) positions of nodes and (n,) yaws, drawn at random."""
    rng = stream(seed, "bench", "gpu")
    nodes = rng.integers(len(world.graph.positions), size=count)
    return world.graph.positions[nodes], rng.uniform(-np.pi, np.pi, count)


def _light(house: House, catalogue: Catalogue, cache: Path, quality: str) -> None:
    """Light the house anew; the first call compiles, and unwraps what no cache has."""
    forget(cache, house, catalogue, quality)
    bake(house, catalogue, cache, quality)


def _look(renderer: Any, poses: tuple[np.ndarray, np.ndarray], sees: tuple[str, ...]) -> None:
    renderer.views(*poses, sees=sees)
    renderer.wait()


def _by_processes(
    count: int, house: House, catalogue: Catalogue, cache: Path, light: str, size: int, seed: int
) -> list[float]:
    """Frames per second of `count` processes together, which draw at the same time."""
    spawn = multiprocessing.get_context("spawn")
    begin, results = spawn.Barrier(count), spawn.SimpleQueue()
    jobs = [
        spawn.Process(target=_film, args=(begin, results, house, catalogue, cache, light, size, seed))
        for _ in range(count)
    ]
    for job in jobs:
        job.start()
    for job in jobs:
        job.join()
    if failed := [job.exitcode for job in jobs if job.exitcode]:
        raise UnableError(f"{len(failed)} of {count} drawing processes failed; try fewer contexts, see above why")
    return [sum(results.get() for _ in jobs)]


def _film(
    begin: Any, results: Any, house: House, catalogue: Catalogue, cache: Path, light: str, size: int, seed: int
) -> None:
    """Draw for DRAWING_SECONDS, together with the other processes; tells the frames per second."""
    try:
        with (
            open_world(house, catalogue, cache, pictures=f"{light}-matte") as world,
            Renderer(house, catalogue, lit=world.lit, size=size) as renderer,
        ):
            cameras = [camera_at(at, yaw) for at, yaw in zip(*_poses(world, 64, seed), strict=True)]
            for camera in cameras:
                renderer.rgb(camera, (size, size))
            begin.wait()
            start, frames = time.perf_counter(), 0
            while time.perf_counter() < start + DRAWING_SECONDS:
                renderer.rgb(cameras[frames % len(cameras)], (size, size))
                frames += 1
            results.put(frames / (time.perf_counter() - start))
    except BaseException:
        begin.abort()
        raise
