"""EQA: questions from the facts of a house, answers as actions, and who guesses."""

from __future__ import annotations

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest
from hand_chat import ChatServer, said
from hand_worlds import grid_world, thing
from test_language_models import client_of

from embodied.agents.language_models.agent import LanguageModelAgent
from embodied.evaluation.evaluate import agent, play
from embodied.interface import Move, Sighting, Stop
from embodied.kinds.metrics import success
from embodied.kinds.shipped.eqa import EQA, FEWEST_HOPS, facts, grounded
from embodied.kinds.task_kind import EnvInputs, TaskInputs
from embodied.language.plain_language import PlainLanguage
from embodied.records import from_json, to_json

COLOURS = ("red", "green", "blue", "white", "black")
CLASSES = tuple(f"lamp{k}" for k in range(12))


def asset(name: str, colour: str):
    return SimpleNamespace(object_class=name, colours=(colour,), materials=("wood",), rooms={})


class Seen:
    """A grid of rooms with a lamp of each class, in a colour of its own; it is seen from the nearest two nodes."""

    def __init__(self, seed: int) -> None:
        world, rng = grid_world(6, name=f"grid_{seed}"), np.random.default_rng(seed)
        rooms = sorted((r.id, r.polygon[0]) for r in world.house.rooms)
        lamps = []
        for k, name in enumerate(CLASSES):
            room, (x, y) = rooms[k % 4]
            lamp = thing(name, 1, room, x + 1 + k % 5, y + 1 + k % 3)
            lamps.append(dataclasses.replace(lamp, asset=f"{name}/{COLOURS[rng.integers(5)]}"))
        self.house, self.graph = dataclasses.replace(world.house, placements=tuple(lamps)), world.graph
        assets = {f"{name}/{colour}": asset(name, colour) for name in CLASSES for colour in COLOURS}
        self.catalogue = SimpleNamespace(assets=assets)

    def sightings(self, node: int) -> tuple[Sighting, ...]:
        at = np.asarray(self.graph.positions)[:, :2]
        near = lambda p: node in np.argsort(np.hypot(*(at - p.position[:2]).T), kind="stable")[:2]
        return tuple(Sighting(p.id, p.object_class, 0.0, 0.0, 1.0, 200) for p in self.house.placements if near(p))


@pytest.fixture(scope="module")
def worlds():
    return {w.house.name: w for w in map(Seen, range(8))}


@pytest.fixture(scope="module")
def tasks(worlds):
    of = lambda w: EQA.tasks(TaskInputs(w, (), 0, PlainLanguage()), [("main", 12)])["main"]
    return [t for w in worlds.values() for t in of(w)]


@pytest.fixture
def make_env(worlds):
    return EQA.environments(EnvInputs(worlds))


def test_the_right_option_is_the_colour_of_the_thing_and_stands_anywhere(worlds, tasks):
    assert len(tasks) > 80
    for t in tasks:
        (name,), goal = t.goal.placements, t.goal
        p = worlds[t.world].house.placement_by_id[name]
        assert goal.options[goal.answer] == p.asset.split("/")[1] and len({*goal.options}) == len(goal.options) == 4
        assert worlds[t.world].graph.hops[t.start.node, list(t.goal_nodes)].min() >= FEWEST_HOPS
    share = np.bincount([t.goal.answer for t in tasks], minlength=4) / len(tasks)
    assert share.max() < 0.45, "the place of an option tells nothing"
    assert from_json(type(tasks[0]), to_json(tasks[0])) == tasks[0]


def test_nothing_that_is_there_twice_is_asked_for(worlds):
    world = Seen(0)
    twin = dataclasses.replace(world.house.placements[0], id="twin")
    world.house = dataclasses.replace(world.house, placements=(*world.house.placements, twin))
    asked = {goal.noun for _, goal in facts(world)}
    assert "lamp0" not in asked and "lamp1" in asked


def test_only_who_looks_answers_more_than_chance(worlds, tasks, make_env):
    rate = {}
    for name in ("random", "majority", "shortest"):
        episodes = play(make_env, agent("eqa", name, worlds), tasks, seed=0)
        rate[name] = np.mean([success(e, worlds[e.task.world].graph) for e in episodes])
        assert name == "shortest" or not any(grounded(e, worlds[e.task.world].graph) for e in episodes)
    assert rate["shortest"] == 1 and rate["random"] < 0.4 and rate["majority"] < 0.4


def test_a_majority_that_there_is_is_guessed(worlds):
    """The blind row can fail: where all houses have red lamps, it is always right."""
    for w in (red := {n: Seen(k) for k, n in enumerate(worlds)}).values():
        w.house = dataclasses.replace(
            w.house, placements=tuple(dataclasses.replace(p, asset=f"{p.object_class}/red") for p in w.house.placements)
        )
    tasks = [t for w in red.values() for t in EQA.tasks(TaskInputs(w, (), 0, PlainLanguage()), [("main", 4)])["main"]]
    episodes = play(EQA.environments(EnvInputs(red)), agent("eqa", "majority", red), tasks, seed=0)
    assert all(success(e, red[e.task.world].graph) for e in episodes)


def test_stopping_twice_is_no_answer_and_a_new_episode_walks_again(worlds, tasks, make_env):
    env, graph = make_env(), worlds[tasks[0].world].graph
    before = env.reset(tasks[0])
    answers = env.step(Stop())
    assert answers.candidates.words == tuple(f"answer {o}" for o in tasks[0].goal.options)
    assert env.step(Stop()) is None and success(env.episode(), graph) == 0
    assert env.reset(tasks[0]) == before
    env.step(Stop())
    env.step(Move(tasks[0].goal.answer))
    assert success(env.episode(), graph) == 1 and grounded(env.episode(), graph) == 0


def test_a_language_model_answers_by_the_name_of_an_option(worlds, tasks, make_env, tmp_path):
    def behaviour(request):
        can = request["response_format"]["json_schema"]["schema"]["properties"]["action"]["enum"]
        wanted = [a for a in can if a.startswith("answer")] or ["stop"]
        return said(json.dumps({"reason": "it is", "action": wanted[0]}))

    with ChatServer(behaviour) as server:
        (episode,) = play(make_env, LanguageModelAgent(client_of(server, tmp_path / "answers")), tasks[:1], seed=0)
    assert [type(s.action) for s in episode.steps] == [Stop, Move]
    assert success(episode, worlds[tasks[0].world].graph) == (tasks[0].goal.answer == 0)
