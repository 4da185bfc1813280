"""Judged as the authors' programs judge, where that differs from ours (docs/sources.md, S3, S5 and S6).

Everything else that they report, error, length, SPL, oracle success, is as in embodied.evaluation.metrics.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from embodied.datasets.matterport import REGIONS
from embodied.evaluation.metrics import navigation_error
from embodied.evaluation.tables import Estimate, Row, estimate
from embodied.interface import Ask, Episode, Mode, Place, Stop

if TYPE_CHECKING:
    from embodied.navigation.graph import NavGraph

RADIUS = 2.0
"""Of HANNA's sub-tasks, metres along the graph, inclusive."""
R2R_RADIUS = 3.0
"""Room-to-Room's, exclusive."""


def r2r_success(episode: Episode, graph: NavGraph) -> float:
    """1 if the episode ended strictly less than 3 m from its goal (Room-to-Room's evaluator)."""
    return float(navigation_error(episode, graph) < R2R_RADIUS)


def r2r_oracle_success(episode: Episode, graph: NavGraph) -> float:
    """1 if any visited node lies strictly less than 3 m from the goal (Room-to-Room's evaluator)."""
    goals = episode.task.goal_nodes
    return float(min(graph.distance[v, g] for v in episode.nodes for g in goals) < R2R_RADIUS)


def vnla_room_success(episode: Episode, place: Place) -> float:
    """1 if the last room has the region letter of the goals' room (VNLA's evaluator): another bathroom will do."""
    return float(_letter(place, episode.nodes[-1]) == _letter(place, episode.task.goal_nodes[0]))


def _letter(place: Place, node: int) -> str:
    return REGIONS.get(place.house.room_by_id[place.graph.room_of_node[node]].kind, "z")


def hanna_targets(episode: Episode, graph: NavGraph) -> tuple[int, int]:
    """Sub-tasks that were left within 2 m of their target, and all of them (HANNA's evaluator).

    A sub-task is left when the agent stops, asks again or is cut short. Where it asks again, the distance is that of
    the node it stands on after asking, which is the new route's first, to the target of the old one.
    """
    near = total = 0
    for i, step in enumerate(episode.steps):
        left = isinstance(step.action, (Ask, Stop))
        if step.mode is Mode.SUB and left:
            near, total = near + (graph.distance[step.next_pose.node, step.targets[0]] <= RADIUS + 1e-9), total + 1
        if i + 1 < len(episode.steps):
            continue
        target = _last_target(episode)
        if target is not None:
            near, total = near + (graph.distance[step.next_pose.node, target] <= RADIUS + 1e-9), total + 1
    return int(near), total


def _last_target(episode: Episode) -> int | None:
    """The target of the sub-task in which the episode was cut short; None where it was not."""
    last = episode.steps[-1]
    if isinstance(last.action, Ask):
        return last.reply.subtask.target if last.reply and last.reply.subtask else None
    return last.targets[0] if last.mode is Mode.SUB and not isinstance(last.action, Stop) else None


def row(agent: str, split: str, episodes: Sequence[Episode], places: Mapping[str, Place], *, seed: int) -> Row:
    """What the program of this kind of task reports differently, over the episodes of one agent.

    Raises:
      ValueError: no episodes, or a kind of task whose program judges as we do.
    """
    if not episodes:
        raise ValueError(f"{agent!r} played no episodes of {split!r}; a table needs at least one")
    kind, groups = episodes[0].task.kind, [e.task.world for e in episodes]
    graphs = {name: place.graph for name, place in places.items()}
    values: dict[str, Estimate]
    if kind == "hanna":
        near, left = zip(*[hanna_targets(e, graphs[e.task.world]) for e in episodes], strict=True)
        values = {"target success (HANNA)": estimate(near, groups, weights=left)}
    elif kind == "vnla":
        rooms = [vnla_room_success(e, places[e.task.world]) for e in episodes]
        values = {"room success (VNLA)": estimate(rooms, groups, share=True)}
    elif kind == "vln":
        judges = {"success (R2R)": r2r_success, "oracle success (R2R)": r2r_oracle_success}
        of = lambda f: [f(e, graphs[e.task.world]) for e in episodes]
        values = {n: estimate(of(f), groups, share=True) for n, f in judges.items()}
    else:
        raise ValueError(f"no published program judges {kind!r} tasks otherwise than we do; leave --as-programs out")
    return Row(agent, split, seed, len(episodes), len(set(groups)), values)
