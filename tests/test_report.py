"""The page about a run: its plots and rows say what the tables say."""

from __future__ import annotations

import json

from viz.report import judged


def test_success_on_the_page_is_that_of_the_table(tmp_path):
    assert judged(tmp_path) == {}
    rows = [{"split": "test_unseen", "agent": "ask every 5", "values": {"success": {"mean": 0.25, "half_width_95": 0.05}}}]
    (tmp_path / "table.json").write_text(json.dumps(rows))
    assert judged(tmp_path) == {"test unseen ask every 5": (25.0, 5.0)}
