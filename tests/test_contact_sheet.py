"""Contact sheets show what they say."""

from __future__ import annotations

import numpy as np
import pytest
from handmade_models import CUBE, write_own

from embodied.assets.catalogue import load_catalogue
from embodied.render.contact_sheet import LABEL, TILE, draw_sheets, sheet

pytestmark = pytest.mark.gl


@pytest.fixture
def catalogue(tmp_path):
    rows = {
        n: {"file": "a.obj", "class": "cardboard box", "size": [0.5, 0.5, 0.5], "looks": {"": look}}
        for n, look in (("blue", "#0000ff"), ("red", "#ff0000"))
    }
    (write_own(tmp_path / "own", rows) / "a.obj").write_text(CUBE)
    return load_catalogue(tmp_path / "cache", own=[tmp_path / "own"])


def test_every_model_is_drawn_in_its_own_tile(catalogue):
    page = np.asarray(sheet(catalogue, ["mine/blue", "mine/red"])).astype(int)
    assert page.shape[0] == TILE + LABEL
    for i, channel in enumerate((2, 0)):
        middle = page[
            LABEL + TILE // 2 - 20 : LABEL + TILE // 2 + 20, i * TILE + TILE // 2 - 20 : i * TILE + TILE // 2 + 20
        ]
        assert middle[..., channel].mean() > 2 * middle[..., 2 - channel].mean()


def test_sheets_are_written_as_png(catalogue, tmp_path):
    (path,) = draw_sheets(catalogue, ["mine/blue"], tmp_path / "out")
    assert path.read_bytes().startswith(b"\x89PNG")
