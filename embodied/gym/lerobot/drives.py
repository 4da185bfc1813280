"""Drives of an expert as LeRobot data (v3.0), in the columns that Drive-v0 shows to LeRobot's policies.

observation.image    (height, width, 3) what is seen before a command
observation.state    agent_pos of embodied.gym.lerobot.DriveForLeRobot
action               what the expert commands there, ahead and left, from -1 to 1
"""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from embodied.datasets.build import whole_folder
from embodied.datasets.lerobot import STEP_COLUMNS, Columns, Writer
from embodied.gym.driving import expert_action
from embodied.gym.lerobot import DriveForLeRobot
from embodied.seeds import stream

STATE = ("metres per second", "radians per second", "touched", "metres to goal", "sine", "cosine")
"""observation.state: motion ahead and to the left, touch, and where the goal is, left positive."""
COMMAND = ("ahead", "left")
DRIVES: Columns = {
    **STEP_COLUMNS,
    "observation.state": (pa.list_(pa.float32(), len(STATE)), STATE),
    "action": (pa.list_(pa.float32(), len(COMMAND)), COMMAND),
}
HELD = 5
"""Commands that a random one is held for."""


def export_drives(
    env: DriveForLeRobot,
    folder: Path,
    drives: int,
    *,
    seed: int,
    action_noise: float = 0.0,
    watch: Callable[[Iterable[int]], Iterable[int]] = iter,
) -> int:
    """Play episodes, as many in each house, and write them; returns how many steps there are.

    Args:
      folder: new or empty.
      action_noise: the share of commands, below 1, that are drawn instead; what is written stays the expert's.
      watch: goes through the numbers of the drives, as a progress bar does.

    Raises:
      ValueError: a folder with files, or an impossible share.
    """
    if not 0 <= action_noise < 1:
        raise ValueError(f"action_noise is a share from 0 to below 1, got {action_noise}")
    settings, names = env.env.driving.settings, sorted(env.env.driving.worlds)
    with whole_folder(folder) as draft:
        fps = round(1 / settings.control)
        writer = Writer(draft, (settings.height, settings.width), DRIVES, key="observation.image", fps=fps)
        for k in watch(range(drives)):
            name, rng = names[k * len(names) // drives], stream(seed, "drives", k)
            first, _ = env.reset(seed=int(rng.integers(2**31)), options={"world": name})
            seen, labels, infos = zip(*_driven(env, first, action_noise, rng), strict=True)
            rows = {"observation.state": np.stack([o["agent_pos"] for o in seen]), "action": np.stack(labels)}
            facts = {"embodied/task": f"{name}_{k}", "embodied/house": name, "embodied/agent": "expert"}
            words = [env.task_description] * len(seen)
            replies = [""] * len(seen)
            writer.add(rows, [o["pixels"] for o in seen], [], words, replies, infos[-1]["is_success"], facts)
        return writer.finish("embodied drive", "lerobot_drive")


def _driven(
    env: DriveForLeRobot, seen: dict[str, Any], action_noise: float, rng: np.random.Generator
) -> Iterator[tuple[dict[str, Any], np.ndarray, dict[str, Any]]]:
    """Observation before each command, the expert's command there, and info after the command that is given."""
    held, drawn, ended = 0, np.zeros(len(COMMAND)), False
    begin = action_noise / (HELD * (1 - action_noise))
    while not ended:
        label = expert_action(env.env.driving)
        if not held and rng.random() < begin:
            held, drawn = HELD, rng.uniform(-1.0, 1.0, len(COMMAND))
        command = drawn if held else label
        held = max(held - 1, 0)
        after, _, terminated, truncated, info = env.step(command)
        yield seen, label, info
        seen, ended = after, terminated or truncated
