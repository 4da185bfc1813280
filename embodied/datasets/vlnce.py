"""Continuous walks as training data: image, action and instruction at every step, in the forms that models train on.

  vlnce        samples.jsonl with a line per step, images/, and the episodes in Habitat's files
  lerobot-vlnce    LeRobot v3.0, for policies that `lerobot-eval` judges in embodied.gym.lerobot

A walk may leave the expert's way: what is written as the action is always what the expert does there (DAgger).
"""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from PIL import Image

from embodied.datasets.build import whole_folder
from embodied.datasets.folders import write_lines
from embodied.datasets.habitat import with_experts, write_vlnce
from embodied.datasets.lerobot import STEP_COLUMNS, Columns, Writer
from embodied.envs import continuous
from embodied.render.camera import camera_at
from embodied.seeds import stream
from embodied.world import World

FORMATS = ("vlnce", "lerobot-vlnce")
SQUARE = continuous.CameraConfig()
STEPS = 4
"""Steps a second of LeRobot's data."""

Chosen = Callable[[int], int]
"""From what the expert does to what is done."""


@dataclass(frozen=True, eq=False)
class Taught:
    """A walk and what the expert would have done before each of its actions."""

    trajectory: continuous.ContinuousTrajectory
    labels: tuple[int, ...]
    world: World
    eye: float
    """Height of the camera, metres."""


def noisy_actions(share: float, rng: np.random.Generator) -> Chosen:
    """The expert plays, but this share of its steps and turns is drawn among steps and turns instead."""

    def chosen(label: int) -> int:
        return int(rng.integers(1, 4)) if label != continuous.HabitatAction.STOP and rng.random() < share else label

    return chosen


def teach(
    env: continuous.ContinuousEnv,
    episode: continuous.ContinuousEpisode,
    world: World,
    chosen: Chosen = lambda label: label,
) -> Taught:
    """Play an episode, as the expert does unless told otherwise, and write down what the expert does at each of its
    states (Ross et al. 2011)."""
    env.reset(episode, world)
    expert, labels = continuous.ShortestPathFollower(env, along=bool(episode.reference)), []
    while not env.ended:
        labels.append(expert.action())
        env.step(chosen(labels[-1]))
    return Taught(env.trajectory(), tuple(labels), world, env.body.eye)


def frames(taught: Taught, camera: continuous.CameraConfig) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """(h, w, 3) uint8 and (h, w) float32 metres along the optical axis, before each action."""
    trajectory, size = taught.trajectory, (camera.height, camera.width)
    for (x, y, z), yaw in zip(trajectory.positions[:-1], trajectory.yaws[:-1], strict=True):
        eye = (x, y, z + taught.eye)
        view = taught.world.renderer.through(camera_at(eye, yaw, vfov=camera.vfov), size)
        yield view.rgb, view.depth


def export_walks(
    form: str,
    folder: Path,
    episodes: Iterable[continuous.ContinuousEpisode],
    worlds: Mapping[str, World],
    *,
    seed: int,
    camera: continuous.CameraConfig = SQUARE,
    action_noise: float = 0.0,
    split: str = "train",
    depth: bool = False,
    watch: Callable[[Iterable[continuous.ContinuousEpisode]], Iterable[continuous.ContinuousEpisode]] = iter,
) -> int:
    """Play episodes and write them in one of FORMATS; returns how many steps there are.

    Args:
      folder: new or empty; it appears when it is whole.
      action_noise: the share of actions, below 1, that are drawn instead of the expert's; what is written stays his.
      depth: whether 'lerobot-vlnce' has videos of depth; policies that want colours alone cannot read them.
      watch: goes through the episodes, as a progress bar does.

    Raises:
      ValueError: an unknown form, a folder with files, or no episodes.
    """
    if form not in FORMATS:
        raise ValueError(f"unknown form {form!r}; use one of {FORMATS}")
    if not 0 <= action_noise < 1:
        raise ValueError(f"action_noise is a share from 0 to below 1, got {action_noise}")
    chosen_episodes = list(episodes)
    if not chosen_episodes:
        raise ValueError("there are no episodes to play; choose another split")
    env = continuous.ContinuousEnv()
    chosen = noisy_actions(action_noise, stream(seed, "wander"))
    taught = (teach(env, e, worlds[e.world], chosen) for e in watch(chosen_episodes))
    with whole_folder(folder) as draft:
        if form == "lerobot-vlnce":
            return _lerobot(draft, taught, camera, depth)
        write_vlnce(draft, split, with_experts(chosen_episodes, worlds, continuous.ContinuousEnv()))
        return _samples(draft, taught, camera)


def _samples(folder: Path, walks: Iterable[Taught], camera: continuous.CameraConfig) -> int:
    lines: list[str] = []
    for t in walks:
        episode = t.trajectory.episode
        for k, (rgb, _) in enumerate(frames(t, camera)):
            image = f"images/{episode.world}_{episode.id}/{k:03d}.jpg"
            (folder / image).parent.mkdir(parents=True, exist_ok=True)
            Image.fromarray(rgb).save(folder / image, quality=92)
            facts = {"episode": episode.id, "world": episode.world, "step": k, "image": image}
            facts |= {"instruction": episode.instruction, "taken": t.trajectory.actions[k], "action": t.labels[k]}
            lines.append(json.dumps(facts))
    write_lines(folder / "samples.jsonl", lines)
    return len(lines)


SCORES = ("stop", "forward", "left", "right")
"""action: 1 for what the expert does, 0 for the others."""
LEROBOT: Columns = {
    **STEP_COLUMNS,
    "observation.state": (pa.list_(pa.float32(), len(continuous.POSITION)), continuous.POSITION),
    "action": (pa.list_(pa.float32(), len(SCORES)), SCORES),
}


def _lerobot(folder: Path, walks: Iterable[Taught], camera: continuous.CameraConfig, with_depth: bool) -> int:
    writer = Writer(
        folder, (camera.height, camera.width), LEROBOT, key="observation.image", fps=STEPS, depth=with_depth
    )
    for t in walks:
        trajectory, episode, n = t.trajectory, t.trajectory.episode, len(t.labels)
        poses = zip(trajectory.positions[:-1], trajectory.yaws[:-1], trajectory.pitches[:-1], strict=True)
        states = [continuous.odometry(episode, p, y, math.radians(tilt)) for p, y, tilt in poses]
        scores = np.eye(len(SCORES), dtype=np.float32)[list(t.labels)]
        rows = {"observation.state": np.stack(states), "action": scores}
        rgb, depth = zip(*frames(t, camera), strict=True)
        facts = {"embodied/task": episode.id, "embodied/house": episode.world, "embodied/agent": "expert"}
        writer.add(rows, rgb, depth, [episode.instruction] * n, [""] * n, trajectory.success > 0, facts)
    return writer.finish("embodied vlnce", "lerobot_vlnce")
