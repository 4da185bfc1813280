"""The navigation graph: viewpoints at eye height, joined where a person walks straight and sees the other end."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
import shapely
from scipy.ndimage import distance_transform_edt
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from embodied.house.house import DOORS, House, HouseError, Room, Stair
from embodied.navigation.free_space import EYE, OPEN_FROM, closed_doors, doors_of_edges, free_floor, opened, sight_floor

AGENT_RADIUS = 0.2
"""Radius of the agent's body, metres."""
CELL = 0.1
"""Grid on which viewpoints are chosen, metres."""
ENTERED = 0.4
"""Share of a room's free floor that must be reachable for the room to count as entered."""
NODE_DISTANCE = 0.65
"""Least distance between viewpoints of one room, in units of the wanted spacing."""
VIEWS_COMPARED = 48
"""Candidates per viewpoint whose views of the others are compared."""
CROWDED = 0.6
"""Viewpoints closer than this, in units of the wanted spacing, are thinned where they can be."""
OPENING = 1.0
"""Metres of way that opening or closing a door counts as: it takes about as long as to walk them."""
BEFORE_STAIRS, LONG_FLIGHT = 0.45, 3.2
"""Distance of viewpoints from a stair's ends, and length of flights that have one on the way, metres."""
STAIR_GAP = 0.15
"""How far the cell where one stands before a stair may lie from its end, metres."""
LONGEST_EDGE = 2.0
"""Longest edge in units of the wanted spacing: 4.5 m; 95 % of Matterport3D's edges are shorter than 5 m."""


@dataclass(frozen=True, eq=False)
class NavGraph:
    """Viewpoints and the straight walks between them.

    Examples:
      >>> nodes = graph.path(0, 3)
      >>> nodes[0], nodes[-1]
      (0, 3)
      >>> metres = graph.distance[0, 3]
    """

    positions: np.ndarray
    """(n, 3) float64, metres, world: the eye, 1.5 m above the floor."""
    ids: tuple[str, ...]
    room_of_node: tuple[str, ...]
    edges: np.ndarray
    """(m, 2) int64, i < j, sorted."""
    lengths: np.ndarray
    """(m,) float64, metres."""
    distance: np.ndarray
    """(n, n) float64: length of the shortest path, metres."""
    next_hop: np.ndarray
    """(n, n) int64: the node after i on the shortest path from i to j; i where i == j."""
    doors: Mapping[tuple[int, int], tuple[str, ...]] = field(default_factory=dict)
    """By edge (i, j), i < j: the doors that it passes, which must be open; edges that pass none are left out."""
    closed: frozenset[str] = frozenset()
    """Doors that the house at rest has closed."""

    def barred(self, a: int, b: int, closed: Collection[str]) -> tuple[str, ...]:
        """The closed doors between two neighbours."""
        return tuple(d for d in self.doors.get((min(a, b), max(a, b)), ()) if d in closed)

    def neighbours(self, node: int) -> tuple[int, ...]:
        """Nodes one edge away, ascending."""
        a, b = self.edges.T
        return tuple(sorted(int(k) for k in np.concatenate([b[a == node], a[b == node]])))

    def path(self, start: int, goal: int) -> tuple[int, ...]:
        """Nodes of the shortest path, both ends included."""
        nodes = [start]
        while nodes[-1] != goal:
            nodes.append(int(self.next_hop[nodes[-1], goal]))
        return tuple(nodes)

    @cached_property
    def hops(self) -> np.ndarray:
        """(n, n) int64: edges on the shortest path (by metres) from i to j."""
        return count_hops(self.next_hop)


def graph_of(positions: np.ndarray, edges: np.ndarray, ids: tuple[str, ...], rooms: tuple[str, ...]) -> NavGraph:
    """A NavGraph from its nodes and edges.

    Args:
      positions: (n, 3) float, metres, world.
      edges: (m, 2) int node pairs.

    Raises:
      HouseError: the graph is not connected.
    """
    positions = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
    n = len(positions)
    edges = np.unique(np.sort(np.asarray(edges, dtype=np.int64).reshape(-1, 2), axis=1), axis=0)
    lengths = np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
    distance, next_hop = _all_pairs(edges, lengths, n)
    if not np.isfinite(distance).all():
        lone = [ids[k] for k in np.flatnonzero(~np.isfinite(distance[0]))[:5]]
        raise HouseError(f"navigation graph is not connected: {lone} cannot be reached from {ids[0]!r}")
    return NavGraph(positions, tuple(ids), tuple(rooms), edges, lengths, distance, next_hop)


def _all_pairs(edges: np.ndarray, lengths: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, n) distances and (n, n) next hops; infinite where there is no way."""
    distance, before = dijkstra(csr_matrix((lengths, edges.T), shape=(n, n)), directed=False, return_predecessors=True)
    next_hop = before.T.astype(np.int64).copy()
    np.fill_diagonal(next_hop, np.arange(n))
    return (distance + distance.T) / 2, next_hop


def with_edge_doors(graph: NavGraph, house: House, open_from: float = OPEN_FROM) -> NavGraph:
    """The graph with the doors that its edges pass, and those that are closed: open by less than `open_from`."""
    doors = doors_of_edges(graph.positions, graph.edges, house)
    return dataclasses.replace(graph, doors=doors, closed=closed_doors(house, open_from))


@lru_cache(maxsize=64)
def behind_doors(graph: NavGraph, closed: frozenset[str], opening: float = OPENING) -> NavGraph:
    """The graph with ways that open doors on them: distances count `opening` metres for each.

    Args:
      closed: the doors that are closed now; without any, the graph itself.
      opening: metres; infinite for who opens none, for whom some nodes are then infinitely far.
    """
    barred = np.array([len(graph.barred(a, b, closed)) for a, b in graph.edges.tolist()]) if closed else np.zeros(1)
    if not barred.any():
        return graph
    lengths = graph.lengths.copy()
    lengths[barred > 0] += opening * barred[barred > 0]
    passable = np.isfinite(lengths)
    distance, next_hop = _all_pairs(graph.edges[passable], lengths[passable], len(graph.ids))
    return dataclasses.replace(graph, lengths=lengths, distance=distance, next_hop=next_hop)


def nearest(graph: NavGraph, node: int, targets: Sequence[int]) -> int:
    """The target nearest to `node` along the graph; the lowest index of equals."""
    distance = graph.distance
    return min(targets, key=lambda g: (distance[node, g], g))


def count_hops(next_hop: np.ndarray) -> np.ndarray:
    """(n, n) number of edges on the shortest (by metres) path from i to j, from the next-hop table."""
    next_hop = np.asarray(next_hop)
    n = len(next_hop)
    hops = np.zeros((n, n), dtype=np.int64)
    here = np.tile(np.arange(n)[:, None], (1, n))
    goal = np.arange(n)[None, :]
    for _ in range(n):
        moving = here != goal
        if not moving.any():
            return hops
        hops += moving
        here = np.where(moving, next_hop[here, goal], here)
    raise ValueError("next_hop does not lead everywhere in n steps; rebuild the graph")


def build_graph(house: House, *, spacing: float = 2.25, open_from: float = OPEN_FROM) -> NavGraph:
    """The house's viewpoints, about `spacing` metres apart, joined where one walks straight.

    A node or an edge keeps the agent's radius from walls, leaves and everything that stands between
    4 cm and 1.8 m above the floor; placements count with their rotated bounding rectangles. A line so
    free is also a free line of sight at eye height. Edges lead through closed doors, too, as if they stood wide open;
    NavGraph.doors says which must be opened first. Deterministic: nothing is drawn.

    Args:
      spacing: metres.
      open_from: openness, 0 to 1, from which a door counts as open.

    Raises:
      HouseError: a room that cannot be entered on foot.

    Examples:
      >>> graph = embodied.build_graph(house)
    """
    rest, house = house, opened(house, closed_doors(house, open_from))
    positions: list[tuple[float, float, float]] = []
    rooms: list[str] = []
    edges: list[tuple[int, int]] = []
    for storey in range(len(house.storeys)):
        xy, room, pairs = _storey_graph(house, storey, spacing)
        edges += [(a + len(positions), b + len(positions)) for a, b in pairs]
        positions += [(x, y, house.storeys[storey].elevation + EYE) for x, y in xy]
        rooms += room
    for stair in house.stairs:
        _climb(stair, positions, rooms, edges)
    ids = tuple(f"v{k:03d}" for k in range(len(positions)))
    return with_edge_doors(graph_of(np.round(positions, 4), np.asarray(edges), ids, tuple(rooms)), rest, open_from)


def walkable(house: House, storey: int = 0) -> shapely.Geometry:
    """Area in which the agent's centre may be: the free floor shrunk by its radius."""
    return free_floor(house, storey).buffer(-(AGENT_RADIUS + 0.005), quad_segs=6)


def stair_ends(stair: Stair) -> tuple[np.ndarray, np.ndarray]:
    """(3,) and (3,) the points on the floors before a stair's foot and after its head, metres, world."""
    path = np.asarray(stair.path, float)
    before, after = path[0] - path[1], path[-1] - path[-2]
    ends = (path[0], before), (path[-1], after)
    foot, head = (p + BEFORE_STAIRS * way * [1, 1, 0] / np.linalg.norm(way[:2]) for p, way in ends)
    return foot, head


def blocked_ends(house: House, storey: int, free: np.ndarray) -> list[np.ndarray]:
    """The ends of stairs on a storey that are not among the points (n, 2) that can be reached there."""
    ends = [e for s in house.stairs for r, e in zip(s.rooms, stair_ends(s)) if house.room_by_id[r].storey == storey]
    return [e for e in ends if np.linalg.norm(free - e[:2], axis=1).min(initial=np.inf) > STAIR_GAP]


def stair_points(stair: Stair) -> np.ndarray:
    """(k, 3) where one stands on a stair, from its foot up: in its bends, and on flights that are long; world."""
    path, points = np.asarray(stair.path, float), []
    rise = (path[-1, 2] - path[0, 2]) / stair.risers
    for k, (a, b) in enumerate(itertools.pairwise(path)):
        pieces = int(np.linalg.norm(b - a) // LONG_FLIGHT) + 1
        for t in np.arange(1, pieces) / pieces if b[2] > a[2] else ():
            x, y, z = a + t * (b - a)
            points.append((x, y, a[2] + rise * np.ceil((z - a[2]) / rise)))
        if k + 2 < len(path) and abs(np.linalg.det([(b - a)[:2], (path[k + 2] - b)[:2]])) > 1e-3:
            points.append(tuple(b))
    return np.round(points, 4).reshape(-1, 3)


def _climb(stair: Stair, positions: list, rooms: list[str], edges: list[tuple[int, int]]) -> None:
    """Add a stair's viewpoints and the edges along it."""
    standing = np.array(positions) - [0, 0, EYE]
    foot, head = (int(np.argmin(np.linalg.norm(standing - p, axis=1))) for p in stair_ends(stair))
    points = stair_points(stair)
    edges += itertools.pairwise([foot, *range(len(positions), len(positions) + len(points)), head])
    positions += [(x, y, z + EYE) for x, y, z in points.tolist()]
    rooms += [stair.rooms[bool(2 * z > stair.path[0][2] + stair.path[-1][2] + 1e-3)] for z in points[:, 2]]


def _storey_graph(house: House, storey: int, spacing: float) -> tuple[list, list[str], list[tuple[int, int]]]:
    rooms = [r for r in house.rooms if r.storey == storey]
    grid, room_of_cell, reach = reachable(house, storey)
    space = grid.space
    if shut := closed_rooms(room_of_cell, reach, len(rooms)):
        raise HouseError(
            f"room {rooms[shut[0]].id!r} cannot be entered on foot by a body of radius {AGENT_RADIUS} m; "
            "widen its door or move the furniture that blocks it"
        )
    room_of_cell[~reach] = -1
    grid.stairs = _stair_cells(house, rooms, grid, reach)
    nodes = _spread(space, grid, room_of_cell, rooms, spacing)
    nodes = _join(house, storey, space, grid, reach, nodes, spacing)
    nodes = _thinned(space, grid, room_of_cell, nodes, spacing)
    xy = grid.xy[nodes]
    pairs = [tuple(p) for p in _visible_pairs(space, xy, LONGEST_EDGE * spacing).tolist()]
    return xy.tolist(), [rooms[room_of_cell[n]].id for n in nodes], pairs


def _stair_cells(house: House, rooms: Sequence[Room], grid: FreeCells, reach: np.ndarray) -> list[int]:
    """The cells where one comes to a storey's stairs and leaves them.

    Raises:
      HouseError: something stands there.
    """
    ids, cells, ends = {r.id for r in rooms}, np.flatnonzero(reach), []
    for stair in house.stairs:
        for room, end in zip(stair.rooms, stair_ends(stair)):
            if room in ids:
                gap, cell = cKDTree(grid.xy[cells]).query(end[:2])
                if gap > STAIR_GAP:
                    raise HouseError(f"stair {stair.id!r} cannot be entered from {room!r}; clear the floor before it")
                ends.append(int(cells[cell]))
    return ends


def unreachable_rooms(house: House) -> tuple[str, ...]:
    """Ids of rooms that a body of the agent's radius cannot enter from the rest of their storey, all doors open."""
    house, closed = opened(house, closed_doors(house)), []
    for storey in range(len(house.storeys)):
        rooms = [r for r in house.rooms if r.storey == storey]
        _, room_of_cell, reach = reachable(house, storey)
        closed += [rooms[k].id for k in closed_rooms(room_of_cell, reach, len(rooms))]
    return tuple(closed)


def closed_rooms(room_of_cell: np.ndarray, reach: np.ndarray, rooms: int) -> list[int]:
    """Indices of rooms of whose free floor less than ENTERED can be reached."""
    free = np.bincount(room_of_cell[room_of_cell >= 0], minlength=rooms)
    reached = np.bincount(room_of_cell[reach & (room_of_cell >= 0)], minlength=rooms)
    return [k for k in range(rooms) if reached[k] == 0 or reached[k] < ENTERED * free[k]]


def reachable(
    house: House, storey: int, also: Sequence[shapely.Geometry] = ()
) -> tuple[FreeCells, np.ndarray, np.ndarray]:
    """The storey's grid, the room index of each cell (-1 for none), and which cells are joined to the most rooms.

    Args:
      also: where the agent's centre may be besides, metres, world.
    """
    space = walkable(house, storey)
    space = shapely.union_all([space, *also]) if also else space
    shapely.prepare(space)
    grid = FreeCells(space)
    room_of_cell = _rooms_of_cells(grid, [r for r in house.rooms if r.storey == storey])
    return grid, room_of_cell, _largest_reach(grid, room_of_cell)


def _rooms_of_cells(grid: FreeCells, rooms: Sequence[Room]) -> np.ndarray:
    """(n,) index of the room each cell lies in; cells inside a wall's doorway belong to the nearest room."""
    room_of_cell = np.full(len(grid.xy), -1)
    for k, r in enumerate(rooms):
        polygon = shapely.Polygon(r.polygon).buffer(1e-6)
        shapely.prepare(polygon)
        room_of_cell[shapely.contains_xy(polygon, grid.xy[:, 0], grid.xy[:, 1])] = k
    return room_of_cell


def _largest_reach(grid: FreeCells, room_of_cell: np.ndarray) -> np.ndarray:
    """(n,) bool: the connected cells that enter the most rooms."""
    if len(grid.xy) == 0:
        raise HouseError("the house has no free floor at all; remove furniture")
    label = connected_components(grid.matrix, directed=False)[1]
    pairs = np.unique(np.stack([label, room_of_cell], axis=1)[room_of_cell >= 0], axis=0)
    best = np.argmax(np.bincount(pairs[:, 0], minlength=label.max() + 1) + 1e-9 * np.bincount(label))
    return label == best


class FreeCells:
    """Cell centres inside the free space and how far each is from its border."""

    def __init__(self, space: shapely.Geometry) -> None:
        self.space = space
        self.stairs: list[int] = []
        """Cells at the foot and at the head of stairs, which are viewpoints."""
        x0, y0, x1, y1 = space.bounds
        self.x0, self.y0 = np.floor(x0 / CELL) * CELL, np.floor(y0 / CELL) * CELL
        nx, ny = int(np.ceil((x1 - self.x0) / CELL)) + 1, int(np.ceil((y1 - self.y0) / CELL)) + 1
        cx, cy = self.x0 + CELL * np.arange(nx), self.y0 + CELL * np.arange(ny)
        gx, gy = np.meshgrid(cx, cy, indexing="ij")
        self.inside = shapely.contains_xy(space, gx, gy)
        self.index = np.full(self.inside.shape, -1)
        self.index[self.inside] = np.arange(int(self.inside.sum()))
        self.xy = np.round(np.stack([gx[self.inside], gy[self.inside]], axis=1), 4)
        padded = np.pad(self.inside, 1)
        self.clearance = (distance_transform_edt(padded)[1:-1, 1:-1] * CELL)[self.inside]
        self.matrix = self._matrix(space)

    def _matrix(self, space: shapely.Geometry) -> csr_matrix:
        """Sparse 8-neighbour graph of the cells, dearer near obstacles; steps out of `space` are left out."""
        rows, cols, costs = [], [], []
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
            a = self.index[: self.index.shape[0] - dx, max(0, -dy) : self.index.shape[1] - max(0, dy)]
            b = self.index[dx:, max(0, dy) : self.index.shape[1] + min(0, dy)]
            both = (a >= 0) & (b >= 0)
            i, j = a[both], b[both]
            rows.append(i)
            cols.append(j)
            near = np.minimum(self.clearance[i], self.clearance[j])
            tight = np.flatnonzero(near < 1.5 * CELL)
            fine = np.ones(len(i), bool)
            fine[tight] = shapely.covers(
                space, shapely.linestrings(np.stack([self.xy[i[tight]], self.xy[j[tight]]], 1))
            )
            rows[-1], cols[-1], near = i[fine], j[fine], near[fine]
            costs.append(CELL * np.hypot(dx, dy) * (1.0 + 0.6 * np.exp(-near / 0.2)))
        n = len(self.xy)
        return csr_matrix((np.concatenate(costs), (np.concatenate(rows), np.concatenate(cols))), shape=(n, n))


def _spread(
    space: shapely.Geometry, grid: FreeCells, room_of_cell: np.ndarray, rooms: Sequence[Room], spacing: float
) -> list[int]:
    """Cells of the viewpoints: those at stairs, halls and corridors, then in each room a loose packing of calm spots
    that see more."""
    chosen = list(grid.stairs)
    apart = NODE_DISTANCE * spacing
    order = sorted(range(len(rooms)), key=lambda k: (rooms[k].kind not in ("hall", "corridor", "stairwell"), k))
    for k in order:
        cells = np.flatnonzero(room_of_cell == k)
        xy, calm = grid.xy[cells], np.minimum(grid.clearance[cells], 0.5)
        own = [c for c in grid.stairs if room_of_cell[c] == k]
        gap, elsewhere = (
            cKDTree(grid.xy[others]).query(xy)[0] if others else np.full(len(cells), np.inf) for others in (own, chosen)
        )
        open_ = gap >= apart
        while open_.any():
            # close to the wanted distance from the room's others, well clear of obstacles
            value = 1.2 * calm - 0.5 * np.abs(np.minimum(gap, 1.5 * apart) - apart) - 0.4 * np.maximum(0, 1 - elsewhere)
            ranked = np.flatnonzero(open_)[np.argsort(-value[open_], kind="stable")]
            top = ranked[: max(1, len(ranked) // 2)]
            top = top[np.linspace(0, len(top) - 1, min(VIEWS_COMPARED, len(top))).astype(int)]
            best = int(
                top[np.argmax(value[top] + 0.5 * np.minimum(_seen(space, grid, cells[top], chosen, spacing), 3))]
            )
            chosen.append(int(cells[best]))
            gap = np.minimum(gap, np.hypot(*(xy - xy[best]).T))
            open_ = (gap >= apart) & (elsewhere >= 0.5 * apart)
    return chosen


def _seen(space: shapely.Geometry, grid: FreeCells, cells: np.ndarray, chosen: list[int], spacing: float) -> np.ndarray:
    """(n,) how many chosen viewpoints, not too near, each cell sees."""
    if not chosen:
        return np.zeros(len(cells))
    xy, others = grid.xy[cells], grid.xy[chosen]
    d = np.hypot(*(xy[:, None] - others[None]).transpose(2, 0, 1))
    i, j = np.nonzero((d > 0.6 * spacing) & (d < 2.2 * spacing))
    ok = shapely.covers(space, shapely.linestrings(np.stack([xy[i], others[j]], 1))) if len(i) else np.zeros(0, bool)
    return np.bincount(i[ok], np.minimum(d[i[ok], j[ok]] / spacing, 1.3), minlength=len(cells))


def _thinned(
    space: shapely.Geometry, grid: FreeCells, room_of_cell: np.ndarray, nodes: list[int], spacing: float
) -> list[int]:
    """The nodes without those that crowd another one and that neither their room nor the graph nor stairs need."""
    xy = grid.xy[nodes]
    pairs = _visible_pairs(space, xy, LONGEST_EDGE * spacing)
    lengths = np.hypot(*(xy[pairs[:, 0]] - xy[pairs[:, 1]]).T)
    alive = np.ones(len(nodes), bool)
    rooms = room_of_cell[nodes]
    for a, b in pairs[np.argsort(lengths, kind="stable")][: int((lengths < CROWDED * spacing).sum())].tolist():
        for k in (a, b) if grid.clearance[nodes[a]] <= grid.clearance[nodes[b]] else (b, a):
            if nodes[k] in grid.stairs or not (alive[a] and alive[b]) or (alive & (rooms == rooms[k])).sum() < 2:
                continue
            alive[k] = False
            kept = pairs[alive[pairs].all(1)]
            at = np.cumsum(alive) - 1
            n = int(alive.sum())
            if connected_components(csr_matrix((np.ones(len(kept)), at[kept].T), shape=(n, n)), directed=False)[0] > 1:
                alive[k] = True
    return [n for n, keep in zip(nodes, alive) if keep]


def _visible_pairs(space: shapely.Polygon, xy: np.ndarray, longest: float) -> np.ndarray:
    """(m, 2) pairs of points within `longest` metres whose straight line stays in `space`."""
    pairs = cKDTree(xy).query_pairs(longest, output_type="ndarray")
    if len(pairs) == 0:
        return pairs.reshape(0, 2)
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    lines = shapely.linestrings(xy[pairs])
    return pairs[shapely.covers(space, lines)]


def _join(
    house: House,
    storey: int,
    space: shapely.Geometry,
    grid: FreeCells,
    reach: np.ndarray,
    nodes: list[int],
    spacing: float,
) -> list[int]:
    """Add viewpoints, in doorways first and then along the cheapest ways, until all are connected."""
    ids = {r.id for r in house.rooms if r.storey == storey}
    cells = np.flatnonzero(reach)
    tree = cKDTree(grid.xy[cells])
    longest = LONGEST_EDGE * spacing
    for o in house.openings:
        if o.kind not in DOORS or o.rooms[1] is None or o.rooms[0] not in ids:
            continue
        xy = grid.xy[nodes]
        label = _components(space, xy, longest)
        if label.max() == 0:
            return nodes
        gap, cell = tree.query((np.asarray(o.a) + np.asarray(o.b)) / 2)
        if gap > 0.2:
            continue
        cell = int(cells[cell])
        close = np.flatnonzero(np.hypot(*(xy - grid.xy[cell]).T) < longest)
        seen = close[[bool(space.covers(shapely.LineString([grid.xy[cell], xy[k]]))) for k in close] or slice(0)]
        if len(np.unique(label[seen])) > 1:
            nodes = [*nodes, cell]
    for _ in range(len(nodes)):
        xy = grid.xy[nodes]
        label = _components(space, xy, longest)
        if label.max() == 0:
            return nodes
        nodes = [*nodes, *_bridge(space, grid, nodes, label, spacing)]
    raise HouseError("viewpoints could not be connected although the floor is; this is a defect of build_graph")


def _components(space: shapely.Geometry, xy: np.ndarray, longest: float) -> np.ndarray:
    pairs = _visible_pairs(space, xy, longest)
    return connected_components(csr_matrix((np.ones(len(pairs)), pairs.T), shape=(len(xy), len(xy))), directed=False)[1]


def _bridge(space: shapely.Geometry, grid: FreeCells, nodes: list[int], label: np.ndarray, spacing: float) -> list[int]:
    """New cells along the cheapest way from the smallest component to the nearest other node."""
    sizes = np.bincount(label)
    small = int(np.argmin(sizes))
    inside = [n for n, k in zip(nodes, label) if k == small]
    others = np.array([n for n, k in zip(nodes, label) if k != small])
    cost, before, _ = dijkstra(grid.matrix, directed=False, indices=inside, min_only=True, return_predecessors=True)
    way = [int(others[np.argmin(cost[others])])]
    while way[-1] not in inside:
        way.append(int(before[way[-1]]))
    added: list[int] = []
    at = 0
    while True:
        ends = np.arange(len(way) - 1, at, -1)
        lines = shapely.linestrings([(grid.xy[way[at]], grid.xy[way[k]]) for k in ends])
        ok = shapely.covers(space, lines) & (shapely.length(lines) < LONGEST_EDGE * spacing)
        far = int(ends[np.argmax(ok)]) if ok.any() else at + 1
        if far == len(way) - 1:
            return added or [way[len(way) // 2]]
        added.append(way[far])
        at = far


def sight_lines(graph: NavGraph, house: House) -> np.ndarray:
    """(n, n) bool: which eyes of one storey see one another over whatever is lower; joined nodes always do."""
    seen = np.zeros((len(graph.ids),) * 2, bool)
    storey_of_node = np.array([house.room_by_id[r].storey for r in graph.room_of_node])
    for storey in range(len(house.storeys)):
        nodes = np.flatnonzero(storey_of_node == storey)
        space = sight_floor(house, storey).buffer(1e-6)
        shapely.prepare(space)
        i, j = nodes[np.stack(np.triu_indices(len(nodes), 1))]
        seen[i, j] = shapely.covers(
            space, shapely.linestrings(np.stack([graph.positions[i, :2], graph.positions[j, :2]], 1))
        )
    seen[graph.edges[:, 0], graph.edges[:, 1]] = True
    return seen | seen.T
