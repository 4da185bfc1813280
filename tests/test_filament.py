"""The two back ends show the same house: Filament's colours equal the classic renderer's, depth and ids are one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, furnished, painted

from embodied import filament
from embodied.render import Renderer

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
    with Renderer(house, HandCatalogue(), size=64, quality="baked", lit=lit) as r:
        p = r.panorama(EYE)
    i = lit.meshes[next(i for i, m in enumerate(lit.meshes) if m.owner == "red_box_1")]
    texel = lit.pages[0][4, int(i.uv[0, 0] * lit.pages[0].shape[1])]
    red = p.rgb[p.ids == 1 + [q.id for q in house.placements].index("red_box_1")]
    assert np.abs(np.median(red, axis=0) - texel).max() <= 1


def test_back_ends_agree(house, lit):
    catalogue = HandCatalogue()
    with Renderer(house, catalogue, size=64, quality="baked", lit=lit) as classic:
        a = classic.panorama(EYE)
    with Renderer(house, catalogue, size=64, quality="baked", lit=lit, backend="filament") as other:
        b = other.panorama(EYE)
    assert np.array_equal(a.ids, b.ids) and np.array_equal(a.depth, b.depth)
    assert np.median(np.abs(a.rgb.astype(int) - b.rgb)) <= 6
    assert np.abs(a.rgb.astype(int) - b.rgb).mean() < 5, "not mirrored, not upside down, not in other colours"


def test_unlit_is_left_to_the_classic_back_end(house):
    with pytest.raises(ValueError, match="baked"):
        Renderer(house, HandCatalogue(), backend="filament")


def test_no_vulkan_gives_the_remedy(monkeypatch):
    monkeypatch.setattr(filament.ctypes.util, "find_library", lambda name: None)
    assert not filament._vulkan_works()
