"""The digests that tell whether a change that should alter nothing altered something."""

from __future__ import annotations

import json

import pytest

from embodied import cli
from embodied.bench.freeze import Frozen, compare, digests_of, folder_digest, load_frozen, summary
from embodied.records import RecordError


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


def products(folder, *, mean: float = 0.5, half: float = 0.1, feature: bytes = b"f") -> dict[str, str]:
    for name in ("hanna/features", "eval_hanna", "light"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / "houses.json").write_text('{"house/38-46/0": "ab"}')
    (folder / "light" / "page_000.jpg").write_bytes(b"page")
    (folder / "hanna" / "config.json").write_text('{"seed": 0}')
    (folder / "hanna" / "features" / "a").write_bytes(feature)
    (folder / "eval_hanna" / "episodes_val_x.jsonl").write_text("{}\n")
    table = [{"agent": "x", "values": {"success": {"mean": mean, "half_width_95": half, "n": 2}}}]
    (folder / "eval_hanna" / "table.json").write_text(json.dumps(table))
    return digests_of(folder)


def test_each_part_of_the_products_has_a_digest_of_its_own(tmp_path):
    first = products(tmp_path)
    assert list(first) == [
        "house/38-46/0",
        "light/flat",
        "dataset/hanna",
        "features/hanna",
        *(f"eval/hanna/{part}" for part in ("episodes", "means", "intervals")),
    ]

    def changed(**change) -> list[str]:
        after = products(tmp_path, **change)
        return [name for name in first if first[name] != after[name]]

    assert changed() == []
    assert changed(mean=0.6) == ["eval/hanna/means"]
    assert changed(half=0.2) == ["eval/hanna/intervals"]
    assert changed(feature=b"g") == ["features/hanna"]


def test_every_part_is_the_same_or_differs_for_a_reason_or_without_one():
    before = Frozen({"a/1": "1", "b/1": "2", "b/2": "3", "c": "4", "a/2": "5"}, meant={"b/*": "light is new"})
    verdicts = compare(before, {"a/1": "1", "b/1": "9", "b/2": "3", "c": "0", "d": "6"})
    assert [str(v) for v in verdicts] == [
        "a/1: same",
        "b/1: differs, expected because light is new",
        "b/2: same",
        "c: differs",
        "d: only now",
        "a/2: only before",
    ]
    assert [v.part for v in verdicts if v.wrong] == ["c", "d", "a/2"]
    assert summary(verdicts).splitlines()[0] == "same: 1 of a, 1 of b" and len(summary(verdicts).splitlines()) == 5


@pytest.mark.parametrize("text", ["[]", '{"house": "ab"}', '{"digests": {"a": 1}}', "no"])
def test_a_file_that_holds_no_digests_is_refused_before_anything_is_made(text, tmp_path, capsys):
    (tmp_path / "old.json").write_text(text)
    with pytest.raises(RecordError, match=r"old\.json"):
        load_frozen(tmp_path / "old.json")
    assert cli.main(["bench", "freeze", "--against", str(tmp_path / "old.json"), "--out", str(tmp_path / "out")]) == 2
    assert "old.json" in capsys.readouterr().err and not (tmp_path / "out").exists()
