"""A language model that rates a walk (BANDIT's rater) or describes it (ILIAD's teacher)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from embodied.agents.language_models.client import Client
from embodied.agents.language_models.completions import object_schema
from embodied.agents.language_models.prompts import read_prompt
from embodied.agents.language_models.words import walk_in_words
from embodied.interface import SeenPlace, Usage

STARS = 5
RATING = object_schema(stars={"type": "integer", "minimum": 1, "maximum": STARS})
DESCRIPTION = object_schema(description={"type": "string", "maxLength": 800})


class ModelJudge:
    """Rates and describes; counts what it asked in `usage`."""

    def __init__(self, client: Client, prompts: Path | None = None) -> None:
        """`prompts`: folder with a judge.md or describe.md of one's own."""
        self._client, self.usage = client, Usage()
        self._judge = read_prompt("judge", ("instruction", "walk"), prompts)
        self._describe = read_prompt("describe", ("walk",), prompts)

    def rate(self, world: SeenPlace, instruction: str, path: Sequence[int], yaw: float) -> float | None:
        """How well a walk carries out an instruction, 0 to 1 in steps of a star; None where the answer is none.

        Args:
          path: nodes; `yaw` is the first direction, radians.
        """
        walk = walk_in_words(world, path, yaw)
        answer = self._client.ask(self._judge.messages(instruction=instruction, walk=walk), RATING)
        self.usage += self._client.usage(answer)
        return None if answer.value is None else (int(answer.value["stars"]) - 1) / (STARS - 1)

    def describe(self, world: SeenPlace, path: Sequence[int], yaw: float, *, rng: np.random.Generator) -> str:
        """One description of a walk, as embodied.language.RouteDescriber gives; '' where the answer is none."""
        answer = self._client.ask(self._describe.messages(walk=walk_in_words(world, path, yaw)), DESCRIPTION)
        self.usage += self._client.usage(answer)
        return "" if answer.value is None else str(answer.value["description"])
