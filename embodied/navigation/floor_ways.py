"""FloorWays: where a body can be in a house, how it slides along walls, and how far it is to go from there. FreePoses:
where one can stand between the viewpoints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree
from shapely.affinity import translate

from embodied.house.house import House, HouseError, Stair
from embodied.navigation.free_space import EYE, ajar_doors, opened
from embodied.navigation.graph import AGENT_RADIUS, FreeCells, NavGraph, reachable, walkable

SLIDE = 0.05
"""A body that touches something is moved in steps of this, metres: less than anything is wide that it goes around."""
INSIDE = 1e-3
"""How far a body that touches something stays inside the free floor, metres, so that rounding never locks it in."""
APART, OVERLAP = 4000.0, 0.45
"""Distance in the plane between a floor and the next; how far stairs and floors reach into each other, metres."""
RAILING, NO_WAY = 0.05, 1e-6
"""Width that a railing takes of a stair on each side; from a place on a floor to the same on a stair, metres."""


class FloorWays:
    """The cells, 10 cm apart, that the centre of a body of the agent's radius can reach, and ways over them.

    Every floor and every stair is laid out flat, side by side in one plane; the ground floor is where it is in the
    world. `plane` and `world` lead from one to the other.
    """

    def __init__(self, house: House, *, stairs: bool = True) -> None:
        """Doors that stand ajar give way to the body.

        Args:
          stairs: without, only the ground floor.

        Raises:
          HouseError: there is no free floor at all.
        """
        house, self._house = opened(house, ajar_doors(house)), house
        self._bands = [_band_of(house, s) for s in house.stairs if stairs]
        spaces, names, cells, rows, matrices = [], [], [], 0, []
        for k in range(len(house.storeys) if stairs else 1):
            ends = [e for b in self._bands for storey, e in zip(b.storeys, b.ends) if storey == k]
            grid, room_of_cell, reach = reachable(house, k, ends)
            ids = [*(r.id for r in house.rooms if r.storey == k), ""]
            spaces.append((grid, reach))
            names.append(np.array(ids)[room_of_cell[reach]])
        self._floors = len(spaces)
        for grid in (FreeCells(b.shape) for b in self._bands):
            spaces.append((grid, np.ones(len(grid.xy), bool)))
            names.append(np.full(len(grid.xy), ""))
        for n, (grid, reach) in enumerate(spaces):
            index = np.full(len(grid.xy), -1)
            index[reach] = rows + np.arange(int(reach.sum()))
            steps = grid.matrix.tocoo()
            a, b = index[steps.row], index[steps.col]
            kept = (a >= 0) & (b >= 0)
            matrices.append((a[kept], b[kept], steps.data[kept]))
            cells.append(grid.xy[reach] + [n * APART, 0.0])
            rows += int(reach.sum())
        self.xy = np.concatenate(cells)
        """(n, 2) metres, in the plane."""
        self.xyz = self.world(self.xy)
        """(n, 3) metres, world."""
        self.room_of_cell = np.concatenate(names)
        """(n,) ids of rooms; empty in a doorway and on stairs."""
        parts = [translate(g.space, n * APART) for n, (g, _) in enumerate(spaces)]
        self.space = shapely.union_all(parts) if len(parts) > 1 else parts[0]
        self._inside = self.space.buffer(-INSIDE)
        for shape in (self.space, self._inside):
            shapely.prepare(shape)
        self._tree = cKDTree(self.xy)
        a, b, costs = (np.concatenate(x) for x in zip(*matrices, *self._crossings()))
        lengths = np.maximum(np.linalg.norm(self.xyz[a] - self.xyz[b], axis=1), NO_WAY)
        self._steps = csr_matrix((lengths, (a, b)), shape=(rows, rows))
        self._wide = csr_matrix((costs, (a, b)), shape=(rows, rows))

    def _crossings(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Pairs of cells, one on a floor and one on a stair, that are the same place, and what it costs to cross."""
        crossings = []
        for n, band in enumerate(self._bands, self._floors):
            for storey, end in zip(band.storeys, band.ends):
                near = np.flatnonzero(shapely.intersects_xy(translate(end, storey * APART), *self.xy.T))
                gap, cell = self._tree.query(self.xy[near] + [(n - storey) * APART, 0.0])
                same = gap < INSIDE
                crossings.append((near[same], cell[same], np.full(int(same.sum()), NO_WAY)))
        return crossings

    def world(self, xy: np.ndarray) -> np.ndarray:
        """(..., 3) where points (..., 2) of the plane are in the world, on the floor, metres."""
        xy = np.asarray(xy, float)
        part = np.rint(xy[..., 0] / APART).astype(int)
        out = np.stack([xy[..., 0] - part * APART, xy[..., 1], np.zeros(xy.shape[:-1])], -1)
        for k, storey in enumerate(self._house.storeys):
            out[part == k, 2] = storey.elevation
        for n, band in enumerate(self._bands, self._floors):
            out[part == n, 2] = band.height(out[part == n, :2])
        return out

    def plane(self, points: np.ndarray) -> np.ndarray:
        """(..., 2) where points (..., 3) on the floor in the world are in the plane, metres."""
        points = np.asarray(points, float)
        levels = np.array([s.elevation for s in self._house.storeys[: self._floors]])
        part = np.maximum(np.searchsorted(levels, points[..., 2] + 0.05, side="right") - 1, 0)
        between = np.abs(points[..., 2, None] - levels).min(-1) > 0.05
        for n, band in enumerate(self._bands, self._floors):
            near = np.abs(band.height(points[..., :2]) - points[..., 2]) < 0.2
            part = np.where(between & near & shapely.intersects_xy(band.shape, points[..., 0], points[..., 1]), n, part)
        return points[..., :2] + np.stack([part * APART, 0.0 * part], -1)

    def _settled(self, xy: np.ndarray) -> np.ndarray:
        """(2,) the same place, on the floor or on the stair that it belongs to: they overlap where they meet."""
        for n, band in enumerate(self._bands, self._floors):
            for storey, end in zip(band.storeys, band.ends):
                for here, there in ((storey, n), (n, storey)):
                    at = xy - [here * APART, 0.0]
                    if shapely.intersects_xy(end, *at) and (0 < band.along(at) < band.length) == (there == n):
                        return at + [there * APART, 0.0]
        return xy

    def cell_at(self, point: np.ndarray) -> int:
        """The cell nearest to a point of the plane (2,) or of the world (3,)."""
        return int(self.cells_at(np.asarray(point)[None])[0])

    def cells_at(self, points: np.ndarray) -> np.ndarray:
        """(n,) the cells nearest to (n, 2) points of the plane or (n, 3) of the world."""
        points = np.asarray(points, float)
        return np.asarray(self._tree.query(self.plane(points) if points.shape[1] == 3 else points)[1])

    def ways(self, goals: np.ndarray) -> DrivingWays:
        """The shortest ways from everywhere to the nearest of some cells, an array of their indices, at least one."""
        return self._ways(self._steps, goals)

    def wide_ways(self, goals: np.ndarray, shut: np.ndarray | None = None) -> DrivingWays:
        """Ways that keep away from things where there is room for that, and out of the cells that are `shut`, (n,)
        bool; their metres are longer than they are."""
        steps = self._wide if shut is None else self._wide.multiply(~shut[:, None]).multiply(~shut).tocsr()
        steps.eliminate_zeros()
        return self._ways(steps, goals)

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
        where it came to along what it touches. On a stair's first step it is on the stair, wherever that lies."""
        if self.is_free(a, b[None])[0]:
            return self._settled(b)
        here, steps = a, max(1, int(np.ceil(np.linalg.norm(b - a) / SLIDE)))
        for _ in range(steps):
            there = here + (b - a) / steps
            if not self.is_free(here, there[None])[0]:
                there = self.nearest_free(there) if sliding else here
            here = there
        return self._settled(here)

    def is_free(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """(m,) bool: whether the straight lines from a (2,) to b (m, 2) stay where the centre may be."""
        if self._bands:  # what is the same place on a stair counts where the line begins
            here, there = self.world(a), self.world(b)
            moved = there[:, :2] + (np.asarray(a) - here[:2])
            b = np.where((np.abs(self.world(moved)[:, 2] - there[:, 2]) < 0.3)[:, None], moved, b)
        lines = np.stack([np.broadcast_to(a, np.shape(b)), b], axis=1)
        return np.asarray(shapely.covers(self.space, shapely.linestrings(lines)))


@dataclass(frozen=True, eq=False)
class _Band:
    """The places of a body's centre on a stair, and on the floors just before and after it; metres, world."""

    line: shapely.LineString
    """Its middle, OVERLAP longer than the stair at both ends."""
    length: float
    """Of the stair in the plan."""
    slope: np.ndarray
    """(n, 2): metres from the foot, and the height there."""
    shape: shapely.Polygon
    ends: tuple[shapely.Polygon, shapely.Polygon]
    """The parts of `shape` around the foot and around the head, which lie on the floors, too."""
    storeys: tuple[int, int]
    """Of the foot and of the head."""

    def along(self, xy: np.ndarray) -> np.ndarray:
        """(n,) metres from the foot of points (n, 2); negative before it."""
        return shapely.line_locate_point(self.line, shapely.points(np.asarray(xy, float))) - OVERLAP

    def height(self, xy: np.ndarray) -> np.ndarray:
        """(n,) height of the slope under points (n, 2)."""
        return np.interp(self.along(xy), *self.slope.T)


def _band_of(house: House, stair: Stair) -> _Band:
    """The places on a stair."""
    path, half = np.asarray(stair.path, float), stair.width / 2 - AGENT_RADIUS - RAILING
    run = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1)))
    tips = [(p, OVERLAP * (p - q) / np.linalg.norm(p - q)) for p, q in (path[:2, :2], path[:-3:-1, :2])]
    wide = lambda points: shapely.LineString(points).buffer(half, cap_style="flat", join_style="mitre")
    line = np.vstack([sum(tips[0]), path[:, :2], sum(tips[1])])
    foot, head = (wide([p - way, p + way]) for p, way in tips)
    low, high = (house.room_by_id[r].storey for r in stair.rooms)
    slope = np.stack([run, path[:, 2]], 1)
    return _Band(shapely.LineString(line), float(run[-1]), slope, wide(line), (foot, head), (low, high))


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
        total, at, metres = 0.0, 0, self._ground.world(way)
        while at < len(way) - 1:
            free = np.flatnonzero(self._ground.is_free(way[at], way[at + 1 :]))
            ahead = at + 1 + (int(free[-1]) if len(free) else 0)
            total += float(np.linalg.norm(metres[ahead] - metres[at]))
            at = ahead
        return total


class FreePoses:
    """Poses from which a body of the agent's radius can walk to a viewpoint."""

    def __init__(self, house: House, graph: NavGraph) -> None:
        self._levels = np.array([s.elevation for s in house.storeys])
        self._bands = [_band_of(house, s) for s in house.stairs]
        self._floors = tuple(self._reached(house, graph, storey) for storey in range(len(house.storeys)))

    def _reached(self, house: House, graph: NavGraph, storey: int) -> shapely.Geometry:
        eyes = graph.positions[np.abs(graph.positions[:, 2] - EYE - self._levels[storey]) < 0.5]
        pieces = shapely.get_parts(walkable(house, storey))
        points = shapely.MultiPoint(eyes[:, :2])
        reached = shapely.MultiPolygon([p for p in pieces if p.geom_type == "Polygon" and p.distance(points) < 1e-6])
        shapely.prepare(reached)
        return reached

    def is_free(self, position: Sequence[float] | np.ndarray) -> bool:
        """True if the body can stand at (x, y) of the ground floor, or at (x, y, z) of the storey that z is in, or on
        stairs with its eye within 0.4 m of z."""
        x, y, z = (*position, EYE) if len(position) == 2 else position
        if not np.isfinite([x, y, z]).all():
            raise ValueError(f"a position should be finite numbers in metres, got {tuple(position)}")
        storey = int(np.searchsorted(self._levels, z + 1e-6, side="right")) - 1
        here, xy = shapely.Point(x, y), np.array([[x, y]])
        on_stairs = any(abs(b.height(xy)[0] + EYE - z) < 0.4 and shapely.covers(b.shape, here) for b in self._bands)
        return on_stairs or (storey >= 0 and bool(shapely.covers(self._floors[storey], here)))

    def draw(self, *, rng: np.random.Generator) -> tuple[np.ndarray, float]:
        """A pose drawn evenly over the free floor.

        Returns:
          (3,) of the eye, metres, world; and yaw, radians.

        Raises:
          HouseError: there is no free floor.
        """
        storey_of, triangles = [], []
        for storey, floor in enumerate(self._floors):
            for t in shapely.get_parts(shapely.constrained_delaunay_triangles(floor)):
                storey_of.append(storey)
                triangles.append(t.exterior.coords[:3])
        if not triangles:
            raise HouseError("the house has no free floor at all; remove furniture")
        corners = np.array(triangles)
        sizes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
        k = int(rng.choice(len(corners), p=sizes / sizes.sum()))
        a, b = sorted(rng.random(2))
        x, y = corners[k].T @ (a, b - a, 1 - b)
        return np.array([x, y, self._levels[storey_of[k]] + EYE]), float(rng.uniform(-math.pi, math.pi))
