"""Driving as dm_env environments, in the way of dm_control's suite.

    environment = suite.load("drive", "reach", task_kwargs={"random": 0}, environment_kwargs={"data": "DIR"})

The same rules, numbers and rewards as embodied/Drive-v0. Arriving, or saying so, ends an episode with discount 0, time
with discount 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import dm_env
import numpy as np
from dm_env import specs

from embodied.gym.drive import make_driving, seen_space
from embodied.gym.driving import TASKS, Driving

ALL_TASKS = tuple(("drive", task) for task in TASKS)
"""(domain, task) of all there are."""


def load(
    domain_name: str,
    task_name: str,
    task_kwargs: Mapping[str, Any] | None = None,
    environment_kwargs: Mapping[str, Any] | None = None,
) -> DriveEnvironment:
    """An environment by its names, as dm_control.suite.load.

    Args:
      task_kwargs: 'random' (a seed or a numpy Generator) and fields of DriveSettings.
      environment_kwargs: where it plays: data, split, seed, cache, pictures, worlds of embodied.gym.drive.make_driving.

    Raises:
      ValueError: there is no such environment.
    """
    if (domain_name, task_name) not in ALL_TASKS:
        raise ValueError(f"there is no environment {domain_name!r} {task_name!r}; use one of {ALL_TASKS}")
    told = dict(task_kwargs or {})
    random = told.pop("random", None)
    return DriveEnvironment(make_driving(task=task_name, **told, **(environment_kwargs or {})), random)


class DriveEnvironment(dm_env.Environment):
    """Driving for whoever speaks dm_env."""

    def __init__(self, driving: Driving, random: int | np.random.Generator | None = None) -> None:
        """
        Args:
          random: a seed, or the generator of starts and goals.
        """
        self.driving, self._rng, self._over = driving, np.random.default_rng(random), True

    def reset(self) -> dm_env.TimeStep:
        self.driving.reset(self._rng)
        self._over = False
        return dm_env.restart(self.driving.look())

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """The next moment; after an episode's last one a new episode begins, whatever the action."""
        if self._over:
            return self.reset()
        outcome = self.driving.step(action)
        self.facts = outcome.facts
        seen, self._over = self.driving.look(), outcome.ended is not None
        if outcome.ended == "limit":
            return dm_env.truncation(outcome.reward, seen)
        return (dm_env.termination if self._over else dm_env.transition)(outcome.reward, seen)

    def action_spec(self) -> specs.BoundedArray:
        return specs.BoundedArray((self.driving.settings.numbers,), np.float32, -1.0, 1.0, "velocities")

    def observation_spec(self) -> dict[str, specs.BoundedArray]:
        spaces = seen_space(self.driving.settings)
        return {n: specs.BoundedArray(s.shape, s.dtype, s.low, s.high, n) for n, s in spaces.items()}

    def control_timestep(self) -> float:
        """Seconds that an action is held."""
        return self.driving.settings.control

    @property
    def physics(self) -> Any:
        """The body's model and data (embodied.envs.driven.Driver), from the first reset on."""
        return self.driving.driver

    def close(self) -> None:
        self.driving.close()
