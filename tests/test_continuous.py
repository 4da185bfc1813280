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

from embodied.assets.json_file import RecordError
from embodied.datasets.build import make_dataset_house
from embodied.datasets.habitat import (
    from_habitat,
    object_excursions,
    read_objectnav,
    read_vlnce,
    rotation_of,
    to_habitat,
    with_experts,
    write_vlnce,
    yaw_of,
)
from embodied.envs.continuous import Aim, Body, ContinuousEnv, Excursion, Follower, Grounds, Move
from embodied.evaluation.continuous import judged
from embodied.generate import HouseConfig
from embodied.gym.continuous import ContinuousGymEnv, make, make_course
from embodied.world import open_world

SMALL = {"height": 32, "width": 32}
VLNCE = Body()


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    with open_world(furnished(two_rooms()), HandCatalogue(), tmp_path_factory.mktemp("continuous"), size=32) as w:
        yield w


@pytest.fixture(scope="module")
def course(world):
    return make_course("vlnce", worlds={world.name: world}, **SMALL)


def excursion(world, a=(1.5, 3.0, 0.0), b=(8.0, 2.0, 0.0), yaw=0.0, **fields) -> Excursion:
    return Excursion("1", world.name, a, yaw, "go", (Aim(b),), **fields)


def placed(world, *actions: int, body: Body = VLNCE, **where) -> ContinuousEnv:
    env = ContinuousEnv(body)
    env.reset(excursion(world, **where), world)
    for action in actions:
        env.step(action)
    return env


def test_steps_and_turns_are_those_of_habitat(world):
    env = placed(world, Move.LEFT, Move.LEFT, Move.FORWARD, Move.RIGHT, Move.FORWARD)
    c, s = (np.array([f(math.radians(30)), f(math.radians(15))]).sum() for f in (np.cos, np.sin))
    assert np.allclose(env.position, [1.5 + 0.25 * c, 3.0 + 0.25 * s]) and not env.collided
    looking = placed(world, *[Move.UP] * 3, Move.DOWN, body=Body(looks=True))
    assert looking.pitch == pytest.approx(math.radians(30))
    with pytest.raises(ValueError, match="0 to 3"):
        placed(world, Move.UP)


def test_a_wall_is_slid_along_or_stopped_at(world):
    free = placed(world, *[Move.FORWARD] * 8, a=(3.0, 0.5, 0.0), yaw=-0.3)
    stuck = placed(world, *[Move.FORWARD] * 8, a=(3.0, 0.5, 0.0), yaw=-0.3, body=Body(sliding=False))
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
def test_what_is_seen_is_drawn_at_the_pose(world, course):
    env = ContinuousGymEnv(replace(course, excursions=(excursion(world, a=(2.0, 3.0, 0.0)),)))
    before = env.reset()[0]
    after = env.step(Move.FORWARD)[0]
    assert np.median(before["depth"][15:17, 15:17]) - np.median(after["depth"][15:17, 15:17]) == pytest.approx(
        0.25, abs=1e-3
    )
    assert not np.array_equal(before["rgb"], after["rgb"])
    assert course.lens.vfov == pytest.approx(math.pi / 2)


@pytest.mark.gl
def test_vector_environments_play_as_one_alone_does(world, course):
    envs = gymnasium.vector.SyncVectorEnv([lambda: ContinuousGymEnv(course)] * 2)
    alone = ContinuousGymEnv(course)
    together, _ = envs.reset(seed=[3, 4])
    o, _ = alone.reset(seed=4)
    for action in (1, 2, 1, 3):
        assert all(np.array_equal(together[name][1], o[name]) for name in o)
        together, *_ = envs.step(np.array([1, action]))
        o, *_ = alone.step(action)
    made = gymnasium.make_vec("embodied/VLNCE-v0", num_envs=2, worlds={world.name: world}, **SMALL)
    assert made.reset(seed=0)[0]["rgb"].shape == (2, 32, 32, 3)


def test_running_out_of_actions_truncates_and_stop_terminates(course):
    env = ContinuousGymEnv(replace(course, body=Body(steps=3), sees=()))
    env.reset(seed=0)
    ends = [env.step(Move.LEFT)[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]
    env.reset(seed=0, options={"episode": 1})
    *_, terminated, truncated, info = env.step(Move.STOP)
    assert terminated and not truncated and info["steps_taken"] == 1 and not info["is_success"]
    with pytest.raises(RuntimeError, match="reset"):
        env.step(Move.STOP)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 4])
def test_an_expert_arrives_in_generated_houses_whatever_its_turns(seed, shared_cache):
    from embodied.assets.catalogue import load_catalogue

    house, graph = make_dataset_house(seed, f"flat_{seed}", HouseConfig(area=(70.0, 110.0)), load_catalogue())
    place = type("Place", (), {"house": house, "graph": graph, "name": house.name})()
    rng, grounds, walks = np.random.default_rng(seed), Grounds(), []
    episodes = object_excursions(place, 4, seed=seed, grounds=grounds)
    for _ in range(3):
        a, b = rng.choice(len(graph.positions), 2, replace=False)
        path = tuple((float(x), float(y), 0.0) for x, y, _ in graph.positions[list(graph.path(int(a), int(b)))])
        episodes.append(excursion(place, path[0], path[-1], float(rng.uniform(-3, 3)), reference=path))
    for body in (Body(), Body(turn=30, sliding=False)):
        for e in episodes:
            env = ContinuousEnv(body, grounds)
            env.reset(e, place)
            expert = Follower(env, along=bool(e.reference))
            while not env.ended:
                env.step(expert.action())
            walks.append(env.walk())
    numbers = [judged(w) for w in walks]
    assert all(n["success"] for n in numbers) and np.mean([n["collisions"] for n in numbers]) < 0.01
    assert np.mean([n["spl"] for n in numbers]) > 0.8


def test_an_expert_knows_the_way_from_wherever_an_agent_went(world):
    rng, body = np.random.default_rng(1), Body()
    for _ in range(5):
        env = placed(world, body=body)
        expert = Follower(env)
        for _ in range(40):
            expert.action()
            env.step(int(rng.integers(1, 4)))
        while not env.ended:
            env.step(expert.action())
        assert judged(env.walk())["success"] == 1.0


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
        expert = Follower(env)
        while not env.ended:
            drawn = int(rng.integers(0 if env.steps > 30 else 1, 4))
            env.step(drawn if rng.random() < run / 16 else expert.action())
        walk = env.walk()
        wanted = published(
            [tuple(p) for p in walk.positions.tolist()],
            walk.actions,
            lambda p, env=env: env.ways.length_from(np.array(p[:2])),
            gt[-1],
            gt,
        )
        ours = judged(walk)
        assert {k: ours[k] for k in wanted} == pytest.approx(wanted, abs=1e-12)
        seen.add(ours["success"])
    assert seen == {0.0, 1.0}


def test_stopping_exactly_at_the_radius_is_no_success(world):
    env = placed(world, Move.STOP, a=(6.0, 2.0, 0.0), b=(8.0, 2.0, 0.0), radius=2.0)
    assert env.distance == 2.0 and judged(env.walk())["success"] == 0.0
    assert judged(placed(world, Move.STOP, a=(6.0, 2.0, 0.0), b=(8.0, 2.0, 0.0), radius=2.001).walk())["success"] == 1.0


def test_habitats_frame_has_y_up_and_agents_look_along_minus_z():
    for yaw in np.linspace(-3, 3, 7):
        x, y, z, w = rotation_of(yaw)
        q = np.array([[1 - 2 * (y * y + z * z), 2 * (x * z + w * y)], [2 * (x * z - w * y), 1 - 2 * (x * x + y * y)]])
        ahead = q @ np.array([0.0, -1.0])
        ours = from_habitat((ahead[0], 0.0, ahead[1]))
        assert np.allclose(ours, [math.cos(yaw), math.sin(yaw), 0.0]) and yaw_of((x, y, z, w)) == pytest.approx(yaw)
    assert to_habitat((1, 2, 3)) == [1, 3, -2] and from_habitat(to_habitat((1, 2, 3))) == (1, 2, 3)


def test_vlnce_episodes_come_back_from_their_files(world, course, tmp_path):
    walked = with_experts(course.excursions[:3], course.worlds, ContinuousEnv())
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
    again = make_course("vlnce", worlds={world.name: world}, episodes=whole, **SMALL)
    env = ContinuousGymEnv(replace(again, sees=()))
    env.reset(options={"episode": 0})
    for action in experts["1"]["actions"]:
        info = env.step(action)[-1]
    assert info["is_success"] and info["ndtw"] > 0.95
    (tmp_path / "bad.json.gz").write_bytes(gzip.compress(b'{"episodes": [{"goals": []}]}'))
    with pytest.raises(RecordError, match="episode 0"):
        read_vlnce(tmp_path / "bad.json.gz")


def write_objectnav(folder, excursions):
    """ObjectNav's files as Habitat has them: one without episodes, and one for each house beside it."""
    towards = lambda a, b: rotation_of(math.atan2(b[1] - a[1], b[0] - a[0]))
    view = lambda v, aim: {"agent_state": {"position": to_habitat(v), "rotation": towards(v, aim.position)}, "iou": 0.0}
    goal = lambda aim, e: {
        "position": to_habitat(aim.position), "object_id": aim.placement, "object_category": e.object_class,
        "view_points": [view(v, aim) for v in aim.views],
    }  # fmt: skip
    episode = lambda e: {
        "episode_id": e.id, "scene_id": f"hm3d/{e.world}/{e.world}.glb", "start_position": to_habitat(e.start),
        "start_rotation": rotation_of(e.yaw), "goals": [], "object_category": e.object_class,
    }  # fmt: skip
    (folder / "content").mkdir()
    for name in {e.world for e in excursions}:
        here = [e for e in excursions if e.world == name]
        goals = {f"{name}.glb_{e.object_class}": [goal(a, e) for a in e.aims] for e in here}
        text = json.dumps({"goals_by_category": goals, "episodes": [episode(e) for e in here]})
        (folder / "content" / f"{name}.json.gz").write_bytes(gzip.compress(text.encode()))
    (folder / "val.json.gz").write_bytes(gzip.compress(b'{"episodes": []}'))
    return folder / "val.json.gz"


def test_objectnav_episodes_come_back_from_their_files(world, tmp_path):
    ours = object_excursions(world, 6, seed=3)
    whole = write_objectnav(tmp_path, ours)
    for a, b in zip(ours, read_objectnav(whole), strict=True):
        assert replace(b, yaw=a.yaw) == a and b.yaw == pytest.approx(a.yaw)
    env = ContinuousEnv(Body(turn=30, looks=True))
    env.reset(ours[0], world)
    expert = Follower(env)
    while not env.ended:
        env.step(expert.action())
    found = {p.id: p.object_class for p in world.house.placements}
    assert judged(env.walk())["success"] == 1.0
    assert {found[a.placement] for a in ours[0].aims} == {ours[0].instruction}
