"""A Gymnasium wrapper for players by messages: observations become messages, actions are called by their names."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
from gymnasium import spaces

from embodied.agents.language_models.telling import Teller, schema_of, told
from embodied.agents.language_models.words import actions_of
from embodied.gym.env import HelpGymEnv
from embodied.gym.spaces import number

LONGEST = 20_000
"""Characters of a text."""


class Messages(gym.Wrapper[str, str, dict[str, Any], Any]):
    """The observation is the text that a model is told; info holds 'messages' and 'schema' for its server.

    An action is one of the names in the text, such as 'go 0' or 'ask help'; any other word is an invalid action, as the
    environment counts them.
    """

    def __init__(self, env: gym.Env, teller: Teller | None = None) -> None:
        """
        Raises:
          ValueError: not an environment of this package.
        """
        super().__init__(env)
        if not isinstance(env.unwrapped, HelpGymEnv):
            raise ValueError(f"Messages wraps embodied/HANNA-v0 and its like, got {type(env.unwrapped).__name__}")
        self._inner, self._teller, self._said = env.unwrapped, teller or Teller(), list[str]()
        self.observation_space = spaces.Text(LONGEST, charset=frozenset(map(chr, range(9, 0x2100))))
        self.action_space = spaces.Text(300, charset=frozenset(map(chr, range(32, 127))))

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[str, dict[str, Any]]:
        _, info = self.env.reset(seed=seed, options=options)
        self._said = []
        return self._text(), self._facts(info)

    def step(self, action: str) -> tuple[str, Any, bool, bool, dict[str, Any]]:
        before, layout = self._inner.observed, self._inner.layout
        chosen = actions_of(before).get(action)
        env: Any = self.env
        _, reward, ended, cut, info = env.step(layout.actions if chosen is None else number(chosen, layout))
        if chosen is not None:
            self._said.append(told(before, chosen))
        return self._text(), reward, ended, cut, self._facts(info)

    def _text(self) -> str:
        return self._teller.text(self._inner.observed, self._said)

    def _facts(self, info: dict[str, Any]) -> dict[str, Any]:
        o = self._inner.observed
        return info | {"messages": self._teller.messages(o, self._said), "schema": schema_of(o)}
