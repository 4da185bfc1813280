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

from embodied.datasets.vlnce import FORMATS, export_walks, frames, noisy_actions, teach
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


def test_a_folder_with_files_is_refused(world, tmp_path):
    (tmp_path / "note").write_text("mine")
    with pytest.raises(ValueError, match="not empty"):
        export_walks("vlnce", tmp_path, [episode(world)], {world.name: world}, seed=0)
