"""Robot-v0 as a dm_env.Environment, for users of dm_control and Acme.

python examples/as_dm_env.py        # plays a few random actions in a flat
"""

from __future__ import annotations

from typing import Any

import dm_env
import gymnasium
import numpy as np
from dm_env import specs
from gymnasium import spaces

import embodied  # noqa: F401  registers the environments


class DmEnv(dm_env.Environment):
    """Any of our environments whose spaces are Boxes, and a Dict of them for what is seen."""

    def __init__(self, env: gymnasium.Env, *, seed: int = 0) -> None:
        self.env, self._seed, self._over = env, seed, True

    def reset(self) -> dm_env.TimeStep:
        seen, self.info = self.env.reset(seed=self._seed)
        self._seed, self._over = self._seed + 1, False
        return dm_env.restart(seen)

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        if self._over:
            return self.reset()
        seen, reward, ended, late, self.info = self.env.step(action)
        self._over = ended or late
        if ended:
            return dm_env.termination(float(reward), seen)
        return dm_env.truncation(float(reward), seen) if late else dm_env.transition(float(reward), seen)

    def action_spec(self) -> Any:
        return spec_of(self.env.action_space, "action")

    def observation_spec(self) -> Any:
        assert isinstance(self.env.observation_space, spaces.Dict)
        return {name: spec_of(space, name) for name, space in self.env.observation_space.items()}

    def close(self) -> None:
        self.env.close()


def spec_of(space: gymnasium.Space, name: str) -> specs.BoundedArray:
    """The spec of a Box."""
    assert isinstance(space, spaces.Box)
    return specs.BoundedArray(space.shape, space.dtype, space.low, space.high, name)


if __name__ == "__main__":
    env = DmEnv(gymnasium.make("embodied/Robot-v0", pictures="unlit", observations=()))
    rng, spec = np.random.default_rng(0), env.action_spec()
    step = env.reset()
    for _ in range(20):
        step = env.step(rng.uniform(spec.minimum, spec.maximum).astype(spec.dtype))
    print(env.info["request"], step.reward, {name: value.shape for name, value in step.observation.items()})
