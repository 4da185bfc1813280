"""A language model as an agent: at every step it is told what is there and names one of the actions."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from embodied.agents.language_models.client import Client
from embodied.agents.language_models.completions import Answer
from embodied.agents.language_models.telling import Teller, action_in, schema_of, told
from embodied.interface import Action, Actions, Move, Observation, Observations, Rngs, Stop, Thought

PATIENCE = 4
"""Answers in a row that are none, after which the agent stops."""


@dataclass
class _Trail:
    """What one episode's model is told of the past."""

    said: list[str] = field(default_factory=list)
    failures: int = 0


class LanguageModelAgent:
    """A `Policy`. An answer that is none moves on, straight ahead where that can be, and is counted."""

    def __init__(self, client: Client, teller: Teller | None = None) -> None:
        self._client, self._teller = client, teller or Teller()

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, Any]:
        trails = memory or [_Trail() for _ in observations]
        playing = [(o, i) for i, o in enumerate(observations) if o is not None]
        asked = [(self._teller.messages(o, trails[i].said), schema_of(o)) for o, i in playing]
        actions: Actions = [None] * len(observations)
        for (o, i), answer in zip(playing, self._client.ask_all(asked), strict=True):
            actions[i] = self._understood(o, answer, trails[i])
        return actions, trails

    def _understood(self, o: Observation, answer: Answer, trail: _Trail) -> Action:
        if answer.value is None:
            trail.failures += 1
            action, words = (Stop() if trail.failures >= PATIENCE else onward(o)), ""
        else:
            trail.failures = 0
            action, words = action_in(o, answer.value), str(answer.value["reason"])
        trail.said.append(told(o, action))
        return dataclasses.replace(action, thought=Thought(usage=self._client.usage(answer), words=words))


def onward(o: Observation) -> Action:
    """The first candidate that is allowed, which is the one nearest to straight ahead; stop where there is none."""
    allowed = np.flatnonzero(o.candidates.allowed)
    return Move(int(allowed[0])) if len(allowed) else Stop()
