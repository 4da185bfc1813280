"""Metrics by hand on a four-node line (truth 8): nodes 0-1-2-3, two metres apart."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hand_worlds import line_world

from embodied.envs.base import HelpEnv
from embodied.interface import (
    Ask,
    FindObject,
    FollowRoute,
    Intention,
    Move,
    Pose,
    Reply,
    Stop,
    Subtask,
    SuccessRule,
    Task,
    Trajectory,
)
from embodied.kinds import metrics
from embodied.kinds.metrics import ask_counts


def task(radius: float = 0.0, start: int = 0, goals: tuple[int, ...] = (3,), horizon: int = 9) -> Task:
    what = FindObject("mug", None, ("mug_1",))
    return Task("line/find/0", "find", "line", Pose(start), what, goals, "find a mug", radius, horizon)


def walk(nodes: list[int], the_task: Task, stop: bool = True):
    """The episode that visits `nodes` and stops."""
    env = HelpEnv({"line": line_world()})
    env.reset(the_task)
    for node in nodes[1:]:
        env.step(Move(env.situation.candidate_nodes.index(node)))
    if stop:
        env.step(Stop())
    return env.episode()


def test_the_straight_way_scores_one():
    graph, e = line_world().graph, walk([0, 1, 2, 3], task())
    assert metrics.success(e, graph) == 1 and metrics.spl(e, graph) == 1
    assert metrics.navigation_error(e, graph) == 0 and metrics.path_length(e, graph) == 6


def test_a_detour_of_four_metres_scores_six_tenths():
    graph, e = line_world().graph, walk([0, 1, 0, 1, 2, 3], task())
    assert metrics.spl(e, graph) == pytest.approx(6 / 10)


def test_stopping_one_node_short_is_success_only_within_the_radius():
    graph = line_world().graph
    short, near = walk([0, 1, 2], task()), walk([0, 1, 2], task(radius=2.0))
    assert (metrics.success(short, graph), metrics.navigation_error(short, graph)) == (0, 2)
    assert metrics.success(near, graph) == 1
    assert metrics.spl(near, graph) == 1, "walked 4 m of 6 m: the ratio is capped at one"


def test_passing_the_goal_is_oracle_success_only():
    graph, e = line_world().graph, walk([1, 2, 3, 2, 1], task(start=1))
    assert metrics.oracle_success(e, graph) == 1 and metrics.success(e, graph) == 0


class Guide:
    """Tells the next two nodes towards node 3, in words unless `mute`."""

    def __init__(self, mute: bool) -> None:
        self.mute = mute

    def intentions(self, situation):
        return (Intention.HELP,)

    def answer(self, situation, question, *, rng):
        way = situation.world.graph.path(situation.pose.node, 3)[:3]
        return Reply(None if self.mute else "on", subtask=Subtask("way", way[-1], path=way))


class Guided(HelpEnv):
    def _replied(self, reply):
        pass


@pytest.mark.parametrize(
    ("nodes", "mute", "counts"),
    [
        ([0, "ask", 1, "ask", 2, 3], False, (2, 1, 0)),  # the second is on the way that was told
        ([0, "ask", 1, "ask", 2, 3], True, (2, 2, 0)),
        ([0, "ask", 1, 0, "ask", 1, 2], True, (2, 2, 1)),  # lost again, then on, then stopped short
        ([0, "ask", "ask", 1, 2, 3], False, (2, 1, 0)),  # nothing came of the first
        ([0, 1, 2, "ask", 1], True, (1, 0, 1)),
        ([0, 1, 2, 3], True, (0, 0, 0)),  # no blocker: it found the way by itself
        ([0, 1, 2, 3, "ask"], True, (1, 1, 0)),  # told that it is there, it stops
    ],
)
def test_a_question_was_needed_where_the_answer_leads_on(nodes, mute, counts):
    env = Guided({"line": line_world()}, Guide(mute))
    env.reset(task())
    for node in nodes[1:]:
        env.step(Ask() if node == "ask" else Move(env.situation.candidate_nodes.index(node)))
    env.step(Stop())
    assert dataclasses.astuple(ask_counts(env.episode(), line_world().graph)) == counts


def test_spl_measures_to_the_goal_nearest_the_final_node():
    graph, e = line_world().graph, walk([1, 2, 3], task(start=1, goals=(0, 3)))
    assert metrics.spl(e, graph) == 1, "4 m walked, 4 m to goal 3; goal 0 at 2 m does not count"


def test_cut_short_by_the_horizon_is_judged_where_it_stands():
    graph, e = line_world().graph, walk([0, 1, 2, 3], task(horizon=3), stop=False)
    assert e.ended == "limit" and metrics.success(e, graph) == 1


def test_the_second_wrong_turn_at_a_place_is_a_repeat():
    graph, e = line_world().graph, walk([1, 0, 1, 0, 1, 2, 3], task(start=1))
    assert metrics.mistake_repeats(e, graph) == (1, 7)


def test_ndtw_of_a_path_one_node_short():
    graph = line_world().graph
    assert metrics.warping(graph.distance[:3]) == 2
    assert metrics.ndtw((0, 1, 2), (0, 1, 2, 3), graph) == pytest.approx(math.exp(-2 / (4 * 3)))
    assert metrics.ndtw((0, 1, 2, 3), (0, 1, 2, 3), graph) == 1
    assert metrics.sdtw((0, 1), (0, 1, 2, 3), graph) == 0, "4 m from the end is outside 3 m"
    assert metrics.without_repeats((0, 0, 1, 1, 0)) == (0, 1, 0)


def test_a_route_task_is_judged_like_any_other():
    route = Task("line/vln/0", "vln", "line", Pose(0), FollowRoute("r", (0, 1, 2)), (2,), "go on", 3.0, 9)
    e = walk([0, 1], route)
    assert metrics.success(e, line_world().graph) == 1


def test_plays_differ_in_the_rule_of_success_alone():
    way = {"distances": np.array([5.0, 2.0, 3.0]), "lengths": np.array([0.0, 4.0, 6.0]), "shortest": 3.0}
    judged = lambda stopped=True, **rule: Trajectory(rule=SuccessRule(3.0, **rule), stopped=stopped, **way)
    graph, habitat = judged(stopped=False, needs_stop=False), judged(strict=True)
    assert (graph.success, graph.spl) == (1, 0.5) and (habitat.success, habitat.spl) == (0, 0), "3 m is at the radius"
    assert judged(stopped=False).success == 0 and (habitat.oracle_success, habitat.oracle_spl) == (1, 0.75)
