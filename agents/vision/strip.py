"""The strip: the part of an equirect that the 36 views see, and where in it each view looks.

The 36 views (12 turns of 30 degrees x 3 tilts, 60 degrees high, 75 wide) overlap about fourfold,
so a network that looks at each alone does most of its work four times. Here it looks once at a
strip of 360 x 120 degrees, 576 x 192 pixels, and every view is a window of the feature map. The
map's cells are 10 degrees wide, three to a turn, so turning the agent by 30 degrees turns its
features exactly.

Row 0 looks 60 degrees up. Column 0 begins at yaw +pi and yaw falls to the right: what is on the
left in the picture is on the left in the world.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from embodied.interface import VIEW_PITCHES, VIEW_YAWS, VIEWS

HEIGHT, WIDTH = 192, 576
CELL = 16
"""Pixels of a cell of the feature map (the encoder's stride)."""
STRIP_ROWS, STRIP_COLUMNS = HEIGHT // CELL, WIDTH // CELL
HALF = math.radians(60)
"""The strip ends this far above and below the horizon."""
VFOV = math.radians(60)
ASPECT = 640 / 480
"""Of a view: what the VLN literature extracts features from."""


@functools.cache
def directions() -> np.ndarray:
    """(192, 576, 3) float64 unit rays of the strip's pixel centres, world frame."""
    pitch = HALF - (np.arange(HEIGHT) + 0.5) / HEIGHT * 2 * HALF
    yaw = np.pi - (np.arange(WIDTH) + 0.5) / WIDTH * 2 * np.pi
    pitch, yaw = np.meshgrid(pitch, yaw, indexing="ij")
    return np.stack([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)], -1)


def view_coverage(view: int) -> np.ndarray:
    """(192, 576) float64: how much picture area of view `view` each pixel of the strip covers; 0 outside.

    A pixel's solid angle is proportional to cos(pitch); a solid angle at angle theta from the
    optical axis covers 1 / cos(theta)^3 of the picture plane. Averages with these weights equal
    averages over the perspective picture.
    """
    yaw, pitch = VIEW_YAWS[view], VIEW_PITCHES[view]
    forward = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    left = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    up = np.cross(forward, left)
    rays = directions()
    depth = rays @ forward
    ahead = np.maximum(depth, 1e-6)
    tall = math.tan(VFOV / 2)
    inside = (depth > 0) & (np.abs(rays @ up) <= tall * ahead) & (np.abs(rays @ left) <= ASPECT * tall * ahead)
    return np.where(inside, np.hypot(rays[..., 0], rays[..., 1]) / ahead**3, 0.0)


def cell_direction(row: int, column: int) -> tuple[float, float]:
    """Yaw and pitch, in radians, of the middle of a cell of the feature map."""
    return math.pi - (column + 0.5) / STRIP_COLUMNS * math.tau, HALF - (row + 0.5) / STRIP_ROWS * 2 * HALF


@functools.cache
def windows() -> np.ndarray:
    """(36, 12, 36) float32: weight of each cell of the feature map in each view; each view sums to 1."""
    weights = np.stack(
        [view_coverage(k).reshape(STRIP_ROWS, CELL, STRIP_COLUMNS, CELL).sum((1, 3)) for k in range(VIEWS)]
    )
    return (weights / weights.sum((1, 2), keepdims=True)).astype(np.float32)


@functools.cache
def inside_windows() -> np.ndarray:
    """(36, K) int64 indices of cells: those that each view shows more than a tenth as much of as of its fullest cell.

    Views with fewer cells than others have some twice."""
    weights = windows().reshape(VIEWS, -1)
    inside = [np.flatnonzero(w > 0.1 * w.max()) for w in weights]
    longest = max(map(len, inside))
    return np.stack([np.resize(cells, longest) for cells in inside])
