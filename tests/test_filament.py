"""The two back ends show the same house: Filament's colours equal the classic renderer's, depth and ids are one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, furnished, painted

from embodied.render import filament
from embodied.render.classic import Renderer
from embodied.render.filament import FilamentPainter
from embodied.scene.house_meshes import owners

pytestmark = pytest.mark.gl

EYE = (2.5, 2.6, 1.2)


@pytest.fixture(scope="module")
def house():
    base = two_rooms()
    return furnished(dataclasses.replace(base, openings=tuple(o for o in base.openings if o.kind != "window")))


@pytest.fixture(scope="module")
def lit(house):
    return painted(house, HandCatalogue())


def test_pages_are_shown_as_they_are(house, lit):
    """What a texel says is what a pixel shows: no lamp is added, and red stays that red."""
    with Renderer(house, HandCatalogue(), size=64, lit=lit) as r:
        p = r.panorama(EYE)
    i = lit.meshes[next(i for i, m in enumerate(lit.meshes) if m.owner == "red_box_1")]
    texel = lit.pages[0][4, int(i.uv[0, 0] * lit.pages[0].shape[1])]
    red = p.rgb[p.ids == 1 + [q.id for q in house.placements].index("red_box_1")]
    assert np.abs(np.median(red, axis=0) - texel).max() <= 1


@pytest.mark.slow
def test_back_ends_agree(house, lit):
    catalogue = HandCatalogue()
    with Renderer(house, catalogue, size=64, lit=lit) as classic:
        a = classic.panorama(EYE)
    with Renderer(house, catalogue, size=64, lit=lit, painter=FilamentPainter(house, catalogue, lit)) as other:
        b = other.panorama(EYE)
    assert np.array_equal(a.ids, b.ids) and np.allclose(a.depth, b.depth, rtol=1e-4)
    assert np.median(np.abs(a.rgb.astype(int) - b.rgb)) <= 6
    assert np.abs(a.rgb.astype(int) - b.rgb).mean() < 5, "not mirrored, not upside down, not in other colours"


@pytest.mark.slow
def test_a_glossy_floor_mirrors_the_room_and_a_matte_one_does_not(house, lit):
    """Only the floor changes; where one looks along it, it takes on what stands behind (Fresnel).

    It darkens nowhere, but for single pixels (seen once: one of 3,211 nine levels darker).
    """
    shiny = dataclasses.replace(
        lit, meshes=tuple(dataclasses.replace(m, gloss=(0.05, 0.5)) if "/floor" in m.owner else m for m in lit.meshes)
    )
    shots = []
    for pages in (lit, shiny):
        with Renderer(
            house, HandCatalogue(), size=96, lit=pages, painter=FilamentPainter(house, HandCatalogue(), pages)
        ) as r:
            shots.append(r.view(EYE, 0.6, -0.5, 1.2, (96, 96)))
    floors = np.array([i + 1 for i, o in enumerate(lit.owners or owners(house)) if "/floor" in o])
    on_floor = np.isin(shots[0].ids, floors)
    gain = shots[1].rgb.astype(int) - shots[0].rgb
    inside = (
        on_floor
        & np.roll(on_floor, 1, 0)
        & np.roll(on_floor, -1, 0)
        & np.roll(on_floor, 1, 1)
        & np.roll(on_floor, -1, 1)
    )
    assert np.abs(gain[~on_floor]).mean() < 1 and np.median(gain[inside].max(-1)) >= 2
    assert np.quantile(gain[inside], 0.002) > -4


def test_the_camera_is_in_the_room_around_it_and_in_none_outdoors(house):
    assert filament.room_at(house, EYE) == "living_room_1" and filament.room_at(house, (-30.0, 0.0, 1.0)) is None


def test_no_vulkan_gives_the_remedy(monkeypatch):
    monkeypatch.setattr(filament.ctypes.util, "find_library", lambda name: None)
    assert not filament._vulkan_works()
