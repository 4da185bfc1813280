"""Which description a simulated teacher gives (Eq 3.15, 3.16), apart from where its candidates come from."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from embodied.agents.iliad.protocol import NOTHING, Executions, Tasks, one_request


def kept(candidates: Sequence[str], performances: Sequence[float], threshold: float) -> list[str]:
    """D_prag of Eq 3.16: the different candidates whose own execution is near enough to the described one, in order."""
    good = [d for d, p in zip(candidates, performances, strict=True) if p >= threshold]
    return list(dict.fromkeys(good))


def by_the_text(pragmatic: Sequence[str], *, rng: np.random.Generator) -> str:
    """Eq 3.15, below: Unif(D_prag and the empty description)."""
    choices = [*pragmatic, NOTHING]
    return choices[int(rng.integers(len(choices)))]


def by_the_program(pragmatic: Sequence[str]) -> str:
    """The authors' program: the first that passed, the likeliest one before the sampled ones, or nothing
    (docs/sources.md, S93)."""
    return pragmatic[0] if pragmatic else NOTHING


class DescribingNetworks(ABC):
    """Eq 3.15 and 3.16: a describer whose words count where an executor carries them out as the execution went."""

    threshold: float
    """Tau: from which performance on a description fits."""
    longest: int
    """Words of a description."""

    def __init__(self, candidates: int, pragmatics: str) -> None:
        self.candidates, self.pragmatics = candidates, pragmatics

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
    def performances(self, cases: Sequence[tuple[Any, Any, str]]) -> list[float]:
        """perf(e^d, e): how nearly the executor, told d, does the same."""

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
        pragmatic_of_left = self._pragmatic([tasks[i] for i in left], [executions[i] for i in left], uniforms[left])
        for i, pragmatic in zip(left, pragmatic_of_left, strict=True):
            text = by_the_text(pragmatic, rng=rng) if self.pragmatics == "text" else by_the_program(pragmatic)
            descriptions[i] = text or None
        return descriptions

    def _pragmatic(self, tasks: Tasks, executions: Executions, uniforms: np.ndarray) -> list[list[str]]:
        """D_prag of each execution, the likeliest description first; of the program's rule, which wants the first one
        only, no more than that."""
        if not tasks:
            return []
        accepted = self._kept(tasks, executions, self.candidates_of(tasks, executions))
        rest = [i for i in range(len(tasks)) if self.pragmatics == "text" or not accepted[i]]
        if rest and self.candidates > 1:
            some, those = [tasks[i] for i in rest], [executions[i] for i in rest]
            several = self._kept(some, those, self.candidates_of(some, those, uniforms[rest]))
            for i, more in zip(rest, several):
                accepted[i] = list(dict.fromkeys([*accepted[i], *more]))
        return accepted

    def _kept(self, tasks: Tasks, executions: Executions, several: Sequence[Sequence[str]]) -> list[list[str]]:
        """Those that the executor carries out as the execution went."""
        cases = [(q, e, d) for q, e, many in zip(tasks, executions, several) for d in many]
        scores = iter(self.performances(cases))
        return [kept(many, [next(scores) for _ in many], self.threshold) for many in several]


class EachDescribed(ABC):
    """A teacher who describes execution by execution."""

    @abstractmethod
    def one(self, task: Any, execution: Any, *, rng: np.random.Generator) -> str | None:
        """A description of what was done; None where there is nothing to say."""

    def describe(self, tasks: Tasks, executions: Executions, *, rng: np.random.Generator) -> list[str | None]:
        return [self.one(q, e, rng=rng) for q, e in zip(tasks, executions, strict=True)]
