"""Training data of continuous walks: each form says at every frame what the expert does there."""

from __future__ import annotations

import json
import math

import av
import numpy as np
import pyarrow.parquet as pq
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, furnished
from PIL import Image

from embodied.datasets.vlnce import FORMATS, export_walks, frames, noisy_actions, pixel_goal, pose_of, teach
from embodied.envs.continuous import CameraConfig, ContinuousEnv, ContinuousEpisode, HabitatAction, NavigationGoal
from embodied.world import open_world

pytestmark = pytest.mark.gl
SMALL = CameraConfig(32, 48, 79.0)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    with open_world(furnished(two_rooms()), HandCatalogue(), tmp_path_factory.mktemp("walks"), size=32) as w:
        yield w


def episode(world) -> ContinuousEpisode:
    path = ((3.0, 3.0, 0.0), (4.0, 1.8, 0.0), (5.5, 1.1, 0.0))
    return ContinuousEpisode(
        "7", world.name, path[0], 0.2, "go to the bedroom", (NavigationGoal(path[-1]),), reference=path
    )


@pytest.fixture(scope="module")
def folders(world, tmp_path_factory):
    home = tmp_path_factory.mktemp("forms")
    for form in FORMATS:
        export_walks(form, home / form, [episode(world)], {world.name: world}, seed=0, camera=SMALL, depth=True)
    return home


@pytest.fixture(scope="module")
def taught(world):
    return teach(ContinuousEnv(), episode(world), world)


def test_samples_lead_whoever_takes_their_actions_to_the_goal(folders, world, taught):
    lines = [json.loads(line) for line in (folders / "vlnce" / "samples.jsonl").read_text().splitlines()]
    env = ContinuousEnv()
    env.reset(episode(world), world)
    for line in lines:
        assert Image.open(folders / "vlnce" / line["image"]).size == (48, 32)
        env.step(line["action"])
    assert env.ended and env.distance < 0.3 and lines[-1]["action"] == HabitatAction.STOP
    assert (folders / "vlnce/train/train_gt.json.gz").exists()


def test_streamvln_reads_the_experts_actions_one_frame_later(folders, taught):
    (row,) = json.loads((folders / "streamvln" / "annotations.json").read_text())
    assert [*row["actions"][1:], 0] == list(taught.labels) and row["actions"][0] == -1
    frames = sorted((folders / "streamvln" / row["video"] / "rgb").iterdir())
    assert len(frames) == len(row["actions"]) and frames[0].name == "000.jpg"


def test_uninavid_is_asked_for_the_next_four_actions_after_a_video_of_what_was_seen(folders, taught):
    rows = json.loads((folders / "uninavid" / "conversations.json").read_text())
    answers = [w for r in rows for w in r["conversations"][1]["value"].split()]
    assert answers == [{0: "stop", 1: "forward", 2: "left", 3: "right"}[a] for a in taught.labels]
    for k, row in enumerate(rows):
        assert "NAV_ID" in row["id"] and row["conversations"][0]["value"].count("<image>") == 1
        with av.open(str(folders / "uninavid" / row["video"])) as video:
            assert sum(1 for _ in video.decode(video=0)) == 4 * k + 1


def test_interndata_has_poses_that_step_a_quarter_of_a_metre_and_pixel_goals_on_the_way(folders, world, taught):
    home = folders / "internnav" / world.name
    rows = pq.read_table(home / "data/chunk-000/episode_000000.parquet").to_pydict()
    info = json.loads((home / "meta/info.json").read_text())
    assert info["codebase_version"] == "v2.1" and info["total_frames"] == len(taught.labels) == len(rows["action"])
    assert set(rows) <= set(info["features"]) and rows["action"] == [-1, *taught.labels[:-1]]
    poses = np.array(rows["pose.125cm_30deg"])
    ahead = poses[:-1, :3, 2] @ [0, 0, 1]
    assert np.allclose(ahead, -0.5, atol=1e-6) and np.allclose(np.linalg.det(poses[:, :3, :3]), 1)
    moved = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    assert np.allclose(moved[np.array(rows["action"][1:]) == 1], 0.25, atol=1e-5)
    goals = [
        (k, g, f)
        for k, (g, f) in enumerate(zip(rows["goal.125cm_30deg"], rows["relative_goal_frame_id.125cm_30deg"]))
        if f > 0
    ]
    assert goals, "looking down, the floor of the way is seen"
    focal = 24 / math.tan(math.radians(79) / 2)
    for k, (u, v), f in goals:
        depth = np.array(
            Image.open(home / f"videos/chunk-000/observation.images.depth.125cm_30deg/episode_000000_{k}.png")
        )
        z = depth[v, u] / 1000
        seen = poses[k, :3, :3] @ [(u + 0.5 - 24) * z / focal, (v + 0.5 - 16) * z / focal, z] + poses[k, :3, 3]
        assert np.linalg.norm(seen[:2] - poses[k + f, :2, 3]) < 0.6, "the pixel shows the floor where the body will be"


def test_lerobots_form_has_the_experts_action_the_way_so_far_and_depth_of_12_bits(folders, world, taught):
    home = folders / "lerobot-vlnce"
    rows = pq.read_table(home / "data/chunk-000/file-000.parquet").to_pydict()
    assert np.argmax(rows["action"], axis=1).tolist() == list(taught.labels)
    assert rows["observation.state"][0] == pytest.approx([0, 0, 0, 1, 0], abs=1e-6)
    info = json.loads((home / "meta/info.json").read_text())
    assert info["features"]["observation.images.depth"]["info"]["is_depth_map"] is True
    with av.open(str(home / "videos/observation.images.depth/chunk-000/file-000.mp4")) as video:
        planes = [f.to_ndarray() for f in video.decode(video=0)]
    for codes, (_, depth) in zip(planes, frames(taught, SMALL), strict=True):
        metres = np.exp(codes / 4095 * math.log(13.5 / 3.51)) * 3.51 - 3.5
        assert np.abs(metres - np.clip(depth, 0.01, 10)).max() < 3e-3


def test_labels_of_a_walk_with_action_noise_lead_back(world):
    rng = np.random.default_rng(0)
    noisy = teach(ContinuousEnv(), episode(world), world, noisy_actions(0.5, rng))
    assert sum(a != b for a, b in zip(noisy.trajectory.actions, noisy.labels, strict=True)) > 3
    assert noisy.labels[-1] == HabitatAction.STOP and noisy.trajectory.distances[-1] < 0.4


def test_what_stands_before_a_goal_hides_it(taught):
    k, camera = taught.labels.index(HabitatAction.FORWARD), CameraConfig(48, 64, 79.0)
    pose = pose_of(taught, k, 30)
    assert pixel_goal(taught, k, pose, np.full((48, 64), np.inf), camera)[1] > 0
    assert pixel_goal(taught, k, pose, np.full((48, 64), 0.2), camera) == ((-1, -1), -1)


def test_a_folder_with_files_and_wandering_poses_are_refused(world, tmp_path):
    (tmp_path / "note").write_text("mine")
    with pytest.raises(ValueError, match="not empty"):
        export_walks("streamvln", tmp_path, [episode(world)], {world.name: world}, seed=0)
    with pytest.raises(ValueError, match="poses"):
        export_walks("internnav", tmp_path / "x", [episode(world)], {world.name: world}, seed=0, action_noise=0.1)
