"""The bench of what a stranger recognises: which crops are shown, and how answers are counted."""

from __future__ import annotations

import json

import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, furnished

from embodied.bench import look
from embodied.bench.crops import crops_of
from embodied.render.pictures import PictureSettings
from embodied.world import open_world


@pytest.mark.slow
@pytest.mark.gl
def test_crops_show_their_object_and_answers_are_counted_by_class(tmp_path, monkeypatch):
    house = furnished(two_rooms())
    monkeypatch.setattr(look, "MAPPED", {"red box": (478,), "flag": (557,)})
    monkeypatch.setattr(look, "generate_house", lambda *_, **__: house)
    with open_world(house, HandCatalogue(), tmp_path / "cache", size=64) as world:
        crops = crops_of(world, look.MAPPED)
    assert {c.object_class for c in crops} == {"red box", "flag"} and all(c.rgb.shape == (224, 224, 3) for c in crops)
    box = next(c.rgb.astype(int) for c in crops if c.object_class == "red box")
    assert (box[60:160, 60:160, 0] > 2 * box[60:160, 60:160, 1]).mean() > 0.8, "it fills the middle"

    def judge(pictures: np.ndarray) -> np.ndarray:
        return np.tile([1, 478, 2, 3, 4], (len(pictures), 1))

    pictures = PictureSettings(64)
    told = {"seed": 0, "pictures": pictures, "houses": 1}
    report = look.recognised(HandCatalogue(), tmp_path / "cache", tmp_path / "out", judge, **told)
    boxes = sum(c.object_class == "red box" for c in crops)
    assert report.facts["by_class"]["red box"] == {"shown": boxes, "recognised": boxes}
    assert report.facts["by_class"]["flag"]["recognised"] == 0 and report.facts["worst"][0] == "flag"
    assert report.facts["classes"] == 0.5
    assert json.loads((tmp_path / "out" / "look.json").read_text())["crops"] == len(crops)
    assert (tmp_path / "out" / "look_worst.jpg").stat().st_size > 1000
