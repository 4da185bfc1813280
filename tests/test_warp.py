"""MuJoCo Warp shows the house that the classic renderer shows: on Warp's CPU device, where mujoco-warp is installed."""

from __future__ import annotations

import dataclasses
import importlib
import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import two_rooms
from gymnasium.utils.seeding import np_random
from handmade import HandCatalogue, decibels, furnished, of_panes, smooth_pages

from embodied.errors import UnableError
from embodied.gym.driving import DriveSettings, Driving
from embodied.render.camera import camera_at
from embodied.render.classic import Renderer
from embodied.scene.house_meshes import owners

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


@pytest.mark.slow
@pytest.mark.gl
def test_bodies_of_a_batch_drive_and_see_as_each_alone_does(house, lit, classic, device):
    torch = pytest.importorskip("torch")
    from embodied.gym.drive_vector import DriveVectorEnv

    world = SimpleNamespace(name="house", house=house, catalogue=HandCatalogue(), lit=lit)
    settings = DriveSettings(height=SIZE, width=SIZE, farthest=5.0, seconds=0.4)
    envs = DriveVectorEnv(world, settings, 2, device=device, out=torch.from_dlpack)
    seen, _ = envs.reset(seed=3)
    assert {name: x.cpu().numpy() for name, x in seen.items()} in envs.observation_space
    alone = [Driving({"house": world}, dataclasses.replace(settings, observations=())) for _ in range(2)]
    for i, driving in enumerate(alone):
        driving.reset(np_random(3 + i)[0])
    actions = torch.tensor([[1.0, 0.2], [-0.6, 1.0]])
    for k in range(4):
        seen, rewards, terminated, truncated, info = envs.step(actions)
        outcomes = [d.step(a) for d, a in zip(alone, actions.numpy(), strict=True)]
        for i, (driving, outcome) in enumerate(zip(alone, outcomes, strict=True)):
            batched = envs.drivers[i]
            assert np.allclose(batched.position, driving.driver.position, atol=0.01), (k, i)
            assert abs(batched.yaw - driving.driver.yaw) < 0.02 and info["metres"][i] > 0
            assert float(rewards[i]) == pytest.approx(outcome.reward, abs=0.01)
            shot = classic.through(driving.camera(), (SIZE, SIZE))
            assert decibels(shot.rgb, seen["rgb"][i].cpu().numpy()) > 20 and seen["depth"].dtype == torch.float32
            assert np.median(np.abs(shot.depth - seen["depth"][i].cpu().numpy())) < 0.05
    assert truncated.all() and not terminated.any()
    _, rewards, _, truncated, _ = envs.step(actions)
    assert not truncated.any() and not rewards.any(), "what has ended begins anew"
    assert not np.allclose(envs.drivers[0].position, alone[0].driver.position, atol=0.01)
    envs.close()
