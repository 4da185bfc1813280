"""The bench of what a stranger recognises: which crops are shown, and how answers are counted."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, furnished

from embodied.bench import crops, look, views
from embodied.bench.crops import crops_of
from embodied.render.pictures import PictureSettings
from embodied.world import open_world


class Judge:
    def first_five(self, pictures: np.ndarray) -> np.ndarray:
        return np.tile([1, 478, 2, 3, 4], (len(pictures), 1))

    def features(self, pictures: np.ndarray) -> np.ndarray:
        return pictures.mean((1, 2))


@pytest.mark.slow
@pytest.mark.gl
def test_crops_show_their_object_and_answers_are_counted_by_class(tmp_path, monkeypatch):
    house = furnished(two_rooms())
    monkeypatch.setattr(look, "MAPPED", {"red box": (478,), "flag": (557,)})
    monkeypatch.setattr(look, "generate_house", lambda *_, **__: house)
    with open_world(house, HandCatalogue(), tmp_path / "cache", size=64) as world:
        shown = crops_of(world, look.MAPPED)
    assert {c.object_class for c in shown} == {"red box", "flag"} and all(c.rgb.shape == (224, 224, 3) for c in shown)
    box = next(c.rgb.astype(int) for c in shown if c.object_class == "red box")
    assert (box[60:160, 60:160, 0] > 2 * box[60:160, 60:160, 1]).mean() > 0.8, "it fills the middle"

    monkeypatch.setattr(views, "SIZE", (32, 48))
    monkeypatch.setattr(views, "RAYS", 4)
    pictures = PictureSettings(64)
    told = {"seed": 0, "pictures": pictures, "houses": 1}
    report = look.recognised(HandCatalogue(), tmp_path / "cache", tmp_path / "out", Judge(), **told)
    boxes = sum(c.object_class == "red box" for c in shown)
    assert report.facts["by_class"]["red box"] == {"shown": boxes, "recognised": boxes}
    assert report.facts["by_class"]["flag"]["recognised"] == 0 and report.facts["worst"][0] == "flag"
    assert report.facts["classes"] == 0.5
    assert report.facts["by_time"] == {look.time_of(house.sky.hour): {"shown": len(shown), "recognised": boxes}}
    assert [look.time_of(hour) for hour in (3.0, 6.0, 12.5, 18.6, 22.0)] == [
        "night",
        "morning",
        "noon",
        "evening",
        "night",
    ]
    assert json.loads((tmp_path / "out" / "look.json").read_text())["crops"] == len(shown)
    assert (tmp_path / "out" / "look_worst.jpg").stat().st_size > 1000
    seen = report.facts["views"]
    assert seen["views"] == 1 and 0 < seen["own"] < 0.2 and seen["nearest"] is None
    assert f"{seen['own']:.3f} from the path tracer's" in report.text
    assert len(list((tmp_path / "out" / "views").iterdir())) == 2
    kept = [p.stat().st_mtime_ns for p in (tmp_path / "out" / "views").iterdir()]
    told["traced"] = False
    bare = look.recognised(HandCatalogue(), tmp_path / "cache", tmp_path / "out", Judge(), **told)
    assert bare.facts["views"]["views"] == 0 and "path tracer" not in bare.text
    look.recognised(HandCatalogue(), tmp_path / "cache", tmp_path / "out", Judge(), **told | {"traced": True})
    assert [p.stat().st_mtime_ns for p in (tmp_path / "out" / "views").iterdir()] == kept, "not traced again"


def test_views_are_compared_with_their_own_traced_picture_and_those_of_others():
    def picture(colour: tuple[int, int, int]) -> np.ndarray:
        return np.full((4, 4, 3), colour, np.uint8)

    red, green, yellow = (255, 0, 0), (0, 255, 0), (255, 255, 0)
    pairs = [views.ViewPair("a", picture(red), picture(red)), views.ViewPair("b", picture(red), picture(green))]
    told = views.likeness(pairs, Judge().features)
    assert told["own"] == pytest.approx(0.5) and told["others"] == pytest.approx(1.0) and told["nearest"] == 0.5
    slanted = views.likeness([views.ViewPair("a", picture(yellow), picture(red))], Judge().features)
    assert slanted["own"] == pytest.approx(1 - math.sqrt(0.5)) and slanted["others"] is None
    assert views.likeness([], Judge().features) == {"views": 0, "own": None, "others": None, "nearest": None}


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.parametrize(("yaw", "side"), [(0.0, -1), (math.pi, 1)])
def test_a_thing_is_shown_from_before_where_all_sides_are_alike(tmp_path, monkeypatch, yaw, side):
    bare = furnished(two_rooms())
    box = next(p for p in bare.placements if p.id == "red_box_1")
    house = dataclasses.replace(bare, placements=(dataclasses.replace(box, yaw=yaw),))
    eyes: list[np.ndarray] = []
    monkeypatch.setattr(crops, "_crop", lambda world, thing, mine, eye: eyes.append(eye))
    with open_world(house, HandCatalogue(), tmp_path / "cache", size=64) as world:
        crops_of(world, {"red box"})
    assert len(eyes) == 1 and side * (eyes[0][1] - box.position[1]) > 0
