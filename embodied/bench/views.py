"""Benchmarks of views of a panorama."""

from __future__ import annotations

import functools
import itertools
import math
import time
from collections.abc import Iterator
from pathlib import Path

from assets.catalogue import Catalogue
from embodied.bench.seen import FLAT
from embodied.bench.timing import Measure, measure, one_core
from embodied.generate import generate_house
from embodied.render.panorama import VFOV36, Panorama, perspective_grid
from embodied.world import open_world

SIZE = 512
"""Side of a face, pixels."""
VIEWS = 12
"""Headings of one timed call."""
AIMS = (((480, 640), 1200.0, 700.0), ((224, 224), 5000.0, 3000.0))
"""Height and width, and how many views per second are promised: of rgb; of rgb, depth and ids."""


def views(catalogue: Catalogue, cache: Path, seed: int) -> Iterator[Measure]:
    """Views per second of processor time of one viewpoint of a flat, on one core."""
    with open_world(generate_house(seed, FLAT, catalogue), catalogue, cache, size=SIZE, pictures="unlit") as world:
        panorama = world.renderer.panorama(world.graph.positions[0])
    with one_core():
        for size, colours, everything in AIMS:
            name = f"views of {size[1]} x {size[0]}"
            for shown, channels, aim in (
                ("rgb", ("rgb",), colours),
                ("rgb, depth and ids", ("rgb", "depth", "ids"), everything),
            ):
                look = functools.partial(_look, panorama, channels, size, itertools.cycle(range(VIEWS)))
                yield measure(f"{name}, {shown}", look, "1/s", per=VIEWS, aim=aim, clock=time.process_time)


def _look(panorama: Panorama, channels: tuple[str, ...], size: tuple[int, int], turns: Iterator[float]) -> None:
    """VIEWS level views, so many `turns` of 30 degrees to the left."""
    for turn in itertools.islice(turns, VIEWS):
        grid = perspective_grid(panorama.size, turn * math.pi / 6 % math.tau, 0.0, VFOV36, *size)
        for channel in channels:
            panorama.through(grid, channel)
