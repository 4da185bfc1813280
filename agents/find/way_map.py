"""WayMap: the places an agent has seen in one episode and the ways between them, known again by what they look like."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from embodied.agents.hanna.topological_map import SAME_PLACE, fewest_moves, matches
from embodied.geometry import wrap
from embodied.interface import Observation

ALIKE = 0.05
"""Radians by which two directions of one way may differ."""


def directions(o: Observation) -> np.ndarray:
    """(n,) in which absolute direction each candidate lies, radians."""
    return o.candidates.bearing + o.turn * math.pi / 6


@dataclass
class Spot:
    """One place on the map."""

    ways: np.ndarray
    """(n,) absolute directions of the ways that begin here, radians."""
    leads: list[int | None]
    """The spot at which each way ends; None for a way that was not tried."""

    def goes(self, ways: np.ndarray) -> bool:
        """True if its ways go in these directions."""
        if len(ways) != len(self.ways):
            return False
        return bool((np.abs(wrap(self.ways[:, None] - ways)).min(0) <= ALIKE).all())

    def way(self, direction: float) -> int | None:
        """The way in a direction; None without one."""
        off = np.abs(wrap(self.ways - direction))
        best = int(off.argmin())
        return best if off[best] <= ALIKE else None


@dataclass
class WayMap:
    """Owns what one episode knows of its house; spots are numbered as they were met."""

    spots: list[Spot] = field(default_factory=list)
    here: int = 0
    _looks: np.ndarray | None = None
    _begun: tuple[int, int] | None = None

    def arrive(self, o: Observation, panorama: np.ndarray) -> bool:
        """Note where a step begins; whether the spot is new.

        Args:
          panorama: (36, D) features, by which a spot is known again; zeros are never known.
        """
        ways = directions(o)
        known = self._known(panorama, ways)
        new = known is None
        if known is None:
            known = len(self.spots)
            self.spots.append(Spot(ways, [None] * len(ways)))
            self._looks = panorama[None] if self._looks is None else np.concatenate([self._looks, panorama[None]])
        if self._begun is not None:
            origin, way = self._begun
            self.spots[origin].leads[way] = known
            back = self.spots[known].way(float(self.spots[origin].ways[way]) + math.pi)
            if back is not None:
                self.spots[known].leads[back] = origin
        self.here, self._begun = known, None
        return new

    def leave(self, way: int) -> None:
        """Note that the step ends along a way of this spot."""
        self._begun = self.here, way

    def reach(self) -> dict[int, tuple[int, int | None]]:
        """How many known moves lead from here to each spot, and along which way they begin."""
        known = lambda spot: ((way, end) for way, end in enumerate(self.spots[spot].leads) if end is not None)
        return fewest_moves(self.here, known)

    def _known(self, panorama: np.ndarray, ways: np.ndarray) -> int | None:
        """The spot that looks the same, of those whose ways go in the same directions."""
        alike = [k for k, spot in enumerate(self.spots) if spot.goes(ways)]
        if not alike or self._looks is None:
            return None
        mean = (self._looks.sum((0, 1)) + panorama.sum(0)) / ((len(self._looks) + 1) * len(panorama))
        scores = matches(panorama, self._looks[alike], mean, turned=False)
        best = int(scores.argmax())
        return alike[best] if scores[best] >= SAME_PLACE else None
