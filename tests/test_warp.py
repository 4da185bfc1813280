"""MuJoCo Warp shows the house that the classic renderer shows: on Warp's CPU device, where mujoco-warp is installed."""

from __future__ import annotations

import importlib
import math
import sys

import mujoco
import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, decibels, furnished, of_panes, smooth_pages

from embodied.assets.people import people
from embodied.errors import UnableError
from embodied.house.moment import Moment, MovingPerson
from embodied.people.gait import Limbs, solved, walk
from embodied.render.camera import camera_at
from embodied.render.classic import Renderer
from embodied.scene.bodies import add_person, stand_people
from embodied.scene.house_meshes import owners
from embodied.scene.model import build_spec

EYE = (2.5, 2.6, 1.2)
SIZE = 64


def test_without_mujoco_warp_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco_warp", None)
    monkeypatch.delitem(sys.modules, "embodied.render.warp", raising=False)
    with pytest.raises(UnableError, match=r"pip install 'embodied-houses\[warp\]'"):
        importlib.import_module("embodied.render.warp")


@pytest.fixture(scope="module", params=["cpu", "cuda:0"])
def device(request):
    pytest.importorskip("mujoco_warp", reason="needs the extra [warp]")
    warp = pytest.importorskip("warp")
    if request.param not in map(str, warp.get_devices()):
        pytest.skip(f"needs {request.param}")
    return request.param


@pytest.fixture(scope="module")
def house():
    pytest.importorskip("mujoco_warp", reason="needs the extra [warp]")
    return furnished(two_rooms())


@pytest.fixture(scope="module")
def lit(house):
    return of_panes(smooth_pages(house, HandCatalogue()), gloss=(0.0, 0.5))


@pytest.fixture(scope="module")
def classic(house, lit):
    with Renderer(house, HandCatalogue(), size=SIZE, lit=lit) as renderer:
        yield renderer


@pytest.fixture(scope="module")
def warped(house, lit, device):
    from embodied.render.warp import WarpRenderer

    with WarpRenderer(house, HandCatalogue(), lit, size=(SIZE, SIZE), device=device) as renderer:
        yield renderer


@pytest.mark.gl
def test_a_panorama_is_the_classic_one(house, classic, warped):
    a, b = classic.panorama(EYE), warped.panorama(EYE)
    same = a.ids == b.ids
    assert same.mean() > 0.99 and decibels(a.rgb, b.rgb) > 30
    inside = same & (a.depth < 10)
    assert inside.mean() > 0.9 and np.abs(a.depth - b.depth)[inside].max() < 0.02
    assert np.array_equal(np.isinf(b.depth), b.ids == 0)
    panes = [i + 1 for i, o in enumerate(owners(house)) if o.endswith("/glass")]
    glass = same & np.isin(a.ids, panes)
    assert glass.sum() > 50, "panes count as what is seen where they are"
    assert np.median(np.abs(a.rgb.astype(int) - b.rgb)[glass]) <= 2, "and colours shine through"


@pytest.mark.gl
def test_every_view_of_a_batch_is_its_own_camera(classic, warped):
    positions = np.array([EYE, (7.0, 2.0, 1.4), (1.0, 3.0, 1.0)])
    yaws, pitches = np.array([0.3, 2.5, -1.2]), np.array([0.0, -0.4, 0.5])
    batch = warped.views(positions, yaws, pitches)
    assert batch.rgb.shape == (3, SIZE, SIZE, 3)
    for k in range(3):
        camera = camera_at(positions[k], yaws[k], pitches[k], math.pi / 2)
        assert decibels(classic.rgb(camera, (SIZE, SIZE)), batch.rgb.numpy()[k]) > 28, k
        assert (classic.depth_and_ids(camera, (SIZE, SIZE))[1] == batch.ids.numpy()[k]).mean() > 0.98, k


@pytest.mark.gl
def test_a_pane_of_two_faces_in_one_place_has_no_holes(house, classic, warped):
    at, yaw = (2.5, 1.4, 1.5), -math.pi / 2
    _, ids = classic.depth_and_ids(camera_at(at, yaw, 0.0, math.pi / 2), (SIZE, SIZE))
    pane = ids == 1 + owners(house).index("window_1/glass")
    assert pane.sum() > 300 and (warped.view(at, yaw).ids[pane] == ids[pane]).mean() > 0.95


def test_a_picture_stays_as_it_is_when_the_next_is_drawn(warped):
    first = warped.view(EYE, 0.0)
    held = first.rgb.copy()
    warped.view(EYE, math.pi)
    assert np.array_equal(first.rgb, held)
    panorama = warped.panorama(EYE)
    held = panorama.depth.copy()
    warped.panorama((7.0, 2.0, 1.4))
    assert np.array_equal(panorama.depth, held)


def test_pictures_are_handed_to_torch_without_a_copy(warped):
    torch = pytest.importorskip("torch")
    batch = warped.views([EYE], [0.0])
    for array, kind in ((batch.rgb, torch.uint8), (batch.depth, torch.float32), (batch.ids, torch.int32)):
        tensor = torch.from_dlpack(array)
        assert tensor.data_ptr() == array.ptr and tensor.dtype == kind and tensor.shape == array.shape


def test_what_is_not_asked_for_is_not_drawn(warped):
    before = warped.views([EYE], [0.0]).ids.numpy().copy()
    colours = warped.views([EYE], [math.pi], sees=("rgb",))
    turned = colours.rgb.numpy().copy()
    assert np.array_equal(colours.ids.numpy(), before)
    assert np.array_equal(turned, warped.views([EYE], [math.pi]).rgb.numpy())


def test_a_batch_larger_than_the_renderer_is_refused(warped):
    with pytest.raises(ValueError, match="7 views.*1 to 6"):
        warped.views([EYE] * 7, [0.0] * 7)
    with pytest.raises(ValueError, match="sound"):
        warped.views([EYE], [0.0], sees=("sound",))


def test_a_person_of_rigid_parts_walks_through_a_house_in_warps_physics_and_pushes_what_lies_there(house):
    mujoco_warp, warp = pytest.importorskip("mujoco_warp"), pytest.importorskip("warp")
    spec, person = build_spec(house, HandCatalogue(), parts=()), people()["mei"]
    ball = spec.worldbody.add_body(name="ball", pos=[2.0, 2.0, 0.15])
    ball.add_freejoint()
    ball.add_geom(size=[0.15, 0, 0], mass=1)
    add_person(spec, "mei", person)
    spec.option.timestep = 0.005
    model = spec.compile()
    data, way = mujoco.MjData(model), np.linspace((1.0, 2.0, 0.0), (3.5, 2.0, 0.0), 60)
    course = walk(limbs := Limbs(person), way, np.zeros(60))
    moves, many = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data)
    for k in range(90):
        moment = Moment(people={"mei": MovingPerson("mei", *solved(limbs, course.at(0.02 * k)))})
        stand_people(model, data, moment)
        many.mocap_pos = warp.array(data.mocap_pos[None], dtype=warp.vec3)
        many.mocap_quat = warp.array(data.mocap_quat[None], dtype=warp.quat)
        for _ in range(4):
            mujoco_warp.step(moves, many)
    places = many.xpos.numpy()[0]
    assert np.linalg.norm(places[model.body("ball").id][:2] - [2.0, 2.0]) > 0.3
    assert (
        np.linalg.norm(places[model.body("mei/chest").id] - data.mocap_pos[model.body("mei/chest").mocapid[0]]) < 0.05
    )
