"""HARI: descriptions, the half-way rule, the goal stack, costs and the telescoping identity (4.21)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hand_worlds import grid_world, line_world, room, thing

from embodied.assistants.descriptions import Describer, dropped, frequent_classes
from embodied.envs.base import ActionError
from embodied.envs.hari import HariEnv, HariExtras, shaped_costs
from embodied.evaluation.evaluate import play
from embodied.interface import Ask, Feature, FindObject, Intention, Mode, Move, Pose, Stop, Task
from embodied.kinds import metrics
from embodied.kinds.shipped.hari import HariAssistant, Uncooperative, hari_pool, hari_task, subgoal
from embodied.language.plain_language import PlainLanguage
from embodied.navigation.graph import count_hops
from embodied.policies.baselines import HalfwaySkyline, Shortest

CUR, GOAL, SUB = Intention.CUR, Intention.GOAL, Intention.SUB
TASK = Task(
    "line/hari/0", "hari", "line", Pose(0), FindObject("mug", "hall", ("mug_1",)), (3,), "find a mug in a hall", 0.0, 30
)


def line_env(**options) -> HariEnv:
    world, say = line_world(), Describer(())
    return HariEnv({"line": world}, HariAssistant(say, **options), say)


def grid_setup(assistant=lambda say: HariAssistant(say)):
    world = grid_world()
    say = Describer(frequent_classes([world], 0.5))
    pool = hari_pool(world, seed=0)
    tasks = [hari_task(pool, i, seed=0, language=PlainLanguage()) for i in range(30)]
    return world, tasks, lambda: HariEnv({"grid": world}, assistant(say), say)


def test_the_half_way_rule():
    assert [subgoal(tuple(range(n))) for n in (1, 2, 3, 4, 5, 6, 7, 8, 20)] == [0, 1, 1, 2, 2, 3, 3, 3, 3]


def test_descriptions_name_the_room_and_what_is_near():
    world = line_world()
    dense = Describer(()).dense(world, 3, goal=True)
    assert dense == (Feature("room", "hall"), Feature("object", "mug", 1, -1, 1)), "0.4 m east, 0.2 m north, 1.4 m down"
    assert Describer(()).dense(world, 0) == (Feature("room", "hall"),), "the mug is more than 5 m away"
    assert Describer(()).sparse(world, 3, goal=True) == (Feature("room", "hall"),), "a mug is not frequent"
    assert Describer(("mug",)).sparse(world, 3) == dense[1:], "no room name for the state"
    assert Describer(()).step(world, 1, 3) == (Feature("action", "go", 0, 0, 2),)
    assert Describer(()).step(world, 3, 3) == (Feature("action", "stop"),)


def test_at_most_twenty_objects_and_none_from_behind_the_wall():
    world = line_world()
    many = tuple(thing("mug", i, "hall_1", 1.0 + i / 20, 0.5) for i in range(1, 40))
    house = dataclasses.replace(world.house, placements=many)
    assert len(Describer(()).dense(dataclasses.replace(world, house=house), 0)) == 21
    other = dataclasses.replace(
        world.house,
        rooms=(*world.house.rooms, room("bedroom_1", "bedroom", 0, 2, 8, 4)),
        placements=(thing("bed", 1, "bedroom_1", 1, 2.5),),
    )
    behind = dataclasses.replace(world, house=other)
    assert len(Describer(()).dense(behind, 0)) == 1


def test_pre_training_drops_features_and_varies_goals_as_appendix_e_says():
    rng, rows = np.random.default_rng(0), tuple(Feature("object", f"thing {i}") for i in range(9))
    kept = [dropped(rows, rng=rng) for _ in range(300)]
    assert {len(k) for k in kept} == {5, 6, 7, 8, 9} and all(list(k) == sorted(k, key=rows.index) for k in kept)
    assert dropped(rows[:3], rng=rng) == rows[:3]
    world, say = line_world(), Describer(())
    goals = {say.pretraining_goal(world, 3, 0, "mug", rng=rng) for _ in range(50)}
    assert goals == {say.dense(world, 3, goal=True)}, "with one object near, dense and sparse say the same"
    assert say.step(world, 2, 3) in {say.pretraining_goal(world, 3, 2, "mug", rng=rng) for _ in range(50)}


def test_the_stack_pushes_describes_pops_and_ends():
    env = line_env()
    o = env.reset(TASK)
    assert (o.mode, o.extras) == (Mode.MAIN, HariExtras((), ((Feature("room", "hall"),),)))
    assert o.can_ask == (CUR, GOAL, SUB)
    o = env.step(Ask(CUR))
    assert o.extras.state_description == (Feature("room", "hall"),)
    o = env.step(Ask(GOAL))
    assert len(o.extras.goal_descriptions) == 1 and len(o.extras.goal_descriptions[0]) == 2
    o = env.step(Ask(SUB))
    assert (env.situation.extras.goals, o.mode, o.can_ask) == ((3, 2), Mode.SUB, (CUR, GOAL)), "the stack is full"
    with pytest.raises(ActionError, match="sub"):
        env.step(Ask(SUB))
    for node in (1, 2):
        o = env.step(Move(env.situation.candidate_nodes.index(node)))
        assert o.extras.state_description == (), "after moving, perception is sparse again"
    o = env.step(Stop())
    assert (env.situation.extras.goals, o.mode) == ((3,), Mode.MAIN)
    o = env.step(Ask(SUB))
    assert o.extras.goal_descriptions[1] == (Feature("action", "go", 0, 0, 2),), "one step away: the action itself"
    env.step(Move(env.situation.candidate_nodes.index(3)))
    env.step(Stop())
    assert env.step(Stop()) is None
    e = env.episode()
    assert metrics.success(e, line_world().graph) == 1 and e.requests == 4
    assert [s.cost for s in e.steps] == [0.01] * 5 + [0.0] + [0.01] * 2 + [0.0, 0.0]


def test_stopping_away_from_the_goal_costs_the_edges_that_are_missing():
    env = line_env()
    env.reset(TASK)
    env.step(Stop())
    assert env.episode().steps[-1].cost == 3.0


def test_a_sub_goal_is_given_up_after_three_times_its_distance():
    env = line_env()
    env.reset(TASK)
    env.step(Ask(SUB))
    for i in range(6):
        assert len(env.situation.extras.goals) == 2
        env.step(Move(env.situation.candidate_nodes.index(1 - env.pose.node)) if i % 2 else Ask(CUR))
    assert env.situation.extras.goals == (3,), "time steps count, not moves (Table E.2)"


def test_an_agent_that_stands_on_its_goal_at_the_horizon_without_done_has_not_succeeded():
    env = line_env()
    env.reset(dataclasses.replace(TASK, start=Pose(3), horizon=2))
    env.step(Ask(CUR))
    assert env.step(Ask(CUR)) is None
    assert env.episode().ended == "limit" and metrics.success(env.episode(), line_world().graph) == 0
    env.reset(dataclasses.replace(TASK, start=Pose(3), horizon=2))
    env.step(Stop())
    assert metrics.success(env.episode(), line_world().graph) == 1
    env.reset(dataclasses.replace(TASK, horizon=3))
    for node in (1, 2, 3):
        env.step(Move(env.situation.candidate_nodes.index(node)))
    assert env.episode().steps[-1].cost == 3.01, "as if it had stayed at the start"


def test_sparse_descriptions_keep_a_tenth_of_the_classes():
    world = line_world()
    things = tuple(thing(f"c{k}", i, "hall_1", 1, 1) for k in range(20) for i in range(1, 22 - k))
    many = dataclasses.replace(world, house=dataclasses.replace(world.house, placements=things))
    assert frequent_classes([many]) == ("c0", "c1")
    assert len(frequent_classes([many], 0.5)) == 10


def test_shaped_costs_telescope_whatever_is_done():
    """Eq 4.21: their sum is the sum of costs minus Phi(s_1, g_1)."""
    world, tasks, make = grid_setup()
    hops, env = count_hops(world.graph.next_hop), make()
    for i, task in enumerate(tasks):
        rng = np.random.default_rng(i)
        o = env.reset(task)
        while o is not None:
            choices = [Move(k) for k in range(len(o.candidates))] + [Ask(q) for q in o.can_ask] + [Stop()]
            o = env.step(choices[int(rng.integers(len(choices)))])
        e = env.episode()
        start = hops[task.start.node, task.goal_nodes[0]]
        assert sum(shaped_costs(e, hops)) == pytest.approx(sum(s.cost for s in e.steps) - start)


def test_the_expert_arrives_exactly_and_pays_for_its_steps_only():
    world, tasks, make = grid_setup()
    hops = count_hops(world.graph.next_hop)
    for e in play(make, Shortest(), tasks, seed=0):
        assert metrics.success(e, world.graph) == 1
        assert sum(s.cost for s in e.steps) == pytest.approx(0.01 * hops[e.task.start.node, e.task.goal_nodes[0]])


def test_the_skyline_reaches_every_goal_by_sub_goals():
    world, tasks, make = grid_setup()
    episodes = play(make, HalfwaySkyline(), tasks, seed=0)
    assert all(metrics.success(e, world.graph) for e in episodes)
    assert all(e.requests >= 2 for e in episodes)


def test_the_uncooperative_assistant_answers_other_questions():
    _, tasks, make = grid_setup(Uncooperative)
    env, heard = make(), set()
    for seed in range(30):
        env.reset(tasks[0], seed=seed)
        env.step(Ask(CUR))
        heard.add(env.last_step.reply.intention)
    assert heard == {CUR, GOAL, SUB}
