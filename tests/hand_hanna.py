"""HANNA on the line and on the grid, with routes made by hand."""

from __future__ import annotations

from hand_worlds import grid_world, line_world

from embodied.assistants.anna import Anna
from embodied.assistants.route_system import build_routes
from embodied.interface import FindObject, Pose, Route, Task
from embodied.kinds.shipped.hanna import HannaEnv, hanna_pool, hanna_task
from embodied.language.plain_language import PlainLanguage

LINE_TASK = Task(
    "line/hanna/0", "hanna", "line", Pose(0), FindObject("mug", None, ("mug_1",)), (3,), "find a mug", 0.0, 20
)
LINE_ROUTES = (
    Route("short", (1, 2), 0, 0, "go one", "test"),
    Route("long", (1, 2, 3), 3, 1, "go two", "test"),
    Route("away", (3, 2, 1), 6, 0, "come back", "test"),
)


def line_env(routes=LINE_ROUTES) -> HannaEnv:
    world = line_world()
    return HannaEnv({"line": world}, Anna({"line": world.graph}, {"line": routes}, split="test"))


def grid_setup(n: int = 40, seed: int = 1):
    world = grid_world(8)
    routes = build_routes(world, seed=seed, language=PlainLanguage(), house_split="test")
    pool = hanna_pool(world, seed=seed)
    tasks = [hanna_task(pool, i, seed=seed, language=PlainLanguage()) for i in range(min(n, len(pool)))]

    def make() -> HannaEnv:
        return HannaEnv({"grid": world}, Anna({"grid": world.graph}, {"grid": routes}, split="test"))

    return world, routes, tasks, make
