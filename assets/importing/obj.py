"""Wavefront OBJ and MTL, read into index arrays per material.

Why not trimesh's loader: it cuts polygons into fans, which fills the hollows of the concave ones
that the packs are full of, and it keeps neither smoothing nor transparency apart.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

MAX_FACES = 2_000_000
FARTHEST = 1e12
"""Largest coordinate, of vertices in a file's own unit and of textures (the packs have some of 3e9)."""
MAX_CORNERS = 20_000
"""Of one polygon."""


class MeshError(ValueError):
    """A mesh that cannot be used: says where and why."""


@dataclass(frozen=True)
class MtlMaterial:
    """What an MTL file says about one material; colours are sRGB in [0, 1]."""

    name: str
    diffuse: tuple[float, float, float] = (0.8, 0.8, 0.8)
    specular: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shininess: float = 0.0
    opacity: float = 1.0
    illum: int = 2
    texture: str | None = None
    """File name of map_Kd, relative to the MTL file."""


@dataclass(frozen=True, eq=False)
class Group:
    """The triangles of one material."""

    material: str
    corners: np.ndarray
    """(m, 3) int64 indices into `Obj.vertices`."""
    uv_corners: np.ndarray
    """(m, 3) int64 indices into `Obj.uvs`, -1 where a corner has none."""


@dataclass(frozen=True, eq=False)
class Obj:
    vertices: np.ndarray
    """(n, 3) float64 in the file's own axes and unit."""
    uvs: np.ndarray
    """(k, 2) float64."""
    groups: tuple[Group, ...]
    libraries: tuple[str, ...]
    """Names of the MTL files it wants."""


def parse_obj(text: str, where: str) -> Obj:
    """Read an OBJ file; faces of one material are gathered from all its objects.

    Raises:
      MeshError: no faces, too many, indices out of range, or numbers that are not finite.
    """
    vertices: list[str] = []
    uvs: list[str] = []
    faces: dict[str, list[list[str]]] = {}
    libraries: list[str] = []
    current = faces.setdefault("", [])
    for line in text.replace("\\\n", " ").splitlines():
        head, _, rest = line.lstrip().partition(" ")
        if head == "v":
            vertices.append(rest)
        elif head == "vt":
            uvs.append(rest)
        elif head == "f":
            current.append(rest.split())
        elif head == "usemtl":
            current = faces.setdefault(rest.strip(), [])
        elif head == "mtllib":
            libraries.append(rest.strip())
    points = _numbers(vertices, 3, where)
    coords = _numbers(uvs, 2, where)
    groups = tuple(_group(name, polygons, points, len(coords), where) for name, polygons in faces.items() if polygons)
    groups = tuple(g for g in groups if len(g.corners))
    if not groups:
        raise MeshError(f"{where} has no faces; the model is empty or damaged")
    if (total := sum(len(g.corners) for g in groups)) > MAX_FACES:
        raise MeshError(f"{where} has {total} triangles, at most {MAX_FACES} are read; simplify the model")
    return Obj(points, coords, groups, tuple(dict.fromkeys(libraries)))


def libraries(text: str) -> tuple[str, ...]:
    """The names of the MTL files that an OBJ file wants, without reading its mesh."""
    found = [line.lstrip().partition(" ") for line in text.replace("\\\n", " ").splitlines()]
    return tuple(dict.fromkeys(rest.strip() for head, _, rest in found if head == "mtllib"))


def parse_mtl(text: str) -> dict[str, MtlMaterial]:
    """The materials of an MTL file by name; lines it does not know are ignored."""
    materials: dict[str, MtlMaterial] = {}
    name = None
    for line in text.splitlines():
        words = line.split()
        if not words:
            continue
        head, rest = words[0], words[1:]
        if head == "newmtl":
            name = line.split(None, 1)[1].strip() if rest else ""
            materials[name] = MtlMaterial(name)
        elif name is not None and (change := _material_field(head, rest, line)):
            materials[name] = dataclasses.replace(materials[name], **change)
    return materials


def _material_field(head: str, rest: list[str], line: str) -> dict:
    colors = {"Kd": "diffuse", "Ks": "specular", "Ke": "emission"}
    try:
        if head in colors:
            values = [min(1.0, max(0.0, float(x))) for x in rest[:3]]
            return {colors[head]: tuple(values) if len(values) == 3 else (values[0],) * 3}
        if head == "Ns":
            return {"shininess": float(rest[0])}
        if head == "d":
            return {"opacity": min(1.0, max(0.0, float(rest[-1])))}
        if head == "Tr":
            return {"opacity": min(1.0, max(0.0, 1.0 - float(rest[-1])))}
        if head == "illum":
            return {"illum": int(float(rest[0]))}
    except (ValueError, IndexError):
        return {}
    if head == "map_Kd" and rest:
        text = line.split(None, 1)[1].strip()
        return {"texture": rest[-1] if text.startswith("-") else text}
    return {}


def _numbers(lines: list[str], width: int, where: str) -> np.ndarray:
    if not lines:
        return np.empty((0, width))
    try:
        rows = [line.split()[:width] for line in lines]
        out = np.array(rows, dtype=np.float64).reshape(len(rows), -1)
        if out.shape[1] != width:
            raise ValueError(f"{out.shape[1]} numbers")
    except ValueError as e:
        raise MeshError(f"{where} has a vertex that is not {width} numbers; the model is damaged") from e
    if not (np.abs(out) <= FARTHEST).all():
        raise MeshError(f"{where} has a vertex that is not finite, or beyond {FARTHEST:g}; the model is damaged")
    return out


def _group(name: str, polygons: list[list[str]], points: np.ndarray, uv_count: int, where: str) -> Group:
    by_size: dict[int, list[list[int]]] = {}
    try:
        for words in polygons:
            if len(words) > 2:
                parts = [w.split("/") for w in words]
                v = [_index(p[0], len(points)) for p in parts]
                t = [_index(p[1], uv_count) if len(p) > 1 and p[1] else -1 for p in parts]
                by_size.setdefault(len(words), []).append(v + t)
    except (ValueError, IndexError) as e:
        raise MeshError(f"{where} has a face with a bad index ({e}); the model is damaged") from e
    corners, uv_corners = [np.empty((0, 3), np.int64)], [np.empty((0, 3), np.int64)]
    if max(by_size, default=0) > MAX_CORNERS:
        raise MeshError(
            f"{where} has a polygon of {max(by_size)} corners, at most {MAX_CORNERS} are read; simplify the model"
        )
    for n in sorted(by_size):
        rows = np.array(by_size[n], dtype=np.int64)
        polygon, order = _split(rows[:, :n], points)
        corners.append(np.take_along_axis(rows[polygon, :n], order, axis=1))
        uv_corners.append(np.take_along_axis(rows[polygon, n:], order, axis=1))
    return Group(name, np.concatenate(corners), np.concatenate(uv_corners))


def _index(word: str, count: int) -> int:
    i = int(word)
    i = i - 1 if i > 0 else count + i
    if not 0 <= i < count:
        raise IndexError(f"index {word} of {count}")
    return i


def _split(v: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles that fill polygons of one size.

    Args:
      v: (m, n) vertex indices, points: (k, 3).

    Returns:
      (t,) polygon of each triangle and (t, 3) its corners within the polygon.
    """
    m, n = v.shape
    rows = np.arange(m)
    if n == 3:
        return rows, np.tile([0, 1, 2], (m, 1))
    if n == 4:
        p = points[v]
        first = _normals(p[:, [0, 1, 2]]), _normals(p[:, [0, 2, 3]])
        fold = np.einsum("ij,ij->i", *first) < 0
        order = np.where(fold[:, None], [0, 1, 3, 1, 2, 3], [0, 1, 2, 0, 2, 3])
        return np.repeat(rows, 2), order.reshape(-1, 3)
    triples = [_triangles(points[row]) for row in v]
    polygon = np.repeat(rows, [len(t) for t in triples])
    return polygon, np.array([t for some in triples for t in some], dtype=np.int64).reshape(-1, 3)


def _normals(p: np.ndarray) -> np.ndarray:
    """(m, 3) normals, twice the area long, of triangles (m, 3, 3)."""
    return np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


def _triangles(p: np.ndarray) -> list[tuple[int, int, int]]:
    """Corner triples that fill the polygon (n, 3): a fan where it is convex, else ear clipping."""
    n = len(p)
    e = np.roll(p, -1, axis=0) - p
    normal = np.cross(p - p[0], np.roll(p, -1, axis=0) - p[0]).sum(axis=0)
    length = np.linalg.norm(normal)
    if length == 0.0:
        return []
    turns = np.cross(np.roll(e, 1, axis=0), e) @ (normal / length)
    if (turns >= -1e-6 * np.abs(turns).max()).all():
        return [(0, i, i + 1) for i in range(1, n - 1)]
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(p, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):
        flat = flat[:, ::-1]
    return _ears(flat)


def _ears(p: np.ndarray) -> list[tuple[int, int, int]]:
    """Ear clipping of a simple counter-clockwise polygon (n, 2): always the first ear, or where there is
    none the least bad corner. A corner that is no ear is looked at again only when that can have changed it."""
    ring = _Ring(p)
    out = []
    while ring.count > 3:
        corner = ring.first_ear()
        out.append((int(ring.before[corner]), corner, int(ring.after[corner])))
        ring.cut(corner)
    a, b, c = np.flatnonzero(ring.left).tolist()
    return [*out, (a, b, c)]


class _Ring:
    """The corners that are left of a polygon while its ears are cut, and what is known about each."""

    def __init__(self, p: np.ndarray) -> None:
        self.p, self.x, self.y = p, np.ascontiguousarray(p[:, 0]), np.ascontiguousarray(p[:, 1])
        self.count = len(p)
        self.left = np.ones(len(p), dtype=bool)
        self.before, self.after = np.roll(np.arange(len(p)), 1), np.roll(np.arange(len(p)), -1)
        self.hopeful = np.ones(len(p), dtype=bool)
        """Corners that are ears or have not been looked at since something changed."""
        self.ear = np.zeros(len(p), dtype=bool)
        self.score = np.full(len(p), -np.inf)
        self.blocker = np.full(len(p), -1)
        """The corner inside the triangle of one that is no ear."""

    def first_ear(self) -> int:
        """The first corner whose triangle holds no other corner, or the best one where there is no such."""
        while self.hopeful[corner := int(np.argmax(self.hopeful))]:
            if not self.ear[corner]:
                self._look(corner)
            if self.ear[corner]:
                return corner
        return int(np.argmax(self.score))

    def cut(self, corner: int) -> None:
        """Take a corner out; its neighbours, and those it kept from being ears, may be ears now."""
        a, b = self.before[corner], self.after[corner]
        self.after[a], self.before[b] = b, a
        self.count -= 1
        self.ear[[a, b]] = False
        self.hopeful[[a, b]] = True
        self.hopeful |= self.blocker == corner
        self.left[corner] = self.hopeful[corner] = False
        self.score[corner], self.blocker[corner] = -np.inf, -1

    def _look(self, corner: int) -> None:
        (ax, ay), (bx, by), (cx, cy) = self.p[[self.before[corner], corner, self.after[corner]]].tolist()
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        self.hopeful[corner], self.blocker[corner] = False, -1
        if area <= 0:
            self.score[corner] = area - 1e6
            return
        x, y = self.x, self.y
        inside = self.left & ((bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0)
        inside &= (cx - bx) * (y - by) - (cy - by) * (x - bx) >= 0
        within = np.flatnonzero(inside & ((ax - cx) * (y - cy) - (ay - cy) * (x - cx) >= 0))
        # Its own corners apart, which keyhole polygons visit twice.
        corners = ((ax, ay), (bx, by), (cx, cy))
        blocker = next((q for q in within[::-1].tolist() if (x[q], y[q]) not in corners), -1)
        if blocker >= 0:
            self.score[corner], self.blocker[corner] = -1e9, blocker
        else:
            self.ear[corner] = self.hopeful[corner] = True
