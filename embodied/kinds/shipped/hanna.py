"""HANNA: find an object with the help of people one meets (dissertation 4.2)."""

from __future__ import annotations

import numpy as np

from embodied.action_spaces import PanoramicMoves
from embodied.assistants.anna import Anna
from embodied.envs.hanna import HannaEnv
from embodied.interface import Ask, Episode, Mode, Move, Stop
from embodied.kinds.splits import five_splits
from embodied.kinds.task_kind import (
    PLAIN_AGENTS,
    EnvInputs,
    EnvMaker,
    Metric,
    Parts,
    PartTasks,
    StoryStyle,
    TaskInputs,
    TaskKind,
    parts_of_pool,
    register_kind,
)
from embodied.navigation.graph import NavGraph
from embodied.policies.baselines import (
    PerfectInterpreter,
    PrivilegedAsking,
    Shortest,
    ask_at_random,
    ask_every_5,
    never_ask,
)
from embodied.policies.listeners import ListeningInterpreter
from embodied.tasks.hanna import hanna_pool, hanna_task

TABLE_4_2 = {"train": 51, "val": 7, "test": 10}, five_splits(82_484, 5_001, 5_017, 5_004, 5_012)
"""Houses and splits of the dissertation's Table 4.2."""
NEAR_ENOUGH = 2.0
"""Metres from the target of a sub-task within which it succeeded."""


def tasks(inputs: TaskInputs, parts: Parts) -> PartTasks:
    pool = hanna_pool(inputs.world, seed=inputs.seed)
    return parts_of_pool(len(pool), lambda i: hanna_task(pool, i, seed=inputs.seed, language=inputs.language), parts)


def environments(inputs: EnvInputs) -> EnvMaker:
    worlds = inputs.worlds
    routes = {name: known for name in worlds if (known := inputs.routes(name))}
    anna = inputs.assistant or Anna({name: w.graph for name, w in worlds.items()}, routes, split=inputs.wording)
    moves = PanoramicMoves()
    return lambda: HannaEnv(worlds, anna, moves)


def subtask_success(episode: Episode, graph: NavGraph) -> float:
    """Share of sub-tasks that were left (departed, asked anew, or cut short) within 2 m of their target.

    NaN without any (docs/sources.md, S6).
    """
    outcomes = []
    for i, step in enumerate(episode.steps):
        if step.mode is not Mode.SUB:
            continue
        last = i + 1 == len(episode.steps)
        if isinstance(step.action, (Ask, Stop)) or last:
            node = step.next_pose.node if isinstance(step.action, Move) else step.pose.node
            outcomes.append(graph.distance[node, step.targets[0]] <= NEAR_ENOUGH + 1e-9)
    return float(np.mean(outcomes)) if outcomes else float("nan")


HANNA = register_kind(
    TaskKind(
        name="hanna",
        title="HANNA",
        tasks=tasks,
        environment=environments,
        help="words",
        baselines={
            **PLAIN_AGENTS,  # in the next three the teacher navigates: they show what asking by that rule costs
            "no ask": lambda: PrivilegedAsking(Shortest(), never_ask),
            "random ask": lambda: PrivilegedAsking(Shortest(), ask_at_random),
            "ask every 5": lambda: PrivilegedAsking(Shortest(), ask_every_5),
            "perfect interpretation": PerfectInterpreter,
        },
        looking={"scripted listener": ListeningInterpreter},
        expert="perfect interpretation",
        metrics={"subtask success": Metric(subtask_success, percent=True)},
        columns=("success", "strict success", "spl", "navigation error", "requests"),
        paper=TABLE_4_2,
        routes=True,
        people=True,
        story=StoryStyle(leaving="leaves the route and goes on by itself"),
    )
)
