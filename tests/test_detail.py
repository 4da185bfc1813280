"""Detail: neutral in the mean, seen from nearby only, and fixed to the world."""

import math

import numpy as np
import pytest

from embodied.assets.materials import MATERIALS
from embodied.assets.records import DETAILS
from embodied.render.camera import Camera, camera_at, pixel_rays
from embodied.render.detail import Detail, pyramid

SIZE = 128


def drawn(camera: Camera, code: int, distance: float) -> np.ndarray:
    """A grey wall in the plane x = 0 as `camera` sees it, which looks straight at it from `distance`."""
    corners = np.array([[[0, -9, -9], [0, 9, -9], [0, 0, 9]]], np.float32)
    detail = Detail(corners, np.array([[-1, 0, 0]], np.float32), np.array([code], np.uint8))
    out = np.full((SIZE, SIZE, 3), 128, np.uint8)
    half = pixel_rays(camera, (SIZE, SIZE), step=2)
    far = (distance / (half @ np.asarray(camera.forward, np.float32))).astype(np.float32)
    n = len(half)
    detail.lay(out, camera, pixel_rays(camera, (SIZE, SIZE)), np.zeros(n, int), far)
    return out.astype(int)


def before_the_wall(distance: float, y: float = 0.0) -> Camera:
    return camera_at((-distance, y, 1.0), 0.0, 0.0, math.pi / 3)


@pytest.mark.parametrize("kind", DETAILS)
def test_a_tile_is_one_in_the_mean_on_every_level_and_fades(kind):
    levels = pyramid(kind)
    assert [len(level) for level in levels] == [512 >> k for k in range(10)]
    assert all(level.mean() == pytest.approx(1.0, abs=1e-3) for level in levels)
    assert levels[0].std() > levels[3].std() > levels[6].std()


def test_materials_show_what_they_are():
    wanted = {"linen/0": "weave", "velvet/0": "nap", "terry/0": "nap", "oak/0": "pores", "leather/0": "pebbles"}
    assert {key: MATERIALS[key].detail for key in wanted} == wanted
    assert all(m.detail in (None, *DETAILS) for m in MATERIALS.values())
    assert MATERIALS["chrome/0"].detail is None


@pytest.mark.parametrize("kind", range(len(DETAILS)))
def test_a_near_wall_shows_its_matter_and_keeps_its_light(kind):
    wall = drawn(before_the_wall(0.4), kind + 1, 0.4)
    assert wall.std() > 0.5
    assert wall.mean() == pytest.approx(128, abs=1.0)


def test_a_far_wall_and_a_smooth_one_stay_as_they_are():
    assert (drawn(before_the_wall(4.0), 1, 4.0) == 128).all()
    assert (drawn(before_the_wall(0.4), 0, 0.4) == 128).all()


def test_threads_stay_on_the_wall_while_the_camera_moves_along_it():
    """A step of ten pixels moves the picture by ten pixels."""
    pixel = 2 * 0.4 * math.tan(math.pi / 6) / SIZE
    here, there = drawn(before_the_wall(0.4), 1, 0.4), drawn(before_the_wall(0.4, 10 * pixel), 1, 0.4)
    middle = slice(30, -30)
    shifts = [np.abs(np.roll(there, k, axis=1) - here)[middle, middle].mean() for k in (10, 0, -10)]
    assert min(shifts[0], shifts[2]) < 0.35 * shifts[1]


def test_pores_run_along_the_grain():
    level, upright = (drawn(before_the_wall(0.3), 3 + 16 * axis, 0.3)[..., 0] for axis in (1, 2))
    rough = lambda a, axis: np.abs(np.diff(a, axis=axis)).mean()
    assert rough(level, 0) > 1.5 * rough(level, 1)
    assert rough(upright, 1) > 1.5 * rough(upright, 0)
