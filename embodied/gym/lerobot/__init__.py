"""Environments as LeRobot's programs want them (0.6.1): `lerobot-eval`, EnvHub.

    from embodied.gym.lerobot import make_env
    envs = make_env(n_envs=4, env="VLNCE", data="DIR", split="val_unseen")     # {"embodied/VLNCE-v0": {0: VectorEnv}}

Observations are `pixels` (pictures) and `agent_pos` (a vector), actions are vectors of float32: in VLNCE-v0 and
ObjectNav-v0 a score for each action, of which the largest is taken; in Drive-v0 the velocities. With
`observations=()` pixels are black. Every info has `is_success`; `task_description`, `task` and
`_max_episode_steps` are attributes.

EnvHub reads a file `env.py` of a repository; `hub_file` writes one that makes these environments.
"""

import functools
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from embodied.assets.cache import write_bytes
from embodied.envs.continuous import POSITION
from embodied.gym import continuous, drive
from embodied.gym.driving import DriveSettings
from embodied.gym.sensors import LARGE

ENVS = ("VLNCE", "ObjectNav", "Drive")
DRIVEN = ("motion", "touched", "goal")
"""Parts of what Drive-v0 shows that agent_pos has, where they are there."""


class _ForLeRobot(gym.Wrapper[dict[str, Any], np.ndarray, Any, Any]):
    """Base of both environments: `pixels`, which are black for a blind agent, and `agent_pos`. Subclasses
    define `_command`, what an action of the policy does, and `_state`, the numbers of agent_pos."""

    env: Any

    def __init__(self, env: Any, sides: Any, numbers: int, steps: int, task: str) -> None:
        """
        Args:
          sides: what has the `height` and `width` of pictures.
          numbers: of agent_pos.
          steps: most of an episode.
        """
        super().__init__(env)
        self._black = np.zeros((sides.height, sides.width, 3), np.uint8)
        self.task, self._max_episode_steps = task, steps
        seen = spaces.Box(0, 255, self._black.shape, np.uint8)
        position = spaces.Box(-LARGE, LARGE, (numbers,), np.float32)
        self.observation_space = spaces.Dict({"pixels": seen, "agent_pos": position})

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        o, info = self.env.reset(seed=seed, options=options)
        self.task_description: str = info.get("instruction") or info["request"]
        return self._seen(o), info | {"is_success": False}

    def step(self, action: np.ndarray) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        o, reward, terminated, truncated, info = self.env.step(self._command(action))
        return self._seen(o), reward, terminated, truncated, {"is_success": False} | info

    def _seen(self, o: dict[str, Any]) -> dict[str, Any]:
        return {"pixels": o.get("rgb", self._black), "agent_pos": self._state(o)}

    def _command(self, action: np.ndarray) -> Any:
        return action

    def _state(self, o: dict[str, Any]) -> np.ndarray:
        raise NotImplementedError


class ContinuousForLeRobot(_ForLeRobot):
    """VLNCE-v0 or ObjectNav-v0 for LeRobot's policies; agent_pos is embodied.envs.continuous.POSITION."""

    def __init__(self, env: continuous.ContinuousGymEnv) -> None:
        camera, body = env.dataset.camera, env.dataset.body
        super().__init__(env, camera, len(POSITION), body.steps, env.dataset.task.name)
        self.action_space = spaces.Box(-1.0, 1.0, (body.actions,), np.float32)

    def _command(self, action: np.ndarray) -> int:
        return int(np.argmax(action))

    def _state(self, o: dict[str, Any]) -> np.ndarray:
        return self.env.odometry()


class DriveForLeRobot(_ForLeRobot):
    """Drive-v0 for LeRobot's policies; agent_pos is its motion, and the direction of the goal where there is one."""

    def __init__(self, env: drive.DriveEnv) -> None:
        settings = env.driving.settings
        steps = round(settings.seconds / settings.control)
        super().__init__(env, settings, _driven(settings), steps, settings.task)
        self.action_space = env.action_space
        self._parts = [name for name in DRIVEN if name in drive.seen_space(settings)]

    def _state(self, o: dict[str, Any]) -> np.ndarray:
        return np.concatenate([o[name] for name in self._parts]).astype(np.float32)


def _driven(settings: DriveSettings) -> int:
    known = drive.seen_space(settings)
    return sum(known[name].shape[0] for name in DRIVEN if name in known)


def sizes(env: str) -> tuple[int, int]:
    """How many numbers an action and `agent_pos` have.

    Raises:
      ValueError: an unknown `env`.
    """
    if env not in ENVS:
        raise ValueError(f"env is {env!r}; use one of {ENVS}")
    if env == "Drive":
        settings = DriveSettings()
        return settings.numbers, _driven(settings)
    return continuous.continuous_task(env.lower()).body.actions, len(POSITION)


def make_env(
    n_envs: int = 1, use_async_envs: bool = False, cfg: Any = None, *, env: str = "VLNCE", **options: Any
) -> dict[str, dict[int, gym.vector.VectorEnv]]:
    """Make the environments that LeRobot's EnvHub asks for: {suite: {number of the task: environments}}.

    Args:
      use_async_envs: a process for each; otherwise they share their houses in one.
      cfg: LeRobot's configuration; not needed.
      env: one of ENVS.
      options: of `gymnasium.make("embodied/VLNCE-v0", ...)`.

    Raises:
      ValueError: an unknown `env`.
    """
    sizes(env)  # refuses unknown ones
    suite = f"embodied/{env}-v0"
    if use_async_envs and n_envs > 1:
        one = functools.partial(make_one, env, **options)
        envs: gym.vector.VectorEnv = gym.vector.AsyncVectorEnv([one] * n_envs, context="spawn")
    elif env == "Drive":
        envs = gym.vector.SyncVectorEnv([functools.partial(make_one, env, **options)] * n_envs)
    else:
        dataset = continuous.open_episodes(env.lower(), **{"observations": ("rgb",)} | options)
        envs = gym.vector.SyncVectorEnv(
            [lambda: ContinuousForLeRobot(continuous.ContinuousGymEnv(dataset, render_mode="rgb_array"))] * n_envs
        )
    return {suite: {0: envs}}


def make_one(env: str, **options: Any) -> gym.Env[Any, Any]:
    """One environment for LeRobot's policies."""
    options = {"observations": ("rgb",), "render_mode": "rgb_array"} | options
    if env == "Drive":
        return DriveForLeRobot(drive.make(**options))
    return ContinuousForLeRobot(continuous.make(env.lower(), **options))


def hub_file(path: Path, env: str = "VLNCE", **options: Any) -> None:
    """Write the env.py of an EnvHub repository, which makes `env` with these options."""
    text = f'''"""LeRobot's EnvHub: houses of `pip install embodied-houses`."""

from embodied.gym import lerobot


def make_env(n_envs=1, use_async_envs=False, cfg=None):
    return lerobot.make_env(n_envs, use_async_envs, cfg, env={env!r}, **{options!r})
'''
    write_bytes(Path(path), text.encode())
