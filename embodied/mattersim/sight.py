"""Viewpoints that can be walked to from a pose, in order, and how actions move it: rules of the Matterport3D simulator.

Viewpoint j is navigable when it is joined to the agent's and, with restricted navigation, lies within
vfov * width / height / 2 of the heading: a linear rule, not the picture's edge; elevation never restricts, and a
neighbour straight above or below is never within. Navigable viewpoints are sorted by
sqrt(rel_heading^2 + rel_elevation^2), the agent's own first (index 0: stay).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from embodied.mattersim.graphs import Graphs

HEADINGS = 12
VIEWS = 36
STEP = 2 * math.pi / HEADINGS
"""Radians between discretized headings."""
TILT = math.pi / 6
"""Radians between discretized elevations."""


class ViewPoint(NamedTuple):
    """A viewpoint as an agent sees it. Metres and radians, heading clockwise from +y."""

    viewpointId: str
    ix: int
    x: float
    y: float
    z: float
    rel_heading: float
    rel_elevation: float
    rel_distance: float


class NavigableLocations:
    """Navigable locations as the programs read them. Those of discretized poses are kept, since they recur."""

    def __init__(self, graphs: Graphs, half_field: float | None) -> None:
        """`half_field`: radians to either side that may be walked to; None is everywhere (unrestricted navigation)."""
        self.graphs, self.half_field = graphs, half_field
        self.view = functools.lru_cache(maxsize=100_000)(self._view)

    def _view(self, code: int) -> tuple[tuple[int, ...], tuple[ViewPoint, ...]]:
        """Rows and locations that can be walked to from a discretized pose, the agent's own first.

        Args:
          code: row * 36 + viewIndex.
        """
        graphs, (row, view) = self.graphs, divmod(code, VIEWS)
        heading, elevation = view % HEADINGS * STEP, (view // HEADINGS - 1) * TILT
        ax, ay = np.float32(np.cos(math.pi / 2 - heading)), np.float32(np.sin(math.pi / 2 - heading))
        x, y = graphs.offset[row].T
        rel_heading = np.arctan2(x * ay - y * ax, x * ax + y * ay).astype(float)
        rel_elevation = graphs.slope[row] - elevation
        keep = graphs.neighbours[row] >= 0
        if self.half_field is not None:
            unit = graphs.unit[row]
            with np.errstate(invalid="ignore"):
                keep &= (unit[:, 0] * ax + unit[:, 1] * ay).astype(float) >= math.cos(self.half_field)
        angle = np.where(keep, np.sqrt(rel_heading**2 + rel_elevation**2), np.inf)
        columns = np.argsort(angle, kind="stable")[: keep.sum()]  # the nearest to the middle of the view first
        rows = (row, *graphs.neighbours[row, columns].tolist())
        first = graphs.first[graphs.scans[row]]
        seen = np.column_stack([rel_heading, rel_elevation, graphs.distance[row]])[columns].tolist()
        places = zip(rows, graphs.positions[[*rows]].tolist(), ([0.0, 0.0, 0.0], *seen), strict=True)
        return rows, tuple(ViewPoint(graphs.ids[r], r - first, *xyz, *relative) for r, xyz, relative in places)


@functools.lru_cache(maxsize=64)
def lookout(graphs: Graphs, half_field: float | None) -> NavigableLocations:
    """The navigable locations of a graph and a camera, shared by all simulators that have them."""
    return NavigableLocations(graphs, half_field)


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


class DiscreteViews:
    """A batch of poses, each row * 36 + viewIndex.

    `start` puts every agent somewhere; `act` lets every agent move to one of its locations and then turn, and raises
    ValueError for an index that it does not have; the others tell the pose of one agent of the batch.
    """

    def __init__(self, lookout: NavigableLocations, steps: Callable[[float], float]) -> None:
        """Args:
        steps: turns a requested change into steps of 30 degrees.
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
                rows, agents = look(code)[0], len(self._codes)
                if not 0 <= k < len(rows):
                    raise ValueError(
                        f"MatterSim: Invalid action index: {k} in environment {agent} of {agents}; "
                        f"it has 0 to {len(rows) - 1}"
                    )
                row = rows[k]
            if h:
                at = view % HEADINGS
                view += heading_step(at * STEP + steps(h) * STEP) - at
            if e:
                tilt = view // HEADINGS - 1
                view += HEADINGS * (elevation_step(tilt * TILT + steps(e) * TILT) - tilt)
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
