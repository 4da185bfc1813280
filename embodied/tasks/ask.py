"""Ask-v0: find one described object among its like, where the description may fit several of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from embodied.house.house import Placement
from embodied.interface import TURNS, FindDescribed, Place, Pose, Task
from embodied.seeds import stream
from embodied.tasks.goals import Instance, find_instances, footprint_distance

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue

Look = Callable[[Placement], tuple[str, ...]]
"""The words of colour and material of a placement."""
UNSEEN = 0.25
"""Share of the object classes that are kept for the split of unseen classes."""
AMBIGUOUS = 0.6
"""Share of the tasks whose request fits several objects."""
REACH = 2.0
"""A goal node lies within this many metres of the object, in its room, and nearer to it than to its like."""
FEWEST_NODES, MOST_NODES, HORIZON = 4, 18, 60
"""Nodes on the shortest path to the nearest goal node, and steps of an episode."""


@dataclass(frozen=True)
class AskPool:
    """(goal, start) pairs of a house, ambiguous and clear ones apart, each in a seeded order."""

    world: str
    goals: tuple[tuple[FindDescribed, tuple[int, ...]], ...]
    """Goals and their goal nodes."""
    ambiguous: np.ndarray
    clear: np.ndarray
    """(m, 2) int64 each: index into `goals`, start node."""


def look_of(catalogue: Catalogue | None) -> Look:
    """The first word of colour and of material that a catalogue has for a thing; none without a catalogue."""
    assets = {} if catalogue is None else catalogue.assets

    def look(p: Placement) -> tuple[str, ...]:
        asset = assets.get(p.asset)
        return () if asset is None else (*asset.colours[:1], *asset.materials[:1])

    return look


def is_unseen(object_class: str) -> bool:
    """True for a class that is kept from training; it depends on its name alone."""
    return float(stream(0, "ask class", object_class).random()) < UNSEEN


def ask_pool(world: Place, look: Look, *, seed: int, unseen: bool | None = None) -> AskPool:
    """All tasks of a house.

    Args:
      unseen: only classes that are kept from training, or only the others; all if None.
    """
    by_class: dict[str, list[Instance]] = {}
    for x in find_instances(world, REACH):
        if unseen is None or is_unseen(x.object_class) == unseen:
            by_class.setdefault(x.object_class, []).append(x)
    instances = [(x, alike) for _, alike in sorted(by_class.items()) if len(alike) > 1 for x in alike]
    goals, kinds = [], []
    for x, alike in instances:
        if nodes := _own_nodes(world, x, alike):
            for goal in _descriptions(world, x, alike, look):
                goals.append((goal, nodes))
                kinds.append(len(goal.fitting) > 1)
    hops, distance = world.graph.hops + 1, np.asarray(world.graph.distance)
    pairs: tuple[list[tuple[int, int]], list[tuple[int, int]]] = ([], [])
    for g, (_, goal_nodes) in enumerate(goals):
        ends = np.array(goal_nodes)
        count = hops[np.arange(len(hops)), ends[np.argmin(distance[:, ends], axis=1)]]
        fits = (count >= FEWEST_NODES) & (count <= MOST_NODES)
        pairs[kinds[g]].extend((g, int(v)) for v in np.flatnonzero(fits))
    classes = [goal.object_class for goal, _ in goals]
    clear, ambiguous = (
        _in_turn(p, classes, rng=stream(seed, "pool", "ask", world.house.name, k)) for k, p in enumerate(pairs)
    )
    return AskPool(world.house.name, tuple(goals), ambiguous, clear)


def ask_tasks(pool: AskPool, count: int, *, seed: int) -> list[Task]:
    """The first `count` tasks of a house, of which the stated share is ambiguous; fewer where the house has fewer."""
    tasks = []
    for j in range(count):
        before, after = math.floor(j * AMBIGUOUS + 1e-9), math.floor((j + 1) * AMBIGUOUS + 1e-9)
        pairs, k = (pool.ambiguous, before) if after > before else (pool.clear, j - before)
        if k >= len(pairs):
            break
        goal, goal_nodes = pool.goals[int(pairs[k, 0])]
        turn = int(stream(seed, "task", "ask", pool.world, j).integers(TURNS))
        name, start = f"{pool.world}/ask/{j}", Pose(int(pairs[k, 1]), turn)
        tasks.append(Task(name, "ask", pool.world, start, goal, goal_nodes, request(goal), radius=0.0, horizon=HORIZON))
    return tasks


def ask_split(
    houses: Mapping[str, Place], look: Look, per_house: int, *, seed: int, unseen: bool | None = None
) -> list[Task]:
    """So many tasks of every house.

    Args:
      unseen: only classes that are kept from training, or only the others.
    """
    tasks: list[Task] = []
    for place in houses.values():
        tasks += ask_tasks(ask_pool(place, look, seed=seed, unseen=unseen), per_house, seed=seed)
    return tasks


def request(goal: FindDescribed) -> str:
    """'find the brown wood chair in the kitchen'."""
    where = f" in the {goal.room_kind.replace('_', ' ')}" if goal.room_kind else ""
    return f"find the {' '.join([*goal.words, goal.object_class])}{where}"


def _in_turn(pairs: list[tuple[int, int]], classes: list[str], *, rng: np.random.Generator) -> np.ndarray:
    """(m, 2) int64: shuffled pairs, one of every class before a second of any."""
    seen: dict[str, int] = {}
    ranked: list[tuple[int, int, tuple[int, int]]] = []
    for i in rng.permutation(len(pairs)):
        name = classes[pairs[i][0]]
        seen[name] = seen.get(name, 0) + 1
        ranked.append((seen[name], len(ranked), pairs[i]))
    return np.array([pair for _, _, pair in sorted(ranked)], dtype=np.int64).reshape(-1, 2)


def _own_nodes(world: Place, x: Instance, alike: list[Instance]) -> tuple[int, ...]:
    """The nodes within reach of an object at which none of its like in the room is as near; ascending."""
    at = np.asarray(world.graph.positions)[list(x.nodes)]
    of = world.house.placement_by_id
    distance = footprint_distance(of[x.placement], at)
    others = [footprint_distance(of[o.placement], at) for o in alike if o is not x and o.room == x.room]
    nearest = np.min(others, axis=0) if others else np.full(len(at), np.inf)
    return tuple(sorted(v for v, d, e in zip(x.nodes, distance, nearest) if d < e - 1e-6))


def _descriptions(world: Place, x: Instance, alike: list[Instance], look: Look) -> list[FindDescribed]:
    """Every way to describe an object by its class, some of its words, and its kind of room."""
    of = world.house.placement_by_id
    words_of_it, descriptions = look(of[x.placement]), {}
    looks = {o.placement: look(of[o.placement]) for o in alike}
    for n in range(len(words_of_it) + 1):
        for words in itertools.combinations(words_of_it, n):
            for kind in (None, x.room_kind):
                there = [o.placement for o in alike if kind in (None, o.room_kind)]
                fits = [name for name in there if all(w in looks[name] for w in words)]
                others = tuple(o.placement for o in alike if o.placement not in fits)
                descriptions[words, kind] = FindDescribed(x.object_class, x.placement, tuple(fits), others, words, kind)
    return list(descriptions.values())
