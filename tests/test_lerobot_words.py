"""What agents are told in a LeRobot export: the expert of each kind asks where help can be had."""

from __future__ import annotations

from itertools import pairwise

import pyarrow.parquet as pq
import pytest
from hand_data import built, paint, small_house

from embodied.cli import main
from embodied.render.pictures import Baked


def exported(kind, folder, *options) -> list[dict]:
    """Steps of every training task of four by four nodes, with the instruction in words."""
    data = built(folder / "data", kind, size="1x4", make_house=small_house)
    paint(data, Baked("fast", size=16), data.names("train"))
    order = ["export", "lerobot", "--data", str(data.folder), "--out", str(folder / "out"), "--size", "16", *options]
    assert main(order) == 0
    words = pq.read_table(folder / "out" / "meta" / "tasks.parquet").to_pydict()
    heard = dict(zip(words["task_index"], words["task"]))
    rows = pq.read_table(folder / "out" / "data" / "chunk-000" / "file-000.parquet").to_pylist()
    return [row | {"words": heard[row["task_index"]]} for row in rows]


@pytest.mark.parametrize("kind", ("hanna", "hari", "vnla"))
def test_what_an_assistant_says_is_what_the_expert_is_to_do_next(kind, tmp_path):
    rows = exported(kind, tmp_path)
    answered = [(a, b) for a, b in pairwise(rows) if a["language_events"] and not a["next.done"]]
    assert len(answered) > 2 and all(a["action"][5] == 1 for a, _ in answered), "asked"
    for before, after in answered:
        (event,) = before["language_events"]
        assert event["content"] and after["words"].startswith(event["content"])
    assert any(not row["words"].startswith("find") for row in rows)
    assert sum(row["next.success"] for row in rows) == sum(row["next.done"] for row in rows), "experts arrive"


def test_another_agent_plays_where_it_is_named(tmp_path, capsys):
    rows = exported("hanna", tmp_path, "--agent", "shortest")
    assert all(row["words"].startswith("find") and not row["language_events"] for row in rows)
    order = ["export", "lerobot", "--data", str(tmp_path / "data"), "--out", str(tmp_path / "b")]
    assert main([*order, "--agent", "scripted listener"]) == 2
    assert "or export the --episodes" in capsys.readouterr().err


@pytest.mark.parametrize(
    "option", [("--agent", "shortest"), ("--split", "train"), ("--tasks", "1")], ids=lambda o: o[0]
)
def test_episodes_say_who_played_what(option, tmp_path, capsys):
    built(tmp_path / "data", "hanna", size="1x4", make_house=small_house)
    order = ["export", "lerobot", "--data", str(tmp_path / "data"), "--out", str(tmp_path / "b")]
    assert main([*order, *option, "--episodes", str(tmp_path / "x.jsonl")]) == 2
    assert f"leave {option[0]} out" in capsys.readouterr().err
