"""Benchmarks of light: processor time of one flat in several qualities, of further lightings of it, and of a house from
its seed to its lit panoramas."""

from __future__ import annotations

import functools
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from embodied.assets.catalogue import Catalogue
from embodied.bench.timing import Measure, from_values, measure
from embodied.generate import HouseConfig, generate_house
from embodied.house.house import House
from embodied.light.baking.house import bake_all, forget, lightings_of
from embodied.scene.house_meshes import house_parts
from embodied.world import open_world

FLAT = HouseConfig(area=(60.0, 70.0), hour=10.5, weather="clear")
"""The flat that is lit."""
HOUSE = HouseConfig(area=(97.0, 103.0), hour=10.5, weather="clear")
"""The house that is made from its seed on."""
QUALITIES = ("fast", "normal")
TIMED_BAKES = 3
LIGHTINGS = 3


def bakes(catalogue: Catalogue, cache: Path, seed: int) -> Iterator[Measure]:
    """Light a flat again and again, its furniture imported and unwrapped before."""
    house = generate_house(seed, FLAT, catalogue=catalogue)
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
    parts = [sum(b.manifest["seconds"].values()) for b in made]
    parts[0] += whole - sum(parts)  # what comes before the first
    parts[0] -= made[0].manifest["seconds"]["unwrap"]
    return parts
