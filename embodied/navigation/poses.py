"""Poses anywhere on the free floor, for who wants to stand between the viewpoints."""

import math
from collections.abc import Sequence

import numpy as np
import shapely

from embodied.house.house import House, HouseError
from embodied.navigation.floor_ways import band_of
from embodied.navigation.free_space import EYE
from embodied.navigation.graph import NavGraph, walkable


class FreePoses:
    """Poses from which a body of the agent's radius can walk to a viewpoint."""

    def __init__(self, house: House, graph: NavGraph) -> None:
        self._levels = np.array([s.elevation for s in house.storeys])
        self._bands = [band_of(house, s) for s in house.stairs]
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
