"""The navigation teacher: the next node of the shortest path to the nearest target (4.2.3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from embodied.action_spaces import doors_in
from embodied.interface import Episode, Label, Move, Open, Place, Pose, Situation, Stop
from embodied.navigation.graph import behind_doors, nearest

if TYPE_CHECKING:
    from embodied.navigation.graph import NavGraph


def next_node(graph: NavGraph, node: int, targets: Sequence[int]) -> int:
    """The next node towards the nearest target; `node` itself when it is one."""
    target = nearest(graph, node, targets)
    return node if target == node else int(graph.next_hop[node, target])


def shortest_action(
    graph: NavGraph,
    pose: Pose,
    targets: Sequence[int],
    candidate_nodes: Sequence[int],
    closed: frozenset[str] = frozenset(),
) -> Move | Open | Stop:
    """The reference action in the panoramic action space, by ways that open doors; stop at a target."""
    node = next_node(behind_doors(graph, closed), pose.node, targets)
    if node == pose.node:
        return Stop()
    chosen = candidate_nodes.index(node)
    return Open(chosen) if graph.barred(pose.node, node, closed) else Move(chosen)


def shortest_of(s: Situation) -> Move | Open | Stop:
    """The shortest path's action in a situation."""
    return shortest_action(s.world.graph, s.pose, s.targets, s.candidate_nodes, s.closed)


class ShortestTeacher:
    """Labels every step with the reference action; has no opinion about asking.

    On a route the reference leads to the departure node by the shortest path, not along the
    route (docs/sources.md, S13).
    """

    def label(self, situation: Situation) -> Label:
        return Label(shortest_of(situation))

    def relabel(self, episode: Episode, world: Place) -> tuple[Label, ...]:
        graph, doors = world.graph, doors_in(episode, world.graph)
        return tuple(
            Label(shortest_action(graph, s.pose, s.targets, s.candidate_nodes, closed))
            for s, (closed, _) in zip(episode.steps, doors, strict=True)
        )
