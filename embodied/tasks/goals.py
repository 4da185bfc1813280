"""Goal nodes, where an object can be found, per object class, room kind and house; and tasks of going there."""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from embodied.house.house import House, Placement
from embodied.interface import TURNS, VIEWS, FindObject, FollowRoute, Language, Place, Pose, SeenPlace, Task
from embodied.navigation.doors import closable_doors
from embodied.seeds import stream
from embodied.teachers.vnla import MonocularPlan

GOAT_REACH = 2.0
"""Metres within which a thing of a sequence counts as found, in its room."""
NOT_OBJECTS = frozenset({"person"})
"""Classes that are never looked for."""


@dataclass(frozen=True)
class Instance:
    """One findable object."""

    placement: str
    object_class: str
    room: str
    room_kind: str
    nodes: tuple[int, ...]
    """Nodes of its room within reach of it, nearest first, at least one."""


@dataclass(frozen=True)
class GoalClass:
    """All instances that satisfy one request."""

    object_class: str
    room_kind: str | None
    placements: tuple[str, ...]
    goal_nodes: tuple[int, ...]
    """Ascending, without repeats."""


def footprint_distance(placement: Placement, points: np.ndarray) -> np.ndarray:
    """(n,) horizontal distance in metres of points (n, 2+) to the placement's footprint; 0 above it."""
    offset = np.asarray(points)[:, :2] - np.asarray(placement.position[:2])
    c, s = math.cos(placement.yaw), math.sin(placement.yaw)
    own = np.stack([c * offset[:, 0] + s * offset[:, 1], -s * offset[:, 0] + c * offset[:, 1]], axis=1)
    outside = np.maximum(np.abs(own) - np.asarray(placement.size[:2]) / 2, 0.0)
    return np.hypot(outside[:, 0], outside[:, 1])


def find_instances(world: Place, reach: float) -> tuple[Instance, ...]:
    """Every object that somebody standing in the same room can be within `reach` metres of.

    The same room is required because a wall between node and object would make "found" a lie.
    The order is that of the house's placements.
    """
    house: House = world.house
    positions = np.asarray(world.graph.positions)
    nodes_of_room: dict[str, list[int]] = {}
    for node, room in enumerate(world.graph.room_of_node):
        nodes_of_room.setdefault(str(room), []).append(node)
    instances = []
    for p in house.placements:
        nodes = nodes_of_room.get(p.room)
        if not nodes or p.object_class in NOT_OBJECTS:
            continue
        distance = np.round(footprint_distance(p, positions[nodes]), 6)
        order = [nodes[i] for i in np.argsort(distance, kind="stable") if distance[i] <= reach]
        if order:
            kind = house.room_by_id[p.room].kind
            instances.append(Instance(p.id, p.object_class, p.room, kind, tuple(order)))
    return tuple(instances)


def goal_classes(instances: tuple[Instance, ...], *, by_room: bool, nearest_only: bool) -> tuple[GoalClass, ...]:
    """Requests that the house can satisfy, sorted by class and room kind.

    Args:
      by_room: one request per (class, room kind) rather than per class.
      nearest_only: the goal is each instance's nearest node rather than all nodes within reach.
    """
    groups: dict[tuple[str, str], list[Instance]] = {}
    for x in instances:
        groups.setdefault((x.object_class, x.room_kind if by_room else ""), []).append(x)
    classes = []
    for (name, kind), members in sorted(groups.items()):
        nodes = sorted({v for x in members for v in (x.nodes[:1] if nearest_only else x.nodes)})
        classes.append(GoalClass(name, kind or None, tuple(x.placement for x in members), tuple(nodes)))
    return tuple(classes)


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


def build_pool(world: Place, classes: tuple[GoalClass, ...], config: FindConfig, *, seed: int) -> Pool:
    """Pairs whose shortest path to the nearest goal (in metres) has as many nodes as it may have."""
    graph = world.graph
    hops = graph.hops + 1
    distance = np.asarray(graph.distance)
    pairs = []
    for c, goal in enumerate(classes):
        goals = np.array(goal.goal_nodes)
        nearest = goals[np.argmin(distance[:, goals], axis=1)]
        nodes = hops[np.arange(len(hops)), nearest]
        pairs += [(c, int(v)) for v in np.flatnonzero((nodes >= config.fewest_nodes) & (nodes <= config.most_nodes))]
    table = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    order = stream(seed, "pool", config.kind, world.house.name).permutation(len(table))
    return Pool(world.house.name, classes, table[order])


def find_pool(world: Place, *, seed: int, config: FindConfig = FindConfig()) -> Pool:
    classes = goal_classes(find_instances(world, config.reach), by_room=False, nearest_only=False)
    return build_pool(world, classes, config, seed=seed)


def find_task(pool: Pool, index: int, *, seed: int, language: Language, config: FindConfig = FindConfig()) -> Task:
    """Task `index` of the pool, with a random heading at the start: a pure function of its arguments.

    Raises:
      ValueError: the pool has no such task.
    """
    kind = config.kind
    if not 0 <= index < len(pool):
        raise ValueError(f"world {pool.world!r} has {len(pool)} {kind} tasks, asked for number {index}")
    c, node = (int(x) for x in pool.pairs[index])
    goal, rng = pool.classes[c], stream(seed, "task", kind, pool.world, index)
    start, what = Pose(node, int(rng.integers(TURNS))), FindObject(goal.object_class, goal.room_kind, goal.placements)
    name, words = f"{pool.world}/{kind}/{index}", language.request(what, rng=rng)
    return Task(name, kind, pool.world, start, what, goal.goal_nodes, words, config.radius, config.horizon)


def with_closed_doors(task: Task, place: Place, share: float, *, seed: int) -> Task:
    """The task, of any kind, with doors closed at its start.

    Args:
      share: probability of each door that can be closed, 0 to 1. One in whose way a viewpoint stands cannot.
      seed: the doors of a task depend on it and on the task's id; those of a smaller share are among those of a larger.
    """
    doors = closable_doors(place.house, place.graph)
    drawn = stream(seed, "closed doors", task.id).random(len(doors))
    return dataclasses.replace(task, closed=tuple(d for d, x in zip(doors, drawn, strict=True) if x < share))


def told_of_doors(task: Task, place: SeenPlace, language: Language[SeenPlace], *, seed: int) -> Task:
    """A task of following a route in new words, which say where to open a door that is closed at the start."""
    assert isinstance(task.goal, FollowRoute), "others say no way"
    rng = stream(seed, "words for closed doors", task.id)
    now = place.with_doors(dict.fromkeys(task.closed, 0.0))
    return dataclasses.replace(task, request=language.route(now, task.goal.path, task.start.yaw, rng=rng))


# VNLA: 'find a towel in a bathroom' with an advisor and a request budget (dissertation 4.1.2) ------

MOST_ACTIONS = 25
"""Of the teacher, the final stop included, and of an episode (docs/sources.md, S45)."""
VNLA = FindConfig("vnla", reach=2.5, fewest_nodes=3, most_nodes=MOST_ACTIONS, radius=2.0, horizon=MOST_ACTIONS)
"""Limits of the VNLA program; the dissertation does not print them."""


def help_budget(horizon: int) -> float:
    """Requests in an episode of `horizon` steps: 0.4 T / 4 (docs/sources.md, S46)."""
    return 0.4 * horizon / 4


def vnla_pool(world: Place, plan: MonocularPlan, *, seed: int, by_room: bool = True) -> Pool:
    """Pairs that the teacher finishes in time, whichever way the agent looks at first.

    Args:
      by_room: False gives the no-room variant: 'find a towel'.
    """
    classes = goal_classes(find_instances(world, VNLA.reach), by_room=by_room, nearest_only=True)
    pool = build_pool(world, classes, VNLA, seed=seed)
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
    task = find_task(pool, index, seed=seed, language=language, config=VNLA)
    horizon = plan.count(task.start, task.goal_nodes)
    return dataclasses.replace(task, horizon=horizon, budget=help_budget(horizon))


def room_kind(world: Place, node: int) -> str:
    """Kind of the room that a node is in."""
    return world.house.room_by_id[world.graph.room_of_node[node]].kind


def limit_key(world: Place, start: int, goal: FindObject) -> tuple[str, str]:
    """(start room kind, goal room kind), or the object class where no room is named."""
    return room_kind(world, start), goal.room_kind or goal.object_class
