"""SharedSyncVectorEnv: many environments that take their steps together in one process and look together, on all cores.

    envs = gymnasium.make_vec("embodied/HANNA-v0", num_envs=64, data="DIR")

Play itself is Python and takes its turn; what is seen is resampled by threads that share the decoded panoramas and
write straight into the batch. For several processes, use Gymnasium's AsyncVectorEnv
(vectorization_mode="async").
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from embodied.gym.env import OWN, HelpGymEnv, check_options, open_resources
from embodied.gym.sensors import Arrays, Sensor, SensorSuite
from embodied.seeds import checked_seed
from embodied.threads import processors

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
    if not isinstance(num_envs, (int, np.integer)) or num_envs < 1:
        raise ValueError(f"num_envs should be a whole number of at least 1, got {num_envs!r}")
    limit = checked_limit(max_episode_steps)
    own = {name: options.pop(name) for name in OWN if name in options}
    check_options(render_mode, **own)
    threads = options.pop("threads", None)
    shared = open_resources(kind, **options)

    def one() -> HelpGymEnv:
        return HelpGymEnv(
            shared.make_env, shared.tasks, SensorSuite(), layout=shared.layout, render_mode=render_mode, **own
        )

    return SharedSyncVectorEnv(one, int(num_envs), shared.sensor, threads=threads, opened=shared.opened, limit=limit)


class SharedSyncVectorEnv(VectorEnv[dict[str, Any], Any, np.ndarray]):
    """A batch of environments whose slots have no sensor: the batch observes for them.

    Observations are new arrays each time. A slot that has ended is reset by the next step.
    """

    def __init__(
        self,
        make_one: Callable[[], HelpGymEnv],
        num_envs: int,
        sensor: Sensor,
        *,
        threads: int | None = None,
        opened: Sequence[World] = (),
        limit: int | None = None,
    ) -> None:
        """Args:
        make_one: makes the environment of a slot, with a sensor that sees nothing.
        sensor: what the slots see; shared.
        threads: that look; one per core by default.
        opened: worlds that `close` closes.
        limit: steps after which an episode is truncated.

        Raises:
          ValueError: fewer than one thread.
        """
        if threads is not None and threads < 1:
            raise ValueError(f"threads should be at least 1, got {threads}")
        self.envs = [make_one() for _ in range(num_envs)]
        """The slots."""
        first = self.envs[0]
        self.num_envs, self.render_mode = num_envs, first.render_mode
        self.metadata = {**first.metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}
        self.single_action_space, self.action_space = first.action_space, batch_space(first.action_space, num_envs)
        self._sensor, self._seen, own_spaces = sensor, sensor.spaces(), first.observation_space
        assert isinstance(own_spaces, gym.spaces.Dict), "an environment shows several things"
        self.single_observation_space = gym.spaces.Dict({**self._seen, **own_spaces.spaces})
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._observations = _arrays_of(own_spaces.spaces, num_envs)
        self._over, self._steps, self._limit = np.zeros(num_envs, bool), np.zeros(num_envs, int), limit
        self._threads = min(threads or processors(), num_envs)
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None
        self._opened = tuple(opened)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """All slots, or those of options["reset_mask"]."""
        seeds, options = seeds_of(seed, self.num_envs), dict(options or {})
        info: dict[str, Any] = {}
        slots = [int(k) for k in np.flatnonzero(mask_of(options, self.num_envs))]
        for k in slots:
            self.envs[k].chosen(options)  # or nothing happens at all
        for k in slots:
            o, one = self.envs[k].reset(seed=seeds[k], options=options or None)
            self._over[k], self._steps[k] = False, 0
            self._note(k, o)
            info = self._add_info(info, one, k)
        return self._shown(), info

    def step(self, actions: Any) -> tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One step of every slot.

        A wrong number of actions, or one that cannot be taken, is refused before any slot moves. An exception inside a
        slot is raised when the others have taken their steps; that slot is reset by the next step.
        """
        if len(actions) != self.num_envs:
            raise ValueError(f"{len(actions)} actions for {self.num_envs} environments; give one for each")
        for k, (env, action) in enumerate(zip(self.envs, actions, strict=True)):
            if not self._over[k]:
                env.refuse(action)
        rewards = np.zeros(self.num_envs)
        terminated, truncated = np.zeros((2, self.num_envs), bool)
        info: dict[str, Any] = {}
        errors: list[Exception] = []
        for k, (env, action) in enumerate(zip(self.envs, actions, strict=True)):
            was_over, self._over[k] = self._over[k], True  # until it is through: an interrupted slot begins anew
            try:
                if was_over:
                    o, one = env.reset()
                    self._steps[k] = 0
                else:
                    o, rewards[k], terminated[k], truncated[k], one = env.step(action)
                    self._steps[k] += 1
                    truncated[k] |= self._steps[k] == self._limit
            except Exception as e:
                e.add_note(f"in slot {k} of {self.num_envs}, which the next step resets")
                errors.append(e)
                continue
            self._over[k] = terminated[k] or truncated[k]
            self._note(k, o)
            info = self._add_info(info, one, k)
        if errors:
            raise errors[0]
        return self._shown(), rewards, terminated, truncated, info

    def render(self) -> tuple[Any, ...] | None:
        return tuple(env.render() for env in self.envs)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method of every slot, or read an attribute of each."""
        attributes = [getattr(env, name) for env in self.envs]
        return tuple(f(*args, **kwargs) if callable(f) else f for f in attributes)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of every slot."""
        return self.call(name)

    def close_extras(self, **kwargs: Any) -> None:
        if self._pool is not None:
            self._pool.shutdown()
        for env in self.envs:
            env.close()
        for world in self._opened:
            world.close()

    def _note(self, k: int, observation: dict[str, Any]) -> None:
        for name, value in observation.items():
            self._observations[name][k] = value

    def _shown(self) -> Arrays:
        arrays = _arrays_of(self._seen, self.num_envs)
        self._look(arrays)
        return {**arrays, **{name: array.copy() for name, array in self._observations.items()}}

    def _look(self, into: Arrays) -> None:
        """Fill in what all slots see: places by this thread, since only it may draw; pictures of them by all."""
        looks = [self._sensor.look(env.observed) for env in self.envs]

        def fill(first: int) -> None:
            for k in range(first, self.num_envs, self._threads):
                for name, array in looks[k]().items():
                    into[name][k] = array

        if self._pool is None:
            fill(0)
        else:
            list(self._pool.map(fill, range(self._threads)))


def _arrays_of(kinds: Mapping[str, gym.Space[Any]], num_envs: int) -> Arrays:
    return {name: np.empty((num_envs, *(s.shape or ())), s.dtype) for name, s in kinds.items()}


def checked_limit(max_episode_steps: int | None) -> int | None:
    """The steps after which Gymnasium truncates an episode; None where an episode has its own end only.

    Raises:
      ValueError: not a positive number of steps.
    """
    if max_episode_steps is None or max_episode_steps == -1:
        return None
    if not isinstance(max_episode_steps, (int, np.integer)) or max_episode_steps < 1:
        raise ValueError(f"max_episode_steps should be a whole number of at least 1, or -1, got {max_episode_steps!r}")
    return int(max_episode_steps)


def seeds_of(seed: int | Sequence[int | None] | None, num_envs: int) -> list[int | None]:
    """One for each slot, as Gymnasium's batches have them.

    Raises:
      ValueError: another number of seeds.
    """
    if not isinstance(seed, (list, tuple, np.ndarray)):
        return [None if seed is None else checked_seed(seed) + i for i in range(num_envs)]
    if len(seed) != num_envs:
        raise ValueError(f"{len(seed)} seeds for {num_envs} environments; give one or as many")
    return [None if s is None else checked_seed(s) for s in seed]


def mask_of(options: dict[str, Any], num_envs: int) -> np.ndarray:
    """(num_envs,) bool: which slots are reset; takes "reset_mask" out of `options`.

    Raises:
      ValueError: no such mask.
    """
    mask = np.asarray(options.pop("reset_mask", np.ones(num_envs, bool)))
    if mask.shape != (num_envs,) or mask.dtype != bool or not mask.any():
        raise ValueError(f"reset_mask should be {num_envs} booleans, some of them true, got {mask!r}")
    return mask
