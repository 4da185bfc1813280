"""Which description a simulated teacher gives (Eq 3.15, 3.16), apart from where its candidates come from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agents.iliad.protocol import NOTHING


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
