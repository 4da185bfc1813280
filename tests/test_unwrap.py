"""Unwrapping: every face on its page once, in proportion, and little of the page left empty."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from handmade import box_mesh

from embodied.assets.records import Finish, MeshPart
from embodied.light.pages import unwrap
from embodied.light.pages.atlas import UnwrappedThing, coarsened
from embodied.light.pages.unwrap import (
    ONCE,
    areas_of,
    density_of,
    face_normals,
    pack,
    unwrap_model,
    unwrap_planes,
    with_budget,
)

pytestmark = [pytest.mark.slow, pytest.mark.gl]


def test_unwrapping_keeps_every_face_and_its_proportions():
    mesh = box_mesh((0, 0, 0), (0.5, 0.4, 0.8), (0.9, 0.1, 0.1, 1.0))
    for flat, uneven in ((unwrap_planes([mesh], 40.0), 1e-3), (unwrap_model([mesh], 3000.0), 0.2)):
        assert len(flat.corners) == 12 and not flat.thin.any()
        on_page = areas_of(np.pad(flat.luxels, ((0, 0), (0, 0), (0, 1))))
        assert np.ptp(on_page / areas_of(flat.corners)) / np.mean(on_page / areas_of(flat.corners)) < uneven
        assert flat.luxels.min() >= 0 and (flat.luxels.reshape(-1, 2).max(0) <= flat.size).all()


def test_inside_out_things_are_turned_and_doubled_or_single_sheets_are_unwrapped_once():
    mesh = box_mesh((0, 0, 0), (1, 1, 1), (0.5, 0.5, 0.5, 1.0))
    inside_out, both = mesh.faces[:, ::-1], np.concatenate([mesh.faces, mesh.faces[:, ::-1]])
    for faces in (inside_out, both):
        flat = unwrap_model([dataclasses.replace(mesh, faces=faces)], 1000.0)
        outward = (face_normals(flat.corners) * (flat.corners.mean(1) - 0.5)).sum(1)
        assert len(flat.corners) == 12 and not flat.thin.any() and (outward > 0).all()
    assert unwrap_model([dataclasses.replace(mesh, faces=mesh.faces[:2])], 1000.0).thin.all(), "seen from both sides"


def test_packed_rectangles_do_not_overlap():
    sizes = np.random.default_rng(3).integers(2, 40, (60, 2))
    places, sheet = pack(sizes)
    taken = np.zeros(sheet[::-1], int)
    for (x, y), (w, h) in zip(places, sizes):
        taken[y : y + h, x : x + w] += 1
    assert taken.max() == 1 and taken.sum() == sizes.prod(1).sum()


def test_large_houses_are_drawn_coarser_floors_first_mirrors_never():
    def some(name, fineness, side):
        flat = SimpleNamespace(size=np.array([side, side]))
        return UnwrappedThing(name, "room", "object", flat, (), fineness, False, False)

    rows = ("floor", 5, 10), ("small floor", 5, 5), ("rug", 4, 10), ("mirror", 8, 4), ("wall", 2, 20)
    things = [some(*row) for row in rows]
    total = lambda ts: sum(int(t.flat.size.prod()) * t.fineness**2 for t in ts)
    fineness = lambda most: [t.fineness for t in coarsened(things, most)]
    assert fineness(total(things)) == [5, 5, 4, 8, 2]
    assert fineness(total(things) - 1) == [4, 5, 4, 8, 2]
    assert fineness(total(things) - 901) == [4, 4, 4, 8, 2]
    assert fineness(0) == [3, 3, 3, 8, 2]
    assert total(coarsened(things, total(things) - 500)) <= total(things) - 500


def ring(side: float, width: float) -> MeshPart:
    """The upper edges of skirting around a square room: four strips in one plane, mitred at the corners."""
    outer = np.array([(0, 0), (side, 0), (side, side), (0, side)], np.float32)
    inner = side / 2 + (outer - side / 2) * (1 - 2 * width / side)
    vertices = np.concatenate([np.pad(np.concatenate([outer, inner]), ((0, 0), (0, 1)))]).astype(np.float32)
    faces = np.array(
        [f for k in range(4) for f in ((k, (k + 1) % 4, 4 + k), ((k + 1) % 4, 4 + (k + 1) % 4, 4 + k))], np.int32
    )
    return MeshPart(vertices, faces, np.tile(np.float32([0, 0, 1]), (8, 1)), np.zeros((8, 2), np.float32), Finish())


def test_a_ring_of_skirting_takes_four_strips_of_a_page_and_not_the_whole_floor():
    flat = unwrap_planes([ring(4.0, 0.05)], 40.0)
    assert np.prod(flat.size) < 0.15 * (4.0 * 40.0) ** 2
    on_page = areas_of(np.pad(flat.luxels, ((0, 0), (0, 0), (0, 1))))
    assert on_page == pytest.approx(areas_of(flat.corners) * 40.0**2, rel=1e-3)


@pytest.mark.parametrize("budget", [500.0, 24000.0])
def test_another_budget_has_the_same_charts_at_another_density(budget):
    laths = [box_mesh((0.1 * k, 0, 0), (0.1 * k + 0.05, 0.04, 1.5), (0.5, 0.4, 0.3, 1.0)) for k in range(5)]
    once, flat = unwrap_model(laths, ONCE), with_budget(unwrap_model(laths, ONCE), ONCE, budget)
    np.testing.assert_array_equal(flat.corners, once.corners)
    assert flat.luxels.min() >= 0 and (flat.luxels.reshape(-1, 2).max(0) <= flat.size).all()
    taken = np.zeros(flat.size[::-1], int)
    for c in range(flat.chart.max() + 1):
        places = flat.luxels[flat.chart == c].reshape(-1, 2)
        extent, before = np.ptp(places, axis=0), np.ptp(once.luxels[once.chart == c].reshape(-1, 2), axis=0)
        scale = density_of(once.corners, budget) / density_of(once.corners, ONCE)
        assert np.sort(extent) == pytest.approx(np.maximum(np.ceil(np.sort(before) * scale - 1e-2), 1), abs=1e-3)
        (x0, y0), (x1, y1) = np.floor(places.min(0) + 1e-3).astype(int), np.ceil(places.max(0) - 1e-3).astype(int)
        taken[y0 : y1 + 1, x0 : x1 + 1] += 1  # with the luxel beside it that reading between luxels touches
    assert taken.max() == 1


def test_a_model_is_unwrapped_once_for_all_budgets(tmp_path, monkeypatch):
    laths, asked = [box_mesh((0, 0, 0), (0.05, 0.04, 1.5), (0.5, 0.4, 0.3, 1.0))], []
    real = unwrap.unwrap_model
    monkeypatch.setattr(unwrap, "unwrap_model", lambda *a, **k: asked.append(a) or real(*a, **k))
    flats = [unwrap.cached_model(laths, budget, tmp_path) for budget in (6000.0, 1200.0, 14000.0, 1200.0)]
    assert len(asked) == 1
    assert flats[0].size.prod() > flats[1].size.prod()
    np.testing.assert_array_equal(flats[1].luxels, flats[3].luxels)
