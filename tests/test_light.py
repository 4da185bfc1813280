"""Light: closed forms of energy, noise, the sky, and exposure."""

from __future__ import annotations

import dataclasses
import itertools
import os
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from conftest import two_rooms
from hand_light import TINY
from handmade import box_mesh

from embodied.assets.people import POSES, people, posed
from embodied.assets.records import Finish, MeshPart
from embodied.bench.light import psnr, ssim
from embodied.house.house import House, Light, Room, Sky, Storey
from embodied.light import LightError, settings_of
from embodied.light.backend import array, drjit, find_llvm, floats, variant_of
from embodied.light.baking import check, compose, solve
from embodied.light.baking.denoise import Grid, smooth_pages
from embodied.light.baking.house import brightest
from embodied.light.pages.atlas import atlas_of, things_of
from embodied.light.pages.colours import ColourMaps
from embodied.light.pages.cover import rasterise
from embodied.light.pages.tone import Exposure, develop
from embodied.light.pages.unwrap import areas_of
from embodied.light.settings import LightSettings
from embodied.light.tracing import luxels, radiosity
from embodied.light.tracing.emitters import lamps_of, portals_of
from embodied.light.tracing.sky import Outdoors, paint, sun_direction, sun_height
from embodied.scene.landscapes import Scenery
from embodied.scene.part import Part
from embodied.software import keep_drawing_to_threads, threads_allowed

pytestmark = [pytest.mark.slow, pytest.mark.gl]

DARK = Outdoors(
    np.full((64, 128, 3), 1e-9, np.float32),
    np.array([0.0, 0.0, 1.0]),
    np.zeros(3),
    np.full((64, 256, 3), 1e-9, np.float32),
)
SRGB_HALF = 0.7353569831
"""sRGB value of linear 0.5."""


def closed_box(size: float, finish: Finish, lights: tuple[Light, ...] = ()):
    """A box seen from inside, its luxels and its light."""
    room = Room("box_1", "hall", ((0, 0), (size, 0), (size, size), (0, size)), *["paint_white/0"] * 4)
    house = House(0, "box", (Storey(0.0, size),), (room,), (), (), lights)
    mesh = box_mesh((0, 0, 0), (size, size, size), finish.color)
    inward = dataclasses.replace(mesh, faces=mesh.faces[:, ::-1], normals=-mesh.normals, finish=finish)
    part = Part("box_1/wall_0", "wall", "box_1", inward, "box")
    atlas = atlas_of(things_of([part], LightSettings(density=8.0, budget=100), None))
    lamps = lamps_of(house, atlas)
    lux = luxels.with_glow(luxels.luxels_of(atlas, ColourMaps()), house, atlas, lamps)
    space = radiosity.with_env(radiosity.space_of(atlas, lux.texels), DARK.picture)
    settings = dataclasses.replace(TINY, bounce_rays=16, seen_rays=32, lamp_rays=24)
    return lux, solve.solve(solve.BakeInput(house, atlas, lux, space, DARK, lamps, settings))


def test_in_a_furnace_light_is_emission_over_absorption():
    """Every wall glows with L and reflects a: e = L + a e everywhere, so e = L / (1 - a)."""
    _, light = closed_box(2.0, Finish((SRGB_HALF, SRGB_HALF, SRGB_HALF, 1.0), emission=(1.0, 2.0, 0.5)))
    ambient = luxels.AMBIENT / 0.5
    for channel, emitted in enumerate((1.0, 2.0, 0.5)):
        assert np.median(light.soft[:, channel]) == pytest.approx(emitted / 0.5 + ambient[channel], rel=0.02)
        assert np.percentile(light.soft[:, channel], 2) > emitted / 0.5 * 0.93


def test_a_closed_box_absorbs_exactly_what_its_lamp_gives():
    """Sum of (1 - a) E dA over the walls is the lamp's flux, all bounces included."""
    lumens = 1000.0
    lamp = Light("l", "box_1", None, (2.0, 2.0, 2.0), (1.0, 1.0, 1.0), lumens)
    lux, light = closed_box(4.0, Finish((SRGB_HALF, SRGB_HALF, SRGB_HALF, 1.0)), (lamp,))
    e = light.soft[:, 1] - luxels.AMBIENT[1]
    absorbed = float((lux.area * (1 - lux.albedo[:, 1]) * e).sum() * np.pi * 100)
    assert absorbed == pytest.approx(lumens, rel=0.03)
    assert float(lux.area.sum()) == pytest.approx(6 * 16.0, rel=1e-3)


def test_sky_through_a_hole_matches_the_form_factor_of_a_rectangle():
    """Under the middle of a w x w uniform opening at height h, e / L is the textbook configuration factor."""
    w, h = 2.0, 1.5
    from embodied.light.tracing.emitters import GLAZING, Portal

    portal = Portal("p", "r", np.array([-w / 2, -w / 2, h]), np.array([0.0, w, 0.0]), np.array([w, 0.0, 0.0]))
    assert portal.normal == pytest.approx([0, 0, -1])
    far_below = box_mesh((-1, -1, -9), (1, 1, -8), (0.5, 0.5, 0.5, 1.0))
    atlas = atlas_of(
        things_of([Part("a/b", "wall", "a", far_below, "x")], LightSettings(density=1.0, budget=100), None)
    )
    space = radiosity.space_of(atlas, [rasterise(p, 1) for p in atlas.pages])
    space = radiosity.with_env(space, np.full((64, 128, 3), 3.0, np.float32))
    up = np.tile([[0.0, 0.0, 1.0]], (64, 1))
    p = radiosity.points_of(np.zeros((64, 3)), up, up, np.zeros(64, bool))
    e = array(radiosity.sky_light(space, p, portal, 256)).mean(0) / (3.0 * GLAZING)
    x = (w / 2) / h
    quarter = 2 * x / np.sqrt(1 + x * x) * np.arctan(x / np.sqrt(1 + x * x)) / (2 * np.pi)  # Siegel & Howell, C-11
    assert e == pytest.approx(np.full(3, 4 * quarter), rel=0.02)


def test_hidden_luxels_take_their_neighbours_light_nearby_and_their_own_shadow_farther_in():
    """A row of which the left six luxels are seen and bright, and the rest lie below a bed that lets a tenth in."""
    good = np.arange(24) < 6
    own = np.where(good, 1.0, 0.1)[:, None].astype(np.float32)
    how = compose.filling(np.arange(24), good, (1, 24))
    row = compose.filled(how, own)[0, :, 0]
    assert (row[:7] == 1.0).all() and (np.diff(row) <= 0).all() and row[14:] == pytest.approx(0.1)
    assert compose.filled(how, 1.1 - own)[0, :, 0] == pytest.approx(0.1)  # never brighter than beside it


def test_a_glint_that_reaches_no_luxel_adds_nothing():
    """Dr.Jit refuses loops over no points: a flat of 56 (seed 0) could not be lit."""
    inputs = SimpleNamespace(space=None, lux=SimpleNamespace())
    assert solve._lit_by(inputs, None, np.zeros(0, np.int64)).shape == (0, 3)


def test_noise_goes_and_an_edge_stays():
    mesh = box_mesh((0, 0, 0), (2.0, 2.0, 2.0), (0.5, 0.5, 0.5, 1.0))
    atlas = atlas_of(
        things_of([Part("a/wall_0", "wall", "a", mesh, "a")], LightSettings(density=20.0, budget=100), None)
    )
    lux = luxels.luxels_of(atlas, ColourMaps())
    left, all_ = lux.position[:, 0] < 1.0, np.ones(len(lux.area), bool)
    clean = np.where(left, 1.0, 4.0)[:, None].repeat(3, 1).astype(np.float32)
    noise = np.random.default_rng(0).normal(0, 0.1, (len(clean), 1)).astype(np.float32)
    variance, likeness = np.square(0.1 * clean[:, 0]), (0.12, 0.12, 0.12)
    out = smooth_pages(clean * (1 + noise), Grid(atlas, lux.texels), all_, variance=variance, likeness=likeness)
    assert np.abs(out / clean - 1).mean() < 0.4 * np.abs(noise).mean()
    assert out[left].max() < 1.6 and out[~left].min() > 3.0


def test_luxels_stand_for_what_they_cover_however_finely_a_sheet_is_cut(tmp_path):
    cuts = np.append(0.0, np.linspace(0.5, 1.0, 41))
    points = np.array([(x, y, 0.0) for x in cuts for y in np.linspace(0, 1, 41)])
    first = (np.arange(len(cuts) - 1)[:, None] * 41 + np.arange(40)).reshape(-1, 1)
    faces = np.concatenate([first + [0, 41, 42], first + [0, 42, 1]]).astype(np.int32)
    sheet = MeshPart(points, faces, np.tile([0.0, 0, 1], (len(points), 1)), points[:, :2], Finish((0.5,) * 3 + (1.0,)))
    part = Part("sheet_1", "object", "a", sheet, "sheet")
    lux = luxels.luxels_of(atlas_of(things_of([part], LightSettings(budget=200), tmp_path)), ColourMaps())
    fine = lux.position[:, 0] > 0.5
    assert len(lux.area) < len(faces) / 4 and lux.area.sum() == pytest.approx(1)
    assert lux.area[fine].sum() == pytest.approx(0.5, abs=0.06)


def test_pixels_left_out_do_not_count_in_the_bench():
    a, b = np.full((40, 60, 3), 100, np.uint8), np.full((40, 60, 3), 110, np.uint8)
    b[:, 40:] = 250
    assert psnr(a, b, np.arange(60)[None].repeat(40, 0) < 30) == pytest.approx(20 * np.log10(255 / 10), abs=1e-6)
    assert psnr(a, b) < 10 and ssim(a, b, np.arange(60)[None].repeat(40, 0) < 30) > 0.98 > ssim(a, b)


def test_the_sun_rises_in_the_east_stands_south_at_noon_and_is_below_at_midnight():
    north = np.pi / 2
    morning, noon = sun_direction(Sky(8.0, "clear", north)), sun_direction(Sky(12.0, "clear", north))
    assert morning[0] > 0.5 and noon[1] < -0.5 and abs(noon[0]) < 1e-6
    assert sun_height(0.0) < -0.5 < 0.5 < sun_height(12.0)
    assert np.linalg.norm(morning) == pytest.approx(1.0)


def test_the_outdoors_gets_darker_from_noon_over_dusk_to_night_and_depends_on_the_seed_alone():
    place = Scenery("fields", "summer", 0.15, 0.0)
    brightness = [paint(Sky(hour), 1, place, 128).picture.mean() for hour in (12.0, 18.3, 19.0, 23.0)]
    assert all(a > 3 * b for a, b in itertools.pairwise(brightness))
    assert (paint(Sky(12.0), 5, place, 128).fine == paint(Sky(12.0), 5, place, 128).fine).all()
    assert not paint(Sky(12.0, "overcast"), 1, place, 128).sun.any()


def test_exposure_is_smooth_through_a_door_and_brightens_dark_rooms():
    rooms = (((0, 0), (4, 0), (4, 4), (0, 4)), ((4, 0), (8, 0), (8, 4), (4, 4)))
    exposure = Exposure(rooms, np.array([[0, 2.6]] * 2), np.array([[1.0] * 3, [8.0] * 3]), np.ones(3))
    x = np.arange(0.5, 7.5, 0.01)
    gain = exposure.at(np.stack([x, np.full_like(x, 2.0), np.full_like(x, 1.5)], 1))[:, 0]
    assert gain[0] == pytest.approx(1.0, rel=0.05) and gain[-1] == pytest.approx(8.0, rel=0.05)
    assert (np.diff(gain) > -1e-5).all() and (gain[1:] / gain[:-1]).max() < 1.04
    many = np.random.default_rng(0).uniform((-2, -2, -1), (10, 6, 4), (500, 3))
    assert np.abs(np.log(exposure.near(many) / exposure.at(many))).max() < 0.25, "the nearest of the grid's points"
    np.testing.assert_allclose(exposure.many(many), exposure.at(many), rtol=2e-3)


def test_the_film_curve_rises_and_keeps_black_black():
    grey = np.repeat(np.linspace(0, 6, 200)[:, None], 3, 1)
    shown = develop(grey, np.ones(3))
    assert (np.diff(shown[:, 0]) >= 0).all() and shown[0].max() == 0 and shown[-1].min() > 0.97


def test_the_newest_llvm_that_can_be_used_is_found(tmp_path, monkeypatch):
    for name in ("libLLVM-9.so.1", "libLLVM-17.so.1", "libLLVM.so.19.1", "libLLVM-99.so.1", "libclang-20.so.1"):
        (tmp_path / name).touch()
    monkeypatch.setattr("embodied.light.backend._LLVM_PLACES", (str(tmp_path / "lib*"),))
    assert find_llvm() == str(tmp_path / "libLLVM.so.19.1")


def test_cuda_goes_before_llvm_and_without_both_the_remedy_is_said():
    assert variant_of(lambda name: True) == "cuda_ad_rgb"
    assert variant_of(lambda name: name == "LLVM") == "llvm_ad_rgb"
    with pytest.raises(LightError, match=r"needs LLVM 15 .*neither works here; run `embodied doctor --fix`.*unlit"):
        variant_of(lambda name: False)


def test_a_process_takes_no_more_threads_than_it_is_given(monkeypatch):
    monkeypatch.setattr("embodied.software.processors", lambda: 3)
    nothing = dict.fromkeys(("", "0", "-2", "many"))
    for text, threads in {"1": 1, "2,4": 2, " 3 ": 3, "64": 3, **nothing}.items():
        monkeypatch.setenv("OMP_NUM_THREADS", text)
        assert threads_allowed() == threads, text
    monkeypatch.delenv("OMP_NUM_THREADS")
    assert threads_allowed() is None


def test_drawing_keeps_to_the_threads_of_a_process(monkeypatch):
    told = []
    monkeypatch.setattr(cv2, "setNumThreads", told.append)
    monkeypatch.setattr("embodied.software.processors", lambda: 3)
    for given, mesa in ((None, None), ("1", "0"), ("2", "2")):
        monkeypatch.setenv("LP_NUM_THREADS", "")  # so that what was there comes back
        monkeypatch.delenv("LP_NUM_THREADS")
        monkeypatch.setenv("OMP_NUM_THREADS", given or "")
        keep_drawing_to_threads()
        assert os.environ.get("LP_NUM_THREADS") == mesa, given
    assert told == [1, 2]
    monkeypatch.setenv("LP_NUM_THREADS", "1")
    keep_drawing_to_threads()
    assert os.environ["LP_NUM_THREADS"] == "1", "whoever set Mesa's own switch meant it"


def test_where_numpy_puts_its_arrays_no_kernel_is_compiled_for():
    """Eight ways to lie in memory, one kernel: Dr.Jit compiles loads of aligned and of other addresses apart."""
    dr, spots = drjit(), range(0, 64, 8)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for k in spots:
            room = np.zeros(4096 + 64, np.uint8)[k:][:4096].view(np.float32)
            room[:] = np.arange(1024)
            out = floats(room) * 3.0 + 1.0
            dr.eval(out)
            np.testing.assert_array_equal(np.asarray(out), np.arange(1024) * 3.0 + 1.0)
        made = [k["hash"] for k in dr.kernel_history() if "hash" in k]
    assert len(made) == len(spots) and len(set(made)) == 1


def test_the_verdict_counts_luxels_beyond_a_tenth_and_its_noise():
    one, none, where = np.ones(20), np.zeros(20), np.zeros((20, 3))
    off = lambda k, by: np.where(np.arange(20) < k, 1 + by, 1.0)
    assert check.judge(off(5, 0.3), one, none, where)[1] == "" and check.judge(off(6, 0.3), one, none, where)[1]
    assert check.judge(off(20, 0.11), one, none, where)[1] and not check.judge(off(20, 0.09), one, none, where)[1]
    assert not check.judge(off(9, 0.3), one, one * 0.15, where)[1], "what the tracer itself does not know is no fault"


def test_an_unknown_quality_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="fast.*high.*normal"):
        settings_of("beautiful")
    assert issubclass(LightError, RuntimeError)


def test_windows_are_portals_that_look_into_their_room():
    house = two_rooms()
    portals = {p.id: p for p in portals_of(house)}
    assert sorted(portals) == ["window_1", "window_2"]
    assert portals["window_1"].normal == pytest.approx([0, 1, 0]) and portals["window_2"].normal == pytest.approx(
        [0, -1, 0]
    )
    assert portals["window_1"].area == pytest.approx(2.0 * 1.2)


def test_exposure_does_not_hang_on_which_side_of_a_leap_a_percentile_falls() -> None:
    """One luxel in a hundred more in the sun: the 97th percentile goes from 2 to 10, what is exposed for hardly."""
    rng = np.random.default_rng(0)
    room = lambda lit: (
        np.where(np.arange(10_000) < 10_000 * lit, 10.0, rng.uniform(0.5, 2.0, 10_000))[:, None] * np.ones(3)
    )
    fewer, more = room(0.026), room(0.036)
    assert np.percentile(more, 97) / np.percentile(fewer, 97) > 4
    assert brightest(more).mean() / brightest(fewer).mean() < 1.4
    assert np.allclose(brightest(np.full((100, 3), 0.7)), 0.7)


def test_skin_of_people_has_finer_texels_than_cloth_and_what_is_inside_them_no_luxels(tmp_path):
    anna = people()["anna"]
    parts = [
        Part("person_1", "object", "a", mesh, f"people/anna#{i}")
        for i, mesh in enumerate(posed(anna, POSES["waiting"], 2))
    ]
    atlas = atlas_of(things_of(parts, LightSettings(density=20.0, budget=800.0, sharpness=0.45), tmp_path))
    fine = {}
    for page in atlas.pages:
        on_page = areas_of(np.pad(page.luxels * page.fineness, ((0, 0), (0, 0), (0, 1)))).sum()
        skin = any("anna.jpg" in (f.texture or "") for f in page.finishes)
        fine[skin] = (on_page / areas_of(page.corners).sum()) ** 0.5
    assert fine[True] > 180 > 100 > fine[False], "texels per metre"
    boxes = [box_mesh((x, x, x), (1 - x, 1 - x, 1 + x), (0.5, 0.5, 0.5, 1.0)) for x in (0.0, 0.3)]
    for key, kept in (("people/anna", False), ("built/boxes", True)):
        nested = [Part("boxes", "object", "a", mesh, f"{key}#{i}") for i, mesh in enumerate(boxes)]
        atlas = atlas_of(things_of(nested, LightSettings(density=20.0, budget=800.0), tmp_path))
        at = np.abs(luxels.luxels_of(atlas, ColourMaps()).position - 0.5)
        assert (at.max(1) < 0.45).any() == kept and (at[:, 2] > 0.7).any(), key
