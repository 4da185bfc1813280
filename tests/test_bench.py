"""`embodied bench`: every part that is named is measured."""

from __future__ import annotations

import json

from embodied.assets.cache import default_cache
from embodied.assets.catalogue import load_catalogue
from embodied.bench import light, moving, timing, world
from embodied.cli import main


def test_every_part_that_is_named_is_measured(tmp_path, monkeypatch, capsys):
    made = timing.Measure("a thing", 2.0, "s", 1.0, 3.0, 5)
    monkeypatch.setattr(world, "houses", lambda catalogue, seed: iter([made]))
    monkeypatch.setattr(light, "compare", lambda *args, **options: {"rows": []})
    monkeypatch.setattr(light, "table", lambda facts: "the ways")
    assert main(["bench", "light", "houses", "--cache", str(tmp_path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["light"] == {"rows": []} and [m["value"] for m in facts["measures"]] == [2.0]


def test_finished_houses_of_bench_moving_are_not_measured_again(tmp_path, monkeypatch):
    monkeypatch.setattr(moving, "MOVING_HOURS", moving.MOVING_HOURS[:1])
    (tmp_path / "moving").mkdir()
    for name, rows in (("7", [{"name": "chair_1"}]), ("prices", [{"way": "at rest"}])):
        (tmp_path / "moving" / f"{name}.json").write_text(json.dumps(rows))
    found = moving.compare(load_catalogue(default_cache()), default_cache(), tmp_path, seed=7)
    assert found == {"rows": [{"name": "chair_1"}], "prices": [{"way": "at rest"}]}
