"""The picture of a far landscape while it is painted: its rows and columns, the light on far things, and its trees.

Rows lie closest around the horizon, where things are (`elevations`). Colours are radiance in the units of whoever
gives the light.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from embodied.house.house import House
from embodied.scene.landscapes import SEASON_COLOURS, Scenery

KNOTS = (np.radians([90.0, 25.0, -40.0, -90.0]), np.array([0.0, 0.2, 0.86, 1.0]))
"""Elevations, and how far down the picture they are."""
AIR = np.array([0.85, 1.0, 1.3])
"""How much faster than green light red and blue light fade: hills turn blue."""
DOME = "outdoor/sky"
"""Owner of the dome; no instance id belongs to it."""
DOME_RADIUS = 90.0
"""Metres to the dome that shows the picture."""
EYE = 1.6
"""Above the floor, metres."""
DrawList = list[tuple[float, Callable[[], None]]]
"""How far something is, metres, and what paints it."""


@dataclass(frozen=True, eq=False)
class FarLight:
    """Light on far things."""

    air: np.ndarray
    """(w, 3) light of the sky just above the horizon, which distance adds."""
    ambient: np.ndarray
    """(3,) e of level ground under the sky without the sun."""
    sun: np.ndarray
    """(3,) e of what faces the sun."""
    towards: np.ndarray
    """(3,) unit, to the sun."""
    visibility: float
    """At which things lose all contrast, metres (Koschmieder: 2 % are left)."""
    lamps: float
    """0 by day, 1 when windows are lit."""

    def on(self, normal: np.ndarray) -> np.ndarray:
        """(n, 3) e of surfaces with unit normals (n, 3)."""
        up = 0.5 + 0.5 * normal[:, 2:]
        ground = 0.18 * (self.ambient + self.sun * max(self.towards[2], 0.0))
        return self.ambient * up + ground * (1 - up) + self.sun * np.clip(normal @ self.towards, 0, None)[:, None]

    def on_leaves(self, yaw: np.ndarray | float) -> np.ndarray:
        """(n, 3) e of trees seen in directions `yaw` (n,): brighter where the sun is behind the viewer."""
        behind = 0.5 - 0.5 * np.cos(yaw - np.arctan2(self.towards[1], self.towards[0]))
        return self.ambient * 0.6 + self.sun * (0.22 + 0.4 * np.asarray(behind))[..., None]


def transmittance(distance: float | np.ndarray, visibility: float) -> np.ndarray:
    """(..., 3) share of a thing's own light that is left at a distance; the air's light takes the rest.

    Source: Koschmieder 1924; extinction 3.912 / visibility.
    """
    return np.exp(-3.912 / visibility * np.asarray(distance, float)[..., None] * AIR)


def elevations(rows: int) -> np.ndarray:
    """(rows,) elevation of the middle of each row, radians, falling."""
    return np.interp((np.arange(rows) + 0.5) / rows, KNOTS[1], KNOTS[0])


def share_down(elevation: np.ndarray | float) -> np.ndarray:
    """How far down the picture elevations are, 0 to 1."""
    return np.interp(-np.asarray(elevation), -KNOTS[0], KNOTS[1])


def dome(house: House, rows: int = 24) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A sphere around the house that shows a picture on its inside: vertices (n, 3), faces (m, 3), uv (n, 2) from the
    top left."""
    corners = np.array([c for r in house.rooms for c in r.polygon])
    centre = np.array([*(corners.min(0) + corners.max(0)) / 2, EYE])
    bands = (KNOTS[1] * rows).round().astype(int)
    height = np.interp(np.arange(rows + 1), bands, KNOTS[0])
    elevation, u = np.meshgrid(height, np.linspace(0, 1, 2 * rows + 1), indexing="ij")
    v, yaw = share_down(elevation), np.pi * (1 - 2 * u)
    d = np.stack([np.cos(elevation) * np.cos(yaw), np.cos(elevation) * np.sin(yaw), np.sin(elevation)], axis=-1)
    i = np.arange(rows)[:, None] * (2 * rows + 1) + np.arange(2 * rows)[None]
    a, b, c, e = i, i + 1, i + 2 * rows + 2, i + 2 * rows + 1
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, e], -1).reshape(-1, 3)])
    vertices = (centre + DOME_RADIUS * d).reshape(-1, 3)
    p = vertices[faces]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    outward = (normal * (p.mean(1) - centre)).sum(1) > 0
    faces = np.where(outward[:, None], faces[:, ::-1], faces)
    real = np.linalg.norm(normal, axis=1) > 1e-4
    uv = np.stack([u, v], axis=-1).reshape(-1, 2)
    return vertices.astype(np.float32), faces[real].astype(np.int32), uv.astype(np.float32)


class FarCanvas:
    """The picture while it is painted."""

    def __init__(self, picture: np.ndarray, eye: float) -> None:
        """`picture`: (h, w, 3) float32, sky already in it; `eye`: metres above the ground."""
        self.picture, self.eye = picture, eye
        self.h, self.w = picture.shape[:2]
        self.elevation = elevations(self.h)
        self.yaw = np.pi - (np.arange(self.w) + 0.5) / self.w * 2 * np.pi

    def rows(self, elevation: np.ndarray | float) -> np.ndarray:
        """Row coordinates of elevations."""
        return share_down(elevation) * self.h - 0.5

    def columns(self, yaw: np.ndarray | float) -> np.ndarray:
        """Column coordinates of directions; may lie outside the picture, which closes."""
        return (np.pi - np.asarray(yaw)) / (2 * np.pi) * self.w - 0.5

    def project(self, points: np.ndarray) -> np.ndarray:
        """(..., 2) column and row of points (..., 3) around the eye, metres; each polygon (second last axis) in one
        piece."""
        flat = np.hypot(points[..., 0], points[..., 1])
        x = self.columns(np.arctan2(points[..., 1], points[..., 0]))
        x = x - np.round((x - x[..., :1]) / self.w) * self.w
        return np.stack([x, self.rows(np.arctan2(points[..., 2], flat))], axis=-1)

    def fill(self, polygons: np.ndarray, colours: np.ndarray) -> None:
        """Convex polygons (n, k, 2) of columns and rows, one over the other in colours (n, 3), edges smooth."""
        low, high = polygons.min((0, 1)), polygons.max((0, 1))
        x0, x1, y0, y1 = int(low[0]) - 2, int(high[0]) + 3, max(int(low[1]) - 2, 0), min(int(high[1]) + 3, self.h)
        if y1 <= y0 or x1 - x0 > self.w // 2:
            return
        top = float(colours.max()) + 1e-9
        codes = np.sqrt(colours / top) * 255
        picture, mask = np.empty((y1 - y0, x1 - x0, 3), np.uint8), np.zeros((y1 - y0, x1 - x0), np.uint8)
        picture[:] = codes[0]
        points = np.round((polygons - [x0, y0]) * 16).astype(np.int32)
        for p, c in zip(points, codes.tolist()):
            cv2.fillConvexPoly(picture, p, c, cv2.LINE_AA, 4)
            cv2.fillConvexPoly(mask, p, 255, cv2.LINE_AA, 4)
        self.blend(
            x0, y0, np.square(picture * np.float32(1 / 255)) * np.float32(top), mask[..., None] * np.float32(1 / 255)
        )

    def blend(self, x0: int, y0: int, colour: np.ndarray, cover: np.ndarray) -> None:
        """`colour` ((h, w, 3) or one) where `cover` (h, w, 1) says, from column x0 (it may lie outside) and row y0."""
        width = cover.shape[1]
        start = x0 % self.w
        for a, b, at in ((0, min(width, self.w - start), start), (min(width, self.w - start), width, 0)):
            if b > a:
                there = self.picture[y0 : y0 + cover.shape[0], at : at + b - a]
                there += ((colour[:, a:b] if colour.ndim == 3 else colour) - there) * cover[:, a:b]


FIR = (0.024, 0.045, 0.024)
"""Linear reflectance, as of bark and snow."""
BARK = np.array([0.075, 0.058, 0.045])
SNOW = (0.76, 0.78, 0.82)


def tree(
    canvas: FarCanvas,
    away: float,
    yaw: float,
    place: Scenery,
    light: FarLight,
    tall: float | None = None,
    *,
    rng: np.random.Generator,
) -> Callable[[], None]:
    """One tree, painted later."""
    fir = rng.random() < place.table.firs
    tall = (rng.uniform(9, 20) if fir else rng.uniform(5, 13)) if tall is None else tall * (1.25 if fir else 1.0)
    which, hue = int(rng.integers(4)), rng.uniform(0.85, 1.18, 3) * rng.uniform(0.85, 1.15)
    flip = rng.random() < 0.5

    def paint() -> None:
        sprite = _sprite("fir" if fir else "leafy", place.season, which)
        foot, tip = canvas.rows(np.arctan2([-canvas.eye, tall - canvas.eye], away))
        high = int(round(foot - tip))
        wide = int(round(tall * sprite.shape[1] / sprite.shape[0] / away * canvas.w / (2 * np.pi)))
        if high < 2 or wide < 2:
            return
        how = cv2.INTER_AREA if high < sprite.shape[0] else cv2.INTER_LINEAR
        small = cv2.resize(sprite, (wide, high), interpolation=how)
        small = small[:, ::-1] if flip else small
        x0, y0 = int(canvas.columns(yaw) - wide / 2), int(round(tip))
        small = small[max(-y0, 0) : canvas.h - y0]
        cover = small[..., 3:]
        clear = transmittance(away, light.visibility)
        air = light.air[int(canvas.columns(yaw)) % canvas.w] * (1 - clear)
        own = small[..., :3] / np.maximum(cover, 1e-3)
        own = own * (light.on_leaves(np.array(yaw)) * hue * clear).astype(np.float32) + air.astype(np.float32)
        canvas.blend(x0, max(y0, 0), own, cover)

    return paint


@functools.cache
def _sprite(kind: str, season: str, which: int) -> np.ndarray:
    """(n, m, 4) float32 of a tree seen from the side: reflectance times cover, and cover."""
    rng = np.random.default_rng([which, len(kind), len(season), ord(season[0])])
    brush = _Brush(320, 320 if kind == "leafy" else 320 * 6 // 10, rng)
    if kind == "fir":
        _fir(brush, season)
    else:
        _leafy(brush, np.array(SEASON_COLOURS[season].leaves[which % 4]), bare=season == "winter")
    alpha = (brush.cover > 0).astype(np.float32)[..., None]
    both = np.concatenate([brush.picture * alpha, alpha], axis=-1)
    return cv2.resize(both, (brush.m // 2, brush.n // 2), interpolation=cv2.INTER_AREA)


class _Brush:
    """A picture of n x m pixels that a tree is painted on."""

    def __init__(self, n: int, m: int, rng: np.random.Generator) -> None:
        self.n, self.m, self.rng = n, m, rng
        self.picture, self.cover = np.zeros((n, m, 3), np.float32), np.zeros((n, m), np.uint8)

    def draw(self, points: np.ndarray, colour: np.ndarray) -> None:
        p = np.round(points * 16).astype(np.int32)
        cv2.fillPoly(self.picture, [p], tuple(float(c) for c in colour), cv2.LINE_8, 4)
        cv2.fillPoly(self.cover, [p], 255, cv2.LINE_8, 4)

    def branch(self, x: float, y: float, angle: float, length: float, width: float, level: int) -> None:
        rng = self.rng
        x1, y1 = x + length * np.sin(angle), y - length * np.cos(angle)
        across = np.array([np.cos(angle), np.sin(angle)]) * width / 2
        tip = across * 0.7
        corners = np.array([[x, y] - across, [x, y] + across, [x1, y1] + tip, [x1, y1] - tip])
        self.draw(corners, BARK * rng.uniform(0.8, 1.3))
        if level > 0:
            for _ in range(3 if level > 1 else 4):
                t, turn = rng.uniform(0.45, 1.0), angle * 0.8 + rng.normal(0, 0.55)
                far, thin = length * rng.uniform(0.5, 0.78), max(width * 0.58, 1.1)
                self.branch(x + t * (x1 - x), y + t * (y1 - y), turn, far, thin, level - 1)


def _fir(brush: _Brush, season: str) -> None:
    n, m, rng = brush.n, brush.m, brush.rng
    brush.draw(np.array([[m / 2 - 5, n], [m / 2 + 5, n], [m / 2 + 2, n * 0.5], [m / 2 - 2, n * 0.5]]), BARK)
    crown = np.array([[m * 0.2, n * 0.93], [m * 0.8, n * 0.93], [m * 0.53, n * 0.06], [m * 0.47, n * 0.06]])
    brush.draw(crown, np.array(FIR) * 0.45)
    for k in range(600):
        t = (k / 600) ** 0.75  # 0 at the foot
        reach = m * 0.47 * (1 - t) ** 0.9 * rng.uniform(0.35, 1.0) + 4
        side = rng.choice([-1, 1]) * rng.random() ** 0.5
        x, y = m / 2 + side * reach, n * (0.97 - 0.97 * t) + abs(side) * reach * 0.22
        shade = 0.5 + 0.5 * abs(side) + rng.uniform(-0.2, 0.35)
        colour = np.array(FIR) * shade * 1.3
        if season == "winter" and rng.random() < 0.4:
            colour = np.array(SNOW) * 0.8
        s = rng.uniform(3, 7)
        twig = [[x - s, y + s * 0.5], [x, y - s * 0.9], [x + s, y + s * 0.5], [x + side * s * 2.2, y + s * 1.1]]
        brush.draw(np.array(twig), colour)


def _leafy(brush: _Brush, leaf: np.ndarray, *, bare: bool) -> None:
    n, m, rng = brush.n, brush.m, brush.rng
    brush.branch(m / 2, n, rng.normal(0, 0.04), n * (0.34 if bare else 0.3), 15, 5 if bare else 2)
    if bare:
        return
    lobes = [(m / 2, n * 0.36, n * 0.30)]
    for k in range(9):
        a = 2 * np.pi * k / 9 + rng.uniform(-0.3, 0.3)
        x, y = m / 2 + np.cos(a) * n * 0.25 * rng.uniform(0.7, 1.15), n * 0.40 + np.sin(a) * n * 0.2
        lobes.append((x, y, n * rng.uniform(0.1, 0.17)))
    for x, y, r in lobes:  # no sky through the middle of a crown
        around, out = np.arange(24) * 2 * np.pi / 24, r * 0.86 * rng.uniform(0.8, 1.08, 24)
        brush.draw(np.column_stack([x + np.cos(around) * out, y + np.sin(around) * out]), leaf * 0.34)
    spots: list[tuple[float, float, float, float]] = []
    for x, y, r in lobes:
        for _ in range(int(r * 6.5)):
            a, d = rng.uniform(0, 2 * np.pi), r * np.sqrt(rng.random())
            lump = 0.55 - 0.40 * (np.sin(a) * d / r)
            spots.append((x + np.cos(a) * d, y + np.sin(a) * d, lump + 0.25 * (1 - y / n), rng.uniform(1.8, 4.6)))
    for i in rng.permutation(len(spots)):
        x, y, shade, s = spots[i]
        turn = rng.uniform(0, 2 * np.pi) + np.arange(5) * 2 * np.pi / 5
        across, down = s * rng.uniform(0.5, 1.2, 5), s * rng.uniform(0.5, 1.1, 5)
        shape = np.column_stack([x + np.cos(turn) * across, y + np.sin(turn) * down])
        brush.draw(shape, leaf * max(0.25, shade + rng.normal(0, 0.16)) * rng.uniform(0.9, 1.1, 3))
