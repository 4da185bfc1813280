"""Plane geometry of walls and floors that shell, joinery and outdoors share."""

from collections.abc import Sequence

import numpy as np

from embodied.assets.built.primitives import Shape
from embodied.house.house import House, Opening

Hole = tuple[float, float, float, float]
"""s0, z0, s1, z1 of a rectangle in a wall face: metres along the face, world heights."""
TOLERANCE = 2e-3
"""How far an opening's jambs may lie off a wall's centre line, metres."""


def inset(polygon: Sequence[Sequence[float]], distance: float) -> np.ndarray:
    """(n, 2) corners of a counter-clockwise polygon moved inward edge by edge, one for one."""
    p = np.asarray(polygon, float)
    d = np.roll(p, -1, axis=0) - p
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    before = np.roll(d, 1, axis=0)
    n, m = np.stack([-d[:, 1], d[:, 0]], 1), np.stack([-before[:, 1], before[:, 0]], 1)
    return p + distance * (n + m) / (1.0 + np.sum(n * m, axis=1, keepdims=True))


def hole_on(p: np.ndarray, q: np.ndarray, opening: Opening, floor: float, distance: float) -> Hole | None:
    """The hole of `opening` in the wall face from p to q, or None where it is in another wall.

    Args:
      floor: world height of the storey's floor.
      distance: of the face from the opening's line, on its left, metres.
    """
    length = float(np.linalg.norm(q - p))
    d = (q - p) / length
    ab = np.array([opening.a, opening.b]) - p
    if np.abs(ab @ [-d[1], d[0]] + distance).max() > TOLERANCE:
        return None
    s0, s1 = sorted(np.clip(ab @ d, 0, length))
    if s1 - s0 <= TOLERANCE:
        return None
    return float(s0), floor + opening.sill, float(s1), floor + opening.head


def wall_face(p: np.ndarray, q: np.ndarray, z0: float, z1: float, holes: Sequence[Hole], along: float = 0.0) -> Shape:
    """The upright rectangle over p-q with rectangular holes, facing left of the direction p to q.

    Args:
      p, q: (2,) ends, metres, world.
      along: metres at which the material's pattern starts, so that it runs on around corners.

    Returns:
      One conforming mesh; u runs to the right of somebody who faces the wall.
    """
    length = float(np.linalg.norm(q - p))
    d = (q - p) / length
    s = np.unique(np.round([0.0, length, *(x for h in holes for x in (h[0], h[2]))], 6))
    z = np.unique(np.round([z0, z1, *(min(max(x, z0), z1) for h in holes for x in (h[1], h[3]))], 6))
    s[-1], z[0], z[-1] = length, z0, z1
    faces = []
    for i in range(len(s) - 1):
        for j in range(len(z) - 1):
            sm, zm = (s[i] + s[i + 1]) / 2, (z[j] + z[j + 1]) / 2
            if any(h[0] < sm < h[2] and h[1] < zm < h[3] for h in holes):
                continue
            a, b = i * len(z) + j, (i + 1) * len(z) + j
            # Facing left of p-q: going up before going along is counter-clockwise from there.
            faces += [[a, a + 1, b + 1], [a, b + 1, b]]
    grid_s, grid_z = (x.reshape(-1) for x in np.meshgrid(s, z, indexing="ij"))
    vertices = np.column_stack([p + grid_s[:, None] * d, grid_z])
    used, corners = np.unique(np.asarray(faces), return_inverse=True)
    normals = np.tile([-d[1], d[0], 0.0], (len(used), 1))
    uv = np.column_stack([-(along + grid_s), grid_z])[used]
    return Shape(vertices[used], corners.reshape(-1, 3), normals, uv)


def floor_turn(house: House) -> bool:
    """True if boards run along y: along the longer side of the house, the same in all rooms."""
    points = np.concatenate([np.asarray(r.polygon) for r in house.rooms])
    width, depth = np.ptp(points, axis=0)
    return bool(depth > width)


def turned_uv(shape: Shape, turn: bool) -> Shape:
    """The same shape with its floor pattern turned by a quarter."""
    if not turn:
        return shape
    return Shape(shape.vertices, shape.faces, shape.normals, np.stack([shape.uv[:, 1], -shape.uv[:, 0]], axis=1))
