"""VLN: follow a route instruction to its end (Room-to-Room)."""

import math
from collections.abc import Callable

from embodied.interface import Episode, FollowRoute, Pose, Route, Task
from embodied.kinds.metrics import ndtw, sdtw, without_repeats
from embodied.kinds.splits import Splits, five_splits
from embodied.kinds.task_kind import Measure, Metric, Parts, PartTasks, TaskInputs, TaskKind, register_kind
from embodied.navigation.graph import NavGraph
from embodied.policies.listeners import ScriptedListener

WORDING_OF = {"main": ("train_seen", "val", "test"), "val": ("train_unseen",), "test": ("train_unseen",)}
"""Splits of the wordings whose routes are the tasks of a part."""
ROOM_TO_ROOM = Splits({"train": 61, "val": 11, "test": 18}, five_splits(14_025, 1_020, 2_349, 1_020, 4_173))
"""The dissertation does not tabulate VLN: Anderson et al. 2018, section 4.4 (61 scenes with 14,025 training and 1,020
seen validation instructions, 11 scenes with 2,349, 18 scenes with 4,173; the files that were published later hold
14,039 and 1,021). Room-to-Room has no seen test split; ours has one of the size of its seen validation split."""


VLN_RADIUS = 3.0
"""Metres from the intended end, inclusive (3.2.4.2); Room-to-Room itself says strictly less."""
VLN_HORIZON = 20


def vln_task(world: str, route: Route) -> Task:
    """The task of following `route` of the house `world`."""
    name, start, end = f"{world}/vln/{route.id}", Pose(route.path[0], route.turn, route.tilt), route.path[-1:]
    goal = FollowRoute(route.id, route.path)
    return Task(name, "vln", world, start, goal, end, route.instruction, VLN_RADIUS, VLN_HORIZON)


def tasks(inputs: TaskInputs, parts: Parts) -> PartTasks:
    return {part: [vln_task(inputs.world.house.name, r) for r in routes_of(inputs, part)[:n]] for part, n in parts}


def routes_of(inputs: TaskInputs, part: str) -> list[Route]:
    """Held-out wordings serve the seen splits: every other path validation, the rest test."""
    paths = {p: k for k, p in enumerate(dict.fromkeys(r.path for r in inputs.routes))}
    return [
        r
        for r in inputs.routes
        if r.split in WORDING_OF[part] and (part == "main" or paths[r.path] % 2 == (part == "test"))
    ]


def on_route(measure: Callable[..., float]) -> Measure:
    """nDTW or SDTW of a walk against the route that was described; NaN for other tasks."""

    def judged(episode: Episode, graph: NavGraph) -> float:
        goal = episode.task.goal
        return measure(without_repeats(episode.nodes), goal.path, graph) if isinstance(goal, FollowRoute) else math.nan

    return judged


VLN = register_kind(
    TaskKind(
        name="vln",
        title="VLN",
        tasks=tasks,
        looking={"scripted listener": ScriptedListener},
        metrics={"nDTW": Metric(on_route(ndtw)), "SDTW": Metric(on_route(sdtw))},
        columns=("success", "strict success", "spl", "navigation error", "nDTW", "SDTW"),
        paper=ROOM_TO_ROOM,
        routes=True,
        from_routes=True,
    )
)
