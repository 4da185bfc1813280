"""The digests that tell whether a change that should alter nothing altered something."""

from __future__ import annotations

import json

from embodied.bench.freeze import changes, folder_digest


def test_a_folder_is_the_same_when_only_the_program_that_made_it_differs(tmp_path):
    for name, code in (("a", "1"), ("b", "2")):
        (tmp_path / name).mkdir()
        facts = {"code": code, "tasks": [1, {"version": code, "n": 3}]}
        (tmp_path / name / "dataset.json").write_text(json.dumps(facts))
        (tmp_path / name / "tasks.jsonl").write_text('{"id": 1}\n{"id": 2}\n')
    assert folder_digest(tmp_path / "a") == folder_digest(tmp_path / "b")


def test_one_letter_one_name_and_one_line_each_change_a_folder(tmp_path):
    (tmp_path / "tasks.jsonl").write_text('{"id": 1}\n{"id": 2}\n')
    before = folder_digest(tmp_path)
    (tmp_path / "tasks.jsonl").write_text('{"id": 1}\n{"id": 3}\n')
    letter = folder_digest(tmp_path)
    (tmp_path / "tasks.jsonl").write_text('{"id": 1}\n')
    line = folder_digest(tmp_path)
    (tmp_path / "tasks.jsonl").rename(tmp_path / "task.jsonl")
    assert len({before, letter, line, folder_digest(tmp_path)}) == 4


def test_changes_name_what_differs_and_what_stands_on_one_side_only():
    assert changes({"a": "1", "b": "2"}, {"a": "1", "b": "2"}) == []
    assert changes({"a": "1", "b": "2"}, {"a": "3", "c": "4"}) == [
        "a: changed",
        "b: only on one side",
        "c: only on one side",
    ]
