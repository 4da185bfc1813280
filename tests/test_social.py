"""People who walk about: the same for the same seed, apart from each other and from walls; contact, measures, ORCA."""

from __future__ import annotations

import dataclasses
import math
import runpy
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import shapely
from conftest import two_rooms
from handmade import HandCatalogue, furnished

from embodied.assets.people import JOINTS, people
from embodied.assets.people.bodies import transforms
from embodied.envs.continuous import CONTACT, Body, ContinuousEnv, ContinuousEpisode, NavigationGoal, social_measures
from embodied.envs.driven import Driver
from embodied.evaluation.evaluate import agent, play
from embodied.generate import HouseConfig, generate_house
from embodied.gym.sensors import with_people
from embodied.house.moment import WIDEST, Moment, MovingPerson
from embodied.interface import AmongPeople, Task
from embodied.kinds.shipped.social import SOCIAL, came
from embodied.kinds.task_kind import EnvInputs, TaskInputs
from embodied.language.plain_language import PlainLanguage
from embodied.navigation.free_space import leaves, room_doors
from embodied.people.errands import Walks
from embodied.people.gait import Limbs, solved
from embodied.people.strolls import PERSON_RADIUS, Crowd, Stroll, Walker, draw_strolls, noticing
from embodied.records import from_json, to_json
from embodied.render.camera import camera_at
from embodied.world import open_world

ACROSS = Stroll("mei", ((4.0, 2.0, 0.0), (1.0, 2.0, 0.0)), 2.0)
"""Three metres towards -x."""


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    with open_world(furnished(two_rooms()), HandCatalogue(), tmp_path_factory.mktemp("social"), size=32) as w:
        yield w


def placed(world, start, *people: Stroll, goal=(3.5, 2.0, 0.0), yaw=0.0, polite=False, **fields) -> ContinuousEnv:
    env = ContinuousEnv(Body(polite=polite))
    goals = (NavigationGoal(goal),)
    env.reset(ContinuousEpisode("1", world.name, start, yaw, "go", goals, 0.3, people=people, **fields), world)
    return env


def test_people_keep_to_the_free_floor_and_apart_and_are_the_same_for_the_same_seed():
    house = generate_house(7, HouseConfig(area=(60, 90)))
    doors = {o.id for o in room_doors(house)}
    shut = [dataclasses.replace(o, angle=0.0) if o.id in doors else o for o in house.openings]
    walks = Walks(dataclasses.replace(house, openings=tuple(shut)))
    ground, start = walks.ground, walks.ground.xyz[0]
    draw = lambda seed: draw_strolls(walks, ("mei", "anna", "jun"), start, rng=np.random.default_rng(seed))
    assert draw(1) == draw(1) != draw(2)
    walkers = [Walker(s) for s in draw(1)]
    times = np.arange(0.0, 120.0, 0.5)
    tracks = [np.array([w.place(t)[:3] for t in times]) for w in walkers]
    assert len(walkers) > 1 and any(s.swings for s in draw(1))
    for k, (stroll, walker, track) in enumerate(zip(draw(1), walkers, tracks)):
        assert shapely.intersects_xy(ground.space.buffer(0.02), *track[:, :2].T).all()
        for t, at in zip(times, shapely.points(track[:, :2])):  # doors are as wide open as it takes
            now = [dataclasses.replace(o, angle=walker.openness(t).get(o.id, 0) * WIDEST) for o in shut]
            mine = [o for o in now if o.id in {s.door for s in stroll.swings}]
            assert all(leaf.distance(at) > 0.19 for o in mine for leaf in leaves(house, o))
        assert np.linalg.norm(np.diff(track, axis=0), axis=1).max() < 1.7 * 0.5
        assert all(np.linalg.norm(track - other, axis=1).min() > 2 * PERSON_RADIUS for other in tracks[:k])
        assert np.linalg.norm(track[0] - start) >= 1.5


def test_a_body_is_drawn_where_its_place_is():
    walker = Walker(ACROSS)
    for t in np.linspace(0, walker.seconds, 20):
        assert math.dist(walker.figure(t).place.position[:2], walker.place(t)[:2]) < 0.1
    assert walker.place(walker.seconds) == pytest.approx(walker.place(0.0))


def test_two_who_pass_through_each_other_between_two_moments_touched():
    crowd = Crowd([Stroll("mei", ACROSS.way, 2.0, begin=1.0)])
    here = crowd.places[0, :3]
    assert crowd.go_on(0.7, here - [1.5, 0, 0], here + [1.0, 0, 0]) == pytest.approx(0.0, abs=1e-6)
    assert math.dist(crowd.places[0, :3], here + [1.0, 0, 0]) > CONTACT


def test_contact_ends_an_episode_unless_people_stand_for_the_body(world):
    for polite, touched in ((False, True), (True, False)):
        env = placed(world, (1.0, 2.0, 0.0), ACROSS, polite=polite)
        while not env.ended and env.steps < 60:
            env.step(2)
        assert env.contact == touched == env.ended


def test_who_finds_somebody_standing_in_the_way_walks_around_them_on_free_floor_or_waits(world):
    walks, stroll = Walks(world.house), ACROSS
    for stands, passed in ((np.array([2.5, 2.0, 0.0]), True), (np.array([1.0, 2.0, 0.0]), False)):
        crowd, seen = Crowd([stroll], walks, polite=True), []
        for _ in range(140):
            assert crowd.go_on(0.1, stands, stands) > CONTACT
            seen.append(crowd.places[0, :3])
        assert walks.ground.space.buffer(1e-3).covers(shapely.MultiPoint(np.array(seen)[:, :2]))
        assert (min(x for x, *_ in seen) < 1.2) == passed
        assert np.linalg.norm(np.diff(seen, axis=0), axis=1).max() < 0.15


def test_people_look_at_who_is_near_and_in_sight_as_far_as_the_neck_lets_them(world):
    person = people()["mei"]
    still = solved(limbs := Limbs(person), limbs.standing(np.array([3.0, 2.0, 0.0]), 0.0))
    now = Moment(people={"mei": MovingPerson("mei", *still)})
    for eye, turns in (((4.5, 2.8, 1.5), 0.49), ((3.2, 3.8, 1.5), 1.2), ((1.5, 2.0, 1.5), 0), ((7.5, 2.0, 1.5), 0)):
        figure = noticing(now, np.array(eye), world.house).people["mei"]
        head = transforms(person, figure.pose)[[*JOINTS].index("head"), :, :3]
        yaw = math.atan2(*(figure.place.rotation @ head @ [0, -1, 0])[1::-1])
        assert yaw == pytest.approx(turns, abs=0.3 if turns else 1e-3)
    crowd = Crowd([ACROSS], Walks(world.house))
    away = [crowd.moment, (crowd.go_on(0.1, *[np.array([2.5, 2.3, 0.0])] * 2), crowd.moment)[1]]
    assert "left_eye" in away[1].people["mei"].pose.joints and "left_eye" not in away[0].people["mei"].pose.joints


def test_measures_by_hand(world):
    far = Stroll("mei", ((4.0, 2.0, 0.0), (4.0, 3.0, 0.0)), 500.0, begin=4.0)  # stands at (4, 3)
    env = placed(world, (1.5, 3.0, 0.0), far, goal=(3.5, 3.0, 0.0))
    for action in (1, 1, 1, 1, 1, 1, 1, 1, 0):
        env.step(action)
    t = env.trajectory()
    numbers = social_measures(t, 500)
    assert t.success == 1.0 and numbers["human_collision"] == 0.0
    assert numbers["psc"] == pytest.approx(6 / 9)  # within a metre from x = 3.25 on
    assert numbers["stl"] == 1.0 and social_measures(dataclasses.replace(t, shortest=0.1), 500)["stl"] == 4 / 9
    follow = placed(world, (1.5, 3.0, 0.0), far, follows=True)
    for action in (1, 1, 1, 2, 2, 2, 2, 2):
        follow.step(action)
    numbers = social_measures(follow.trajectory(), 8)
    assert (numbers["found"], numbers["steps_to_find"]) == (1.0, 2.0)  # 2 m away after two steps
    assert numbers["following"] == 6 / 8 and numbers["success"] == 1.0  # 60 degrees are faced, 75 are not


def test_orca_keeps_two_discs_apart_for_as_long_as_it_says_and_arrives_where_nobody_is_in_the_way(world):
    pytest.importorskip("stable_baselines3")
    script = runpy.run_path(str(Path(__file__).parents[1] / "examples" / "social_navigation.py"))
    rng = np.random.default_rng(0)
    for p, v in zip(rng.uniform(-3, 3, (300, 2)), rng.uniform(-1.5, 1.5, (300, 2))):
        if np.hypot(*p) > 0.6:
            nearest = lambda v, p=p: np.linalg.norm(p - v * np.clip(p @ v / max(v @ v, 1e-12), 0, script["TIME"]))
            change, normal = script["half_plane"](p, v, 0.55, 0.25)
            assert nearest(v + change) == pytest.approx(0.55, abs=1e-6)
            assert (nearest(v) < 0.55) == (change @ normal > 1e-9)
    away = Stroll("mei", ((7.0, 2.0, 0.0), (8.0, 2.0, 0.0)), 5.0)
    for rule in (script["WaitAndGo"], script["Orca"]):
        env = placed(world, (1.5, 3.0, 0.0), away)
        acts = rule(env)
        while not env.ended:
            env.step(acts.action())
        assert env.trajectory().success == 1.0, rule


def test_a_person_stands_in_the_depth_where_they_are():
    camera = camera_at((0.0, 0.0, 1.0), 0.0, 0.0, 1.0)
    seen = with_people(np.full((21, 41), 9.0), camera, np.array([[3.0, 1.0, 0.0]]))
    rows, columns = np.nonzero(seen < 9)
    assert seen.min() == pytest.approx(3.0 - PERSON_RADIUS, abs=0.1) and columns.max() < 20  # to the left
    assert not (with_people(np.full((21, 41), 1.0), camera, np.array([[3.0, 1.0, 0.0]])) < 1).any()


def test_on_the_graph_contact_ends_the_episode_and_tasks_are_kept_as_they_are(world):
    tasks = SOCIAL.tasks(TaskInputs(world, (), 3, PlainLanguage()), [("main", 8)])["main"]
    assert all(from_json(Task, to_json(t)) == t for t in tasks) and any(t.goal.strolls for t in tasks)
    task = tasks[0]
    path = world.graph.path(task.start.node, task.goal_nodes[0])[::-1]
    way = tuple((x, y, 0.0) for x, y, _ in world.graph.positions[list(path)].tolist())
    towards = dataclasses.replace(task, goal=AmongPeople((Stroll("mei", way, 1.0),)))
    make = SOCIAL.environments(EnvInputs({world.name: world}))
    met, free = play(
        make, agent("social", "shortest"), [towards, dataclasses.replace(task, goal=AmongPeople(()))], seed=0
    )
    judge = SOCIAL.success
    assert came(met, world.graph) < CONTACT and not judge(met, world.graph) and met.ended == "limit"
    assert judge(free, world.graph)


@pytest.mark.gl
def test_environments_show_people_and_tell_the_measures(world):
    small = {"worlds": {world.name: world}, "height": 16, "width": 32, "observations": "depth"}
    env = gymnasium.make("embodied/SocialNav-v0", **small)
    a, info = env.reset(seed=0)
    b, _ = gymnasium.make("embodied/SocialNav-v0", **small).reset(seed=0)
    assert all(np.array_equal(a[k], b[k]) for k in a) and a["goal"].shape == (2,)
    *_, info = env.step(0)
    assert {"psc", "stl", "human_collision"} <= set(info)
    follow = gymnasium.make("embodied/FollowNav-v0", **small)
    follow.reset(seed=0)
    assert {"found", "following"} <= set(follow.step(0)[-1])
    drive = gymnasium.make("embodied/Drive-v0", people=2, polite=False, **small).unwrapped
    drive.reset(seed=0)
    driving = drive.driving
    x, y, z, heading = driving.crowd.places[0]
    ahead = np.array([math.cos(heading), math.sin(heading)])
    driving.driver.place(np.array([x, y, z + 1.5] + [*(0.6 * ahead), 0]), heading)  # in whose way it stands
    while driving.ended is None:
        *_, ended, _, info = drive.step(np.zeros(2))
    assert ended and driving.ended == "contact" and info["human_collision"] == 1.0


def test_a_person_stops_wheels_and_pushes_them_and_opens_the_door_that_they_cannot():
    shut = Moment(openness={"door_1": 0.0}).applied(furnished(two_rooms()))
    driver = Driver(shut, HandCatalogue(), ["mei"], ["door_1"])
    someone, door = solved(limbs := Limbs(people()["mei"]), limbs.standing(np.array([2.0, 2.0, 0.0]), 0.0)), "door_1"
    stands = Moment(people={"mei": MovingPerson("mei", *someone)})
    driver.place(np.array([3.0, 2.0, 1.5]), math.pi)
    driver.stand(stands)
    assert "mei" in driver.roll(0.6, 0.0, 150, stands).collisions and driver.position[0] > 2.2
    before = driver.position
    nearer = solved(limbs, limbs.standing(np.array([2.4, 2.0, 0.0]), 0.0))
    driver.roll(0.0, 0.0, 50, Moment(people={"mei": MovingPerson("mei", *nearer)}))
    assert driver.position[0] > before[0] + 0.2
    for opened, passes in ((0.0, False), (1.0, True)):
        driver.place(np.array([4.2, 1.05, 1.5]), 0.0)
        driver.roll(0.6, 0.0, 250, Moment(openness={door: opened}))
        assert (driver.position[0] > 5.3) == passes
