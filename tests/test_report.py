"""The page about a run and its list of episodes."""

from __future__ import annotations

import pytest

from embodied.interface import Episode, FindObject, Pose, Task
from embodied.records import RecordError, save_lines
from embodied.viz.report import Listed, load_run, write_page

TASK = Task("a/find/1", "find", "a", Pose(0), FindObject("mug", None, ("mug_1",)), (1,), "find a mug", 0.0, 9)


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
