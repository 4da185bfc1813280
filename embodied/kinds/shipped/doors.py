"""Doors: find a thing of a class in a house in which doors are closed (docs/doors.md)."""

import functools

from embodied.action_spaces import doors_in
from embodied.interface import Close, Episode, Task
from embodied.kinds import task_kind
from embodied.kinds.metrics import success
from embodied.navigation.graph import NavGraph, behind_doors
from embodied.policies.doors import NeverOpens, Wanderer
from embodied.tasks.goals import FindConfig, find_pool, find_task, with_closed_doors

SHARE = 0.5
"""Share of the doors that are closed at the start."""
CONFIG = FindConfig(kind="doors", horizon=60)


def tasks(inputs: task_kind.TaskInputs, parts: task_kind.Parts) -> task_kind.PartTasks:
    pool = find_pool(inputs.world, seed=inputs.seed, config=CONFIG)

    def task(i: int) -> Task:
        plain = find_task(pool, i, seed=inputs.seed, language=inputs.language, config=CONFIG)
        return with_closed_doors(plain, inputs.world, SHARE, seed=inputs.seed)

    return task_kind.parts_of_pool(len(pool), task, parts)


def opened(episode: Episode, graph: NavGraph) -> float:
    """Doors that the agent opened, how ever."""
    moved = zip(doors_in(episode, graph), episode.steps)
    return float(sum(len(doors) for (_, doors), s in moved if not isinstance(s.action, Close)))


def needed(episode: Episode, graph: NavGraph) -> float:
    """1 if no goal can be reached without opening a door."""
    closed = graph.closed.union(episode.task.closed)
    ways = behind_doors(graph, closed, float("inf")).distance[episode.task.start.node]
    return float(all(ways[g] == float("inf") for g in episode.task.goal_nodes))


def success_behind(episode: Episode, graph: NavGraph) -> float:
    """Success where a door had to be opened, else 0."""
    return success(episode, graph) * needed(episode, graph)


DOORS_KIND = task_kind.register_kind(
    task_kind.TaskKind(
        name="doors",
        title="Doors",
        tasks=tasks,
        baselines={**task_kind.PLAIN_AGENTS, "never opens": NeverOpens, "wanderer, blind": lambda: Wanderer(None)},
        looking={"wanderer": Wanderer, "wanderer, never opens": functools.partial(Wanderer, opens=False)},
        needs_stop=True,
        metrics={
            "success behind doors": task_kind.Metric(success_behind, percent=True, per=needed),
            "doors opened": task_kind.Metric(opened),
        },
        columns=("success", "success behind doors", "spl", "navigation error", "doors opened", "steps"),
        opens_doors=True,
        story=task_kind.StoryStyle(dialogue=False),
    )
)
