"""HANNA: find an object with the help of people one meets (dissertation 4.2.2 and 4.2.5)."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.interface import Language, Place, Task
from embodied.tasks.find import Pool, TaskLimits, build_pool, task_of_pair
from embodied.tasks.goals import find_instances, goal_classes


@dataclass(frozen=True)
class HannaConfig:
    """Limits of 4.2.5 and Table D.1."""

    fewest_nodes: int = 5
    most_nodes: int = 15
    """Nodes on the shortest path to the nearest goal."""
    radius: float = 2.0
    """epsilon_success, metres."""
    horizon: int = 50
    """Evaluation steps; training uses 20."""
    reach: float = 2.5
    """An instance counts when a node of its room is within this many metres; that node is its goal."""


def hanna_pool(world: Place, *, seed: int, config: HannaConfig = HannaConfig()) -> Pool:
    classes = goal_classes(find_instances(world, config.reach), by_room=False, nearest_only=True)
    return build_pool(world, classes, seed=seed, fewest=config.fewest_nodes, most=config.most_nodes, kind="hanna")


def hanna_task(pool: Pool, index: int, *, seed: int, language: Language, config: HannaConfig = HannaConfig()) -> Task:
    """Task `index` of the pool: a pure function of its arguments.

    Raises:
      ValueError: the pool has no such task.
    """
    limits = TaskLimits(config.radius, config.horizon)
    return task_of_pair("hanna", pool, index, seed=seed, language=language, limits=limits)
