"""The outdoors by hour and weather: where the sun stands, how bright it is, what windows show.

Radiance is in units of 100 cd/m2 throughout `embodied.light`: daylight skies lie around 50, a
white wall by lamplight around 0.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from embodied.house.house import House, Sky
from embodied.seeds import stream

LATITUDE = np.radians(48.0)
DECLINATION = np.radians(6.0)
"""A day in early April or September: low enough a sun to reach into rooms."""
HEIGHT = 1024
"""Rows of the environment picture; twice as many columns."""
GRASS = np.array([0.082, 0.108, 0.050])
TREES = np.array([0.045, 0.075, 0.028])
"""Linear reflectances of lawn and foliage."""


@dataclass(frozen=True, eq=False)
class Outdoors:
    """What surrounds a house."""

    picture: np.ndarray
    """(h, 2h, 3) float32 radiance, row 0 at the zenith, column 0 looking along world -x, yaw falling to the right."""
    sun_direction: np.ndarray
    """(3,) unit, towards the sun."""
    sun: np.ndarray
    """(3,) radiosity e = E/pi that the unobstructed sun gives a surface facing it; zero at night."""


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


def outdoors(house: House) -> Outdoors:
    """Sky, sun, lawn, trees and far houses around `house`; the same for the same seed and sky."""
    return paint(house.sky, house.seed)


def paint(sky: Sky, seed: int, height: int = HEIGHT) -> Outdoors:
    """The surroundings as a picture of radiance.

    Sky luminances follow the usual clear (5 kcd/m2 at noon) and overcast (CIE 1:3) models in
    shape; they are plausible, not measured.
    """
    towards, up = sun_direction(sky), sun_height(sky.hour)
    elevation = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    yaw = np.pi - (np.arange(2 * height) + 0.5) / height * np.pi
    directions = np.stack(
        [
            np.cos(elevation)[:, None] * np.cos(yaw),
            np.cos(elevation)[:, None] * np.sin(yaw),
            np.broadcast_to(np.sin(elevation)[:, None], (height, 2 * height)),
        ],
        axis=-1,
    ).astype(np.float32)
    sun = _sun_strength(sky, up)
    above = _sky(sky, up, directions[: height // 2], towards, seed)
    mean = above.mean(axis=(0, 1), dtype=np.float64)
    horizontal, lit = float(mean @ [0.2126, 0.7152, 0.0722]) * 0.9, mean * 0.9 + sun * max(np.sin(up), 0.0)
    picture = np.concatenate([above, _ground(above, elevation, lit, seed)])
    _add_far_things(picture, elevation, yaw, lit, sun, towards, horizontal, seed)
    return Outdoors(np.maximum(picture, 1e-5), towards, sun)


def _sun_strength(sky: Sky, up: float) -> np.ndarray:
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


def _noise(rng: np.random.Generator, rows: int, columns: int, shape: tuple[int, int]) -> np.ndarray:
    """Smooth noise in [0, 1] of `shape` that closes round the horizon."""
    grid = rng.random((rows, columns)).astype(np.float32)
    grid = np.concatenate([grid[:, -4:], grid, grid[:, :4]], axis=1)
    scale = shape[1] / columns
    wide = cv2.resize(grid, (round((columns + 8) * scale), shape[0]), interpolation=cv2.INTER_CUBIC)
    start = round(4 * scale)
    return np.clip(wide[:, start : start + shape[1]], 0.0, 1.0)


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


def _ground(above: np.ndarray, elevation: np.ndarray, lit: np.ndarray, seed: int) -> np.ndarray:
    """Lawn below the horizon: near grass is coarse, far grass smooth and hazy; a paved strip around the house.

    Args:
      above: (h / 2, w, 3) the sky. elevation: (h,) of the rows of the whole picture.
    """
    h, w = len(elevation), above.shape[1]
    rng = stream(seed, "light", "lawn")
    distance = 2.2 / np.tan(np.maximum(-elevation[h // 2 :], 1e-3))
    patches = (
        _noise(rng, h // 4, 80, (h, w)) * 0.5
        + _noise(rng, h, 900, (h, w)) * 0.3
        + _noise(rng, h // 24, 20, (h, w)) * 0.4
    )
    patches = patches[h // 2 :, :, None]
    near = (1 / (1 + np.exp(np.minimum((distance - 3.2) * 3, 60)))).astype(np.float32)[:, None, None]
    haze = np.clip(distance / 160, 0, 0.35).astype(np.float32)[:, None, None]
    horizon = above[h // 2 - 2].mean(0) * 0.5
    shown = lit.astype(np.float32) * (1 - haze)
    grass = (GRASS.astype(np.float32) * shown * (1 - near)) * (0.72 + 0.5 * patches)
    return grass + (_colour(0.30, 0.28, 0.25) * shown * near) * (0.85 + 0.25 * patches) + horizon * haze


def _add_far_things(
    picture: np.ndarray,
    elevation: np.ndarray,
    yaw: np.ndarray,
    lit: np.ndarray,
    sun: np.ndarray,
    towards: np.ndarray,
    sky_level: float,
    seed: int,
) -> None:
    """Hills, houses, two rows of trees and a hedge, far to near, each lit from the sun's side, put into the picture."""
    h, w = picture.shape[:2]
    rng = stream(seed, "light", "horizon")
    facing = 0.55 + 0.45 * np.cos(yaw - np.arctan2(towards[1], towards[0]) - np.pi)
    ambient = lit - sun * max(towards[2], 0.0)
    side = (ambient * 0.55 + sun * 0.5 * facing[:, None])[None].astype(np.float32)
    air = picture[h // 2 - 3].mean(0)
    hills = np.radians(1.2 + 3.0 * _noise(rng, 1, 9, (1, w))[0] + 0.8 * _noise(rng, 1, 40, (1, w))[0])
    _add_layer(picture, elevation, hills, TREES * side * 0.9, air, 0.55)
    _add_houses(picture, elevation, side, sky_level, rng)
    for top, rough, grain, haze in ((5.5, 2.6, 46, 0.25), (8.0, 4.5, 30, 0.1)):
        line = top * (_noise(rng, 1, 14, (1, w))[0] ** 1.5) + rough * _noise(rng, 1, grain, (1, w))[0]
        line = line + 0.9 * _noise(rng, 1, 260, (1, w))[0] + 0.5 * _noise(rng, 1, 800, (1, w))[0] - 1.4
        crowns = (
            0.5
            + 0.8 * _noise(rng, h // 5, 420, (h, w)) * _noise(rng, h // 24, 110, (h, w))
            + 0.25 * _noise(rng, h, 1000, (h, w))
        )
        hue = 0.8 + 0.5 * _noise(rng, 1, 50, (1, w))[0]
        hues = TREES * np.stack([hue, np.ones(w), hue * 0.9], 1) * side * 1.1
        _add_layer(picture, elevation, np.radians(line), hues, air, haze, shade=crowns)
    hedge = np.radians(-3.2 + 0.45 * _noise(rng, 1, 300, (1, w))[0])
    leaves = 0.55 + 0.7 * _noise(rng, h, 1100, (h, w))
    _add_layer(picture, elevation, hedge, TREES * 1.15 * side, air, 0.03, bottom=float(np.radians(-6.8)), shade=leaves)


def _add_layer(
    picture: np.ndarray,
    elevation: np.ndarray,
    top: np.ndarray,
    colour: np.ndarray,
    air: np.ndarray,
    haze: float,
    bottom: float = float(np.radians(-2.6)),
    shade: np.ndarray | None = None,
) -> None:
    """`colour` (1, w, 3) from `bottom` up to the line `top` (w,), times `shade` (h, w), mixed with `haze` of the air's
    light; edges one row soft."""
    row = np.pi / picture.shape[0]
    which = np.nonzero((elevation > bottom) & (elevation < top.max() + row))[0]
    if not len(which):
        return
    rows = slice(which[0], which[-1] + 1)
    cover = np.clip((top[None] - elevation[rows, None]) / row + 0.5, 0, 1).astype(np.float32)[..., None]
    own = (colour * (1 - haze)).astype(np.float32)
    if shade is not None:
        own = own * shade[rows, :, None]
    picture[rows] += (own + (air * (haze * 0.8)).astype(np.float32) - picture[rows]) * cover


def _add_houses(
    picture: np.ndarray, elevation: np.ndarray, side: np.ndarray, sky_level: float, rng: np.random.Generator
) -> None:
    """A dozen neighbours as plain facades with pitched roofs; windows glow when the sky is dark."""
    h, w = picture.shape[:2]
    row = np.pi / h
    paints = np.array([[0.55, 0.50, 0.42], [0.62, 0.60, 0.56], [0.42, 0.24, 0.17], [0.58, 0.47, 0.30]])
    for _ in range(12):
        x0, wide = int(rng.integers(w)), int(rng.integers(w // 60, w // 26))
        wall, roof = np.radians(rng.uniform(2.6, 4.6)), np.radians(rng.uniform(1.2, 2.6))
        paint_, tiles = paints[rng.integers(4)], np.array([0.22, 0.10, 0.07]) * rng.uniform(0.6, 1.2)
        columns = (x0 + np.arange(wide)) % w
        ridge = wall + roof * (1 - np.abs(np.linspace(-1, 1, wide)))
        e = elevation[:, None]
        light = side[:, columns]
        roof_cover = (e > wall) & (e < ridge[None])
        wall_cover = (e <= wall) & (e > np.radians(-2.4))
        block = picture[:, columns]
        block = np.where(roof_cover[..., None], tiles * light * 1.2, block)
        block = np.where(wall_cover[..., None], paint_ * light, block)
        across = (np.arange(wide) / wide * rng.integers(4, 7)) % 1
        along = ((elevation - np.radians(-1.6)) / max(wall / 2, 4 * row)) % 1
        panes = wall_cover & (np.abs(across - 0.5) < 0.19)[None] & (np.abs(along - 0.5) < 0.26)[:, None]
        glow = np.array([1.0, 0.72, 0.38]) * 0.35 * (sky_level < 1.0) * (rng.random() < 0.7)
        picture[:, columns] = np.where(panes[..., None], 0.05 * light + glow, block)
