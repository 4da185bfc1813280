"""Cameras: the ideal one changes nothing, the others do what their traits say and the same again from the same seed."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from embodied.render import photograph as lab
from embodied.render.photograph import CAMERAS, RANGES, CameraTraits, PhotoCamera, check_camera, photograph
from embodied.seeds import stream

VFOV = math.radians(60)


def plain(**changes) -> CameraTraits:
    """A device whose traits do nothing, but for those given."""
    nothing = CameraTraits(0.0, 0.0, 2.0, 0.0, 0.0, 0.9, 0.0, 0.0, (0.0, 0.0), 100_000, 1.0, 0.0, 100)
    return dataclasses.replace(nothing, **changes)


@pytest.fixture
def picture():
    """Smooth colours with a bright window."""
    y, x = np.mgrid[0:96, 0:128] / 96
    rgb = np.stack([90 + 60 * x, 80 + 50 * y, 70 + 30 * x * y], -1).astype(np.uint8)
    rgb[20:40, 30:50] = 255
    return rgb


def test_the_ideal_camera_gives_back_the_picture_itself(picture):
    camera = PhotoCamera("ideal", 5)
    assert camera.photographed(picture, VFOV, 1) is picture and camera.traits is None
    ids = np.arange(12, dtype=np.int32).reshape(3, 4)
    assert camera.bent(ids, VFOV) is ids


@pytest.mark.parametrize("name", CAMERAS[1:])
def test_a_seed_is_a_device_and_a_place_is_a_photograph(picture, name):
    one = PhotoCamera(name, 3).photographed(picture, VFOV, "house", 4)
    assert one.shape == picture.shape and one.dtype == np.uint8
    assert np.array_equal(one, PhotoCamera(name, 3).photographed(picture, VFOV, "house", 4))
    assert not np.array_equal(one, PhotoCamera(name, 3).photographed(picture, VFOV, "house", 5)), "noise"
    assert PhotoCamera(name, 3).traits != PhotoCamera(name, 4).traits
    before = picture.copy()
    PhotoCamera(name, 3).photographed(picture, VFOV)
    assert np.array_equal(picture, before), "the ideal picture stays"


@pytest.mark.parametrize("name", CAMERAS[1:])
def test_traits_lie_in_their_ranges(name):
    for seed in range(50):
        traits = lab.camera_traits(name, rng=stream(seed, "traits"))
        values = {**dataclasses.asdict(traits), "k1": traits.radial[0], "k2": traits.radial[1]}
        assert all(low - 0.5 <= values[k] <= high + 0.5 for k, (low, high) in RANGES[name].items())
        assert all(low <= values[k] <= high for k, (low, high) in RANGES[name].items() if k not in ("rows", "jpeg"))
    with pytest.raises(ValueError, match="'pinhole' is unknown"):
        check_camera("pinhole")


def test_a_device_without_traits_changes_next_to_nothing(picture):
    out = photograph(picture, plain(), VFOV, rng=stream(0, "noise"))
    assert np.abs(out.astype(int) - picture)[:, 60:].max() <= 6, "JPEG alone"
    every = np.arange(256, dtype=np.uint8)[None, :, None].repeat(3, 2)
    assert np.abs(lab.shown(lab.expanded(every), 0.9).astype(int) - every).max() <= 1
    assert lab.expanded(every)[0, -1, 0] == pytest.approx(3.7, abs=0.01), "windows are brighter than paper"


def test_exposure_opens_in_the_dark_and_closes_in_the_light_within_its_stops():
    dark, bright = np.full((32, 48, 3), 0.06, np.float32), np.full((32, 48, 3), 0.6, np.float32)
    assert lab.exposure(dark, plain(metering=1.0)) * 0.06 == pytest.approx(0.18, rel=0.05)
    assert lab.exposure(bright, plain(metering=1.0)) * 0.6 == pytest.approx(0.18, rel=0.05)
    assert 1 < lab.exposure(dark, plain(metering=0.5)) < lab.exposure(dark, plain(metering=1.0))
    assert lab.exposure(dark, plain(metering=1.0, most=1.0)) == 2.0
    assert lab.exposure(bright, plain()) == 1.0
    assert lab.exposure(dark, plain(bias=0.5)) == pytest.approx(2**0.5)


def test_balance_takes_out_some_of_the_colour_of_light():
    lamp = np.full((8, 8, 3), (0.5, 0.4, 0.2), np.float32)
    assert np.ptp(lamp[0, 0] * lab.balance(lamp, plain(balancing=1.0))) < 0.01
    half = lamp[0, 0] * lab.balance(lamp, plain(balancing=0.5))
    assert 1 < half[0] / half[2] < 2.5
    off = lab.balance(lamp, plain(warmth=0.1))
    assert off[0] / off[2] == pytest.approx(math.exp(0.1), rel=1e-4) and off[1] == 1.0


def test_bloom_spreads_light_and_loses_none():
    lamp = np.zeros((128, 128, 3), np.float32)
    lamp[60:68, 60:68] = 50.0
    out = lab.bloomed(lamp, 0.05)
    assert out.sum() == pytest.approx(lamp.sum(), rel=0.02)
    ring = [out[64, 68 + r, 0] for r in (3, 8, 20, 50)]
    assert all(a > b > 0 for a, b in zip(ring, ring[1:])), "ever less further away"
    assert np.array_equal(lab.bloomed(lamp, 0.0), lamp)


def test_corners_darken_by_the_cosine():
    share = lab.corners(4.0, math.radians(90), 101, 101)
    assert share[50, 50] == 1.0
    assert share[50, 0] == pytest.approx(math.cos(math.atan(50 / 50.5)) ** 4, rel=1e-4)
    assert share[0, 0] < share[0, 50] < share[25, 50]


@pytest.mark.parametrize("k1", [-0.2, 0.1])
def test_the_lens_bends_lines_and_keeps_within_the_picture(k1):
    x, y = lab.lens_map((k1, 0.0), VFOV, 120, 160)
    assert x.min() >= -1e-3 and x.max() <= 159.001 and y.min() >= -1e-3 and y.max() <= 119.001
    assert (x[60, 80], y[60, 80]) == pytest.approx((80, 60), abs=0.1), "the middle stays in the middle"
    focal = 60 / math.tan(VFOV / 2)
    to_lens = lambda x, y: np.hypot(x - 79.5, y - 59.5) / focal
    ideal, pixel = to_lens(x[10, 20], y[10, 20]), to_lens(20, 10)
    scale = to_lens(x[59, 79], y[59, 79]) / to_lens(79, 59)
    assert ideal * (1 + k1 * ideal**2) == pytest.approx(pixel * scale, rel=1e-3), "Brown's formula"
    bow = y[20, 80] - y[20, 2]  # the ideal row that a straight row of the photograph shows, middle against edge
    assert bow > 0.5 if k1 < 0 else bow < -0.2


def test_ids_and_depth_follow_the_lens_and_hold_nothing_new():
    camera = PhotoCamera("robot", 1)
    ids = (np.arange(96 * 128) // 37).astype(np.int32).reshape(96, 128) + 2**24
    bent = camera.bent(ids, VFOV)
    assert bent.dtype == np.int32 and set(bent.ravel()) <= set(ids.ravel()) and not np.array_equal(bent, ids)
    assert camera.bent(ids, None) is ids, "pictures of all directions know no lens"
    x, y = lab.lens_map(camera.traits.radial, VFOV, 96, 128)
    assert bent[5, 7] == ids[round(float(y[5, 7])), round(float(x[5, 7]))]


def test_noise_grows_in_the_dark_with_gain_and_falls_when_pixels_are_averaged():
    grey = np.full((200, 200, 3), 0.2, np.float32)
    traits = plain(rows=200, iso=300.0, read_noise=3.0)
    deviation = lambda light, dark, t: float(lab.noisy(light, 1.0, t, dark, rng=stream(0, "n")).std() / light.mean())
    wanted = math.sqrt(0.2 / 2000 + (3 / 2000) ** 2) / 0.2  # 6000 electrons at ISO 100: 2000 at ISO 300
    assert deviation(grey, 1.0, traits) == pytest.approx(wanted, rel=0.03)
    assert deviation(grey / 8, 1.0, traits) > 2.5 * deviation(grey, 1.0, traits)
    assert deviation(grey, 4.0, traits) > 1.9 * deviation(grey, 1.0, traits), "a darker room"
    binned = dataclasses.replace(traits, rows=800)
    assert deviation(grey, 1.0, binned) == pytest.approx(wanted / 4, rel=0.03)
