"""Truths 4, 5 and 7 of the design, over every kind of task on one hand-made house."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hand_data import DATA_KINDS
from hand_worlds import grid_world

from embodied.assistants.route_system import build_routes
from embodied.evaluation.evaluate import agent, play
from embodied.interface import Ask, Move, Observation, Task
from embodied.kinds import metrics
from embodied.kinds.task_kind import EnvInputs, TaskInputs, kind_named
from embodied.language.plain_language import PlainLanguage


def setting(kind: str, n: int = 24):
    world, language = grid_world(7), PlainLanguage()
    routes = build_routes(world, seed=2, language=language, house_split="test")
    known = kind_named(kind)
    tasks = known.tasks(TaskInputs(world, routes, 2, language), [(known.unseen_part, n)])[known.unseen_part]
    return world, tasks, known.environments(EnvInputs({"grid": world}, lambda _: routes))


def same_but_for_the_goal(tasks: list[Task]) -> tuple[Task, Task]:
    one = tasks[0]
    two = next(t for t in tasks if t.goal_nodes != one.goal_nodes)
    return one, dataclasses.replace(
        two, start=one.start, request=one.request, horizon=one.horizon, budget=one.budget, id=one.id
    )


def without_descriptions(o: Observation) -> Observation:
    """HARI speaks of the goal from the first moment, in the goal's description (4.3.2)."""
    extras = o.extras and dataclasses.replace(o.extras, goal_descriptions=())
    return dataclasses.replace(o, extras=extras)


@pytest.mark.parametrize("kind", DATA_KINDS)
def test_nothing_leaks_before_the_goal_is_spoken_of(kind):
    _, tasks, make = setting(kind)
    one, two = same_but_for_the_goal(tasks)
    a, b, rng = make(), make(), np.random.default_rng(0)
    x, y = a.reset(one), b.reset(two)
    for _ in range(min(one.horizon - 1, 25)):
        assert without_descriptions(x) == without_descriptions(y)
        move = Move(int(rng.choice(np.flatnonzero(x.candidates.allowed))))
        x, y = a.step(move), b.step(move)


@pytest.mark.slow
def test_help_does_speak_of_the_goal():
    """The leak test can fail: after asking, the two tasks differ."""
    _, tasks, make = setting("vnla")
    heard, env = set(), make()
    for t in tasks:
        env.reset(dataclasses.replace(t, start=tasks[0].start, request="find it", budget=1))
        heard.add(env.step(Ask()).instruction)
    assert len(heard) > 1


@pytest.mark.slow
@pytest.mark.parametrize("kind", DATA_KINDS)
def test_the_expert_solves_every_task(kind):
    world, tasks, make = setting(kind, 60)
    episodes = play(make, agent(kind, "shortest"), tasks, seed=0)
    assert len(episodes) >= 15 and all(metrics.success(e, world.graph) for e in episodes)
    if not kind_named(kind).monocular:  # whose forward goes where the camera looks, at times a detour
        assert all(metrics.spl(e, world.graph) == pytest.approx(1) for e in episodes)


@pytest.mark.slow
@pytest.mark.parametrize("kind", DATA_KINDS)
def test_no_agents_episode_depends_on_order_or_batch(kind):
    _, tasks, make = setting(kind)
    for name in kind_named(kind).baselines:
        alone = play(make, agent(kind, name), tasks, seed=3)
        assert alone == play(make, agent(kind, name), tasks, seed=3, batch=32), name
        assert alone == play(make, agent(kind, name), tasks[::-1], seed=3, batch=5)[::-1], name
