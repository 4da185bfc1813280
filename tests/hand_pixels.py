"""Two rooms with three viewpoints, quickly drawn, and environments that see them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from conftest import two_rooms
from handmade import HandCatalogue, furnished

from embodied.envs.base import HelpEnv
from embodied.gym.env import HelpGymEnv
from embodied.gym.sensors import CameraSensor, PanoramaStore, ViewSettings
from embodied.interface import FindObject, Pose, Task
from embodied.navigation.graph import graph_of
from embodied.world import World, open_world

NODES = np.array([[2.5, 2.6, 1.5], [4.6, 1.05, 1.5], [6.5, 1.05, 1.5]])
ROOMS = ("living_room_1", "living_room_1", "bedroom_1")


def world_in(cache: Path) -> World:
    graph = graph_of(NODES, np.array([[0, 1], [1, 2]]), ("a", "b", "c"), ROOMS)
    return open_world(furnished(two_rooms()), HandCatalogue(), cache, graph=graph, size=48)


def tasks_in(world) -> list[Task]:
    what = FindObject("mug", "living_room", ("mug_1",))
    where = [(0, 0), (1, 4), (2, 7), (0, 11)]
    return [
        Task(f"{world.name}/find/{k}", "find", world.name, Pose(v, turn), what, (2 - v,), f"find a mug {k}", 0.0, 9)
        for k, (v, turn) in enumerate(where)
    ]


def pixels(cache: Path) -> HelpGymEnv:
    """An environment that sees the panoramas of the two rooms; draws those that are not in the cache."""
    world = world_in(cache)
    sensor = CameraSensor(PanoramaStore({world.name: world}), ("rgb", "depth"), ViewSettings(height=16, width=16))
    return HelpGymEnv(lambda: HelpEnv({world.name: world}), tasks_in(world), sensor, opened=[world])


def coloured_strips(name: str, n: int, *, seed: int):
    """HouseStrips of a world of red cells, each a 'rose', and green ones, a 'fern'; half a view or more is of one
    colour."""
    from embodied.agents.vision.features import HouseStrips  # late: processes that only see need no torch

    rng = np.random.default_rng(seed)
    what = rng.integers(0, 2, (n, 1, 4)).repeat(12, 1).repeat(9, 2)
    rgb = np.zeros((n, 12, 36, 3), np.uint8)
    rgb[..., 0], rgb[..., 1] = 200 * (what == 0) + 30, 200 * (what == 1) + 30
    share = (np.eye(2)[what] * 255).astype(np.uint8)
    depth = rng.normal(size=(n, 12, 36)).astype(np.float16)
    rooms, room = np.zeros((n, 12, 36), np.int8), np.zeros(n, np.int8)
    return HouseStrips(name, ("rose", "fern"), rgb.repeat(16, 1).repeat(16, 2), share, rooms, depth, room)
