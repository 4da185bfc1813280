"""Pixels in environments: what is shown is what the panoramas hold, batches share them, and bad wishes are refused."""

from __future__ import annotations

import math
from unittest.mock import Mock

import gymnasium as gym
import numpy as np
import pytest
from hand_data import built, random_encoder
from hand_pixels import tasks_in, world_in
from hand_worlds import grid_world

import embodied.gym.env
from embodied.agents.vision.features import encode_panoramas
from embodied.agents.vision.live import LiveFeatures
from embodied.envs.base import HelpEnv
from embodied.gym import sensors as module
from embodied.gym.env import HelpGymEnv
from embodied.gym.sensors import (
    FAR,
    HOUSES_CHANGED,
    CameraSensor,
    FeatureSensor,
    PanoramaStore,
    SensorSuite,
    ViewSettings,
)
from embodied.gym.spaces import SpaceLayout, number
from embodied.gym.vector_env import SharedSyncVectorEnv
from embodied.interface import Move, Sight, Stop

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    with world_in(tmp_path_factory.mktemp("pixels")) as w:
        w.render_all()
        yield w


def env_of(world, sensor) -> HelpGymEnv:
    return HelpGymEnv(lambda: HelpEnv({world.name: world}), tasks_in(world), sensor, layout=SpaceLayout())


def blind(world, count: int) -> gym.vector.SyncVectorEnv:
    """Slots of a batch that looks for them."""
    return gym.vector.SyncVectorEnv([lambda: env_of(world, SensorSuite())] * count)


@pytest.mark.parametrize(
    "view", [ViewSettings(height=40, width=56), ViewSettings("views36", 24), ViewSettings("equirect", 20)]
)
def test_pixels_belong_to_the_space_and_are_those_of_the_panorama(world, view):
    env = env_of(world, CameraSensor(PanoramaStore({world.name: world}), ("rgb", "depth", "ids"), view))
    for task in range(4):
        o, _ = env.reset(seed=task, options={"task": task})
        if task == 3:  # a move looks along the edge that was walked
            o, *_ = env.step(number(Move(0), SpaceLayout()))
        assert env.observation_space.contains(o)
        pose, panorama = env._env.pose, world.panorama(env._env.pose.node)
        if view.frame == "view":
            rgb, depth, ids = panorama.view(pose.yaw, pose.pitch, view.vfov, (40, 56))
        elif view.frame == "views36":
            rgb, depth, ids = panorama.views36(24), None, None
        else:
            rgb, depth, ids = panorama.equirect(20), panorama.equirect_depth(20), panorama.equirect_ids(20)
        assert (o["rgb"] == rgb).all()
        if depth is not None:
            assert np.allclose(o["depth"], np.minimum(depth, FAR)) and (o["ids"] == ids).all()
        assert o["depth"].shape == o["ids"].shape == view.shape and o["ids"].max() > 0


def test_features_come_from_the_very_panoramas_that_are_shown(world):
    store, encoder = PanoramaStore({world.name: world}), random_encoder(seed=0)
    sensor = SensorSuite(
        [CameraSensor(store, ("rgb",), ViewSettings()), FeatureSensor("features", LiveFeatures(encoder, store))]
    )
    env = env_of(world, sensor)
    o, _ = env.reset(seed=1, options={"task": 1})
    assert set(o) > {"rgb", "target_rgb", "features", "target_features"}
    expected = encode_panoramas(encoder, [world.panorama(1)])[0].astype(np.float32)
    assert np.array_equal(o["features"], expected)
    assert not o["target_features"].any() and not o["target_rgb"].any(), "this kind of task has no target image"
    o["features"][:] = 0
    assert env.step(number(Stop(), SpaceLayout()))[0]["features"].any(), "what is handed out is a copy"


@pytest.mark.parametrize("threads", [1, 3])
def test_many_environments_hold_every_panorama_once_and_each_its_own_task(world, threads):
    store = PanoramaStore({world.name: world})
    sensor = CameraSensor(store, ("rgb",), ViewSettings(height=16, width=16))
    envs = SharedSyncVectorEnv(blind(world, 12), sensor, threads=threads)
    o, _ = envs.reset(seed=5)
    for _ in range(6):
        o, *_ = envs.step(np.zeros(12, dtype=np.int64))
    assert len(store._kept) == 3
    assert len({bytes(row) for row in o["instruction"]}) > 1
    for i, env in enumerate(envs.unwrapped.envs):
        assert (o["rgb"][i] == sensor.look(env.observed)()["rgb"]).all()
        assert bytes(o["instruction"][i]).rstrip(b"\0").decode() == env._env.instruction
    envs.close()


def test_a_batch_gives_what_gymnasium_would_batch(world):
    sensor = CameraSensor(
        PanoramaStore({world.name: world}), ("rgb", "depth", "ids"), ViewSettings(height=16, width=16)
    )
    ours = SharedSyncVectorEnv(blind(world, 5), sensor, threads=2)
    theirs = gym.vector.SyncVectorEnv([lambda: env_of(world, sensor)] * 5)
    assert ours.observation_space == theirs.observation_space
    assert ours.single_observation_space == theirs.single_observation_space
    a, b = ours.reset(seed=3), theirs.reset(seed=3)
    for k in range(40):
        assert a[0].keys() == b[0].keys()
        assert all(np.array_equal(a[0][name], b[0][name]) and a[0][name].dtype == b[0][name].dtype for name in b[0])
        assert all(np.array_equal(x, y) for x, y in zip(a[1:4], b[1:4], strict=False) if isinstance(x, np.ndarray))
        moves = np.where(a[0]["action_mask"][:, k % 3], k % 3, SpaceLayout().candidates)
        earlier, kept = a[0]["rgb"], a[0]["rgb"].copy()
        a, b = ours.step(moves), theirs.step(moves)
        assert (earlier == kept).all(), "what was handed out stays"
    assert ours.unwrapped.get_attr("render_mode") == (None,) * 5
    with pytest.raises(ValueError, match="threads should be at least 1"):
        SharedSyncVectorEnv(blind(world, 2), sensor, threads=0)
    ours.close(), theirs.close()


def test_the_store_keeps_to_its_budget_and_gives_the_same_pictures(world):
    one = module._bytes(world.panorama(0))
    store = PanoramaStore({world.name: world}, budget=2 * one)
    first = store.at(Sight(world.name, 0)).rgb.copy()
    for node in (1, 2, 1, 2):
        store.at(Sight(world.name, node))
    assert len(store._kept) == 2 and sum(map(module._bytes, store._kept.values())) <= 2 * one
    assert (store.at(Sight(world.name, 0)).rgb == first).all()


@pytest.mark.parametrize("observations", ["touch", ("rgb", "rgb"), (), ("rgb", "smell"), None, 3, ("rgb", ["depth"])])
def test_what_cannot_be_seen_is_refused_with_what_can(observations, tmp_path):
    with pytest.raises(ValueError, match="observations should be one or several of .*oracle"):
        embodied.gym.env.make("find", cache=str(tmp_path), worlds={"grid": grid_world()}, observations=observations)


def test_what_nobody_here_can_show_is_refused_with_the_remedy(tmp_path):
    with pytest.raises(ValueError, match="no pictures of .*grid.*observations='oracle'"):
        embodied.gym.env.make("find", cache=str(tmp_path), worlds={"grid": grid_world()}, observations="rgb")
    with pytest.raises(module.UnableError, match="no encoder 'mine' is installed"):
        module.encoder_entry("mine")


def test_views_without_pixels_and_unknown_frames_are_refused():
    for wrong in ({"height": 0}, {"width": -3}, {"vfov": math.pi}, {"vfov": 0.0}, {"frame": "fisheye"}):
        with pytest.raises(ValueError, match=r"needs|use one of"):
            ViewSettings(**wrong)


@pytest.mark.slow
def test_a_data_set_without_pictures_says_the_command_that_draws_them(tmp_path):
    data = built(tmp_path / "data")
    with pytest.raises(ValueError, match=r"pictures of 0 of its \d+ houses.*--pictures fast"):
        embodied.gym.env.make(data.kind, data=data.folder, split="train", cache=tmp_path / "cache", observations="rgb")


def test_a_robots_camera_is_seen_through_and_sees_the_same_again(world):
    views = [ViewSettings(height=40, width=56, camera=c, device=1) for c in ("robot", "robot", "ideal")]
    envs = [env_of(world, CameraSensor(PanoramaStore({world.name: world}), ("rgb", "ids"), v)) for v in views]
    one, again, ideal = (e.reset(seed=0, options={"task": 1})[0] for e in envs)
    assert envs[0].observation_space.contains(one)
    assert np.array_equal(one["rgb"], again["rgb"]) and not np.array_equal(one["rgb"], ideal["rgb"])
    assert np.array_equal(one["target_rgb"], again["target_rgb"])
    assert set(np.unique(one["ids"])) <= set(np.unique(ideal["ids"]))
    for frame in ("views36", "equirect"):
        whole = ViewSettings(frame, 24, camera="phone")
        sensor = CameraSensor(PanoramaStore({world.name: world}), ("rgb", "depth"), whole)
        o, _ = env_of(world, sensor).reset(seed=0, options={"task": 0})
        assert o["rgb"].shape == (*whole.shape, 3) and o["depth"].shape == whole.shape
    with pytest.raises(ValueError, match="camera 'webcam' is unknown"):
        ViewSettings(camera="webcam")


def test_only_the_latest_houses_stay_open_in_other_states():
    worlds = {f"h{k}": Mock() for k in range(HOUSES_CHANGED + 2)}
    store = PanoramaStore(worlds)
    for name in worlds:
        store.at(Sight(f"{name}|@", 0))
        store.at(Sight(name, 0))
    assert [w.close_states.call_count for w in worlds.values()] == [1, 1, *[0] * HOUSES_CHANGED]
