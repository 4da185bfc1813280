"""The outdoors by hour and weather: where the sun stands, how bright it is, what windows show.

Radiance is in units of 100 cd/m2 throughout `embodied.light`: daylight skies lie around 50, a
white wall by lamplight around 0.3.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from embodied.house.house import House, Sky
from embodied.scene.backdrop import land_rng, paint_land
from embodied.scene.far_canvas import EYE, FarCanvas, FarLight, elevations, share_down
from embodied.scene.landscapes import Scenery, scenery_of
from embodied.seeds import stream

LATITUDE = np.radians(48.0)
DECLINATION = np.radians(6.0)
"""A day in early April or September: low enough a sun to reach into rooms."""
HEIGHT = 1024
"""Rows of the environment picture; twice as many columns."""
VISIBILITY = {"clear": 26e3, "hazy": 4e3, "overcast": 12e3}
"""How far one sees, metres."""


@dataclass(frozen=True, eq=False)
class Outdoors:
    """Surroundings of a house."""

    picture: np.ndarray
    """(h, 2h, 3) float32 radiance, row 0 at the zenith, column 0 looking along world -x, yaw falling to the right."""
    sun_direction: np.ndarray
    """(3,) unit, towards the sun."""
    sun: np.ndarray
    """(3,) radiosity e = E/pi that the unobstructed sun gives a surface facing it; zero at night."""
    fine: np.ndarray
    """(h, 4h, 3), the picture as it is shown: rows closest around the horizon (see scene.far_canvas.elevations)."""
    lamps: float = 0.0
    """0 by day, 1 when the neighbours' windows are lit."""


def sun_height(hour: float) -> float:
    """Elevation of the sun above the horizon at a local solar hour, radians."""
    turn = (hour - 12.0) * np.pi / 12.0
    return float(
        np.arcsin(np.sin(LATITUDE) * np.sin(DECLINATION) + np.cos(LATITUDE) * np.cos(DECLINATION) * np.cos(turn))
    )


def sun_direction(sky: Sky) -> np.ndarray:
    """(3,) unit vector towards the sun, world."""
    turn, height = (sky.hour - 12.0) * np.pi / 12.0, sun_height(sky.hour)
    east = -np.cos(DECLINATION) * np.sin(turn)
    north = np.sin(DECLINATION) * np.cos(LATITUDE) - np.cos(DECLINATION) * np.sin(LATITUDE) * np.cos(turn)
    to_north = np.array([np.cos(sky.north), np.sin(sky.north)])
    to_east = np.array([to_north[1], -to_north[0]])
    flat = east * to_east + north * to_north
    return np.array([*flat, np.sin(height)])


def outdoors(house: House, rows: int = HEIGHT) -> Outdoors:
    """Sky, sun and landscape around `house`, painted in so many rows; the same for the same seed and sky."""
    return paint(house.sky, house.seed, scenery_of(house), rows)


def paint(sky: Sky, seed: int, place: Scenery, height: int = HEIGHT) -> Outdoors:
    """The surroundings as a picture of radiance.

    Sky luminances follow the usual clear (5 kcd/m2 at noon) and overcast (CIE 1:3) models in
    shape; they are plausible, not measured.
    """
    towards, up = sun_direction(sky), sun_height(sky.hour)
    elevation = (0.5 - (np.arange(height // 2) + 0.5) / height) * np.pi
    yaw = np.pi - (np.arange(2 * height) + 0.5) / height * np.pi
    flat, upwards = np.cos(elevation)[:, None], np.tile(np.sin(elevation)[:, None], 2 * height)
    directions = np.stack([flat * np.cos(yaw), flat * np.sin(yaw), upwards], axis=-1).astype(np.float32)
    sun = sun_strength(sky, up)
    above = _sky(sky, up, directions, towards, seed)
    air = cv2.resize(above[-max(height // 256, 1) :].mean(0)[None], (4 * height, 1), interpolation=cv2.INTER_LINEAR)[0]
    lamps = float(np.clip((2.0 - np.degrees(up)) / 5.0, 0, 1))
    ambient = above.mean(axis=(0, 1), dtype=np.float64) * 0.9
    light = FarLight(air, ambient, sun, towards, VISIBILITY[sky.weather], lamps)
    fine = _spread(above, height)
    paint_land(FarCanvas(fine, place.height + EYE), place, light, rng=land_rng(seed))
    np.maximum(fine, 1e-5, out=fine)
    return Outdoors(_evenly(fine), towards, sun, fine, lamps)


def _spread(above: np.ndarray, height: int) -> np.ndarray:
    """(h, 4h, 3) float32 in rows as `elevations` has them, the sky (h / 2, 2h, 3) in its upper part."""
    fine = np.zeros((height, 4 * height, 3), np.float32)
    rows = (0.5 - elevations(height) / np.pi) * height - 0.5
    upper = int(np.searchsorted(rows, height / 2))
    x = np.tile(((np.arange(4 * height) + 0.5) / 2 - 0.5).astype(np.float32), (upper, 1))
    y = np.repeat(np.minimum(rows[:upper, None], height / 2 - 1).astype(np.float32), 4 * height, axis=1)
    fine[:upper] = cv2.remap(above, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return fine


def _evenly(fine: np.ndarray) -> np.ndarray:
    """The picture (h, 4h, 3) with h even rows and 2h columns."""
    h = fine.shape[0]
    half = cv2.resize(fine, (2 * h, h), interpolation=cv2.INTER_AREA)
    rows = share_down((0.5 - (np.arange(h) + 0.5) / h) * np.pi) * h - 0.5
    low = np.clip(rows.astype(int), 0, h - 2)
    t = np.clip(rows - low, 0, 1).astype(np.float32)[:, None, None]
    return half[low] * (1 - t) + half[low + 1] * t


def sun_strength(sky: Sky, up: float) -> np.ndarray:
    """e of a surface facing the sun: 128 klx outside the air, dimmed and reddened by it (Bouguer, Kasten air mass)."""
    if up <= 0.0 or sky.weather == "overcast":
        return np.zeros(3)
    mass = 1.0 / (np.sin(up) + 0.50572 * (np.degrees(up) + 6.07995) ** -1.6364)
    thick = np.array([0.10, 0.14, 0.22]) * (2.2 if sky.weather == "hazy" else 1.0)
    fade = min(1.0, up / np.radians(1.5))
    return 128e3 / 100 / np.pi * np.exp(-thick * mass) * np.array([1.0, 0.97, 0.94]) * fade


def _sky(sky: Sky, up: float, d: np.ndarray, towards: np.ndarray, seed: int) -> np.ndarray:
    """(h, w, 3) float32 radiance of the bare sky in directions (h, w, 3)."""
    z = np.clip(d[..., 2:], 0.0, 1.0)
    near = np.clip(d @ towards.astype(np.float32), -1, 1)[..., None]
    day = _daylight(up)
    clouds = _clouds(d, seed, sky.weather)[..., None]
    if sky.weather == "overcast":
        level = 58.0 * day * (1 + 2 * z) / 3 * (0.86 + 0.28 * clouds)
        return level * _tint(up, _colour(0.93, 0.99, 1.07))
    low = float(np.clip(1 - up / np.radians(25), 0, 1) * np.clip(1 + up / np.radians(8), 0, 1))
    zenith = _colour(0.42, 0.72, 1.35) * 26.0
    horizon = _colour(0.86, 1.0, 1.12) * 62.0
    glow = _colour(1.25, 0.82, 0.48) * 60.0
    air = zenith + (horizon - zenith) * (1 - z) ** 4
    air = air + (glow - air) * (low * 0.75 * np.exp(-z * 5) * np.clip(0.55 + 0.45 * near, 0, 1))
    air = air * (1 + 1.1 * np.exp((near - 1) * 9) + 4 * np.exp((near - 1) * 160))
    lit = (_colour(1.0, 0.98, 0.95) * (1 - low) + _colour(1.25, 0.86, 0.66) * low) * 78.0
    cover = 0.75 if sky.weather == "hazy" else 0.6
    mixed = air + (lit - air) * (clouds * cover)
    if sky.weather == "hazy":
        mixed = 0.45 * mixed + 0.55 * _colour(0.98, 1.0, 1.02) * 55.0 * (1 + 0.6 * np.exp((near - 1) * 5))
    return mixed * (day * _tint(up, _colour(1.0, 1.0, 1.0)))


def _colour(*rgb: float) -> np.ndarray:
    """In single precision, like the picture."""
    return np.array(rgb, np.float32)


def _daylight(up: float) -> float:
    """Sky brightness against noon: falls with the sun, then a thousandfold through twilight."""
    degrees = np.degrees(up)
    if degrees >= 0:
        return float(0.06 + 0.94 * np.clip(np.sin(up) / np.sin(np.radians(40)), 0, 1.15) ** 0.75)
    return float(max(0.06 * 10 ** (degrees / 3.6), 2.5e-5))


def _tint(up: float, day: np.ndarray) -> np.ndarray:
    """Twilight is blue: colour of the sky light by sun height."""
    blue = float(np.clip(-np.degrees(up) / 6, 0, 1))
    return day * (1 - blue) + _colour(0.42, 0.62, 1.35) * blue


def _clouds(d: np.ndarray, seed: int, weather: str) -> np.ndarray:
    """(h, w) cover in [0, 1]: fractal noise on a flat layer overhead."""
    rng = stream(seed, "light", "clouds")
    sheet = sum(
        cv2.resize(rng.random((n, n)).astype(np.float32), (1024, 1024), interpolation=cv2.INTER_CUBIC) * w
        for n, w in ((10, 0.5), (24, 0.27), (60, 0.14), (150, 0.09))
    )
    z = np.maximum(d[..., 2], 0.03) + 0.12
    x, y = d[..., 0] / z * 110 + 512, d[..., 1] / z * 110 + 512
    value = cv2.remap(
        sheet, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
    )
    threshold = {"clear": 0.53, "hazy": 0.45, "overcast": 0.3}[weather]
    return np.clip((value - threshold) / 0.16, 0, 1) * np.clip(d[..., 2] * 9, 0, 1)
