"""Doors, drawers and lids of furniture: found in its mesh by one rule, with the inside that they close.

A front is a separate piece of the mesh, or several that overlap, which nothing covers and which carries one or two
handles. With its handle near one side it is a door, hung at the other; with its handle in the middle a drawer, or, of
ovens and the like, a flap hung at its lower edge. Round doors and lids need no handle. What the front closes is cut
open and lined, with shelves in it; a drawer takes its box along.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from embodied.assets.built.parametric import plain
from embodied.assets.built.primitives import box, lathe, part, tube
from embodied.assets.records import Finish, MeshPart

OPEN = "open/"
"""Start of the params of a placement that say how far its parts are open: ('open/left_door', 0.7)."""
FLAPS = frozenset({"cooker", "toaster oven"})
"""Classes whose doors hang at their lower edge, where the handle is in the middle."""
ROUND = frozenset({"washing machine", "tumble dryer"})
LIDS = frozenset({"toilet", "chest freezer"})
BASINS = frozenset({"kitchen sink", "bathroom vanity", "double vanity"})
"""Classes that hold a basin above the inside."""
PALE = frozenset({"fridge", "kitchen sink", "microwave"})
"""Classes that are white inside."""
ONLY_DOORS = frozenset({"microwave", "safe", "wall cabinet", "corner base cabinet"})
"""Classes that have no drawers: what looks like one is a panel of controls, or fixed."""
CUPBOARDS = frozenset(
    """base cabinet;bathroom vanity;bedside table;changing table;corner base cabinet;corner wall cabinet;cupboard;desk
    double vanity;drawer cabinet;dresser;dressing table;filing cabinet;fridge;glass-door cabinet;kitchen island
    kitchen sink;locker;media cabinet;microwave;office cabinet;oven cabinet;safe;sideboard;tall cabinet;tv stand
    wall cabinet;wall unit;wardrobe;workbench""".replace("\n    ", ";").split(";")
)
OPENING_CLASSES = CUPBOARDS | FLAPS | ROUND | LIDS
"""Classes in whose models moving parts are looked for."""
REACH = {"door": math.pi / 2, "flap": 1.45, "lid": 1.5}
"""Radians at openness 1."""
PULL = 0.75
"""Share of its depth that a drawer comes out."""
LEAST_AREA, LEAST_SIDES = 0.008, (0.09, 0.08)
"""Square metres, and width and height in metres, of a front."""
FULL = 0.5
"""Share of its rectangle that a front fills; frames of joints fill less."""
TOUCH, ROUND_ABOUT = 0.0006, 0.0045
"""Metres by which pieces of one front may lie apart, and by which what belongs to it may stand out."""
BOARD, LAP = 0.12, 0.005
"""Width of the boards of a front's frame at most, and metres by which they lie over each other."""
GRIP = 0.007
"""Metres that handles stand out at least."""
OFF_CENTRE = 0.25
"""Distance of a door's handle from the middle of its front, in widths."""
RIM = 0.014
"""Width of the frame around what a front closes, metres."""
BASIN = 0.16
"""Metres below a front's upper edge that a basin reaches."""
BACK = 0.02
"""Metres between an inside and the back of the thing."""
STEP = 0.34
"""Metres between shelves, about."""
WHITE, STEEL, DARK = plain((0.86, 0.86, 0.84), 0.5), plain((0.6, 0.6, 0.6), 0.3, 1.0), plain((0.12, 0.12, 0.12), 0.5)


@dataclass(frozen=True, eq=False)
class MovingPart:
    """A door, drawer or lid, in the frame of its thing."""

    name: str
    """'door', 'left_door', 'door_2', 'drawer', 'drawer_1' (from below), 'lid'; unique in its thing."""
    kind: str
    """'door', 'flap', 'drawer' or 'lid'."""
    axis: np.ndarray
    """(3,) unit: a drawer's way out, or what it turns about, right-handed."""
    origin: np.ndarray
    """(3,) a point that its axis goes through, metres."""
    reach: float
    """How far openness 1 is: radians, of drawers metres."""
    box: np.ndarray
    """(2, 3) lowest and highest corner of the front, without its handle."""
    handle: np.ndarray
    """(2, 3) likewise of the handle; of what has none, of where one would take hold."""
    inside: np.ndarray
    """(2, 3) likewise of what it closes; a lid closes nothing."""

    @property
    def slides(self) -> bool:
        return self.kind == "drawer"

    def turn(self, openness: float) -> tuple[np.ndarray, np.ndarray]:
        """(3, 3) rotation and (3,) metres that bring it from closed to open: rotation @ point + metres."""
        if self.slides:
            return np.eye(3), self.axis * (openness * self.reach)
        x, y, z = self.axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        angle = openness * self.reach
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
    fixed: tuple[MeshPart, ...]
    """What stays: cut open, without what is within."""
    within: tuple[MeshPart, ...]
    """The inside, which is seen when something is open."""
    parts: Mapping[str, tuple[MeshPart, ...]]
    """Meshes of the moving parts, closed, by name; drawers with their boxes."""
    holes: tuple[_Hole, ...]
    """Where the thing must be cut open."""

    def label_at(self, points: np.ndarray, openness: Mapping[str, float]) -> np.ndarray:
        """(k,) labels of the faces of the thing, open so far, whose middles are nearest to points (k, 3)."""
        tree, label = self._middles(tuple(sorted(openness.items())))
        return label[tree.query(points)[1]]

    def _middles(self, openness: tuple[tuple[str, float], ...]) -> tuple[cKDTree, np.ndarray]:
        label = np.concatenate(self.labels)
        middles = np.concatenate([p.vertices[p.faces].mean(1) for p in self.closed])
        for name, value in openness:
            k = next(k for k, m in enumerate(self.moving) if m.name == name)
            turn, shift = self.moving[k].turn(value)
            middles[label == k] = middles[label == k] @ turn.T + shift
        return cKDTree(middles), label


FIXED, WITHIN = -1, -2


@functools.lru_cache(maxsize=256)
def taken_apart(object_class: str, parts: tuple[MeshPart, ...]) -> TakenApart | None:
    """The moving parts of a thing; None where it has none that can be told from the rest.

    Args:
      parts: the meshes of a thing that is closed, in its own frame.
    """
    if object_class not in OPENING_CLASSES:
        return None
    pieces = _Pieces.of(parts)
    fronts = [*_lids(pieces)] if object_class in LIDS else [*_fronts(pieces, object_class)]
    if not fronts:
        return None
    moving = _named([f.part for f in fronts])
    order = [next(k for k, f in enumerate(fronts) if f.part.box is m.box) for m in moving]
    label = np.full(len(pieces.low), FIXED)
    for number, k in enumerate(order):
        label[fronts[k].pieces] = number
    for m in moving:
        low, high = m.inside
        label[(label == FIXED) & ((pieces.low > low - 1e-4) & (pieces.high < high + 1e-4)).all(1)] = WITHIN
    labels = tuple(label[of] for of in pieces.of_face)
    holes = tuple(_Hole.of(m, object_class in ROUND) for k, m in zip(order, moving, strict=True) if fronts[k].cut)
    fixed = tuple(_cut_part(p, holes) for p in parts_where(parts, labels, FIXED))
    finish = max((p for p in fixed), key=lambda p: float(np.ptp(p.vertices, axis=0).prod())).finish
    inside = [*parts_where(parts, labels, WITHIN)]
    meshes = {}
    for number, (k, m) in enumerate(zip(order, moving, strict=True)):
        meshes[m.name] = parts_where(parts, labels, number)
        if fronts[k].cut:
            low, high = m.inside
            flat = ((pieces.high - pieces.low)[:, :2] > 0.5 * (high - low)[:2]).all(1) & (label == WITHIN)
            empty = not (flat & (pieces.low > low - 1e-3).all(1) & (pieces.high < high + 1e-3).all(1)).any()
            liner, own = _furnished(m, object_class, finish, empty)
            inside += liner
            meshes[m.name] += own
    return TakenApart(parts, tuple(moving), labels, fixed, tuple(inside), meshes, holes)


def opened(object_class: str, parts: tuple[MeshPart, ...], openness: Mapping[str, float]) -> tuple[MeshPart, ...]:
    """A thing with some of its parts open, 0 to 1 by name.

    Raises:
      ValueError: it has no such part.
    """
    thing = taken_apart(object_class, parts)
    check_names(object_class, thing, openness)
    assert thing is not None
    out = [*thing.fixed, *thing.within]
    for m in thing.moving:
        turn, shift = m.turn(openness.get(m.name, 0.0))
        for p in thing.parts[m.name]:
            vertices, normals = p.vertices @ turn.T + shift, p.normals @ turn.T
            out.append(dataclasses.replace(p, vertices=vertices.astype(np.float32), normals=normals.astype(np.float32)))
    return tuple(out)


def openness_of(params: Sequence[tuple[str, str | float]]) -> dict[str, float]:
    """How far the parts of a placement are open, by name, from its params."""
    return {name.removeprefix(OPEN): float(value) for name, value in params if name.startswith(OPEN)}


def check_names(object_class: str, thing: TakenApart | None, names: Sequence[str] | Mapping[str, float]) -> None:
    """Refuse names of parts that a thing does not have.

    Raises:
      ValueError: it names them, and those that there are.
    """
    known = [m.name for m in thing.moving] if thing is not None else []
    if unknown := sorted(set(names) - set(known)):
        raise ValueError(f"this {object_class} has no {unknown} that opens; it has {known or 'nothing that does'}")


def parts_where(parts: Sequence[MeshPart], labels: Sequence[np.ndarray], label: int) -> tuple[MeshPart, ...]:
    """The faces of one label."""
    return tuple(_faces(p, of == label) for p, of in zip(parts, labels, strict=True) if (of == label).any())


def _faces(p: MeshPart, keep: np.ndarray) -> MeshPart:
    used, faces = np.unique(p.faces[keep], return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int32)
    return MeshPart(p.vertices[used], faces, p.normals[used], p.uv[used], p.finish)


# ------------------------------------------------------------------ finding


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
    def of(parts: Sequence[MeshPart]) -> _Pieces:
        lows, highs, fills, of_face, first = [], [], [], [], 0
        for p in parts:
            _, welded = np.unique(np.round(p.vertices / 1e-4).astype(np.int64), axis=0, return_inverse=True)
            f = welded.ravel()[p.faces]
            n = int(f.max()) + 1
            links = coo_matrix((np.ones(2 * len(f)), (f[:, [0, 1]].T.ravel(), f[:, [1, 2]].T.ravel())), (n, n))
            _, piece = np.unique(connected_components(links, directed=False)[1][f[:, 0]], return_inverse=True)
            corners = p.vertices[p.faces].astype(float)
            count = int(piece.max()) + 1
            low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
            np.minimum.at(low, piece, corners.min(1))
            np.maximum.at(high, piece, corners.max(1))
            ahead = -np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 1] / 2
            area = np.bincount(piece, np.maximum(ahead, 0), count)
            lows.append(low), highs.append(high), of_face.append(piece + first)
            fills.append(area / np.maximum(np.prod((high - low)[:, [0, 2]], axis=1), 1e-9))
            first += count
        return _Pieces(np.concatenate(lows), np.concatenate(highs), np.concatenate(fills), tuple(of_face))


@dataclass(frozen=True, eq=False)
class _Front:
    part: MovingPart
    pieces: np.ndarray
    cut: bool
    """True where the thing must be cut open behind it."""


def _fronts(s: _Pieces, object_class: str) -> list[_Front]:
    low, high = s.low, s.high
    size = high - low
    whole = np.array([low.min(0), high.max(0)])
    depth = whole[1, 1] - whole[0, 1]
    wide = (size[:, 0] > LEAST_SIDES[0]) & (size[:, 2] > LEAST_SIDES[1]) & (size[:, 0] * size[:, 2] > LEAST_AREA)
    thin = size[:, 1] < min(0.16, 0.35 * depth)
    before = low[:, 1] < whole[0, 1] + 0.4 * depth
    deep = size[:, 1] > 0.35 * depth
    sides = [0, 2]
    holds = lambda a, b: (low[:, sides] < a[sides] + 1e-3).all(1) & (high[:, sides] > b[sides] - 1e-3).all(1)
    held = np.array([(deep & holds(a, b) & (high[:, 1] > b[1] - 1e-3)).sum() > 1 for a, b in zip(low, high)])
    solid = (s.fill > FULL) | (size[:, 1] > 0.008)
    drawer = deep & held & (size[:, 2] < 0.5)
    seeds = np.flatnonzero(wide & before & (s.fill > FULL) & (thin | drawer))
    out: list[_Front] = []
    for seed in seeds[np.argsort(-(size[seeds, 0] * size[seeds, 2]))]:
        if any(seed in f.pieces for f in out):
            continue
        a, b = low[seed].copy(), high[seed].copy()
        face = a[1]
        if _covers(s, seed, seeds).any():
            continue
        for _ in range(4):
            near = _belongs(s, a, b) & thin & (low[:, 1] < face + 0.03) & solid
            a[[0, 2]] = np.minimum(a[[0, 2]], low[near][:, [0, 2]].min(0, initial=np.inf))
            b[[0, 2]] = np.maximum(b[[0, 2]], high[near][:, [0, 2]].max(0, initial=-np.inf))
        frame = (
            near & (high[:, 1] > (low[seed, 1] + high[seed, 1]) / 2) & (size[:, [0, 2]] > 0.5 * (b - a)[[0, 2]]).any(1)
        )
        face = min(face, low[frame, 1].min(initial=face))
        back = min(b[1], face + 0.16) if drawer[seed] else max(b[1], high[near][:, 1].max(initial=-np.inf))
        own = (low[:, [0, 2]] > a[[0, 2]] - ROUND_ABOUT).all(1) & (high[:, [0, 2]] < b[[0, 2]] + ROUND_ABOUT).all(1)
        own &= (high[:, 1] < back + 0.004) | (np.arange(len(low)) == seed)
        own &= ~np.isin(np.arange(len(low)), [p for f in out for p in f.pieces])
        grips = _grips(s, np.flatnonzero(own & (low[:, 1] < face - GRIP)), face)
        if object_class in ROUND:
            if out or abs(size[seed, 0] / size[seed, 2] - 1) > 0.1:
                continue
        elif not 1 <= len(grips) <= 2:
            continue
        grips = grips[:2]
        front = np.array([[a[0], face, a[2]], [b[0], back, b[2]]])
        pieces = np.flatnonzero(own)
        handle = np.array([np.min([g[0] for g in grips], 0), np.max([g[1] for g in grips], 0)]) if grips else front
        hung = _hung(front, handle, whole, object_class)
        if object_class not in ONLY_DOORS or hung.kind != "drawer":
            out.append(_Front(hung, pieces, not drawer[seed]))
    return out


def _covers(s: _Pieces, seed: int, seeds: np.ndarray) -> np.ndarray:
    """(k,) bool: which of `seeds` stand before the middle of one by more than a handle is thick."""
    middle = (s.low[seed] + s.high[seed]) / 2
    at = (s.low[seeds] < middle) & (middle < s.high[seeds])
    return at[:, 0] & at[:, 2] & (s.low[seeds, 1] < s.low[seed, 1] - 0.03) & (seeds != seed)


def _belongs(s: _Pieces, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) bool: pieces of the front that a rectangle of x and z is part of: those in it, a frame around it, boards of
    a frame beside it."""
    low, high, a, b = s.low[:, [0, 2]], s.high[:, [0, 2]], a[[0, 2]], b[[0, 2]]
    within = ((low > a - ROUND_ABOUT) & (high < b + ROUND_ABOUT)).all(1)
    around = ((low < a + TOUCH) & (high > b - TOUCH)).all(1) & ((high - low).prod(1) < 2.5 * (b - a).prod())
    out = within | around
    for i, k in ((0, 1), (1, 0)):
        meets = np.minimum(high[:, i], b[i]) - np.maximum(low[:, i], a[i])
        along = (low[:, k] < a[k] + LAP) & (low[:, k] > a[k] - BOARD) & (high[:, k] > b[k] - LAP)
        along &= high[:, k] < b[k] + BOARD
        out |= along & (meets > -TOUCH) & (meets < LAP) & (high[:, i] - low[:, i] < BOARD)
    return out


def _grips(s: _Pieces, pieces: np.ndarray, face: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Corners of the handles among pieces that stand out: those that stand out most, each in one."""
    groups: list[tuple[np.ndarray, np.ndarray]] = []
    for k in pieces:
        a, b = s.low[k], s.high[k]
        meets = [((a < g[1] + 0.01) & (b > g[0] - 0.01)).all() for g in groups]
        a, b = (
            f([x, *(g[i] for g, m in zip(groups, meets) if m)], axis=0) for i, x, f in ((0, a, np.min), (1, b, np.max))
        )
        groups = [*(g for g, m in zip(groups, meets) if not m), (a, b)]
    most = max((face - a[1] for a, _ in groups), default=0.0)
    return [(a, b) for a, b in groups if face - a[1] > 0.6 * most and (b - a).max() > 0.02]


def _hung(front: np.ndarray, handle: np.ndarray, whole: np.ndarray, object_class: str) -> MovingPart:
    """The moving part that a front with its handle is; the name is its kind."""
    (x0, face, z0), (x1, back, z1) = front
    off = (handle[:, 0].mean() - (x0 + x1) / 2) / (x1 - x0)
    below = BASIN if object_class in BASINS else 0.0
    inside = np.array([[x0 + RIM, back, z0 + RIM], [x1 - RIM, whole[1, 1] - BACK, max(z1 - RIM - below, z0 + 0.05)]])
    if object_class in ROUND:
        inset = 0.2 * (x1 - x0)
        inside = np.array([[x0 + inset, back, z0 + inset], [x1 - inset, whole[1, 1] - 0.1, z1 - inset]])
        off = off or 0.3
    if object_class in FLAPS and abs(off) < OFF_CENTRE and z1 - z0 > 0.2:
        kind, axis, origin = "flap", [1.0, 0, 0], [(x0 + x1) / 2, face, z0]
    elif abs(off) >= OFF_CENTRE or object_class in ROUND or z1 - z0 > max(0.5, 1.6 * (x1 - x0)):
        left = off > 0
        kind, axis, origin = "door", [0, 0, -1.0 if left else 1.0], [x0 if left else x1, face, (z0 + z1) / 2]
    else:
        kind, axis, origin = "drawer", [0, -1.0, 0], front.mean(0).tolist()
    reach = PULL * float(inside[1, 1] - inside[0, 1]) if kind == "drawer" else REACH[kind]
    return MovingPart(kind, kind, np.array(axis), np.array(origin), reach, front, handle, inside)


def _lids(s: _Pieces) -> list[_Front]:
    """The lid of a toilet or chest: the highest flat piece that covers most of what is below, hung at its back."""
    size, low, high = s.high - s.low, s.low.min(0), s.high.max(0)
    flat = (size[:, 2] < 0.3 * (high - low)[2]) & (size[:, 2] < 0.25) & (size[:, 0] > 0.75 * (high - low)[0])
    flat &= (size[:, 1] > 0.4 * (high - low)[1]) & (s.low[:, 2] > 0.3 * high[2])
    if not flat.any():
        return []
    lid = np.flatnonzero(flat)[np.argmax(s.high[flat, 2])]
    a, b = s.low[lid], s.high[lid]
    own = (s.low > a - ROUND_ABOUT).all(1) & (s.high < b + ROUND_ABOUT).all(1)
    front = np.array([a, b])
    handle = np.array([[(a[0] + b[0]) / 2 - 0.05, a[1], a[2]], [(a[0] + b[0]) / 2 + 0.05, a[1] + 0.02, b[2]]])
    m = MovingPart(
        "lid",
        "lid",
        np.array([-1.0, 0, 0]),
        np.array([(a[0] + b[0]) / 2, b[1], b[2]]),
        REACH["lid"],
        front,
        handle,
        np.array([b, b]),
    )
    return [_Front(m, np.flatnonzero(own), False)]


def _named(parts: Sequence[MovingPart]) -> list[MovingPart]:
    """The parts in order, with names: what is alone has no number, two doors beside each other are left and right."""
    out = []
    for word, kinds in (("door", ("door", "flap")), ("drawer", ("drawer",)), ("lid", ("lid",))):
        some = sorted((p for p in parts if p.kind in kinds), key=lambda p: (round(p.box[0, 2], 2), p.box[0, 0]))
        names = [word] if len(some) == 1 else [f"{word}_{k + 1}" for k in range(len(some))]
        if len(some) == 2 and word == "door" and some[0].box[1, 0] < some[1].box[0, 0] + 0.01:
            names = ["left_door", "right_door"]
        out += [dataclasses.replace(p, name=name) for p, name in zip(some, names, strict=True)]
    return out


# ------------------------------------------------------------------ insides


@dataclass(frozen=True, eq=False)
class _Hole:
    """A hole that is cut into a thing behind a front."""

    box: np.ndarray
    """(2, 3) of what is cut away."""
    ways: np.ndarray
    """(k, 3) unit directions in which it ends, as far as the box."""

    @staticmethod
    def of(m: MovingPart, is_round: bool) -> _Hole:
        low, high = m.inside + [[-1e-3], [1e-3]]
        sides = _circle(24) if is_round else np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
        ways = np.insert(sides, 1, 0.0, axis=1)
        return _Hole(np.array([[low[0], m.box[0, 1] - 2e-3, low[2]], high]), np.array([*ways, [0, 1, 0], [0, -1, 0]]))

    def cut(self, rows: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cut a mesh whose vertices (n, 3 + k) are positions and k other values; returns vertices, faces and, for each
        face, the one it was."""
        middle, half = self.box.mean(0), np.ptp(self.box, axis=0) / 2
        far = self.ways @ middle + np.linalg.norm(self.ways * half, axis=1)
        over = rows[faces, :3] @ self.ways.T - far
        outside, inside = (over > 0).all(1).any(1), (over <= 0).all((1, 2))
        pieces, source = [], []
        for k in np.flatnonzero(~(outside | inside)):
            rest = rows[faces[k]]
            for way, end in zip(self.ways, far, strict=True):
                apart, rest = _halves(rest, way, float(end))
                pieces += [apart[[0, i, i + 1]] for i in range(1, len(apart) - 1)]
                source += [k] * max(len(apart) - 2, 0)
                if len(rest) < 3:
                    break
        more = np.array(pieces, rows.dtype).reshape(-1, rows.shape[1])
        own = np.arange(len(more)).reshape(-1, 3) + len(rows)
        return (
            np.concatenate([rows, more]),
            np.concatenate([faces[outside], own]).astype(np.int32),
            np.concatenate([np.flatnonzero(outside), np.array(source, int)]),
        )


def cut_open(holes: Sequence[_Hole], rows: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut all holes, as `_Hole.cut`."""
    source = np.arange(len(faces))
    for hole in holes:
        rows, faces, some = hole.cut(rows, faces)
        source = source[some]
    return rows, faces, source


def _cut_part(p: MeshPart, holes: Sequence[_Hole]) -> MeshPart:
    rows, faces, _ = cut_open(holes, np.concatenate([p.vertices, p.normals, p.uv], axis=1), p.faces)
    return MeshPart(rows[:, :3], faces, rows[:, 3:6], rows[:, 6:], p.finish)


def _circle(n: int) -> np.ndarray:
    turn = np.arange(n) * (2 * np.pi / n)
    return np.stack([np.cos(turn), np.sin(turn)], axis=1)


def _halves(polygon: np.ndarray, way: np.ndarray, far: float) -> tuple[np.ndarray, np.ndarray]:
    """The parts of a convex polygon, (k, 3 and more), that lie farther along a way than `far`, and not."""
    over = polygon[:, :3] @ way - far
    apart, rest = [], []
    for k, a in enumerate(over):
        b, here, next_ = over[(k + 1) % len(over)], polygon[k], polygon[(k + 1) % len(over)]
        (apart if a > 0 else rest).append(here)
        if (a > 0) != (b > 0):
            between_ = here + (next_ - here) * (a / (a - b))
            apart.append(between_)
            rest.append(between_)
    return np.array(apart), np.array(rest)


def _furnished(
    m: MovingPart, object_class: str, finish: Finish, empty: bool
) -> tuple[list[MeshPart], tuple[MeshPart, ...]]:
    """The inside that a part closes, with shelves where it is empty, and what the part takes along."""
    (x0, y0, z0), (x1, y1, z1) = m.inside
    skin = WHITE if object_class in PALE else DARK if object_class in FLAPS else finish
    if object_class in ROUND:
        r, deep = (x1 - x0) / 2, y0 - y1
        drum = lathe([(0, deep), (r + RIM, deep), (r + RIM, 0), (r, 0), (r, deep + 0.01), (0, deep + 0.01)], 24)
        return [part(STEEL, drum.hung((x0 + x1) / 2, y0, (z0 + z1) / 2))], ()
    (a, _, c), (b, _, d) = m.box
    walls = [((a, c), (x0, d)), ((x1, c), (b, d)), ((x0, c), (x1, z0)), ((x0, z1), (x1, d))]
    boxes = [box([p[0], y0, p[1]], [q[0], y1, q[1]]) for p, q in walls]
    inside = [part(skin, *boxes, box([a, y1, c], [b, y1 + 0.01, d]))]
    if m.slides:
        return inside, (part(skin, *(box(a, b, 0.001) for a, b in drawer_boards(m))),)
    if object_class in FLAPS:
        rows = np.linspace(y0 + 0.03, y1 - 0.02, 9)
        inside.append(
            part(
                STEEL, *(tube([(x0, y, z), (x1, y, z)], 0.003, 5) for z in shelf_levels(m, object_class) for y in rows)
            )
        )
    elif empty and (boards := shelf_boards(m, object_class)):
        inside.append(part(skin, *(box(a, b, 0.001) for a, b in boards)))
        if _hangs(m, object_class):
            z = boards[-1][0][2] - 0.06
            inside.append(part(STEEL, tube([(x0, (y0 + y1) / 2, z), (x1, (y0 + y1) / 2, z)], 0.012, 10)))
    return inside, ()


def _hangs(m: MovingPart, object_class: str) -> bool:
    """True where clothes hang on a rod."""
    return object_class == "wardrobe" and float(np.ptp(m.inside[:, 2])) > 1.2


def shelf_levels(m: MovingPart, object_class: str) -> np.ndarray:
    """(k,) heights of the shelves that an empty inside gets, metres."""
    z0, z1 = m.inside[:, 2]
    if object_class in FLAPS:
        return z0 + (z1 - z0) * np.array([0.3, 0.65])
    if _hangs(m, object_class):
        return np.array([z0 + 0.3, z1 - 0.3])
    return np.linspace(z0, z1, max(1, round((z1 - z0) / STEP)) + 1)[1:-1]


def shelf_boards(m: MovingPart, object_class: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Corners of those shelves."""
    (x0, y0, _), (x1, y1, _) = m.inside
    return [
        (np.array([x0, y0 + 0.03, z - 0.009]), np.array([x1, y1, z + 0.009])) for z in shelf_levels(m, object_class)
    ]


def drawer_boards(m: MovingPart) -> list[tuple[np.ndarray, np.ndarray]]:
    """Corners of the boards of a drawer's box behind its front: ground, sides and back."""
    (x0, y0, z0), (x1, y1, z1) = m.inside + [[0.006, 0, 0.004], [-0.006, -0.02, -0.012]]
    top, board = z0 + 0.8 * (z1 - z0), 0.012
    corners = [
        ((x0, y0, z0), (x1, y1, z0 + 0.006)),
        ((x0, y0, z0), (x0 + board, y1, top)),
        ((x1 - board, y0, z0), (x1, y1, top)),
        ((x0, y1 - board, z0), (x1, y1, top)),
    ]
    return [(np.array(a), np.array(b)) for a, b in corners]
