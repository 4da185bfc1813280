"""Ask-v0: questions have a price and true answers; nothing of the goal reaches the agent unasked."""

from __future__ import annotations

import dataclasses
import functools
import json
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hand_worlds import grid_world

from embodied.agents.ask.learned import CHOICES, Foresight, LearnedAsker, facts, fit
from embodied.agents.ask.study import AskStudy
from embodied.agents.language_models.agent import QUESTION_WORDS
from embodied.agents.learners.ask import AskerConfig, AskEvaluation
from embodied.agents.studies.engine import run_study
from embodied.assistants.ask import in_view
from embodied.cli import main as start
from embodied.envs.ask import AskSettings, Prices
from embodied.evaluation import tables
from embodied.evaluation.evaluate import late_env, play, read_seeds, submitted
from embodied.gym.env import HelpGymEnv
from embodied.gym.sensors import SensorSuite
from embodied.gym.spaces import SpaceLayout, number
from embodied.interface import Ask, Intention, Move, Pose, Stop
from embodied.kinds.metrics import ask_counts, success
from embodied.kinds.shipped.ask import ASK, ask_environments, price, success_progress, weighted_success
from embodied.language.templates import intention_of
from embodied.policies.ask import ASKER_RULES, COLLECT, Asker, CollectThenSplit, EpisodeMemory
from embodied.records import from_json, to_json
from embodied.tasks.ask import AMBIGUOUS, ask_pool, ask_tasks

LITTLE = AskerConfig(hidden_size=16, passes=300)
TYPED = (Intention.CONFIRM, Intention.APPEARANCE, Intention.REGION, Intention.ROUTE, Intention.DISAMBIGUATE)
CHAIRS = ("red", "red", "blue", "blue")


def ask_world():
    """The grid with four chairs, two red and two blue, one in each room."""
    world = grid_world()
    house = world.house
    (mug,) = [p for p in house.placements if p.id == "mug_1"]
    corners = {
        "kitchen_1": (1.2, 0.8),
        "bedroom_1": (11.0, 0.8),
        "living_room_1": (1.0, 11.0),
        "bathroom_1": (11.0, 11.2),
    }
    chairs = tuple(
        dataclasses.replace(mug, id=f"chair_{i}", object_class="chair", room=room, position=(*at, 0.0), asset=colour)
        for i, ((room, at), colour) in enumerate(zip(corners.items(), CHAIRS))
    )
    return dataclasses.replace(world, house=dataclasses.replace(house, placements=(*house.placements, *chairs)))


def look(placement) -> tuple[str, ...]:
    return (placement.asset,) if placement.object_class == "chair" else ()


@pytest.fixture(scope="module")
def world():
    return ask_world()


@pytest.fixture(scope="module")
def tasks(world):
    return ask_tasks(ask_pool(world, look, seed=0), 20, seed=0)


@pytest.fixture
def make_env(world):
    return ask_environments({"grid": world}, look)


def at_target(task, world) -> Pose:
    return dataclasses.replace(task.start, node=task.goal_nodes[0])


def test_the_stated_share_of_requests_is_ambiguous_and_all_can_be_solved(world, tasks, make_env):
    assert sum(len(t.goal.fitting) > 1 for t in tasks) == round(AMBIGUOUS * len(tasks))
    for t in tasks:
        assert t.goal.placement in t.goal.fitting and not set(t.goal.fitting) & set(t.goal.similar)
        assert all(word in t.request for word in (*t.goal.words, t.goal.object_class))
        for node in t.goal_nodes:
            assert in_view(world, node, t.goal)[0][0] == t.goal.placement, "what is nearest there is what is meant"
    episodes = play(make_env, ASK.agent("oracle"), tasks, seed=0)
    assert all(success(e, world.graph) == 1 for e in episodes)
    assert [from_json(type(t), to_json(t)) for t in tasks] == tasks


def test_task_j_is_the_same_however_many_are_drawn(world, tasks):
    assert ask_tasks(ask_pool(world, look, seed=0), 7, seed=0) == tasks[:7]


def test_every_answer_is_true_and_costs_its_price_and_a_step(world, tasks, make_env):
    env, prices = make_env(), Prices()
    for t in tasks:
        env.reset(t)
        for question in (Intention.REGION, Intention.APPEARANCE, Intention.ROUTE):
            before = env.time
            o = env.step(Ask(question))
            reply = env.last_step.reply
            assert t.goal.placement not in reply.ruled_out and env.last_step.cost == prices.of(question)
            assert env.time == before + 1 and reply.text in o.instruction
        kind = world.house.room_by_id[world.house.placement_by_id[t.goal.placement].room].kind
        region = env._steps[0].reply.text
        assert kind.replace("_", " ") in region
        assert o.extras.advised is not None


def test_confirm_says_yes_at_the_thing_that_is_meant_and_no_elsewhere(world, tasks, make_env):
    env = make_env()
    for t in tasks:
        for goal in (t.goal.placement, *t.goal.fitting):
            node = next(n for n in range(36) if (v := in_view(world, n, t.goal)) and v[0][0] == goal and v[0][2] <= 2.0)
            o = env.reset(dataclasses.replace(t, start=dataclasses.replace(t.start, node=node)))
            assert Intention.CONFIRM in o.can_ask
            nearest = min(o.extras.detections, key=lambda d: d.distance)
            o = env.step(Ask(Intention.CONFIRM))
            yes = goal == t.goal.placement
            assert env.last_step.reply.text.startswith("Yes" if yes else "No")
            now = min(o.extras.detections, key=lambda d: d.distance)
            assert now.score == nearest.score if yes else now.score < nearest.score


def test_a_thing_that_is_far_cannot_be_confirmed(world, tasks, make_env):
    for node in range(36):
        t = dataclasses.replace(tasks[0], start=Pose(node))
        o = make_env().reset(t)
        seen = in_view(world, node, t.goal)
        assert (Intention.CONFIRM in o.can_ask) == bool(seen and seen[0][2] <= 2.0)


def test_nothing_of_the_goal_is_seen_before_it_is_asked_for(world, tasks, make_env):
    """Tasks alike but for which of the things is meant give equal observations under equal moves."""
    t = next(t for t in tasks if len(t.goal.fitting) > 1)
    others = []
    for p in t.goal.fitting:
        env = make_env()
        o = env.reset(dataclasses.replace(t, goal=dataclasses.replace(t.goal, placement=p)))
        seen = [o]
        for _ in range(10):
            o = env.step(Move(0))
            seen.append(o)
        others.append(seen)
    assert all(seen == others[0] for seen in others)


def test_without_grounding_answers_come_in_words_alone(world, tasks):
    env = ask_environments({"grid": world}, look, AskSettings(grounded=False))()
    for t in tasks[:6]:
        first = env.reset(t)
        o = env.step(Ask(Intention.ROUTE))
        assert o.extras.advised is None and o.extras.detections == first.extras.detections
        assert o.instruction != first.instruction


def test_a_free_question_is_answered_by_what_it_means_or_not_at_all(tasks, make_env):
    env = make_env()
    env.reset(tasks[0])
    env.step(Ask(Intention.FREE, question="In which room should I look?"))
    assert env.last_step.reply.text.startswith("It is in")
    env.step(Ask(Intention.FREE, question="Do you like me?"))
    assert env.last_step.reply.text == "I do not know." and not env.last_step.reply.ruled_out


@pytest.mark.parametrize("kind", ["confirm", "disambiguate", "region", "route", "appearance", "none"])
def test_questions_as_people_type_them_are_understood(kind):
    text = (Path(__file__).parent / "data" / "free_questions.txt").read_text()
    questions = text.split(f"[{kind}]\n")[1].split("\n[")[0].splitlines()
    meant = {q: (i := intention_of(q)) and i.value for q in questions if q}
    assert len(meant) >= 40 and {q: m for q, m in meant.items() if (m or "none") != kind} == {}


def test_the_questions_that_agents_word_are_understood_as_they_are_meant():
    assert all(intention_of(QUESTION_WORDS[i]) is i for i in TYPED)


def test_following_told_routes_always_arrives(world, tasks, make_env):
    episodes = play(make_env, Asker(ASKER_RULES["always route"]), tasks, seed=0, batch=4)
    assert all(success(e, world.graph) == 1 for e in episodes)
    assert all(price(e, world.graph) == pytest.approx(0.2 * e.requests) for e in episodes)


def test_asking_pays_and_episodes_do_not_depend_on_the_batch(world, tasks, make_env):
    """Here, where four chairs look alike, asking at each whether it is the one finds more than never asking."""
    rate = {}
    for name in ("never ask", "confirm on sight"):
        alone = play(make_env, Asker(ASKER_RULES[name]), tasks, seed=0)
        assert [to_json(e) for e in play(make_env, Asker(ASKER_RULES[name]), tasks, seed=0, batch=7)] == [
            to_json(e) for e in alone
        ]
        rate[name] = np.mean([weighted_success(e, world.graph) for e in alone])
    assert rate["confirm on sight"] > rate["never ask"]


def test_measures_by_hand(world, tasks, make_env):
    t = tasks[0]
    env = make_env()
    env.reset(dataclasses.replace(t, start=at_target(t, world)))
    for q in (Intention.CONFIRM, Intention.REGION, Intention.ROUTE):
        env.step(Ask(q))
    env.step(Stop())
    won = env.episode()
    env.reset(dataclasses.replace(t, id="grid/ask/lost"))
    env.step(Ask(Intention.APPEARANCE))
    env.step(Stop())
    lost = env.episode()
    graph = world.graph
    assert price(won, graph) == pytest.approx(0.3) and weighted_success(won, graph) == pytest.approx(0.7)
    assert success_progress(won, graph) == pytest.approx(3 / 5) and weighted_success(lost, graph) == 0
    row = tables.row("by hand", "x", [won, lost], {"grid": graph}, seed=0)
    assert row.values["price per success"].mean == pytest.approx(0.35)
    assert row.values["asks confirm"].mean == 0.5 and "model calls" not in row.values
    assert "weighted success (%)" in tables.markdown([row])


def test_a_question_was_needed_if_it_rules_something_out(world, tasks, make_env):
    vague = next(t for t in tasks if len(t.goal.fitting) > 1)
    clear = next(t for t in tasks if len(t.goal.fitting) == 1)

    def counts(task, *questions):
        env = make_env()
        env.reset(dataclasses.replace(task, start=at_target(task, world)))
        for q in questions:
            env.step(Ask(q))
        env.step(Stop())
        return dataclasses.astuple(ask_counts(env.episode(), world.graph))

    assert counts(vague) == (0, 0, 1) and counts(vague, Intention.CONFIRM, Intention.REGION) == (2, 1, 0)
    assert counts(vague, Intention.ROUTE) == (1, 1, 0), "a route that is told to its end says which it is"
    assert counts(clear, Intention.ROUTE, Intention.CONFIRM) == (2, 0, 0)


def test_nobody_can_be_asked_before_the_moment(tasks, make_env):
    asks = Asker(ASKER_RULES["always route"])
    for share in (0.1, 0.5, 1.0):
        for e in play(functools.partial(late_env, make_env, share), asks, tasks[:6], seed=0):
            times = [t for t, s in enumerate(e.steps) if s.reply]
            assert all(t >= share * e.task.horizon for t in times) and (not times) == (share == 1 or len(e.steps) < 7)


def test_who_collects_first_asks_only_what_splits_the_pool(world, tasks, make_env):
    episodes = play(make_env, CollectThenSplit(), tasks, seed=0)
    assert np.mean([success(e, world.graph) for e in episodes]) > 0.5
    for e in episodes:
        first = next((t for t, s in enumerate(e.steps) if s.reply), None)
        assert first is None or first >= COLLECT * e.task.horizon
        assert len([s for s in e.steps if s.reply and s.action.intention is not Intention.CONFIRM]) <= 1


def test_the_environment_checker_has_nothing_to_say(make_env, tasks):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = HelpGymEnv(make_env, tasks, SensorSuite(), layout=SpaceLayout.of(ASK), render_mode="rgb_array")
        check_env(env, skip_render_check=True)
    assert env.render().ndim == 3
    assert gym.spec("embodied/Ask-v0").kwargs == {"kind": "ask"}
    env.reset(seed=0)
    assert env.step(number(Ask(Intention.REGION), env.layout))[-1]["price"] == Prices().region


# Judging others ---------------------------------------------------------------------------------


def test_a_submitted_folder_is_judged_and_may_not_see_situations(tmp_path, tasks, make_env):
    with pytest.raises(ValueError, match=r"agent\.py"):
        submitted(str(tmp_path))
    file = tmp_path / "agent.py"
    file.write_text(
        "from embodied.interface import Stop\nclass A:\n"
        "    def act(self, o, m, *, rngs):\n        return [Stop() if x else None for x in o], ()\n"
        "def make_agent():\n    return A()\n"
    )
    (episode,) = play(make_env, submitted(str(tmp_path)), tasks[:1], seed=0)
    assert episode.ended == "stop" and len(episode.steps) == 1
    file.write_text("from embodied.policies.baselines import Shortest as make_agent\n")
    with pytest.raises(ValueError, match="not shown the situations"):
        submitted(str(tmp_path))


def test_a_list_of_seeds_is_read_and_checked(tmp_path):
    file = tmp_path / "seeds.txt"
    file.write_text("# ours\n12\n-3  # small\n")
    assert read_seeds(file) == [12, -3]
    file.write_text("12\nx\n")
    with pytest.raises(ValueError, match=r"seeds.txt:2"):
        read_seeds(file)


# Who learns to ask ------------------------------------------------------------------------------


def test_the_oracle_of_asking_improves_on_the_rule_that_it_thinks_ahead_with(world, tasks, make_env):
    def value(agent) -> float:
        return float(np.mean([weighted_success(e, world.graph) for e in play(make_env, agent, tasks[:6], seed=0)]))

    assert value(Foresight(make_env)) > value(Asker(ASKER_RULES["confirm on sight"])), (
        "which it goes on with in its head"
    )


def test_the_learned_asker_learns_a_rule_from_what_the_agent_knows(world, tasks, make_env):
    """It is taught that asking for the way at once is worth most, and does so."""
    known = np.stack([facts(make_env().reset(t), EpisodeMemory()) for t in tasks])
    worth = np.zeros((len(tasks), len(CHOICES)))
    worth[:, CHOICES.index(Intention.ROUTE)], worth[:, CHOICES.index(Intention.CONFIRM)] = 1.0, np.nan
    net = fit((known, worth), LITTLE)
    episodes = play(make_env, LearnedAsker(net), tasks[:4], seed=0)
    for batch in (5, 32):
        together = play(make_env, LearnedAsker(net), tasks, seed=0, batch=batch)
        assert [to_json(e) for e in together[:4]] == [to_json(e) for e in episodes]
    assert all(isinstance(e.steps[0].action, Ask) and e.steps[0].action.intention is Intention.ROUTE for e in episodes)


def test_a_study_trains_by_dagger_judges_and_draws(world, tasks, make_env, tmp_path, monkeypatch):
    monkeypatch.setattr("embodied.agents.ask.study.houses", lambda *_: ({"grid": world}, make_env, look))
    config = dataclasses.replace(LITTLE, houses=1, tasks=1, rounds=1, round_tasks=1, passes=10)
    sizes = AskEvaluation(test_houses=1, test_tasks=2, oracle_tasks=1, model_tasks=1)
    model = lambda places: Asker(ASKER_RULES["always route"])
    study = AskStudy(tmp_path, config, sizes, (0, 1), model=model, model_about={"model": "scripted"})
    rows = ["never ask", "always route", "learned asker", "language model", "oracle of asking"]
    quiet = lambda line: None
    run_study(study, ["houses"], tmp_path, rows=rows, note=quiet)
    found = {r["label"]: r["values"] for r in json.loads((tmp_path / "ask-houses.json").read_text())["rows"]}
    assert [found[r]["success_unseen_houses"]["n"] for r in rows] == [2, 2, 4, 1, 1]
    assert found["language model"]["success_unseen_houses"]["mean"] == 100
    assert found["never ask"]["price_unseen_houses"]["mean"] == 0
    made = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*.safetensors")}
    late = [f"always route, from {share} %" for share in (0, 50, 100)]
    run_study(study, ["moments"], tmp_path, rows=[*late, "learned asker, from 100 %"], note=quiet)
    found = {r["label"]: r["values"] for r in json.loads((tmp_path / "ask-moments.json").read_text())["rows"]}
    by_moment = [found[name]["ask_F1_unseen_houses"]["mean"] for name in late]
    assert by_moment[0] > by_moment[2] == 0 and (tmp_path / "ask-moments.png").exists()
    assert {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*.safetensors")} == made and len(made) == 2


@pytest.mark.slow
def test_the_command_judges_in_houses_of_hidden_seeds_and_does_not_tell_the_seeds(tmp_path, shared_cache, capsys):
    (tmp_path / "seeds.txt").write_text("918273645\n")
    words = f"evaluate ask --seed-file {tmp_path}/seeds.txt --tasks 4 --cache {shared_cache} --out {tmp_path}/out"
    assert start([*words.split(), "--sees", "nothing", "--agent", "never ask", "oracle"]) == 0
    assert "weighted success" in capsys.readouterr().out
    written = "".join(p.read_text() for p in (tmp_path / "out").rglob("*") if p.is_file())
    assert "918273645" not in written and '"world":"ask_0"' in written
