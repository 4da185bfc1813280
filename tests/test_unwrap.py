"""Unwrapping: every face on its page once, in proportion, and little of the page left empty."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from handmade import box_mesh

from embodied.assets.records import Finish, MeshPart
from embodied.light.pages import cover, unwrap
from embodied.light.pages.atlas import Page, UnwrappedThing, coarsened
from embodied.light.pages.cover import rasterise
from embodied.light.pages.unwrap import ONCE, areas_of, density_of, pack, unwrap_model, unwrap_planes, with_budget

pytestmark = [pytest.mark.slow, pytest.mark.gl]


def test_unwrapping_keeps_every_face_and_its_proportions():
    mesh = box_mesh((0, 0, 0), (0.5, 0.4, 0.8), (0.9, 0.1, 0.1, 1.0))
    for flat, uneven in ((unwrap_planes([mesh], 40.0), 1e-3), (unwrap_model([mesh], 3000.0), 0.2)):
        assert len(flat.corners) == 12 and not flat.thin.any()
        on_page = areas_of(np.pad(flat.luxels, ((0, 0), (0, 0), (0, 1))))
        assert np.ptp(on_page / areas_of(flat.corners)) / np.mean(on_page / areas_of(flat.corners)) < uneven
        assert flat.luxels.min() >= 0 and (flat.luxels.reshape(-1, 2).max(0) <= flat.size).all()


def test_an_atlas_is_freed_only_after_its_threads_had_time_to_fall_asleep(monkeypatch):
    """xatlas waits for ever where it ends a thread that is about to sleep."""
    clock, freed = [0.0], {}

    class Atlas:
        def __init__(self, number: int) -> None:
            self.number = number

        def __del__(self) -> None:
            freed[self.number] = clock[0]

    monkeypatch.setattr(unwrap, "_retired", [])
    monkeypatch.setattr(unwrap.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(unwrap.time, "sleep", lambda seconds: clock.__setitem__(0, clock[0] + seconds))
    for number in range(3):
        unwrap._retire(Atlas(number))
    assert freed == {0: unwrap.REST, 1: 2 * unwrap.REST}, "the last one rests"


def test_inside_out_things_are_turned_and_sheets_are_seen_from_both_sides():
    mesh = box_mesh((0, 0, 0), (1, 1, 1), (0.5, 0.5, 0.5, 1.0))
    inside_out = dataclasses.replace(mesh, faces=mesh.faces[:, ::-1])
    from embodied.light.pages.unwrap import face_normals

    flat = unwrap_model([inside_out], 1000.0)
    outward = flat.corners.mean(1) - 0.5
    assert ((face_normals(flat.corners) * outward).sum(1) > 0).all()
    sheet = dataclasses.replace(mesh, faces=mesh.faces[:2])
    assert unwrap_model([sheet], 1000.0).thin.all()


def test_sheets_listed_once_per_side_are_unwrapped_once():
    mesh = box_mesh((0, 0, 0), (0.4, 0.4, 0.4), (0.5, 0.5, 0.5, 1.0))
    doubled = dataclasses.replace(mesh, faces=np.concatenate([mesh.faces, mesh.faces[:, ::-1]]))
    flat = unwrap_model([doubled], 1000.0)
    assert len(flat.corners) == 12 and not flat.thin.any()
    from embodied.light.pages.unwrap import face_normals

    assert (
        (face_normals(flat.corners) * (flat.corners.mean(1) - 0.2)).sum(1)[
            np.abs(flat.corners.mean(1)[:, 2] - 0.2) < 0.19
        ]
        > 0
    ).all()


def test_large_houses_are_drawn_coarser_floors_first_mirrors_never():
    def some(name, fineness, side):
        flat = SimpleNamespace(size=np.array([side, side]))
        return UnwrappedThing(name, "room", "object", flat, (), fineness, False)

    things = [
        some("floor", 5, 10),
        some("small floor", 5, 5),
        some("rug", 4, 10),
        some("mirror", 8, 4),
        some("wall", 2, 20),
    ]
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


def test_charts_of_a_model_fill_their_sheet_and_do_not_overlap(monkeypatch):
    """Twelve laths side by side, of which xatlas alone covers 41 % of its sheet, with half the distance between
    charts. Overlapping charts would cover less than their area."""
    laths = [box_mesh((0.1 * k, 0, 0), (0.1 * k + 0.05, 0.05, 1.5), (0.5, 0.4, 0.3, 1.0)) for k in range(12)]
    flat = unwrap_model(laths, 6000.0)
    on_page = areas_of(np.pad(flat.luxels, ((0, 0), (0, 0), (0, 1)))).sum()
    assert on_page > 0.43 * np.prod(flat.size)
    assert flat.luxels.min() >= 0 and (flat.luxels.reshape(-1, 2).max(0) <= flat.size).all()
    monkeypatch.setattr(cover, "OFFSETS", ())
    width, height = (int(x) for x in flat.size)
    page = Page(
        width, height, 4, False, flat.corners, flat.normals, flat.luxels, flat.uv, flat.thin, flat.part, (), flat.part
    )
    assert len(rasterise(page, 4).index) == pytest.approx(4**2 * on_page, rel=0.01)


def test_rectangles_are_put_where_they_lie_lowest_and_leftmost():
    """`pack` against the same rule written out over every place."""
    rng = np.random.default_rng(0)
    for trial in range(60):
        n, width = int(rng.integers(1, 120)), int(rng.integers(1, 90))
        sizes = np.stack([rng.geometric(0.2, n), rng.geometric(0.1, n)], 1)
        filled = np.zeros(max(width, sizes[:, 0].max()), int)
        expected = np.zeros((n, 2), int)
        for i in sorted(range(n), key=lambda i: (-sizes[i, 1], -sizes[i, 0])):
            w, h = sizes[i]
            lies = [filled[x : x + w].max() for x in range(len(filled) - w + 1)]
            x = int(np.argmin(lies))
            expected[i] = x, lies[x]
            filled[x : x + w] = lies[x] + h
        places, size = pack(sizes, width)
        assert (places == expected).all() and (size == (expected + sizes).max(0)).all(), trial
