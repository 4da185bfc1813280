"""An observation in words: what is seen, where one can go, what can be done. No word tells one place from another."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

from embodied.assistants.words import side
from embodied.geometry import wrap
from embodied.interface import STEP, Action, Ask, Move, Observation, SeenPlace, Sight, Stop, viewpoint

MOST_NAMES = 12
"""Things that are named of one place."""
SMALLEST_SIGHTING = 20
"""Fewest pixels of a sighting (of 24576 around) of what is named."""


class Namer(Protocol):
    """Names what can be seen of a sight; a stand-in for eyes, and an oracle."""

    def names(self, sight: Sight) -> Sequence[tuple[str, float, float]]:
        """(object class, yaw in radians, metres), the largest in view first."""


class SeenNames:
    """The true names of what can be seen: an oracle in place of pictures."""

    def __init__(self, worlds: Mapping[str, SeenPlace]) -> None:
        self._worlds = worlds

    def names(self, sight: Sight) -> list[tuple[str, float, float]]:
        here = viewpoint(sight)
        seen = self._worlds[here.world].sightings(here.node)
        return [(s.object_class, s.yaw, s.distance) for s in seen if s.pixels >= SMALLEST_SIGHTING][:MOST_NAMES]


def actions_of(o: Observation) -> dict[str, Action]:
    """Every possible action by the name that a model calls it by."""
    c = o.candidates
    moves: dict[str, Action] = {
        (c.words[i] if c.words else f"go {i}"): Move(i) for i in range(len(c)) if bool(c.allowed[i])
    }
    return {**moves, **{f"ask {i.value}": Ask(i) for i in o.can_ask}, "stop": Stop()}


def ways(o: Observation, names: Sequence[tuple[str, float, float]] = ()) -> str:
    """The candidates: 'go 0: straight ahead, towards the sofa; go 1: ...'."""
    if o.candidates.words:
        return ", ".join(w for w, ok in zip(o.candidates.words, o.candidates.allowed) if ok)
    yaw, said = o.turn * STEP, []
    for i, bearing in enumerate(o.candidates.bearing):
        off = [(abs(float(wrap(y - yaw - bearing))), name) for name, y, _ in names]
        towards = f", towards the {min(off)[1]}" if off and min(off)[0] < STEP / 2 else ""
        slope = float(o.candidates.slope[i])
        stairs = "" if abs(slope) < math.radians(15) else f", {'up' if slope > 0 else 'down'} the stairs"
        said.append(f"go {i}: {side(float(bearing))}{towards}{stairs}")
    return "; ".join(said) or "nowhere"


def sees(o: Observation, names: Sequence[tuple[str, float, float]] = ()) -> str:
    """What the observation tells of the place: names, and what its kind of task adds."""
    yaw = o.turn * STEP
    parts = [f"{name} ({side(y - yaw)}, {d:.0f} m)" for name, y, d in names]
    if o.extras is not None:
        parts += o.extras.lines(o.turn)
    return "; ".join(parts) or "nothing that has a name"
