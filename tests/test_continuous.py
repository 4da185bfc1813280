"""Continuous navigation: bodies move as Habitat's do, experts arrive, numbers and files are the published ones."""

from __future__ import annotations

import gzip
import json
import math
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from conftest import two_rooms
from gymnasium.utils.env_checker import check_env
from handmade import HandCatalogue, furnished

from embodied.datasets.build import make_dataset_house
from embodied.datasets.habitat import (
    from_habitat,
    object_episodes,
    read_objectnav,
    read_vlnce,
    rotation_of,
    to_habitat,
    with_experts,
    write_vlnce,
    yaw_of,
)
from embodied.envs.continuous import (
    Body,
    ContinuousEnv,
    ContinuousEpisode,
    HabitatAction,
    NavigationGoal,
    NavMeshCache,
    ShortestPathFollower,
)
from embodied.generate import HouseConfig
from embodied.gym.continuous import ContinuousGymEnv, judged, make, open_episodes, register_continuous
from embodied.gym.continuous_tasks.objectnav import OBJECTNAV
from embodied.world import open_world

SMALL = {"height": 32, "width": 32}
VLNCE = Body()


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    with open_world(furnished(two_rooms()), HandCatalogue(), tmp_path_factory.mktemp("continuous"), size=32) as w:
        yield w


@pytest.fixture(scope="module")
def dataset(world):
    return open_episodes("vlnce", worlds={world.name: world}, **SMALL)


def episode(world, a=(1.5, 3.0, 0.0), b=(8.0, 2.0, 0.0), yaw=0.0, **fields) -> ContinuousEpisode:
    return ContinuousEpisode("1", world.name, a, yaw, "go", (NavigationGoal(b),), **fields)


def placed(world, *actions: int, body: Body = VLNCE, **where) -> ContinuousEnv:
    env = ContinuousEnv(body)
    env.reset(episode(world, **where), world)
    for action in actions:
        env.step(action)
    return env


def test_steps_and_turns_are_those_of_habitat(world):
    left, ahead, right = HabitatAction.LEFT, HabitatAction.FORWARD, HabitatAction.RIGHT
    env = placed(world, left, left, ahead, right, ahead)
    c, s = (np.array([f(math.radians(30)), f(math.radians(15))]).sum() for f in (np.cos, np.sin))
    assert np.allclose(env.position, [1.5 + 0.25 * c, 3.0 + 0.25 * s]) and not env.collided
    looking = placed(world, *[HabitatAction.UP] * 3, HabitatAction.DOWN, body=Body(looks=True))
    assert looking.pitch == pytest.approx(math.radians(30))
    with pytest.raises(ValueError, match="0 to 3"):
        placed(world, HabitatAction.UP)


def test_a_wall_is_slid_along_or_stopped_at(world):
    free = placed(world, *[HabitatAction.FORWARD] * 8, a=(3.0, 0.5, 0.0), yaw=-0.3)
    stuck = placed(world, *[HabitatAction.FORWARD] * 8, a=(3.0, 0.5, 0.0), yaw=-0.3, body=Body(sliding=False))
    assert free.collisions > 3 and stuck.collisions > 3
    assert free.position[0] - stuck.position[0] > 0.5 and free.position[1] == pytest.approx(stuck.position[1], abs=0.06)
    for env in (free, stuck):
        assert env.ground.is_free(env.position, env.position[None])[0]


def test_nobody_goes_through_walls(world):
    rng, ground = np.random.default_rng(0), placed(world).ground
    for sliding in (True, False):
        here = np.array([1.5, 3.0])
        for _ in range(150):
            angle = rng.uniform(-math.pi, math.pi)
            there = ground.moved(here, here + 0.25 * np.array([math.cos(angle), math.sin(angle)]), sliding=sliding)
            assert ground.is_free(there, there[None])[0]
            assert ground.ways(np.array([ground.cell_at(there)])).length_from(here) < 0.4
            here = there


def test_distance_is_the_way_through_the_door_and_straight_where_nothing_is_between(world):
    straight = placed(world, a=(6.0, 2.0, 0.0), b=(8.0, 2.0, 0.0))
    assert straight.distance == pytest.approx(2.0, abs=1e-6)
    through = placed(world, a=(4.0, 3.6, 0.0), b=(6.0, 3.6, 0.0))
    door, half = 1.05, 0.2
    corner = 1.5 - half
    tight = 2 * math.dist((4.0, 3.6), (5.0, corner))
    assert tight < through.distance < 2 * math.dist((4.0, 3.6), (5.0, door)) + 0.5


@pytest.mark.gl
@pytest.mark.parametrize("kind", ["vlnce", "objectnav"])
def test_gymnasium_accepts_the_environments(world, kind):
    env = make(kind, worlds={world.name: world}, **SMALL)
    check_env(env, skip_render_check=True)
    assert env.observation_space["rgb"].shape == (32, 32, 3)


@pytest.mark.gl
def test_what_is_seen_is_drawn_at_the_pose(world, dataset):
    env = ContinuousGymEnv(replace(dataset, episodes=(episode(world, a=(2.0, 3.0, 0.0)),)))
    before = env.reset()[0]
    after = env.step(HabitatAction.FORWARD)[0]
    far = [np.median(o["depth"][15:17, 15:17]) for o in (before, after)]
    assert far[0] - far[1] == pytest.approx(0.25, abs=1e-3)
    assert not np.array_equal(before["rgb"], after["rgb"])
    assert dataset.camera.vfov == pytest.approx(math.pi / 2)


def test_a_task_of_ones_own_is_an_environment_of_gymnasium(world):
    register_continuous(replace(OBJECTNAV, name=f"{__name__}:OWN", title="Own", gps=False))
    env = gymnasium.make("embodied/Own-v0", worlds={world.name: world}, **SMALL)
    assert set(env.reset(seed=0)[0]) == {"rgb", "depth", "instruction"}
    with pytest.raises(ValueError, match=r"unknown continuous task 'nowhere'; use one of .*'objectnav', .*'vlnce'"):
        open_episodes("nowhere")


@pytest.mark.gl
def test_vector_environments_end_at_gymnasiums_limit_with_all_measures(world):
    made = gymnasium.make_vec("embodied/VLNCE-v0", num_envs=2, worlds={world.name: world}, max_episode_steps=2, **SMALL)
    assert made.reset(seed=0)[0]["rgb"].shape == (2, 32, 32, 3)
    assert not made.step(np.array([2, 2]))[3].any()
    *_, truncated, info = made.step(np.array([2, 2]))
    assert truncated.all() and {"success", "is_success", "spl"} <= set(info)


def test_running_out_of_actions_truncates_and_stop_terminates(dataset):
    env = ContinuousGymEnv(replace(dataset, body=Body(steps=3), observations=()))
    env.reset(seed=0)
    ends = [env.step(HabitatAction.LEFT)[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]
    env.reset(seed=0, options={"episode": 1})
    *_, terminated, truncated, info = env.step(HabitatAction.STOP)
    assert terminated and not truncated and info["steps_taken"] == 1 and not info["is_success"]
    with pytest.raises(RuntimeError, match="reset"):
        env.step(HabitatAction.STOP)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 4])
def test_an_expert_arrives_in_generated_houses_whatever_its_turns(seed, shared_cache):
    from embodied.assets.catalogue import load_catalogue

    house, graph = make_dataset_house(seed, f"flat_{seed}", HouseConfig(area=(70.0, 110.0)), load_catalogue())
    place = type("Place", (), {"house": house, "graph": graph, "name": house.name})()
    rng, navmeshes, walks = np.random.default_rng(seed), NavMeshCache(), []
    episodes = object_episodes(place, 4, seed=seed, navmeshes=navmeshes)
    for _ in range(3):
        a, b = rng.choice(len(graph.positions), 2, replace=False)
        path = tuple((float(x), float(y), 0.0) for x, y, _ in graph.positions[list(graph.path(int(a), int(b)))])
        episodes.append(episode(place, path[0], path[-1], float(rng.uniform(-3, 3)), reference=path))
    for body in (Body(), Body(turn=30, sliding=False)):
        for e in episodes:
            env = ContinuousEnv(body, navmeshes)
            env.reset(e, place)
            expert = ShortestPathFollower(env, along=bool(e.reference))
            while not env.ended:
                env.step(expert.action())
            walks.append(env.trajectory())
    numbers = [judged(w) for w in walks]
    assert all(n["success"] for n in numbers) and np.mean([n["collisions"] for n in numbers]) < 0.01
    assert np.mean([n["spl"] for n in numbers]) > 0.8


def test_an_expert_knows_the_way_from_wherever_an_agent_went(world):
    rng, body = np.random.default_rng(1), Body()
    for _ in range(5):
        env = placed(world, body=body)
        expert = ShortestPathFollower(env)
        for _ in range(40):
            expert.action()
            env.step(int(rng.integers(1, 4)))
        while not env.ended:
            env.step(expert.action())
        assert judged(env.trajectory())["success"] == 1.0


def published(positions, actions, distance, goal, gt, radius=3.0):
    """VLN-CE's measures as they are computed there: step by step."""
    before, gone, oracle, oracle_spl, nearest = positions[0], 0.0, 0.0, 0.0, math.inf
    start, locations = distance(positions[0]), []
    for position in positions[1:]:
        gone += float(np.linalg.norm(np.array(position) - np.array(before)))
        before, left = position, distance(position)
        nearest = min(nearest, left)
        if not oracle and left < radius:
            oracle, oracle_spl = 1.0, start / max(start, gone)
        if not locations or position != locations[-1]:
            locations.append(position)
    table = np.full((len(locations) + 1, len(gt) + 1), np.inf)
    table[0, 0] = 0.0
    for i, p in enumerate(locations, 1):
        for j, q in enumerate(gt, 1):
            table[i, j] = math.dist(p, q) + min(table[i - 1, j], table[i, j - 1], table[i - 1, j - 1])
    success = float(actions[-1] == 0 and left < radius)
    ndtw = math.exp(-table[-1, -1] / (len(gt) * radius))
    return {
        "distance_to_goal": left,
        "success": success,
        "spl": success * start / max(start, gone),
        "ndtw": ndtw,
        "sdtw": success * ndtw,
        "path_length": gone,
        "oracle_success": oracle,
        "oracle_spl": oracle_spl,
        "oracle_navigation_error": nearest,
        "steps_taken": len(actions),
    }


def test_measures_are_those_of_the_published_evaluator_on_the_same_walks(world):
    rng, gt = np.random.default_rng(2), ((1.5, 3.0, 0.0), (4.0, 1.5, 0.0), (5.0, 1.0, 0.0), (8.0, 2.0, 0.0))
    seen: set[float] = set()
    for run in range(8):
        env = placed(world, b=gt[-1], expert=gt)
        expert = ShortestPathFollower(env)
        while not env.ended:
            drawn = int(rng.integers(0 if env.steps > 30 else 1, 4))
            env.step(drawn if rng.random() < run / 16 else expert.action())
        trajectory = env.trajectory()
        wanted = published(
            [tuple(p) for p in trajectory.positions.tolist()],
            trajectory.actions,
            lambda p, env=env: env.ways.length_from(np.array(p[:2])),
            gt[-1],
            gt,
        )
        ours = judged(trajectory)
        assert {k: ours[k] for k in wanted} == pytest.approx(wanted, abs=1e-12)
        seen.add(ours["success"])
    assert seen == {0.0, 1.0}


def test_stopping_exactly_at_the_radius_is_no_success(world):
    for radius, success in ((2.0, 0.0), (2.001, 1.0)):
        env = placed(world, HabitatAction.STOP, a=(6.0, 2.0, 0.0), b=(8.0, 2.0, 0.0), radius=radius)
        assert env.distance == 2.0 and judged(env.trajectory())["success"] == success


def test_habitats_frame_has_y_up_and_agents_look_along_minus_z():
    for yaw in np.linspace(-3, 3, 7):
        x, y, z, w = rotation_of(yaw)
        q = np.array([[1 - 2 * (y * y + z * z), 2 * (x * z + w * y)], [2 * (x * z - w * y), 1 - 2 * (x * x + y * y)]])
        ahead = q @ np.array([0.0, -1.0])
        ours = from_habitat((ahead[0], 0.0, ahead[1]))
        assert np.allclose(ours, [math.cos(yaw), math.sin(yaw), 0.0]) and yaw_of((x, y, z, w)) == pytest.approx(yaw)
    assert to_habitat((1, 2, 3)) == [1, 3, -2] and from_habitat(to_habitat((1, 2, 3))) == (1, 2, 3)


def test_vlnce_episodes_come_back_from_their_files(world, dataset, tmp_path):
    walked = with_experts(dataset.episodes[:3], dataset.worlds, ContinuousEnv())
    whole, gt = write_vlnce(tmp_path, "val", walked)
    for ours, back in zip([e for e, _ in walked], read_vlnce(whole), strict=True):
        assert replace(back, yaw=ours.yaw) == replace(ours, trajectory=back.trajectory)
        assert back.yaw == pytest.approx(float((ours.yaw + math.pi) % (2 * math.pi) - math.pi), abs=1e-9)
    file = json.loads(gzip.decompress(whole.read_bytes()))
    words, item = file["instruction_vocab"]["word_list"], file["episodes"][0]
    said = [words[k] for k in item["instruction"]["instruction_tokens"] if k]
    told = item["instruction"]
    assert len(told["instruction_tokens"]) == 200 and said[0] in told["instruction_text"].lower()
    experts = json.loads(gzip.decompress(gt.read_bytes()))
    assert experts["1"]["actions"][-1] == 0
    again = open_episodes("vlnce", worlds={world.name: world}, episodes=whole, **SMALL)
    env = ContinuousGymEnv(replace(again, observations=()))
    env.reset(options={"episode": 0})
    with pytest.raises(TypeError, match="whole number, got 1.7"):
        env.step(1.7)
    for action in experts["1"]["actions"]:
        info = env.step(action)[-1]
    assert info["is_success"] and info["ndtw"] > 0.95
    hundred = lambda point: [100 * v for v in point]
    start, goal, turned = item["start_position"], item["goals"], item["start_rotation"]
    for wrong, message in [
        ({"goals": []}, "it should have goals"),
        ({"instruction": {"instruction_text": None}}, "should have a str 'instruction_text'"),
        ({"instruction": "walk on"}, "should have a dict 'instruction'"),
        ({"start_rotation": [turned[3], *turned[:3]]}, "start_rotation is .*about y"),
        ({"start_rotation": [2 * v for v in turned]}, "expected a unit quaternion"),
        ({"start_rotation": [0, 0, 0, 0]}, "expected a unit quaternion"),
        ({"start_position": hundred(start), "goals": [{"position": hundred(goal[0]["position"])}]}, "the start of"),
        ({"start_position": [start[0], -start[2], start[1]]}, r"the start of .*in Habitat's files are \[x, z, -y\]"),
        ({"start_position": [start[0], 30.0, start[2]]}, "the start of episode '1' is at"),
        ({"start_position": [1e3, 0.0, 1e3]}, "nobody can stand in house"),
        ({"goals": [{"position": [1e3, 0.0, 1e3]}]}, "the goal 0 of episode '1'"),
    ]:
        bad = tmp_path / "bad.json.gz"
        bad.write_bytes(gzip.compress(json.dumps({"episodes": [item | wrong]}).encode()))
        with pytest.raises(ValueError, match=message) as refused:
            open_episodes("vlnce", worlds={world.name: world}, episodes=bad, **SMALL)
        assert str(bad) in str(refused.value)


def write_objectnav(folder, episodes):
    """ObjectNav's files as Habitat has them: one without episodes, and one for each house beside it."""
    towards = lambda a, b: rotation_of(math.atan2(b[1] - a[1], b[0] - a[0]))
    view = lambda v, goal: {
        "agent_state": {"position": to_habitat(v), "rotation": towards(v, goal.position)},
        "iou": 0.0,
    }
    goal = lambda goal, e: {
        "position": to_habitat(goal.position), "object_id": goal.placement, "object_category": e.object_class,
        "view_points": [view(v, goal) for v in goal.views],
    }  # fmt: skip
    episode = lambda e: {
        "episode_id": e.id, "scene_id": f"hm3d/{e.world}/{e.world}.glb", "start_position": to_habitat(e.start),
        "start_rotation": rotation_of(e.yaw), "goals": [], "object_category": e.object_class,
    }  # fmt: skip
    (folder / "content").mkdir()
    for name in {e.world for e in episodes}:
        here = [e for e in episodes if e.world == name]
        goals = {f"{name}.glb_{e.object_class}": [goal(a, e) for a in e.goals] for e in here}
        text = json.dumps({"goals_by_category": goals, "episodes": [episode(e) for e in here]})
        (folder / "content" / f"{name}.json.gz").write_bytes(gzip.compress(text.encode()))
    (folder / "val.json.gz").write_bytes(gzip.compress(b'{"episodes": []}'))
    return folder / "val.json.gz"


def test_objectnav_episodes_come_back_from_their_files(world, tmp_path):
    ours = object_episodes(world, 6, seed=3)
    whole = write_objectnav(tmp_path, ours)
    for a, b in zip(ours, read_objectnav(whole), strict=True):
        assert replace(b, yaw=a.yaw) == a and b.yaw == pytest.approx(a.yaw)
    env = ContinuousEnv(Body(turn=30, looks=True))
    env.reset(ours[0], world)
    expert = ShortestPathFollower(env)
    while not env.ended:
        env.step(expert.action())
    found = {p.id: p.object_class for p in world.house.placements}
    assert judged(env.trajectory())["success"] == 1.0
    assert {found[a.placement] for a in ours[0].goals} == {ours[0].instruction}
