"""The scripts of examples/ run from another folder and do what they say."""

from __future__ import annotations

import json
import re
import runpy
import shlex
import sys
from pathlib import Path

import cv2
import pytest
import torch
from hand_data import COMPACT, built, live_among_boxes, noise_features, small_house

from embodied.cli import main

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "examples"


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Runs an example in this process, which has loaded its libraries, and returns what it prints."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)

    def example(name: str, *words: str) -> str:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", [name, *words])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out

    yield example
    torch.set_num_threads(threads)


def test_every_example_is_run_here_and_shown_in_the_readme_of_examples():
    here = "".join(p.read_text(encoding="utf-8") for p in sorted(Path(__file__).parent.glob("test_*.py")))
    listed = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    for script in sorted(EXAMPLES.glob("*.py")):
        assert f'"{script.name}"' in here and script.name in listed, script.name


@pytest.mark.gl
@pytest.mark.slow
def test_generate_and_look_writes_a_plan_and_pictures(run, tmp_path):
    said = run("generate_and_look.py", "--out", "look")
    assert "digest" in said
    assert cv2.imread(str(tmp_path / "look" / "panorama.png")).std() > 20
    assert cv2.imread(str(tmp_path / "look" / "view.png")).shape == (480, 640, 3)
    assert {p.name for p in (tmp_path / "look").iterdir()} >= {"house.json", "plan.png"}


def test_the_day_of_a_household_begins_and_ends_in_bed(run):
    told = run("household_day.py", "--seed", "7")
    for person in told.split(", man ")[1:] + told.split(", woman ")[1:]:
        hours = re.findall(r"^  (\d\d:\d\d) (\w+)", person.partition("\nadult")[0], re.M)
        assert hours == sorted(hours) and hours[0][1] == hours[-1][1] == "sleeping" and len(hours) > 8


@pytest.mark.gl
@pytest.mark.slow
def test_the_gymnasium_loop_hears_help(run):
    said = run("gymnasium_loop.py", "--episodes", "2")
    assert said.count("“find ") >= 2 and said.count("reward") == 2


@pytest.mark.gl
@pytest.mark.slow
def test_a_data_set_teaches_a_torch_module_more_than_guessing(run, monkeypatch):
    live_among_boxes(monkeypatch)
    said = run("dataset_to_torch.py", "--data", "flats", "--epochs", "5")
    off, same = map(float, re.search(r"unseen house: (\d+) % off, (\d+) %", said).groups())
    assert off < same - 5


@pytest.mark.gl
@pytest.mark.slow
def test_looks_from_one_room_are_more_alike_to_an_encoder_than_those_from_two(run):
    said = run("encode.py", "--pictures", "unlit", "--steps", "40")
    assert "40 looks of 256 numbers" in said
    one, two = map(float, re.search(r"one room (\S+), from two rooms (\S+)\n", said).groups())
    assert one > two


@pytest.mark.gl
@pytest.mark.slow
@pytest.mark.parametrize(
    "what", [(), ("--task", "find", "--goals", "mug", "red box", "--eyes", "detector")], ids=["pixels", "detector"]
)
def test_ppo_runs_on_pixels_and_leaves_an_agent_and_its_curve(run, tmp_path, monkeypatch, what):
    pytest.importorskip("stable_baselines3")
    live_among_boxes(monkeypatch)
    short = "--threads 1 --pictures unlit --steps 128 --envs 2 --rollout 64 --judge 2 --flats 1"
    said = run("ppo_pixels.py", *shlex.split(short), *what, "--out", "ppo")
    for where in ("flats it learned in", "flats it never saw"):
        assert re.search(where + r": succeeds in \d+ % \(\d+ to \d+\) of 2 episodes, random walk \d+ %", said)
    assert (tmp_path / "ppo" / "agent.zip").exists()
    rows = (tmp_path / "ppo" / "curve.csv").read_text().splitlines()
    assert rows[0] == "steps,episodes,success,reward,seconds" and len(rows) == 2


def test_a_learner_outside_the_tree_is_trained_evaluated_and_studied(tmp_path, monkeypatch, capsys):
    """Each viewpoint has features of its own: the learner knows the houses of its training by heart."""
    monkeypatch.chdir(EXAMPLES)
    assert len((EXAMPLES / "my_learner.py").read_text("utf-8").splitlines()) < 120
    data = built(tmp_path / "data", "find", "1x40", make_house=small_house)
    noise_features(data)
    common = ["--data", str(data.folder), "--encoder", str(COMPACT), "--cache", str(tmp_path / "cache")]
    assert main(["train", "my_learner:LEARNER", *common, "--out", str(tmp_path / "run"), "--seed", "1"]) == 0
    trained = f"my_learner:LEARNER={tmp_path / 'run' / 'best.safetensors'}"
    assert main(["evaluate", "find", *common, "--split", "train", "--agent", trained, "random walk", "--json"]) == 0
    body = json.loads(capsys.readouterr().out)
    learned, chance = sorted(body["rows"], key=lambda r: -r["values"]["success"]["mean"])
    assert learned["agent"].endswith("learned") and learned["values"]["success"]["mean"] > 0.5
    assert main(["study", "my_learner:LEARNER", *common, "--out", str(tmp_path / "out"), "--seeds", "1"]) == 0
    assert "| 10 walks |" in capsys.readouterr().out
    assert main(["train", "my_learner:NOBODY"]) == 2 and "my_learner" in capsys.readouterr().err


@pytest.mark.slow
def test_agents_among_people_are_trained_and_judged(run, tmp_path, monkeypatch):
    pytest.importorskip("stable_baselines3")
    live_among_boxes(monkeypatch)
    run(
        "social_navigation.py",
        *["--flats", "1", "--unseen", "1", "--imitate", "60", "--steps", "1", "--judge", "1", "--out", "out"],
    )
    for kind, last in (("social", "PPO, out"), ("follow", "knows, and steps aside")):
        table = json.loads((tmp_path / "out" / f"social-{kind}.json").read_text())
        assert table["rows"][-1]["label"] == last and {c["key"] for c in table["columns"]} >= {"success"}
