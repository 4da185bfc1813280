"""The body on wheels drives what the graph promises, and notices what is in its way."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import two_rooms

import embodied.gym.env
from embodied.assets.catalogue import load_catalogue
from embodied.assistants.anna import Anna
from embodied.datasets.store import StoredPlace
from embodied.envs.driven import DrivenHannaEnv, Driver, is_overhead
from embodied.envs.hanna import HannaEnv
from embodied.interface import Ask, FindObject, Move, Pose, Route, Stop, Task
from embodied.navigation.graph import build_graph


@pytest.fixture(scope="module")
def place():
    house = two_rooms()
    return StoredPlace(house, build_graph(house))


@pytest.fixture(scope="module")
def catalogue(shared_cache):
    return load_catalogue(shared_cache)


@pytest.mark.slow
def test_every_edge_is_driven_without_a_collision(place, catalogue):
    driver = Driver(place.house, catalogue)
    for a, b in place.graph.edges:
        driver.place(place.graph.positions[a], 1.0)
        drive = driver.drive(place.graph.positions[b])
        assert drive.arrived and not drive.collisions, (a, b, drive)
        length = place.graph.distance[a, b]
        assert length - 0.1 <= drive.metres <= 1.2 * length + 0.2
        assert np.linalg.norm(driver.position - place.graph.positions[b, :2]) < 0.1


@pytest.mark.slow
def test_the_body_stands_still_when_nothing_is_asked(place, catalogue):
    driver = Driver(place.house, catalogue)
    driver.place(place.graph.positions[0], 0.5)
    assert np.linalg.norm(driver.position - place.graph.positions[0, :2]) < 1e-3 and abs(driver.yaw - 0.5) < 1e-2


@pytest.mark.slow
def test_a_wall_in_the_way_is_bumped_into_and_not_passed(place, catalogue):
    driver = Driver(place.house, catalogue)
    driver.place(np.array([4.0, 3.0, 1.5]), 0.0)
    drive = driver.drive(np.array([6.0, 3.0]))
    assert not drive.arrived and driver.position[0] < 5.0
    assert any("wall" in owner for owner in drive.collisions)


@pytest.mark.slow
def test_hanna_on_wheels_visits_the_same_nodes(place, catalogue):
    graph, name = place.graph, place.house.name
    far = int(np.argmax(graph.distance[0]))
    path = graph.path(0, far)
    task = Task("t", "hanna", name, Pose(0), FindObject("rug", None, ("rug_1",)), (far,), "find a rug", 2.0, 30)
    anna = Anna({name: graph}, {name: (Route("r", path, 0, 0, "go", "test"),)}, split="test")
    envs = [HannaEnv({name: place}, anna), DrivenHannaEnv(catalogue, {name: place}, anna)]
    for env in envs:
        env.reset(task)
        env.step(Ask())
        for node in path[1:]:
            env.step(Move(env.situation.candidate_nodes.index(node)))
        env.step(Stop())
        env.step(Stop())
    walked, drove = (e.episode() for e in envs)
    assert walked == drove
    assert len(envs[1].drives) == len(path) - 1 and envs[1].facts() == {"collisions": 0}


@pytest.mark.slow
def test_gymnasium_plays_on_wheels_too(place, tmp_path):
    blank = {"sees": "features", "source": Blank()}
    env = embodied.gym.env.make("vln", cache=tmp_path, worlds={place.name: place}, wheels=True, **blank)
    o, _ = env.reset(seed=0)
    _, _, _, _, info = env.step(int(np.flatnonzero(o["action_mask"])[0]))
    assert info["collisions"] == 0
    with pytest.raises(ValueError, match="wheels"):
        embodied.gym.env.make("hari", cache=tmp_path, worlds={place.name: place}, wheels=True, **blank)


class Blank:
    size = 3

    def features(self, sight):
        return np.zeros((36, 3), dtype=np.float32)


def test_only_what_hangs_over_the_body_is_left_out():
    floors = [0.0, 2.9]
    assert is_overhead(1.6, 2.2, floors) and is_overhead(4.6, 5.3, floors)  # wall cabinets
    assert not is_overhead(0.0, 2.6, floors) and not is_overhead(2.6, 2.9, floors)  # a wall; the upper floor
    assert not is_overhead(1.4, 2.0, floors) and not is_overhead(2.9, 3.6, floors)
