"""Judges: each quantity is defined once, over finished episodes, with the source of its formula.

Distances are metres along the graph. A function of one episode takes the episode and the graph of
its world; tables over many episodes are in embodied.evaluation.tables.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from embodied.action_spaces import doors_in
from embodied.interface import Ask, Episode, FindDescribed, Intention, Move, SuccessRule, Trajectory, Usage
from embodied.kinds.task_kind import Measure, kind_named
from embodied.navigation.graph import OPENING, behind_doors

if TYPE_CHECKING:
    from embodied.navigation.graph import NavGraph


def trajectory_of(episode: Episode, graph: NavGraph) -> Trajectory:
    """An episode on a graph as it is judged.

    Its way is as long as the graph's distances between consecutive nodes (docs/sources.md, S4), and OPENING longer for
    each door or part of furniture that is opened or closed (docs/sources.md, S185). The shortest way is what the kind
    of task says, or that from the start to the goal nearest the *final* node, with the doors that it opens.
    """
    task, kind, nodes, goals = episode.task, kind_named(episode.task.kind), [*episode.nodes], [*episode.task.goal_nodes]
    metres, steps = np.asarray(graph.distance), np.asarray(graph.distance)[nodes[:-1], nodes[1:]]
    goal = min(goals, key=lambda g: (metres[nodes[-1], g], g))
    closed = graph.closed.union(task.closed)
    if closed or any(s.moved for s in episode.steps):
        steps = steps + [OPENING * len(moved) for _, moved in doors_in(episode, graph)]
    shortest = behind_doors(graph, closed).distance[nodes[0], goal]
    return Trajectory(
        rule=SuccessRule(task.radius, needs_stop=kind.needs_stop),
        distances=metres[np.ix_(nodes, goals)].min(axis=1),
        lengths=np.concatenate([[0.0], np.cumsum(steps)]),
        shortest=float(kind.shortest(episode, graph) if kind.shortest else shortest),
        stopped=episode.ended == "stop",
        achieved=kind.success and kind.success(episode, graph),
    )


def success(episode: Episode, graph: NavGraph) -> float:
    """1 if the episode ended within the radius of a goal, or did what its kind of task calls a success; else 0."""
    return trajectory_of(episode, graph).success


def spl(episode: Episode, graph: NavGraph) -> float:
    """Success weighted by path length, one term of (4.17)."""
    return trajectory_of(episode, graph).spl


def navigation_error(episode: Episode, graph: NavGraph) -> float:
    """Distance from the last node to the nearest goal (4.2.5)."""
    return float(trajectory_of(episode, graph).distances[-1])


def oracle_success(episode: Episode, graph: NavGraph) -> float:
    """1 if any visited node lies within the radius of a goal."""
    return trajectory_of(episode, graph).oracle_success


def path_length(episode: Episode, graph: NavGraph) -> float:
    """Metres walked."""
    return float(trajectory_of(episode, graph).lengths[-1])


def strict_success(episode: Episode, graph: NavGraph) -> float:
    """Success of an episode whose agent said that it is done; running out of steps near a goal is none."""
    return success(episode, graph) if episode.ended == "stop" else 0.0


def requests(episode: Episode, graph: NavGraph) -> float:
    """Requests for help in the episode."""
    return float(episode.requests)


def steps(episode: Episode, graph: NavGraph) -> float:
    return float(len(episode.steps))


def mistake_repeats(episode: Episode, graph: NavGraph) -> tuple[int, int]:
    """Steps that repeat a past mistake, and all steps (Table 4.6 'nav. mistake repeat').

    A mistake is a navigation action that the teacher would not take; it repeats when the same
    wrong next node was chosen before at this node, with this instruction and these targets.
    """
    wrong = list[tuple[object, ...]]()
    for step in episode.steps:
        if isinstance(step.action, Ask):
            continue
        here = step.pose.node
        target = min(step.targets, key=lambda g: (graph.distance[here, g], g))
        reference = here if here == target else int(graph.next_hop[here, target])
        chosen = step.candidate_nodes[step.action.candidate] if isinstance(step.action, Move) else here
        if chosen != reference:
            wrong.append((here, step.instruction, tuple(sorted(step.targets)), chosen))
    return len(wrong) - len({*wrong}), len(episode.steps)


def request_repeats(episode: Episode, graph: NavGraph) -> tuple[int, int]:
    """Requests made before at the same node, instruction and targets, and all requests (Table 4.6)."""
    made = [(s.pose.node, s.instruction, frozenset(s.targets)) for s in episode.steps if isinstance(s.action, Ask)]
    return len(made) - len({*made}), len(made)


@dataclass(frozen=True)
class AskCounts:
    """Numbers of one episode, whose sums over episodes make the measures below."""

    questions: int
    needed: int
    """Questions that were needed; each clears one blocker."""
    left: int
    """1 if a blocker is left at the end."""


def ask_counts(episode: Episode, graph: NavGraph) -> AskCounts:
    """Questions and blockers of an episode, for question precision (needed / questions), the share of blockers cleared
    (needed / (needed + left)) and their harmonic mean, Ask-F1 (2 needed / (questions + needed + left)).

    After HiL-Bench (Elfeki et al. 2026, arXiv 2604.09408), where a blocker is information that a task lacks and that no
    exploring brings, and precise questions are those about blockers. Theirs were written by people; ours follow from
    the truth:

      Ask-v0: one is blocked while the request and the answers fit several things. A question was needed if its answer
        rules out one of them, or tells a route to its end.
      HANNA, VNLA, HARI: one is blocked where one does not get on by oneself. A question on a way that the last answer
        tells in words, short of its end, was not needed. Another was needed if the agent, before it asks the next such
        question, comes nearer to a goal than it ever was, or succeeds. Who fails is blocked at the end.

    What would have happened without the answer is not known: compare with the agent that never asks.
    """
    if isinstance(episode.task.goal, FindDescribed):
        return _among_rivals(episode, episode.task.goal)
    metres = np.asarray(graph.distance)[:, list(episode.task.goal_nodes)].min(axis=1)
    steps, good = episode.steps, bool(success(episode, graph))
    new, told_way = list[int](), tuple[int, ...]()
    for t, step in enumerate(steps):
        if isinstance(step.action, Ask):
            new += [t] if step.pose.node not in told_way else []
            told_way = step.reply.subtask.path[:-1] if step.reply and step.reply.text and step.reply.subtask else ()
    needed = 0
    for t, after in itertools.pairwise([*new, len(steps)]):
        before = metres[[s.pose.node for s in steps[: t + 1]]].min()
        nearer = metres[[s.next_pose.node for s in steps[t:after]]].min() < before - 1e-6
        needed += int(nearer or (good and after == len(steps)))
    return AskCounts(episode.requests, needed, int(not good))


def _among_rivals(episode: Episode, goal: FindDescribed) -> AskCounts:
    """Of Ask-v0: rivals are the things that fit and are not meant."""
    rivals, needed = {*goal.fitting} - {goal.placement}, 0
    for reply in (s.reply for s in episode.steps if s.reply is not None):
        led = reply.subtask is not None and reply.subtask.target in episode.task.goal_nodes
        left = set() if led else rivals - {*reply.ruled_out}
        needed, rivals = needed + (left != rivals), left
    return AskCounts(episode.requests, needed, int(bool(rivals)))


def warping(distances: np.ndarray) -> float:
    """Dynamic time warping cost of two paths with (n, m) metres between their points (Magalhaes et al. 2019)."""
    cost = np.pad(np.asarray(distances, float), ((1, 0), (1, 0)), constant_values=np.inf)
    cost[0, 0] = 0.0
    for i, j in np.ndindex(distances.shape):
        cost[i + 1, j + 1] += min(cost[i, j + 1], cost[i + 1, j], cost[i, j])
    return float(cost[-1, -1])


def ndtw(path: tuple[int, ...], reference: tuple[int, ...], graph: NavGraph, radius: float = 3.0) -> float:
    """exp(-DTW / (|R| radius)), 1 for the reference itself (docs/sources.md, S7)."""
    metres = np.asarray(graph.distance)[np.ix_(path, reference)]
    return float(np.exp(-warping(metres) / (len(reference) * radius)))


def sdtw(path: tuple[int, ...], reference: tuple[int, ...], graph: NavGraph, radius: float = 3.0) -> float:
    """nDTW if the ends are within the radius, else 0 (docs/sources.md, S7)."""
    near = SuccessRule(radius).near(graph.distance[path[-1], reference[-1]])
    return ndtw(path, reference, graph, radius) if near else 0.0


def without_repeats(nodes: tuple[int, ...]) -> tuple[int, ...]:
    """The node sequence with consecutive repeats removed (turning, asking and stopping stay put)."""
    return tuple(v for i, v in enumerate(nodes) if i == 0 or v != nodes[i - 1])


def asked(intention: Intention) -> Measure:
    """How often an episode asked with an intention (Table 4.7)."""

    def count(episode: Episode, graph: NavGraph) -> float:
        return float(sum(isinstance(s.action, Ask) and s.action.intention is intention for s in episode.steps))

    return count


def moves(episode: Episode, graph: NavGraph) -> float:
    """How often an episode moved: DO of Table 4.7."""
    return float(sum(isinstance(s.action, Move) for s in episode.steps))


_REPORTED = (success, strict_success, spl, navigation_error, requests, oracle_success, path_length, steps)
PER_EPISODE: dict[str, Measure] = {f.__name__.replace("_", " "): f for f in _REPORTED}
"""The numbers every task reports, by name, in the order of their columns."""
USAGE: dict[str, Callable[[Usage], float]] = {
    "model calls": lambda u: u.calls,
    "tokens in": lambda u: u.tokens_in,
    "tokens out": lambda u: u.tokens_out,
    "model price": lambda u: u.price,
    "invalid answers": lambda u: u.invalid,
    "refusals": lambda u: u.refusals,
}
"""Numbers that episodes with a language model report besides, per episode."""


def usage(episode: Episode) -> Usage | None:
    """Calls of language models in an episode, as agent and as assistant; None where there was none."""
    asked = [s.action.thought.usage for s in episode.steps if s.action.thought and s.action.thought.usage]
    asked += [s.reply.usage for s in episode.steps if s.reply and s.reply.usage]
    return sum(asked, Usage()) if asked else None
