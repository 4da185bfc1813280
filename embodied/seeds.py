"""The one source of randomness: named generators derived from an integer seed."""

from __future__ import annotations

import hashlib
import operator

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
