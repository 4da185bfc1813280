"""The stand-in for MatterSim answers as the C++ simulator did, and is what programs written for it expect.

data/mattersim.json holds what the simulator's own C++ code (graph, navigation and angles; drawing left out) answered
on 250 poses: two runs of 25 states of five agents in three generated houses to which two excluded viewpoints and a
viewpoint straight above and one straight below another were added. Upstream and the fork with discretized angles.
Numbers were rounded to seven digits.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from embodied import mattersim
from embodied.mattersim.__main__ import main as launch
from embodied.mattersim.pictures import tiles_of

RECORD = json.loads((Path(__file__).parent / "data" / "mattersim.json").read_text())
SCANS = sorted(RECORD["graphs"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The connectivity files of the record."""
    folder = tmp_path_factory.mktemp("connectivity")
    for scan, graph in RECORD["graphs"].items():
        n = len(graph["ids"])
        open_ = np.zeros((n, n), bool)
        for i, j in graph["edges"]:
            open_[i, j] = open_[j, i] = True
        items = []
        for name, included, near, (x, y, z) in zip(graph["ids"], graph["included"], open_, graph["positions"]):
            pose = [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, y, 0.0, 0.0, 1.0, z, 0.0, 0.0, 0.0, 1.0]
            ways = {"visible": near.tolist(), "unobstructed": near.tolist()}
            items.append({"image_id": name, "pose": pose, "included": bool(included), "height": 1.5, **ways})
        (folder / f"{scan}_connectivity.json").write_text(json.dumps(items))
    (folder / "scans.txt").write_text("\n".join(SCANS) + "\n")
    return folder


def simulator(folder: Path, dialect: str = "upstream", *, batch: int = 1):
    sim = mattersim.module(dialect).Simulator()
    sim.setNavGraphPath(str(folder))
    sim.setRenderingEnabled(False)
    sim.setDiscretizedViewingAngles(True)
    sim.setCameraResolution(640, 480)
    sim.setCameraVFOV(math.radians(60))
    sim.setBatchSize(batch)
    return sim


@pytest.mark.parametrize("run", RECORD["runs"], ids=[r["kind"] for r in RECORD["runs"]])
def test_every_field_of_the_recorded_poses_is_as_the_simulator_gave_it(run, folder):
    sim = simulator(folder, run["kind"], batch=5)
    sim.initialize()
    sim.newEpisode(*run["start"])
    for number, wanted in enumerate(run["states"]):
        if number:
            sim.makeAction(*run["actions"][number - 1])
        for state, (scan, step, view, heading, elevation, locations) in zip(sim.getState(), wanted, strict=True):
            ids = RECORD["graphs"][SCANS[scan]]["ids"]
            assert (state.scanId, state.step, state.viewIndex) == (SCANS[scan], step, view)
            assert (state.heading, state.elevation) == pytest.approx((heading, elevation), abs=2e-7)
            assert [v.ix for v in state.navigableLocations] == [v[0] for v in locations], (
                "the same viewpoints, in order"
            )
            assert [v.viewpointId for v in state.navigableLocations] == [ids[v[0]] for v in locations]
            got = [(v.x, v.y, v.z, v.rel_heading, v.rel_elevation, v.rel_distance) for v in state.navigableLocations]
            np.testing.assert_allclose(got, [v[1:] for v in locations], atol=5e-7)
            assert (state.location.ix, state.location.rel_heading) == (locations[0][0], 0.0)


def test_states_are_alive(folder):
    sim = simulator(folder)
    sim.initialize()
    state = sim.getState()[0]
    assert state.location is None and state.navigableLocations == [] and state.rgb.shape == (480, 640, 3)
    sim.newEpisode([SCANS[0]], ["v001"], [0], [0])
    sim.makeAction([0], [1], [0])
    assert (state.step, state.viewIndex) == (1, 13) and sim.getState()[0] is state


def test_the_errors_are_those_of_the_module(folder, tmp_path):
    sim = simulator(folder)
    with pytest.raises(RuntimeError, match="newEpisode"):
        sim.makeAction([0], [0], [0])
    with pytest.raises(IndexError, match="no scan 'elsewhere'"):
        sim.newEpisode(["elsewhere"], ["v001"], [0], [0])
    with pytest.raises(ValueError, match="Could not find viewpointId"):
        sim.newEpisode([SCANS[0]], ["nowhere"], [0], [0])
    graph = RECORD["graphs"][SCANS[0]]
    shut = graph["ids"][graph["included"].index(0)]
    with pytest.raises(ValueError, match="excluded"):
        sim.newEpisode([SCANS[0]], [shut], [0], [0])
    with pytest.raises(ValueError, match="Invalid action index"):
        sim.makeAction([0], [0], [0])
    sim.newEpisode([SCANS[0]], ["v001"], [0], [0])
    with pytest.raises(ValueError, match="Invalid action index: 99"):
        sim.makeAction([99], [0], [0])
    with pytest.raises(IndexError, match="0 values for 1 agents"):
        sim.makeAction([], [], [])
    empty = simulator(tmp_path)
    with pytest.raises(ValueError, match="list of scans"):
        empty.initialize()
    (tmp_path / "scans.txt").write_text("gone\n")
    with pytest.raises(ValueError, match="gone_connectivity"):
        empty.initialize()


def test_settings_are_ignored_after_initialize_but_for_the_camera(folder):
    sim = simulator(folder, batch=2)
    sim.initialize()
    sim.setBatchSize(7)
    sim.setDiscretizedViewingAngles(False)
    sim.newEpisode([SCANS[0]] * 2, ["v001"] * 2, [0.4, 0.4], [0, 0])
    assert len(sim.getState()) == 2 and sim.getState()[0].viewIndex == 13
    seen = len(sim.getState()[0].navigableLocations)
    sim.setCameraVFOV(math.radians(180) * 3 / 4)
    sim.makeAction([0, 0], [0, 0], [0, 0])
    assert len(sim.getState()[0].navigableLocations) > seen
    sim.close()
    with pytest.raises(RuntimeError):
        sim.makeAction([0, 0], [0, 0], [0, 0])


def box(folder: Path, scan: str, viewpoint: str) -> None:
    """A skybox around a viewpoint: each side of the world in a colour of its own, two metres away."""
    colours = {0: (0, 0, 255), 1: (0, 255, 0), 2: (255, 0, 0), 3: (0, 255, 255), 4: (255, 255, 255), 5: (0, 0, 0)}
    faces = np.stack([np.full((64, 64, 3), colours[k], np.uint8) for k in range(6)])
    u = (np.arange(64) + 0.5) / 32 - 1
    ray = 2.0 * np.sqrt(1 + u[None] ** 2 + u[:, None] ** 2)
    depth = np.stack([np.rint(ray * 4000).astype(np.uint16)] * 6)
    home = folder / scan / "matterport_skybox_images"
    home.mkdir(parents=True)
    tiles = tiles_of(faces)
    cv2.imwrite(str(home / f"{viewpoint}_skybox_small.jpg"), np.concatenate(list(tiles), 1))
    cv2.imwrite(str(home / f"{viewpoint}_skybox_depth_small.png"), np.concatenate(list(tiles_of(depth)), 1))


SIDES = {0: (0, 255, 0), 3: (0, 0, 255), 6: (0, 255, 255), 9: (255, 0, 0)}
"""Heading in steps of 30 degrees to the colour that is seen there: north, east, south, west."""


def test_pictures_look_where_the_agent_looks(folder, tmp_path):
    box(tmp_path, SCANS[0], "v001")
    sim = simulator(folder, "hanna")
    sim.setRenderingEnabled(True)
    sim.setDepthEnabled(True)
    sim.setDatasetPath(str(tmp_path))
    for step, colour in SIDES.items():
        sim.newEpisode([SCANS[0]], ["v001"], [step * math.pi / 6], [0])
        state = sim.getState()[0]
        assert (
            state.rgb.shape == (480, 640, 3) and state.depth.shape == (480, 640, 1) and state.depth.dtype == np.uint16
        )
        assert np.abs(state.rgb[240, 320].astype(int) - colour).max() < 12, "blue, green, red"
        assert int(state.depth[240, 320, 0]) == pytest.approx(8000, abs=4), "two metres along the axis"
        assert int(state.depth[240, 5, 0]) == pytest.approx(8000, abs=8), "not along the ray"
    sim.makeAction([0], [0], [1])
    assert sim.getState()[0].rgb[2, 320].min() > 240, "the ceiling is on top"
    sim.newEpisode([SCANS[0]], ["v002"], [0], [0])
    with pytest.raises(ValueError, match="v002_skybox_small"):
        _ = sim.getState()[0].rgb


SCRIPT = """
import sys
sys.path.append('../../build')
import MatterSim
from beside import name
sim = MatterSim.Simulator()
sim.setNavGraphPath(sys.argv[1])
sim.setDiscretizedViewingAngles(True)
sim.setRenderingEnabled(False)
sim.newEpisode([sys.argv[2]], ['v001'], [0], [0])
sim.makeAction([0], [4], [0])
print(name, __name__, sim.getState()[0].viewIndex)
"""


@pytest.mark.slow
def test_a_script_runs_unchanged_with_the_launcher(folder, tmp_path, monkeypatch, capsys):
    (tmp_path / "train.py").write_text(SCRIPT)
    (tmp_path / "beside.py").write_text("name = 'found'\n")
    root = str(Path(mattersim.__file__).parents[2])
    words = [str(tmp_path / "train.py"), str(folder), SCANS[0]]
    command = [sys.executable, "-m", "embodied.mattersim", "hanna", *words]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
    assert done.stdout == "found __main__ 16\n"
    monkeypatch.setattr(sys, "argv", list(sys.argv))
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert launch(["upstream", *words]) == 0
    assert capsys.readouterr().out == "found __main__ 13\n"
    assert launch(["other", "x.py"]) == 2 and "expected a dialect" in capsys.readouterr().err
    for name in ("MatterSim", "beside"):
        del sys.modules[name]


def test_values_that_the_module_takes_are_taken_and_others_refused(folder):
    sim, start = simulator(folder), RECORD["graphs"][SCANS[0]]["ids"][0]
    for scans in ([SCANS[0]], (SCANS[0],), np.array([SCANS[0]])):
        sim.newEpisode(scans, [start], (0,), np.array([0.0], np.float32))
    for wrong in (([1.0], [0], [0]), (["1"], [0], [0]), ({1}, [0], [0]), ([1], [None], [0]), ([1], b"ab", [0])):
        with pytest.raises(TypeError):
            sim.makeAction(*wrong)
    with pytest.raises(ValueError, match="Invalid action index"):
        sim.makeAction([-1], [0], [0])
    assert sim.getState()[0].step == 0
    for index in ([0], (0,), range(1), np.array([0]), [np.int64(0)], [False]):
        sim.makeAction(index, [np.float32(1)], [True])
