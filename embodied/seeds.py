"""The one source of randomness: named generators derived from an integer seed."""

from __future__ import annotations

import hashlib
import operator
from typing import SupportsIndex

import numpy as np


def whole(seed: SupportsIndex) -> int:
    """A seed as Python's own integer, NumPy's included.

    Raises:
      TypeError: it is no whole number.
    """
    try:
        return operator.index(seed)
    except TypeError as e:
        raise TypeError(f"a seed should be a whole number, got {seed!r}; pass an integer such as 7") from e


def stream(seed: SupportsIndex, *names: str | int) -> np.random.Generator:
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
    """
    text = "\x1f".join([f"{whole(seed)}", *(f"{type(n).__name__}:{n}" for n in names)])
    words = np.frombuffer(hashlib.sha256(text.encode()).digest(), dtype="<u4")
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words.tolist())))
