"""The list of the episodes of a run."""

from __future__ import annotations

import pytest

from embodied.interface import Episode, FindObject, Pose, Task
from embodied.records import RecordError, save_lines
from embodied.viz.episode_log import load_run

TASK = Task("a/find/1", "find", "a", Pose(0), FindObject("mug", None, ("mug_1",)), (1,), "find a mug", 0.0, 9)


def test_an_episode_that_did_not_end_is_refused(tmp_path):
    path = tmp_path / "episodes_x.jsonl"
    save_lines(path, [Episode(TASK, (), "<script>")])
    with pytest.raises(RecordError, match="episodes_x.jsonl:1: .*ended should be 'stop' or 'limit'"):
        load_run(tmp_path)
