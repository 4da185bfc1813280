"""The random numbers of the C++ simulator, so that its random starts are ours: libstdc++'s default engine.

It is x -> 16807 x mod (2^31 - 1) (Park and Miller 1988), and libstdc++ turns its numbers into integers by rejection
and into floats by two draws. Not for anything else: it is a poor generator; the rest of the package draws from
`embodied.seeds`.
"""

from __future__ import annotations

MODULUS = 2**31 - 1
MULTIPLIER = 16807
RANGE = MODULUS - 2
"""The largest number less the smallest."""


class Engine:
    """std::default_random_engine of libstdc++."""

    def __init__(self, seed: int = 1) -> None:
        self._state = seed % MODULUS or 1

    def _draw(self) -> int:
        """0 to RANGE."""
        self._state = self._state * MULTIPLIER % MODULUS
        return self._state - 1

    def below(self, n: int) -> int:
        """std::uniform_int_distribution over 0 to n - 1."""
        scale = RANGE // n
        while (drawn := self._draw()) >= n * scale:
            pass
        return drawn // scale

    def uniform(self) -> float:
        """std::uniform_real_distribution over [0, 1)."""
        low = self._draw()
        return (low + self._draw() * (RANGE + 1)) / (RANGE + 1) ** 2
