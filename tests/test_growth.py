"""Benches of light that go on where they were stopped: growth by a hand-made law, pictures of rooms."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from embodied.bench import growth, timing, world
from embodied.bench.light import Kept, Shot
from embodied.cli import main


def house(area: float) -> growth.Grown:
    return growth.Grown(area, 100, 0.3 * area**1.1, 20.0, 1000, 900.0, 12.0)


def test_slope_is_the_exponent_of_area():
    assert growth.slope([house(a) for a in growth.AREAS]) == pytest.approx(1.1)


@pytest.mark.slow
def test_a_house_is_lit_once_per_code_seed_and_quality(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(growth, "light_code", lambda: "this code")
    monkeypatch.setattr(
        growth, "grown", lambda catalogue, cache, seed, area, quality: asked.append(area) or house(area)
    )

    def run(seed: int, areas: tuple[float, ...]) -> dict:
        return growth.growth(None, tmp_path, tmp_path, seed=seed, areas=areas).facts

    run(7, (40.0, 100.0))
    facts = run(7, (40.0, 100.0, 400.0))
    assert asked == [40.0, 100.0, 400.0] and facts["slope"] == pytest.approx(1.1)
    assert "slope 1.10 (aim <= 1.15: met)".casefold() in growth.table(facts).casefold()
    picture = cv2.imread(str(tmp_path / "growth.png"))
    assert picture is not None and np.ptp(picture) > 0
    run(8, (40.0, 100.0))
    assert asked[3:] == [40.0, 100.0]


@pytest.mark.slow
def test_a_picture_of_the_bench_is_drawn_once(tmp_path):
    rgb, plain = np.arange(24, dtype=np.uint8).reshape(2, 4, 3), np.eye(2, 4, dtype=bool)
    asked = []

    def draw(way: str) -> Shot:
        asked.append(way)
        return Shot("hall_1", 10.5, way, rgb, 7.5, plain if way == "diffuse" else None, 3.25)

    kept = Kept(tmp_path)
    assert kept.empty(7)
    for way in ("diffuse", "fast", "diffuse", "fast"):
        shot = kept.once(7, way, "hall_1", lambda way=way: draw(way))
        assert (shot.room, shot.hour, shot.way, shot.ms, shot.processor) == ("hall_1", 10.5, way, 7.5, 3.25)
        np.testing.assert_array_equal(shot.rgb, rgb)
        assert (shot.plain is None) == (way == "fast")
    assert asked == ["diffuse", "fast"] and not kept.empty(7) and kept.empty(8)


def test_every_part_that_is_named_is_measured(tmp_path, monkeypatch, capsys):
    made = timing.Measure("a thing", 2.0, "s", 1.0, 3.0, 5)
    monkeypatch.setattr(world, "houses", lambda catalogue, seed: iter([made]))
    monkeypatch.setattr(growth, "growth", lambda *args, **options: timing.Report({"slope": 1.1}, "the slope"))
    assert main(["bench", "growth", "houses", "--cache", str(tmp_path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["growth"] == {"slope": 1.1} and [m["value"] for m in facts["measures"]] == [2.0]
