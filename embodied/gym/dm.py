"""Our Gymnasium environments as dm_env.Environment, for users of dm_control and Acme (extra `robots`)."""

from typing import Any

import dm_env
import gymnasium
from dm_env import specs
from gymnasium import spaces


class DmEnv(dm_env.Environment):
    """One whose spaces are Box or Discrete, or a Dict of them; `info` is what the last reset or step told besides."""

    def __init__(self, env: gymnasium.Env, first: int = 0) -> None:
        """`first`: seed of the first episode; each further one has the next."""
        self.env, self._seed, self._over = env, first, True

    def reset(self) -> dm_env.TimeStep:
        seen, self.info = self.env.reset(seed=self._seed)
        self._seed, self._over = self._seed + 1, False
        return dm_env.restart(seen)

    def step(self, action: Any) -> dm_env.TimeStep:
        if self._over:
            return self.reset()
        seen, reward, ended, late, self.info = self.env.step(action)
        self._over = ended or late
        step = dm_env.termination if ended else dm_env.truncation if late else dm_env.transition
        return step(float(reward), seen)

    def action_spec(self) -> Any:
        return spec_of(self.env.action_space, "action")

    def observation_spec(self) -> Any:
        return spec_of(self.env.observation_space, "observation")

    def close(self) -> None:
        self.env.close()


def spec_of(space: gymnasium.Space, name: str) -> Any:
    """The spec of a space, or a dict of specs; raises ValueError for spaces that specs cannot say."""
    if isinstance(space, spaces.Dict):
        return {key: spec_of(part, key) for key, part in space.items()}
    if isinstance(space, spaces.Discrete) and space.start == 0:
        return specs.DiscreteArray(int(space.n), space.dtype, name)
    if not isinstance(space, spaces.Box):
        raise ValueError(f"dm_env has no spec for {space} of {name!r}; choose other observations or actions")
    return specs.BoundedArray(space.shape, space.dtype, space.low, space.high, name)


def make(name: str = "embodied/Robot-v0", *, first: int = 0, **options: Any) -> DmEnv:
    """A registered environment, with its options; `first` is the seed of the first episode.

    Examples:
      >>> embodied.dm_env(task="bring", pictures="unlit", observations=()).action_spec().name
      'action'
    """
    return DmEnv(gymnasium.make(name, **options), first)
