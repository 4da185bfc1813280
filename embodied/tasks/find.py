"""'Find a mug': go near any instance of an object class; also the pool of tasks that others share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from embodied.interface import TURNS, FindObject, Language, Place, Pose, Task
from embodied.seeds import stream
from embodied.tasks.goals import GoalClass, find_instances, goal_classes


@dataclass(frozen=True)
class FindConfig:
    """Limits of tasks of finding something."""

    kind: str = "find"
    """Names the shuffle of the pool."""
    reach: float = 2.0
    """A goal node lies within this many metres of the object and in its room."""
    fewest_nodes: int = 4
    """Nodes on the shortest path to the nearest goal, start and goal included."""
    most_nodes: int = 15
    radius: float = 0.0
    """Metres from a goal node within which the task is fulfilled."""
    horizon: int = 40


@dataclass(frozen=True)
class Pool:
    """All (request, start) pairs of a world that a rule allows, in the order of a seeded shuffle.

    Task j is pair j: no two tasks of a house are alike, every one is feasible, and task j is the
    same however many are drawn.
    """

    world: str
    classes: tuple[GoalClass, ...]
    pairs: np.ndarray
    """(m, 2) int64: index into `classes`, start node."""

    def __len__(self) -> int:
        return len(self.pairs)


def build_pool(world: Place, classes: tuple[GoalClass, ...], *, seed: int, fewest: int, most: int, kind: str) -> Pool:
    """Pairs whose shortest path to the nearest goal (in metres) has `fewest`..`most` nodes."""
    graph = world.graph
    hops = graph.hops + 1
    distance = np.asarray(graph.distance)
    pairs = []
    for c, goal in enumerate(classes):
        goals = np.array(goal.goal_nodes)
        nearest = goals[np.argmin(distance[:, goals], axis=1)]
        nodes = hops[np.arange(len(hops)), nearest]
        pairs += [(c, int(v)) for v in np.flatnonzero((nodes >= fewest) & (nodes <= most))]
    table = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    order = stream(seed, "pool", kind, world.house.name).permutation(len(table))
    return Pool(world.house.name, classes, table[order])


def find_pool(world: Place, *, seed: int, config: FindConfig = FindConfig()) -> Pool:
    classes = goal_classes(find_instances(world, config.reach), by_room=False, nearest_only=False)
    return build_pool(world, classes, seed=seed, fewest=config.fewest_nodes, most=config.most_nodes, kind=config.kind)


def find_task(pool: Pool, index: int, *, seed: int, language: Language, config: FindConfig = FindConfig()) -> Task:
    """Task `index` of the pool: a pure function of its arguments.

    Raises:
      ValueError: the pool has no such task.
    """
    c = config
    return task_of_pair(c.kind, pool, index, seed=seed, language=language, radius=c.radius, horizon=c.horizon)


def task_of_pair(
    kind: str,
    pool: Pool,
    index: int,
    *,
    seed: int,
    language: Language,
    radius: float,
    horizon: int,
    budget: float | None = None,
) -> Task:
    """Pair `index` of the pool as a task of a kind, in words.

    Raises:
      ValueError: the pool has no such pair.
    """
    goal, start, rng = draw(pool, index, seed=seed, kind=kind)
    what = FindObject(goal.object_class, goal.room_kind, goal.placements)
    return Task(
        id=f"{pool.world}/{kind}/{index}",
        kind=kind,
        world=pool.world,
        start=start,
        goal=what,
        goal_nodes=goal.goal_nodes,
        request=language.request(what, rng=rng),
        radius=radius,
        horizon=horizon,
        budget=budget,
    )


def draw(pool: Pool, index: int, *, seed: int, kind: str) -> tuple[GoalClass, Pose, np.random.Generator]:
    """Pair `index` of the pool with a random heading, and the generator for the rest of its words.

    Raises:
      ValueError: the pool has no such pair.
    """
    if not 0 <= index < len(pool):
        raise ValueError(f"world {pool.world!r} has {len(pool)} {kind} tasks, asked for number {index}")
    c, node = (int(x) for x in pool.pairs[index])
    rng = stream(seed, "task", kind, pool.world, index)
    return pool.classes[c], Pose(node, int(rng.integers(TURNS))), rng
