"""Plain navigation: checks, the expert, no leak, and independence of order and batch."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hand_worlds import grid_world, line_world

from embodied.action_spaces import MonocularMoves, PanoramicMoves, nearest_views
from embodied.envs.base import ActionError, HelpEnv, TaskError
from embodied.interface import Ask, Move, Pose, Stop
from embodied.language.plain_language import PlainLanguage
from embodied.navigation.graph import count_hops
from embodied.tasks.goals import find_instances, find_pool, find_task


def find_tasks(world, n: int = 30):
    pool = find_pool(world, seed=3)
    return [find_task(pool, i, seed=3, language=PlainLanguage()) for i in range(min(n, len(pool)))]


def test_a_goal_node_is_in_the_objects_room_and_within_reach():
    world = grid_world()
    for x in find_instances(world, 2.0):
        for v in x.nodes:
            assert world.graph.room_of_node[v] == x.room
            p = world.house.placement_by_id[x.placement]
            assert np.hypot(*(world.graph.positions[v, :2] - p.position[:2])) <= 2.0 + 0.15


def test_task_j_is_the_same_however_many_are_drawn_and_no_two_are_alike():
    world = grid_world()
    tasks = find_tasks(world, 40)
    assert find_task(find_pool(world, seed=3), 7, seed=3, language=PlainLanguage()) == tasks[7]
    assert len({(t.request, t.start.node) for t in tasks}) == len(tasks)


def test_path_lengths_keep_the_limits():
    world = grid_world()
    hops = count_hops(world.graph.next_hop)
    for t in find_tasks(world, 1000):
        nearest = min(t.goal_nodes, key=lambda g: (world.graph.distance[t.start.node, g], g))
        assert 4 <= hops[t.start.node, nearest] + 1 <= 15


def test_impossible_actions_are_refused_and_change_nothing():
    world = line_world()
    env = HelpEnv({"line": world}, moves=MonocularMoves())
    task = dataclasses.replace(find_tasks(world)[0], start=Pose(0, 6))
    first = env.reset(task)
    wrong = ((Move(9), "does not exist"), (Move(0), "masked"), (Ask(), "can_ask"), ("left", "expected Move"))
    for action, words in wrong:
        with pytest.raises(ActionError, match=words):
            env.step(action)
    assert env.observation == first
    env.step(Stop())
    with pytest.raises(ActionError, match="over"):
        env.step(Stop())


def test_tasks_that_cannot_be_played_are_refused():
    world = line_world()
    task, env = find_tasks(world)[0], HelpEnv({"line": world})
    house = dataclasses.replace(world.house, placements=())
    for bad, worlds, words in (
        (dataclasses.replace(task, world="nowhere"), {"line": world}, "unknown world"),
        (dataclasses.replace(task, goal_nodes=(99,)), {"line": world}, "nodes"),
        (task, {"line": dataclasses.replace(world, house=house)}, "not in the house"),
        (dataclasses.replace(task, horizon=0), {"line": world}, "horizon"),
    ):
        env.worlds = worlds
        with pytest.raises(TaskError, match=words):
            env.reset(bad)


def test_moving_looks_where_the_candidate_was():
    world = line_world()
    candidates, poses = PanoramicMoves().at(world, Pose(1, 3))
    assert {p.node for p in poses} == {0, 2}
    east = next(p for p in poses if p.node == 2)
    assert (east.turn, east.tilt) == (0, 0)
    bearing = {pose.node: float(b) for pose, b in zip(poses, candidates.bearing, strict=True)}
    assert bearing == pytest.approx({2: -np.pi / 2, 0: np.pi / 2})  # looking north, east is to the right


def test_the_nearest_view_of_a_view_centre_is_itself():
    views = np.arange(36)
    assert (nearest_views((views % 12) * np.pi / 6, (views // 12 - 1) * np.pi / 6) == views).all()


def test_monocular_turns_close_a_circle():
    world, moves, pose = line_world(), MonocularMoves(), Pose(1, 5)
    for _ in range(12):
        pose = moves.at(world, pose)[1][1]
    assert pose == Pose(1, 5)
    assert moves.at(world, Pose(0, 0))[1][0] == Pose(1, 0), "forward along +x from the west end"
    assert not moves.at(world, Pose(0, 6))[0].allowed[0], "nothing ahead at the west wall"


def test_candidates_come_by_bearing_and_point_at_their_nodes():
    world, moves = grid_world(), PanoramicMoves()
    for node in (7, 14, 21):
        for turn in range(12):
            candidates, poses = moves.at(world, Pose(node, turn))
            assert (np.diff(np.abs(candidates.bearing)) >= -1e-6).all()
            for bearing, pose in zip(candidates.bearing, poses, strict=True):
                offset = world.graph.positions[pose.node] - world.graph.positions[node]
                assert np.cos(bearing + turn * np.pi / 6 - np.arctan2(offset[1], offset[0])) == pytest.approx(1)
                assert abs((pose.yaw - bearing - turn * np.pi / 6 + np.pi) % (2 * np.pi) - np.pi) <= np.pi / 12 + 1e-6
