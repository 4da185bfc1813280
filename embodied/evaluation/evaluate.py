"""Judging agents that do not learn on the splits of a data set: the rows of Table 4.3."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from embodied.envs.make import AS_PUBLISHED
from embodied.evaluation.rollout import play
from embodied.evaluation.tables import Row, row
from embodied.interface import Agent, Episode, SeenPlace, Task
from embodied.policies.baselines import (
    Forward10,
    HalfwaySkyline,
    PerfectInterpreter,
    PrivilegedAsking,
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
    from embodied.datasets.store import SplitData

PLAIN: Mapping[str, Callable[[], Agent]] = {"random walk": RandomWalk, "forward 10": Forward10, "shortest": Shortest}
AGENTS: Mapping[str, Mapping[str, Callable[[], Agent]]] = {
    "find": PLAIN,
    "vln": PLAIN,
    "hanna": {
        **PLAIN,
        "no ask": lambda: PrivilegedAsking(Shortest(), never_ask),
        "random ask": lambda: PrivilegedAsking(Shortest(), ask_at_random),
        "ask every 5": lambda: PrivilegedAsking(Shortest(), ask_every_5),
        "perfect interpretation": PerfectInterpreter,
    },
    "vnla": {
        "random walk": RandomWalk,
        "shortest": lambda: Shortest(VnlaTeacher()),
        "shortest, random": lambda: VnlaAsking(Shortest(VnlaTeacher()), "random"),
        "listener, none": lambda: VnlaAsking(SubgoalListener(), "none"),
        "listener, first": lambda: VnlaAsking(SubgoalListener(), "first"),
        "listener, random": lambda: VnlaAsking(SubgoalListener(), "random"),
        "listener, teacher": lambda: VnlaAsking(SubgoalListener(), "teacher"),
    },
    "hari": {"random walk": RandomWalk, "shortest": Shortest, "half-way sub-goals": HalfwaySkyline},
}
"""Agents without learning, by kind of task. In HANNA's 'no ask', 'random ask' and 'ask every 5' the
teacher navigates, so they show what asking by that rule costs."""
EXPERTS = {"hanna": "perfect interpretation", "vnla": "shortest, random", "hari": "half-way sub-goals"}
"""Who shows how a task is done, by its kind: they ask where help can be had; 'shortest' is that of the others."""
LOOKING: Mapping[str, Mapping[str, Callable[[Mapping[str, SeenPlace]], Agent]]] = {
    "vln": {"scripted listener": ScriptedListener},
    "hanna": {"scripted listener": ListeningInterpreter},
}
"""Agents that look around, by kind of task: made for worlds with sightings, not only houses and graphs."""


def agent_names(kind: str) -> list[str]:
    """All agents without learning of a kind of task."""
    return [*AGENTS[kind], *LOOKING.get(kind, {})]


def agent(kind: str, name: str, worlds: Mapping[str, SeenPlace] | None = None, rules: str = AS_PUBLISHED) -> Agent:
    """A fresh agent by name.

    Args:
      worlds: what agents that look around look at.
      rules: of VNLA; the shortest way is that of their teacher.

    Raises:
      ValueError: unknown for this kind of task, or one that looks and was given no worlds.

    Examples:
      >>> agent = embodied.baseline('hanna', 'shortest')
    """
    if (kind, name) == ("vnla", "shortest"):
        return Shortest(VnlaTeacher())
    if name in AGENTS[kind]:
        return AGENTS[kind][name]()
    if name not in LOOKING.get(kind, {}):
        raise ValueError(f"unknown agent {name!r} for {kind}; use one of {sorted(agent_names(kind))}")
    if worlds is None:
        raise ValueError(f"agent {name!r} looks around; give it the worlds that it plays in")
    return LOOKING[kind][name](worlds)


def spread(tasks: Sequence[Task], limit: int | None) -> list[Task]:
    """At most `limit` tasks, taken from all houses alike: every house's first, then every second one, ..."""
    by_house: dict[str, list[Task]] = {}
    for t in tasks:
        by_house.setdefault(t.world, []).append(t)
    longest = max(map(len, by_house.values()), default=0)
    order = [ts[i] for i in range(longest) for ts in by_house.values() if i < len(ts)]
    return order[:limit]


def evaluate(
    split: SplitData,
    agents: Mapping[str, Agent],
    *,
    seed: int = 0,
    limit: int | None = None,
    batch: int = 1,
    keep: Callable[[str, Sequence[Episode]], None] | None = None,
    watch: Callable[[Iterable[str]], Iterable[str]] = iter,
) -> list[Row]:
    """One row per agent, over the same tasks.

    Args:
      limit: at most so many tasks, from all houses alike.
      keep: is given each agent's name and episodes (to save them).
      watch: wraps the iterator over agent names (a progress bar).

    Examples:
      >>> rows = embodied.evaluate(split, {'shortest': agent}, limit=10)
    """
    tasks = spread(split.tasks, limit)
    graphs = {name: world.graph for name, world in split.worlds.items()}
    rows = []
    for name in watch(agents):
        episodes = play(split.make_env, agents[name], tasks, seed=seed, batch=batch, agent=name)
        rows.append(row(name, split.name, episodes, graphs, seed=seed))
        if keep:
            keep(name, episodes)
    return rows
