"""The scripts of examples/ run as a newcomer runs them, and do what they say."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "examples"


@pytest.fixture(scope="module")
def flats(tmp_path_factory) -> Path:
    """Where the data set of an example goes."""
    return tmp_path_factory.mktemp("examples") / "flats"


def run(name: str, folder: Path, *words: str) -> str:
    """What an example prints, run in `folder`."""
    env = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    script = [sys.executable, str(EXAMPLES / name), *words]
    done = subprocess.run(script, cwd=folder, env=env, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def test_every_example_is_run_here_and_shown_in_the_readme_of_examples():
    here, listed = Path(__file__).read_text(), (EXAMPLES / "README.md").read_text()
    for script in sorted(EXAMPLES.glob("*.py")):
        assert f'run("{script.name}"' in here and script.name in listed, script.name


@pytest.mark.gl
@pytest.mark.slow
def test_generate_and_look_writes_a_plan_and_pictures(tmp_path):
    said = run("generate_and_look.py", tmp_path, "--out", "look")
    assert "digest" in said
    assert cv2.imread(str(tmp_path / "look" / "panorama.png")).std() > 20
    assert cv2.imread(str(tmp_path / "look" / "view.png")).shape == (480, 640, 3)
    assert {p.name for p in (tmp_path / "look").iterdir()} >= {"house.json", "plan.png"}


@pytest.mark.gl
@pytest.mark.slow
def test_the_gymnasium_loop_hears_help(tmp_path):
    said = run("gymnasium_loop.py", tmp_path, "--episodes", "2")
    assert said.count("“find ") >= 2 and said.count("reward") == 2


@pytest.mark.gl
@pytest.mark.slow
def test_a_data_set_teaches_a_torch_module_more_than_guessing(tmp_path, flats):
    said = run("dataset_to_torch.py", tmp_path, "--data", str(flats))
    off, same = map(float, re.search(r"unseen house: (\d+) % off, (\d+) %", said).groups())
    assert off < same - 5


@pytest.mark.gl
@pytest.mark.slow
def test_looks_from_one_room_are_more_alike_to_an_encoder_than_those_from_two(tmp_path):
    said = run("encode.py", tmp_path, "--pictures", "unlit", "--steps", "40")
    assert "40 looks of 192 numbers" in said
    one, two = map(float, re.search(r"one room (\S+), from two rooms (\S+)\n", said).groups())
    assert one > two


@pytest.mark.gl
@pytest.mark.slow
def test_ppo_runs_on_pixels_and_leaves_an_agent_and_its_curve(tmp_path):
    pytest.importorskip("stable_baselines3")
    short = ("--pictures", "unlit", "--steps", "256", "--envs", "2", "--rollout", "64", "--judge", "3", "--flats", "1")
    said = run("ppo_pixels.py", tmp_path, *short, "--out", "ppo")
    for where in ("flats it learned in", "flats it never saw"):
        assert re.search(where + r": succeeds in \d+ % \(\d+ to \d+\) of 3 episodes, random walk \d+ %", said)
    assert (tmp_path / "ppo" / "agent.zip").exists()
    rows = (tmp_path / "ppo" / "curve.csv").read_text().splitlines()
    assert rows[0] == "steps,episodes,success,reward,seconds" and 1 < len(rows) <= 3
