"""Robot-v0: a hand holds what it takes, doors of furniture open, and who knows where a thing is brings it."""

from __future__ import annotations

import importlib.util
import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
from absl.testing import absltest
from conftest import two_rooms
from dm_env import test_utils
from gymnasium.utils.env_checker import check_env
from handmade import HandCatalogue, furnished

from embodied.gym.robot import RobotEnv, RobotSettings, make
from embodied.world import open_world

pytestmark = pytest.mark.gl
SMALL = {"size": (32, 32), "observations": ()}


def example(name):
    spec = importlib.util.spec_from_file_location(
        name.removesuffix(".py"), Path(__file__).parents[1] / "examples" / name
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    with open_world(furnished(two_rooms()), HandCatalogue(), tmp_path_factory.mktemp("robot"), size=32) as w:
        yield w


def test_gymnasium_accepts_the_environment_and_its_cameras_see(world):
    env = RobotEnv(
        {world.name: world}, RobotSettings(size=(32, 32), observations=("rgb", "depth"), cameras=("head", "hand"))
    )
    check_env(env, skip_render_check=True)
    seen, info = env.reset(seed=1)
    assert info["request"] == "pick up the wood mug" and {"head_depth", "hand_rgb"} < set(seen)
    assert len(env.body.feels) == len(seen["proprio"]) and len(env.commands) == env.action_space.shape[0]


def test_velocities_are_those_of_the_base(world):
    env = RobotEnv({world.name: world}, RobotSettings(**SMALL))
    env.reset(seed=1)
    env.body.stand(np.array([3.0, 2.0]), math.pi / 2)
    action = env.action_space.sample() * 0
    action[:2] = 0.5, -0.5
    for _ in range(10):
        o, *_, info = env.step(action)
    assert np.allclose(env.body.position, (3.3, 2.3), atol=0.05), "ahead is +y, to the right +x"
    assert np.allclose(o["proprio"][-4:], (0.3, -0.3, 0, 0), atol=0.05) and abs(info["metres"] - 0.42) < 0.05


@pytest.mark.parametrize("grasp", ["assisted", "contact"])
def test_a_closed_hand_holds_a_thing_where_grasps_are_assisted_alone(world, grasp):
    env = RobotEnv({world.name: world}, RobotSettings(**SMALL, grasp=grasp))
    env.reset(seed=1)
    body, mug = env.body, env.body.thing("mug_1")
    body.stand(mug[:2] + (0, 0.32), -math.pi / 2)
    body.data.qpos[body.model.joint("robot/lift").qposadr[0]] = mug[2]
    lifted = (np.array([mug[2], 0, 0, 0, 0]) - env.middle) / env.half
    for k in range(25):
        lifted[0] = min(lifted[0] + 0.02 * (k > 3), 1.0)
        *_, ended, late, info = env.step(np.array([0, 0, 0, *lifted, *([1.0] if grasp == "assisted" else [])]))
        if ended:
            break
    assert (info["held"] == "mug_1") == ended == (grasp == "assisted"), info
    if ended:
        body.step(1.0)
        assert body.held is None and body.thing("mug_1")[2] < mug[2] + 0.02, "let go, it falls"


def test_who_knows_where_it_is_brings_it_and_who_does_not_may_ask(world):
    bring = example("bring_me.py")
    env = bring.BringEnv({world.name: world}, RobotSettings(**SMALL, task="bring"))
    skills = bring.Skills(env)
    for seed in range(3):
        assert skills.reset(seed) == "bring me the wood mug"
        bring.expert(skills, np.random.default_rng(0))
        assert skills.info["success"] == 1.0 and 0 < skills.info["spl"] <= 1, (seed, skills.info)
    skills.reset(3)
    assert skills.do("ask region") == "It is in living_room_1." and skills.do("ask route") == "It is on table_1."
    assert math.isclose(env.price, 0.25) and skills.do("fly") == "say go, open, take, give or ask"
    assert skills.do("take moon_1") == "nothing is called moon_1" and skills.do("open door_1").startswith("nothing")


def test_wishes_of_robots_that_cannot_be_had_are_refused(world):
    for name, value in {
        "task": "fly",
        "actions": "legs",
        "grasp": "magic",
        "size": (0, 8),
        "observations": ("x",),
    }.items():
        with pytest.raises(ValueError, match="use one of|should be|need"):
            make(worlds={world.name: world}, **{name: value})
    with pytest.raises(ValueError, match="no site or body 'claw'"):
        make(worlds={world.name: world}, hand="claw")
    env = make(worlds={world.name: world}, **SMALL)
    with pytest.raises(ValueError, match="no house 'x'"):
        env.reset(options={"world": "x"})
    env.reset(seed=0)
    with pytest.raises(ValueError, match="finite numbers"):
        env.step(np.full(env.action_space.shape, np.nan))


class TestDmEnv(test_utils.EnvironmentTestMixin, absltest.TestCase):
    """dm_env's own tests of the environment that examples/as_dm_env.py makes of it."""

    def make_object_under_test(self):
        world = open_world(furnished(two_rooms()), HandCatalogue(), Path(tempfile.mkdtemp()), size=32)
        return example("as_dm_env.py").DmEnv(RobotEnv({world.name: world}, RobotSettings(**SMALL, seconds=0.5)))

    def make_action_sequence(self):
        spec = self.environment.action_spec()
        return [np.full(spec.shape, 0.1, spec.dtype)] * 8
