"""Wavefront OBJ and MTL, read into index arrays per material.

Why not trimesh's loader: it cuts polygons into fans, which fills the hollows of the concave ones that the packs are
full of, and it keeps neither smoothing nor transparency apart. tinyobjloader has release candidates only.
"""

import dataclasses
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from embodied.assets.importing.meshing import face_normals

MAX_FACES = 2_000_000
FARTHEST_VERTEX = 1e12
"""Largest coordinate, of vertices in a file's own unit and of textures (the packs have some of 3e9)."""
MAX_CORNERS = 20_000
"""Of one polygon."""


Line = tuple[int, str]
"""A line's number, from 1, and what follows its first word."""
Polygon = tuple[Line, int, int]
"""The line of a face, and how many vertices and texture coordinates stand above it."""
CORRECT = "correct that line, or write the model with another program"
UNREAD = {"l": "lines", "p": "points", "curv": "curves", "curv2": "curves", "surf": "curved surfaces"}
COLOURS = {"Kd": "diffuse", "Ks": "specular", "Ke": "emission"}
SHARES = {"d": "dissolve", "Tr": "transparency", "Pr": "roughness", "Pm": "metallic"}
JOINED = "\x1f"
"""A blank that no line begins or ends with: where lines were joined."""
MAPS = {"map_kd": "texture", "map_d": "opacity_map"}
OPTIONS = {"s": 3, "o": 3, "t": 3, "mm": 2}
"""Numbers that an option of a map may take; others take one or a word."""


class MeshError(ValueError):
    """A mesh that cannot be used: says where and why."""


@dataclass(frozen=True)
class MtlMap:
    """A picture that an MTL file names, and how it is laid on: texture coordinates times `scale` plus `shift`."""

    name: str
    """As written: relative to the MTL file."""
    scale: tuple[float, float] = (1.0, 1.0)
    shift: tuple[float, float] = (0.0, 0.0)
    clamped: bool = False


@dataclass(frozen=True)
class MtlMaterial:
    """One material of an MTL file; colours are sRGB in [0, 1]."""

    name: str
    diffuse: tuple[float, float, float] = (0.8, 0.8, 0.8)
    specular: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shininess: float = 0.0
    dissolve: float | None = None
    """d: opacity."""
    transparency: float | None = None
    """Tr: 1 - d by the format; some programs write opacity here."""
    illum: int = 2
    roughness: float | None = None
    metallic: float | None = None
    texture: MtlMap | None = None
    """map_Kd."""
    opacity_map: MtlMap | None = None
    """map_d."""
    unread: tuple[str, ...] = ()
    """Statements that are not drawn: pictures such as map_Bump, and numbers that are none."""

    @property
    def opacity(self) -> float:
        """`dissolve`, or else what `transparency` leaves; a Tr of 1 alone is taken for opacity: nobody models air."""
        if self.dissolve is not None:
            return self.dissolve
        return 1.0 if self.transparency is None or self.transparency >= 1 else 1.0 - self.transparency


@dataclass(frozen=True, eq=False)
class MaterialFaces:
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
    groups: tuple[MaterialFaces, ...]
    libraries: tuple[str, ...]
    """Texts of its mtllib statements: the names of one or more MTL files each."""
    colours: np.ndarray | None = None
    """(n, 3) sRGB of the vertices, where the file gives them."""
    left_out: tuple[str, ...] = ()
    """Parts of its geometry that are not drawn, in words."""


def parse_obj(data: bytes, where: str) -> Obj:
    """Read an OBJ file; faces of one material are gathered from all its objects.

    Raises:
      MeshError: no faces, too many, indices out of range, or numbers that are not finite.
    """
    vertices: list[Line] = []
    uvs: list[Line] = []
    faces: dict[str, list[Polygon]] = {}
    libraries, left_out = [], set()
    current = faces.setdefault("", [])
    for number, head, rest in _statements(data):
        if head == "v":
            vertices.append((number, rest.partition("#")[0]))
        elif head == "vt":
            uvs.append((number, rest.partition("#")[0]))
        elif head == "f":
            current.append(((number, rest.partition("#")[0]), len(vertices), len(uvs)))
        elif head == "usemtl":
            current = faces.setdefault(rest, [])
        elif head == "mtllib":
            libraries.append(rest)
        elif head in UNREAD:
            left_out.add(f"its {UNREAD[head]} are left out; export them as triangles")
    points, lost_points = _finite_rows(_numbers(vertices, 3, where, "v"))
    coords, lost_coords = _finite_rows(_numbers([_pair(line) for line in uvs], 2, where, "vt"))
    groups = []
    for name, polygons in faces.items():
        rows = [_corners(polygon, len(points), len(coords), lost_coords, where) for polygon in polygons]
        sound = [row for row in rows if len(row) > 4 and not lost_points.intersection(row[: len(row) // 2])]
        if len(sound) < len(rows):
            left_out.add("some faces are left out: they have under three corners, or vertices that are not finite")
        group = _group(name, sound, points, where)
        if len(group.corners):
            groups.append(group)
        elif sound:
            left_out.add(f"faces of material {name!r} are left out: they have no area")
    if not groups:
        why = f" ({'; '.join(sorted(left_out))})" if left_out else ""
        raise MeshError(f"{where} has no faces that can be drawn{why}; export its surfaces as polygons")
    if (total := sum(len(g.corners) for g in groups)) > MAX_FACES:
        raise MeshError(f"{where} has {total} triangles, at most {MAX_FACES} are read; simplify the model")
    colours = _colours(vertices, where)
    return Obj(points, coords, tuple(groups), tuple(dict.fromkeys(libraries)), colours, tuple(sorted(left_out)))


def libraries(data: bytes) -> tuple[str, ...]:
    """Texts of the mtllib statements of an OBJ file, without reading its mesh."""
    return tuple(dict.fromkeys(rest for _, head, rest in _statements(data) if head == "mtllib"))


def decoded(data: bytes) -> str:
    """The text of an OBJ or MTL file, which is UTF-8 today and was Latin-1 once."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _statements(data: bytes) -> Iterator[tuple[int, str, str]]:
    """The number, the first word and the rest of every line; a backslash at its end joins it with the next."""
    text = decoded(data).replace("\r\n", "\n").replace("\r", "\n")
    number = 1
    for line in re.sub(r"\\[ \t]*\n", JOINED, text).split("\n"):
        head, *rest = line.split(None, 1) or [""]
        yield number, head, rest[0].strip() if rest else ""
        number += 1 + line.count(JOINED)


def parse_mtl(data: bytes) -> dict[str, MtlMaterial]:
    """The materials of an MTL file by name; statements it does not know are ignored."""
    materials: dict[str, MtlMaterial] = {}
    name = None
    for _, head, rest in _statements(data):
        if head == "newmtl":
            name = rest
            materials[name] = MtlMaterial(name)
        elif name is not None and rest:
            old = materials[name]
            try:
                change = _material_field(head, rest)
            except (ValueError, IndexError):
                change = {"unread": (*old.unread, head)}
            materials[name] = dataclasses.replace(old, **change)
    return materials


def _material_field(head: str, rest: str) -> dict[str, Any]:
    """The fields that a statement changes.

    Raises:
      ValueError, IndexError: it asks for a picture that is not drawn, or has no numbers where they belong.
    """
    if head.lower() in MAPS:
        return {MAPS[head.lower()]: _map(rest)}
    if head.lower().startswith(("map_", "bump", "disp", "decal", "norm", "refl")):
        raise ValueError("not drawn")
    words = rest.partition("#")[0].split()
    if head in COLOURS:
        values = [min(1.0, max(0.0, _finite(x))) for x in words[:3]]
        return {COLOURS[head]: tuple(values) if len(values) == 3 else (values[0],) * 3}
    if head in SHARES:
        return {SHARES[head]: min(1.0, max(0.0, _finite(words[-1])))}
    if head == "Ns":
        return {"shininess": _finite(words[0])}
    return {"illum": int(_finite(words[0]))} if head == "illum" else {}


def _finite(word: str) -> float:
    value = float(word)
    if not abs(value) <= FARTHEST_VERTEX:
        raise ValueError(f"{word} is not finite")
    return value


def _map(text: str) -> MtlMap:
    """A picture's options and its name, which may hold blanks."""
    options: dict[str, Any] = {}
    while option := re.match(r"-(\w+)\s+", text):
        text, number = text[option.end() :], re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s+", re.ASCII)
        values: list[float] = []
        while len(values) < OPTIONS.get(option[1], 1) and (m := number.match(text)):
            values.append(_finite(m[1]))
            text = text[m.end() :]
        if option[1] == "clamp":
            options["clamped"] = text.split(None, 1)[0] == "on"
        elif option[1] in ("s", "o") and values:
            first = 1.0 if option[1] == "s" else 0.0
            options["scale" if option[1] == "s" else "shift"] = (values[0], values[1] if len(values) > 1 else first)
        if not values and " " in text:  # a word: on, off, l
            text = text.split(None, 1)[1]
    return MtlMap(text.strip().strip('"'), **options)


def _colours(lines: list[Line], where: str) -> np.ndarray | None:
    """(n, 3) sRGB that follow the positions on the lines of vertices, from 0 to 1 or to 255; None for none."""
    if not lines or any(len(line.split()) < 6 for _, line in lines):
        return None
    colours = _numbers([(n, " ".join(line.split()[3:])) for n, line in lines], 3, where, "v x y z")
    colours = np.nan_to_num(colours, nan=1.0, posinf=1.0)
    return np.clip(colours / (255.0 if colours.max() > 1.0 else 1.0), 0, 1)


def _numbers(lines: list[Line], width: int, where: str, head: str) -> np.ndarray:
    """(n, width) float64 of lines that begin with `head`."""
    rows = np.empty((len(lines), width))
    for row, (number, line) in zip(rows, lines):
        try:
            words = line.split()
            row[:] = [float(words[k]) for k in range(width)]
        except (ValueError, IndexError) as e:
            raise MeshError(
                f"{where}, line {number}: {head!r} should have {width} numbers, got {line!r}; {CORRECT}"
            ) from e
    return rows


def _pair(line: Line) -> Line:
    """A line of texture coordinates, which may have one number only."""
    return line if len(line[1].split()) > 1 else (line[0], f"{line[1]} 0")


def _finite_rows(rows: np.ndarray) -> tuple[np.ndarray, frozenset[int]]:
    """Rows of finite numbers; those that are not, or lie too far away, are zeros, and are named."""
    good = (np.abs(rows) <= FARTHEST_VERTEX).all(axis=1)
    return np.where(good[:, None], rows, 0.0), frozenset(np.flatnonzero(~good).tolist())


def _corners(polygon: Polygon, points: int, uvs: int, lost_uvs: frozenset[int], where: str) -> list[int]:
    """The n vertices of a face and behind them its n texture coordinates, -1 where not all of them are there."""
    (number, text), points_above, uvs_above = polygon
    parts = [word.split("/") for word in text.split()]
    try:
        v = [_index(p[0], points_above, points) for p in parts]
        t = [_index(p[1], uvs_above, uvs) if len(p) > 1 and p[1] else -1 for p in parts]
    except (ValueError, IndexError) as e:
        raise MeshError(f"{where}, line {number}: a bad index in 'f {text}' ({e}); {CORRECT}") from e
    return v + (t if min(t, default=0) >= 0 and not lost_uvs.intersection(t) else [-1] * len(t))


def _group(name: str, rows: list[list[int]], points: np.ndarray, where: str) -> MaterialFaces:
    by_size: dict[int, list[list[int]]] = {}
    for row in rows:
        by_size.setdefault(len(row) // 2, []).append(row)
    corners, uv_corners = [np.empty((0, 3), np.int64)], [np.empty((0, 3), np.int64)]
    if max(by_size, default=0) > MAX_CORNERS:
        raise MeshError(
            f"{where} has a polygon of {max(by_size)} corners, at most {MAX_CORNERS} are read; simplify the model"
        )
    for n in sorted(by_size):
        table = np.array(by_size[n], dtype=np.int64)
        polygon, order = _split(table[:, :n], points)
        corners.append(np.take_along_axis(table[polygon, :n], order, axis=1))
        uv_corners.append(np.take_along_axis(table[polygon, n:], order, axis=1))
    return MaterialFaces(name, np.concatenate(corners), np.concatenate(uv_corners))


def _index(word: str, before: int, count: int) -> int:
    """From 0 on, of `count`; a negative one counts back from the `before` that stand above it in the file."""
    i = int(word)
    i = i - 1 if i > 0 else before + i if i < 0 else -1
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
        first = face_normals(points, v[:, [0, 1, 2]]), face_normals(points, v[:, [0, 2, 3]])
        fold = np.einsum("ij,ij->i", *first) < 0
        order = np.where(fold[:, None], [0, 1, 3, 1, 2, 3], [0, 1, 2, 0, 2, 3])
        return np.repeat(rows, 2), order.reshape(-1, 3)
    triples = [_triangles(points[row]) for row in v]
    polygon = np.repeat(rows, [len(t) for t in triples])
    return polygon, np.array([t for some in triples for t in some], dtype=np.int64).reshape(-1, 3)


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
    n, out = len(p), []
    before, after = np.roll(np.arange(n), 1), np.roll(np.arange(n), -1)
    left, hopeful = np.ones(n, bool), np.ones(n, bool)  # those that are ears, or to be looked at
    score, blocker = np.full(n, -np.inf), np.full(n, -1)
    for _ in range(n - 3):
        while hopeful[k := int(np.argmax(hopeful))] and score[k] < np.inf:
            score[k], blocker[k] = _looked_at(p, left, [before[k], k, after[k]])
            hopeful[k] = score[k] == np.inf
        k = k if hopeful[k] else int(np.argmax(score))
        a, b = before[k], after[k]
        out.append((int(a), k, int(b)))
        after[a], before[b] = b, a
        hopeful |= blocker == k
        hopeful[[a, b]] = True
        left[k] = hopeful[k] = False
        score[[a, b, k]], blocker[k] = -np.inf, -1
    a, b, c = np.flatnonzero(left).tolist()
    return [*out, (a, b, c)]


def _looked_at(p: np.ndarray, left: np.ndarray, triple: list[int]) -> tuple[float, int]:
    """How good it is to cut the triangle of three corners off, infinite for an ear; and a corner inside, or -1."""
    corners = p[triple].tolist()
    (ax, ay), (bx, by), (cx, cy) = corners
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if area <= 0:
        return area - 1e6, -1
    x, y = p.T
    inside = left & ((bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0)
    inside &= (cx - bx) * (y - by) - (cy - by) * (x - bx) >= 0
    within = np.flatnonzero(inside & ((ax - cx) * (y - cy) - (ay - cy) * (x - cx) >= 0))
    # Its own corners apart, which keyhole polygons visit twice.
    held = next((q for q in within[::-1].tolist() if p[q].tolist() not in corners), -1)
    return (np.inf, -1) if held < 0 else (-1e9, held)
