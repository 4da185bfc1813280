"""Judging agents that do not learn on the splits of a data set: the rows of Table 4.3."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from embodied.evaluation.rollout import play
from embodied.evaluation.tables import Row, row
from embodied.interface import Episode, Policy, Task
from embodied.policies.baselines import (
    Asking,
    Forward10,
    HalfwaySkyline,
    PerfectInterpreter,
    RandomWalk,
    Shortest,
    SubgoalListener,
    VnlaAsking,
    ask_at_random,
    ask_every_5,
    never_ask,
)
from embodied.policies.listeners import ListeningInterpreter, ScriptedListener
from embodied.teachers.vnla import VnlaTeacher

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset
    from embodied.world import World

PLAIN: Mapping[str, Callable[[], Policy]] = {"random walk": RandomWalk, "forward 10": Forward10, "shortest": Shortest}
LOOKING = ("scripted listener",)
"""Agents that need worlds with sightings, not only houses and graphs."""
AGENTS: Mapping[str, Mapping[str, Callable[[], Policy]]] = {
    "find": PLAIN,
    "vln": {**PLAIN, "scripted listener": ScriptedListener},
    "hanna": {
        **PLAIN,
        "no ask": lambda: Asking(Shortest(), never_ask),
        "random ask": lambda: Asking(Shortest(), ask_at_random),
        "ask every 5": lambda: Asking(Shortest(), ask_every_5),
        "perfect interpretation": PerfectInterpreter,
        "scripted listener": ListeningInterpreter,
    },
    "vnla": {
        "random walk": RandomWalk,
        "shortest": lambda: Shortest(VnlaTeacher()),
        **{
            f"listener, {ask}": lambda ask=ask: VnlaAsking(SubgoalListener(), ask)
            for ask in ("none", "first", "random", "teacher")
        },
    },
    "hari": {"random walk": RandomWalk, "shortest": Shortest, "half-way sub-goals": HalfwaySkyline},
}
"""Agents without learning, by kind of task. In HANNA's 'no ask', 'random ask' and 'ask every 5' the
teacher navigates, so they show what asking by that rule costs; who learns to navigate brings an own
policy to the same rules (embodied.policies.baselines.Asking)."""


def agent(kind: str, name: str) -> Policy:
    """A fresh agent by name.

    Raises:
      ValueError: unknown for this kind of task.
    """
    if name not in AGENTS[kind]:
        raise ValueError(f"unknown agent {name!r} for {kind}; use one of {sorted(AGENTS[kind])}")
    return AGENTS[kind][name]()


def spread(tasks: Sequence[Task], limit: int | None) -> list[Task]:
    """At most `limit` tasks, taken from all houses alike: every house's first, then every second one, ..."""
    by_house: dict[str, list[Task]] = {}
    for t in tasks:
        by_house.setdefault(t.world, []).append(t)
    longest = max(map(len, by_house.values()), default=0)
    order = [ts[i] for i in range(longest) for ts in by_house.values() if i < len(ts)]
    return order[:limit]


def evaluate(
    data: Dataset,
    split: str,
    agents: Mapping[str, Policy],
    *,
    seed: int = 0,
    limit: int | None = None,
    batch: int = 1,
    keep: Callable[[str, Sequence[Episode]], None] | None = None,
    watch: Callable[[Iterable[str]], Iterable[str]] = iter,
    worlds: Mapping[str, World] | None = None,
) -> list[Row]:
    """One row per agent, over the same tasks.

    Args:
      keep: is given each agent's name and episodes (to save them).
      watch: wraps the iterator over agent names (a progress bar).
      worlds: worlds with pictures by house name, for agents that look.
    """
    tasks = spread(data.tasks(split), limit)
    graphs = {name: data.place(name).graph for name in data.names(split)}
    make_env = data.environment(split, worlds=worlds)
    rows = []
    for name in watch(agents):
        episodes = play(make_env, agents[name], tasks, seed=seed, batch=batch, agent=name)
        rows.append(row(name, split, episodes, graphs, seed=seed))
        if keep:
            keep(name, episodes)
    return rows
