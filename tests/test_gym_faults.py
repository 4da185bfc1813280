"""Environments under mistakes: nothing half-steps, nothing leaks, what is asked for is there or refused in words."""

from __future__ import annotations

import contextlib
import copy
import gc
import os
import pickle
import subprocess
import sys
import weakref
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from hand_data import built
from hand_pixels import pixels
from hand_worlds import grid_world
from test_gym import make

import embodied.gym.env
from embodied.datasets.store import Dataset
from embodied.envs.base import ActionError
from embodied.gym.env import HelpGymEnv
from embodied.gym.sensors import SensorSuite
from embodied.gym.spaces import SpaceLayout, number
from embodied.gym.vector_env import SharedSyncVectorEnv
from embodied.teachers.shortest import shortest_action

STOP = SpaceLayout().candidates


@pytest.fixture(scope="module")
def tmp(tmp_path_factory) -> str:
    return str(tmp_path_factory.mktemp("cache"))


def batch(tmp, n=3, **options) -> SharedSyncVectorEnv:
    return embodied.gym.vector_env.make_vec(
        "find", n, cache=tmp, worlds={"grid": grid_world()}, observations="oracle", **options
    )


def way_to_the_goal(env: HelpGymEnv) -> list[int]:
    """The actions of an expert, taken in `env`, until it stands at a goal."""
    taken = []
    while env.pose.node not in env.task.goal_nodes:
        s = env._env.situation
        action = shortest_action(s.world.graph, s.pose, s.targets, s.candidate_nodes)
        taken.append(number(action, SpaceLayout()))
        env.step(taken[-1])
    return taken


@pytest.mark.parametrize("count", [2, 4])
def test_a_batch_moves_no_slot_where_the_number_of_actions_is_wrong(tmp, count):
    envs = batch(tmp)
    envs.reset(seed=0)
    with pytest.raises(ValueError, match=f"{count} actions for 3 environments"):
        envs.step([0] * count)
    assert [env._env.time for env in envs.unwrapped.envs] == [0] * 3


def test_a_task_is_chosen_by_the_id_that_info_tells_or_by_number(tmp):
    env = make("find", tmp)
    _, info = env.reset(seed=3)
    number = [t.id for t in env._tasks].index(info["task"])
    for name in (info["task"], number, np.int64(number)):
        assert env.reset(options={"task": name})[1] == info
    for wrong in (-1, len(env._tasks), 10**9, "nowhere", 1.0, [0]):
        with pytest.raises(ValueError, match=r"there is no task .*name one by its id, such as 'grid/find.* 0 to \d+"):
            env.reset(options={"task": wrong})
    vector = batch(tmp)
    vector.reset(seed=1)
    assert list(vector.reset(options={"task": info["task"]})[1]["task"]) == [info["task"]] * 3


def test_seeds_are_integers_of_any_kind_and_nothing_else(tmp):
    env = make("find", tmp)
    same = [env.reset(seed=s)[1]["task"] for s in (3, np.int64(3), np.uint8(3))]
    assert len(set(same)) == 1 and batch(tmp).reset(seed=3)[1]["task"][0] == same[0]
    for wrong in ("3", 3.0):
        with pytest.raises(TypeError, match="a seed should be an integer, got"):
            env.reset(seed=wrong)


@pytest.mark.parametrize("wrong", [{"patience": -1}, {"patience": 0}, {"patience": 2.5}, {"render_mode": "human"}])
def test_options_are_refused_before_anything_is_opened(wrong, tmp_path):
    for maker in (embodied.gym.env.make, embodied.gym.vector_env.make_vec):
        with pytest.raises(ValueError, match=f"{next(iter(wrong))} should be"):
            maker("find", data="no/such/folder", cache=str(tmp_path), **wrong)


@pytest.mark.parametrize("kind", ["find", "hari"])
def test_every_last_info_has_success_is_success_and_spl(kind, tmp):
    env = make(kind, tmp, patience=1)
    observation, info = env.reset(seed=0)
    bad = int(np.flatnonzero(observation["action_mask"] == 0)[0])
    *_, truncated, given_up = env.step(bad)
    assert truncated and "success" not in info
    with pytest.raises(ActionError, match="the episode is over"):
        env.step(STOP)
    env.reset(seed=0)
    while True:
        *_, terminated, truncated, stopped = env.step(STOP)
        if terminated or truncated:
            break
    for last in (given_up, stopped):
        assert {"success", "spl", "navigation_error"} <= set(last)
        assert isinstance(last["is_success"], bool) and last["is_success"] == (last["success"] == 1)


@pytest.mark.parametrize("needs_stop", [False, True])
@pytest.mark.parametrize("mode", ["one", "vector_entry_point", "sync"])
def test_gymnasiums_limit_keeps_success_and_spl_in_the_last_info(tmp, mode, needs_stop):
    """It cuts an episode short without a word to the environment: here at the goal, or two steps before."""
    options = {"cache": tmp, "worlds": {"grid": grid_world()}, "observations": "oracle", "needs_stop": needs_stop}
    options["disable_env_checker"] = True
    env = make("find", tmp)
    env.reset(seed=2)
    way = way_to_the_goal(env)
    for steps in (len(way), len(way) - 2):
        options["max_episode_steps"] = steps
        if mode == "one":
            one = gym.make("embodied/Find-v0", **options)
        else:
            one = gym.make_vec("embodied/Find-v0", num_envs=1, vectorization_mode=mode, **options)
        one.reset(seed=2)
        ends = [one.step(a if mode == "one" else np.array([a])) for a in way[:steps]]
        last = {name: np.ravel(ends[-1][4][name])[0] for name in ("success", "is_success", "spl")}
        assert [bool(np.ravel(e[3])[0]) for e in ends] == [False] * (steps - 1) + [True]
        won = steps == len(way) and not needs_stop
        assert last == {"success": won, "is_success": won, "spl": pytest.approx(float(won))}


def test_an_environment_that_is_registered_again_has_its_limit_in_batches_too(tmp):
    known = gym.spec("embodied/Find-v0")
    kwargs = {**known.kwargs, "cache": tmp, "worlds": {"grid": grid_world()}, "observations": "oracle"}
    makers = {"entry_point": known.entry_point, "vector_entry_point": known.vector_entry_point}
    gym.register("mine/Find-v0", **makers, kwargs=kwargs, max_episode_steps=1)
    for env in (gym.make("mine/Find-v0"), gym.make_vec("mine/Find-v0", num_envs=2)):
        env.reset(seed=0)
        assert np.all(env.step(env.action_space.sample() * 0)[3])
    with pytest.raises(ValueError, match="max_episode_steps should be"):
        gym.make_vec("mine/Find-v0", num_envs=2, max_episode_steps=0)


def test_strict_success_needs_a_stop(tmp):
    found = {}
    for needs_stop in (False, True):
        env = make("find", tmp, patience=1, needs_stop=needs_stop)
        for last_word in ("nothing", "stop"):
            env.reset(seed=0)
            way_to_the_goal(env)
            forbidden = len(env._env.observation.candidates)
            info = env.step(STOP if last_word == "stop" else forbidden)[-1]
            found[needs_stop, last_word] = info["success"], info["is_success"], info["spl"]
    assert found[True, "nothing"] == (0.0, False, 0.0)
    assert found[True, "stop"] == found[False, "stop"] == found[False, "nothing"] == (1.0, True, 1.0)


def test_the_clock_is_of_the_size_of_other_numbers(tmp):
    for kind in ("find", "vnla"):
        observation, _ = make(kind, tmp).reset(seed=0)
        assert np.abs(observation["clock"]).max() <= 2 and (kind == "vnla" or observation["clock"][2] == -1)


@pytest.mark.slow
def test_a_data_set_that_is_dropped_keeps_none_of_its_houses(tmp_path):
    built(tmp_path / "data", "vnla")
    for _ in range(3):
        split = Dataset(tmp_path / "data").split("val_seen")
        env = HelpGymEnv(split.make_env, split.tasks, SensorSuite())
        env.reset(seed=0)
        places = [weakref.ref(place) for place in split.worlds.values()]
        assert all(place() is not None for place in places)
        del split, env
        gc.collect()
        assert [place() for place in places] == [None] * len(places)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> Path:
    cache = tmp_path_factory.mktemp("drawn")
    with contextlib.closing(pixels(cache)) as env:
        env._opened[0].render_all()
    return cache


@pytest.mark.gl
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_and_what_was_pickled_go_on_where_the_environment_was(drawn, copied):
    with contextlib.closing(pixels(drawn)) as env:
        env.reset(seed=1)
        env.step(0)
        for action in (0, STOP):
            other = copied(env)
            (a, *ends), (b, *others) = env.step(action), other.step(action)
            assert ends == others and all(np.array_equal(a[name], b[name]) for name in a)


@pytest.mark.gl
def test_environments_that_see_leave_no_houses_behind(drawn):
    houses = []
    for k in range(20):
        with contextlib.closing(pixels(drawn)) as env:
            assert env.reset(seed=k)[0]["rgb"].any()
            houses.append(weakref.ref(env._opened[0]))
        del env
    gc.collect()
    assert not any(house() for house in houses)


WORKERS = """
import functools, sys
from pathlib import Path
import gymnasium as gym, numpy as np
from embodied import gl
from hand_pixels import pixels

if __name__ == "__main__":
    make = functools.partial(pixels, Path(sys.argv[1]))
    batches = [gym.vector.AsyncVectorEnv([make], context=context) for context in ("fork", "spawn")]
    seen = [many.reset(seed=3)[0] for many in batches]
    assert gl._owner().context is None, "the parent has opened OpenGL"
    one = gym.vector.SyncVectorEnv([make])
    told, _ = one.reset(seed=3)
    for k in range(6):
        for found in seen:
            assert found["rgb"].any() and all((found[n] == told[n]).all() for n in told), k
        moves = np.where(told["action_mask"][:, k % 3], k % 3, 16)
        seen, told = [many.step(moves)[0] for many in batches], one.step(moves)[0]
    for batch in (*batches, one):
        batch.close()
    print("same")
"""


@pytest.mark.gl
@pytest.mark.slow
def test_gymnasiums_processes_forked_or_spawned_show_the_pictures_that_one_process_shows(drawn, tmp_path):
    script = tmp_path / "workers.py"
    script.write_text(WORKERS)
    paths = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    done = subprocess.run(
        [sys.executable, script, str(drawn)],
        capture_output=True,
        text=True,
        timeout=600,
        env={**os.environ, "PYTHONPATH": paths},
    )
    assert done.stdout.strip() == "same", done.stderr[-3000:]
