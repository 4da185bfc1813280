"""Trail: the map that an agent draws of where it has been, from what it saw and which way it walked.

The likeliest move of an agent that misread its words leads to and fro between the same few places. With a trail it
knows which of its moves lead towards where it has been, under the words that it still follows, and how often it was
there; never more than it has walked itself. A place is known again by its panorama; the way back lies opposite the way
there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from agents.hanna.percept import HEADINGS, VIEWS
from embodied.interface import Action, Move, Observation, Sight


@dataclass(frozen=True)
class Trail:
    """What one episode knows of its way so far; directions are views, 0..35, which keep neighbours apart by 30 degrees
    only: whatever lies in the same view as a place that was visited counts as leading there (docs/sources.md, S36)."""

    leads: Mapping[tuple[Sight, int], Sight] = field(default_factory=dict)
    """Where the last move in a view from a place led, in either direction."""
    visits: Mapping[tuple[Sight, str], int] = field(default_factory=dict)
    """How many steps began at a place under these words."""
    begun: tuple[Sight, int] | None = None
    """The last move, which led to where the next step begins."""

    def here(self, observation: Observation) -> Trail:
        """The trail when a step begins: where the last move led, and one visit more."""
        o, leads = observation, dict(self.leads)
        if self.begun is not None:
            origin, view = self.begun
            leads[self.begun] = o.sight
            leads[o.sight, opposite(view)] = origin
        key = o.sight, o.instruction
        return Trail(leads, {**self.visits, key: self.visits.get(key, 0) + 1})

    def left(self, observation: Observation, action: Action | None) -> Trail:
        """The trail when a step ends with `action`."""
        if not isinstance(action, Move):
            return self
        return dataclasses.replace(self, begun=(observation.sight, int(observation.candidates.view[action.candidate])))

    def times(self, observation: Observation) -> np.ndarray:
        """(n,) how often the agent was, under these words, where each candidate's view is known to lead."""
        o = observation
        ends = [self.leads.get((o.sight, view)) for view in o.candidates.view.tolist()]
        return np.array([0 if end is None else self.visits.get((end, o.instruction), 0) for end in ends])


def opposite(view: int) -> int:
    """The view behind: half a turn on, and as far below the horizon as the other is above."""
    turn, tilt = view % HEADINGS, view // HEADINGS
    return (turn + HEADINGS // 2) % HEADINGS + (VIEWS // HEADINGS - 1 - tilt) * HEADINGS
