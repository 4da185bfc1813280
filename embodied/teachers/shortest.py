"""Teachers of the shortest path to the nearest target (4.2.3): of navigation, and HANNA's of navigation and asking."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from embodied.action_spaces import PanoramicMoves, doors_in
from embodied.interface import VIEWS, Ask, Candidates, Episode, Label, Move, Open, Place, Pose, Situation, Step, Stop
from embodied.navigation.graph import OPENING, behind_doors, nearest

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
    opening: float = OPENING,
) -> Move | Open | Stop:
    """The reference action in the panoramic action space, by ways that open doors; stop at a target, or where no way
    leads to one.

    Args:
      opening: metres that opening a door counts as; infinite for who opens none.
    """
    ways, here = behind_doors(graph, closed, opening), pose.node
    target = nearest(ways, here, targets) if targets else here
    if target == here or not np.isfinite(ways.distance[here, target]):
        return Stop()
    node = int(ways.next_hop[here, target])
    chosen = candidate_nodes.index(node)
    return Open(chosen) if graph.barred(here, node, closed) else Move(chosen)


def shortest_of(s: Situation, targets: Sequence[int] | None = None, opening: float = OPENING) -> Move | Open | Stop:
    """The shortest path's action in a situation, towards its targets or others; `opening` as in `shortest_action`."""
    targets = s.targets if targets is None else targets
    return shortest_action(s.world.graph, s.pose, targets, s.candidate_nodes, s.closed, opening)


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


GAMMA = 0.25
"""Uncertainty threshold (Table D.1)."""


def lost_as_programmed(distances: Sequence[float]) -> list[bool]:
    """Steps of a segment strictly after the earliest step of closest approach (docs/sources.md, S19).

    Args:
      distances: to the target at each state of a segment, metres.
    """
    closest = int(np.argmin(np.round(distances, 9)))
    return [t > closest for t in range(len(distances))]


def base37_entropy(probabilities: np.ndarray, candidates: Candidates) -> float:
    """Entropy in base 37 of a navigation distribution spread over the 36 views and stop (4.2.3).

    Args:
      probabilities: (n + 1,) over the candidates and, last, stop. Candidates that share a view add up.
    """
    slots = np.zeros(VIEWS + 1)
    np.add.at(slots, candidates.view, probabilities[:-1])
    slots[-1] = probabilities[-1]
    some = slots[slots > 0]
    return float(-(some * np.log(some)).sum() / np.log(VIEWS + 1))


class HannaTeacher(ShortestTeacher):
    """Labels finished episodes: reference actions, help requests with their reasons, mistakes (4.2.3, Eq 4.12).

    The rule for being lost is the authors' program's, because the text's would teach an agent to ask for help when it
    has arrived. `uncertain_wrong` follows the text: at steps where the
    agent asked, the program has no reference action and calls every prediction wrong (docs/sources.md, S20).
    """

    def __init__(self) -> None:
        self._moves = PanoramicMoves()

    def relabel(self, episode: Episode, world: Place) -> tuple[Label, ...]:
        graph, steps = world.graph, episode.steps
        lost = [x for segment in segments(steps) for x in _lost_in(segment, graph)]
        asked_at: set[int] = set()
        mistakes: dict[tuple[int, str], dict[int, None]] = {}
        labels = []
        for step, is_lost in zip(steps, lost, strict=True):
            here = step.pose.node
            reference = shortest_action(graph, step.pose, step.targets, step.candidate_nodes)
            never_asked = here not in asked_at  # condition 3
            unsure = self._uncertain_wrong(step, reference, world)  # condition 2
            ask = ((is_lost or unsure) and never_asked) if step.can_ask else None
            reasons = (is_lost, unsure, never_asked) if step.can_ask else None
            if isinstance(step.action, Ask):
                asked_at.add(here)
                labels.append(Label(None, ask, reasons))
                continue
            key = (here, step.instruction)  # v_t = v_t', l_t = l_t' in Eq 4.12
            past = mistakes.setdefault(key, {})
            again = (Stop() if v == step.pose.node else Move(step.candidate_nodes.index(v)) for v in past)
            labels.append(Label(reference, ask, reasons, tuple(again)))
            if step.action != reference:
                past[_chosen(step)] = None
        return tuple(labels)

    def _uncertain_wrong(self, step: Step, reference: Move | Open | Stop, world: Place) -> bool:
        thought = step.action.thought
        if thought is None or thought.moves is None:
            return False
        candidates, _ = self._moves.at(world, step.pose)
        best = int(np.argmax(thought.moves))
        wanted = len(candidates) if isinstance(reference, Stop) else reference.candidate
        return best != wanted and base37_entropy(np.asarray(thought.moves, dtype=float), candidates) >= GAMMA


def segments(steps: Sequence[Step]) -> list[list[Step]]:
    """The steps cut after every request, departure or stop: stretches with one target."""
    pieces: list[list[Step]] = [[]]
    for step in steps:
        pieces[-1].append(step)
        if not isinstance(step.action, Move):
            pieces.append([])
    return [p for p in pieces if p]


def _lost_in(segment: Sequence[Step], graph: NavGraph) -> list[bool]:
    nodes = [s.pose.node for s in segment]
    if isinstance(segment[-1].action, Move):  # cut short: where it ended counts too
        nodes.append(segment[-1].next_pose.node)
    targets = segment[0].targets
    distances = [float(graph.distance[v, nearest(graph, v, targets)]) for v in nodes]
    return lost_as_programmed(distances)[: len(segment)]


def _chosen(step: Step) -> int:
    """The node that a navigation action chose; its own for stop."""
    return step.candidate_nodes[step.action.candidate] if isinstance(step.action, Move) else step.pose.node
