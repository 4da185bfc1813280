"""SharedSyncVectorEnv: many environments that take their steps together in one process and look together, on all cores.

    envs = gymnasium.make_vec("embodied/HANNA-v0", num_envs=64, data="DIR")

Play itself is Python and takes its turn; what is seen is resampled by threads that share the decoded panoramas and
write straight into the batch. For several processes, use Gymnasium's AsyncVectorEnv (vectorization_mode="async").
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import SyncVectorEnv, VectorObservationWrapper
from gymnasium.vector.utils import batch_space, create_empty_array

from embodied.gym.env import OWN, HelpGymEnv, check_options, open_resources
from embodied.gym.sensors import Sensor, SensorSuite
from embodied.software import processors

if TYPE_CHECKING:
    from embodied.world import World


def make_vec(
    kind: str,
    num_envs: int = 1,
    *,
    render_mode: str | None = None,
    max_episode_steps: int | None = None,
    disable_env_checker: bool | None = None,
    **options: Any,
) -> SharedSyncVectorEnv:
    """`num_envs` environments that share resources: houses, pages and decoded panoramas are held once.

    Each has its own task, target, instruction and generator.

    Args:
      max_episode_steps: steps after which an episode is truncated, as by Gymnasium's TimeLimit; -1 and None: its own.
      disable_env_checker: as of gymnasium.make; these environments have no checker.
      options: as of `make`, and `threads` that look (default: one per core).

    Raises:
      ValueError: fewer than one, or no such limit.
    """
    own = {name: options.pop(name) for name in OWN if name in options}
    check_options(render_mode, **own)
    threads = options.pop("threads", None)
    shared = open_resources(kind, **options)
    sensor, opened = shared.pop("sensor"), shared.pop("opened")
    one = functools.partial(HelpGymEnv, sensor=SensorSuite(), render_mode=render_mode, **shared, **own)
    slots = in_step(one, num_envs, max_episode_steps)
    return SharedSyncVectorEnv(slots, sensor, threads=threads, opened=opened)


def in_step(make_one: Callable[[], gym.Env[Any, Any]], count: int, max_episode_steps: int | None) -> SyncVectorEnv:
    """Gymnasium's batch of `count` environments of one process, whose episodes are truncated after so many steps.

    Raises:
      ValueError: no environment, or no such limit.
    """
    for name, number, none in (("num_envs", count, ()), ("max_episode_steps", max_episode_steps, (None, -1))):
        if number not in none and not (isinstance(number, (int, np.integer)) and number >= 1):
            raise ValueError(f"{name} should be a whole number of at least 1, got {number!r}")
    if max_episode_steps in (None, -1):
        return SyncVectorEnv([make_one] * count)
    return SyncVectorEnv([lambda: gym.wrappers.TimeLimit(make_one(), int(max_episode_steps))] * count)


class SharedSyncVectorEnv(VectorObservationWrapper[dict[str, Any], Any, dict[str, Any], np.ndarray]):
    """A batch of environments whose slots have no sensor: the batch observes for them, in new arrays each time."""

    def __init__(
        self, slots: SyncVectorEnv, sensor: Sensor, *, threads: int | None = None, opened: Sequence[World] = ()
    ) -> None:
        """
        Args:
          slots: each a HelpGymEnv, with a sensor that sees nothing.
          sensor: what the slots see; shared.
          threads: that look; one per core by default.
          opened: worlds that `close` closes.

        Raises:
          ValueError: fewer than one thread.
        """
        if threads is not None and threads < 1:
            raise ValueError(f"threads should be at least 1, got {threads}")
        super().__init__(slots)
        self._slots: list[Any] = [env.unwrapped for env in slots.envs]
        self._sensor, self._seen = sensor, gym.spaces.Dict({**sensor.spaces()})
        own_spaces = slots.single_observation_space
        assert isinstance(own_spaces, gym.spaces.Dict), "an environment shows several things"
        self.single_observation_space = gym.spaces.Dict({**self._seen, **own_spaces})
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._threads = min(threads or processors(), self.num_envs)
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None
        self._opened = tuple(opened)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """As Gymnasium's; the seed may be one of NumPy's integers, too."""
        return super().reset(seed=int(seed) if isinstance(seed, np.integer) else seed, options=options)

    def step(self, actions: Any) -> tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One step of every slot; one that has ended is reset."""
        if len(actions) != self.num_envs:
            raise ValueError(f"{len(actions)} actions for {self.num_envs} environments; give one for each")
        return super().step(actions)

    def close(self, **kwargs: Any) -> None:
        super().close(**kwargs)
        if self._pool is not None:
            self._pool.shutdown()
        for world in self._opened:
            world.close()

    def observations(self, observations: dict[str, Any]) -> dict[str, Any]:
        """Add what all slots see: places are opened by this thread, since only it may draw; pictures made by all."""
        arrays: Any = create_empty_array(self._seen, self.num_envs, np.empty)
        looks = [self._sensor.look(env.observed) for env in self._slots]

        def fill(first: int) -> None:
            for k in range(first, self.num_envs, self._threads):
                for name, array in looks[k]().items():
                    arrays[name][k] = array

        if self._pool is None:
            fill(0)
        else:
            list(self._pool.map(fill, range(self._threads)))
        return {**arrays, **observations}
