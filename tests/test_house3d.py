"""The light meshes of recordings: colours come from the thing itself and not from its neighbours on the page."""

from __future__ import annotations

import numpy as np

from embodied.scene.lit_pages import LitMesh
from embodied.viz.house3d import _lit_piece


def test_a_vertex_on_the_rim_of_its_chart_has_the_colour_of_its_faces():
    page = np.zeros((64, 64, 3), np.uint8)
    page[16:48, 16:32], page[16:48, 32:48] = (200, 40, 40), (40, 40, 200)  # two charts side by side in the dark
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    uv = np.array([[16, 16], [32, 16], [32, 48], [16, 48]], np.float32) / 64
    mesh = LitMesh("person_1", "object", "hall_1", 0, corners, np.array([[0, 1, 2], [0, 2, 3]]), uv)
    _, _, colors, _ = _lit_piece(mesh, page, 100)
    assert (colors == (200, 40, 40, 255)).all()
