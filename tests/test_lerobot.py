"""Episodes as a LeRobot data set: read back table by table, frame by frame, and by LeRobot where it is installed."""

from __future__ import annotations

import json
import math

import av
import numpy as np
import pyarrow.parquet as pq
import pytest
from hand_data import build, paint

from embodied.cli import main
from embodied.datasets.checks import DatasetError
from embodied.datasets.lerobot import ACTION, CAMERA, DEPTH, FPS, MOST_CANDIDATES, RECORDED_VFOV, STATE, export_lerobot
from embodied.evaluation.evaluate import play
from embodied.kinds.metrics import success
from embodied.policies.baselines import PrivilegedAsking, Shortest, ask_every_5
from embodied.records import save_lines
from embodied.render.panorama_file import PanoramaFile
from embodied.render.pictures import Baked

pytestmark = pytest.mark.slow

SMALL = (32, 48)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lerobot")
    data = build(folder / "data", folder / "cache", "hanna", size="1x4")
    paint(data, Baked("fast", size=16), ["train_0000"])
    return data


@pytest.fixture(scope="module")
def episodes(data):
    """Three that hear other words on their way."""
    whole = data.split("train")
    return play(whole.make_env, PrivilegedAsking(Shortest(), ask_every_5), whole.tasks[:3], seed=0)


@pytest.fixture(scope="module")
def folder(data, episodes, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out") / "walks"
    steps = export_lerobot(data, folder, episodes, succeeded=lambda e: won(data, e), size=SMALL, depth=True)
    assert steps == sum(len(e.steps) for e in episodes)
    return folder


def seen(file, pose, size) -> np.ndarray:
    return file.read(pose.node).view_rgb(pose.yaw, pose.pitch, RECORDED_VFOV, size)


def seen_depth(file, pose, size) -> np.ndarray:
    return file.read(pose.node).view(pose.yaw, pose.pitch, RECORDED_VFOV, size)[1]


def won(data, episode) -> bool:
    return success(episode, data.place(episode.task.world).graph) > 0


def rows(folder) -> dict[str, list]:
    return pq.read_table(folder / "data" / "chunk-000" / "file-000.parquet").to_pydict()


def frames(folder) -> list[np.ndarray]:
    with av.open(str(folder / "videos" / CAMERA / "chunk-000" / "file-000.mp4")) as video:
        return [f.to_ndarray(format="rgb24") for f in video.decode(video=0)]


def test_every_step_is_a_row_with_its_pose_its_action_and_the_words_of_the_moment(folder, data, episodes):
    table, steps = rows(folder), [s for e in episodes for s in e.steps]
    heard = pq.read_table(folder / "meta" / "tasks.parquet").to_pydict()
    words = dict(zip(heard["task_index"], heard["task"]))
    assert [words[k] for k in table["task_index"]] == [s.instruction for s in steps]
    assert len(set(table["task_index"])) > 3, "an assistant spoke"
    said = [[event["content"] for event in events] for events in table["language_events"]]
    assert said == [[s.reply.text] if s.reply and s.reply.text else [] for s in steps] and any(said)
    assert {(e["role"], e["style"]) for events in table["language_events"] for e in events} == {
        ("assistant", "interjection")
    }
    graph = data.place("train_0000").graph
    assert np.allclose(np.array(table["observation.state"])[:, :3], [graph.positions[s.pose.node] for s in steps])
    acts, asked = np.array(table["action"]), [ACTION.index("ask"), ACTION.index("stop")]
    kinds = [type(s.action).__name__ for s in steps]
    assert [("Ask", "Stop")[int(a[1])] if a.any() else "Move" for a in acts[:, asked]] == kinds
    where = np.array(table["candidates"]).reshape(len(steps), MOST_CANDIDATES, 3)
    for k, step in enumerate(steps):
        there = graph.positions[list(step.candidate_nodes)] - graph.positions[step.pose.node]
        n, chosen = len(there), table["candidate"][k]
        assert np.allclose(np.linalg.norm(where[k, :n], axis=1), np.linalg.norm(there, axis=1)), "metres"
        assert not where[k, n:].any() and (chosen == -1) == (kinds[k] != "Move")
        if chosen >= 0:
            assert step.candidate_nodes[chosen] == step.next_pose.node
            assert np.allclose(where[k, chosen], acts[k, :3], atol=1e-5), "in the agent's own frame"
    ends = np.cumsum([len(e.steps) for e in episodes]) - 1
    assert np.flatnonzero(table["next.done"]).tolist() == ends.tolist()
    assert [table["next.success"][k] for k in ends] == [won(data, e) for e in episodes]
    assert table["index"] == list(range(len(steps)))


def test_walking_by_the_actions_ends_where_the_agent_was(folder, episodes):
    """Each action, applied to its state in the agent's frame, gives the next state."""
    table = rows(folder)
    states, acts = np.array(table["observation.state"]), np.array(table["action"])
    forward, left = acts[:, 0], acts[:, 1]
    yaw = states[:, STATE.index("yaw")]
    x = states[:, 0] + forward * np.cos(yaw) - left * np.sin(yaw)
    y = states[:, 1] + forward * np.sin(yaw) + left * np.cos(yaw)
    within = ~np.array(table["next.done"])[:-1]
    assert np.allclose(np.stack([x, y], 1)[:-1][within], states[1:, :2][within], atol=1e-4)
    turned = np.exp(1j * (yaw + acts[:, ACTION.index("turn")]))[:-1]
    assert np.allclose(turned[within], np.exp(1j * yaw[1:])[within], atol=1e-4)
    assert np.abs(acts[:, ACTION.index("turn")]).max() <= math.pi + 1e-6


def test_the_videos_frames_are_what_the_agent_saw(folder, data, episodes):
    shown, steps = frames(folder), [s for e in episodes for s in e.steps]
    assert len(shown) == len(steps) and shown[0].shape == (32, 48, 3)
    with PanoramaFile(data.folder / "houses" / "train_0000" / "panoramas.pano") as file:
        for frame, step in zip(shown, steps):
            assert np.abs(frame.astype(int) - seen(file, step.pose, SMALL)).mean() < 6
    table = pq.read_table(folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pydict()
    assert table["length"] == [len(e.steps) for e in episodes]
    assert [t * FPS for t in table[f"videos/{CAMERA}/from_timestamp"]] == table["dataset_from_index"]
    assert table["embodied/task"] == [e.task.id for e in episodes]


def test_statistics_are_those_of_the_rows_and_of_the_pixels(folder, data, episodes):
    found, table = json.loads((folder / "meta" / "stats.json").read_text()), rows(folder)
    states = np.array(table["observation.state"], np.float64)
    assert np.allclose(found["observation.state"]["mean"], states.mean(0))
    assert np.allclose(found["observation.state"]["q90"], np.quantile(states, 0.9, axis=0))
    assert found["observation.state"]["count"] == [len(states)] == found[CAMERA]["count"]
    with PanoramaFile(data.folder / "houses" / "train_0000" / "panoramas.pano") as file:
        pixels = np.stack([seen(file, s.pose, SMALL) for e in episodes for s in e.steps]).reshape(-1, 3) / 255
    for name, f in {"mean": np.mean, "std": np.std, "min": np.min, "max": np.max}.items():
        assert np.allclose(np.array(found[CAMERA][name]), f(pixels, axis=0).reshape(3, 1, 1)), name
    exact = np.quantile(pixels, 0.1, axis=0, method="inverted_cdf")
    assert np.allclose(np.array(found[CAMERA]["q10"]).ravel(), exact)


def test_the_command_exports_what_an_expert_or_a_file_of_episodes_did(data, episodes, tmp_path, capsys):
    assert main(["export", "lerobot", "--data", str(data.folder), "--out", str(tmp_path / "a"), "--tasks", "2"]) == 0
    assert "2 episodes" in capsys.readouterr().out
    assert rows(tmp_path / "a")["next.success"].count(True) == 2, "an expert"
    save_lines(tmp_path / "e.jsonl", episodes[:1])
    words = ["--episodes", str(tmp_path / "e.jsonl"), "--size", "32"]
    assert main(["export", "lerobot", "--data", str(data.folder), "--out", str(tmp_path / "b"), *words]) == 0
    assert len(rows(tmp_path / "b")["index"]) == len(episodes[0].steps)


def test_what_cannot_be_exported_is_said_and_leaves_nothing(data, episodes, tmp_path):
    judged = {"succeeded": lambda e: True, "size": SMALL}
    with pytest.raises(ValueError, match="no episodes"):
        export_lerobot(data, tmp_path / "none", [], **judged)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letter").touch()
    with pytest.raises(ValueError, match="not empty"):
        export_lerobot(data, tmp_path / "full", episodes, **judged)
    blind = play(data.split("test_unseen").make_env, Shortest(), data.tasks("test_unseen")[:1], seed=0)
    with pytest.raises(DatasetError, match=r"no pictures of 'test_0000'; draw them"):
        export_lerobot(data, tmp_path / "blind", blind, **judged)
    with pytest.raises(ValueError, match="even sides"):
        export_lerobot(data, tmp_path / "odd", episodes, **{**judged, "size": (33, 48)})
    assert sorted(p.name for p in tmp_path.iterdir()) == ["full"]


def test_lerobots_own_reader_reads_it(folder, data, episodes):
    """Where it is installed: LeRobot 0.6.1, frames decoded by its PyAV backend, batches by a loader of PyTorch."""
    reader = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    from lerobot.utils.collate import lerobot_collate_fn
    from torch.utils.data import DataLoader

    read = reader.LeRobotDataset("embodied/walks", root=folder, video_backend="pyav")
    steps, table = [s for e in episodes for s in e.steps], rows(folder)
    assert (len(read), read.num_episodes, read.fps) == (len(steps), 3, FPS)
    shown = frames(folder)
    with PanoramaFile(data.folder / "houses" / "train_0000" / "panoramas.pano") as file:
        for k in (0, len(steps) // 2, len(steps) - 1):
            item = read[k]
            assert item["task"] == steps[k].instruction
            spoken = [event["content"] for event in item.get("language_events", ())]
            assert spoken == ([steps[k].reply.text] if steps[k].reply and steps[k].reply.text else [])
            picture = item[CAMERA].permute(1, 2, 0).numpy() * 255
            assert np.abs(picture - shown[k]).mean() < 3
            millimetres = 1000 * np.clip(seen_depth(file, steps[k].pose, SMALL), 0.01, 10)
            assert np.allclose(item[DEPTH].numpy().squeeze(), millimetres, rtol=2e-3, atol=2)
    loader = DataLoader(read, batch_size=4, collate_fn=lerobot_collate_fn)
    batches = list(loader)
    for name in ("observation.state", "action", "candidates", "candidate", "next.done", "next.success"):
        loaded = np.concatenate([b[name].numpy().reshape(len(b["index"]), -1) for b in batches])
        assert np.allclose(loaded, np.array(table[name], float).reshape(len(steps), -1)), name
    assert [text for b in batches for text in b["task"]] == [s.instruction for s in steps]
