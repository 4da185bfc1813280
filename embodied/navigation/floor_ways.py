"""FloorWays: where a body can be on a storey, how it slides along walls, and how far it is to go from there."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from embodied.house.house import House
from embodied.navigation.free_space import ajar_doors, opened
from embodied.navigation.graph import reachable

SLIDE = 0.05
"""A body that touches something is moved in steps of this, metres: less than anything is wide that it goes around."""
INSIDE = 1e-3
"""How far a body that touches something stays inside the free floor, metres, so that rounding never locks it in."""


class FloorWays:
    """The cells, 10 cm apart, that the centre of a body of the agent's radius can reach, and ways over them."""

    def __init__(self, house: House, storey: int = 0) -> None:
        """Doors that stand ajar give way to the body.

        Raises:
          HouseError: there is no free floor at all.
        """
        grid, room_of_cell, reach = reachable(opened(house, ajar_doors(house)), storey)
        cells = np.flatnonzero(reach)
        self.xy = grid.xy[cells]
        """(n, 2) metres, world."""
        rooms = [*(r.id for r in house.rooms if r.storey == storey), ""]
        self.room_of_cell = np.array(rooms)[room_of_cell[cells]]
        """(n,) ids of rooms; empty in a doorway."""
        self._space = grid.space
        self._inside = grid.space.buffer(-INSIDE)
        index = np.full(len(grid.xy), -1)
        index[cells] = np.arange(len(cells))
        steps = grid.matrix.tocoo()
        a, b = index[steps.row], index[steps.col]
        kept = (a >= 0) & (b >= 0)
        lengths = np.linalg.norm(grid.xy[steps.row[kept]] - grid.xy[steps.col[kept]], axis=1)
        shape = (len(cells), len(cells))
        self._steps = csr_matrix((lengths, (a[kept], b[kept])), shape=shape)
        self._wide = csr_matrix((steps.data[kept], (a[kept], b[kept])), shape=shape)
        self._tree = cKDTree(self.xy)

    def cell_at(self, xy: np.ndarray) -> int:
        """The cell nearest to (x, y)."""
        return int(self._tree.query(np.asarray(xy)[:2])[1])

    def cells_at(self, points: np.ndarray) -> np.ndarray:
        """(n,) the cells nearest to (n, 2) points."""
        return np.asarray(self._tree.query(points)[1])

    def ways(self, goals: np.ndarray) -> DrivingWays:
        """The shortest ways from everywhere to the nearest of some cells, an array of their indices, at least one."""
        return self._ways(self._steps, goals)

    def wide_ways(self, goals: np.ndarray) -> DrivingWays:
        """Ways that keep away from things where there is room for that; their metres are longer than they are."""
        return self._ways(self._wide, goals)

    def _ways(self, steps: csr_matrix, goals: np.ndarray) -> DrivingWays:
        metres, after, _ = dijkstra(
            steps, directed=False, indices=np.asarray(goals), min_only=True, return_predecessors=True
        )
        return DrivingWays(self, metres, after)

    def nearest_free(self, xy: np.ndarray) -> np.ndarray:
        """(2,) the point nearest to (x, y) where the centre may be."""
        if shapely.covers(self._inside, shapely.Point(xy)):
            return np.asarray(xy, float)
        return np.array(shapely.shortest_line(self._inside, shapely.Point(xy)).coords[0])

    def moved(self, a: np.ndarray, b: np.ndarray, *, sliding: bool) -> np.ndarray:
        """(2,) where a body that goes straight from a to b ends: at b, or where it touches something, or, sliding,
        where it came to along what it touches."""
        if self.is_free(a, b[None])[0]:
            return b
        here, steps = a, max(1, int(np.ceil(np.linalg.norm(b - a) / SLIDE)))
        for _ in range(steps):
            there = here + (b - a) / steps
            if not self.is_free(here, there[None])[0]:
                there = self.nearest_free(there) if sliding else here
            here = there
        return here

    def is_free(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """(m,) bool: whether the straight lines from a (2,) to b (m, 2) stay where the centre may be."""
        lines = np.stack([np.broadcast_to(a, np.shape(b)), b], axis=1)
        return np.asarray(shapely.covers(self._space, shapely.linestrings(lines)))


class DrivingWays:
    """How far every cell is from the nearest goal, metres over the grid (`metres`), and ways there."""

    def __init__(self, ground: FloorWays, metres: np.ndarray, after: np.ndarray) -> None:
        """
        Args:
          metres: (n,) float64; inf where no goal can be reached.
          after: (n,) the next cell on the way; negative at goals.
        """
        self.metres, self._ground, self._after = metres, ground, after

    def cells(self, cell: int) -> list[int]:
        """The cells of the way from a cell to its goal, both included."""
        way = [cell]
        while self._after[way[-1]] >= 0:
            way.append(int(self._after[way[-1]]))
        return way

    def length(self, cell: int) -> float:
        """Metres of the way when it is pulled tight: up to 8 % less than over the grid, which has eight directions."""
        return self._tight(self._ground.xy[self.cells(cell)])

    def length_from(self, xy: np.ndarray) -> float:
        """Metres of the way from (x, y) anywhere on the free floor, pulled tight; inf where there is none."""
        cell = self._ground.cell_at(xy)
        if not np.isfinite(self.metres[cell]):
            return float("inf")
        return self._tight(np.vstack([np.asarray(xy)[None, :2], self._ground.xy[self.cells(cell)]]))

    def _tight(self, way: np.ndarray) -> float:
        total, at = 0.0, 0
        while at < len(way) - 1:
            free = np.flatnonzero(self._ground.is_free(way[at], way[at + 1 :]))
            ahead = at + 1 + (int(free[-1]) if len(free) else 0)
            total += float(np.linalg.norm(way[ahead] - way[at]))
            at = ahead
        return total
