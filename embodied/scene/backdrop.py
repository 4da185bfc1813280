"""The far landscape, painted once around a house: ground, hills, woods, towns and water, paler with distance.

The picture goes all round (columns) and from zenith to nadir (rows); see far_canvas.
"""

from __future__ import annotations

import functools
from pathlib import Path

import cv2
import numpy as np

from embodied.assets.cache import digest, write_bytes
from embodied.assets.closure import code_digest
from embodied.assets.decoding import read_picture
from embodied.house.house import House
from embodied.scene.far_canvas import KNOTS, DrawList, FarCanvas, FarLight, elevations, share_down
from embodied.scene.far_land import DRY, paint_ground, paint_water, ridge
from embodied.scene.far_towns import street_lamps, town
from embodied.scene.far_trees import tree
from embodied.scene.landscapes import Ridge, Scenery
from embodied.seeds import stream

DOME = "outdoor/sky"
"""Owner of the dome; no instance id belongs to it."""
DOME_RADIUS = 90.0
"""Metres to the dome that shows the picture."""
EYE = 1.6
"""Above the floor, metres."""
VARIANTS = 8
"""Of every landscape; houses whose seeds differ by so many share one."""


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


def land_rng(seed: int) -> np.random.Generator:
    """Scenery from which the far landscape of a house is drawn."""
    return stream(seed % VARIANTS, "outdoors", "land")


def kept_picture(place: Scenery, seed: int, cache: Path | None) -> np.ndarray:
    """`plain_picture`, kept in `cache` where one is given."""
    if cache is None:
        return plain_picture(place, seed)
    facts = (place.landscape, place.season, place.height, place.outlook if place.table.water else 0.0, seed % VARIANTS)
    file = Path(cache) / "landscapes" / f"{digest(code_digest(__name__), *facts)[:24]}.png"
    known = read_picture(file)
    if known is not None:
        return known[..., ::-1]
    made = plain_picture(place, seed)
    write_bytes(file, cv2.imencode(".png", made[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes())
    return made


def plain_picture(place: Scenery, seed: int, rows: int = 512) -> np.ndarray:
    """(rows, 4 rows, 3) uint8 sRGB: the landscape under an even sky at noon, for pictures without baked light."""
    picture = np.empty((rows, 4 * rows, 3), np.float32)
    high = np.clip(np.sin(elevations(rows)), 0, 1)[:, None] ** 0.5
    picture[:] = (np.array([0.80, 0.86, 0.92]) * (1 - high) + np.array([0.24, 0.42, 0.72]) * high)[:, None]
    towards = np.array([0.45, -0.55, 0.70])
    air = np.tile(np.array([0.80, 0.86, 0.92], np.float32), (4 * rows, 1))
    light = FarLight(air, np.array([0.52, 0.55, 0.60]), np.array([0.62, 0.60, 0.55]), towards, 26e3, 0.0)
    paint_land(FarCanvas(picture, place.height + EYE), place, light, rng=land_rng(seed))
    return (255 * np.clip(picture, 0, 1) ** (1 / 2.2) + 0.5).astype(np.uint8)


def paint_land(canvas: FarCanvas, place: Scenery, light: FarLight, *, rng: np.random.Generator) -> None:
    """Everything between the plot and the sky, into `canvas`."""
    paint_ground(canvas, place, light, rng=rng)
    things: DrawList = []
    for far in place.table.far:
        if isinstance(far, Ridge):
            things += ridge(canvas, far, place, light, rng=rng)
        else:
            things += town(canvas, far, place, light, rng=rng)
    shore = place.table.water
    count, nearest, farthest = place.table.scatter
    for _ in range(count):
        t = rng.random()
        away = nearest * (farthest / nearest) ** t
        if place.landscape == "forest":  # as dense everywhere
            away = float(np.sqrt(nearest**2 + t * (farthest**2 - nearest**2)))
        yaw = float(rng.uniform(-np.pi, np.pi))
        one = tree(canvas, away, yaw, place, light, rng=rng)
        if shore is None or np.cos(yaw - place.outlook) < DRY:
            things.append((away, one))
    if shore is not None:
        things.append((shore[1] - 60, functools.partial(paint_water, canvas, place, light, shore, rng=rng)))
    for _, paint in sorted(things, key=lambda t: -t[0]):
        paint()
    if light.lamps > 0 and place.table.ground == "town":
        street_lamps(canvas, light, rng=rng)
