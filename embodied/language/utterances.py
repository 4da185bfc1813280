"""Sub-goals in people's words, where people have spoken of the same actions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from embodied.interface import FindObject, Language
from embodied.seeds import stream


@dataclass(frozen=True)
class Utterance:
    """Words of somebody and the primitive actions that were meant, without 'stop'."""

    words: tuple[str, ...]
    text: str


class PeoplesWords:
    """A `Language` with people's sub-goals where people meant the same actions, and another language's elsewhere."""

    def __init__(self, utterances: Iterable[Utterance], other: Language) -> None:
        self._other = other
        self._texts: defaultdict[tuple[str, ...], list[str]] = defaultdict(list)
        for u in utterances:
            self._texts[u.words].append(u.text)

    def request(self, goal: FindObject, *, rng: np.random.Generator) -> str:
        return self._other.request(goal, rng=rng)

    def route(self, world: Any, path: Sequence[int], yaw: float, *, rng: np.random.Generator) -> str:
        return self._other.route(world, path, yaw, rng=rng)

    def subgoal(self, words: Sequence[str]) -> str:
        """Of several people's words for these actions, always the same ones."""
        texts = self._texts.get(tuple(w for w in words if w != "stop"))
        if not texts:
            return self._other.subgoal(words)
        return texts[int(stream(0, "said", *words).integers(len(texts)))]
