"""Benchmarks of houses, pictures, light and play: the table of what the main line costs."""

from __future__ import annotations

import functools
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.assistants.route_system import build_routes
from embodied.bench.timing import Measure, from_values, measure
from embodied.datasets.build import DatasetConfig, make_dataset_house
from embodied.datasets.store import StoredPlace
from embodied.envs.base import HelpEnv
from embodied.generate import HouseConfig, generate_house
from embodied.house.house import House
from embodied.interface import Action, Ask, Intention, Move, Observation, Task
from embodied.kinds.task_kind import EnvInputs, TaskInputs, kind_named
from embodied.language.plain_language import PlainLanguage
from embodied.light.baking.house import bake_all, forget, lightings_of
from embodied.render.camera import Camera, face_cameras
from embodied.render.classic import Renderer
from embodied.scene.house_meshes import house_parts
from embodied.scene.model import compile_scene
from embodied.world import open_world

LARGE_HOUSE = HouseConfig(area=(400.0, 440.0), storeys=1)
"""A house of about 125 viewpoints; Matterport3D has 117 per building."""


def houses(catalogue: Catalogue, seed: int) -> Iterator[Measure]:
    """Layout and furnishing of a 125-node house."""
    seeds = iter(range(seed, seed + 10_000))
    make = lambda: generate_house(next(seeds), LARGE_HOUSE, catalogue)
    yield measure("layout and furnishing, 125-node house", make, "s", repeats=7)
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
        of_nodes = functools.partial(measure, per=len(nodes), repeats=3)
        faces = lambda: [[renderer.rgb(c, (256, 256)) for c in face_cameras(eyes[n])] for n in nodes]
        yield of_nodes(f"256 panorama, six faces of rgb, {kind}", faces)
        yield of_nodes(f"256 panorama with depth and ids, {kind}", lambda: [renderer.panorama(eyes[n]) for n in nodes])
        panorama = renderer.panorama(eyes[0])
        yield measure("36 views at 224 px from a panorama", lambda: panorama.views36(224), repeats=15)
    if kind != "unlit":
        with open_world(house, catalogue, cache, size=256, pictures="unlit") as plain:
            yield _face(plain.renderer, cameras, "unlit")


def _face(renderer: Renderer, cameras: Sequence[Camera], kind: str) -> Measure:
    name, draw = f"256x256 cube face, rgb, {kind}", lambda: [renderer.rgb(c, (256, 256)) for c in cameras]
    return measure(name, draw, per=len(cameras), repeats=5)


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
    parts = [b.manifest["processor_seconds"] for b in made]
    parts[0] += whole - sum(parts)  # what comes before the first
    parts[0] -= made[0].manifest["unwrap_seconds"]
    return parts


KINDS_PLAYED = ("find", "hanna")
"""HANNA's steps include the assistant's replies."""
TASKS_PLAYED = 60


def plays(catalogue: Catalogue, seed: int) -> Iterator[Measure]:
    """Environment steps per second of every kind of task, with caches warm, no pixels."""
    language = PlainLanguage()
    for kind in KINDS_PLAYED:
        known = kind_named(kind)
        house, graph = make_dataset_house(seed, "bench", HouseConfig(area=DatasetConfig(kind).area), catalogue)
        place = StoredPlace(house, graph)
        routes = build_routes(place, seed=seed, language=language, house_split="test") if known.routes else ()
        (tasks,) = known.tasks(TaskInputs(place, routes, seed, language), [(known.unseen_part, TASKS_PLAYED)]).values()
        env = known.environments(EnvInputs({"bench": place}, {"bench": routes}.__getitem__))()
        counts = walk(env, tasks)
        name = f"{kind} steps, {100 * counts[1] / counts[0]:.0f} % requests"
        yield measure(name, functools.partial(walk, env, tasks), "1/s", repeats=7, per=counts[0])


def walk(env: HelpEnv, tasks: list[Task]) -> tuple[int, int]:
    """Play tasks by a fixed rule that asks at every fifth step where it can; (steps, requests) taken."""
    steps = requests = 0
    for task in tasks:
        o: Observation | None = env.reset(task)
        while o is not None:
            help_wanted = o.can_ask and o.time % 5 == 4 and o.time_on_task
            choice = o.time % len(o.candidates)
            action: Action = Move(choice if o.candidates.allowed[choice] else 1)
            if help_wanted:
                action = Ask(o.can_ask[0] if o.can_ask[0] is Intention.HELP else o.can_ask[-1])
            requests += isinstance(action, Ask)
            o = env.step(action)
            steps += 1
    return steps, requests
