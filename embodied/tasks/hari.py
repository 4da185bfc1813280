"""HARI: reach the one place somebody had in mind (dissertation 4.3.5, appendix E)."""

from __future__ import annotations

import dataclasses
import functools

from embodied.interface import Place
from embodied.tasks.find import FindConfig, Pool, build_pool, find_task
from embodied.tasks.goals import GoalClass, find_instances

HARI = FindConfig("hari", reach=2.5, fewest_nodes=5, most_nodes=10, horizon=30)
"""Limits of 4.3.5 and Table E.2; success is to end exactly at the intended node."""
PRETRAINING = dataclasses.replace(HARI, fewest_nodes=1)
"""Of pre-training (appendix E)."""


def hari_pool(world: Place, *, seed: int, config: FindConfig = HARI) -> Pool:
    """One request per object instance: the node nearest to it is what the human has in mind."""
    classes = tuple(
        GoalClass(x.object_class, x.room_kind, (x.placement,), x.nodes[:1]) for x in find_instances(world, config.reach)
    )
    return build_pool(world, classes, seed=seed, fewest=config.fewest_nodes, most=config.most_nodes, kind="hari")


hari_task = functools.partial(find_task, config=HARI)
"""Task `index` of the pool, as find_task."""
