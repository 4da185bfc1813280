"""HANNA: find an object with the help of people one meets (dissertation 4.2.2 and 4.2.5)."""

from __future__ import annotations

import functools

from embodied.interface import Place
from embodied.tasks.find import FindConfig, Pool, build_pool, find_task
from embodied.tasks.goals import find_instances, goal_classes

HANNA = FindConfig("hanna", reach=2.5, fewest_nodes=5, most_nodes=15, radius=2.0, horizon=50)
"""Limits of 4.2.5 and Table D.1; training takes 20 steps. An instance counts when a node of its room is within reach;
that node is its goal."""


def hanna_pool(world: Place, *, seed: int) -> Pool:
    classes = goal_classes(find_instances(world, HANNA.reach), by_room=False, nearest_only=True)
    return build_pool(world, classes, seed=seed, fewest=HANNA.fewest_nodes, most=HANNA.most_nodes, kind=HANNA.kind)


hanna_task = functools.partial(find_task, config=HANNA)
"""Task `index` of the pool, as find_task."""
