"""Which viewpoints can be walked to from a pose, and in which order: the rule of the Matterport3D simulator.

Viewpoint j is navigable when it is joined to the agent's and, with restricted navigation, lies within
vfov * width / height / 2 of the heading: a linear rule, not the picture's edge; elevation never restricts, and a
neighbour straight above or below is never within. Navigable viewpoints are sorted by
sqrt(rel_heading^2 + rel_elevation^2), the agent's own first (index 0: stay).
"""

from __future__ import annotations

import functools
import math
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
