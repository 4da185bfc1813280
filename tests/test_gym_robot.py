"""Robot-v0: a hand holds what it takes, doors of furniture open, and who knows where a thing is brings it."""

from __future__ import annotations

import dataclasses
import importlib
import json
import math
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np
import pyarrow.parquet as pq
import pytest
import torch
from absl.testing import absltest
from conftest import two_rooms
from dm_env import specs, test_utils
from gymnasium.utils.env_checker import check_env
from hand_chat import ChatServer, said
from handmade import HandCatalogue, furnished

import embodied
from embodied.agents.language_models.agent import LanguageModelAgent
from embodied.agents.language_models.client import AnswerCache, Client, ServerSettings
from embodied.gym.bring import BringEnv
from embodied.gym.robot import RobotEnv, RobotSettings, make
from embodied.interface import Ask, Intention, Move
from embodied.render.photograph import PhotoCamera, lens_map
from embodied.world import open_world

pytestmark = pytest.mark.gl
SMALL = {"size": (32, 32), "observations": ()}


EXAMPLES = str(Path(__file__).parents[1] / "examples")


def example(name):
    """A script of examples/ as a module."""
    sys.path.insert(0, EXAMPLES)
    try:
        return importlib.import_module(name.removesuffix(".py"))
    finally:
        sys.path.remove(EXAMPLES)


bring, others, Skills = example("bring_me.py"), example("other_robots.py"), example("skills.py").Skills


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


def test_a_devices_lens_bends_all_that_a_robots_camera_sees(world):
    seen = {}
    for camera in ("ideal", "robot"):
        settings = RobotSettings(size=(32, 32), observations=("rgb", "depth", "ids"), camera=camera, device=3)
        env = RobotEnv({world.name: world}, settings)
        seen[camera] = env.reset(seed=1)[0]
        assert all(np.array_equal(a, seen[camera][k]) for k, a in env.reset(seed=1)[0].items()), "noise is of the seed"
    x, y = lens_map(PhotoCamera("robot", 3).traits.radial, math.radians(70), 32, 32)
    at = np.round(y).astype(int), np.round(x).astype(int)
    for k in ("head_depth", "head_ids"):
        assert (seen["robot"][k] == seen["ideal"][k][at]).mean() > 0.97 and (seen["robot"][k] != seen["ideal"][k]).any()


def test_observations_have_the_names_that_robosuites_users_know(world):
    settings = RobotSettings(size=(32, 32), cameras=("head", "hand"), observations=("rgb", "ids"), names="robosuite")
    env = RobotEnv({world.name: world}, settings)
    o, _ = env.reset(seed=1)
    assert env.observation_space.contains(o)
    assert {"agentview_image", "agentview_segmentation_instance", "robot0_eye_in_hand_image"} < set(o)
    assert np.allclose(o["robot0_eef_pos"], env.body.hand) and o["robot0_gripper_qpos"].shape == (2,)
    assert len(o["robot0_joint_pos"]) == 7, "head, lift and telescope"
    _, _, z, w = o["robot0_eef_quat"]
    assert math.isclose(2 * math.atan2(z, w) % math.tau, env.body.yaw % math.tau, abs_tol=0.02)


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


@pytest.mark.parametrize("breaks", [0.5, 1e4])
def test_what_is_pushed_harder_than_it_stands_counts_as_broken(world, breaks):
    env = RobotEnv({world.name: world}, RobotSettings(**SMALL, breaks=breaks))
    env.reset(seed=1)
    mug = env.body.thing("mug_1")
    env.body.stand(mug[:2] + (0, 0.45), -math.pi / 2)
    env.body.data.qpos[env.body.model.joint("robot/lift").qposadr[0]] = mug[2]
    arm = (np.array([mug[2], 0, 0, 0, 0]) - env.middle) / env.half
    for _ in range(10):
        *_, info = env.step(np.array([0.5, 0, 0, *arm, 0]))
    assert info["broken"] == (("mug_1",) if breaks < 1 else ())


@pytest.fixture(scope="module")
def skills(world):
    return Skills(BringEnv({world.name: world}, RobotSettings(**{**SMALL, "task": "bring"})))


def test_who_knows_where_it_is_brings_it_and_others_find_it(skills):
    for seed in range(3):
        for name in ("expert", "always asks"):
            facts = bring.episode(skills, bring.PLAYERS[name], seed)
            assert facts["success"] == 1 and 0 < facts["spl"] <= 1, (seed, name, facts)
        assert facts["asked"]["region"] == 2 and facts["asked"]["confirm"] == 1
        assert math.isclose(facts["price"], 0.05 * (sum(facts["asked"].values()) - 1) + 0.2), "a route costs more"
    assert bring.episode(skills, bring.Searcher(sees=False), 0)["success"] <= 1


def test_answers_are_about_the_thing_then_about_the_person_and_cost_reward(skills):
    o = skills.reset(3)
    assert o.instruction == "bring me the wood mug" and Intention.CONFIRM not in o.can_ask
    env, hold = skills.env, np.zeros(skills.env.action_space.shape)
    hold[env.commands.index("ask region")] = 1.0
    rewards = [env.step(hold)[1] for _ in range(2)]
    assert rewards == pytest.approx([-0.051, -0.001]), "holding the question asks once"
    assert skills.step(Ask(Intention.REGION)).instruction.endswith("It is in the living room.")
    assert skills.do("take mug_1") == "you hold mug_1"
    o = skills.step(Ask(Intention.CONFIRM))
    assert o.instruction.endswith("Yes, it is this one.") and o.extras.holds == "mug_1"
    room = env.world.house.room_by_id[env.room_at(env.person)].kind.replace("_", " ")
    assert skills.step(Ask(Intention.REGION)).instruction.endswith(f"I am in the {room}.")
    assert "leave" in o.candidates.words and not any(w.startswith("take") for w in o.candidates.words)
    assert skills.step(Move(skills.words.index("leave"))).extras.holds == ""


def test_a_language_model_plays_by_skills_and_its_answers_play_again(skills, tmp_path):
    def speaks(request):
        schema = request["response_format"]["json_schema"]["schema"]
        can, text = schema["properties"]["action"]["enum"], json.dumps(request["messages"])
        told = [w for w in can if w.startswith("go ") and f"in the {w[3:-2].replace('_', ' ')}." in text]
        wants = ["give", "take mug_1", *["ask region"] * (" . " not in text or "you hold mug_1" in text), *told]
        return said(json.dumps({"reason": "", "action": next((w for w in wants if w in can), can[0])}))

    episode, cache = bring.episode, AnswerCache(tmp_path / "answers.sqlite")
    with ChatServer(speaks) as server:
        client = Client(ServerSettings("scripted", server.url), cache)
        facts = episode(skills, LanguageModelAgent(client), 1)
        assert facts["success"] == 1 and facts["asked"] and client.sent > 1
        shown = server.requests[0]["messages"][1]["content"]
    assert "bring me the wood mug" in shown and "you are in" in shown
    offline = Client(dataclasses.replace(client.settings, base_url="http://127.0.0.1:9/v1"), cache)
    assert episode(skills, LanguageModelAgent(offline), 1) == facts and offline.sent == 0


def test_episodes_become_lerobot_data_with_what_was_said(world, tmp_path):
    settings = RobotSettings(task="bring", size=(32, 32), observations=("rgb",))
    env = BringEnv({world.name: world}, settings)
    steps = bring.record(env, tmp_path / "out", range(2), bring.Searcher(Intention.REGION))
    table = pq.read_table(tmp_path / "out/data/chunk-000/file-000.parquet").to_pydict()
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert len(table["index"]) == steps and info["fps"] == 10 and table["next.success"].count(True) == 2
    assert tuple(info["features"]["action"]["names"]) == env.commands
    asks = np.array(table["action"])[:, env.commands.index("ask region")]
    heard = [bool(events) for events in table["language_events"]]
    assert heard == (asks == 1).tolist() and 2 <= sum(heard) <= 4


def test_an_arm_of_dm_control_on_a_cart_finds_things(world):
    from dm_control.third_party import kinova

    arm = others.on_a_cart(mujoco.MjSpec.from_file(f"{kinova.__path__[0]}/jaco_arm.xml"))
    env = RobotEnv({world.name: world}, RobotSettings(robot=arm, hand="arm_wristsite", task="find", **SMALL))
    assert env.commands[:3] == ("ahead", "left", "turn") and "robot/arm_joint_1 rad" in " ".join(env.body.feels)
    for seed in range(2):
        assert others.drive(env, seed)["success"] == 1.0


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
    """dm_env's own tests of what embodied.dm_env makes."""

    def make_object_under_test(self):
        world = open_world(furnished(two_rooms()), HandCatalogue(), Path(tempfile.mkdtemp()), size=32)
        return embodied.dm_env(worlds={world.name: world}, task="bring", seconds=0.5, **SMALL)

    def make_action_sequence(self):
        spec = self.environment.action_spec()
        return [np.full(spec.shape, 0.1, spec.dtype)] * 8


def test_specs_say_what_spaces_say_and_others_are_refused():
    from gymnasium import spaces

    from embodied.gym.dm import spec_of

    spec = spec_of(spaces.Dict({"a": spaces.Discrete(3), "b": spaces.Box(-1, 2, (2,), np.float32)}), "x")
    assert isinstance(spec["a"], specs.DiscreteArray) and spec["a"].num_values == 3
    assert spec["b"].maximum.tolist() == [2, 2] and spec["b"].dtype == np.float32
    with pytest.raises(ValueError, match="no spec for Text"):
        spec_of(spaces.Text(3), "words")


def test_a_chooser_learns_to_see_which_thing_is_meant_and_its_blind_twin_does_not():
    sight, rng, names = (
        example("bring_by_sight.py"),
        np.random.default_rng(0),
        ["red mug", "blue mug", "book", "shoe", "lamp"],
    )
    looks, takes = rng.normal(size=(4, 6)), sight.VERBS.index("take")

    def moments(n):
        for _ in range(n):
            order, meant = rng.permutation(4), int(rng.integers(5))
            facts = torch.zeros(5, sight.FACTS)
            facts[:4, takes] = facts[4, 0] = 1.0
            seen = torch.tensor(np.vstack([looks[order] + 0.1 * rng.normal(size=(4, 6)), np.zeros(6)])).float()
            right = torch.tensor([*(order == meant), meant == 4])  # no lamp is there: go
            yield sight.Example(facts, seen, torch.tensor(sight.codes(names[meant])), right)

    taught, others = [*moments(200)], [*moments(100)]
    found = [np.mean(sight.judged(sight.train(taught, x, 25, 0), others, x)[0]) for x in (False, True)]
    assert found[0] > 0.9 and found[1] < 0.5
