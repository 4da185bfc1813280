"""Doors, drawers and lids of furniture, curtains and blinds: found in its mesh by one rule, with what they close.

A front is a separate piece of the mesh, or several that belong together, which nothing covers and which carries one or
two handles. With its handle near one side it is a door, hung at the other; with its handle in the middle a drawer, or,
of ovens, a flap hung at its lower edge. Round doors and lids need no handle. What the front closes is cut open and
lined, with shelves in it; a drawer takes its box along.
"""

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from embodied.assets.built.parametric import PLAIN
from embodied.assets.built.primitives import box, lathe, part, tube
from embodied.assets.records import Finish, MeshPart
from embodied.assets.rows import DATA, Row, read_json

OPEN = "open/"
"""Start of the params of a placement that say how far its parts are open: ('open/left_door', 0.7)."""
OPENING_ROWS = read_json(DATA / "opening.json")
OPENING_CLASSES = frozenset(OPENING_ROWS)
"""Classes in whose models moving parts are looked for. A row may have a "kind": "flap" (doors hang at their lower edge
where the handle is in the middle), "round", "lid", "curtain", "blind"; "only_doors" where what looks like a drawer is
fixed; a "basin" that reaches so many metres below the upper edge of a front; the "skin" of its inside; and the classes
of what it "holds", in "drawers" where these hold something else (embodied.house.contents)."""
FULL_TURN = {"door": math.pi / 2, "flap": 1.45, "lid": 1.5}
"""Radians at openness 1; a drawer comes out by PULL of its depth."""
PULL = 0.75
LEAST_AREA, LEAST_SIDES = 0.008, (0.09, 0.08)
"""Square metres, and width and height in metres, of a front."""
FULL = 0.5
"""Share of its rectangle that a front fills; frames of joints fill less."""
TOUCH, ROUND_ABOUT = 0.0006, 0.0045
"""Metres by which pieces of one front may lie apart, and by which what belongs to it may stand out."""
BOARD, LAP = 0.12, 0.005
"""Width of the boards of a front's frame at most, and metres by which they lie over each other."""
GRIP, OFF_CENTRE = 0.007, 0.25
"""Metres that handles stand out at least, and the distance of a door's from the middle of its front, in widths."""
RIM, BACK, STEP = 0.014, 0.02, 0.34
"""Metres between an inside and the edge of its front, and the back of the thing, and about between shelves."""
FIXED, WITHIN = -1, -2
XZ = [0, 2]
Corners = tuple[np.ndarray, np.ndarray]
"""(3,) lowest and highest, metres."""


@dataclass(frozen=True, eq=False)
class MovingPart:
    """A door, drawer or lid, in the frame of its thing."""

    name: str
    """'door', 'left_door', 'door_2', 'drawer', 'drawer_1' (from below), 'lid', 'left_half', 'cloth'; unique."""
    kind: str
    """'door', 'flap', 'drawer', 'lid', 'blind', which rises to its roll, or 'curtain': half of a pair, which slides
    from the side to the middle."""
    axis: np.ndarray
    """(3,) unit: the way in which it slides, or what it turns about, right-handed."""
    origin: np.ndarray
    """(3,) a point that its axis goes through, metres."""
    reach: float
    """How far openness 1 is: radians, of what slides metres."""
    box: np.ndarray
    """(2, 3) lowest and highest corner of the front, without its handle."""
    handle: np.ndarray
    """(2, 3) likewise of the handle; of what has none, of where one would take hold."""
    inside: np.ndarray
    """(2, 3) likewise of what it closes; lids and curtains close nothing."""
    pieces: np.ndarray
    """Numbers of the connected pieces of the mesh that it consists of."""
    cut: bool
    """True where the thing must be cut open behind it."""
    floors: tuple[float, ...] = ()
    """z of what things can lie on behind it, or in it, upwards, and last of what is above; none where it is full."""

    @property
    def slides(self) -> bool:
        """True for what does not turn."""
        return self.kind in ("drawer", "curtain", "blind")

    @property
    def top(self) -> float:
        """z above which nothing of it is: a blind is rolled up there."""
        return float(self.box[1, 2]) if self.kind == "blind" else math.inf

    def turn(self, openness: float) -> tuple[np.ndarray, np.ndarray]:
        """(3, 3) rotation and (3,) metres that bring it from closed to open: rotation @ point + metres."""
        if self.slides:
            return np.eye(3), self.axis * (openness * self.reach)
        (x, y, z), angle = self.axis, openness * self.reach
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
        return turn, self.origin - turn @ self.origin


@dataclass(frozen=True, eq=False)
class TakenApart:
    """A thing whose parts move."""

    closed: tuple[MeshPart, ...]
    """The thing as it is."""
    moving: tuple[MovingPart, ...]
    labels: tuple[np.ndarray, ...]
    """(m,) int of the faces of each of its meshes: number of the part they belong to, or FIXED, or WITHIN."""
    holes: tuple[Corners, ...]
    """Holes by which it is cut open: (k, 3) unit directions in which a hole ends, and (k,) how far, metres."""
    fixed: tuple[MeshPart, ...]
    """Meshes that stay: cut open, without what is within."""
    within: tuple[MeshPart, ...]
    """The inside, which is seen when something is open."""
    parts: Mapping[str, tuple[MeshPart, ...]]
    """Meshes of the moving parts, closed, by name; drawers with their boxes."""

    def label_at(self, points: np.ndarray, openness: Mapping[str, float]) -> np.ndarray:
        """(k,) labels of the faces of the thing, open so far, whose middles are nearest to points (k, 3)."""
        groups: list[tuple[MeshPart, np.ndarray | int]] = list(zip(self.closed, self.labels, strict=True))
        if openness:  # what is closed does not show
            groups = [*((p, FIXED) for p in self.fixed), *((p, WITHIN) for p in self.within)]
            groups += [(p, k) for k, m in enumerate(self.moving) for p in self.parts[m.name]]
        label = np.concatenate([np.broadcast_to(of, len(p.faces)) for p, of in groups])
        middles = np.concatenate([p.vertices[p.faces].mean(1) for p, _ in groups])
        for k, m in enumerate(self.moving):
            turn, shift = m.turn(openness.get(m.name, 0.0))
            middles[label == k] = np.minimum(middles[label == k] @ turn.T + shift, [np.inf, np.inf, m.top])
        nearest: np.ndarray = label[cKDTree(middles).query(points)[1]]
        return nearest


@functools.lru_cache(maxsize=256)
def taken_apart(object_class: str, parts: tuple[MeshPart, ...]) -> TakenApart | None:
    """The moving parts of a thing; None where it has none that can be told from the rest.

    Args:
      parts: the meshes of a thing that is closed, in its own frame.
    """
    if (row := OPENING_ROWS.get(object_class)) is None:
        return None
    s = _Pieces.of(parts)
    special = {"lid": _lids, "curtain": _curtains, "blind": _blinds}.get(row.get("kind"))
    moving = _named(special(s) if special else _fronts(s, row))
    if not moving:
        return None
    label = np.full(len(s.low), FIXED)
    for k, m in enumerate(moving):
        label[m.pieces] = k
    held = [_within(s, m.inside) & (label == FIXED) for m in moving]
    label[np.any(held, axis=0)] = WITHIN
    labels = tuple(label[of] for of in s.of_face)
    holes = tuple(_hole(m, row.get("kind") == "round") for m in moving if m.cut)
    fixed = [part_without(p, holes) for p in _where(parts, labels, FIXED)]
    finish = max(fixed, key=lambda p: float(np.ptp(p.vertices, axis=0).prod())).finish
    within, meshes = list(_where(parts, labels, WITHIN)), {}
    for k, (m, holds) in enumerate(zip(moving, held, strict=True)):
        empty = not (holds & ((s.high - s.low) > 0.5 * np.ptp(m.inside, axis=0))[:, :2].all(1)).any()
        liner, own = _furnished(m, row, finish, empty) if m.cut else ([], [])
        if m.cut and empty and m.kind in ("door", "drawer") and row.get("kind") != "round":
            moving[k] = dataclasses.replace(m, floors=_floors(m))
        within += liner
        meshes[m.name] = (*_where(parts, labels, k), *own)
    return TakenApart(parts, tuple(moving), labels, holes, tuple(fixed), tuple(within), meshes)


def opened(object_class: str, parts: tuple[MeshPart, ...], openness: Mapping[str, float]) -> tuple[MeshPart, ...]:
    """A thing with some of its parts open, 0 to 1 by name.

    Raises:
      ValueError: it has no such part, or that cannot be open so far.
    """
    thing = taken_apart(object_class, parts)
    known = [m.name for m in thing.moving] if thing is not None else []
    if thing is None or (unknown := sorted({*openness} - {*known})):
        raise ValueError(f"a {object_class} has no {unknown} that opens; it has {known or 'nothing that does'}")
    if wrong := {name: x for name, x in openness.items() if not 0 <= x <= 1}:
        raise ValueError(f"openness should lie between 0 (closed) and 1 (open), got {wrong}")
    out = [*thing.fixed, *thing.within]
    for m in thing.moving:
        turn, shift = (a.astype(np.float32) for a in m.turn(openness.get(m.name, 0.0)))
        for p in thing.parts[m.name]:
            there = np.minimum(p.vertices @ turn.T + shift, np.array([np.inf, np.inf, m.top], np.float32))
            out.append(dataclasses.replace(p, vertices=there, normals=p.normals @ turn.T))
    return tuple(out)


def closed(params: Sequence[tuple[str, str | float]]) -> tuple[tuple[str, str | float], ...]:
    """The params of a placement without those that say how far it is open."""
    return tuple(x for x in params if not x[0].startswith(OPEN))


def openness_of(params: Sequence[tuple[str, str | float]]) -> dict[str, float]:
    """How far the parts of a placement are open, by name, from its params."""
    return {name.removeprefix(OPEN): float(value) for name, value in params if name.startswith(OPEN)}


def _where(parts: Sequence[MeshPart], labels: Sequence[np.ndarray], label: int) -> tuple[MeshPart, ...]:
    """The faces of one label."""
    out = []
    for p, of in zip(parts, labels, strict=True):
        if (of == label).any():
            used, faces = np.unique(p.faces[of == label], return_inverse=True)
            faces = faces.reshape(-1, 3).astype(np.int32)
            out.append(MeshPart(p.vertices[used], faces, p.normals[used], p.uv[used], p.finish))
    return tuple(out)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Connected pieces of all meshes of a thing; n of them."""

    low: np.ndarray
    high: np.ndarray
    """(n, 3) metres."""
    fill: np.ndarray
    """(n,) area of what looks forward, as a share of the rectangle around it."""
    of_face: tuple[np.ndarray, ...]
    """(m,) piece of each face, by mesh."""

    @staticmethod
    def of(parts: Sequence[MeshPart]) -> "_Pieces":
        of_face, first = [], 0
        for p in parts:
            _, welded = np.unique(np.round(p.vertices / 1e-4).astype(np.int64), axis=0, return_inverse=True)
            f = welded.ravel()[p.faces]
            links = coo_matrix(
                (np.ones(2 * len(f)), (f[:, [0, 1]].T.ravel(), f[:, [1, 2]].T.ravel())), [f.max() + 1] * 2
            )
            _, piece = np.unique(connected_components(links, directed=False)[1][f[:, 0]], return_inverse=True)
            of_face.append(piece + first)
            first += int(piece.max()) + 1
        of, corners = np.concatenate(of_face), np.concatenate([p.vertices[p.faces] for p in parts]).astype(float)
        low, high = np.full((first, 3), np.inf), np.full((first, 3), -np.inf)
        np.minimum.at(low, of, corners.min(1))
        np.maximum.at(high, of, corners.max(1))
        ahead = -np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 1] / 2
        around = np.maximum((high - low)[:, XZ].prod(1), 1e-9)
        return _Pieces(low, high, np.bincount(of, np.maximum(ahead, 0), first) / around, tuple(of_face))


def _within(s: _Pieces, corners: np.ndarray, by: float = 1e-4) -> np.ndarray:
    """(n,) bool: pieces inside a box."""
    return (s.low > corners[0] - by).all(1) & (s.high < corners[1] + by).all(1)


def _fronts(s: _Pieces, row: Row) -> list[MovingPart]:
    low, high, size = s.low, s.high, s.high - s.low
    whole = np.array([low.min(0), high.max(0)])
    depth = whole[1, 1] - whole[0, 1]
    deep, thin = size[:, 1] > 0.35 * depth, size[:, 1] < min(0.16, 0.35 * depth)
    solid = (s.fill > FULL) | (size[:, 1] > 0.008)
    holds = [
        (low < b + 1e-3)[:, XZ].all(1) & (high > c - 1e-3).all(1) & (low < a + 1e-3)[:, XZ].all(1) & deep
        for a, b, c in zip(low, low, high)
    ]
    drawer = deep & (np.sum(holds, axis=1) > 1) & (size[:, 2] < 0.5)
    seeds = np.flatnonzero(
        (size[:, XZ] > LEAST_SIDES).all(1)
        & (size[:, XZ].prod(1) > LEAST_AREA)
        & (s.fill > FULL)
        & (thin | drawer)
        & (low[:, 1] < whole[0, 1] + 0.4 * depth)
    )
    out: list[MovingPart] = []
    for seed in seeds[np.argsort(-size[seeds][:, XZ].prod(1))]:
        others = np.isin(np.arange(len(low)), [k for m in out for k in m.pieces])
        a, b, middle = low[seed].copy(), high[seed].copy(), (low[seed] + high[seed]) / 2
        covers = ((low < middle) & (high > middle))[seeds][:, XZ].all(1) & (low[seeds, 1] < a[1] - 0.03)
        if others[seed] or covers.any():
            continue
        for _ in range(4):
            near = _belongs(s, a, b) & thin & (low[:, 1] < low[seed, 1] + 0.03) & solid
            a[XZ] = np.minimum(a[XZ], low[near][:, XZ].min(0, initial=np.inf))
            b[XZ] = np.maximum(b[XZ], high[near][:, XZ].max(0, initial=-np.inf))
        frame = near & (high[:, 1] > middle[1]) & (size[:, XZ] > 0.5 * (b - a)[XZ]).any(1)
        a[1] = min(a[1], low[frame, 1].min(initial=np.inf))
        b[1] = min(b[1], a[1] + 0.16) if drawer[seed] else high[near, 1].max(initial=b[1])
        own = _within(s, np.array([[a[0], -np.inf, a[2]], b]), ROUND_ABOUT) & ~others
        own[seed] = True
        grips = _grips(s, np.flatnonzero(own & (low[:, 1] < a[1] - GRIP)), a[1])
        is_round = not out and abs(size[seed, 0] / size[seed, 2] - 1) < 0.1
        if is_round if row.get("kind") == "round" else 1 <= len(grips) <= 2:
            handle = np.array([np.min(grips[:2], (0, 1)), np.max(grips[:2], (0, 1))]) if grips else np.array([a, b])
            m = _hung(np.array([a, b]), handle, whole, row, np.flatnonzero(own), not drawer[seed])
            out += [m] if m.kind != "drawer" or "only_doors" not in row else []
    return out


def _belongs(s: _Pieces, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) bool: pieces of the front that a rectangle of x and z is part of: those in it, a frame around it, boards of
    a frame beside it."""
    low, high, a, b = s.low[:, XZ], s.high[:, XZ], a[XZ], b[XZ]
    out = ((low > a - ROUND_ABOUT) & (high < b + ROUND_ABOUT)).all(1)
    out |= ((low < a + TOUCH) & (high > b - TOUCH)).all(1) & ((high - low).prod(1) < 2.5 * (b - a).prod())
    for i, k in ((0, 1), (1, 0)):
        beside = (high[:, i] < a[i] + LAP) & (high[:, i] > a[i] - TOUCH)
        beside |= (low[:, i] > b[i] - LAP) & (low[:, i] < b[i] + TOUCH)
        along = (low[:, k] < a[k] + LAP) & (low[:, k] > a[k] - BOARD)
        along &= (high[:, k] > b[k] - LAP) & (high[:, k] < b[k] + BOARD)
        out |= along & beside & (high[:, i] - low[:, i] < BOARD)
    return out


def _grips(s: _Pieces, pieces: np.ndarray, face: float) -> list[Corners]:
    """Corners of the handles among pieces that stand out: those that stand out most, each in one."""
    groups: list[Corners] = []
    for k in pieces:
        meets = [((s.low[k] < b + 0.01) & (s.high[k] > a - 0.01)).all() for a, b in groups]
        some = [(s.low[k], s.high[k]), *(g for g, m in zip(groups, meets, strict=True) if m)]
        groups = [g for g, m in zip(groups, meets, strict=True) if not m]
        groups.append((np.min([a for a, _ in some], 0), np.max([b for _, b in some], 0)))
    most = max((face - a[1] for a, _ in groups), default=0.0)
    return [(a, b) for a, b in groups if face - a[1] > 0.6 * most and (b - a).max() > 0.02]


def _hung(
    front: np.ndarray, handle: np.ndarray, whole: np.ndarray, row: Row, pieces: np.ndarray, cut: bool
) -> MovingPart:
    """The moving part that a front with its handle is; its name is its kind."""
    (x0, face, z0), (x1, back, z1) = front
    w, h, is_round = x1 - x0, z1 - z0, row.get("kind") == "round"
    off = (handle[:, 0].mean() - (x0 + x1) / 2) / w or 0.3 * is_round
    rim, deep = (0.2 * w, 0.1) if is_round else (RIM, BACK)
    ceiling = max(z1 - rim - row.get("basin", 0.0), z0 + 0.05)
    inside = np.array([[x0 + rim, back, z0 + rim], [x1 - rim, whole[1, 1] - deep, ceiling]])
    if row.get("kind") == "flap" and abs(off) < OFF_CENTRE and h > 0.2:
        kind, axis, origin = "flap", [1.0, 0, 0], [(x0 + x1) / 2, face, z0]
    elif abs(off) >= OFF_CENTRE or is_round or h > max(0.5, 1.6 * w):
        kind, axis, origin = "door", [0, 0, -np.sign(off)], [x0 if off > 0 else x1, face, (z0 + z1) / 2]
    else:
        kind, axis, origin = "drawer", [0, -1.0, 0], front.mean(0).tolist()
    reach = FULL_TURN.get(kind, PULL * float(inside[1, 1] - back))
    return MovingPart(kind, kind, np.array(axis), np.array(origin), reach, front, handle, inside, pieces, cut)


def _lids(s: _Pieces) -> list[MovingPart]:
    """The lid of a toilet or chest: the highest flat piece that covers most of what is below, hung at its back."""
    size, low, high = s.high - s.low, s.low.min(0), s.high.max(0)
    flat = (size < [9, 9, 0.25]).all(1) & (size[:, 2] < 0.3 * (high - low)[2]) & (s.low[:, 2] > 0.3 * high[2])
    flat &= (size[:, :2] > [0.75, 0.4] * (high - low)[:2]).all(1)
    if not flat.any():
        return []
    lid = np.flatnonzero(flat)[np.argmax(s.high[flat, 2])]
    a, b = front = np.array([s.low[lid], s.high[lid]])
    x = (a[0] + b[0]) / 2
    handle = np.array([[x - 0.05, a[1], a[2]], [x + 0.05, a[1] + 0.02, b[2]]])
    pieces, hinge = np.flatnonzero(_within(s, front, ROUND_ABOUT)), np.array([x, b[1], b[2]])
    none, axis = np.array([b, b]), np.array([-1.0, 0, 0])
    return [MovingPart("lid", "lid", axis, hinge, FULL_TURN["lid"], front, handle, none, pieces, False)]


def _curtains(s: _Pieces) -> list[MovingPart]:
    """The halves of a pair of curtains, each with its rings; none where they do not hang on both sides."""
    size, low, high = s.high - s.low, s.low.min(0), s.high.max(0)
    middle, rings = (low[0] + high[0]) / 2, (size < [0.006, 0.06, 0.06]).all(1)
    halves = []
    for side in (-1, 1):
        own = np.where(side > 0, s.low[:, 0] > middle, s.high[:, 0] < middle)
        sheets = own & (size[:, 2] > 0.5 * (high - low)[2])
        if not sheets.any():
            return []
        box = np.array([s.low[sheets].min(0), s.high[sheets].max(0)])
        edge, pieces = box[(side < 0) * 1, 0], np.flatnonzero(own & (sheets | rings))
        grip = np.array([[edge - 0.02, box[0, 1], box[0, 2] + 1.0], [edge + 0.02, box[0, 1] + 0.02, box[0, 2] + 1.1]])
        way, none = np.array([-1.0 * side, 0, 0]), box[[1, 1]]
        halves.append(
            MovingPart("half", "curtain", way, box.mean(0), abs(edge - middle), box, grip, none, pieces, False)
        )
    return halves


def _blinds(s: _Pieces) -> list[MovingPart]:
    """The cloth of a blind with the bar at its foot, which rises to its roll; none where they are not told apart."""
    size, low, high = s.high - s.low, s.low.min(0), s.high.max(0)
    foot = s.low[:, 2] < low[2] + 1e-4
    cloth = ~foot & (size > 0.7 * (high - low))[:, XZ].all(1)
    if not cloth.any():
        return []
    box, bar = (np.array([s.low[some].min(0), s.high[some].max(0)]) for some in (cloth, foot))
    reach = float(2 * box[1, 2] - high[2] - bar[1, 2])  # the cloth ends at the axis of its roll
    pieces, up = np.flatnonzero(cloth | foot), np.array([0, 0, 1.0])
    return [MovingPart("cloth", "blind", up, box.mean(0), reach, box, bar, box[[1, 1]], pieces, False)]


def _named(parts: Sequence[MovingPart]) -> list[MovingPart]:
    """The parts in order, with names: what is alone has no number, two doors beside each other are left and right."""
    out = []
    words = {"door": ["door", "flap"], "drawer": ["drawer"], "lid": ["lid"], "half": ["curtain"], "cloth": ["blind"]}
    for word, kinds in words.items():
        some = sorted((p for p in parts if p.kind in kinds), key=lambda p: (round(p.box[0, 2], 2), p.box[0, 0]))
        names = [word] if len(some) == 1 else [f"{word}_{k + 1}" for k in range(len(some))]
        if len(some) == 2 and word in ("door", "half") and some[0].box[1, 0] < some[1].box[0, 0] + 0.01:
            names = [f"left_{word}", f"right_{word}"]
        out += [dataclasses.replace(p, name=name) for p, name in zip(some, names, strict=True)]
    return out


def _hole(m: MovingPart, is_round: bool) -> Corners:
    """As TakenApart.holes."""
    low, high = m.inside + [[-1e-3], [1e-3]]
    low[1] = m.box[0, 1] - 2e-3
    turn = np.linspace(0, 2 * np.pi, 25 if is_round else 5)[:-1]
    ways = np.array([*np.stack([np.cos(turn), 0 * turn, np.sin(turn)], 1), [0, 1, 0], [0, -1, 0]])
    return ways, ways @ (low + high) / 2 + np.linalg.norm(ways * (high - low) / 2, axis=1)


def cut_open(
    holes: Sequence[Corners], rows: np.ndarray, faces: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut all holes into a mesh whose vertices (n, 3 + k) are positions and k other values.

    Returns:
      The vertices, the old ones first, the faces, and, for each of these, the one that it was.
    """
    source = np.arange(len(faces))
    for ways, far in holes:
        over = rows[faces, :3] @ ways.T - far
        outside, inside = np.any((over > 0).all(1), axis=1), np.all(over <= 0, axis=(1, 2))
        pieces: list[np.ndarray] = []
        cut: list[int] = []
        for k in np.flatnonzero(~(outside | inside)):
            rest = rows[faces[k]]
            for way, end in zip(ways, far, strict=True):
                apart, rest = _halves(rest, way, float(end))
                pieces += [apart[[0, i, i + 1]] for i in range(1, len(apart) - 1)]
                cut += [int(k)] * max(len(apart) - 2, 0)
                if len(rest) < 3:
                    break
        own = np.arange(3 * len(pieces)).reshape(-1, 3) + len(rows)
        rows = np.concatenate([rows, np.array(pieces, rows.dtype).reshape(-1, rows.shape[1])])
        faces = np.concatenate([faces[outside], own]).astype(np.int32)
        source = np.concatenate([source[outside], source[np.array(cut, int)]])
    return rows, faces, source


def part_without(p: MeshPart, holes: Sequence[Corners]) -> MeshPart:
    """A mesh with holes cut into it."""
    rows, faces, _ = cut_open(holes, np.concatenate([p.vertices, p.normals, p.uv], axis=1), p.faces)
    return MeshPart(rows[:, :3], faces, rows[:, 3:6], rows[:, 6:], p.finish)


def _halves(polygon: np.ndarray, way: np.ndarray, far: float) -> Corners:
    """The parts of a convex polygon, (k, 3 and more), that lie farther along a way than `far`, and not."""
    apart: list[np.ndarray] = []
    rest: list[np.ndarray] = []
    over = polygon[:, :3] @ way - far
    for k, a in enumerate(over):
        here, following, b = polygon[k], polygon[(k + 1) % len(over)], over[(k + 1) % len(over)]
        (apart if a > 0 else rest).append(here)
        if (a > 0) != (b > 0):
            apart.append(here + (following - here) * (a / (a - b)))
            rest.append(apart[-1])
    return np.array(apart), np.array(rest)


def _furnished(m: MovingPart, row: Row, finish: Finish, empty: bool) -> tuple[list[MeshPart], list[MeshPart]]:
    """The inside that a part closes, with shelves where it is empty, and what the part takes along."""
    (x0, y0, z0), (x1, y1, z1) = m.inside
    skin = PLAIN[row["skin"]] if "skin" in row else finish
    if row.get("kind") == "round":
        r, deep = (x1 - x0) / 2, y0 - y1
        drum = lathe([(0, deep), (r + RIM, deep), (r + RIM, 0), (r, 0), (r, deep + 0.01), (0, deep + 0.01)], 24)
        return [part(skin, drum.hung((x0 + x1) / 2, y0, (z0 + z1) / 2))], []
    (a, _, c), (b, _, d) = m.box
    walls = [((a, y0, c), (x0, y1, d)), ((x1, y0, c), (b, y1, d)), ((x0, y0, c), (x1, y1, z0))]
    walls += [((a, y1, c), (b, y1 + 0.01, z1)), ((x0, y0, z1), (x1, y0 + RIM if "basin" in row else y1, d))]
    inside = [part(skin, *(box(p, q) for p, q in walls))]
    boards = boards_of(m)
    built = [part(skin, *(box(p, q, 0.001) for p, q in boards))] if boards and empty else []
    if m.kind == "drawer":
        return inside, built
    if m.kind == "flap":
        wires = [(y, z) for y in np.linspace(y0 + 0.03, y1 - 0.02, 9) for z in z0 + (z1 - z0) * np.array([0.3, 0.65])]
        inside.append(part(PLAIN["steel"], *(tube([(x0, y, z), (x1, y, z)], 0.003, 5) for y, z in wires)))
    return [*inside, *built], []


def _floors(m: MovingPart) -> tuple[float, ...]:
    """As MovingPart.floors, of one that is empty."""
    low, high = m.inside[:, 2].tolist()
    return (low + 0.011, high) if m.kind == "drawer" else (low, *(float(top[2]) for _, top in boards_of(m)), high)


def boards_of(m: MovingPart) -> list[Corners]:
    """Corners of a drawer's box, ground, sides and back, or of the shelves behind a door that has none."""
    (x0, y0, z0), (x1, y1, z1) = m.inside
    if m.kind == "drawer":
        (x0, y0, z0), (x1, y1, z1) = m.inside + [[0.006, 0, 0.004], [-0.006, -0.02, -0.012]]
        top, b = z0 + 0.8 * (z1 - z0), 0.012
        walls = [((x0, y0), (x0 + b, y1)), ((x1 - b, y0), (x1, y1)), ((x0, y1 - b), (x1, y1))]
        boards = [((*p, z0), (*q, top)) for p, q in walls] + [((x0, y0, z0), (x1, y1, z0 + 0.006))]
    else:
        levels = np.linspace(z0, z1, max(1, round((z1 - z0) / STEP)) + 1)[1:-1]
        boards = [((x0, y0 + 0.03, z - 0.009), (x1, y1, z + 0.009)) for z in levels if m.kind == "door"]
    return [(np.array(p), np.array(q)) for p, q in boards]
