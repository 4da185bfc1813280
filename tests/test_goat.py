"""Goat: sequences of goals, their measures by hand, and GOAT-Bench's files as its loader reads them."""

from __future__ import annotations

import dataclasses
import gzip
import json

import pytest
from hand_data import hand_house
from hand_worlds import HandWorld, line_world

from embodied.cli.exports import registered_exports
from embodied.datasets.habitat import from_habitat, write_goat
from embodied.evaluation.evaluate import agent, play
from embodied.interface import FindInTurn, Move, NextGoal, Pose, Stop, Task, viewpoint
from embodied.kinds.shipped.goat import GOAL_STEPS, GOAT, UNSEEN_CLASSES, GoatEnv, outcomes
from embodied.kinds.task_kind import EnvInputs, TaskInputs
from embodied.language.plain_language import PlainLanguage
from embodied.language.templates import SPOKEN
from embodied.tasks.ask import is_unseen


def goal(node: int, picture: int | None = None) -> NextGoal:
    return NextGoal("image" if picture else "object", "mug", ("mug_1",), (node,), f"find {node}", picture)


def on_the_line(*goals: NextGoal, start: int = 0):
    env, world = GoatEnv({"line": line_world()}), line_world()
    task = Task(
        "line/goat/0",
        "goat",
        "line",
        Pose(start),
        FindInTurn(goals),
        goals[-1].nodes,
        goals[0].words,
        0.0,
        40 * len(goals),
    )
    return env, world.graph, env.reset(task)


def go(env, *places):
    for place in places:
        env.step(Stop() if place == "stop" else Move(env.situation.candidate_nodes.index(place)))


def test_each_goal_is_judged_from_where_it_was_told():
    env, graph, _ = on_the_line(goal(3), goal(1), goal(2))
    go(env, 1, 2, 3, "stop", 2, 3, 2, 1, "stop", 0, "stop")
    assert env.ended == "stop"
    results = [(t.success, t.spl, t.shortest) for _, t in outcomes(env.episode(), graph)]
    assert results == [(1.0, 1.0, 6.0), (1.0, 0.5, 4.0), (0.0, 0.0, 2.0)]


def test_a_goal_that_takes_too_long_is_lost_and_the_next_one_is_told():
    env, graph, _ = on_the_line(goal(3), goal(0, picture=2))
    for _ in range(GOAL_STEPS // 2):
        go(env, 1, 0)
    assert env.observation.instruction == "find 0" and env.observation.time_on_task == 0
    assert viewpoint(env.observation.target).node == 2
    go(env, "stop")
    assert [(t.success, t.spl) for _, t in outcomes(env.episode(), graph)] == [(0.0, 0.0), (1.0, 1.0)]


def test_goals_that_never_came_were_not_found():
    env, graph, _ = on_the_line(goal(0), goal(3))
    go(env, "stop", 1)
    assert [t.success for _, t in outcomes(env.so_far(), graph)] == [1.0, 0.0]


@pytest.fixture(scope="module")
def made():
    classes, (house, graph) = sorted(SPOKEN.things), hand_house(0, "grid", None, None)
    named = lambda p: classes[int(p.object_class[5:])] if p.object_class.startswith("thing") else p.object_class
    things = tuple(dataclasses.replace(p, object_class=named(p)) for p in house.placements)
    world = HandWorld(dataclasses.replace(house, placements=things), graph)
    wanted = [(part, 20) for part in ("main", "synonyms", UNSEEN_CLASSES)]
    return world, GOAT.tasks(TaskInputs(world, (), 2, PlainLanguage()), wanted)


def test_parts_ask_for_their_own_classes_in_their_own_words(made):
    world, parts = made
    spoken = {nouns[0] for nouns in SPOKEN.things.values()}
    for part, tasks in parts.items():
        for g in (g for t in tasks for g in t.goal.goals):
            (name,) = {world.house.placement_by_id[p].object_class for p in g.placements}
            assert is_unseen(name) == (part == UNSEEN_CLASSES) and g.nodes
            assert g.category == (SPOKEN.things[name][0] if part == "synonyms" else name)
            assert g.category in g.words if g.form != "image" else g.words == "find the place of the picture"
            assert part != "synonyms" or g.category in spoken


def test_who_remembers_finds_as_much_on_shorter_ways(made):
    world, parts = made
    make_env = GOAT.environments(EnvInputs({world.house.name: world}))
    spl = {}
    for name in ("explores, forgets", "explores, remembers"):
        episodes = play(make_env, agent("goat", name), parts["main"], seed=0)
        results = [t for e in episodes for _, t in outcomes(e, world.graph)]
        spl[name] = sum(x.spl for x in results) / len(results)
    assert spl["explores, remembers"] > spl["explores, forgets"] + 0.1


def test_files_are_read_as_goat_benchs_loader_reads_them(made, tmp_path):
    """The steps of GoatDatasetV1.from_json: one list of goals a category, and the instance that a task names in it."""
    world, parts = made
    *_, path = write_goat(tmp_path, "val", parts["main"], {world.house.name: world})
    body = json.loads(gzip.decompress(path.read_bytes()))
    for episode, task in zip(body["episodes"], parts["main"], strict=True):
        scene = episode["scene_id"].split("/")[-1]
        for (category, form, thing), told in zip(episode["tasks"], task.goal.goals, strict=True):
            (goals,) = [g for g in body["goals"].values() if g[0]["object_category"] == category]
            assert goals is body["goals"][f"{scene}_{category}"]
            some = [g for g in goals if form == "object" or g["object_id"] == thing]
            assert {g["object_id"] for g in some} >= set(told.placements)
            assert form != "description" or len(some[0]["lang_desc"].split()) <= 55
            views = [from_habitat(v["agent_state"]["position"])[:2] for g in some for v in g["view_points"]]
            assert {tuple(map(float, world.graph.positions[v][:2])) for v in told.nodes} <= {
                tuple(map(float, v)) for v in views
            }
    assert "goat" in registered_exports()
