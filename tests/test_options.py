"""Arguments are checked before any work begins, and what one word cannot be is said in one line."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys

import pytest

from embodied import cli
from embodied.cli.light import hour_of_day
from embodied.options import any_folder, any_path, file_to_write, folder_to_write, positive, video_side, whole


def said(capsys, *words: str) -> str:
    try:
        assert cli.main(words) == 2
    except SystemExit as e:  # words that the parser refuses
        assert e.code == 2
    out, err = capsys.readouterr()
    assert not out and err.startswith("error: ") and err.count("\n") == 1, err
    return err


LEARN = ("--data", "d", "--out", "o")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("light", "x", "--lights", "0", "--hour", "night"), "--lights: should be a whole number of at least 1"),
        (("light", "x", "--hour", "25:00"), "such as 17:30 or 17.5, got '25:00'"),
        (("light", __file__), "is a file; name the folder that it is in"),
        (("light", "/no/such/folder"), "house.json does not exist; make one with"),
        (("render", "x", "--node", "1", "--view", "v.mp4"), "--view: should end in .png, which is written"),
        (("export", "glb", "--house", "x", "--out", "x/house.json"), "--out: should end in .glb"),
        (("rollout", "--video", "house.json"), "--video: should end in .mp4"),
        (("rollout", "--rrd", "house.json"), "--rrd: should end in .rrd"),
        (("bench", "nope"), "unknown benchmark"),
        (("dataset", "find", "--out", "x", "--houses", "2000000000"), "at most 100000, got '2000000000'"),
        (("dataset", "find", "--out", "x", "--houses", "2", "--tasks", "2147483648"), "at most 10000000"),
        (("study", "bandit", "3.2", *LEARN, "--report", "--seeds", "99999999"), "at most 1000, got '99999999'"),
        (("train", "iliad", "regex", "--out", "o", "--learner", "nope"), "learner must be one of"),
        (("rollout", "--video-size", "0", "0"), "--video-size: should be an even number of at least 16"),
        (("rollout", "--video-size", "100000", "100000"), "at most 4096, got '100000'"),
        (("rollout", "--episodes", "-3"), "--episodes: should be a whole number of at least 1, got '-3'"),
        (("evaluate", "hanna", "--data", "d", "--threads", "0"), "--threads: should be a whole number of at least 1"),
        (("evaluate", "hanna", "--data", "d", "--batch", "-3"), "--batch: should be"),
        (("features", "--data", "d", "--workers", "-5"), "--workers: should be"),
        (("features", "--data", "d", "--pictures", "nope"), "--pictures: invalid choice: 'nope'"),
        (("train", "hanna", *LEARN, "--minutes", "-1"), "--minutes: should be a number above 0, got '-1'"),
        (("train", "hanna", *LEARN, "--validation-tasks", "0"), "validation_tasks must be at least 1"),
        (("train", "hanna", *LEARN, "--evaluation-temperature", "nan"), "evaluation_temperature must be"),
        (("train", "hanna", *LEARN, "--learning-rate", "inf"), "learning_rate must be positive and finite"),
        (("train", "vision", *LEARN, "--network", "nope"), "network must be one of"),
        (("train", "vision", *LEARN, "--epochs", "0"), "epochs must be at least 1"),
        (("dataset", "find", "--out", "x", "--pictures", "unlit", "--size", "-5"), "--size: should be"),
        (("dataset", "find", "--out", ""), "--out: should be a path, got an empty word"),
        (("house", "--out", "/dev/null"), "--out: /dev/null is a file, a folder is wanted"),
        (("export", "glb", "--house", "x", "--out", "/dev/null/a.glb"), "--out: /dev/null is a file"),
        (("export", "usd", "--house", "x", "--out", "a.glb"), "--out: should end in .usdz"),
        (("export", "mjcf", "--house", "x", "--out", "/dev/null"), "--out: /dev/null is a file, a folder is wanted"),
        (("render", "x", "--node", "1", "--equirect", "."), "--equirect: . is a folder, a file is wanted"),
        (("demo", "--size", "5000"), "at most 4096"),
        (("house", "--seed", "1", "--area", "900", "950", "--out", "x"), "area should be"),
        (("house", "--seed", "1", "--storeys", "9", "--out", "x"), "storeys"),
        (("render", "nowhere"), "house.json"),
        (("render", "nowhere", "--node", "3"), "--equirect"),
        (("doctor", "--pack", "none.sh3f"), "--fix"),
        (("doctor", "--fix", "--pack", "none.sh3f"), "none.sh3f"),
        (("view", "nowhere.rrd"), "nowhere.rrd"),
        (("assets", "list", "--class", "unicorn"), "unicorn"),
    ],
)
def test_odd_arguments_are_refused_before_any_work(words, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    os.symlink("loop", "loop")
    assert message in said(capsys, *words)
    assert [p.name for p in tmp_path.iterdir()] == ["loop"]


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        (whole(1, 9), ("1", "9", "+3"), ("0", "10", "x", "", "2.0", "1e3", "nan", "9" * 5000)),
        (whole(0), ("0",), ("-1",)),
        (video_side, ("16", "480"), ("17", "0", "4098")),
        (positive, ("0.5", "3"), ("0", "-1", "nan", "inf", "1e999", "x")),
        (hour_of_day, ("16:00", "16.5", "night", "0"), ("24", "16:60", "noonish", "-1", "nan", "")),
        (any_path, (".", "ü"), ("",)),
        (any_folder, (".", "new/one"), (__file__,)),
        (folder_to_write, ("new/one",), (f"{__file__}/x",)),
        (file_to_write, ("new/one",), (".", f"{__file__}/x")),
    ],
)
def test_types_of_arguments_take_what_they_name_and_nothing_else(kind, good, bad, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for text in good:
        kind(text)
    for text in bad:
        with pytest.raises(argparse.ArgumentTypeError, match=r"should be|is a f|cannot be used"):
            kind(text)


def test_a_terminal_that_knows_no_unicode_gets_question_marks_not_an_error():
    code = (
        "from embodied import cli\nfrom embodied.cli import doctor\n"
        "def run(args: doctor.DoctorOptions):\n    print('50.0', chr(177), '3.1')\n"
        "doctor.run = run\n"
        "raise SystemExit(cli.main(['doctor']))"
    )
    plain = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, env=plain)
    assert (done.returncode, done.stdout) == (0, "50.0 ? 3.1\n"), done.stderr
