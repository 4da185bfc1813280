"""HARI: reach the one place somebody had in mind (dissertation 4.3.5, appendix E)."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.interface import Language, Place, Task
from embodied.tasks.find import Pool, TaskLimits, build_pool, task_of_pair
from embodied.tasks.goals import GoalClass, find_instances


@dataclass(frozen=True)
class HariConfig:
    """Limits of 4.3.5 and Table E.2."""

    fewest_nodes: int = 5
    most_nodes: int = 10
    """Nodes on the shortest path; 1 to 10 for pre-training (appendix E)."""
    horizon: int = 30
    reach: float = 2.5


def hari_pool(world: Place, *, seed: int, config: HariConfig = HariConfig()) -> Pool:
    """One request per object instance: the node nearest to it is what the human has in mind."""
    classes = tuple(
        GoalClass(x.object_class, x.room_kind, (x.placement,), x.nodes[:1]) for x in find_instances(world, config.reach)
    )
    return build_pool(world, classes, seed=seed, fewest=config.fewest_nodes, most=config.most_nodes, kind="hari")


def hari_task(pool: Pool, index: int, *, seed: int, language: Language, config: HariConfig = HariConfig()) -> Task:
    """Task `index` of the pool; success is to end exactly at the intended node.

    Raises:
      ValueError: the pool has no such task.
    """
    limits = TaskLimits(radius=0.0, horizon=config.horizon)
    return task_of_pair("hari", pool, index, seed=seed, language=language, limits=limits)
