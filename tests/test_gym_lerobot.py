"""Environments for LeRobot: what lerobot-eval asks of them, over hand-made houses."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from conftest import two_rooms
from gymnasium.utils.env_checker import check_env
from handmade import HandCatalogue, furnished

from embodied.envs.continuous import POSITION
from embodied.gym.lerobot import ENVS, hub_file, make_env, make_one
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

    monkeypatch.setattr(continuous, "flat_worlds", lambda *_: {world.name: world})
    hub_file(tmp_path / "env.py", "VLNCE", seed=4, **SMALL)
    spec = importlib.util.spec_from_file_location("hub_env", tmp_path / "env.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    envs = module.make_env(n_envs=1, use_async_envs=False, cfg=None)["embodied/VLNCE-v0"][0]
    assert envs.reset(seed=0)[0]["pixels"].shape == (1, 32, 32, 3)
    with pytest.raises(ValueError, match="use one of"):
        make_env(env="Arena")
