"""Far trees: firs and leafy ones by season, painted once from the side and pasted small."""

from __future__ import annotations

import functools
from collections.abc import Callable

import cv2
import numpy as np

from embodied.scene.far_canvas import FarCanvas, FarLight, transmittance
from embodied.scene.landscapes import SEASON_COLOURS, Scenery

FIR = (0.024, 0.045, 0.024)
"""Linear reflectance, as all here."""
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
