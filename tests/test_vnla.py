"""VNLA: monocular planning, the advisor, the budget, Algorithm 6 and the program's rules."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hand_worlds import grid_world, line_world

from embodied.action_spaces import WORDS, MonocularMoves
from embodied.envs.base import ActionError
from embodied.evaluation.evaluate import play
from embodied.interface import Ask, FindObject, Mode, Move, Pose, Stop, Task, Thought
from embodied.kinds import metrics
from embodied.kinds.shipped.find import FIND
from embodied.kinds.shipped.vnla import (
    RULES_OF_PLAY,
    VNLA,
    Advisor,
    Algorithm6Env,
    DirectVnlaEnv,
    MuteDirectVnlaEnv,
    VnlaEnv,
    fitted,
)
from embodied.kinds.task_kind import EnvInputs
from embodied.language.plain_language import PlainLanguage, heard_subgoal
from embodied.policies.baselines import Shortest, SubgoalListener, VnlaAsking
from embodied.tasks.goals import MOST_ACTIONS, time_limits, vnla_pool, vnla_task
from embodied.teachers.vnla import VnlaTeacher, ask_reason

TASK = Task(
    "line/vnla/0", "vnla", "line", Pose(0, 6), FindObject("mug", "hall", ("mug_1",)), (3,), "find a mug", 0.0, 20, 2.0
)


def line_env(kind=VnlaEnv):
    world, teacher = line_world(), VnlaTeacher()
    return kind({"line": world}, Advisor(teacher, PlainLanguage()), teacher.moves)


def grid_setup(kind=VnlaEnv, n: int = 25):
    world, teacher = grid_world(), VnlaTeacher()
    plan = teacher.plan(world)
    pool = vnla_pool(world, plan, seed=0)
    tasks = [vnla_task(pool, i, world, plan, seed=0, language=PlainLanguage()) for i in range(min(n, len(pool)))]
    return world, teacher, tasks, lambda: kind({"grid": world}, Advisor(teacher, PlainLanguage()), teacher.moves)


def go(word: str) -> Move:
    return Move(WORDS.index(word))


def test_who_has_walked_where_no_way_leads_back_is_told_moves_that_are_possible():
    class OneWay(MonocularMoves):
        def at(self, world, pose):
            candidates, poses = super().at(world, pose)
            if pose.node == 3:  # the end of the line, from which nobody can walk
                allowed = candidates.allowed.copy()
                allowed[WORDS.index("forward")] = False
                candidates = dataclasses.replace(candidates, allowed=allowed)
            return candidates, poses

    world, moves = line_world(), OneWay()
    plan = VnlaTeacher(moves).plan(world)
    for turn in range(12):
        pose = Pose(3, turn)
        for action in (plan.action(pose, (0,)), plan.action_to(pose, Pose(0, 0))):
            assert moves.at(world, pose)[0].allowed[action]
        with pytest.raises(ValueError, match="can be reached"):
            plan.count(pose, (0,))


def test_the_teacher_turns_round_and_walks_the_line():
    world, teacher = line_world(), VnlaTeacher()
    words, end = teacher.plan(world).words(Pose(0, 6), (3,), 20)
    assert len(words) == 6 - 1 + 3 + 1, "40 degrees beside the line is near enough: five turns, three steps, stop"
    assert (words[-4:], end.node) == (("forward", "forward", "forward", "stop"), 3)
    assert set(words[:-4]) in ({"left"}, {"right"})


def test_help_costs_no_step_and_stays_in_front_of_the_request():
    env = line_env()
    o = env.reset(TASK)
    assert (o.time, o.requests_left, bool(o.can_ask)) == (0, 2, True)
    o = env.step(Ask())
    assert (o.time, o.requests_left, o.can_ask) == (0, 1, ()), "the same step goes on, with a move"
    assert o.instruction == "turn 120 degrees left . find a mug"
    with pytest.raises(ActionError):
        env.step(Ask())
    o = env.step(go("left"))
    assert (o.time, o.instruction[:4], o.mode) == (1, "turn", Mode.MAIN)
    o = env.step(Ask())
    o = env.step(go("left"))
    assert o.requests_left == 0 and o.can_ask == (), "the budget is spent"
    assert env.step(Stop()) is None, "stopping ends the episode even inside a sub-goal"
    assert env.episode().requests == 2


def test_a_budget_of_zero_cannot_ask():
    env = line_env()
    assert env.reset(dataclasses.replace(TASK, budget=0)).can_ask == ()


def test_a_fractional_budget_is_rounded_up_with_its_probability_and_repeatably():
    env, given = line_env(), []
    for seed in range(300):
        given.append(env.reset(dataclasses.replace(TASK, budget=1.25), seed=seed).requests_left)
        assert env.reset(dataclasses.replace(TASK, budget=1.25), seed=seed).requests_left == given[-1]
    assert set(given) == {1, 2} and 0.15 < np.mean(given) - 1 < 0.35


def test_algorithm_6_overwrites_costs_a_step_and_resumes():
    env = line_env(Algorithm6Env)
    env.reset(TASK)
    o = env.step(Ask())
    assert (o.time, o.mode, o.instruction, env.pose) == (1, Mode.SUB, "turn 120 degrees left", TASK.start)
    o = env.step(Stop())
    assert (o.time, o.mode, o.instruction) == (2, Mode.MAIN, "find a mug")
    assert env.step(Stop()) is None


def test_the_teacher_of_algorithm_6_does_what_was_said_before_it_stops():
    """A sub-goal of turns ends where the agent stands: by its node alone the teacher said stop at once."""
    teacher, env = VnlaTeacher(), line_env(Algorithm6Env)
    env.reset(dataclasses.replace(TASK, horizon=60))
    env.step(Ask())
    said = []
    while env.mode is Mode.SUB:
        said.append(teacher.label(env.situation).move)
        env.step(said[-1])
    assert said == [go("left")] * 4 + [Stop()]
    assert (env.pose.node, env.instruction, env.ended) == (0, "find a mug", None)


def test_asking_first_and_obeying_the_teacher_of_algorithm_6_arrives_in_the_time_it_is_given():
    world, teacher, tasks, make = grid_setup(Algorithm6Env)
    for task in tasks:
        task, env = fitted(dataclasses.replace(task, budget=2), world, "algorithm-6"), make()
        env.reset(task)
        while env.ended is None:
            ask = env.observation.mode is Mode.MAIN and env.observation.can_ask
            env.step(Ask() if ask else teacher.label(env.situation).move)
        assert env.ended == "stop" and metrics.success(env.episode(), world.graph), task.id
        again = teacher.relabel(env.episode(), world)
        moves = [(s.action, x.move) for s, x in zip(env.episode().steps, again, strict=True) if x.move is not None]
        assert all(a == b for a, b in moves), "what is said of a finished episode is what was said in it"


def test_direct_intervention_acts_in_the_agents_place():
    env = line_env(DirectVnlaEnv)
    env.reset(TASK)
    for _ in range(2):
        env.step(Ask())
        for _ in range(4):
            env.step(go("up") if env.observation.candidates.allowed[3] else go("down"))
    assert env.pose.node == 3
    env.step(Stop())
    assert metrics.success(env.episode(), line_world().graph) == 1


def test_direct_intervention_may_be_silent():
    env = line_env(MuteDirectVnlaEnv)
    env.reset(TASK)
    assert env.step(Ask()).instruction == "find a mug"
    env.step(go("down"))
    assert env.pose == Pose(0, 7), "it was turned to the left all the same"


@pytest.mark.parametrize("rules", RULES_OF_PLAY)
def test_every_rule_is_chosen_by_name_and_the_teacher_wins_in_time(rules):
    world = grid_world()
    tasks = grid_setup()[2][:8]
    make = VNLA.environments(EnvInputs({"grid": world}, rules=rules))
    tasks = VNLA.tasks_under(tasks, {"grid": world}, rules)
    assert type(make()) is RULES_OF_PLAY[rules]
    episodes = play(make, Shortest(VnlaTeacher()), tasks, seed=0)
    assert all(metrics.success(e, world.graph) and e.ended == "stop" for e in episodes)


def test_rules_that_are_none_are_refused_with_those_that_are():
    with pytest.raises(ValueError, match="use one of .*algorithm-6"):
        VNLA.environments(EnvInputs({}, rules="algorithm 7"))
    with pytest.raises(ValueError, match="'find' have no rules to choose, got 'direct'"):
        FIND.environments(EnvInputs({}, rules="direct"))


@pytest.mark.slow
def test_asking_all_the_way_and_listening_arrives_and_the_deaf_do_not():
    world, _, tasks, make = grid_setup()

    def rate(ask: str, budget: float) -> float:
        given = [dataclasses.replace(t, budget=budget) for t in tasks]
        episodes = play(make, VnlaAsking(SubgoalListener(), ask), given, seed=0)
        return float(np.mean([metrics.success(e, world.graph) for e in episodes]))

    assert rate("first", 30) == 1, "the sentence alone carries the actions"
    none, first, chance, teacher = (rate(ask, 3) for ask in ("none", "first", "random", "teacher"))
    assert none < chance < teacher and none < first < teacher, (none, first, chance, teacher)


def test_sub_goals_survive_being_said_and_heard():
    for words in (("left", "left", "forward", "stop"), ("up", "up", "forward", "forward"), ("right", "down", "stop")):
        assert heard_subgoal(PlainLanguage().subgoal(words) + " . find a mug in a kitchen") == words
    assert heard_subgoal("find a mug in a kitchen") == ()


# When to ask


def situation(env, **changes):
    return dataclasses.replace(env.situation, **changes)


def think(best: int, p: float) -> Thought:
    moves = np.full(6, (1 - p) / 5)
    moves[best] = p
    return Thought(moves)


def test_the_rules_of_asking_in_their_order(monkeypatch):
    env = line_env()
    env.reset(TASK)
    sure = think(1, 0.99)
    assert ask_reason(env.situation, sure) is None
    assert ask_reason(env.situation, think(1, 0.3)) == "uncertain"
    assert ask_reason(situation(env, requests_left=0), think(1, 0.3)) is None
    assert ask_reason(situation(env, trail=(1,) * 9), sure) == "unmoved"
    assert ask_reason(situation(env, trail=(1,) * 8), sure) is None
    assert ask_reason(situation(env, time=18), sure) == "remain"
    assert ask_reason(situation(env, trail=(0, 3)), think(0, 0.3)) == "arrive", "before 'uncertain'"
    monkeypatch.setattr("embodied.teachers.vnla.DEVIATE", 1.9)
    away = situation(env, trail=(1, 0), task=dataclasses.replace(TASK, start=Pose(1)))
    assert ask_reason(away, sure) == "deviate"


def test_relabelling_repeats_what_the_teacher_would_have_said():
    world, teacher, tasks, make = grid_setup(n=8)
    for e in play(make, VnlaAsking(Shortest(teacher), "first"), tasks, seed=0):
        labels = teacher.relabel(e, world)
        assert all(isinstance(s.action, Ask) or s.action == x.move for s, x in zip(e.steps, labels, strict=True))


# Time


def test_evaluation_limits_come_from_training():
    ways = [("hall", "kitchen", 10), ("hall", "kitchen", 14), ("hall", "bath", 9), ("a", "b", 25), ("a", "b", 25)]
    limits = {("hall", "kitchen"): round(12 + 1.95 * 2), ("hall", "bath"): 25, ("a", "b"): 25}
    assert time_limits(ways, 25) == limits


def test_the_expert_has_the_time_that_it_needs():
    world, teacher, _, _ = grid_setup()
    plan = teacher.plan(world)
    pool = vnla_pool(world, plan, seed=0)
    for i in range(20):
        task = vnla_task(pool, i, world, plan, seed=0, language=PlainLanguage())
        assert plan.count(task.start, task.goal_nodes) == task.horizon <= MOST_ACTIONS
