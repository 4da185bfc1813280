"""Judging agents on the splits of a data set: a row of a table each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from embodied.evaluation.rollout import play
from embodied.evaluation.tables import Row, row
from embodied.interface import Agent, Episode, SeenPlace, Task
from embodied.kinds.task_kind import kind_named

if TYPE_CHECKING:
    from embodied.datasets.store import SplitData


def agent(kind: str, name: str, worlds: Mapping[str, SeenPlace] | None = None) -> Agent:
    """A fresh agent without learning, by name, of a kind of task; see TaskKind.agent.

    Raises:
      ValueError: unknown for this kind of task, or one that looks around and was given no worlds.

    Examples:
      >>> agent = embodied.baseline('hanna', 'shortest')
    """
    return kind_named(kind).agent(name, worlds)


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
