"""`embodied bench`: every part that is named is measured."""

from __future__ import annotations

import json

from embodied.bench import moving, timing, world
from embodied.cli import main


def test_every_part_that_is_named_is_measured(tmp_path, monkeypatch, capsys):
    made = timing.Measure("a thing", 2.0, "s", 1.0, 3.0, 5)
    monkeypatch.setattr(world, "houses", lambda catalogue, seed: iter([made]))
    monkeypatch.setattr(moving, "compare", lambda *args, **options: {"rows": []})
    monkeypatch.setattr(moving, "table", lambda facts: "the ways")
    assert main(["bench", "moving", "houses", "--cache", str(tmp_path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["moving"] == {"rows": []} and [m["value"] for m in facts["measures"]] == [2.0]
