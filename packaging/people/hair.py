"""Hair, beards and glasses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from body import layer
from clothes import ORDER, Wearer
from mesh import Layer, clipped, hemmed, joined_layers, noise, smoothed, subdivided

from embodied.assets.built.primitives import Shape, joined, tube

AROUND, DOWN = 96, 34
THETA = np.linspace(2, 128, DOWN)
"""Angles of the rows from above, degrees."""
HAIRLINE = np.array(
    [
        [0, 8.02],
        [25, 8.0],
        [42, 7.86],
        [55, 7.66],
        [66, 7.5],
        [75, 7.18],
        [84, 7.12],
        [92, 7.42],
        [112, 7.46],
        [125, 7.05],
        [140, 6.78],
        [180, 6.62],
    ]
)
"""Angle from the front, degrees, and height on the template's head, decimetres."""
AXIS = 0.35
"""Place in front of the template's origin of the head's middle line, decimetres."""


@dataclass(frozen=True)
class Cut:
    """A haircut; lengths in metres."""

    top: float = 0.02
    """Thickness on the crown."""
    sides: float = 0.012
    fall: float = 0.0
    """How far below the ears it hangs; 0 is hair that ends at the hairline."""
    fringe: float = 0.0
    """How far it falls over the forehead."""
    part: float | None = None
    """Place of the parting, from -1 (right) to 1; None without."""
    curl: float = 0.0
    """Height of curls."""
    recede: float = 0.0
    """How far the hairline has gone back, decimetres; over 0.6 the crown is bald."""
    bun: float = 0.0
    """Radius of a bun at the back."""
    tail: float = 0.0
    """Length of a ponytail."""
    wave: float = 0.004
    """Height of strands."""


def hairline(template: np.ndarray, cut: Cut) -> np.ndarray:
    """(n,) decimetres inside the hairline, at places of the template (x, up, front)."""
    x, up, front = template.T
    angle = np.degrees(np.abs(np.arctan2(x, front - AXIS)))
    line = np.interp(angle, *HAIRLINE.T)
    back = cut.recede * np.interp(angle, [0, 30, 50, 75, 90], [1.0, 1.35, 0.9, 0.0, 0.0])
    inside = up - line - back
    if cut.recede > 0.6:
        inside = np.minimum(inside, 8.0 - up)
    return inside


def _cast(x: Layer, origin: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance along each ray (m, 3) to the layer, 0 where it misses, and the template's place there; the farthest hit."""
    a, b, c = (x.place[x.faces[:, k]] for k in range(3))
    e, f, t0 = b - a, c - a, origin - a
    q, far, place = np.cross(t0, e), np.zeros(len(rays)), np.zeros((len(rays), 3))
    for i, d in enumerate(rays):
        p = np.cross(d, f)
        det = np.einsum("ni,ni->n", e, p)
        det = np.where(np.abs(det) < 1e-12, 1e-12, det)
        u, v, t = np.einsum("ni,ni->n", t0, p) / det, (q @ d) / det, np.einsum("ni,ni->n", f, q) / det
        good = (u >= -1e-4) & (v >= -1e-4) & (u + v <= 1.0001) & (t > 0)
        if good.any():
            k = np.where(good, t, -1).argmax()
            far[i] = t[k]
            place[i] = np.array([1 - u[k] - v[k], u[k], v[k]]) @ x.template[x.faces[k]]
    return far, place


def hair(w: Wearer, cut: Cut) -> list[Layer]:
    """Locks over the scalp as a shell, and what hangs from it."""
    head = layer("body", w.place)
    ears = _ears(head)
    head = smoothed(
        head.compact(
            head.faces[(head.weights[head.faces][:, :, ORDER.index("head")] > 0.5).all(1) & ~ears[head.faces].any(1)]
        ),
        2,
    )
    k = w.height_of_head
    top = head.place[:, 2].max()
    origin = np.array([0.0, np.mean([head.place[:, 1].min(), head.place[:, 1].max()]) + 0.012 * k, top - 0.095 * k])
    phi = np.linspace(0, 2 * np.pi, AROUND + 1)[:-1]  # 0 is the front, then to the left
    theta = np.radians(THETA)
    ray = np.stack(
        np.broadcast_arrays(
            np.sin(theta)[:, None] * np.sin(phi), -np.sin(theta)[:, None] * np.cos(phi), np.cos(theta)[:, None]
        ),
        -1,
    )
    far, place = _cast(head, origin, ray.reshape(-1, 3))
    far, place = far.reshape(DOWN, AROUND), place.reshape(DOWN, AROUND, 3)
    inside = hairline(place.reshape(-1, 3), cut).reshape(DOWN, AROUND)
    inside[far < 0.02 * k] = -1
    around = np.degrees(np.abs(np.arctan2(np.sin(phi), np.cos(phi))))[None]
    crown = np.clip((theta[:, None] - 0.5) / 1.1, 0, 1)
    thick = cut.top * (1 - crown) + cut.sides * crown
    rng = w.rng
    flow = np.column_stack([np.cos(phi) * 9, np.sin(phi) * 9, 0 * phi])
    strands = np.stack([noise(flow + [0, 0, 0.5 * i * 0.12], 0.9, np.random.default_rng(7)) for i in range(DOWN)])
    fine = np.stack([noise(flow * 2.7 + [0, 0, 0.4 * i * 0.12], 0.9, np.random.default_rng(8)) for i in range(DOWN)])
    skin = origin + ray * far[..., None]
    relief = cut.wave * (0.5 * strands + 0.4 * fine) + cut.curl * _curls(skin, k, rng)
    if cut.part is not None:
        line = np.abs(skin[..., 0] - cut.part * 0.05 * k)
        relief -= (0.008 * np.exp(-((line / (0.006 * k)) ** 2)) - 0.006 * np.exp(-((line / (0.03 * k)) ** 2))) * (
            skin[..., 1] < origin[1] + 0.05
        )
    wide = 0.28 if cut.fall else float(np.clip(18 * cut.sides, 0.35, 0.7))
    reach = np.clip(inside / wide, 0, 1) ** 0.85
    out = np.where(
        inside > 0, (thick * k + relief) * reach - 0.002 * (1 - reach), -0.004 - 0.02 * np.clip(-inside, 0, 1)
    )
    shell = origin + ray * (far + out)[..., None]
    made = [_grid(w, shell, place)]
    made = [clipped(x, hairline(x.template, cut) + 0.1) for x in made]
    if cut.fall or cut.fringe:
        made.append(_curtain(w, cut, origin, shell, inside, around, phi))
    if cut.bun:
        made.append(_ball(w, origin + np.array([0.0, 0.105 * k, 0.03 * k]), cut.bun, rng))
    if cut.tail:
        start = origin + np.array([0.0, 0.1 * k, 0.035 * k])
        t = np.linspace(0, 1, 12)
        path = start + np.column_stack(
            [
                0 * t,
                0.055 * np.sin(np.pi * np.minimum(1.3 * t, 1)) * (1 - 0.3 * t),
                0.02 * np.sin(np.pi * t) - cut.tail * t**1.3,
            ]
        )
        made.append(_of(w, tube(path, np.interp(t, [0, 0.08, 0.35, 0.8, 1], [0.012, 0.02, 0.026, 0.018, 0.003]), 12)))
    return made


def _curls(points: np.ndarray, k: float, rng: np.random.Generator) -> np.ndarray:
    flat = points.reshape(-1, 3)
    return (0.7 * noise(flat, 0.035 * k, rng) + 0.5 * noise(flat, 0.02 * k, rng)).reshape(points.shape[:2])


def _curtain(
    w: Wearer, cut: Cut, origin: np.ndarray, shell: np.ndarray, inside: np.ndarray, around: np.ndarray, phi: np.ndarray
) -> Layer:
    """Hair that hangs from the hairline: at the sides and the back `fall` below the ears, over the forehead `fringe`."""
    k = w.height_of_head
    rows, columns = 22, np.arange(AROUND)
    last = np.where(inside > 0.03, np.arange(len(shell))[:, None], 0)
    last[(76 if cut.fall else 128) < THETA] = 0
    start = shell[last.max(0), columns]
    low = origin[2] - 0.075 * k - cut.fall
    ragged = 1 + 0.035 * noise(np.column_stack([np.cos(phi), np.sin(phi), 0 * phi]) * 9, 0.8, w.rng)
    sides = np.interp(around[0], [44, 52, 75], [0, 0.8, 1.0]) * (cut.fall > 0)
    length = (
        np.where(
            around[0] > 44, (start[:, 2] - low) * sides, np.interp(around[0], [0, 34, 46], [1, 1.05, 0.0]) * cut.fringe
        )
        * ragged
    )
    t = np.linspace(0, 1, rows)[:, None]
    down = t * length
    flat = (start - origin) * [1, 1, 0]
    radius = np.linalg.norm(flat, axis=1)
    unit = flat / radius[:, None]
    ear = 0.092 * k * np.exp(-(((around[0] - 88) / 26) ** 2))
    wide = np.maximum(
        radius + 0.004,
        np.where(
            around[0] > 44,
            np.maximum(ear, np.interp(around[0], [50, 70, 110, 180], [0.095, 0.088, 0.09, 0.105]) * k),
            0,
        ),
    )
    locks = noise(np.column_stack([np.cos(phi) * 14, np.sin(phi) * 14, 0 * phi]), 0.9, np.random.default_rng(7))
    reach = radius + (wide - radius) * np.clip(down / (0.05 * k), 0, 1) ** 0.8
    reach -= 0.16 * np.maximum(down - 0.13 * k, 0) * (around[0] > 60)
    reach += cut.wave * 0.8 * locks * np.clip(down / 0.04, 0, 1) + 0.35 * cut.curl * np.sin(
        down / (0.028 * k) + 3 * np.sin(2 * phi)
    ) * np.clip(down / 0.05, 0, 1)
    grid = origin + unit[None] * reach[..., None]
    grid[..., 2] = start[:, 2] - down
    neck, chest = w.joints["neck"], w.joints["chest"]
    behind = neck[1] + 0.07 * k + 0.25 * np.clip(neck[2] - grid[..., 2], 0, 0.2)
    back = np.clip((around - 95) / 30, 0, 1)
    under = np.clip((neck[2] + 0.05 - grid[..., 2]) / 0.06, 0, 1) * back
    grid[..., 1] = grid[..., 1] * (1 - under) + np.maximum(grid[..., 1], behind) * under
    fore = np.clip((neck[2] - 0.02 - grid[..., 2]) / 0.08, 0, 1) * (around < 95)
    grid[..., 1] = grid[..., 1] * (1 - fore) + np.minimum(grid[..., 1], chest[1] - 0.105 * w.scale) * fore
    x = _grid(w, grid, np.broadcast_to(np.array([0, 8.0, 0.0]), grid.shape))
    hang = np.clip((neck[2] + 0.04 - x.place[:, 2]) / 0.12, 0, 0.8)  # what lies on the shoulders goes with the chest
    x.data[:, 8 + ORDER.index("head")], x.data[:, 8 + ORDER.index("chest")] = 1 - hang, hang
    keep = np.tile(np.append(length, length[0]) > 0.006, rows)
    x = x.compact(x.faces[keep[x.faces].all(1)])
    inner = x.moved(x.place - 0.007 * x.normals())
    return joined_layers([hemmed(x, 0.007), Layer(inner.data, inner.faces[:, ::-1], inner.weld)])


def _grid(w: Wearer, points: np.ndarray, template: np.ndarray) -> Layer:
    """A closed ring of columns as a layer; uv: u around, v down, metres."""
    rows, columns = points.shape[:2]
    ring = lambda g: np.concatenate([g, g[:, :1]], axis=1)
    p, t = ring(points).reshape(-1, 3), ring(template).reshape(-1, 3)
    v = np.repeat(np.linspace(0, 0.05 * rows, rows), columns + 1)
    u = np.tile(np.linspace(0, 4.0, columns + 1), rows)
    weights = np.zeros((len(p), len(ORDER)))
    weights[:, ORDER.index("head")] = 1
    i = (np.arange(rows - 1)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    a, b, c, d = i, i + 1, i + columns + 2, i + columns + 1
    faces = np.concatenate([np.column_stack([a, d, c]), np.column_stack([a, c, b])])
    own = np.arange(rows)[:, None] * columns + np.arange(columns + 1) % columns
    return Layer(np.column_stack([p, t, u, v, weights]), faces, own.ravel())


def _of(w: Wearer, shape: Shape, joint: str = "head") -> Layer:
    weights = np.zeros((len(shape.vertices), len(ORDER)))
    weights[:, ORDER.index(joint)] = 1
    t = np.broadcast_to([0.0, 8.0, 0.0], (len(weights), 3))
    _, weld = np.unique(shape.vertices.round(6), axis=0, return_inverse=True)
    return Layer(np.column_stack([shape.vertices, t, shape.uv, weights]), np.asarray(shape.faces), weld.ravel())


def _ball(w: Wearer, middle: np.ndarray, radius: float, rng: np.random.Generator) -> Layer:
    t = np.linspace(-0.98, 0.98, 14)
    path = middle + np.column_stack([0 * t, 0.7 * radius * t, 0.35 * radius * t])
    x = _of(w, tube(path, radius * np.sqrt(1 - t**2), 18))
    return x.moved(x.place + x.normals() * (0.1 * radius * noise(x.place, 0.03, rng))[:, None])


def _ears(x: Layer) -> np.ndarray:
    """(n,) True at vertices of the ears."""
    side, up, front = x.template.T
    return (np.abs(side) > 0.70) & (up > 6.8) & (up < 7.75) & (front > -0.1) & (front < 0.75)


def beard(w: Wearer, long: float) -> Layer:
    """A beard over jaw and lip, `long` metres thick at the chin."""
    x = layer("body", w.place)
    x = x.compact(x.faces[(x.weights[x.faces][:, :, ORDER.index("head")] > 0.2).all(1)])
    x = subdivided(clipped(x, beard_field(x.template) + 0.1))
    f = beard_field(x.template)
    reach = np.clip(f / 0.12, 0, 1) ** 0.5
    low = np.clip((6.75 - x.template[:, 1]) / 0.4, 0.25, 1)
    thick = long * reach * low * (1 + 0.2 * noise(x.place, 0.012, w.rng)) + 0.0012 * reach - 0.0006
    x = smoothed(x, 3)
    x = clipped(x.moved(x.place + x.normals() * thick[:, None]), f)
    x.data[:, 6:8] = np.column_stack([np.arctan2(x.template[:, 0], x.template[:, 2]), x.template[:, 1] * 0.5])
    return x


def beard_field(template: np.ndarray) -> np.ndarray:
    """(n,) decimetres inside a beard, at places of the template."""
    x, up, front = template.T
    x = np.abs(x)
    edge = 6.52 + 0.75 * np.clip((x - 0.3) / 0.4, 0, 1) ** 2
    edge = np.maximum(edge, 6.76 - 12 * (x - 0.37) ** 2)
    inside = np.minimum.reduce([edge - up, up - 6.05, 0.72 - x, front - 0.1])
    lip = 0.16 - np.hypot(x / 1.75, (up - 6.66) * 1.1)  # around the mouth
    upper = np.minimum.reduce([0.07 - np.abs(up - 6.81 + 0.9 * x**2), (0.44 - x) * 0.6, front - 1.0])
    return np.maximum(np.minimum(inside, -lip), upper)


def glasses(w: Wearer) -> Layer:
    """Round frames before the eyes and temples to the ears."""
    left, right = w.joints["left_eye"], w.joints["right_eye"]
    k = w.height_of_head
    a = np.linspace(0, 2 * np.pi, 25)[:-1]
    shapes = []
    front = min(left[1], right[1]) - 0.026 * k
    for eye in (left, right):
        sign = np.sign(eye[0])
        ring = np.column_stack(
            [
                eye[0] + sign * 0.002 + 0.0245 * k * np.cos(a),
                front + 0.004 * np.abs(np.cos(a)) * (np.cos(a) * sign > 0),
                eye[2] - 0.003 + 0.019 * k * np.sin(a),
            ]
        )
        shapes.append(tube(ring, 0.0016, 6, closed=True))
        end = np.array([sign * 0.078 * k, left[1] + 0.075 * k, eye[2] + 0.004])
        start = np.array([eye[0] + sign * 0.027 * k, front + 0.004, eye[2] + 0.004])
        shapes.append(tube(np.array([start, start + (0.014 * k * sign, 0.012, 0), end]), 0.0014, 6))
    inner = 0.0245 * k - abs(left[0]) - 0.002
    b = np.linspace(-1, 1, 7)
    shapes.append(
        tube(np.column_stack([-inner * b, front - 0.002 + 0 * b, left[2] + 0.003 + 0.004 * (1 - b**2)]), 0.0014, 6)
    )
    return _of(w, joined(*shapes))


def options(row: Mapping[str, object]) -> Cut:
    return Cut(**{k: v for k, v in row.items() if k not in ("color", "grey")})
