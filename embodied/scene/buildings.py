"""Neighbours' houses as flat faces: near ones become parts of the scene, far ones are painted into the distance."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Add = Callable[..., None]
"""Takes what a face is made of, and its four corners."""
WALL, ROOF, TRIM, DOOR, PANE, LIT = range(6)
"""Material of a face; LIT panes glow when it is dark."""
EVENING = 0.42
"""Share of the windows that are lit after dusk."""


@dataclass(frozen=True)
class Building:
    """One house seen from outside."""

    at: tuple[float, float]
    """Middle of its base, metres, world."""
    yaw: float
    """Its front looks along yaw - pi/2, as objects' fronts do."""
    wide: float
    deep: float
    eaves: float
    """Height of its walls, metres."""
    ridge: float
    """Height of the roof above the eaves; 0 is a flat roof."""
    paint: int
    """Which of the landscapes' wall colours it has, counted from 0."""
    tiles: int
    """Which of their roof colours."""
    storey: float = 2.9


@dataclass(frozen=True, eq=False)
class Faces:
    """(n, 4, 3) corners, counter-clockwise from outside, metres, and (n,) what each is made of."""

    corners: np.ndarray
    made_of: np.ndarray


def faces_of(b: Building, base: float, *, detail: bool, rng: np.random.Generator) -> Faces:
    """The visible faces of a building.

    Args:
      base: z of the ground it stands on.
      detail: frames, sills, doors and chimneys; without, bare panes.
    """
    out: list[np.ndarray] = []
    made: list[int] = []

    def add(kind: int, *corners: tuple[float, float, float]) -> None:
        out.append(np.array(corners, float))
        made.append(kind)

    x, y, z = b.wide / 2, b.deep / 2, b.eaves
    for c, s, w, d in ((1, 0, x, y), (0, 1, y, x), (-1, 0, x, y), (0, -1, y, x)):
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        first = len(out)
        add(WALL, (-w, -d, -1), (w, -d, -1), (w, -d, z), (-w, -d, z))
        gable = s != 0 and b.ridge > 0
        if gable:
            add(WALL, (-w, -d, z), (0, -d, z), (0, -d, z + b.ridge), (-w, -d, z + 1e-3))
            add(WALL, (0, -d, z), (w, -d, z), (w, -d, z + 1e-3), (0, -d, z + b.ridge))
        _add_windows(add, b, w, d, front=c == 1, gable=gable, detail=detail, rng=rng)
        out[first:] = [q @ turn.T for q in out[first:]]
    _add_roof(add, b, detail)
    turn = np.array([[np.cos(b.yaw), -np.sin(b.yaw), 0], [np.sin(b.yaw), np.cos(b.yaw), 0], [0, 0, 1.0]])
    return Faces(np.array(out) @ turn.T + [*b.at, base], np.array(made))


def _add_windows(
    add: Add, b: Building, w: float, d: float, *, front: bool, gable: bool, detail: bool, rng: np.random.Generator
) -> None:
    """Windows of one wall in rows and columns, a door in the front's lowest row."""
    columns = max(1, int((2 * w - 0.6) / (2.3 if front else 3.2)))
    rows = max(1, int(b.eaves / b.storey + 0.15))
    door = int(rng.integers(columns)) if front and detail else -1
    for row in range(rows + int(gable and b.ridge > 2.6)):
        in_gable = row == rows
        for i in range(1 if in_gable else columns):
            u = 0.0 if in_gable else -w + (i + 0.5) * 2 * w / columns
            low = row * b.storey + (b.storey - 2.0)
            half, high = 0.42 if in_gable or not front else 0.58, low + (1.15 if in_gable else 1.35)
            lit = LIT if rng.random() < EVENING else PANE
            if row == 0 and i == door:
                _add_rect(add, TRIM, u - 0.62, u + 0.62, 0.0, 2.3, d + 0.03)
                _add_rect(add, DOOR, u - 0.5, u + 0.5, 0.0, 2.16, d + 0.06)
                continue
            if not detail:
                _add_rect(add, lit, u - half, u + half, low, high, d + 0.05)
                continue
            _add_rect(add, TRIM, u - half - 0.08, u + half + 0.08, low - 0.08, high + 0.08, d + 0.03)
            _add_rect(add, lit, u - half, u - 0.03, low, high, d + 0.05)
            _add_rect(add, lit, u + 0.03, u + half, low, high, d + 0.05)


def _add_rect(add: Add, kind: int, u0: float, u1: float, z0: float, z1: float, d: float) -> None:
    add(kind, (u0, -d, z0), (u1, -d, z0), (u1, -d, z1), (u0, -d, z1))


def _add_roof(add: Add, b: Building, detail: bool) -> None:
    """A pitched roof with eaves that stand out, or a flat one; chimneys."""
    x, y, z = b.wide / 2, b.deep / 2, b.eaves
    if b.ridge <= 0:
        add(ROOF, (-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z))
        return
    over = 0.35
    drop = over * b.ridge / y
    u, v, low, top = x + 0.25, y + over, z - drop + 0.1, z + b.ridge + 0.1
    for s in (1, -1):
        add(ROOF, (-u * s, -v * s, low), (u * s, -v * s, low), (u * s, 0, top), (-u * s, 0, top))
        if detail:
            p, q, y, foot, head = -u * s, u * s, -v * s, low - 0.16, top - 0.16
            add(TRIM, (p, y, foot), (q, y, foot), (q, y, low), (p, y, low))
            add(TRIM, (q, 0, head), (q, y, foot), (p, y, foot), (p, 0, head))
            for e in (u, -u):  # the verge
                side = ((e, y, foot), (e, 0, head), (e, 0, top), (e, y, low))
                add(TRIM, *(side if e * s < 0 else side[::-1]))
    cx, half, height = 0.27 * b.wide, 0.35, top + 0.7
    for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        left, right = (cx - half * (c - s), -half * (c + s)), (cx + half * (c + s), half * (s - c))
        add(WALL, (*left, top - 1.2), (*right, top - 1.2), (*right, height), (*left, height))
    x0, x1 = cx - half, cx + half
    add(DOOR, (x0, -half, height), (x1, -half, height), (x1, half, height), (x0, half, height))
