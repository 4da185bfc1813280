"""Angles, yaw rotations and flat polygons. Radians, metres, counter-clockwise."""

from __future__ import annotations

import numpy as np

TWO_PI = 2.0 * np.pi


def wrap(angle):
    """Angle(s) brought into [-pi, pi)."""
    return (np.asarray(angle) + np.pi) % TWO_PI - np.pi


def heading_of_yaw(yaw):
    """Matterport heading (clockwise from +y, in [0, 2 pi)) of a yaw (ccw from +x)."""
    return (np.pi / 2 - np.asarray(yaw)) % TWO_PI


def yaw_of_heading(heading):
    """Yaw (ccw from +x, in [-pi, pi)) of a Matterport heading (clockwise from +y)."""
    return wrap(np.pi / 2 - np.asarray(heading))


def facing_of(yaw: float) -> float:
    """World direction (radians ccw from +x) in which the front of a thing with `yaw` looks.

    Assets look along -y in their own frame, so a thing with yaw 0 faces -pi/2.
    """
    return float(wrap(yaw - np.pi / 2))


def yaw_facing(direction: float) -> float:
    """The yaw that makes an asset's front look along `direction`; inverse of `facing_of`."""
    return float(wrap(direction + np.pi / 2))


def rotation(yaw: float) -> np.ndarray:
    """(2, 2) counter-clockwise rotation matrix."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s], [s, c]])


def rectangle(x: float, y: float, width: float, depth: float, yaw: float = 0.0) -> np.ndarray:
    """(4, 2) corners, counter-clockwise, of a rectangle centred at (x, y)."""
    half = np.array([[-width, -depth], [width, -depth], [width, depth], [-width, depth]]) / 2
    return half @ rotation(yaw).T + [x, y]


def polygon_area(polygon) -> float:
    """Signed area in square metres, positive for counter-clockwise corners (n, 2)."""
    p = np.asarray(polygon, dtype=float)
    q = np.roll(p, -1, axis=0)
    return float(0.5 * np.sum(p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]))
