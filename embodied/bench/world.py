"""House, scene and panorama benchmarks: the table of what the main line costs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.bench.timing import Measure, measure
from embodied.generate import HouseConfig, generate_house
from embodied.render.camera import Camera, face_cameras
from embodied.render.classic import Renderer
from embodied.scene.model import compile_scene
from embodied.world import open_world

LARGE_HOUSE = HouseConfig(area=(400.0, 440.0))
"""A house of about 125 viewpoints; Matterport3D has 117 per building."""


def houses(catalogue: Catalogue, seed: int) -> Iterator[Measure]:
    """Layout and furnishing of a 125-node house."""
    seeds = iter(range(seed, seed + 10_000))
    yield measure(
        "layout and furnishing, 125-node house",
        lambda: generate_house(next(seeds), LARGE_HOUSE, catalogue),
        "s",
        repeats=7,
    )
    house = generate_house(seed, LARGE_HOUSE, catalogue)
    yield measure("to a ready MjModel, assets cached", lambda: compile_scene(house, catalogue), "s", repeats=5)


def pictures(catalogue: Catalogue, cache: Path, seed: int, kind: str) -> Iterator[Measure]:
    """Cube faces, panoramas and resampled views."""
    house = generate_house(seed, LARGE_HOUSE, catalogue)
    with open_world(house, catalogue, cache, size=256, pictures=kind) as world:
        renderer, eyes = world.renderer, world.graph.positions
        nodes = np.linspace(0, len(eyes) - 1, 12).astype(int)
        cameras = [c for n in nodes for c in face_cameras(eyes[n])]
        yield _face(renderer, cameras, kind)
        yield measure(
            f"256 panorama, six faces of rgb, {kind}",
            lambda: [[renderer.rgb(c, (256, 256)) for c in face_cameras(eyes[n])] for n in nodes],
            per=len(nodes),
            repeats=3,
        )
        yield measure(
            f"256 panorama with depth and ids, {kind}",
            lambda: [renderer.panorama(eyes[n]) for n in nodes],
            per=len(nodes),
            repeats=3,
        )
        panorama = renderer.panorama(eyes[0])
        yield measure("36 views at 224 px from a panorama", lambda: panorama.views36(224), repeats=15)
    if kind != "unlit":
        with open_world(house, catalogue, cache, size=256, pictures="unlit") as plain:
            yield _face(plain.renderer, cameras, "unlit")


def _face(renderer: Renderer, cameras: Sequence[Camera], kind: str) -> Measure:
    name, draw = f"256x256 cube face, rgb, {kind}", lambda: [renderer.rgb(c, (256, 256)) for c in cameras]
    return measure(name, draw, per=len(cameras), repeats=5)
