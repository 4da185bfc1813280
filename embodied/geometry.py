"""Angles, yaw rotations and flat polygons. Radians, metres, counter-clockwise."""

from typing import Any, TypeVar, cast

import numpy as np

TWO_PI = 2.0 * np.pi
Angles = TypeVar("Angles", float, np.ndarray)
"""Of a number NumPy's float64 comes back, which is a float."""


def wrap(angle: Angles) -> Angles:
    """Angle(s) brought into [-pi, pi)."""
    return cast(Angles, (np.asarray(angle) + np.pi) % TWO_PI - np.pi)


def heading_of_yaw(yaw: Angles) -> Angles:
    """Matterport heading (clockwise from +y, in [0, 2 pi)) of a yaw (ccw from +x)."""
    return cast(Angles, (np.pi / 2 - np.asarray(yaw)) % TWO_PI)


def yaw_of_heading(heading: Angles) -> Angles:
    """Yaw (ccw from +x, in [-pi, pi)) of a Matterport heading (clockwise from +y)."""
    return wrap(np.pi / 2 - heading)


def r2(k: Any) -> tuple[Any, Any]:
    """Point k of the R2 low-discrepancy sequence, both coordinates with any whole part: in the unit square lie their
    fractions.

    Args:
      k: a number or an array of numbers, on the device, too, counted from 0, which is the origin.

    Source: M. Roberts, "The unreasonable effectiveness of quasirandom sequences" (2018).
    """
    return k * 0.7548776662466927, k * 0.5698402909980532


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
