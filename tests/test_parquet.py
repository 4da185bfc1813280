"""The Parquet tables hold the data set, whole, and the card tells Hugging Face where they are."""

from __future__ import annotations

import pyarrow.parquet as pq
import pytest
from hand_data import built

from embodied.datasets.parquet import PARQUET_TABLES, export_parquet, size_category
from embodied.evaluation.evaluate import agent, play
from embodied.house.house import House
from embodied.interface import Episode, Route, Task
from embodied.records import from_json, save_lines


@pytest.mark.slow
def test_tables_give_back_every_record_and_the_card_names_every_file(tmp_path):
    data = built(tmp_path / "d")
    episodes = play(data.split("val_unseen").make_env, agent("hanna", "ask every 5"), data.tasks("val_unseen"), seed=0)
    save_lines(tmp_path / "episodes_val.jsonl", episodes)
    files = export_parquet(data, tmp_path / "out", [tmp_path / "episodes_val.jsonl"])

    def table(name):
        return pq.read_table(tmp_path / "out" / f"{name}.parquet")

    for split in data.splits:
        tasks = table(f"tasks/{split}").to_pylist()
        assert [from_json(Task, t["record"]) for t in tasks] == list(data.tasks(split))
        assert [t["goal_nodes"] for t in tasks] == [list(t.goal_nodes) for t in data.tasks(split)]
        assert all(t["shortest_m"] >= 0 and t["object_class"] and t["path"] is None for t in tasks)
        houses = table(f"houses/{split}").to_pylist()
        assert [House.from_json(h["record"]).digest for h in houses] == [h["digest"] for h in houses]
        assert [len(h["positions"]) for h in houses] == [len(h["viewpoints"]) for h in houses]
        routes = table(f"routes/{split}").to_pylist()
        told = [r for name in data.names(split) for r in data.routes(name)]
        assert [from_json(Route, r["record"]) for r in routes] == told
    played = table("episodes/episodes_val").to_pylist()
    assert [from_json(Episode, e["record"]).nodes for e in played] == [e.nodes for e in episodes]
    assert any("ask help" in e["actions"] for e in played) and any(any(e["replies"]) for e in played)
    for name in PARQUET_TABLES:
        assert (tmp_path / "out" / name).is_dir()

    card = (tmp_path / "out/README.md").read_text()
    assert card.startswith("---\n") and "$" not in card and data.digest[:16] in card
    for file in files[:-1]:
        assert f"path: {file.relative_to(tmp_path / 'out').as_posix()}\n" in card


@pytest.mark.slow
def test_tables_of_routes_to_follow_hold_their_paths(tmp_path):
    data = built(tmp_path / "d", "vln")
    export_parquet(data, tmp_path / "out")
    for row, task in zip(
        pq.read_table(tmp_path / "out/tasks/train.parquet").to_pylist(), data.tasks("train"), strict=True
    ):
        assert row["path"] == list(task.goal.path) and row["route"] == task.goal.route and row["object_class"] is None


def test_sizes_are_said_in_hugging_faces_words():
    assert [size_category(n) for n in (999, 1000, 82_484, 500_000)] == ["n<1K", "1K<n<10K", "10K<n<100K", "100K<n<1M"]
