"""Benchmarks of live pictures and of the body on wheels that sees them, per second of processor time.

With OMP_NUM_THREADS=1 they are of one core; threads that draw together take more processor time in all.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.bench.seen import FLAT
from embodied.bench.timing import Measure, measure, one_core
from embodied.generate import generate_house
from embodied.gym.driving import DriveSettings, Driving, expert_action
from embodied.render.camera import Camera
from embodied.render.classic import Renderer
from embodied.seeds import stream
from embodied.world import open_world

STEPS = 60
"""Of one timed call; a command is held for a tenth of a second."""
LIVE_SIZES = ((128, 128), (480, 640))
"""Height and width of live pictures."""


def drive(catalogue: Catalogue, cache: Path, seed: int, pictures: str) -> Iterator[Measure]:
    """Guided drives through one flat; whoever draws with the CPU has all of that counted."""
    with one_core(), open_world(generate_house(seed, FLAT, catalogue), catalogue, cache, pictures=pictures) as world:
        driving = Driving({world.name: world}, DriveSettings(observations=()))
        commands, cameras = recorded(driving, seed)
        rate = functools.partial(measure, unit="1/s", per=STEPS, clock=time.process_time)
        for size in LIVE_SIZES:
            name = f"frames of {size[1]} x {size[0]}"
            yield rate(f"{name}, rgb", functools.partial(_film, world.renderer, cameras, size, False))
            yield rate(f"{name}, rgb, depth and ids", functools.partial(_film, world.renderer, cameras, size, True))
        driving = Driving({world.name: world}, DriveSettings(observations=("rgb",)))
        yield rate("drive, rgb, 128 x 128", functools.partial(replay, driving, commands, seed))


def recorded(driving: Driving, seed: int) -> tuple[list[tuple[int, np.ndarray]], list[Camera]]:
    """Episode and command of STEPS steps of whoever knows the way, and where its eye was then."""
    commands: list[tuple[int, np.ndarray]] = []
    cameras = []
    episode = 0
    while len(commands) < STEPS:
        driving.reset(stream(seed, "bench", "drive", episode))
        while driving.ended is None and len(commands) < STEPS:
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
