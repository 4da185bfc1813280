"""The picture of a far landscape while it is painted: its rows and columns, and the light on far things.

Rows lie closest around the horizon, where things are (`elevations`). Colours are radiance in the units of whoever
gives the light.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

KNOTS = (np.radians([90.0, 25.0, -40.0, -90.0]), np.array([0.0, 0.2, 0.86, 1.0]))
"""Elevations, and how far down the picture they are."""
AIR = np.array([0.85, 1.0, 1.3])
"""How much faster than green light red and blue light fade: hills turn blue."""
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
