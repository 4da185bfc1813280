"""Reflections: what mirrors show is what stands there, rough things show it blurred, matte ones stay as they are."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, furnished

from embodied.assets.records import Finish
from embodied.light.tracing.rays import embree, mitsuba_among, rays_among
from embodied.render import gloss
from embodied.render.camera import Camera
from embodied.render.film import film, light_of, shown_of
from embodied.render.gloss import Gloss, GlossData, schlick
from embodied.render.pictures import Baked, matte, parse_pictures
from embodied.scene.lit_pages import LitMesh, LitPages
from embodied.world import open_world

LOOKING_DOWN = Camera((0.0, 0.0, 1.5), (math.sqrt(0.5), 0.0, -math.sqrt(0.5)), (math.sqrt(0.5), 0.0, math.sqrt(0.5)))
GREY, RED = (120, 120, 120), (200, 30, 30)


def test_the_film_curve_is_the_bakes_own_and_is_undone():
    tone = pytest.importorskip("embodied.light.pages.tone")
    x = np.geomspace(1e-3, 5, 200)[:, None].repeat(3, 1)
    assert np.allclose(film(x), tone.develop(x, np.ones(3)), atol=2e-3)
    values = np.arange(256, dtype=np.uint8)[:, None].repeat(3, 1)
    assert np.abs(shown_of(light_of(values)).astype(int) - values).max() <= 1
    assert light_of(values)[255, 0] == pytest.approx(5.0, rel=0.02)


def test_schlick_is_f0_ahead_and_one_along_a_smooth_surface():
    assert schlick(0.04, np.float32(1.0), np.float32(0.0)) == pytest.approx(0.04)
    assert schlick(0.04, np.float32(0.0), np.float32(0.0)) == pytest.approx(1.0)
    assert schlick(0.04, np.float32(0.0), np.float32(1.0)) < 0.15


def quad(name: str, corners, page: int) -> LitMesh:
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return LitMesh(name, "floor", "room", page, np.array(corners, np.float32), faces, uv)


def house(rough: float, specular: float = 0.5, metal: float = 0.0, gains=(1.0, 1.0), wide: float = 8.0) -> Gloss:
    """A grey floor, so `wide`, and, behind it, a wall whose lower half is grey and whose upper half is red."""
    pytest.importorskip("embreex")
    wall = np.zeros((64, 64, 3), np.uint8)
    wall[:32], wall[32:] = RED, GREY
    pages = (np.full((64, 64, 3), GREY, np.uint8), wall)
    left, right = wide / 2, -wide / 2
    floor = quad("floor", [(-1, right, 0), (4, right, 0), (4, left, 0), (-1, left, 0)], 0)
    back = quad("wall", [(4, 4, 4), (4, -4, 4), (4, -4, 0), (4, 4, 0)], 1)
    shine = np.tile(np.round(255 * np.array([rough, specular, metal])).astype(np.uint8), (2, 1))
    tint = np.full((2, 3), 0.9, np.float32) if metal else None
    room, wall_s = (np.full(3, g, np.float32) for g in gains)
    exposed = lambda p: np.where(p[:, :1] > 3.99, wall_s, room)
    known = GlossData([shine, None], [tint, None], [None, None], exposed, np.ones(3, np.float32), 1.0)
    return Gloss(LitPages((floor, back), pages, "x"), known, rays_among)


def drawn(size: int = 96) -> np.ndarray:
    return np.full((size, size, 3), GREY, np.uint8)


def rows_that_mirror_red(rgb: np.ndarray) -> np.ndarray:
    middle = rgb[:, rgb.shape[1] // 2].astype(int)
    return np.flatnonzero(middle[:, 0] > middle[:, 1] + 60)


def test_a_mirror_on_the_floor_shows_the_wall_where_geometry_says():
    out = house(0.0, 1.0, 1.0).over(drawn(), LOOKING_DOWN)
    red = rows_that_mirror_red(out)
    # a ray down to (x, 0) rises again at the same slope and meets the wall at height 1.5 (4 - x) / x: red above 2
    x = 4 * 1.5 / (1.5 + 2.0)
    angle = math.atan2(1.5, x) - math.pi / 4
    border = 48 + math.tan(angle) * 48
    assert red.size and abs(red.min() - border) <= 1.5
    floor_begins = 48 - math.tan(math.pi / 4 - math.atan2(1.5, 4)) * 48
    between = out[math.ceil(floor_begins) + 3 : math.floor(border) - 3, 48]
    assert np.abs(between.astype(int) - GREY).max() < 12, "the grey half of the wall, a little darker"


def test_matte_floors_and_what_has_no_gloss_stay_to_the_byte():
    rgb = drawn()
    for flat in (house(0.9), house(0.3, specular=0.0)):
        out = flat.over(rgb, LOOKING_DOWN)
        assert np.array_equal(out, rgb) and out is not rgb
    before = rgb.copy()
    house(0.3).over(rgb, LOOKING_DOWN)
    assert np.array_equal(rgb, before)


def test_a_rough_floor_shows_a_faint_blurred_picture_of_a_brighter_room():
    sharp, rough = (house(r, gains=(1.0, 0.1)).over(drawn(), LOOKING_DOWN).astype(int) for r in (0.05, 0.4))
    edge = lambda a: np.abs(np.diff(a[28:, 48, 0])).max()  # below the line where the floor begins
    assert edge(sharp) > 5 * edge(rough)
    assert (rough[:, 48, 0] - 120).max() > 10, "but it is there"
    steep, flat = rough[90, 48, 0] - 120, rough[40:60, 48, 0].max() - 120
    assert flat > steep, "more along the floor than down at it"


def test_rough_reflections_are_smooth_and_the_same_for_any_size_of_picture():
    rough = house(0.4, gains=(1.0, 0.1))
    out = rough.over(drawn(97), LOOKING_DOWN).astype(int)
    inside = out[45:, 20:77, 0]
    grain = np.abs(np.diff(inside, axis=1))
    assert grain.max() <= 6, "no grain between neighbours in a row of the same floor"
    half = rough.over(drawn(48), LOOKING_DOWN)
    assert np.abs(out[60:90:2, 48, 0] - half[30:45, 24, 0].astype(int)).mean() < 5
    assert np.array_equal(out, rough.over(drawn(97), LOOKING_DOWN)), "and the same every time"


def test_brushed_metal_shows_a_bright_edge_once_and_not_in_every_direction_of_its_lobe(monkeypatch):
    steps = lambda: np.abs(
        np.diff(house(0.3, 1.0, 1.0, (1.0, 0.1)).over(drawn(384), LOOKING_DOWN)[200:, 192, 0].astype(int))
    ).max()
    smooth = steps()
    monkeypatch.setattr(gloss, "BETWEEN", 1e-9)
    assert smooth < 0.6 * steps()


@pytest.mark.parametrize("metal", [0.0, 1.0])
def test_thin_bars_do_not_flicker_while_the_camera_turns(metal, monkeypatch):
    def flicker() -> float:
        bar = house(0.35, 1.0, metal, gains=(1.0, 0.1), wide=0.09)
        seen = []
        for turn in np.linspace(0, 0.08, 9):
            ahead = math.cos(turn) * math.sqrt(0.5), math.sin(turn) * math.sqrt(0.5), -math.sqrt(0.5)
            camera = Camera((0.0, 0.0, 1.5), ahead, (ahead[0], ahead[1], math.sqrt(0.5)))
            rgb = bar.over(drawn(), camera).astype(int)
            there = (rgb != GREY).any(-1)
            seen.append([rgb[row, there[row], 0].mean() for row in range(50, 80)])
        return float(np.std(seen, axis=0).mean())

    many = flicker()
    monkeypatch.setattr(gloss, "MIN_SAMPLES", 0)
    monkeypatch.setattr(gloss, "BRUSHED", 1)
    assert many < 0.7 * flicker()


def night_window(kind: str = "opening", rough: float = 0.02, night_at: float = 5.0) -> np.ndarray:
    """What a camera before a pane sees: night behind it (or before it), a red wall far behind the camera."""
    pytest.importorskip("embreex")
    pages = (np.full((8, 8, 3), RED, np.uint8), np.zeros((8, 8, 3), np.uint8), np.zeros((8, 8, 3), np.uint8))
    behind = quad("wall", [(-3, -9, -9), (-3, 9, -9), (-3, 9, 9), (-3, -9, 9)], 0)
    night = quad("night", [(night_at, y, z) for y, z in ((9, -9), (-9, -9), (-9, 9), (9, 9))], 1)
    pane = quad("pane", [(2, 1, -1), (2, -1, -1), (2, -1, 1), (2, 1, 1)], 2)
    pane = dataclasses.replace(pane, kind=kind, alpha=0.08, gloss=(rough, 0.5))
    everywhere = lambda p: np.ones((len(p), 3), np.float32)
    known = GlossData([None] * 3, [None] * 3, [None] * 3, everywhere, np.ones(3, np.float32), 1.0)
    ahead = Camera((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    gloss = Gloss(LitPages((behind, night, pane), pages, "x"), known, rays_among)
    return gloss.over(np.zeros((64, 64, 3), np.uint8), ahead)


def test_a_window_at_night_shows_the_room_and_only_where_the_pane_is():
    out = night_window()
    assert out[32, 32, 0] > out[32, 32, 1] + 20, "the red wall behind the camera"
    assert not out[2, 2].any() and not out[32, 5].any(), "beside the pane is night"
    light = light_of(out[32, 32])[0] / light_of(np.array(RED, np.uint8))[0]
    assert light == pytest.approx(4 * 0.04 / (1 + 3 * 0.04), rel=0.1), "double glazing: four surfaces of 4 %"
    table = light_of(night_window("object")[32, 32])[0] / light_of(np.array(RED, np.uint8))[0]
    assert table == pytest.approx(2 * 0.04 / (1 + 0.04), rel=0.15), "one pane: two surfaces"


def test_sheer_curtains_and_hidden_panes_mirror_nothing():
    assert not night_window(rough=0.8).any()
    assert not night_window(night_at=1.0).any()


@pytest.mark.parametrize("among", [embree, mitsuba_among])
def test_rays_meet_what_geometry_says(among):
    """Against all triangles in turn (Moeller and Trumbore 1997)."""
    if among is embree:
        pytest.importorskip("embreex")
    rng = np.random.default_rng(3)
    corners = (rng.uniform(-2, 2, (60, 1, 3)) + rng.uniform(-0.7, 0.7, (60, 3, 3))).astype(np.float32)
    start, onward = rng.uniform(-2, 2, (500, 3)), rng.normal(size=(500, 3))
    onward /= np.linalg.norm(onward, axis=1, keepdims=True)
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(onward[:, None], b)
    inverse = 1 / np.einsum("ijk,jk->ij", p, a)
    s = start[:, None] - corners[:, 0]
    u = np.einsum("ijk,ijk->ij", p, s) * inverse
    q = np.cross(s, a)
    v = np.einsum("ik,ijk->ij", onward, q) * inverse
    t = np.einsum("jk,ijk->ij", b, q) * inverse
    t[(u < 0) | (v < 0) | (u + v > 1) | (t < 0)] = np.inf
    nearest, met = t.argmin(1), np.isfinite(t.min(1))
    assert 50 < met.sum() < 450
    face, far, second, third = among(corners)(start.astype(np.float32), onward.astype(np.float32))
    assert np.array_equal(face, np.where(met, nearest, -1))
    assert np.allclose(far[met], t.min(1)[met], atol=1e-4)
    there = np.arange(500)[met], nearest[met]
    assert np.allclose(second[met], u[there], atol=1e-4) and np.allclose(third[met], v[there], atol=1e-4)
    assert [len(x) for x in among(corners)(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32))] == [0] * 4


def test_gloss_is_laid_over_baked_light_unless_pictures_are_matte():
    assert parse_pictures("fast", 64) == Baked("fast", size=64)
    assert matte(Baked("fast")) == parse_pictures("fast-matte") == matte(parse_pictures("fast-matte"))


class Polished(HandCatalogue):
    """Where floors, walls and ceilings shine."""

    def finish(self, key: str) -> Finish:
        return dataclasses.replace(super().finish(key), roughness=0.3)


@pytest.mark.slow
@pytest.mark.gl
def test_a_world_with_gloss_shows_the_same_things_at_the_same_places_in_another_light(tmp_path):
    pytest.importorskip("embreex")
    house = furnished(two_rooms())
    matte, gloss = (open_world(house, Polished(), tmp_path, size=48, pictures=k) for k in ("fast-matte", "fast"))
    with matte, gloss:
        a, b = matte.panorama(0), gloss.panorama(0)
        assert np.array_equal(a.depth, b.depth) and np.array_equal(a.ids, b.ids)
        assert "look" not in matte.fingerprint and gloss.fingerprint["look"] == "gloss" and matte.path != gloss.path
        changed = (a.rgb != b.rgb).any(-1)
        assert 0 < changed.mean() < 1 and np.abs(a.rgb.astype(int) - b.rgb).mean() < 20
