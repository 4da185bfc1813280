"""Nothing of other people's is deleted or believed: what stands beside what is written, episodes played elsewhere."""

from __future__ import annotations

import argparse
import ast
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hand_data import build, content, paint, small_house
from hand_worlds import grid_world
from test_locks import own_files

from embodied import cli
from embodied.assets.cache import DRAFTS
from embodied.assets.closure import ROOT
from embodied.cli import doctor
from embodied.datasets.checks import DatasetError
from embodied.datasets.store import Dataset
from embodied.evaluation.evaluate import play
from embodied.interface import Episode
from embodied.light import LightError, backend
from embodied.light.baking import house as baking
from embodied.policies.baselines import Shortest
from embodied.records import RecordError, from_json, save_lines
from embodied.render.panorama import Panorama
from embodied.render.pictures import Baked
from embodied.seeds import stream


@pytest.fixture(scope="module")
def here(tmp_path_factory) -> Dataset:
    """A data set whose houses have painted pictures."""
    folder = tmp_path_factory.mktemp("here")
    data = build(folder / "data", folder / "cache", "vln", size="1x4", make_house=small_house)
    paint(data, Baked("fast", size=16))
    return data


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory) -> Path:
    """Episodes that were played in another data set, whose houses have the same names."""
    folder = tmp_path_factory.mktemp("elsewhere")
    split = build(folder / "data", folder / "cache", "vln", size="1x4").split("val_seen")
    save_lines(folder / "run" / "episodes_val_seen_x.jsonl", play(split.make_env, Shortest(), split.tasks, seed=0))
    return folder / "run" / "episodes_val_seen_x.jsonl"


@pytest.fixture(scope="module")
def played(here, tmp_path_factory) -> Path:
    split, path = here.split("val_seen"), tmp_path_factory.mktemp("played") / "episodes_val_seen_x.jsonl"
    save_lines(path, play(split.make_env, Shortest(), split.tasks, seed=0))
    return path


# Whose it is --------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("what", ["lerobot", "view"])
def test_episodes_of_another_data_sets_house_are_believed_nowhere(what, here, elsewhere, played, tmp_path, capsys):
    out, size = ["--out", str(tmp_path / "o")], ["--size", "16"]
    orders = {
        "lerobot": lambda file: ["export", "lerobot", "--episodes", str(file), *size, *out],
        "view": lambda file: ["view", str(file.parent), "--episode", "0"],
    }
    assert cli.main([*orders[what](elsewhere), "--data", str(here.folder)]) == 2
    assert "was played in another house of the name" in capsys.readouterr().err
    assert not list(tmp_path.rglob("*.*")), "nothing is written"
    if what != "view":
        assert cli.main([*orders[what](played), "--data", str(here.folder)]) == 0, "its own are"


def test_nodes_that_the_house_has_not_are_refused(here, played):
    (line, *_) = played.read_text().splitlines()
    body = json.loads(line)
    body["task"]["goal_nodes"] = [10**6]
    episode = from_json(Episode, json.dumps(body))
    with pytest.raises(DatasetError, match=r"names the nodes \[1000000\], its house has 0 to 15"):
        here.place_of(episode)
    body["task"]["radius"] = 5e11
    with pytest.raises(RecordError, match="radius should be at most 100 m, which no house is wide, got 5e\\+11"):
        from_json(Episode, json.dumps(body))


# What is deleted ----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    "order",
    [
        ["dataset", "vln", "--houses", "1", "--tasks", "4", "--pictures", "none", "--workers", "1"],
        ["evaluate", "vln", "--agent", "shortest", "--split", "val_seen"],
        ["export", "r2r"],
        ["export", "lerobot", "--split", "val_seen", "--size", "16"],
    ],
    ids=lambda order: " ".join(order[:2]),
)
def test_no_command_touches_what_stands_beside_what_it_writes(order, here, tmp_path, monkeypatch):
    if order[0] == "dataset":  # as `here` was built, house by house
        monkeypatch.setattr("embodied.datasets.build.make_dataset_house", small_house)
        out = tmp_path / "out"
        order = ["dataset", *order[1:], "--language", "plain", "--seed", "4", "--out", str(out)]
        beside = (tmp_path, out / "houses", out / "houses" / "train_0000")
        assert cli.main(order) == 0
        (out / "dataset.json").unlink()
    else:
        order = [*order, "--data", str(here.folder), "--out", str(tmp_path / "out")]
        beside = (tmp_path,) if order[1] == "lerobot" else (tmp_path, tmp_path / "out")
    mine: dict[Path, bytes] = {}
    for folder in beside:
        folder.mkdir(exist_ok=True)
        mine |= {p: p.read_bytes() for p in own_files(folder) if p.is_file()}
    assert cli.main(order) == 0
    assert {p: p.read_bytes() for p in mine if p.is_file()} == mine


DELETES = {"rmtree", "unlink", "rmdir", "remove"}
REVIEWED = {
    "assets/cache.py": "drafts, which are marked",
    "embodied/cli/cache.py": "what it was asked to, of the kinds that the program keeps in a cache",
    "agents/bandit/corpus.py": "the mark of a whole corpus, before it writes another",
    "embodied/cli/serve.py": "its own links, before it writes them anew",
    "embodied/locks.py": "its own lock",
    "embodied/datasets/build.py": "an empty folder",
    "embodied/light/baking/house.py": "a bake in the cache",
    "embodied/light/pages/files.py": "a bake in the cache",
    "embodied/scene/collision.py": "a file in the cache",
    "embodied/scene/export.py": "house.xml, which it writes anew",
    "agents/vision/run.py": "the checkpoint of a finished training",
}
"""Who deletes files, and which; nobody else does."""


def test_only_reviewed_places_delete_files():
    found = set()
    for package in ("assets", "embodied", "agents", "viz"):
        for path in (ROOT / package).rglob("*.py"):
            calls = (n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Call))
            called = [n.func for n in calls if isinstance(n.func, ast.Attribute)]
            if any(f.attr in DELETES and (f.attr != "remove" or ast.unparse(f.value) == "os") for f in called):
                found.add(path.relative_to(ROOT).as_posix())
    assert found <= set(REVIEWED), f"{found - set(REVIEWED)} delete files; say here what makes them sure"


@pytest.mark.slow
@pytest.mark.parametrize("what", ["parquet", "r2r", "lerobot"])
def test_an_export_that_is_killed_leaves_nothing_that_is_believed_and_the_next_is_whole(what, here, tmp_path):
    options = ["--split", "val_seen", "--size", "16"] if what == "lerobot" else []
    order = ["export", what, "--data", str(here.folder), *options, "--out"]
    assert cli.main([*order, str(tmp_path / "whole" / "out")]) == 0
    (tmp_path / "cut").mkdir()
    whole, out, rng = content(tmp_path / "whole" / "out"), tmp_path / "cut" / "out", stream(0, "kills")
    process = subprocess.Popen([sys.executable, "-m", "embodied", *order, str(out)], stderr=subprocess.DEVNULL)
    while not any(out.parent.iterdir()) and process.poll() is None:
        time.sleep(0.01)
    time.sleep(float(rng.uniform(0.0, 0.06)))
    process.send_signal(signal.SIGKILL)
    process.wait()
    there = {k: v for k, v in content(out).items() if not k.startswith(".")} if out.exists() else {}
    assert all(DRAFTS in name or data == whole[name] for name, data in there.items()), "what has its name is whole"
    if what != "lerobot" or not there:  # it goes into empty folders only
        assert cli.main([*order, str(out)]) == 0
    assert content(out) == whole and list(out.parent.iterdir()) == [out]


# Light --------------------------------------------------------------------------------------------


def test_whoever_lights_a_house_is_told_before_how_long_it_takes_or_what_is_missing(monkeypatch, tmp_path, caplog):
    house, light = grid_world(4).house, lambda: baking.bake(grid_world(4).house, None, tmp_path, "fast")
    for name, value in {"house_parts": lambda *_: (), "looks_of": lambda _: "", "BakeContext": None}.items():
        monkeypatch.setattr(baking, name, value)
    with monkeypatch.context() as without_llvm:
        without_llvm.setattr("embodied.light.backend.mitsuba", lambda: backend.variant_of(lambda name: False))
        finding = doctor.path_tracer(None)
        assert "doctor --fix" in finding.text and "unlit" in finding.remedy and not finding.ok and not finding.needed
        with pytest.raises(LightError, match=r"needs LLVM .*`embodied doctor --fix`"):
            light()
    assert not caplog.text
    monkeypatch.setattr(baking, "device", lambda: "llvm")
    with pytest.raises(TypeError, match="NoneType"):  # it begins
        light()
    assert re.search(f"lighting {house.name}, which .*, takes about a minute$", caplog.text.strip())


# What is read -------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [90.0, -360.0, float("nan"), float("inf")])
def test_degrees_and_what_is_no_angle_are_no_radians(angle):
    faces = Panorama(np.zeros((6, 8, 8, 3), np.uint8), np.ones((6, 8, 8), np.float32), np.zeros((6, 8, 8), np.int32))
    for look in (faces.view, faces.view_rgb):
        with pytest.raises(ValueError, match=r"are in radians, got .*math\.radians\(90\)"):
            look(angle)
    with pytest.raises(ValueError, match="in radians"):
        faces.view_rgb(0.0, angle)


# Machines -----------------------------------------------------------------------------------------


NAMELESS = """
import json, pwd, sys
def nobody(*_):
    raise KeyError("getpwuid(): uid not found")
pwd.getpwuid = pwd.getpwnam = nobody
from embodied.cli import main
for words in json.loads(sys.argv[1]):
    try:
        status = main(words)
    except SystemExit as e:
        status = e.code
    print("status", status)
"""


@pytest.mark.slow
def test_somebody_without_a_home_and_a_name_gets_help_and_tables(here, tmp_path):
    bare = {"PATH": os.environ["PATH"], "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    out = ["--data", str(here.folder), "--out", str(tmp_path / "out")]
    orders = json.dumps([["--help"], ["house", "--help"], ["export", "r2r", *out]])
    done = subprocess.run([sys.executable, "-c", NAMELESS, orders], capture_output=True, text=True, env=bare)
    assert done.stdout.count("status 0\n") == 3 and done.stdout.count("usage: embodied") == 2, done.stderr[-2000:]


def test_a_cache_that_cannot_be_written_is_named_with_what_to_do(capsys, tmp_path):
    order = ["house", "--seed", "1", "--out", str(tmp_path / "h"), "--cache", "/proc/nowhere", "--area", "38", "46"]
    assert cli.main(order) == 2 and "/proc/nowhere" in capsys.readouterr().err
    found = doctor.disk(argparse.Namespace(cache=Path("/proc/nowhere/cache")))
    assert not found.ok and found.needed and "cannot be written" in found.text and "EMBODIED_CACHE" in found.remedy
