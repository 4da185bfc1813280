"""Graphs: the navigation graphs of a folder of Matterport connectivity files, as arrays over all viewpoints; and the
viewpoints that can be walked to from a pose, in order, and how actions move it: rules of the Matterport3D simulator.

A viewpoint is a row; the rows of a scan follow each other in the order of its file, so that a row less the scan's
first row is the `ix` of the format, which counts excluded viewpoints too.

Viewpoint j is navigable when it is joined to the agent's and, with restricted navigation, lies within
vfov * width / height / 2 of the heading: a linear rule, not the picture's edge; elevation never restricts, and a
neighbour straight above or below is never within. Navigable viewpoints are sorted by
sqrt(rel_heading^2 + rel_elevation^2), the agent's own first (index 0: stay).
"""

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from embodied.interface import STEP, TURNS, VIEWS
from embodied.navigation.connectivity import viewpoints_of


@dataclass(frozen=True, eq=False)
class Graphs:
    """Viewpoints of one or more scans and the edges between them. All arrays share the row; D is the largest degree."""

    first: Mapping[str, int]
    """Scan to its first row."""
    size: Mapping[str, int]
    """Scan to its number of viewpoints."""
    scans: tuple[str, ...]
    """Scan of each row."""
    ids: tuple[str, ...]
    """Viewpoint id of each row."""
    positions: np.ndarray
    """(m, 3) float32 metres, world: the simulator keeps no more digits."""
    turned: np.ndarray
    """(m,) bool: the camera's pose is turned, as in scans; those of our exports are upright and look along the axes."""
    included: np.ndarray
    """(m,) bool."""
    neighbours: np.ndarray
    """(m, D) rows that can be walked to, ascending, padded with -1."""
    offset: np.ndarray
    """(m, D, 2) float32 metres east and north to each neighbour."""
    unit: np.ndarray
    """(m, D, 2) float32: the same, of length 1; NaN for a neighbour straight above or below."""
    slope: np.ndarray
    """(m, D) float64 radians above the horizon."""
    distance: np.ndarray
    """(m, D) float64 metres, in space."""

    def row(self, scan: str, viewpoint: str) -> int:
        """Row of a viewpoint.

        Raises:
          IndexError: an unknown scan, as there.
          ValueError: an unknown or an excluded viewpoint, as there.
        """
        if scan not in self.first:
            raise IndexError(f"MatterSim: there is no scan {scan!r}; scans.txt names {len(self.first)} others")
        row = self._rows.get((scan, viewpoint))
        if row is None:
            raise ValueError(f"MatterSim: Could not find viewpointId: {viewpoint}, is viewpoint id valid?")
        if not self.included[row]:
            raise ValueError(f"MatterSim: ViewpointId: {viewpoint}, is excluded from the connectivity graph.")
        return row

    @functools.cached_property
    def _rows(self) -> dict[tuple[str, str], int]:
        keys = list(zip(self.scans, self.ids, strict=True))
        return {keys[row]: row for row in reversed(range(len(keys)))}  # of equal ids the first counts


def listed_scans(folder: str) -> tuple[str, ...]:
    """The scans that `folder`/scans.txt names.

    Raises:
      ValueError: there is no such file, as there.
    """
    path = Path(folder) / "scans.txt"
    try:
        return tuple(path.read_text(encoding="utf-8").split())
    except OSError as e:
        raise ValueError(f"MatterSim: Could not open list of scans at: {path}, is path valid?") from e


@functools.lru_cache(maxsize=512)
def load_graphs(folder: str, scans: tuple[str, ...]) -> Graphs:
    """Read the connectivity files of some scans; kept, since a hundred simulators may want the same.

    Raises:
      ValueError: a file is missing, as there, or none of the format: says which viewpoint.
    """
    items = [(scan, item) for scan in scans for item in _read(Path(folder) / f"{scan}_connectivity.json")]
    sizes = {scan: sum(s == scan for s, _ in items) for scan in scans}
    first, at = {}, 0
    for scan in scans:
        first[scan], at = at, at + sizes[scan]
    poses = np.array([item["pose"] for _, item in items], np.float32).reshape(-1, 4, 4)
    included = np.array([bool(item["included"]) for _, item in items], bool)
    near = ((first[scan], row, item["unobstructed"]) for row, (scan, item) in enumerate(items))
    joined = (
        [n + j for j, open_ in enumerate(ways) if open_ and n + j != row and included[n + j]] for n, row, ways in near
    )
    neighbours = _padded(list(joined))
    positions = np.ascontiguousarray(poses[:, :3, 3])
    to = positions[neighbours] - positions[:, None]
    flat = np.sqrt((to[..., :2] ** 2).sum(-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = to[..., :2] * (np.float32(1) / flat)[..., None]
    return Graphs(
        first=first,
        size=sizes,
        scans=tuple(s for s, _ in items),
        ids=tuple(str(i["image_id"]) for _, i in items),
        positions=positions,
        turned=(poses[:, :3, :3] != np.eye(3)).any((1, 2)),
        included=included,
        neighbours=neighbours,
        offset=to[..., :2],
        unit=unit,
        slope=np.arctan2(to[..., 2].astype(float), flat.astype(float)),
        distance=np.sqrt((to**2).sum(-1)).astype(float),
    )


def _read(path: Path) -> list[dict[str, Any]]:
    try:
        return viewpoints_of(path)
    except OSError as e:
        raise ValueError(f"MatterSim: Could not open navigation graph file: {path}, is path valid?") from e


def _padded(rows: Sequence[Sequence[int]]) -> np.ndarray:
    """(m, D) int64, padded with -1; D is at least 1."""
    table = np.full((len(rows), max((len(r) for r in rows), default=0) or 1), -1)
    for k, row in enumerate(rows):
        table[k, : len(row)] = row
    return table


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
        heading, elevation = view % TURNS * STEP, (view // TURNS - 1) * STEP
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
    return math.floor(normal(heading) / STEP + 0.5) % TURNS


def elevation_step(elevation: float) -> int:
    """-1, 0 or 1: beyond 15 degrees the camera looks 30 degrees down or up."""
    return -1 if elevation < -STEP / 2 else 1 if elevation > STEP / 2 else 0


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
            row * VIEWS + TURNS * (elevation_step(e) + 1) + heading_step(h)
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
                at = view % TURNS
                view += heading_step(at * STEP + steps(h) * STEP) - at
            if e:
                tilt = view // TURNS - 1
                view += TURNS * (elevation_step(tilt * STEP + steps(e) * STEP) - tilt)
            codes.append(row * VIEWS + view)
        self._codes = codes

    def row(self, agent: int) -> int:
        """Row of its viewpoint in the graphs."""
        return self._codes[agent] // VIEWS

    def locations(self, agent: int) -> tuple[ViewPoint, ...]:
        return self.lookout.view(self._codes[agent])[1]

    def heading(self, agent: int) -> float:
        return self._codes[agent] % TURNS * STEP

    def elevation(self, agent: int) -> float:
        return (self._codes[agent] % VIEWS // TURNS - 1) * STEP

    def view(self, agent: int) -> int:
        return self._codes[agent] % VIEWS
