"""Wrong input, damaged files and unable machines: one line says what to do, nothing half-written is believed."""

from __future__ import annotations

import dataclasses
import errno
import functools
import resource
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from tqdm import tqdm

from embodied import cli
from embodied.agents.learners.bandit import BanditConfig
from embodied.agents.learners.hanna import TrainingConfig
from embodied.agents.learners.hari import ExecutionConfig, IntentionConfig
from embodied.agents.vision.config import VisionConfig
from embodied.assets.materials import finish
from embodied.cli import doctor
from embodied.datasets.build import for_each_unit
from embodied.errors import UnableError
from embodied.generate import HouseConfig
from embodied.gl import GLError
from embodied.light.backend import LightError
from embodied.options import field_docs
from embodied.render.panorama import Panorama
from embodied.render.panorama_file import write_panoramas
from embodied.scene.model import load_texture


def said(capsys, *words: str) -> str:
    """The one line that a wrong command says."""
    try:
        assert cli.main(words) == 2
    except SystemExit as e:  # words that the parser refuses
        assert e.code == 2
    out, err = capsys.readouterr()
    assert not out and err.startswith("error: ") and err.count("\n") == 1, err
    return err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("house", "--area", "5", "10", "--out", "x"), "area should be"),
        (("house", "--style", "nope", "--out", "x"), "style should be one of"),
        (("assets", "list", "--class", "zebra"), "no object class 'zebra'"),
        (("render", "/nowhere"), "house.json does not exist; make one with"),
        (("evaluate", "find", "--data", "/nowhere"), "build one with `embodied dataset"),
        (("evaluate", "find", "--closed-doors", "nan"), "--closed-doors should be a share"),
        (("house", "--own", "/nowhere", "--out", "x"), "catalogue.json cannot be read"),
        (("bench", "nothing"), "unknown benchmark"),
        (("house", "--seed", "seven", "--out", "x"), "invalid int value: 'seven'; `embodied house --help` explains"),
        (("nonsense",), "invalid choice: 'nonsense'"),
        (("rollout", "--seed", "3", "--size", "0"), "--size: should be a whole number of at least 8 and at most 4096"),
        (("train", "hanna", "--data", "x", "--out", "y", "--nothing"), "`embodied --help` explains"),
        (("dataset", "find", "--out", "x", "--workers", "0"), "--workers: should be a whole number of at least 1"),
        (("dataset", "find", "--out", "x", "--own", "y"), "should hold a groups.toml and no catalogue.json"),
    ],
)
def test_wrong_words_get_one_line_with_the_remedy(words, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert message in said(capsys, *words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("note", ["[1]", "null", "{", '{"color": "x", "bytes": {}}'])
def test_a_damaged_note_of_a_material_is_made_again(note, tmp_path):
    made = finish("paint_white/0", tmp_path)
    (path,) = tmp_path.glob("materials/*/maps.json")
    before = path.read_text()
    path.write_text(note)
    finish.cache_clear()
    assert finish("paint_white/0", tmp_path) == made
    assert path.read_text() == before


def test_a_flipped_texture_is_noticed(tmp_path):
    path = tmp_path / "color.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"x" * 100)
    with pytest.raises(OSError, match="missing or damaged; delete"):
        load_texture(str(path))


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [
        (
            OSError(errno.ENOSPC, "No space left on device", "/x/y"),
            2,
            "/x/y: No space left on device: the disk is full",
        ),
        (UnableError("no light;\nuse unlit"), 2, "error: no light; use unlit"),
        (KeyboardInterrupt(), 130, "the same command goes on from there"),
    ],
)
def test_what_goes_wrong_in_a_command_is_one_line(error, status, message, capsys, monkeypatch):
    def fail(_):
        raise error

    monkeypatch.setattr(doctor, "run", functools.wraps(doctor.run)(fail))
    assert cli.main(["doctor"]) == status
    err = capsys.readouterr().err.strip()
    assert message in err and "\n" not in err


def test_an_error_stands_on_a_line_of_its_own_below_a_progress_bar(capsys, monkeypatch):
    def drawn():
        yield from tqdm(range(3), "panoramas", file=sys.stderr)

    def write(panoramas) -> None:
        for _ in panoramas:  # which the traceback keeps, and with it the bar
            raise OSError(errno.ENOSPC, "No space left on device", "/x/a.pano")

    monkeypatch.setattr(doctor, "run", functools.wraps(doctor.run)(lambda _: write(drawn())))
    assert cli.main(["doctor"]) == 2
    *_, last, end = capsys.readouterr().err.split("\n")
    assert last.startswith("error: /x/a.pano: No space left on device") and not end


@pytest.mark.slow
def test_a_killed_worker_is_one_line(capsys, monkeypatch):
    def fail(_):
        for_each_unit(signal.raise_signal, [signal.SIGKILL] * 2, (), workers=2, watch=None)

    monkeypatch.setattr(doctor, "run", functools.wraps(doctor.run)(fail))
    assert cli.main(["doctor"]) == 2
    *_, last, end = capsys.readouterr().err.split("\n")
    assert last.startswith("error: a worker process was ended from outside") and "fewer --workers" in last and not end


def test_no_space_left_in_the_middle_of_drawing_is_one_line_and_leaves_the_old_pictures(tmp_path, capsys, monkeypatch):
    path, drawn, limits = tmp_path / "panoramas.pano", [], resource.getrlimit(resource.RLIMIT_FSIZE)
    path.write_bytes(b"old")

    def faces():
        rng = np.random.default_rng(0)
        for k in range(9):
            drawn.append(k)
            rgb = rng.integers(0, 255, (6, 32, 32, 3), np.uint8)
            yield Panorama(rgb, np.ones((6, 32, 32), np.float32), np.zeros((6, 32, 32), np.int32))

    monkeypatch.setattr(doctor, "run", functools.wraps(doctor.run)(lambda _: write_panoramas(path, faces(), {})))
    try:  # as on a full disk, a write fails
        resource.setrlimit(resource.RLIMIT_FSIZE, (65536, limits[1]))
        status = cli.main(["doctor"])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    err = capsys.readouterr().err
    assert status == 2 and err.startswith(f"error: {path}: File too large") and err.count("\n") == 1
    assert 2 <= len(drawn) < 9, "it began, and stopped at once"
    assert [p.name for p in tmp_path.iterdir()] == [path.name] and path.read_bytes() == b"old"


@pytest.mark.slow
def test_an_optimiser_can_be_made_after_drawing():
    """PyTorch's CUDA build imports triton then, whose LLVM does not get on with that of Mesa's software OpenGL."""
    code = (
        "from embodied import gl; gl.info(); import torch\n"
        "torch.optim.Adam([torch.nn.Parameter(torch.zeros(1))]); print('made')"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, timeout=600)
    assert done.stdout.strip() == "made", (done.returncode, done.stderr)


def test_viewers_that_are_not_there_are_named_before_any_work(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "no viewer listens at" in said(capsys, "demo", "--connect", "rerun+http://127.0.0.1:1/proxy")
    assert "URL of a running viewer" in said(capsys, "demo", "--connect", "http://127.0.0.1:1")
    assert not list(tmp_path.iterdir())


DRAWING = [
    ("demo",),
    ("demo", "--small"),
    ("rollout",),
    ("rollout", "--pictures", "unlit"),
    ("render", "house"),
    ("dataset", "find"),
    ("dataset", "find", "--pictures", "unlit"),
]


LIGHTING = [*(w for w in DRAWING if "unlit" not in w and "render" not in w), ("light", "house")]
NO_RENDERER = "embodied.gl.info", GLError("neither EGL nor OSMesa works here")
NO_LIGHT = "embodied.light.backend.mitsuba", LightError("light needs mitsuba")


@pytest.mark.parametrize(("words", "lacks"), [*((w, NO_RENDERER) for w in DRAWING), *((w, NO_LIGHT) for w in LIGHTING)])
def test_a_machine_that_cannot_draw_or_light_is_told_before_any_work(words, lacks, capsys, tmp_path, monkeypatch):
    unable(monkeypatch, *lacks)
    late = AssertionError("work was done first")
    for function in ("generate.generate_house", "datasets.build.build_dataset", "world.open_folder"):
        unable(monkeypatch, f"embodied.{function}", late)
    (tmp_path / "house").mkdir()
    (tmp_path / "house/house.json").write_text("{}")
    places = [str(tmp_path / w) if w == "house" else w for w in words]
    if words[0] in ("demo", "dataset"):
        places += ["--out", str(tmp_path / "out")]
    assert str(lacks[1]) in said(capsys, *places, "--cache", str(tmp_path / "cache"))
    assert [p.name for p in tmp_path.iterdir()] == ["house"]


def unable(monkeypatch, function, error):
    """Calls of `function` raise `error`."""

    def fail(*_, **__):
        raise error

    monkeypatch.setattr(function, fail)


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.0, 1.0])
def test_ctrl_c_stops_with_130_and_leaves_only_whole_files(seconds, tmp_path):
    """Also while libraries are being imported, of which some swallow a KeyboardInterrupt."""
    words = ("house", "--seed", "4", "--area", "400", "600", "--no-mjcf", "--out", str(tmp_path / "h"))
    code = (
        "import sys, signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from embodied.__main__ import start\n"
        "print('go', flush=True); sys.exit(start())"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    process.stdout.readline()
    time.sleep(0.01 + seconds)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=600)
    assert process.returncode == 130 and "Traceback" not in err and "stopped" in err, err
    assert not list(tmp_path.rglob(".*"))


@pytest.mark.parametrize(
    "kind", [HouseConfig, TrainingConfig, VisionConfig, BanditConfig, ExecutionConfig, IntentionConfig]
)
def test_every_field_that_is_an_option_is_explained(kind):
    assert [f.name for f in dataclasses.fields(kind) if not field_docs(kind).get(f.name)] == []
