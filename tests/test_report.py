"""The page about a run: its plots and rows say what the tables say."""

from __future__ import annotations

import json

from embodied.records import episodes_file
from viz.report import _name, judged


def test_success_on_the_page_is_that_of_the_table(tmp_path):
    assert judged(tmp_path) == {}
    rows = [
        {
            "split": "test_unseen",
            "agent": "learned, no ask",
            "values": {"success": {"mean": 0.25, "half_width_95": 0.05}},
        }
    ]
    (tmp_path / "table.json").write_text(json.dumps(rows))
    (tmp_path / episodes_file("test_unseen", "learned, no ask")).touch()
    assert judged(tmp_path) == {"test unseen learned no ask": (25.0, 5.0)}
    assert [_name(f.name) for f in tmp_path.glob("episodes*.jsonl")] == list(judged(tmp_path)), (
        "the page lists it by the same name"
    )
