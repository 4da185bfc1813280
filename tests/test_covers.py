"""Covers of imported parts: chosen by what is said or by name, seamless, in the part's colour, along the boards."""

import numpy as np
import pytest
from PIL import Image

from embodied.assets.importing.looks import COVERS, cover_of, creased, laid_on, picture

OAK, WHITE = (0.72, 0.58, 0.42), (0.9, 0.9, 0.9)


@pytest.mark.parametrize("cover", sorted(COVERS))
def test_a_cover_keeps_the_colour_and_repeats_without_a_seam(cover):
    tile = np.asarray(picture(cover, OAK), float) / 255
    assert tile.mean((0, 1)) == pytest.approx(OAK, abs=0.02)
    assert tile.std() > 0.01
    for axis in (0, 1):
        across = np.abs(np.take(tile, 0, axis) - np.take(tile, -1, axis)).mean()
        inside = np.abs(np.diff(tile, axis=axis)).mean()
        assert across < 3 * inside


def test_a_word_decides_before_a_name_and_paint_hides_wood():
    assert cover_of("Material.001", WHITE, "", textured=False, clear=False) is None
    assert cover_of("Bed sheet", WHITE, "", textured=False, clear=False) == "cloth"
    assert cover_of("doll skin", WHITE, "", textured=False, clear=False) is None
    assert cover_of("Bed sheet", WHITE, "#ffffff bedding", textured=False, clear=False) == "bedding"
    assert cover_of("Bed sheet", WHITE, "plain", textured=False, clear=False) is None
    assert cover_of("wood", OAK, "", textured=False, clear=False) == "wood"
    assert cover_of("wood", (0.35, 0.24, 0.16), "", textured=False, clear=False) == "dark wood"
    assert cover_of("wood", WHITE, "", textured=False, clear=False) is None
    assert cover_of("wood", OAK, "#b8946a paint", textured=False, clear=False) is None
    assert cover_of("glass with wood", OAK, "", textured=False, clear=True) is None


def test_a_texture_is_taken_for_what_a_word_or_its_name_says():
    kind_of = lambda name, look: cover_of(name, WHITE, look, textured=True, clear=False)
    assert kind_of("RED_OAK.001", "") == "wood" and kind_of("cloak", "") is None
    assert kind_of("Material", "") is None and kind_of("Material", "cloth") == "cloth"
    assert kind_of("wood", "plain") is None


def test_folds_are_as_large_on_a_texture_as_on_plain_cloth():
    """A blanket of 2.2 by 1.1 m under one picture has two tiles of folds across and one down, and keeps its colour."""
    corners = np.array([[0, 0, 0], [2.2, 0, 0], [2.2, 1.1, 0], [0, 1.1, 0]])
    faces, spots = np.array([[0, 1, 2], [0, 2, 3]]), np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    made = np.asarray(creased(Image.new("RGB", (400, 200), (120, 90, 60)), "bedding", corners, faces, spots[faces]))
    assert made.mean((0, 1)) == pytest.approx((120, 90, 60), abs=1.5)
    assert made.std() > 2 and np.abs(made[:, :200].astype(int) - made[:, 200:]).max() <= 1


def test_grain_runs_along_the_longest_side_of_every_board():
    """A top 1.2 m long and a leg 0.7 m tall, each one board of two triangles."""
    top = np.array([[0, 0, 0.7], [1.2, 0, 0.7], [1.2, 0.5, 0.7], [0, 0.5, 0.7]])
    leg = np.array([[0, 2, 0], [0.06, 2, 0], [0.06, 2, 0.7], [0, 2, 0.7]])
    vertices = np.concatenate([top, leg])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    uv = laid_on("wood", vertices, faces) * COVERS["wood"].tile
    assert np.ptp(uv[:2].reshape(-1, 2), axis=0) == pytest.approx([1.2, 0.5])
    assert np.ptp(uv[2:].reshape(-1, 2), axis=0) == pytest.approx([0.7, 0.06])


def test_a_tile_of_cloth_is_as_large_on_every_side():
    box = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = np.array([[4, 6, 7], [4, 7, 5], [2, 3, 7], [2, 7, 6], [1, 5, 7], [1, 7, 3]])
    uv = laid_on("cloth", box, faces)
    assert np.ptp(uv, axis=1) == pytest.approx(np.full((6, 2), 1 / COVERS["cloth"].tile))
