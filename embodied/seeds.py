"""The one source of randomness: named generators derived from an integer seed. And what is kept from learning."""

import hashlib
import operator
from collections.abc import Collection, Iterable, Sequence
from typing import TypeVar

import numpy as np


def checked_seed(seed: object) -> int:
    """`seed` as a plain integer; NumPy's integers are, too.

    Raises:
      TypeError: a text, a number with a point, None.
    """
    try:
        return operator.index(seed)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"a seed should be an integer, got {seed!r:.60} ({type(seed).__name__})") from None


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """The generator that belongs to `names` under `seed`.

    The same arguments give the same draws in every process and on every machine; different
    names give independent streams, so adding a consumer never shifts another one's draws.

    Args:
      seed: any integer, negative ones included.
      names: what the draws are for, e.g. stream(7, "house", 3, "layout").

    Returns:
      A fresh PCG64 generator.

    Raises:
      TypeError: a seed that is no whole number.

    Examples:
      >>> int(embodied.stream(7, 'house', 3).integers(100))
      31
    """
    text = "\x1f".join([f"{checked_seed(seed):d}", *(f"{type(n).__name__}:{n}" for n in names)])
    words = np.frombuffer(hashlib.sha256(text.encode()).digest(), dtype="<u4")
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words.tolist())))


T = TypeVar("T")
FAMILIAR, NOVEL = "familiar", "novel"
NOVELTIES = (FAMILIAR, NOVEL)
"""Of models, looks, words and templates: data sets with houses out of distribution (`test_ood`) build all others of
'familiar' things, and those of 'novel' ones, which are kept from learning. None: all there is may be used."""
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
