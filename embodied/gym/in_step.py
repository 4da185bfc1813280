"""InStep: many environments that take their steps together in one process and look together, on all cores.

    envs = gymnasium.make_vec("embodied/HANNA-v0", num_envs=64, data="DIR")

Play itself is Python and takes its turn, some 60 % of a step with 128 x 128 rgb; what is seen is resampled by threads
that share the decoded panoramas and write straight into the batch.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
import psutil
from gymnasium.vector import SyncVectorEnv, VectorEnv
from gymnasium.vector.utils import batch_space

from embodied.gym.eyes import Arrays, Eyes

if TYPE_CHECKING:
    from embodied.gym.env import HelpGymEnv

COPIES = 2
"""Of an observation that a batch holds per slot: what was handed out last, and what is being filled."""


class InStep(VectorEnv[dict[str, Any], Any, np.ndarray]):
    """A batch of environments whose slots have closed eyes: the batch looks for them.

    Observations are new arrays each time. A slot that has ended is reset by the next step.
    """

    def __init__(
        self, make_one: Callable[[], HelpGymEnv], num_envs: int, eyes: Eyes, *, threads: int | None = None
    ) -> None:
        """Args:
        make_one: makes the environment of a slot, with `embodied.gym.eyes.Closed`.
        eyes: what the slots see; shared.
        threads: that look; one per core by default.

        Raises:
          ValueError: fewer than one thread.
        """
        if threads is not None and threads < 1:
            raise ValueError(f"threads should be at least 1, got {threads}")
        self._play, self._eyes, self._seen = SyncVectorEnv([make_one] * num_envs), eyes, eyes.spaces()
        self.num_envs, self.metadata, self.render_mode = num_envs, self._play.metadata, self._play.render_mode
        self.single_action_space, self.action_space = self._play.single_action_space, self._play.action_space
        without = self._play.single_observation_space
        assert isinstance(without, gym.spaces.Dict), "an environment shows several things"
        self.single_observation_space = gym.spaces.Dict({**self._seen, **without.spaces})
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._threads = min(threads or len(os.sched_getaffinity(0)), num_envs)
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None

    @property
    def envs(self) -> list[HelpGymEnv]:
        """The slots."""
        return self._play.envs  # type: ignore[return-value]  # made by make_one

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        observations, info = self._play.reset(seed=seed, options=options)
        return {**self._look(), **observations}, info

    def step(self, actions: Any) -> tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        observations, rewards, terminated, truncated, info = self._play.step(actions)
        return {**self._look(), **observations}, rewards, terminated, truncated, info

    def render(self) -> tuple[Any, ...] | None:
        return self._play.render()

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """What a method of every slot returns, or an attribute of each."""
        return self._play.call(name, *args, **kwargs)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of every slot."""
        return self._play.get_attr(name)

    def close_extras(self, **kwargs: Any) -> None:
        if self._pool is not None:
            self._pool.shutdown()
        self._play.close(**kwargs)

    def _look(self) -> Arrays:
        """What all slots see: places by this thread, since only it may draw; pictures of them by all."""
        looks = [self._eyes.look(env.observed) for env in self.envs]
        found = {name: np.empty((self.num_envs, *(s.shape or ())), s.dtype) for name, s in self._seen.items()}

        def fill(first: int) -> None:
            for k in range(first, self.num_envs, self._threads):
                for name, array in looks[k]().items():
                    found[name][k] = array

        if self._pool is None:
            fill(0)
        else:
            list(self._pool.map(fill, range(self._threads)))
        return found


def refuse_too_many(num_envs: int, space: gym.spaces.Dict) -> None:
    """Raises ValueError where the observations of a batch do not fit into memory."""
    each = sum(int(np.prod(s.shape)) * np.dtype(s.dtype).itemsize for s in space.values() if s.shape is not None)
    wanted, free = COPIES * num_envs * each, psutil.virtual_memory().available
    if wanted > 0.8 * free:
        raise ValueError(
            f"{num_envs} environments hold about {wanted / 2**30:.1f} GiB of observations, {free / 2**30:.1f} GiB "
            "are free; use fewer, or smaller views"
        )
