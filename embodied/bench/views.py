"""Benchmarks of views of a panorama: angles seen before and new ones."""

from __future__ import annotations

import functools
import itertools
import math
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from embodied.assets.catalogue import Catalogue
from embodied.bench.seen import FLAT
from embodied.bench.timing import Measure, measure, one_core
from embodied.generate import generate_house
from embodied.mattersim.pictures import Skyboxes, skybox_folder
from embodied.mattersim.skyboxes import write_skybox
from embodied.render.panorama import VFOV36, Panorama, perspective_grid
from embodied.world import open_world

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
