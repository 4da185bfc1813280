"""Which description a simulated teacher gives (Eq 3.15, 3.16), apart from where its candidates come from."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from embodied.agents.iliad.protocol import Executions, Tasks, one_request


class DescribingNetworks(ABC):
    """Eq 3.15 and 3.16: a describer whose words count where an executor carries them out as the execution went.

    Of the candidates that pass, the likeliest is given, as in the authors' program (docs/sources.md, S93).
    """

    longest: int
    """Words of a description."""

    def __init__(self, candidates: int) -> None:
        self.candidates = candidates

    @abstractmethod
    def spoken_of(self, task: Any, execution: Any) -> bool:
        """True where there is anything to say."""

    @abstractmethod
    def near_optimal(self, task: Any, execution: Any) -> bool:
        """perf >= tau of Eq 3.15: people's own words describe it."""

    @abstractmethod
    def candidates_of(
        self, tasks: Tasks, executions: Executions, uniforms: np.ndarray | None = None
    ) -> list[list[str]]:
        """The likeliest description of each execution, or different ones sampled with `uniforms` (B, K, words)."""

    @abstractmethod
    def fits(self, cases: Sequence[tuple[Any, Any, str]]) -> list[bool]:
        """perf(e^d, e) >= tau of Eq 3.16: the executor, told d, does the same."""

    def describe(self, tasks: Tasks, executions: Executions, *, rng: np.random.Generator) -> list[str | None]:
        uniforms = rng.random((len(tasks), self.candidates - 1, self.longest))
        descriptions: list[str | None] = [None] * len(tasks)
        left = []
        for i, (task, execution) in enumerate(zip(tasks, executions, strict=True)):
            if self.spoken_of(task, execution):
                if self.near_optimal(task, execution):
                    descriptions[i] = one_request(task, rng=rng)
                else:
                    left.append(i)
        for sampled in (False, True)[: self.candidates]:
            if not left:
                break
            some, done = [tasks[i] for i in left], [executions[i] for i in left]
            several = self.candidates_of(some, done, uniforms[left] if sampled else None)
            fitting = iter(self.fits([(q, e, d) for q, e, many in zip(some, done, several) for d in many]))
            accepted = [[d for d in many if next(fitting)] for many in several]
            for i, good in zip(left, accepted, strict=True):
                descriptions[i] = (good[0] or None) if good else None
            left = [i for i, good in zip(left, accepted, strict=True) if not good]
        return descriptions
