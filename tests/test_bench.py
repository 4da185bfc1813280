"""`embodied bench`: pictures are kept, and every part that is named is measured."""

from __future__ import annotations

import json

import numpy as np

from embodied.bench import light, timing, world
from embodied.bench.light import Kept, Shot
from embodied.cli import main


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
    monkeypatch.setattr(light, "compare", lambda *args, **options: timing.Report({"rows": []}, "the ways"))
    assert main(["bench", "light", "houses", "--cache", str(tmp_path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["light"] == {"rows": []} and [m["value"] for m in facts["measures"]] == [2.0]
