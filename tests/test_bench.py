"""`embodied bench`: every part that is named is measured."""

from __future__ import annotations

import itertools
import json

import numpy as np

from embodied.bench import light, timing, views, world
from embodied.cli import main
from embodied.render.panorama import Panorama


def test_every_part_that_is_named_is_measured(tmp_path, monkeypatch, capsys):
    made = timing.Measure("a thing", 2.0, "s", 1.0, 3.0, 5)
    monkeypatch.setattr(world, "houses", lambda catalogue, seed: iter([made]))
    monkeypatch.setattr(light, "compare", lambda *args, **options: {"rows": []})
    monkeypatch.setattr(light, "table", lambda facts: "the ways")
    assert main(["bench", "light", "houses", "--cache", str(tmp_path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["light"] == {"rows": []} and [m["value"] for m in facts["measures"]] == [2.0]


def test_views_turn_round_and_round():
    """On a fast machine, a measurement looks more than twice around."""
    rgb, none = np.zeros((6, 8, 8, 3), np.uint8), np.zeros((6, 8, 8), np.float32)
    panorama = Panorama(rgb, none + 1, none.astype(np.int32))
    turns = iter(itertools.count(0.01, 1.01))
    for _ in range(5):
        views._look(panorama, ("rgb", "depth", "ids"), (6, 8), turns)
    assert next(turns) > 5 * views.HEADINGS
