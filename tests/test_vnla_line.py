"""The commands of VNLA's learner, end to end on a hand-made data set: training, resuming, judging, the tables."""

from __future__ import annotations

import json

import pytest
from hand_data import COMPACT, built, noise_features, small_house, validations_of

from embodied.agents.vnla.study import VnlaAgent
from embodied.cli import main

pytestmark = pytest.mark.slow

SMALL = [
    *("--hidden-size", 16, "--word-embedding", 8, "--navigation-embedding", 4, "--ask-embedding", 4, "--looking", 0),
    *("--budget-embedding", 4, "--batch", 4, "--validation-tasks", 3, "--validate-every", 1),
    *("--threads", 1, "--encoder", COMPACT),
]


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A tiny data set with features of the untrained encoder that are not computed but drawn."""
    data = built(tmp_path_factory.mktemp("vnla") / "data", "vnla", make_house=small_house)
    noise_features(data)
    return data


def run(*words) -> int:
    return main([str(w) for w in words])


def test_training_resuming_and_judging_from_the_command_line(data, tmp_path, capsys):
    train = ("train", "vnla", "--data", data.folder, "--out", tmp_path, *SMALL, "--iterations")
    assert run(*train, 1) == 0 and run(*train, 2) == 0
    said = capsys.readouterr()
    assert "continuing after update 1" in said.out + said.err and "pictures: unlit_192" in said.out + said.err
    assert [u for u, name, _ in validations_of(tmp_path) if name == "success"] == [1, 2]
    best = tmp_path / "best.safetensors"
    assert VnlaAgent.load(best).about.pictures == "unlit_192"
    judge = ("evaluate", "vnla", "--data", data.folder, "--agent", best, "--encoder", COMPACT, "--tasks", 2, "--json")
    rows = ("learned", "learned, asks never", "learned, direct intervention", "shortest")
    assert run(*judge, "--out", tmp_path / "judged", "--rows", *rows) == 0
    said_by_judge = capsys.readouterr()
    facts = json.loads(said_by_judge.out)
    by = {r["agent"]: r["values"] for r in facts["rows"]}
    assert by["shortest"]["success"]["mean"] == 1 and by["learned, asks never"]["requests"]["mean"] == 0
    assert "trained on pictures unlit_192" in said_by_judge.err and (tmp_path / "judged/table.md").exists()
    run_json = json.loads((tmp_path / "judged/run.json").read_text())
    assert "learned" in run_json["looking"] and "shortest" not in run_json["looking"] and run_json["pictures"]
    assert run(*judge, "--rows", "listener") == 2 and "unknown rows ['listener']" in capsys.readouterr().err


LISTENER = "scripted listener asking at random"


def test_the_tables_of_the_paper_from_one_command(data, tmp_path):
    words = ("study", "vnla", "askers", "--data", data.folder, "--out", tmp_path, *SMALL)
    words = (*words, "--iterations", 1, "--seeds", 1, "--tasks", 2)
    rows = ("--rows", "none", "first")
    assert run(*words, *rows) == 0
    text = (tmp_path / "vnla-askers.md").read_text()
    assert "| first |" in text and "unlit_192" in text and "seeds 123, 435, 6757, 867, 983" in text
    judged = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("runs/*/judged/*.json")}
    trained = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("best.safetensors")}
    assert run(*words, *rows) == 0 and len(judged) == 2 * 2 and len(trained) == 1, "two rows of one agent"
    assert judged == {p: p.stat().st_mtime_ns for p in tmp_path.rglob("runs/*/judged/*.json")}, "nothing is done twice"
    assert trained == {p: p.stat().st_mtime_ns for p in tmp_path.rglob("best.safetensors")}
    assert run(*words, "--rows", "learned", "teacher", LISTENER) == 0
    text = (tmp_path / "vnla-askers.md").read_text()
    assert "| teacher |" in text and f"| {LISTENER} |" in text and "(34.95)" in text
    assert "Not run: none, first, random, none, blind, learned, blind, scripted listener asking as the teacher." in text


def test_a_rule_of_play_is_chosen_on_the_command_line(data, capsys):
    words = ("evaluate", "vnla", "--data", data.folder, "--rules", "algorithm-6", "--agent", "shortest", "--json")
    assert run(*words) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["values"]["success"]["mean"] == 1
