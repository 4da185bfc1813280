"""A data set that was changed, or that contradicts itself, is refused with the file and the remedy."""

from __future__ import annotations

import functools
import json
import os
from pathlib import Path

import pytest
from hand_data import build, built, content, small_house

from embodied.assets.cache import digest
from embodied.datasets.store import Dataset, DatasetError
from embodied.house.house import HouseError
from embodied.locks import LockedError
from embodied.records import RecordError

pytestmark = pytest.mark.slow

HOUSE = "test_0000"
TASKS = "tasks_test_unseen.jsonl"


@pytest.fixture
def folder(tmp_path) -> Path:
    return built(tmp_path / "data").folder


def use(folder: Path) -> None:
    """Read what judging in one house would read."""
    data = Dataset(folder)
    assert data.table() and data.names("test_unseen") == (HOUSE,)
    data.tasks("test_unseen")
    data.routes(HOUSE)
    data.place(HOUSE)


def rewrite(folder: Path, file: str, text: str, name: str = HOUSE) -> None:
    """Change a file of a house and make dataset.json agree, as somebody who knows the format would."""
    (folder / "houses" / name / file).write_text(text)
    index = json.loads((folder / "dataset.json").read_text())
    index["files"][f"{name}/{file}"] = digest(text.encode())[:16]
    index["digest"] = digest(index["files"])
    (folder / "dataset.json").write_text(json.dumps(index))


def lines_of(folder: Path, file: str) -> list[dict]:
    return [json.loads(line) for line in (folder / "houses" / HOUSE / file).read_text().splitlines()]


def as_lines(items: list[dict]) -> str:
    return "".join(json.dumps(i) + "\n" for i in items)


@pytest.mark.parametrize("file", ["routes.jsonl", TASKS, "house.json", "connectivity.json"])
def test_a_file_that_was_changed_is_noticed(file, folder):
    path = folder / "houses" / HOUSE / file
    path.write_bytes(b"" if file == "routes.jsonl" else path.read_bytes().replace(b"1", b"2", 1))
    with pytest.raises(DatasetError, match=rf"{file} was changed since it was written.*delete .*{HOUSE}"):
        use(folder)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t["start"].update(turn=99), r"turn should be 0 to 11"),
        (lambda t: t["start"].update(node=-1), "nodes are counted from 0"),
        (lambda t: t.update(goal_nodes=[]), "at least one node"),
        (lambda t: t.update(radius=-1.0), "radius, horizon and budget"),
        (lambda t: t.update(horizon=0), "radius, horizon and budget"),
    ],
)
def test_a_task_that_cannot_be_is_refused_with_its_line(change, message, folder):
    tasks = lines_of(folder, TASKS)
    change(tasks[1])
    rewrite(folder, TASKS, as_lines(tasks))
    with pytest.raises((DatasetError, RecordError), match=rf"{TASKS}:2: .*{message}"):
        use(folder)


@pytest.mark.parametrize(
    ("change", "message"),
    [(lambda r: r.update(path=[]), "at least one node"), (lambda r: r.update(tilt=2), "tilt -1 to 1")],
)
def test_a_route_off_the_graph_is_refused(change, message, folder):
    routes = lines_of(folder, "routes.jsonl")
    change(routes[2])
    rewrite(folder, "routes.jsonl", as_lines(routes))
    with pytest.raises((DatasetError, RecordError), match=rf"routes.jsonl:3: .*{message}"):
        use(folder)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda v: v[0].update(pose=v[0]["pose"][:15]), "a pose of 16"),
        (lambda v: v[0]["pose"].__setitem__(3, 1e300), "a pose of 16"),
        (lambda v: v[0].update(unobstructed=["false"] * len(v)), "booleans 'unobstructed'"),
        (lambda v: v[0].update(included=1), "'included'"),
        (lambda v: v[0].update(image_id=v[1]["image_id"]), "an image_id of its own"),
    ],
)
def test_a_graph_that_cannot_be_is_refused(change, message, folder):
    items = json.loads((folder / "houses" / HOUSE / "connectivity.json").read_text())
    change(items)
    rewrite(folder, "connectivity.json", json.dumps(items))
    with pytest.raises((DatasetError, HouseError), match=rf"connectivity.json.*{message}"):
        use(folder)


@pytest.mark.parametrize(
    ("file", "change"),
    [
        ("config.json", lambda b: b["config"].update(kind="nope")),
        ("config.json", lambda b: b["config"].update(surprise=1)),
        ("config.json", lambda b: b["config"].update(seed=5)),
        ("dataset.json", lambda b: b.update(digest="0" * 64)),
        ("dataset.json", lambda b: b["files"].pop(f"{HOUSE}/{TASKS}")),
        ("dataset.json", lambda b: b["splits"]["train"].update(houses="two")),
    ],
)
def test_an_index_that_was_changed_is_refused(file, change, folder):
    body = json.loads((folder / file).read_text())
    change(body)
    (folder / file).write_text(json.dumps(body))
    with pytest.raises(DatasetError, match=r"\.json"):
        use(folder)


def test_a_second_build_of_the_same_folder_is_refused_and_the_first_ends_right(tmp_path):
    make = functools.partial(build, tmp_path / "data", tmp_path / "cache", "find", size="1x4")

    def house(*facts):
        with pytest.raises(LockedError, match=f"being written by process {os.getpid()}"):
            make()
        return small_house(*facts)

    make(make_house=house)
    assert content(tmp_path / "data") == content(built(tmp_path / "whole", "find", "1x4", small_house).folder)
