"""A language model as an agent, which is told at every step what is there and names one of the actions."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from embodied.agents.language_models.client import Client
from embodied.agents.language_models.completions import Answer
from embodied.agents.language_models.prompts import PromptBuilder, action_in, action_in_words, schema_of
from embodied.interface import Action, Actions, Move, Observation, Observations, Rngs, Stop, Thought

MOST_INVALID = 4
"""Invalid answers in a row after which the agent stops."""


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
