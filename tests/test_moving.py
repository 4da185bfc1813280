"""Things that move: a moment of a house, what is drawn of it, and the light on it."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace
from unittest.mock import Mock

import cv2
import mujoco
import numpy as np
import pytest
from conftest import two_rooms
from hand_light import TINY
from handmade import HandCatalogue, box_mesh, decibels, furnished

from embodied.assets.people import SITTING, STANDING, people
from embodied.house.house import HouseError, Light, Sky
from embodied.house.moment import Moment, MovingPerson, RigidPose
from embodied.interface import Pose
from embodied.light import bake
from embodied.light.viewer import ViewerLight
from embodied.navigation.doors import lived_name, place_named
from embodied.navigation.graph import build_graph
from embodied.people.day import errand
from embodied.people.strolls import in_sight
from embodied.render.classic import Renderer
from embodied.render.pictures import Baked
from embodied.scene.model import build_spec
from embodied.scene.part import Part
from embodied.world import World

HOUSE = furnished(two_rooms())
SUNNY = dataclasses.replace(
    HOUSE,
    lights=(Light("l1", "living_room_1", None, (2.5, 2.0, 2.2), (1.0, 0.8, 0.6), 1100.0),),
    sky=Sky(11.0, "clear", north=-math.pi / 2),
)
CAMERA = ((4.2, 3.4, 1.5), math.radians(-140), -0.45, 1.2, (120, 160))
TURN = (math.cos(0.4), 0.0, 0.0, math.sin(0.4))


def thing() -> str:
    """The id of something that carries another thing."""
    return next(p.parent for p in HOUSE.placements if p.parent is not None)


def test_a_moved_thing_takes_along_what_stands_on_it():
    root = HOUSE.placement_by_id[thing()]
    child = next(p for p in HOUSE.placements if p.parent == root.id)
    moved = Moment(moved={root.id: RigidPose.upright((1.0, 3.0, 0.0), root.yaw + math.pi / 2)}).applied(HOUSE)
    there, above = moved.placement_by_id[root.id], moved.placement_by_id[child.id]
    x, y = np.subtract(child.position, root.position)[:2]
    np.testing.assert_allclose(np.subtract(above.position, there.position)[:2], [-y, x], atol=1e-9)
    assert math.isclose(above.yaw - child.yaw, math.pi / 2) and above.parent == root.id


def test_an_empty_moment_is_the_house_at_rest_and_a_door_opens_to_a_right_angle():
    assert Moment().is_rest and Moment().applied(HOUSE) == HOUSE
    opened = Moment(openness={"door_1": 1.0}).applied(HOUSE)
    assert {o.id: o.angle for o in opened.openings}["door_1"] == math.pi / 2


@pytest.mark.parametrize(
    ("moment", "error", "words"),
    [
        (Moment(moved={"ghost_1": RigidPose((1.0, 1.0, 0.0))}), ValueError, "ghost_1"),
        (Moment(openness={"window_9": 0.5}), ValueError, "window_9"),
        (Moment(openness={"door_1": 1.5}), ValueError, "between 0"),
        (Moment(moved={"rug_1": RigidPose((math.nan, 1.0, 0.0))}), ValueError, "finite"),
        (Moment(moved={"rug_1": RigidPose((1.0, 1.0, 0.0), (0.0, 0.0, 0.0, 0.0))}), ValueError, "finite"),
        (Moment(moved={"rug_1": RigidPose((1.0, 1.0, 0.0), (0.9, 0.4, 0.0, 0.0))}), ValueError, "lean"),
        (Moment(moved={"rug_1": RigidPose((50.0, 1.0, 0.0))}), HouseError, "outside"),
    ],
)
def test_a_moment_that_a_house_cannot_have_is_refused_by_name(moment, error, words):
    with pytest.raises(error, match=words):
        moment.applied(HOUSE)


def test_what_a_world_refuses_is_not_undone(tmp_path, monkeypatch):
    with World(HOUSE, HandCatalogue(), build_graph(HOUSE), tmp_path) as unlit:
        unlit.open("door_1", 0.5)
        with pytest.raises(ValueError, match="between 0"):
            unlit.open("door_1", 2.0)
        with monkeypatch.context() as m, pytest.raises(ValueError, match="drawn"):
            m.setattr(unlit, "_bring_up_to_date", Mock(side_effect=ValueError("cannot be drawn")))
            unlit.move(thing(), (1.0, 1.0, 0.0))
        assert unlit.moment == Moment(openness={"door_1": 0.5})
        unlit.undo()
        assert unlit.moment.is_rest
        with pytest.raises(ValueError, match="show no bodies"):
            unlit.add("robot", [])
        with pytest.raises(ValueError, match="hour"):
            unlit.at(math.nan)
    with World(HOUSE, HandCatalogue(), build_graph(HOUSE), tmp_path, _tiny()) as lit, pytest.raises(ValueError):
        lit.add(thing(), [])


def test_a_pose_turns_points_as_its_quaternion_says():
    pose = RigidPose((1.0, 2.0, 3.0), TURN)
    np.testing.assert_allclose(pose.points(np.eye(3))[0], [1 + math.cos(0.8), 2 + math.sin(0.8), 3.0])
    assert math.isclose(pose.yaw, 0.8)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """The furnished two-room house on a sunny morning, baked tinily."""
    cache = tmp_path_factory.mktemp("moving")
    with World(SUNNY, HandCatalogue(), build_graph(SUNNY), cache, _tiny()) as w:
        w._bake = bake(SUNNY, HandCatalogue(), cache, TINY)
        yield w


def _tiny():
    return Baked("fast", gloss=False)


@pytest.mark.slow
@pytest.mark.gl
def test_a_thing_that_moves_to_where_it_stands_looks_as_baked_and_undo_gives_the_same_bytes(world):
    rest = world.camera(*CAMERA)
    root = SUNNY.placement_by_id[thing()]
    world.move(root.id, root.position)
    here = world.camera(*CAMERA)
    np.testing.assert_array_equal(here.ids, rest.ids)
    assert decibels(here.rgb, rest.rgb) > 24
    world.undo()
    np.testing.assert_array_equal(world.camera(*CAMERA).rgb, rest.rgb)


@pytest.mark.slow
@pytest.mark.gl
def test_a_body_is_drawn_where_it_is_and_is_brighter_by_the_window_than_in_the_corner(world):
    side = 0.4
    white = box_mesh((-side / 2, -side / 2, 0.0), (side / 2, side / 2, side), (0.8, 0.8, 0.8, 1.0))
    world.add("crate", [Part("", "object", "", white, "crate")])
    number = len(world.owners) + 1
    seen = {}
    for name, place in (("window", (2.5, 0.8, 0.6)), ("far", (4.5, 3.4, 0.6)), ("other room", (8.5, 0.5, 0.6))):
        world.show(Moment(bodies={"crate": RigidPose(place, TURN)}))
        eye = (place[0] - 1.0, place[1] + 0.3, 1.2)
        view = world.camera(eye, math.atan2(-0.3, 1.0), -0.35, 1.2, (96, 96))
        on_it = view.ids == number
        assert on_it.sum() > 200 and abs(float(np.median(view.depth[on_it])) - 0.95) < 0.35
        seen[name] = world.baked().probes.at(np.array([place]), world_room(place)).mean()
        shown = view.rgb[on_it].mean(1)
        assert np.ptp(shown) > 15  # it is no silhouette
    assert seen["window"] > seen["far"]
    world.show(Moment())


def world_room(place) -> str:
    return "living_room_1" if place[0] < 5 else "bedroom_1"


@pytest.mark.slow
@pytest.mark.gl
def test_floors_darken_under_a_thing_and_only_near_it(world):
    flat = box_mesh((-0.5, -0.5, 0.0), (0.5, 0.5, 0.05), (0.1, 0.1, 0.1, 1.0))
    world.add("lid", [Part("", "object", "", flat, "lid")])
    eye = ((1.5, 3.6, 0.2), -math.pi / 2, -0.1, 1.4, (96, 128))
    before = world.camera(*eye)
    world.show(Moment(bodies={"lid": RigidPose((1.5, 2.4, 0.25))}))
    after = world.camera(*eye)
    world.show(Moment())
    floor = world.owners.index("living_room_1/floor") + 1
    same = (before.ids == floor) & (after.ids == floor)
    change = after.rgb.astype(float).mean(2) - before.rgb.astype(float).mean(2)
    assert np.percentile(change[same], 2) < -25 and np.abs(np.percentile(change[same], 60)) < 8


@pytest.mark.slow
@pytest.mark.gl
def test_a_body_that_the_moment_does_not_have_any_more_is_not_drawn_and_leaves_no_shadow(world):
    flat = box_mesh((-0.5, -0.5, 0.0), (0.5, 0.5, 0.05), (0.1, 0.1, 0.1, 1.0))
    small = box_mesh((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (0.5, 0.5, 0.5, 1.0))
    for name, mesh in (("lid", flat), ("cube", small)):
        world.add(name, [Part("", "object", "", mesh, name)])
    eye = ((1.5, 3.6, 0.2), -math.pi / 2, -0.1, 1.4, (96, 128))
    far = RigidPose((8.5, 0.5, 0.1))
    world.show(Moment(bodies={"cube": far}))
    without = world.camera(*eye).rgb
    world.show(Moment(bodies={"cube": far, "lid": RigidPose((1.5, 2.4, 0.25))}))
    world.show(Moment(bodies={"cube": far}))
    np.testing.assert_array_equal(world.camera(*eye).rgb, without)
    world.show(Moment())


@pytest.mark.slow
@pytest.mark.gl
def test_a_robot_without_shadows_leaves_the_house_around_it_as_it_was(world):
    plate = "<body name='plate'><geom type='box' size='.5 .5 .02' rgba='.1 .1 .1 1'/></body>"
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{plate}</worldbody></mujoco>")
    data, views = mujoco.MjData(model), []
    for place, shadows in (((8.5, 0.5, 0.1), True), ((1.5, 2.4, 0.25), False), ((1.5, 2.4, 0.25), True)):
        model.body("plate").pos = place
        mujoco.mj_forward(model, data)
        world.follow(model, data, shadows=shadows)
        views.append(world.camera((1.5, 3.6, 0.2), -math.pi / 2, -0.1, 1.4, (96, 128)))
    world.show(Moment())
    around = cv2.erode((views[0].ids == views[1].ids).astype(np.uint8), np.ones((5, 5))) > 0  # edges are mixed
    assert 0.2 < around.mean() < 1
    np.testing.assert_array_equal(views[1].rgb[around], views[0].rgb[around])
    assert (views[2].rgb[around] != views[0].rgb[around]).any()


@pytest.mark.slow
def test_a_grey_ball_in_mujocos_viewer_takes_the_light_of_the_room_that_it_is_in(world):
    spec = build_spec(SUNNY, HandCatalogue(), lit=world.lit)
    for name in ("one", "other"):
        ball = spec.worldbody.add_body(name=name)
        ball.add_freejoint()
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0], rgba=[0.5, 0.5, 0.5, 1.0])
    model = spec.compile()
    data, light = mujoco.MjData(model), ViewerLight(model, world.baked(), SUNNY)
    places = {"living_room_1": (2.5, 1.0, 1.0), "bedroom_1": (8.5, 0.5, 1.0)}
    seen = {}
    for order in (1, -1):
        for body, place in zip(("one", "other"), list(places.values())[::order], strict=True):
            data.joint(model.body(body).jntadr[0]).qpos[:3] = place
        mujoco.mj_forward(model, data)
        light.shine(data)
        seen[order] = [model.geom_rgba[model.body(b).geomadr[0]] for b in ("one", "other")]
        seen[order] = np.array(seen[order])
    np.testing.assert_array_equal(seen[1], seen[-1][::-1])  # by place, whichever ball it is
    lights = [world.baked().probes.at(np.array([p]), room)[0, 0] for room, p in places.items()]
    gains = world.baked().exposure.near(np.array(list(places.values())))
    assert np.argmax((np.array(lights) * gains).sum(1)) == np.argmax(seen[1][:, :3].sum(1))
    assert np.ptp(seen[1][:, :3].sum(1)) > 0.02


@pytest.mark.slow
@pytest.mark.gl
def test_a_recording_shows_the_house_as_it_is_now(world):
    recorded = pytest.importorskip("embodied.viz.recording")
    root = SUNNY.placement_by_id[thing()]
    logged: dict[str, list] = {}
    stream = SimpleNamespace(log=lambda path, *what, **_: logged.setdefault(path, []).append(what[0]))
    pictures, places, path = [], [], f"house/{root.room}/{root.id}"
    for x in (root.position[0], 1.0):
        world.move(root.id, (x, *root.position[1:]))
        recorded.log_world(stream, world)
        recorded.log_sight(stream, recorded.Views(world, recorded.PictureSizes()), Pose(0, 0.0, 0.0))
        places.append(np.mean(logged[path][-1].vertex_positions.as_arrow_array().to_pylist(), axis=0))
        pictures.append(bytes(logged["view/panorama"][-1].blob.as_arrow_array()[0].as_py()))
    world.show(Moment())
    np.testing.assert_allclose(places[1] - places[0], [1.0 - root.position[0], 0, 0], atol=0.02)
    assert pictures[0] != pictures[1]


@pytest.mark.slow
@pytest.mark.gl
def test_pages_for_others_are_those_that_are_drawn(world):
    root = SUNNY.placement_by_id[thing()]
    world.move(root.id, (1.0, *root.position[1:]))
    shown = world.camera(*CAMERA)
    with Renderer(SUNNY, HandCatalogue(), lit=world.lit) as other:
        again = other.view(*CAMERA)
    world.show(Moment())
    np.testing.assert_array_equal(shown.ids, again.ids)
    assert decibels(shown.rgb, again.rgb) > 45


@pytest.fixture(scope="module")
def evening(tmp_path_factory):
    """The house at night, lit by a ceiling lamp and by one that stands on something; both are bare bulbs."""
    stand = SUNNY.placement_by_id[thing()]
    above = tuple(np.add(stand.position, (0, 0, stand.size[2] + 0.5)))
    lamp = Light("bulb", stand.room, stand.id, above, (1.0, 0.7, 0.4), 900.0)
    house = dataclasses.replace(SUNNY, lights=(*SUNNY.lights, lamp), sky=Sky(23.0, "clear"))
    with World(house, HandCatalogue(), build_graph(SUNNY), tmp_path_factory.mktemp("evening"), _tiny()) as w:
        yield w, stand


@pytest.mark.slow
@pytest.mark.gl
def test_a_lamp_that_is_switched_off_gives_the_picture_of_a_house_without_its_light(evening):
    world, stand = evening
    world.switch(stand.id, False)
    off = world.camera(*CAMERA).rgb
    dark = world.moment.applied(world.house)
    assert [x.on for x in dark.lights] == [True, False]
    with World(dark, HandCatalogue(), world.graph, world.cache, _tiny()) as other:
        np.testing.assert_array_equal(off, other.camera(*CAMERA).rgb)
    world.undo()
    assert np.abs(world.camera(*CAMERA).rgb.astype(int) - off).mean() > 2
    with pytest.raises(ValueError, match="no lights.*moon"):
        world.switch("moon", True)
    world.undo()


@pytest.mark.slow
@pytest.mark.gl
def test_a_carried_lamp_takes_its_light_along(evening):
    world, stand = evening
    there = (1.2, 3.2, 0.0) if stand.position[0] > 2.5 else (4.2, 3.2, 0.0)
    world.switch("l1", False)
    wall = lambda x: world.camera((x, 2.4, 1.2), math.pi / 2, 0.0, 0.9, (64, 64)).rgb[:24].astype(float).mean()
    before = [wall(x) for x in (there[0], 5 - there[0])]
    world.move(stand.id, there)
    after = [wall(x) for x in (there[0], 5 - there[0])]
    assert after[0] > before[0] + 10 and after[0] > after[1] + 10
    truth = world.moment.applied(world.house)
    assert math.dist(truth.lights[1].position[:2], there[:2]) < 1e-6
    world.undo()
    world.undo()
    assert world.moment.is_rest


@pytest.mark.slow
@pytest.mark.gl
def test_a_mirror_shows_a_thing_that_moves_before_it(world):
    mirror = box_mesh((0.0, -0.6, 0.0), (0.02, 0.6, 1.2), (0.9, 0.9, 0.9, 1.0))
    mirror = dataclasses.replace(mirror, finish=dataclasses.replace(mirror.finish, mirror=True, roughness=0.01))
    red = box_mesh((-0.3, -0.3, 0.0), (0.3, 0.3, 1.2), (0.9, 0.02, 0.02, 1.0))
    with World(SUNNY, HandCatalogue(), world.graph, world.cache, Baked("fast")) as glossy:
        glossy._bake = world.baked()
        for name, mesh in (("mirror", mirror), ("red", red)):
            glossy.add(name, [Part("", "object", "", mesh, name)])
        seen = []
        for y in (3.4, 1.2):
            glossy.show(Moment(bodies={"mirror": RigidPose((1.0, 2.0, 0.4)), "red": RigidPose((3.2, y, 0.2))}))
            view = glossy.camera((2.0, 2.8, 1.0), math.atan2(-0.8, -1.0), 0.0, 0.8, (96, 96))
            on_it = view.ids == len(glossy.owners) + 1
            seen.append((view.rgb[on_it][:, 0].astype(int) - view.rgb[on_it][:, 1] > 60).mean())
    assert on_it.mean() > 0.05 and abs(seen[0] - seen[1]) > 0.05


@pytest.mark.slow
@pytest.mark.gl
def test_a_person_is_in_the_picture_in_ids_and_depth_and_shades_the_floor_and_leaves_no_trace(world):
    somebody = next(iter(people().values()))
    at = lambda x, pose: Moment(
        people={"adult_1": MovingPerson(somebody.id, RigidPose.upright((x, 2.4, 0.0), 0.0), pose)}
    )
    eye = ((1.5, 3.6, 1.1), -math.pi / 2, -0.5, 1.4, (96, 128))
    world.show(at(8.5, STANDING))
    before = world.camera(*eye)
    seen = {}
    for name, pose in (("standing", STANDING), ("sitting", SITTING)):
        world.show(at(1.5, pose))
        view = seen[name] = world.camera(*eye)
        person = view.ids == [*world.classes].index("person")
        assert person.sum() > 200 and abs(float(np.median(view.depth[person])) - 1.2) < 0.5
    assert (seen["standing"].ids != seen["sitting"].ids).sum() > 300
    floor = world.owners.index("living_room_1/floor") + 1
    same = (before.ids == floor) & (seen["standing"].ids == floor)
    assert np.percentile(seen["standing"].rgb[same].mean(1) - before.rgb[same].mean(1), 1) < -6
    world.show(at(8.5, STANDING))
    np.testing.assert_array_equal(world.camera(*eye).rgb, before.rgb)
    world.show(Moment())
    with pytest.raises(ValueError, match="no people"):
        world.show(Moment(people={"a": MovingPerson("nobody", RigidPose((1.0, 1.0, 0.0)), STANDING)}))


@pytest.mark.slow
@pytest.mark.gl
def test_who_lives_here_is_in_the_picture_and_the_same_sight_is_the_same_picture_in_any_order(world):
    with World(SUNNY, HandCatalogue(), world.graph, world.cache, _tiny()) as home:
        home._homes[0]._bake = world.baked()
        day = home._day = errand(SUNNY, next(iter(people().values())), (1.0, 1.5), (4.2, 3.2))
        node = next(n for n, eye in enumerate(world.graph.positions) if in_sight(day.at(1.0), eye, SUNNY))
        sight, places = lived_name(SUNNY.name, (1.0, node)), {SUNNY.name: home}
        draw = lambda name: place_named(places, name).panorama(node)
        somebody, nobody = draw(sight), draw(lived_name(SUNNY.name, None))
        person = [*place_named(places, sight).classes].index("person")
        assert (somebody.ids == person).any() and somebody.ids.max() > nobody.ids.max()
        np.testing.assert_array_equal(draw(sight).rgb, somebody.rgb)
        np.testing.assert_array_equal(world.panorama(node).rgb, nobody.rgb)


@pytest.mark.slow
@pytest.mark.gl
def test_a_front_door_that_was_open_leaves_no_daylight_behind(world):
    with World(SUNNY, HandCatalogue(), world.graph, world.cache, _tiny()) as home:
        home._bake = world.baked()
        seen = lambda **ways: (home.show(Moment(openness=ways)), home.camera(*CAMERA).rgb.astype(int))[1]
        rest, inner = home.camera(*CAMERA).rgb.astype(int), seen(door_1=0.9)
        opened = seen(door_1=0.9, front_door_1=0.7)
        assert np.abs(opened - inner).max() > 20
        np.testing.assert_array_equal(seen(door_1=0.9), inner)
        assert np.abs(seen(front_door_1=0.7) - rest).max() > 20
        np.testing.assert_array_equal(seen(front_door_1=0.0), rest)
