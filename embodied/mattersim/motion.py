"""How agents move and turn, in batches and in steps of 30 degrees."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from embodied.mattersim.sight import HEADINGS, STEP, TILT, VIEWS, NavigableLocations, ViewPoint


def heading_step(heading: float) -> int:
    """The discretized heading 0..11 nearest to an angle, radians; halves round up, as lround does."""
    return math.floor(normal(heading) / STEP + 0.5) % HEADINGS


def elevation_step(elevation: float) -> int:
    """-1, 0 or 1: beyond 15 degrees the camera looks 30 degrees down or up."""
    return -1 if elevation < -TILT / 2 else 1 if elevation > TILT / 2 else 0


def normal(heading: float) -> float:
    """The heading in [0, 2 pi)."""
    heading = math.fmod(heading, 2 * math.pi)
    if heading < 0.0:
        heading += 2 * math.pi
    return heading if heading < 2 * math.pi else 0.0


def sign_steps(change: float) -> int:
    """Upstream: only the sign counts."""
    return int(change > 0) - int(change < 0)


def counted_steps(change: float) -> float:
    """HANNA's fork: the change is a number of steps."""
    return change


class DiscreteViews:
    """A batch of poses, each row * 36 + viewIndex.

    `start` puts every agent somewhere; `act` lets every agent move to one of its locations and then turn, and raises
    ValueError for an index that it does not have; the others tell the pose of one agent of the batch.
    """

    def __init__(self, lookout: NavigableLocations, steps: Callable[[float], float]) -> None:
        """Args:
        steps: turns a requested change into steps of 30 degrees, `sign_steps` or `counted_steps`.
        """
        self.lookout, self._steps = lookout, steps
        self._codes: list[int] = []

    @property
    def started(self) -> bool:
        """True once agents stand somewhere."""
        return bool(self._codes)

    def start(self, rows: Sequence[int], headings: Sequence[float], elevations: Sequence[float]) -> None:
        self._codes = [
            row * VIEWS + HEADINGS * (elevation_step(e) + 1) + heading_step(h)
            for row, h, e in zip(rows, headings, elevations, strict=True)
        ]

    def act(self, index: Sequence[int], heading: Sequence[float], elevation: Sequence[float]) -> None:
        steps, look, codes = self._steps, self.lookout.view, []
        for agent, (code, k, h, e) in enumerate(zip(self._codes, index, heading, elevation, strict=True)):
            row, view = divmod(code, VIEWS)
            if k:
                row = _chosen(look(code)[0], k, agent, len(self._codes))
            if h:
                view += _turned(view % HEADINGS, steps(h)) - view % HEADINGS
            if e:
                view += HEADINGS * (_tilted(view // HEADINGS - 1, steps(e)) + 1 - view // HEADINGS)
            codes.append(row * VIEWS + view)
        self._codes = codes

    def row(self, agent: int) -> int:
        """Row of its viewpoint in the graphs."""
        return self._codes[agent] // VIEWS

    def here(self, agent: int) -> ViewPoint:
        return self.lookout.view(self._codes[agent])[1][0]

    def locations(self, agent: int) -> tuple[ViewPoint, ...]:
        return self.lookout.view(self._codes[agent])[1]

    def heading(self, agent: int) -> float:
        return self._codes[agent] % HEADINGS * STEP

    def elevation(self, agent: int) -> float:
        return (self._codes[agent] % VIEWS // HEADINGS - 1) * TILT

    def view(self, agent: int) -> int:
        return self._codes[agent] % VIEWS


def _chosen(rows: tuple[int, ...], k: int, agent: int, agents: int) -> int:
    if not 0 <= k < len(rows):
        raise ValueError(
            f"MatterSim: Invalid action index: {k} in environment {agent} of {agents}; it has 0 to {len(rows) - 1}"
        )
    return rows[k]


def _turned(at: int, steps: float) -> int:
    if isinstance(steps, int):
        return (at + steps) % HEADINGS
    return heading_step(at * STEP + steps * STEP)


def _tilted(at: int, steps: float) -> int:
    if isinstance(steps, int):
        return max(-1, min(1, at + steps))
    return elevation_step(at * TILT + steps * TILT)
