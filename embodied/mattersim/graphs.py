"""Graphs: the navigation graphs of a folder of Matterport connectivity files, as arrays over all viewpoints.

A viewpoint is a row; the rows of a scan follow each other in the order of its file, so that a row less the scan's
first row is the `ix` of the format, which counts excluded viewpoints too.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

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
