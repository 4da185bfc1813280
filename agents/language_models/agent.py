"""A language model as an agent, which is told at every step what is there and names one of the actions.

`Messages` is a Gymnasium wrapper for any player by messages.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from embodied.agents.language_models.client import Client
from embodied.agents.language_models.completions import Answer
from embodied.agents.language_models.observations import actions_by_name
from embodied.agents.language_models.prompts import PromptBuilder, action_in, action_in_words, schema_of
from embodied.gym.env import HelpGymEnv
from embodied.gym.spaces import number
from embodied.interface import Action, Actions, Move, Observation, Observations, Rngs, Stop, Thought

MOST_INVALID = 4
"""Invalid answers in a row after which the agent stops."""
LONGEST_PROMPT = 20_000
"""Characters of the text of an observation."""


@dataclass
class _EpisodeHistory:
    """The past of one episode."""

    actions: list[str] = field(default_factory=list)
    failures: int = 0


class LanguageModelAgent:
    """A `Policy`. An invalid answer moves on, straight ahead where that can be, and is counted."""

    def __init__(self, client: Client, builder: PromptBuilder | None = None) -> None:
        self._client, self._builder = client, builder or PromptBuilder()

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, Any]:
        histories = memory or [_EpisodeHistory() for _ in observations]
        playing = [(o, i) for i, o in enumerate(observations) if o is not None]
        asked = [(self._builder.messages(o, histories[i].actions), schema_of(o)) for o, i in playing]
        actions: Actions = [None] * len(observations)
        for (o, i), answer in zip(playing, self._client.ask_all(asked), strict=True):
            actions[i] = self._understood(o, answer, histories[i])
        return actions, histories

    def _understood(self, o: Observation, answer: Answer, history: _EpisodeHistory) -> Action:
        if answer.value is None:
            history.failures += 1
            action, words = (Stop() if history.failures >= MOST_INVALID else straight_on(o)), ""
        else:
            history.failures = 0
            action, words = action_in(o, answer.value), str(answer.value["reason"])
        history.actions.append(action_in_words(o, action))
        return dataclasses.replace(action, thought=Thought(usage=self._client.usage(answer), words=words))


def straight_on(o: Observation) -> Action:
    """The first candidate that is allowed, which is the one nearest to straight ahead; stop where there is none."""
    allowed = np.flatnonzero(o.candidates.allowed)
    return Move(int(allowed[0])) if len(allowed) else Stop()


class Messages(gym.Wrapper[str, str, dict[str, Any], Any]):
    """The observation is the text that a model is told; info holds 'messages' and 'schema' for its server.

    An action is one of the names in the text, such as 'go 0' or 'ask help'; any other word is an invalid action, as the
    environment counts them.
    """

    def __init__(self, env: gym.Env, builder: PromptBuilder | None = None) -> None:
        """
        Raises:
          ValueError: not an environment of this package.
        """
        super().__init__(env)
        if not isinstance(env.unwrapped, HelpGymEnv):
            raise ValueError(f"Messages wraps embodied/HANNA-v0 and its like, got {type(env.unwrapped).__name__}")
        self._inner, self._builder, self._history = env.unwrapped, builder or PromptBuilder(), list[str]()
        self.observation_space = spaces.Text(LONGEST_PROMPT, charset=frozenset(map(chr, range(9, 0x2100))))
        self.action_space = spaces.Text(300, charset=frozenset(map(chr, range(32, 127))))

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[str, dict[str, Any]]:
        _, info = self.env.reset(seed=seed, options=options)
        self._history = []
        return self._text(), self._facts(info)

    def step(self, action: str) -> tuple[str, Any, bool, bool, dict[str, Any]]:
        before, layout = self._inner.observed, self._inner.layout
        chosen = actions_by_name(before).get(action)
        env: Any = self.env
        _, reward, ended, cut, info = env.step(layout.actions if chosen is None else number(chosen, layout))
        if chosen is not None:
            self._history.append(action_in_words(before, chosen))
        return self._text(), reward, ended, cut, self._facts(info)

    def _text(self) -> str:
        return self._builder.text(self._inner.observed, self._history)

    def _facts(self, info: dict[str, Any]) -> dict[str, Any]:
        o = self._inner.observed
        return info | {"messages": self._builder.messages(o, self._history), "schema": schema_of(o)}
