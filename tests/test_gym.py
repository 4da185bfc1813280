"""Gymnasium: the checker, vector environments, masks, rewards, pictures, and a learner off the shelf."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hand_data import DATA_KINDS
from hand_worlds import grid_world

import embodied.gym.env
from embodied.assistants.descriptions import word_number, words
from embodied.envs.base import ActionError
from embodied.envs.hari import Costs, HariRules
from embodied.gym.spaces import SpaceLayout, number
from embodied.interface import Ask, Intention, Reply, Stop, Subtask
from embodied.kinds.plugins import shipped_kinds
from embodied.teachers.shortest import shortest_action


def make(kind: str, tmp: str, **options):
    return embodied.gym.env.make(kind, cache=tmp, worlds={"grid": grid_world()}, observations="oracle", **options)


@pytest.fixture
def tmp(tmp_path) -> str:
    return str(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("kind", DATA_KINDS)
def test_the_environment_checker_has_nothing_to_say(kind, tmp):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        name, worlds = f"embodied/{shipped_kinds()[kind]}-v0", {"grid": grid_world()}
        env = gym.make(name, cache=tmp, worlds=worlds, observations="oracle", render_mode="rgb_array")
        check_env(env.unwrapped, skip_render_check=False)


@pytest.mark.slow
def test_the_rules_of_vnla_and_its_rooms_are_chosen_by_name(tmp):
    env = make("vnla", tmp, rules="algorithm-6", rooms=False)
    env.reset(seed=0)
    assert type(env._env).__name__ == "Algorithm6Env" and all(t.goal.room_kind is None for t in env._tasks)
    with pytest.raises(ValueError, match="unknown rules"):
        make("vnla", tmp, rules="algorithm 7")


@pytest.mark.slow
@pytest.mark.parametrize("imports", ["embodied, gymnasium", "gymnasium, embodied", "embodied.interface, gymnasium"])
def test_import_embodied_registers_in_any_order(imports):
    code = (
        f"import sys, {imports}; print([gymnasium.spec(f'embodied/{{n}}-v0').kwargs for n in "
        f"{[*shipped_kinds().values()]}], sys.modules.keys() & {{'mujoco', 'torch', 'embodied.gym.env'}})"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=600)
    assert done.stdout.strip() == f"{[{'kind': kind} for kind in shipped_kinds()]} set()"


def test_a_forbidden_action_changes_nothing_and_says_so(tmp):
    env = make("hanna", tmp, patience=2)
    before, _ = env.reset(seed=0)
    bad = int(np.flatnonzero(before["action_mask"] == 0)[0])
    after, _, terminated, truncated, info = env.step(bad)
    assert "does not exist" in info["invalid_action"] and not terminated and not truncated
    assert all(np.array_equal(before[k], after[k]) for k in before)
    assert env.step(bad)[3], "patience is over"
    strict = make("hanna", tmp, strict=True)
    strict.reset(seed=0)
    with pytest.raises(ActionError):
        strict.step(bad)
    with pytest.raises(ActionError, match="action 9999 does not exist; use 0 to"):
        strict.unwrapped.step(9999)


class Guide:
    """Sends whoever asks to the nearest goal, without a word of where the way starts."""

    def intentions(self, situation):
        return (Intention.HELP,)

    def answer(self, situation, question, *, rng):
        goal = situation.task.goal_nodes[0]
        return Reply("over there", subtask=Subtask("own", goal, start=None, goal=goal))


def test_request_instruction_and_ways_on_are_in_every_info_also_after_a_reply(tmp):
    env = make("hanna", tmp, assistant=Guide())
    _, info = env.reset(seed=0)
    assert info["request"] == info["instruction"] == env.task.request
    request, before = info["request"], env.pose
    observation, _, _, _, info = env.step(number(Ask(), SpaceLayout()))
    assert (info["request"], info["instruction"], env.pose) == (request, "over there", before)
    moves = np.flatnonzero(observation["action_mask"][: SpaceLayout().candidates])
    assert [c["action"] for c in info["candidates"]] == moves.tolist()
    headings = np.arctan2(*observation["candidates"][moves, :2].T)
    assert [c["heading"] for c in info["candidates"]] == pytest.approx(headings.tolist())
    assert all(("left" in c["text"]) == (0.1 < c["heading"] < 2.9) for c in info["candidates"])


def test_an_assistant_is_named_by_module_and_class_and_refused_where_nobody_is_asked(tmp):
    options = {"worlds": {"grid": grid_world()}, "observations": "oracle", "assistant": "test_gym:Guide"}
    envs = gym.make_vec("embodied/HANNA-v0", 2, cache=tmp, **options)
    envs.reset(seed=0)
    *_, info = envs.step(np.full(2, number(Ask(), SpaceLayout())))
    assert list(info["instruction"]) == ["over there"] * 2
    with pytest.raises(ValueError, match="importable module, got 'test_gym:Nobody'"):
        make("hanna", tmp, assistant="test_gym:Nobody")
    with pytest.raises(ValueError, match="nobody is asked in tasks of kind 'find'"):
        make("find", tmp, assistant=Guide())


@pytest.mark.slow
def test_the_expert_earns_one_minus_its_steps_and_shaping_telescopes(tmp):
    for shaping in (False, True):
        env = make("find", tmp, shaping=shaping)
        env.reset(seed=2)
        inner, total, done, n = env._env, 0.0, False, 0
        start = env._env.potential()
        while not done:
            s = inner.situation
            action = shortest_action(s.world.graph, s.pose, s.targets, s.candidate_nodes)
            _, reward, done, _, info = env.step(number(action, SpaceLayout()))
            total, n = total + reward, n + 1
        assert info["success"] == 1 and info["spl"] == pytest.approx(1)
        assert total == pytest.approx(1 - 0.01 * n + (start if shaping else 0))


def test_haris_variants_are_chosen_by_name(tmp):
    cheap, dear = (make("hari", tmp, rules=HariRules(Costs.alike(c), stack=1, horizon=4)) for c in (0.0, 0.5))
    for env in (cheap, dear):
        env.reset(seed=0)
    ask = number(Ask(Intention.CUR), SpaceLayout())
    assert [env.step(ask)[1] for env in (cheap, dear)] == [0.0, -0.5]
    assert [dear.step(ask)[3] for _ in range(3)] == [False, False, True], "the horizon is 4"
    usual = make("hari", tmp)
    assert usual.reset(seed=0)[0]["goals"].shape == (3, 21, 5)
    assert usual.step(ask)[1] == pytest.approx(-0.01) and usual.step(number(Stop(), SpaceLayout()))[1] <= -4
    with pytest.raises(ValueError, match="have no rules to choose"):
        make("find", tmp, rules=HariRules(stack=1))


def test_the_picture_shows_view_plan_and_words(tmp):
    env = make("hanna", tmp, render_mode="rgb_array")
    env.reset(seed=0)
    image = env.render()
    assert image.shape[0] == 544 and image.shape[1] > 900 and image.dtype == np.uint8 and image.std() > 10


def test_too_many_candidates_are_an_error_that_names_the_remedy(tmp):
    env = make("find", tmp, layout=SpaceLayout(candidates=1))
    with pytest.raises(ValueError, match="enlarge SpaceLayout"):
        env.reset(seed=0)


@pytest.mark.slow
def test_words_of_descriptions_have_the_numbers_of_the_catalogue_in_every_process():
    code = (
        "from embodied.assistants.descriptions import word_number, words\n"
        "print([word_number(w) for w in ('mug', 'kitchen', 'go', 'rug', 'my own thing')], len(words()))"
    )
    seed = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    other = {**os.environ, "PYTHONHASHSEED": seed}
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, env=other).stdout
    mine = [word_number(w) for w in ("mug", "kitchen", "go", "rug", "my own thing")]
    assert said == f"{mine} {len(words())}\n"
    numbers = [word_number(w) for w in words()]
    assert numbers == list(range(1, len(words()) + 1)), "every word a number of its own, whatever was met first"
    assert word_number("my own thing") > len(words())
