"""Where the CPU draws a lit house, its pictures are MuJoCo's; things that are small in them lose triangles unseen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, decibels, furnished, of_panes, smooth_pages

from embodied.render import coarser, raster
from embodied.render.camera import camera_at
from embodied.render.classic import Renderer

gl_test = pytest.mark.gl
EYE = (2.5, 2.6, 1.2)
VIEWS = [(EYE, 0.0, -0.3), (EYE, math.pi / 2, -0.2), ((4.5, 1.0, 1.5), 0.1, 0.0), ((7.5, 1.0, 1.5), 2.0, -0.5)]
LENS, SIZE = 1.2, (96, 128)


@pytest.fixture(scope="module")
def house():
    return furnished(two_rooms())


@pytest.fixture(scope="module")
def lit(house):
    """Pages whose colours change smoothly, with glass that one looks through."""
    return of_panes(smooth_pages(house, HandCatalogue()), alpha=0.3)


@pytest.fixture(scope="module")
def mine(house, lit):
    with Renderer(house, HandCatalogue(), size=64, lit=lit) as r:
        if not isinstance(r._drawing, raster.Raster):
            pytest.skip("a GPU draws here")
        yield r


@pytest.fixture(scope="module")
def mujocos(house, lit):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(raster, "able", lambda: False)
        with Renderer(house, HandCatalogue(), size=64, lit=lit) as r:
            yield r


@gl_test
def test_a_house_without_colours_shows_the_depth_and_ids_that_mujoco_draws(house):
    with Renderer(house, HandCatalogue(), size=64, colours=False) as bare, Renderer(house, HandCatalogue()) as whole:
        if not isinstance(bare._drawing, raster.Raster):
            pytest.skip("a GPU draws here")
        (depths, ids), (depths_there, ids_there) = bare.seen(EYE), whole.seen(EYE)
    same = ids == ids_there
    assert same.mean() > 0.999
    np.testing.assert_allclose(depths[same], depths_there[same], rtol=1e-4)


@gl_test
@pytest.mark.parametrize(("eye", "yaw", "pitch"), VIEWS)
def test_pictures_are_those_of_mujoco(mine, mujocos, eye, yaw, pitch):
    camera = camera_at(eye, yaw, pitch, LENS)
    a, b = mine.rgb(camera, SIZE), mujocos.rgb(camera, SIZE)
    assert a.shape == b.shape == (*SIZE, 3)
    assert decibels(a, b) > 40
    for ours, theirs in zip(mine.depth_and_ids(camera, SIZE), mujocos.depth_and_ids(camera, SIZE), strict=True):
        assert ours.dtype == theirs.dtype
        assert np.isclose(ours, theirs, rtol=1e-3).mean() > 0.995


@gl_test
@pytest.mark.parametrize(("eye", "yaw", "pitch"), VIEWS)
@pytest.mark.parametrize("size", [SIZE, (95, 127), (480, 640)])
def test_one_pass_shows_what_two_show(mine, eye, yaw, pitch, size):
    """But for edges, where ids come from a sixth of a pixel beside; depth is that of the middle of the pixel."""
    camera = camera_at(eye, yaw, pitch, LENS)
    view, (depth, ids) = mine.through(camera, size), mine.depth_and_ids(camera, size)
    assert np.array_equal(view.rgb, mine.rgb(camera, size))
    same = view.ids == ids
    assert same.mean() > 0.97
    assert np.isclose(view.depth, depth, rtol=1e-4)[same].mean() > 0.96
    glass = [i + 1 for i, owner in enumerate(mine.owners) if owner.endswith("/glass")]
    assert (np.isin(view.ids, glass) == np.isin(ids, glass)).mean() > 0.98


@gl_test
def test_mujoco_and_shaders_do_not_disturb_each_other(mine, mujocos):
    camera = camera_at(EYE, 0.4, -0.2, LENS)
    first = [r.through(camera, SIZE) for r in (mine, mujocos)]
    again = [r.through(camera, SIZE) for r in (mine, mujocos, mine, mujocos)][2:]
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one.rgb, other.rgb) and np.array_equal(one.ids, other.ids)


@gl_test
def test_who_looks_away_from_everything_sees_nothing(mine):
    away = mine.view((500.0, 500.0, 300.0), math.pi / 4, 0.5, LENS, SIZE)
    assert not away.rgb.any() and not away.ids.any() and np.isinf(away.depth).all()


@gl_test
def test_a_larger_picture_than_before_is_drawn_and_a_closed_renderer_says_so(house, lit):
    with Renderer(house, HandCatalogue(), size=16, lit=lit) as r:
        small, large = (r.view(EYE, 0.0, size=(n, n)).rgb for n in (32, 256))
        assert np.abs(large.reshape(32, 8, 32, 8, 3).mean((1, 3)) - small).mean() < 2
    with pytest.raises(RuntimeError, match="closed"):
        r.view(EYE, 0.0)


def sphere(rings: int, radius: float) -> coarser.Corners:
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * rings + 1), np.linspace(0, np.pi, rings + 1))
    xyz = np.stack([np.sin(up) * np.cos(around), np.sin(up) * np.sin(around), np.cos(up)], -1) * radius
    i = np.arange(rings * (2 * rings + 1)).reshape(rings, -1)[:, :-1].ravel()
    faces = np.concatenate(
        [np.stack(t, 1) for t in ((i, i + 2 * rings + 1, i + 1), (i + 1, i + 2 * rings + 1, i + 2 * rings + 2))]
    )
    return corners_of(xyz.reshape(-1, 3), faces)


def corners_of(xyz: np.ndarray, faces: np.ndarray) -> coarser.Corners:
    uv = xyz[:, :2].astype(np.float32)
    return coarser.Corners(xyz.astype(np.float32), uv, np.zeros(len(xyz), int), faces)


def test_no_copy_loses_surface():
    """Neither a bar thinner than the cells nor leaves smaller than they vanish."""
    ring = 0.003 * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    bar = np.concatenate([np.c_[ring, np.full(4, z)] for z in np.linspace(0, 1, 40)])
    i, k = (np.arange(39)[:, None] * 4).repeat(4, 1).ravel(), np.tile(np.arange(4), 39)
    a, b = i + k, i + (k + 1) % 4
    sides = np.concatenate([np.stack([a, b, b + 4], 1), np.stack([a, b + 4, a + 4], 1)])
    rng = np.random.default_rng(0)
    leaves = rng.uniform(0, 1, (300, 1, 3)) + rng.normal(0, 0.003, (300, 3, 3))
    for whole in (
        corners_of(bar, sides),
        corners_of(leaves.reshape(-1, 3), np.arange(900).reshape(-1, 3)),
        sphere(60, 0.2),
    ):
        copies = coarser.copies(whole, 1, np.ones(1, bool))
        assert all(surface(c) > 0.9 * surface(whole) for c in copies if len(c.faces))
        assert not any(len(c.faces) for c in coarser.copies(whole, 1, np.zeros(1, bool)))


def surface(meshes: coarser.Corners) -> float:
    a, b, c = meshes.xyz[meshes.faces].swapaxes(0, 1)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
