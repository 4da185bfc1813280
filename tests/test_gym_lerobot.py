"""Environments for LeRobot: what lerobot-eval asks of them, over hand-made houses."""

from __future__ import annotations

import importlib.util

import numpy as np
import pyarrow.parquet as pq
import pytest
from conftest import two_rooms
from gymnasium.utils.env_checker import check_env
from handmade import HandCatalogue, furnished

from embodied.envs.continuous import POSITION
from embodied.gym.lerobot import ENVS, hub_file, make_env, make_one, sizes
from embodied.gym.lerobot.drives import DRIVES, export_drives
from embodied.seeds import stream
from embodied.world import open_world

pytestmark = pytest.mark.gl
SMALL = {"height": 32, "width": 32}


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    with open_world(furnished(two_rooms()), HandCatalogue(), tmp_path_factory.mktemp("lerobot"), size=32) as w:
        yield w


@pytest.mark.parametrize("name", ENVS)
def test_a_rollout_of_lerobot_finds_what_it_asks_for(world, name):
    ((suite, tasks),) = make_env(2, env=name, worlds={world.name: world}, **SMALL).items()
    envs = tasks[0]
    assert suite == f"embodied/{name}-v0" and envs.call("_max_episode_steps")[0] >= 400
    o, _ = envs.reset(seed=[0, 1])
    assert o["pixels"].shape == (2, 32, 32, 3) and o["pixels"].dtype == np.uint8
    assert o["agent_pos"].dtype == np.float32 and o["agent_pos"].ndim == 2
    assert all(isinstance(text, str) and text for text in envs.call("task_description"))
    action = np.zeros(envs.action_space.shape, np.float32)
    action[:, -1 if name == "Drive" else 1] = 1.0
    *_, info = envs.step(action)
    assert info["is_success"].tolist() == [False, False]
    assert envs.render()[0].shape == (480, 640, 3)


def test_a_policy_that_scores_the_experts_action_highest_succeeds(world):
    env = make_one("VLNCE", worlds={world.name: world}, **SMALL)
    check_env(env, skip_render_check=True)
    env.reset(seed=3)
    expert, ended, seen = env.env.expert(along=True), False, []
    while not ended:
        scores = np.full(4, -1.0, np.float32)
        scores[expert.action()] = 1.0
        o, _, terminated, truncated, info = env.step(scores)
        seen.append(o["agent_pos"])
        ended = terminated or truncated
    assert info["is_success"] and len(seen[0]) == len(POSITION)
    assert np.allclose(np.hypot(seen[-1][2], seen[-1][3]), 1, atol=1e-6)


def test_the_hubs_file_makes_the_environment(world, tmp_path, monkeypatch):
    from embodied.gym import continuous

    monkeypatch.setattr(continuous, "chosen_worlds", lambda **_: ({world.name: world}, {}))
    hub_file(tmp_path / "env.py", "VLNCE", seed=4, **SMALL)
    spec = importlib.util.spec_from_file_location("hub_env", tmp_path / "env.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    envs = module.make_env(n_envs=1, use_async_envs=False, cfg=None)["embodied/VLNCE-v0"][0]
    assert envs.reset(seed=0)[0]["pixels"].shape == (1, 32, 32, 3)
    with pytest.raises(ValueError, match="use one of"):
        make_env(env="Arena")


@pytest.mark.parametrize("name", ENVS)
def test_the_blind_see_black_and_feel_the_same(world, name):
    (seeing, _), (blind, _) = (
        make_one(name, worlds={world.name: world}, **SMALL, **sees).reset(seed=2) for sees in ({}, {"observations": ()})
    )
    assert seeing["pixels"].any() and not blind["pixels"].any() and seeing["pixels"].shape == blind["pixels"].shape
    assert (seeing["agent_pos"] == blind["agent_pos"]).all()


@pytest.fixture(scope="module")
def drives(world, tmp_path_factory):
    home = tmp_path_factory.mktemp("drives")
    env = make_one("Drive", worlds={world.name: world}, farthest=4.0, **SMALL)
    tables = {}
    for noise in (0.0, 0.3):
        steps = export_drives(env, home / str(noise), 3, seed=5, action_noise=noise)
        tables[noise] = pq.read_table(next((home / str(noise) / "data").rglob("*.parquet"))).to_pydict()
        assert len(tables[noise]["index"]) == steps
    return tables


def test_whoever_takes_the_written_commands_sees_the_written_states_and_arrives(world, drives):
    table, env = drives[0.0], make_one("Drive", worlds={world.name: world}, farthest=4.0, observations=(), **SMALL)
    assert tuple(DRIVES[key][0].list_size for key in ("action", "observation.state")) == sizes("Drive")
    for k in range(3):
        mine = [i for i, number in enumerate(table["episode_index"]) if number == k]
        seed = int(stream(5, "drives", k).integers(2**31))
        o, _ = env.reset(seed=seed, options={"world": world.name})
        for i in mine:
            assert np.allclose(o["agent_pos"], table["observation.state"][i], atol=1e-5)
            o, _, terminated, _, info = env.step(np.array(table["action"][i], np.float32))
        assert terminated and info["is_success"] and table["next.success"][mine[-1]]


def test_who_wanders_is_elsewhere_and_is_told_what_the_expert_does_there(drives):
    straight, wandering = (np.array(drives[action_noise]["observation.state"]) for action_noise in (0.0, 0.3))
    assert np.ptp(wandering[:, 0]) > np.ptp(straight[:, 0]) + 0.1, "the expert never drives backwards"
    assert all(0 <= ahead <= 1 for ahead, _ in drives[0.3]["action"])
    assert sum(drives[0.3]["next.success"]) == 3
