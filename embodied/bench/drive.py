"""Benchmarks of the body on wheels: physics and live pictures, per second of processor time, and the share of each."""

from __future__ import annotations

import functools
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from assets.catalogue import Catalogue
from embodied.bench.seen import FLAT
from embodied.bench.timing import Measure, from_values, measure
from embodied.generate import generate_house
from embodied.gym.driving import DriveSettings, Driving, guided
from embodied.seeds import stream
from embodied.world import open_world

STEPS = 60
"""Of one timed call; a command is held for a tenth of a second."""
LINES = (
    ("physics alone", (), None),
    ("rgb, 128 x 128", ("rgb",), 120.0),
    ("rgb and depth, 128 x 128", ("rgb", "depth"), None),
)
"""What is seen, and how many commands per second the project promises with it."""


def drive(catalogue: Catalogue, cache: Path, seed: int, quality: str, look: str) -> Iterator[Measure]:
    """Guided drives through one flat; whoever draws with the CPU has all of that counted."""
    with open_world(generate_house(seed, FLAT, catalogue), catalogue, cache, quality=quality, look=look) as world:
        seconds = {}
        for name, sees, aim in LINES:
            driving = Driving({world.name: world}, DriveSettings(sees=sees))
            commands = recorded(driving, seed)
            body = functools.partial(replay, driving, commands, seed)
            rate = measure(f"drive, {name}", body, "1/s", per=STEPS, aim=aim, clock=time.process_time)
            seconds[sees] = 1.0 / rate.value
            yield rate
        share = seconds[()] / seconds["rgb",]
        yield from_values("drive, share of physics in rgb", [share], "x")


def recorded(driving: Driving, seed: int) -> list[tuple[int, np.ndarray]]:
    """Episode and command of STEPS steps of whoever knows the way, so that none of its thinking is timed."""
    found: list[tuple[int, np.ndarray]] = []
    episode = 0
    while len(found) < STEPS:
        driving.reset(stream(seed, "bench", "drive", episode))
        while driving.ended is None and len(found) < STEPS:
            found.append((episode, guided(driving)))
            driving.step(found[-1][1])
        episode += 1
    return found


def replay(driving: Driving, commands: list[tuple[int, np.ndarray]], seed: int) -> None:
    """The same drives again, looking after every command."""
    begun = -1
    for episode, command in commands:
        if episode != begun:
            driving.reset(stream(seed, "bench", "drive", episode))
            begun = episode
        driving.step(command)
        driving.look()
