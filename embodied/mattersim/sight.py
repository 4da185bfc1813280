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
from dataclasses import dataclass
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


@dataclass(frozen=True, eq=False)
class Bearings:
    """The navigable viewpoints of n poses. (n, D) arrays; of a row the first `count` columns hold."""

    rows: np.ndarray
    """Rows in Graphs, the nearest to the middle of the view first; the agent's own is left out."""
    count: np.ndarray
    """(n,) how many there are."""
    heading: np.ndarray
    """Radians from the agent's heading, right is positive."""
    elevation: np.ndarray
    """Radians from the agent's elevation."""
    distance: np.ndarray
    """Metres, in space."""

    @functools.cached_property
    def lists(self) -> tuple[list, ...]:
        """Rows, counts, headings, elevations and distances as lists, which are read one by one ten times as fast."""
        return tuple(a.tolist() for a in (self.rows, self.count, self.heading, self.elevation, self.distance))


class NavigableLocations:
    """Navigable locations as the programs read them. Those of discretized poses are kept, since they recur."""

    def __init__(self, graphs: Graphs, half_field: float | None) -> None:
        """`half_field`: radians to either side that may be walked to; None is everywhere (unrestricted navigation)."""
        self.graphs, self.half_field = graphs, half_field
        self.view = functools.lru_cache(maxsize=100_000)(self._view)
        self._around = functools.lru_cache(maxsize=4096)(self._look_around)
        self.here = functools.lru_cache(maxsize=100_000)(self._here)
        self._points: list[tuple[float, float, float]] = [(x, y, z) for x, y, z in graphs.positions.tolist()]

    def _here(self, row: int) -> ViewPoint:
        """The agent's own viewpoint."""
        graphs = self.graphs
        x, y, z = self._points[row]
        return ViewPoint(graphs.ids[row], row - graphs.first[graphs.scans[row]], x, y, z, 0.0, 0.0, 0.0)

    def _view(self, code: int) -> tuple[tuple[int, ...], tuple[ViewPoint, ...]]:
        """Rows and locations that can be walked to from a discretized pose, its own first.

        Args:
          code: row * 36 + viewIndex.
        """
        row, view = divmod(code, VIEWS)
        return self.locations(row, self._around(row), view)

    def _look_around(self, row: int) -> Bearings:
        views = np.arange(VIEWS)
        return self.bearings(np.full(VIEWS, row), views % HEADINGS * STEP, (views // HEADINGS - 1) * TILT)

    def bearings(self, rows: np.ndarray, heading: np.ndarray, elevation: np.ndarray) -> Bearings:
        """The navigable viewpoints of n poses.

        Args:
          rows: (n,) rows of the agents' viewpoints.
          heading: (n,) radians clockwise from +y.
          elevation: (n,) radians above the horizon.
        """
        graphs = self.graphs
        neighbours = graphs.neighbours[rows]
        ahead = np.stack([np.cos(math.pi / 2 - heading), np.sin(math.pi / 2 - heading)], axis=-1).astype(np.float32)
        x, y = graphs.offset[rows, :, 0], graphs.offset[rows, :, 1]
        ax, ay = ahead[:, None, 0], ahead[:, None, 1]
        rel_heading = np.arctan2(x * ay - y * ax, x * ax + y * ay).astype(float)
        rel_elevation = graphs.slope[rows] - elevation[:, None]
        keep = neighbours >= 0
        if self.half_field is not None:
            unit = graphs.unit[rows]
            with np.errstate(invalid="ignore"):
                keep &= (unit[..., 0] * ax + unit[..., 1] * ay).astype(float) >= math.cos(self.half_field)
        angle = np.where(keep, np.sqrt(rel_heading**2 + rel_elevation**2), np.inf)
        order = np.argsort(angle, axis=1, kind="stable")

        def sort(values: np.ndarray) -> np.ndarray:
            return np.take_along_axis(values, order, axis=1)

        return Bearings(
            sort(neighbours), keep.sum(1), sort(rel_heading), sort(rel_elevation), sort(graphs.distance[rows])
        )

    def locations(self, row: int, seen: Bearings, at: int) -> tuple[tuple[int, ...], tuple[ViewPoint, ...]]:
        """Rows and locations of pose number `at` in `seen`, which is at `row`."""
        rows, counts, headings, elevations, distances = seen.lists
        count, ids, points = counts[at], self.graphs.ids, self._points
        first = self.graphs.first[self.graphs.scans[row]]
        rows = rows[at][:count]
        others = []
        for r, h, e, d in zip(rows, headings[at], elevations[at], distances[at], strict=False):  # these are padded
            x, y, z = points[r]
            others.append(ViewPoint(ids[r], r - first, x, y, z, h, e, d))
        return (row, *rows), (self.here(row), *others)


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
