"""Continuous walks as training data: image, action and instruction at every step, in the forms that models train on.

  vlnce        samples.jsonl with a line per step, images/, and the episodes in Habitat's files
  streamvln    annotations.json with the actions of each walk, images/<walk>/rgb/000.jpg
  uninavid     conversations that ask for the next four actions, with a video of what was seen until then
  lerobot-vlnce    LeRobot v3.0, for policies that `lerobot-eval` judges in embodied.gym.lerobot
  internnav    InternData-N1's vln_ce: a LeRobot v2.1 folder per house, cameras level and 30 degrees down, pixel goals

A walk may leave the expert's way: what is written as the action is always what the expert does there (DAgger).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from PIL import Image

from embodied.assets.cache import write_json
from embodied.datasets.folders import write_lines
from embodied.datasets.habitat import with_experts, write_vlnce
from embodied.datasets.lerobot import STEP_COLUMNS, Columns, RecordedCamera, Writer, whole_folder
from embodied.envs.continuous import (
    POSITION,
    Body,
    CameraConfig,
    ContinuousEnv,
    ContinuousEpisode,
    HabitatAction,
    NavMeshCache,
    ShortestPathFollower,
    Trajectory,
    odometry,
)
from embodied.locks import LOCK
from embodied.render.camera import camera_at
from embodied.seeds import stream
from embodied.world import World

FORMATS = ("vlnce", "streamvln", "uninavid", "internnav", "lerobot-vlnce")
WORDS = {
    HabitatAction.STOP: "stop",
    HabitatAction.FORWARD: "forward",
    HabitatAction.LEFT: "left",
    HabitatAction.RIGHT: "right",
}
"""Actions in Uni-NaVid's answers."""
PROMPT = (
    "Imagine you are a robot programmed for navigation tasks. You have been given a video of historical observations "
    "and an image of the current observation <image>. Your assigned task is: '{}'. Analyze this series of images to "
    "determine your next four actions. The predicted action should be one of the following: forward, left, right, or "
    "stop."
)
"""Uni-NaVid's question: its model is trained on these very words."""
AHEAD = 4
"""Actions of an answer, and steps between two questions of a walk."""
PITCHES = (0, 30)
"""Degrees that InternData-N1's cameras look down."""
HIDDEN = 0.15
"""A pixel goal is seen where nothing is nearer than it by more than this, metres."""
NO_GOAL = (-1, -1)
VLNCE, CAMERA_VLNCE = Body(), CameraConfig(480, 640, 79.0)
STEPS = 4
"""Steps a second of LeRobot's data."""
CARD = """$COUNT$ of continuous walks in generated, lit houses, written by `embodied export lerobot-vlnce`.

`observation.image` is what is seen before an action, `observation.state` the way since the start, `action` scores stop,
forward, left, right: 1 for what an expert does there. `lerobot-eval` judges policies in embodied.gym.lerobot.
"""
FPS = 10
"""Frames a second of videos."""

Chosen = Callable[[int], int]
"""From what the expert does to what is done."""


@dataclass(frozen=True, eq=False)
class Taught:
    """A walk and what the expert would have done before each of its actions."""

    trajectory: Trajectory
    labels: tuple[int, ...]
    world: World
    body: Body

    @property
    def key(self) -> str:
        """A name for files."""
        return f"{self.trajectory.episode.world}_{self.trajectory.episode.id}"


def noisy_actions(share: float, rng: np.random.Generator) -> Chosen:
    """The expert plays, but this share of its steps and turns is drawn among steps and turns instead."""

    def chosen(label: int) -> int:
        return int(rng.integers(1, 4)) if label != HabitatAction.STOP and rng.random() < share else label

    return chosen


def teach(env: ContinuousEnv, episode: ContinuousEpisode, world: World, chosen: Chosen = lambda label: label) -> Taught:
    """Play an episode, as the expert does unless told otherwise, and write down what the expert does at each of its
    states (Ross et al. 2011)."""
    env.reset(episode, world)
    expert, labels = ShortestPathFollower(env, along=bool(episode.reference)), []
    while not env.ended:
        labels.append(expert.action())
        env.step(chosen(labels[-1]))
    return Taught(env.trajectory(), tuple(labels), world, env.body)


def frames(taught: Taught, camera: CameraConfig, down: int = 0) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """(h, w, 3) uint8 and (h, w) float32 metres along the optical axis, before each action, `down` degrees down."""
    trajectory, size = taught.trajectory, (camera.height, camera.width)
    for (x, y, z), yaw in zip(trajectory.positions[:-1], trajectory.yaws[:-1], strict=True):
        eye = (x, y, z + taught.body.eye)
        view = taught.world.renderer.through(camera_at(eye, yaw, -math.radians(down), camera.vfov), size)
        yield view.rgb, view.depth


def export_walks(
    form: str,
    folder: Path,
    episodes: Iterable[ContinuousEpisode],
    worlds: dict[str, World],
    *,
    seed: int,
    body: Body = VLNCE,
    camera: CameraConfig = CAMERA_VLNCE,
    action_noise: float = 0.0,
    split: str = "train",
    depth: bool = False,
    watch: Callable[[Iterable[ContinuousEpisode]], Iterable[ContinuousEpisode]] = iter,
) -> int:
    """Play episodes and write them in one of FORMATS; returns how many steps there are.

    Args:
      folder: new or empty.
      action_noise: the share of actions, below 1, that are drawn instead of the expert's; what is written stays his.
      depth: whether 'lerobot-vlnce' has videos of depth; policies that want colours alone cannot read them.
      watch: goes through the episodes, as a progress bar does.

    Raises:
      ValueError: an unknown form, a folder with files, no episodes, or noise where poses are what is learned from.
    """
    if form not in FORMATS:
        raise ValueError(f"unknown form {form!r}; use one of {FORMATS}")
    if not 0 <= action_noise < 1:
        raise ValueError(f"action_noise is a share from 0 to below 1, got {action_noise}")
    if form == "internnav" and action_noise:
        raise ValueError(
            "InternData-N1 learns from the poses of a walk, which should be the expert's; leave action_noise 0"
        )
    folder, chosen_episodes = Path(folder), list(episodes)
    if folder.exists() and any(p.name != LOCK for p in folder.iterdir()):
        raise ValueError(f"{folder} is not empty; choose another folder")
    if not chosen_episodes:
        raise ValueError("there are no episodes to play; choose another split")
    env = ContinuousEnv(body, NavMeshCache())
    chosen = noisy_actions(action_noise, stream(seed, "wander"))
    taught = (teach(env, e, worlds[e.world], chosen) for e in watch(chosen_episodes))
    if form == "vlnce":
        write_vlnce(folder, split, with_experts(chosen_episodes, worlds, ContinuousEnv(body, NavMeshCache())))
    if form == "lerobot-vlnce":
        with whole_folder(folder) as draft:
            return _lerobot(draft, taught, camera, depth)
    writers = {"vlnce": _samples, "streamvln": _streamvln, "uninavid": _uninavid, "internnav": _internnav}
    return writers[form](folder, taught, camera)


def _samples(folder: Path, walks: Iterable[Taught], camera: CameraConfig) -> int:
    lines: list[str] = []
    for t in walks:
        for k, (rgb, _) in enumerate(frames(t, camera)):
            image = f"images/{t.key}/{k:03d}.jpg"
            _jpeg(folder / image, rgb)
            facts = {"episode": t.trajectory.episode.id, "world": t.trajectory.episode.world, "step": k, "image": image}
            facts |= {
                "instruction": t.trajectory.episode.instruction,
                "taken": t.trajectory.actions[k],
                "action": t.labels[k],
            }
            lines.append(json.dumps(facts))
    write_lines(folder / "samples.jsonl", lines)
    return len(lines)


def _streamvln(folder: Path, walks: Iterable[Taught], camera: CameraConfig) -> int:
    """The action at a frame is the one that led there, -1 at first: the program shifts them by one and adds STOP."""
    rows, steps = [], 0
    for number, t in enumerate(walks):
        video = f"images/{t.key}"
        for k, (rgb, _) in enumerate(frames(t, camera)):
            _jpeg(folder / video / "rgb" / f"{k:03d}.jpg", rgb)
        rows.append(
            {
                "id": number,
                "video": video,
                "instructions": [t.trajectory.episode.instruction],
                "actions": [-1, *t.labels[:-1]],
            }
        )
        steps += len(t.labels)
    write_json(folder / "annotations.json", rows)
    return steps


def _uninavid(folder: Path, walks: Iterable[Taught], camera: CameraConfig) -> int:
    rows, steps = [], 0
    for number, t in enumerate(walks):
        seen = [rgb for rgb, _ in frames(t, camera)]
        for k in range(0, len(t.labels), AHEAD):
            video = f"nav_videos/{number}_{k:03d}.mp4"
            write_film(folder / video, seen[: k + 1], FPS)
            answer = " ".join(WORDS[HabitatAction(a)] for a in t.labels[k : k + AHEAD])
            talk = [
                {"from": "human", "value": PROMPT.format(t.trajectory.episode.instruction)},
                {"from": "gpt", "value": answer},
            ]
            rows.append({"id": f"NAV_ID_VLN_{number}_{k:03d}", "video": video, "conversations": talk})
        steps += len(t.labels)
    write_json(folder / "conversations.json", rows)
    return steps


SCORES = ("stop", "forward", "left", "right")
"""action: 1 for what the expert does, 0 for the others."""
LEROBOT: Columns = {
    **STEP_COLUMNS,
    "observation.state": (pa.list_(pa.float32(), len(POSITION)), POSITION),
    "action": (pa.list_(pa.float32(), len(SCORES)), SCORES),
}


def _lerobot(folder: Path, walks: Iterable[Taught], camera: CameraConfig, with_depth: bool) -> int:
    writer = Writer(
        folder,
        RecordedCamera(camera.height, camera.width, camera.vfov),
        LEROBOT,
        key="observation.image",
        fps=STEPS,
        depth=with_depth,
    )
    for t in walks:
        trajectory, n = t.trajectory, len(t.labels)
        poses = zip(trajectory.positions[:-1], trajectory.yaws[:-1], trajectory.pitches[:-1], strict=True)
        rows = {
            "observation.state": np.stack(
                [odometry(trajectory.episode, p, y, math.radians(tilt)) for p, y, tilt in poses]
            ),
            "action": np.eye(len(SCORES), dtype=np.float32)[list(t.labels)],
        }
        rgb, depth = zip(*frames(t, camera), strict=True)
        facts = {
            "embodied/task": trajectory.episode.id,
            "embodied/house": trajectory.episode.world,
            "embodied/agent": "expert",
        }
        reached = trajectory.stopped and bool(trajectory.distances[-1] < trajectory.episode.radius)
        writer.add(rows, rgb, depth, [trajectory.episode.instruction] * n, [""] * n, reached, facts)
    return writer.finish("embodied vlnce", CARD)


# InternData-N1 -----------------------------------------------------------------------------------


def _internnav(folder: Path, walks: Iterable[Taught], camera: CameraConfig) -> int:
    houses: dict[str, list[dict[str, Any]]] = {}
    steps = 0
    for t in walks:
        known = houses.setdefault(t.trajectory.episode.world, [])
        known.append(_intern_episode(folder / t.trajectory.episode.world, len(known), steps, t, camera))
        steps += len(t.labels)
    for name, episodes in houses.items():
        _intern_meta(folder / name / "meta", episodes, camera)
    return steps


def _intern_episode(home: Path, number: int, first: int, t: Taught, camera: CameraConfig) -> dict[str, Any]:
    n, columns = len(t.labels), {}
    for pitch in PITCHES:
        setting = f"{round(100 * t.body.eye)}cm_{pitch}deg"
        depths, where = [], home / "videos" / "chunk-000"
        for k, (rgb, depth) in enumerate(frames(t, camera, pitch)):
            _jpeg(where / f"observation.images.rgb.{setting}" / f"episode_{number:06d}_{k}.jpg", rgb)
            _png(where / f"observation.images.depth.{setting}" / f"episode_{number:06d}_{k}.png", depth)
            depths.append(depth)
        poses = [pose_of(t, k, pitch) for k in range(n)]
        goals = [pixel_goal(t, k, poses[k], depths[k], camera) for k in range(n)]
        columns[f"pose.{setting}"] = pa.array([p.tolist() for p in poses], pa.list_(pa.list_(pa.float32())))
        columns[f"goal.{setting}"] = pa.array([list(g[0]) for g in goals], pa.list_(pa.int32()))
        columns[f"relative_goal_frame_id.{setting}"] = pa.array([g[1] for g in goals], pa.int32())
    table = pa.table(
        {
            "action": pa.array([-1, *t.labels[:-1]], pa.int32()),
            **columns,
            "timestamp": pa.array((np.arange(n) / FPS).astype(np.float32)),
            "frame_index": pa.array(np.arange(n)),
            "episode_index": pa.array(np.full(n, number)),
            "index": pa.array(first + np.arange(n)),
            "task_index": pa.array(np.full(n, number)),
        }
    )
    path = home / "data" / "chunk-000" / f"episode_{number:06d}.parquet"
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path)
    return {"episode_index": number, "tasks": [t.trajectory.episode.instruction], "length": n, "columns": table.schema}


def _intern_meta(meta: Path, episodes: list[dict[str, Any]], camera: CameraConfig) -> None:
    schema = [e.pop("columns") for e in episodes][0]
    write_lines(meta / "episodes.jsonl", [json.dumps(e) for e in episodes])
    tasks = [{"task_index": e["episode_index"], "task": e["tasks"][0]} for e in episodes]
    write_lines(meta / "tasks.jsonl", [json.dumps(x) for x in tasks])
    counts = [{"episode_index": e["episode_index"], "stats": {"action": {"count": [e["length"]]}}} for e in episodes]
    write_lines(meta / "episodes_stats.jsonl", [json.dumps(c) for c in counts])
    shapes = {"pose": [4, 4], "goal": [2]}
    features: dict[str, Any] = {}
    for field in schema:
        kind = (
            "float32" if field.name.startswith(("pose", "timestamp")) else "int64" if field.type == "int64" else "int32"
        )
        features[field.name] = {"dtype": kind, "shape": shapes.get(field.name.split(".")[0], [1]), "names": None}
        if field.name.startswith("pose."):
            setting = field.name.removeprefix("pose.")
            for what, channels in (("rgb", 3), ("depth", 1)):
                shape = [camera.height, camera.width, channels]
                names = ["height", "width", "channel"]
                features[f"observation.images.{what}.{setting}"] = {"dtype": "image", "shape": shape, "names": names}
    total = sum(e["length"] for e in episodes)
    facts = {
        "codebase_version": "v2.1",
        "robot_type": "unknown",
        "total_episodes": len(episodes),
        "total_frames": total,
        "total_tasks": len(episodes),
        "total_videos": 0,
        "total_chunks": 1,
        "chunks_size": 1000,
        "fps": FPS,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
        "video_path": "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
        "features": features,
    }
    write_json(meta / "info.json", facts, indent=1)


def pose_of(taught: Taught, k: int, down: int) -> np.ndarray:
    """(4, 4) camera to world, z up: columns right, down, ahead (OpenCV's axes) and where the camera is, metres."""
    yaw, tilt = float(taught.trajectory.yaws[k]), -math.radians(down)
    ahead = np.array([math.cos(yaw) * math.cos(tilt), math.sin(yaw) * math.cos(tilt), math.sin(tilt)])
    right = np.array([math.sin(yaw), -math.cos(yaw), 0.0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, np.cross(ahead, right), ahead
    pose[:3, 3] = taught.trajectory.positions[k] + (0.0, 0.0, taught.body.eye)
    return pose


def pixel_goal(
    taught: Taught, k: int, pose: np.ndarray, depth: np.ndarray, camera: CameraConfig
) -> tuple[tuple[int, int], int]:
    """The farthest later position of the walk whose floor is seen: its (column, row), and how many frames ahead it is;
    (-1, -1) and -1 where none is seen."""
    focal = camera.width / 2 / math.tan(math.radians(camera.hfov) / 2)
    later = taught.trajectory.positions[k + 1 : len(taught.labels)]
    for ahead in range(len(later), 0, -1):
        x, y, z = pose[:3, :3].T @ (later[ahead - 1] - pose[:3, 3])
        if z <= 0.1:
            continue
        u, v = int(camera.width / 2 + focal * x / z), int(camera.height / 2 + focal * y / z)
        if 0 <= u < camera.width and 0 <= v < camera.height and depth[v, u] > z - HIDDEN:
            return (u, v), ahead
    return NO_GOAL, -1


# -------------------------------------------------------------------------------------------------


def _jpeg(path: Path, rgb: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(rgb).save(path, quality=92)


def _png(path: Path, depth: np.ndarray) -> None:
    """16 bits, millimetres; 0 where nothing is or it is farther than 65 m."""
    path.parent.mkdir(parents=True, exist_ok=True)
    millimetres = np.where(depth < 65.5, 1000 * np.minimum(depth, 65.5), 0).astype(np.uint16)
    Image.fromarray(millimetres).save(path)


def write_film(path: Path, pictures: Iterable[np.ndarray], fps: int) -> None:
    """(h, w, 3) uint8 frames as an H.264 video."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with av.open(str(path), "w") as container:
        film: Any = None
        for rgb in pictures:
            if film is None:
                film = container.add_stream("libx264", rate=fps, options={"crf": "20"})
                film.height, film.width, film.pix_fmt = *rgb.shape[:2], "yuv420p"
            container.mux(film.encode(av.VideoFrame.from_ndarray(rgb, "rgb24")))
        container.mux(film.encode())
