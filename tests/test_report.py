"""The page about a run: its plots and rows say what the tables say."""

from __future__ import annotations

import json

import pytest

from embodied.interface import Episode, FindObject, Pose, Task
from embodied.records import RecordError, episodes_file, save_lines
from embodied.viz.report import Listed, _name, judged, load_run, write_page

TASK = Task("a/find/1", "find", "a", Pose(0), FindObject("mug", None, ("mug_1",)), (1,), "find a mug", 0.0, 9)


def test_success_on_the_page_is_that_of_the_table(tmp_path):
    assert judged(tmp_path) == {}
    values = {"success": {"mean": 0.25, "half_width_95": 0.05}}
    row = {"split": "test_unseen", "agent": "learned, no ask", "values": values}
    (tmp_path / "table.json").write_text(json.dumps([row]))
    (tmp_path / episodes_file("test_unseen", "learned, no ask")).touch()
    assert judged(tmp_path) == {"test unseen learned no ask": (25.0, 5.0)}
    assert [_name(f.name) for f in tmp_path.glob("episodes*.jsonl")] == list(judged(tmp_path)), "by the same name"


@pytest.mark.slow
def test_nothing_that_an_episode_says_becomes_a_part_of_the_page(tmp_path):
    evil = "<script>alert(1)</script>"
    episode = Episode(TASK, (), evil, agent=evil)
    page = write_page(tmp_path, [Listed(evil, episode)]).read_text()
    assert "<script" not in page and "&lt;script&gt;" in page


def test_an_episode_that_did_not_end_is_refused(tmp_path):
    path = tmp_path / "episodes_x.jsonl"
    save_lines(path, [Episode(TASK, (), "<script>")])
    with pytest.raises(RecordError, match="episodes_x.jsonl:1: .*ended should be 'stop' or 'limit'"):
        load_run(tmp_path)


@pytest.mark.parametrize("text", ["{}", "[{}]", "[1]", '[{"split": "a", "agent": "b", "values": null}]', "["])
def test_a_damaged_table_is_named(text, tmp_path):
    (tmp_path / "table.json").write_text(text)
    with pytest.raises(RecordError, match="table.json"):
        judged(tmp_path)
