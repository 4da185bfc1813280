"""Driving: what is seen is where the body is, experts arrive, and walls hold."""

from __future__ import annotations

import math
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from conftest import two_rooms
from gymnasium.utils.env_checker import check_env
from handmade import HandCatalogue, furnished

from embodied.gym import drive
from embodied.gym.drive import DriveEnv, make
from embodied.gym.driving import DriveSettings, Driving, driven_task, expert_action
from embodied.navigation.floor_ways import FloorWays
from embodied.world import open_world

SMALL = {"height": 32, "width": 32, "farthest": 5.0}
pytestmark = pytest.mark.gl
STAY_HERE = replace(driven_task("reach"), name=f"{__name__}:STAY_HERE", says=True)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    with open_world(furnished(two_rooms()), HandCatalogue(), tmp_path_factory.mktemp("drive"), size=32) as w:
        yield w


def env_of(world, **settings) -> DriveEnv:
    return DriveEnv(Driving({world.name: world}, DriveSettings(**{**SMALL, **settings})))


def test_ways_over_free_floor_are_straight_lines_and_others_are_longer(world):
    ground = FloorWays(world.house)
    rng = np.random.default_rng(0)
    for goal in rng.integers(len(ground.xy), size=8):
        ways = ground.ways(np.array([goal]))
        starts = rng.integers(len(ground.xy), size=20)
        lengths = np.array([ways.length(int(s)) for s in starts])
        straight = np.linalg.norm(ground.xy[starts] - ground.xy[goal], axis=1)
        free = ground.is_free(ground.xy[goal], ground.xy[starts])
        assert np.allclose(lengths[free], straight[free], rtol=0.03, atol=1e-6)
        assert (lengths >= straight - 1e-9).all() and (lengths <= ways.metres[starts] + 1e-9).all()


@pytest.mark.parametrize("task", ["reach", "find"])
def test_gymnasium_accepts_the_environment(world, task):
    check_env(env_of(world, task=task, observations=("rgb", "depth", "ids")), skip_render_check=True)


def test_a_driven_task_of_ones_own_is_played_by_its_name(world):
    env = gymnasium.make("embodied/Drive-v0", worlds={world.name: world}, task=STAY_HERE.name, observations=())
    observation, _ = env.reset(seed=0)
    assert {"motion", "touched", "goal"} == set(observation) and env.action_space.shape == (3,)
    _, _, terminated, _, info = env.step(np.array([0, 0, 1], np.float32))
    assert terminated and info["success"] == 0.0
    with pytest.raises(ValueError, match="should be a DrivenTask with name"):
        DriveSettings(task=f"{__name__}:SMALL")


def test_depth_straight_ahead_is_how_far_the_wall_is(world):
    env = env_of(world, observations=("rgb", "depth"))
    env.reset(seed=0)
    driving = env.driving
    for x in (3.0, 4.0):
        driving.driver.place(np.array([x, 3.0, 1.5]), 0.0)
        eye = driving.driver.eye[0]
        seen = driving.look()
        assert np.allclose(eye[:2], [x, 3.0], atol=0.02)
        far = float(np.median(seen["depth"][15:17, 15:17]))
        driving.driver.place(np.array([x - 0.5, 3.0, 1.5]), 0.0)
        assert float(np.median(driving.look()["depth"][15:17, 15:17])) == pytest.approx(far + 0.5, abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("task", ["reach", "find"])
def test_whoever_knows_the_way_arrives_without_a_collision(world, task):
    env = env_of(world, task=task, observations=())
    for seed in range(6):
        env.reset(seed=seed)
        ended = False
        while not ended:
            _, _, terminated, truncated, info = env.step(expert_action(env.driving))
            ended = terminated or truncated
        assert info["success"] == 1.0 and info["collisions"] == 0 and info["spl"] > 0.75, (seed, info)


def test_a_wall_stops_the_body_and_is_counted_once(world):
    env = env_of(world, observations=())
    env.reset(seed=1)
    env.driving.driver.place(np.array([4.0, 3.0, 1.5]), 0.0)
    steps = [env.step(np.array([1.0, 0.0])) for _ in range(30)]
    assert 1 <= steps[-1][-1]["collisions"] <= 3 and env.driving.driver.position[0] < 5.0
    assert steps[0][0]["touched"][0] == 0.0 and any(o["touched"][0] for o, *_ in steps[-10:])


def test_time_is_up_or_the_wrong_thing_is_said(world):
    env = env_of(world, task="find", observations=(), seconds=1.0)
    env.reset(seed=3)
    ends = [env.step(np.zeros(3)) for _ in range(10)]
    assert [e[3] for e in ends] == [False] * 9 + [True] and ends[-1][4]["success"] == 0.0
    with pytest.raises(RuntimeError, match="over .limit.; reset"):
        env.step(np.zeros(3))
    env.reset(seed=3)
    _, reward, terminated, _, info = env.step(np.array([0.0, 0.0, 1.0]))
    assert terminated and info["success"] == info["spl"] == 0.0 and reward < 0.05


@pytest.mark.parametrize("named", [None, "fast", "normal-matte"])
def test_live_pictures_are_without_reflections_unless_they_are_named(named, tmp_path, monkeypatch):
    house = furnished(two_rooms())
    monkeypatch.setattr(drive, "make_dataset_house", lambda *_: (house, None))
    monkeypatch.setattr(drive, "load_catalogue", lambda *_: HandCatalogue())
    (flat,) = drive.chosen_worlds(cache=tmp_path, pictures=named)[0].values()
    assert flat.pictures.word == (named or "fast-matte")


def test_wishes_that_cannot_be_had_are_refused(world):
    wrong = {"task": "fly", "observations": ("smell",), "height": 0, "vfov": math.pi, "control": 0.0, "nearest": 9.0}
    for name, value in wrong.items():
        with pytest.raises(ValueError, match=r"use one of|should be|need"):
            make(worlds={world.name: world}, **{name: value})
    with pytest.raises(ValueError, match="no houses"):
        make(worlds={})
    env = env_of(world, nearest=40.0, farthest=50.0)
    with pytest.raises(ValueError, match="no goal for 'reach'"):
        env.reset(seed=0)
    env = env_of(world, observations=())
    env.reset(seed=0)
    for action in ([1.0, 0.0, 1.0], [np.nan, 0.0]):
        with pytest.raises(ValueError, match="2 finite numbers"):
            env.step(np.array(action))
