"""HANNA: ANNA's equations, Algorithm 7, routes and Lemma 2, the retrospective teacher."""

from __future__ import annotations

import dataclasses
import math

import av
import numpy as np
import pytest
from hand_hanna import LINE_ROUTES, LINE_TASK, grid_setup, line_env
from hand_worlds import grid_world, line_world

from embodied.action_spaces import PanoramicMoves
from embodied.assistants.anna import Anna, AssistantError
from embodied.assistants.route_system import build_routes, sampled_paths
from embodied.envs.base import ActionError
from embodied.evaluation.evaluate import play
from embodied.interface import VIEWS, Ask, Intention, Mode, Move, Pose, Route, Step, Stop, Thought, Viewpoint, viewpoint
from embodied.kinds import metrics
from embodied.kinds.shipped.hanna import HANNA, ShowingEnv, subtask_success
from embodied.kinds.task_kind import EnvInputs
from embodied.language.plain_language import PlainLanguage, detokenized
from embodied.navigation.graph import count_hops
from embodied.policies.baselines import (
    PerfectInterpreter,
    PrivilegedAsking,
    RandomWalk,
    Shortest,
    ask_at_random,
    ask_every_5,
    never_ask,
)
from embodied.seeds import stream
from embodied.teachers.shortest import HannaTeacher, base37_entropy, lost_as_programmed, segments
from embodied.viz.video import _captions, film_episode

# ANNA


def test_help_is_near_route_starts_only_and_asking_elsewhere_is_an_error():
    env = line_env(LINE_ROUTES[:2])
    can = []
    for node in range(4):
        env.reset(dataclasses.replace(LINE_TASK, start=Pose(node)))
        can.append(bool(env.observation.can_ask))
    assert can == [True, True, True, False], "routes start at node 1, whose neighbours are 2 m away"
    with pytest.raises(ActionError, match="can_ask"):
        env.step(Ask())
    with pytest.raises(AssistantError, match="nobody"):
        env.assistant.answer(env.situation, Intention.HELP, rng=stream(0))


def test_the_reply_is_the_route_that_ends_nearest_the_goal():
    env = line_env()
    env.reset(LINE_TASK)
    reply = env.assistant.answer(env.situation, Intention.HELP, rng=stream(0))
    assert (reply.text, reply.image) == ("go two", Viewpoint("line", 3))
    assert (reply.subtask.target, reply.subtask.goal, reply.subtask.start) == (3, 3, Pose(1, 3, 1))


def test_the_departure_node_is_the_nearest_to_a_goal_not_the_end_of_the_route():
    env = line_env((Route("through", (1, 2, 3), 0, 0, "go on", "test"),))
    env.reset(dataclasses.replace(LINE_TASK, goal_nodes=(2,)))
    reply = env.assistant.answer(env.situation, Intention.HELP, rng=stream(0))
    assert reply.subtask.target == 2 and reply.subtask.path == (1, 2)


def test_who_is_shown_the_way_can_only_follow_and_is_back_at_the_main_task_where_it_ends():
    told = line_env((Route("long", (1, 2, 3), 3, 1, "go two", "test"),))
    env = ShowingEnv(told.worlds, told.assistant)
    env.reset(LINE_TASK)
    env.step(Ask())
    for node in (2, 3):
        assert env.mode is Mode.SUB and env.instruction == "go two"
        (only,) = np.flatnonzero(env.observation.candidates.allowed)
        env.step(Move(int(only)))
        assert env.pose.node == node
    assert env.mode is Mode.MAIN and env.subtask is None and env.observation.candidates.allowed.any()
    env.step(Stop())
    assert metrics.success(env.episode(), env.world.graph) == 1.0
    assert subtask_success(env.episode(), env.world.graph) == 1.0
    with pytest.raises(ValueError, match="living"):
        HANNA.environments(EnvInputs(told.worlds, rules="alive"))


def test_every_path_needs_a_wording_in_the_split():
    world = line_world()
    with pytest.raises(AssistantError, match="no wording"):
        Anna({"line": world.graph}, {"line": LINE_ROUTES}, split="val")


def test_brute_force_agrees_with_equations_4_4_to_4_7():
    world, routes, tasks, make = grid_setup()
    env, distance = make(), world.graph.distance
    for task in tasks:
        env.reset(task)
        if not env.observation.can_ask:
            continue
        reply = env.assistant.answer(env.situation, Intention.HELP, rng=stream(0))
        v = task.start.node
        zone = [
            r
            for r in routes
            if r.path[0] == v or (r.path[0] in world.graph.neighbours(v) and distance[v, r.path[0]] <= 2.0)
        ]
        best = min(distance[u, g] for r in zone for u in r.path for g in task.goal_nodes)
        assert distance[reply.subtask.target, reply.subtask.goal] == pytest.approx(best)


# Algorithm 7


def test_an_episode_follows_algorithm_7_line_by_line():
    env = line_env()
    o = env.reset(LINE_TASK)
    assert (o.mode, o.instruction, o.target, o.time, o.time_on_task) == (Mode.MAIN, "find a mug", None, 0, 0)
    o = env.step(Ask())
    assert (o.mode, o.instruction, viewpoint(o.target)) == (Mode.SUB, "go two", Viewpoint("line", 3))
    assert (env.pose, o.time, o.time_on_task) == (Pose(1, 3, 1), 1, 0), "entered the route, looking along its angles"
    o = env.step(Move(env.situation.candidate_nodes.index(2)))
    assert (o.mode, o.time_on_task, env.pose.node) == (Mode.SUB, 1, 2)
    o = env.step(Stop())
    assert (o.mode, o.instruction, viewpoint(o.target)) == (Mode.MAIN, "find a mug", Viewpoint("line", 3)), (
        "departed early: image of g*"
    )
    assert (env.pose.node, o.time, o.time_on_task, env.situation.targets) == (2, 3, 0, (3,))
    o = env.step(Move(env.situation.candidate_nodes.index(3)))
    assert env.step(Stop()) is None
    e = env.episode()
    assert (e.ended, e.requests, e.nodes) == ("stop", 1, (0, 1, 2, 2, 3, 3))
    assert metrics.success(e, line_world().graph) == 1 and metrics.spl(e, line_world().graph) == 1
    assert subtask_success(e, line_world().graph) == 1, "left within 2 m of the target"


def test_asking_again_on_a_route_replaces_the_message():
    env = line_env()
    env.reset(LINE_TASK)
    env.step(Ask())
    o = env.step(Ask())
    assert o.mode is Mode.SUB and o.time_on_task == 0 and env.pose.node == 1


# Agents


def test_teacher_navigation_solves_everything_however_it_asks():
    world, _, tasks, make = grid_setup()
    for rule in (never_ask, ask_at_random, ask_every_5):
        episodes = play(make, PrivilegedAsking(Shortest(), rule), tasks, seed=2)
        assert all(metrics.success(e, world.graph) for e in episodes)
    assert np.mean([e.requests for e in episodes]) > 0.2
    alone = play(make, Shortest(), tasks, seed=2)
    assert all(metrics.spl(e, world.graph) == pytest.approx(1) for e in alone)


def test_perfect_interpretation_beats_chance_by_far():
    world, _, tasks, make = grid_setup(60)
    rates = [
        np.mean([metrics.success(e, world.graph) for e in play(make, p, tasks, seed=0)])
        for p in (PerfectInterpreter(), RandomWalk())
    ]
    assert rates[0] > 0.7 and rates[1] < 0.2


# Routes


def test_sampled_routes_are_shortest_paths_of_4_to_6_edges_without_repeats():
    world = grid_world(8)
    paths = sampled_paths(world.graph, 50, rng=stream(0))
    hops = count_hops(world.graph.next_hop)
    assert len(set(paths)) == 50
    assert all(4 <= len(p) - 1 <= 6 and hops[p[0], p[-1]] == len(p) - 1 for p in paths)


def test_training_houses_hold_out_one_wording_of_every_path():
    routes = build_routes(grid_world(8), seed=0, language=PlainLanguage(), house_split="train")
    by_path: dict = {}
    for r in routes:
        by_path.setdefault(r.path, []).append(r.split)
    assert all(sorted(s) == ["train_seen", "train_seen", "train_unseen"] for s in by_path.values())
    assert len(by_path) == round(211 / 125 * 64 / 3)


# The retrospective teacher


def test_lost_is_who_never_gets_as_close_again():
    assert lost_as_programmed([5, 3, 6, 5, 4]) == [False, False, True, True, True]
    assert lost_as_programmed([3, 2, 2, 1]) == [False] * 4


def thought(env, best: int, p: float) -> Thought:
    n = len(env.observation.candidates)
    moves = np.full(n + 1, (1 - p) / n if n else 0.0)
    moves[best] = p
    return Thought(moves)


def test_reasons_and_labels_by_hand():
    """0 -> 1 -> 0 (lost, sure), ask, depart at once, on to the goal."""
    env = line_env()
    env.reset(dataclasses.replace(LINE_TASK, start=Pose(1)))

    def to(node: int) -> int:
        return env.situation.candidate_nodes.index(node)

    env.step(Move(to(0), thought(env, to(0), 0.4)))  # wrong and unsure, at the closest approach
    env.step(Move(to(1), thought(env, to(1), 1.0)))  # right and sure, but farther than before
    env.step(Ask(thought=thought(env, to(2), 0.9)))  # back at the closest distance, but later
    env.step(Stop())  # departs at node 1: wrong
    env.step(Move(to(0), thought(env, to(0), 0.9)))  # the same mistake as in the first step
    env.step(Move(to(1)))
    env.step(Move(to(2)))
    env.step(Move(to(3)))
    env.step(Stop())
    labels = HannaTeacher().relabel(env.episode(), line_world())
    assert [x.reasons for x in labels[:3]] == [(False, True, True), (True, False, True), (True, False, True)]
    assert [x.ask for x in labels[:5]] == [True, True, True, False, False], "node 1 has been asked at"
    assert labels[2].move is None, "a step that asked teaches no navigation"
    assert isinstance(labels[8].move, Stop)
    (again,) = labels[4].negatives
    assert env.episode().steps[4].candidate_nodes[again.candidate] == 0, "curiosity remembers across the help (4.12)"
    assert labels[3].negatives == (), "another instruction, another memory"


def test_steps_outside_a_zone_teach_nothing_about_asking():
    env = line_env(LINE_ROUTES[:1])
    env.reset(dataclasses.replace(LINE_TASK, start=Pose(3)))
    env.step(Stop())
    (label,) = HannaTeacher().relabel(env.episode(), line_world())
    assert label.ask is None and label.reasons is None


def test_segments_are_cut_after_requests_and_stops():
    def step(action) -> Step:
        return Step(Pose(0), Mode.MAIN, "", (3,), "none", (), (1,), action, None, Pose(0))

    pieces = segments([step(a) for a in (Move(0), Ask(), Move(0), Move(0), Stop(), Stop())])
    assert [len(p) for p in pieces] == [2, 3, 1]


def test_entropy_in_base_37_spans_zero_to_one():
    candidates, _ = PanoramicMoves().at(line_world(), Pose(1))
    sure, even = np.array([1.0, 0, 0]), np.full(3, 1 / 3)
    assert base37_entropy(sure, candidates) == 0
    assert base37_entropy(even, candidates) == pytest.approx(math.log(3) / math.log(VIEWS + 1))


def test_a_film_of_an_episode_shows_the_request_and_then_what_the_assistant_said(tmp_path):
    env = line_env()
    env.reset(LINE_TASK)
    while env.ended is None:
        asks = bool(env.observation.can_ask) and not env.requests
        env.step(Ask() if asks else Stop() if env.time else Move(0))
    episode = env.episode()
    reply = next(s.reply.text for s in episode.steps if s.reply)
    words, first = _captions(episode), f"Task: {LINE_TASK.request}"
    assert words[0] == first and f"Agent asks. Assistant: {detokenized(reply)}" in words and first in words[-1]
    black = np.zeros((48, 64, 3), np.uint8)
    frames = film_episode(env.world.graph, episode, lambda i, c: black, tmp_path / "film.mp4", (48, 64))
    with av.open(str(tmp_path / "film.mp4")) as film:
        assert sum(1 for _ in film.decode(video=0)) == frames > len(episode.steps)
