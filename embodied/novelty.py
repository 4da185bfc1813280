"""Parts of the world that are kept from learning, for evaluation out of distribution: models, looks, words, templates.

Data sets with houses out of distribution (`test_ood`) build all others of 'familiar' things, and those of 'novel'
ones. Where nobody asks, novelty is None and all there is may be used.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import TypeVar

from embodied.seeds import stream

T = TypeVar("T")
FAMILIAR, NOVEL = "familiar", "novel"
NOVELTIES = (FAMILIAR, NOVEL)
SHARE = 0.25
"""Of several alternatives, how many are novel."""
FEWEST = 4
"""Fewer alternatives than these are not divided: one of two toilets does not fit every house."""


def novel_among(names: Iterable[str]) -> frozenset[str]:
    """A quarter of several alternatives; nothing where they are fewer than FEWEST.

    It depends on the names alone: not on their order, the seed of a data set or the process.
    """
    known = sorted(set(names))
    if len(known) < FEWEST:
        return frozenset()
    drawn = sorted(known, key=lambda name: float(stream(0, NOVEL, name).random()))
    return frozenset(drawn[: round(SHARE * len(known))])


def of_novelty(items: Sequence[T], novel: Collection[T], novelty: str | None) -> Sequence[T]:
    """Those of `items` that are of this novelty; all of them for None, and where there are no such."""
    if novelty is None:
        return items
    return [x for x in items if (x in novel) == (novelty == NOVEL)] or items


def check_novelty(novelty: str | None) -> None:
    """Refuse an unknown one.

    Raises:
      ValueError: neither None nor one of NOVELTIES.
    """
    if novelty not in (None, *NOVELTIES):
        raise ValueError(f"novelty should be None or one of {NOVELTIES}, got {novelty!r}")
