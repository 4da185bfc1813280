"""The line from a seed to a recording, end to end, and what the commands do with wrong input."""

from __future__ import annotations

import json
import socket
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb
import rerun_cli

from embodied import generate
from embodied.agents.vision import detector, features
from embodied.agents.vision.config import PLAIN
from embodied.assets.cache import digest
from embodied.assets.catalogue import load_catalogue
from embodied.cli import demo, main
from embodied.envs.base import HelpEnv
from embodied.evaluation.evaluate import play, rollout
from embodied.generate import HouseConfig, generate_house
from embodied.house.house import House
from embodied.interface import Pose
from embodied.kinds.metrics import spl, success
from embodied.language import People
from embodied.policies.baselines import RandomWalk, Shortest
from embodied.render.panorama import Panorama
from embodied.render.pictures import Baked
from embodied.tasks.goals import find_pool, find_task
from embodied.viz import house3d, recording
from embodied.viz.recording import PictureSizes, camera_axes, record
from embodied.viz.sinks import Sinks, blueprint_of, check_connected, listens, open_recording, sees_title
from embodied.viz.video import camera_track, write_video
from embodied.world import open_world

pytestmark = [pytest.mark.slow, pytest.mark.gl]

SMALL, README_SEED = HouseConfig(area=(38.0, 46.0)), 7
"""The flat of the README, whose furniture other tests have imported."""


@pytest.fixture(scope="module")
def world(shared_cache):
    catalogue = load_catalogue(shared_cache)
    house = generate_house(README_SEED, SMALL, catalogue)
    with open_world(house, catalogue, shared_cache, size=64) as world:
        yield world


def tasks_of(world, count):
    pool = find_pool(world, seed=1)
    return [find_task(pool, i, seed=1, language=People(tries=1)) for i in range(min(count, len(pool)))]


def test_a_seed_becomes_a_house_a_walk_and_a_recording(world, tmp_path):
    task = tasks_of(world, 1)[0]
    rrd = tmp_path / "episode.rrd"
    frames = list(rollout(lambda: HelpEnv({world.name: world}), Shortest(), [task], seed=0))
    with open_recording(
        Sinks(rrd), blueprint_of(world.house, frames[-1].episode), name="test", properties={"renderer": "any"}
    ) as recording:
        passed_on = list(record(recording, world, task, (f.step for f in frames), pictures=PictureSizes((48, 64), 32)))
    assert [s.pose for s in passed_on] == [f.step.pose for f in frames]
    assert success(frames[-1].episode, world.graph) == 1.0
    assert 10_000 < rrd.stat().st_size < 60 * 2**20


def test_the_expert_finds_everything_and_a_random_walker_little(world):
    tasks = tasks_of(world, 40)
    make = lambda: HelpEnv({world.name: world})
    expert = play(make, Shortest(), tasks, seed=0)
    lost = play(make, RandomWalk(), tasks, seed=0)
    assert all(success(e, world.graph) == 1.0 and spl(e, world.graph) == pytest.approx(1.0) for e in expert)
    assert np.mean([success(e, world.graph) for e in lost]) < 0.6


def jpeg(image: rr.EncodedImage) -> str:
    """Digest of a logged picture's bytes."""
    return digest(bytes(image.blob.as_arrow_array().to_pylist()[0]))


def test_the_demo_records_two_walks_and_its_agent_sees_the_panoramas_that_are_shown(
    world, shared_cache, tmp_path, monkeypatch, capsys
):
    """`embodied demo` in a small flat without light; the trained agent's recording shows what its features come from,
    the world's own pictures, and what it recognises in each."""
    fed: list[Panorama] = []
    poses: list[Pose] = []
    recognised: list[int] = []
    logged: dict[str, list[str]] = {"agent/camera/image": []}
    strip_of, log_sight, log = features.strip_of, recording.log_sight, rr.RecordingStream.log

    def watched_log(stream, path, *parts, **more):
        if path in logged:
            logged[path].append(jpeg(parts[-1]))
        if path == "view/panorama/recognised":
            recognised.append(len(parts[0].positions.as_arrow_array()))
        log(stream, path, *parts, **more)

    monkeypatch.setattr(detector, "strip_of", strip_of)
    monkeypatch.setattr(features, "strip_of", lambda p: (fed.append(p), strip_of(p))[1])
    monkeypatch.setattr(recording, "log_sight", lambda r, v, pose: (poses.append(pose), log_sight(r, v, pose))[1])
    monkeypatch.setattr(rr.RecordingStream, "log", watched_log)
    find, found = demo.find_something, []
    monkeypatch.setattr(generate, "generate_house", lambda seed, catalogue: world.house)
    monkeypatch.setattr(house3d, "BUDGET", 10**9)  # simpler meshes are looked at above

    def kept(args, world):
        facts = find(args, world)
        fed.clear(), poses.clear()
        logged.update({path: [] for path in logged})
        found.extend(world.panorama(n).rgb for n in range(len(world.graph.ids)))
        return facts

    monkeypatch.setattr(demo, "find_something", kept)
    words = ("demo", "--seed", README_SEED, "--pictures", "unlit", "--size", 48, "--json", "--cache", shared_cache)
    assert main([*map(str, words), "--out", str(tmp_path)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["walk"]["success"] and told["walk"]["spl"] == 1.0
    assert {p.name for p in tmp_path.iterdir()} >= {"house.json", "plan.png", "episode.rrd", "help.rrd"}
    assert all(10_000 < (tmp_path / f"{k}.rrd").stat().st_size < 60 * 2**20 for k in ("episode", "help"))
    agent = [jpeg(recording.ahead(fed[p.node], p, PictureSizes())) for p in poses]
    assert len(fed) == len(found) and len(poses) == told["help"]["steps"] + 1
    assert all(np.array_equal(p.rgb, rgb) for p, rgb in zip(fed, found, strict=True))
    assert logged == {"agent/camera/image": agent}
    assert len(recognised) == len(poses) and sum(recognised) > len(poses)


def test_the_picture_says_how_it_was_drawn_or_that_nobody_looks_at_it():
    assert sees_title(PLAIN) == "What the agent sees: without light"
    assert sees_title(Baked("normal")) == "What the agent sees: lit"
    assert "looks at no pictures" in sees_title(None)


def test_a_broken_recording_leaves_no_file(world, tmp_path):
    rrd = tmp_path / "episode.rrd"
    with (
        pytest.raises(RuntimeError, match="stopped half-way"),
        open_recording(Sinks(rrd), rrb.Blueprint(), name="test", properties={}),
    ):
        raise RuntimeError("stopped half-way")
    assert not list(tmp_path.iterdir())


def test_what_is_sent_to_a_viewer_arrives(world, tmp_path):
    task, saved = tasks_of(world, 1)[0], tmp_path / "received.rrd"
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    viewer = subprocess.Popen(
        [str(Path(rerun_cli.__file__).with_name("rerun")), "--save", str(saved), "--port", str(port)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        until = time.monotonic() + 300
        while not listens("127.0.0.1", port) and time.monotonic() < until:
            time.sleep(0.1)
        viewer_url = f"rerun+http://127.0.0.1:{port}/proxy"
        check_connected(viewer_url)
        steps = [f.step for f in rollout(lambda: HelpEnv({world.name: world}), Shortest(), [task], seed=0)]
        for _ in range(2):  # a second recording follows the first into the same viewer
            with open_recording(Sinks(None, viewer_url), rrb.Blueprint(), name="sent", properties={}) as recording:
                list(record(recording, world, task, steps, pictures=PictureSizes((48, 64), 32)))

        def held() -> int:
            return saved.read_bytes().count(b"RecordingInfo:name") if saved.exists() else 0

        while held() < 2 and time.monotonic() < until:
            time.sleep(0.1)
        assert held() >= 2 and b"/agent/camera" in saved.read_bytes()
    finally:
        viewer.kill()
        viewer.wait()


def test_the_film_starts_and_ends_where_the_walk_does_and_never_jumps(world, tmp_path):
    task = tasks_of(world, 1)[0]
    episode = play(lambda: HelpEnv({world.name: world}), Shortest(), [task], seed=0)[0]
    poses = [task.start, *(s.next_pose for s in episode.steps)]
    track = np.concatenate(camera_track(world.graph.positions, poses))
    assert track[0, :3] == pytest.approx(world.graph.positions[poses[0].node])
    assert track[-1, :3] == pytest.approx(world.graph.positions[poses[-1].node])
    assert np.linalg.norm(np.diff(track[:, :3], axis=0), axis=1).max() < 0.1
    frames = (np.full((48, 64, 3), i, np.uint8) for i in range(10))
    assert write_video(tmp_path / "film.mp4", frames, (48, 64)) == 10
    with pytest.raises(ValueError, match="even height and width"):
        write_video(tmp_path / "odd.mp4", iter(()), (47, 64))


def test_the_camera_in_the_recording_looks_where_the_agent_looks():
    axes = camera_axes(np.pi / 2, 0.0)
    assert axes[:, 2] == pytest.approx([0, 1, 0])  # forward
    assert axes[:, 0] == pytest.approx([1, 0, 0])  # right
    assert axes[:, 1] == pytest.approx([0, 0, -1])  # down
    assert np.linalg.det(camera_axes(0.7, 0.3)) == pytest.approx(1.0)


def test_house_command_writes_what_it_says(shared_cache, tmp_path, capsys):
    out = tmp_path / "house"
    assert main(f"house --seed 2 --area 38 46 --no-mjcf --json --out {out} --cache {shared_cache}".split()) == 0
    facts = json.loads(capsys.readouterr().out)
    house = House.load(out / "house.json")
    assert house.digest == facts["digest"] and facts["objects"] == len(house.placements)
    assert {p.name for p in out.iterdir()} >= {"house.json", "connectivity.json", "plan.png"}


def test_doctor_knows_the_renderer_and_the_furniture(shared_cache, capsys):
    assert main(["doctor", "--json", "--cache", str(shared_cache)]) == 0
    findings = {f["name"]: f for f in json.loads(capsys.readouterr().out)["findings"]}
    assert findings["renderer"]["ok"] and findings["furniture"]["ok"] and "mujoco" in findings["versions"]["text"]


def test_doctor_tells_the_remedy_when_the_furniture_is_missing(shared_cache, monkeypatch, capsys):
    monkeypatch.setattr("embodied.assets.importing.sh3f._installed", tuple)
    main(["doctor", "--cache", str(shared_cache)])
    assert "no furniture library found" in (said := capsys.readouterr().out) and "doctor --fix" in said
