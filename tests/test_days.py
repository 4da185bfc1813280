"""Days of households: who is where, and that nobody walks through anything."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import shapely

from embodied.assets.cache import default_cache
from embodied.assets.catalogue import load_catalogue
from embodied.assistants.anna import Anna, Residents, minute_of
from embodied.datasets.store import StoredPlace
from embodied.generate import HouseConfig, generate_house
from embodied.house.moment import Moment
from embodied.house.shapes import inward
from embodied.interface import FindObject, Mode, Pose, Route, Situation, Task, viewpoint
from embodied.kinds.shipped.hanna import HANNA
from embodied.kinds.task_kind import EnvInputs
from embodied.navigation.free_space import free_floor, leaves, sight_floor
from embodied.navigation.graph import AGENT_RADIUS, build_graph
from embodied.people.day import day_of, seconds_of

SMALL, CATALOGUE = HouseConfig(area=(38, 46)), load_catalogue(default_cache())


def day(seed):
    house = generate_house(seed, SMALL)
    return house, day_of(house, CATALOGUE, seed=seed)


def spots(lives, time):
    return {name: piece.spot for name, piece in lives.now(time).items()}


def floor_of(house, moment, z=0.0):
    """Where feet at height z may be while doors are as they are; the way out of the front door is floor, too."""
    now = dataclasses.replace(house, openings=Moment(openness=moment.openness).applied(house).openings)
    fronts = [o for o in now.openings if o.kind == "front_door"]
    out = []
    for o in fronts:
        middle, into = (np.array(o.a) + o.b) / 2, inward(house, o)
        line, wide = shapely.LineString([middle + 0.4 * into, middle - into]), np.linalg.norm(np.subtract(o.a, o.b))
        out.append(line.buffer(wide / 2 - 0.03, cap_style="flat"))
    out += [free_floor(now, k) for k, s in enumerate(house.storeys) if abs(s.elevation - z) < 0.5]
    for s in house.stairs:
        line = shapely.get_coordinates(shapely.segmentize(shapely.LineString(s.path), 0.1), include_z=True)
        here = line[np.abs(line[:, 2] - z) < 0.5]
        if len(here) > 1:
            out.append(shapely.LineString(here[:, :2]).buffer(s.width / 2, cap_style="square", join_style="mitre"))
    return shapely.union_all(out).difference(
        shapely.union_all([leaf for o in fronts if moment.openness.get(o.id) for leaf in leaves(now, o)])
    )


def off_and_near(lives, name, time, floors):
    """Whether somebody who walks is off the free floor, and whether near another; `floors` keeps what was found."""
    moment = lives.at(time)
    places = {n: np.array(f.place.position) for n, f in moment.people.items()}
    at, z = places.pop(name), lives.now(time)[name].leg.place(time)[0][2]
    key = round(z, 1), *moment.openness.items()
    if key not in floors:
        floors[key] = floor_of(lives.house, moment, z).buffer(1e-4)
    near = [math.dist(at[:2], other[:2]) < 0.4 and abs(at[2] - other[2]) < 1.5 for other in places.values()]
    return not floors[key].covers(shapely.Point(at[:2]).buffer(AGENT_RADIUS - 0.01)), any(near)


@pytest.mark.parametrize("seed", [7, 10])
def test_nobody_walks_through_walls_furniture_doors_or_others(seed):
    _, lives = day(seed)
    walks = [(name, p) for name, own in lives.pieces.items() for p in own if p.leg is not None]
    assert len(walks) > 10 and lives.doors
    rng = np.random.default_rng(seed)
    for name, p in [walks[i] for i in rng.permutation(len(walks))[:40]]:
        assert off_and_near(lives, name, p.begin + (p.end - p.begin) * rng.random(), {}) == (False, False)


def test_the_same_seed_gives_the_same_day_and_people_sleep_at_night_and_eat_at_home():
    house, lives = day(7)
    again = day_of(house, CATALOGUE, seed=7)
    assert lives.doors == again.doors
    for time in ("7:45", "18:30", 43200.0):
        assert lives.at(time).openness == again.at(time).openness and spots(lives, time) == spots(again, time)
        assert {n: f.place for n, f in lives.at(time).people.items()} == {
            n: f.place for n, f in again.at(time).people.items()
        }
    assert day_of(house, CATALOGUE, seed=8).doors != lives.doors
    assert {s.activity for s in spots(lives, "3:00").values()} == {"sleeping"}
    lying = next(iter(lives.at("3:00").people.values()))
    assert lying.pose.joints["pelvis"][0] < -1.5
    others = {s.activity for h in range(24) for s in spots(lives, 3600 * h).values()}
    assert {"eating", "cooking", "washing", "out"} <= others


def test_living_people_answer_where_they_are_awake_and_move_while_an_episode_goes_on():
    house, lives = day(7)
    graph = build_graph(house)
    place, nodes = StoredPlace(house, graph), range(len(graph.positions))
    routes = [Route(f"r{n}", (n, int(graph.neighbours(n)[0])), 0, 0, "go", "test") for n in nodes]
    inputs = {house.name: place}, {house.name: routes}
    everywhere, living = Anna({house.name: graph}, inputs[1], split="test"), Residents(*inputs, split="test")
    manned = set()
    for hour in (3.0, 7.8, 12.5, 18.6):
        awake = {n for n, p in lives.now(3600 * hour).items() if p.spot.activity not in ("sleeping", "out")}
        for node in nodes:
            task = Task(f"t{hour}", "hanna", house.name, Pose(node), FindObject("mug"), (0,), "find a mug", 2.0, 50)
            late = int(hour * 60) - minute_of(task.id)
            situation = Situation(place, task, Pose(node), Mode.MAIN, (0,), None, (), None, late, 0)
            assert len(everywhere.known(situation))
            rooms = {graph.room_of_node[routes[k].path[0]] for k in living.known(situation)}
            assert not rooms or awake
            manned.update((hour, room) for room in rooms)
    assert not any(hour == 3.0 for hour, _ in manned)
    assert len({room for _, room in manned}) > 1 and {hour for hour, _ in manned} >= {7.8, 18.6}


def test_an_observation_among_living_people_names_the_second_only_where_somebody_is_in_sight():
    house = generate_house(7, SMALL)
    lives = day_of(house, CATALOGUE, seed=0)
    place = StoredPlace(house, build_graph(house))
    inputs = EnvInputs({house.name: place}, lambda name: (), "test", rules="living")
    env, walls = HANNA.environments(inputs)(), sight_floor(house, 0)
    sights = set()
    for k in range(40):
        for node in range(len(place.graph.positions)):
            task = Task(f"t{k}", "hanna", house.name, Pose(node), FindObject("bed"), (0,), "find a bed", 2.0, 50)
            seen, second = viewpoint(env.reset(task).sight).world, 60 * minute_of(task.id)
            sights.add(seen)
            now, eye = lives.at(second), place.graph.positions[node, :2]
            lines = [shapely.LineString([eye, f.place.position[:2]]) for f in now.people.values()]
            assert (now.openness or any(map(walls.covers, lines))) == (not seen.endswith("@"))
            if not seen.endswith("@"):
                then = float(seen.partition("@")[2].partition("/")[0])
                assert then <= second and {n: f.place for n, f in lives.at(then).people.items()} == {
                    n: f.place for n, f in now.people.items()
                }
    assert len(sights) > 10


@pytest.mark.parametrize("time", ["25:00", "half past six", -1, float("nan"), "7:75"])
def test_what_is_no_time_of_a_day_is_refused(time):
    with pytest.raises(ValueError, match="18:30"):
        seconds_of(time)
