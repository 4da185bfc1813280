"""VNLA: 'find a towel in a bathroom' with an advisor and a request budget (dissertation 4.1.2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from embodied.interface import TURNS, VIEWS, FindObject, Language, Place, Task
from embodied.tasks.goals import GoalClass, Pool, build_pool, draw, find_instances, goal_classes, task_of_pair
from embodied.teachers.vnla import MonocularPlan

FEWEST_NODES = 3
MOST_ACTIONS = 25
"""Of the teacher, the final stop included, and of an episode (docs/sources.md, S45)."""
VNLA_RADIUS, VNLA_REACH = 2.0, 2.5
"""Metres from a goal node to succeed, and from a thing to its goal node. Limits of the VNLA program; the dissertation
does not print them."""


def help_budget(horizon: int) -> float:
    """Requests in an episode of `horizon` steps: 0.4 T / 4 (docs/sources.md, S46)."""
    return 0.4 * horizon / 4


def vnla_pool(world: Place, plan: MonocularPlan, *, seed: int, by_room: bool = True) -> Pool:
    """Pairs that the teacher finishes in time, whichever way the agent looks at first.

    Args:
      by_room: False gives the no-room variant: 'find a towel'.
    """
    classes = goal_classes(find_instances(world, VNLA_REACH), by_room=by_room, nearest_only=True)
    pool = build_pool(world, classes, seed=seed, fewest=FEWEST_NODES, most=MOST_ACTIONS, kind="vnla")
    return Pool(pool.world, classes, np.array([p for p in pool.pairs if _in_time(p, classes, plan)]).reshape(-1, 2))


def _in_time(pair: np.ndarray, classes: tuple[GoalClass, ...], plan: MonocularPlan) -> bool:
    level = int(pair[1]) * VIEWS + TURNS
    counts = plan.counts(classes[int(pair[0])].goal_nodes)[level : level + TURNS]
    return counts.min() > 0 and counts.max() <= MOST_ACTIONS


def time_limits(lengths: Sequence[tuple[str, str, int]], cap: int) -> dict[tuple[str, str], int]:
    """Evaluation limits T from training: mean + 1.95 s.e.m. of teacher lengths per key, capped (docs/sources.md, S45).

    Args:
      lengths: (start room kind, end room kind or object class, teacher actions) of training tasks.
        A pair with a single sample gets the cap, as an unseen pair does.
    """
    groups: dict[tuple[str, str], list[int]] = {}
    for start, end, n in lengths:
        groups.setdefault((start, end), []).append(n)
    return {
        key: cap if len(v) < 2 else round(min(cap, float(np.mean(v) + 1.95 * np.std(v, ddof=1) / math.sqrt(len(v)))))
        for key, v in sorted(groups.items())
    }


def vnla_task(pool: Pool, index: int, world: Place, plan: MonocularPlan, *, seed: int, language: Language) -> Task:
    """Task `index` of the pool: a pure function of its arguments.

    Its time limit is the teacher's own length, as in training; in evaluation, `Dataset` raises it to what `time_limits`
    learned for its rooms.

    Raises:
      ValueError: the pool has no such task.
    """
    goal, start, _ = draw(pool, index, seed=seed, kind="vnla")
    horizon = plan.count(start, goal.goal_nodes)
    how: dict[str, Any] = {"radius": VNLA_RADIUS, "horizon": horizon, "budget": help_budget(horizon)}
    return task_of_pair("vnla", pool, index, seed=seed, language=language, **how)


def room_kind(world: Place, node: int) -> str:
    """Kind of the room that a node is in."""
    return world.house.room_by_id[world.graph.room_of_node[node]].kind


def limit_key(world: Place, start: int, goal: FindObject) -> tuple[str, str]:
    """(start room kind, goal room kind), or the object class where no room is named."""
    return room_kind(world, start), goal.room_kind or goal.object_class
