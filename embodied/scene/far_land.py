"""Far ground, hills with what covers them, and lakes."""

import functools

import cv2
import numpy as np
from scipy.spatial import cKDTree

from embodied.scene.far_canvas import FIR, SNOW, DrawList, FarCanvas, FarLight, transmittance, tree
from embodied.scene.landscapes import Ridge, Scenery

DRY = 0.2
"""Cosine of the angle from the outlook beyond which a lake has land."""


def paint_ground(canvas: FarCanvas, place: Scenery, light: FarLight, *, rng: np.random.Generator) -> None:
    """The ground up to the horizon, as fields, a town's streets and gardens, or meadow."""
    first = int(np.searchsorted(-canvas.elevation, 0.0))
    down = -canvas.elevation[first:]
    away = np.minimum(canvas.eye / np.tan(np.maximum(down, 1e-4)), 30e3)
    x = (away[:, None] * np.cos(canvas.yaw)[None]).astype(np.float32)
    y = (away[:, None] * np.sin(canvas.yaw)[None]).astype(np.float32)
    step = away**2 / canvas.eye * np.pi / 180 / 10  # metres of ground under a row
    seen = lambda size: (1 / (1 + (2 * step / size) ** 2)).astype(np.float32)[:, None]
    soft, fine = _grain(1, 16), _grain(2, 90)
    vary = 1 + 0.20 * _over_ground(soft, 160.0, x, y) * seen(10) + 0.16 * _over_ground(fine, 40.0, x, y) * seen(0.5)
    if place.snow:
        vary = 1 + 0.25 * (vary - 1)
    kind = place.table.ground
    if kind == "fields":
        own = _over_ground(_field_tile(place, rng=rng), 1100.0, x, y) * vary[..., None]
    elif kind == "town":
        paved, green = (np.array([0.16, 0.155, 0.15], np.float32), np.array(place.colours.grass, np.float32))
        share = np.clip(0.35 + 0.6 * _over_ground(_grain(3, 40), 600.0, x, y), 0, 0.75)[..., None]
        own = (paved + (green - paved) * share) * vary[..., None]
    else:
        colour = np.array(place.colours.grass, np.float32)
        if kind == "woodland" and not place.snow:
            colour = np.array([0.075, 0.060, 0.030], np.float32)
        own = colour * vary[..., None]
    e = (light.ambient + light.sun * max(light.towards[2], 0.0)).astype(np.float32)
    clear = transmittance(away, light.visibility).astype(np.float32)[:, None]
    canvas.picture[first:] = own * e * clear + light.air[None].astype(np.float32) * (1 - clear)


def ridge(canvas: FarCanvas, r: Ridge, place: Scenery, light: FarLight, *, rng: np.random.Generator) -> DrawList:
    """A line of hills or trees around the house."""
    height = r.height + r.rough * (2 * _wave(canvas.w, r.grain, rng=rng) - 1)
    if r.cover == "trees" and r.distance <= 600:
        return _trees_of(canvas, r, height, place, light, rng=rng)
    if r.cover in ("wood", "trees") and r.distance < 4000:
        height = height + 7 * _wave(canvas.w, 700, rng=rng)
    if r.cover == "rock":
        height = height + 0.25 * r.rough * _wave(canvas.w, 60, rng=rng) + 0.08 * r.rough * _wave(canvas.w, 200, rng=rng)
    noise = rng.integers(1 << 30)

    def paint() -> None:
        top = canvas.rows(np.arctan2(height - canvas.eye, r.distance))
        bottom = float(canvas.rows(np.array(-canvas.eye / r.distance)))
        y0, y1 = max(int(top.min()) - 1, 0), min(int(np.ceil(bottom)) + 2, canvas.h)
        y = np.arange(y0, y1)[:, None]
        cover = (np.clip(y - top[None] + 0.5, 0, 1) * np.clip(bottom - y + 1.5, 0, 1)).astype(np.float32)[..., None]
        e = light.on_leaves(canvas.yaw)
        slope = np.gradient(height) * canvas.w / (2 * np.pi * r.distance)
        to_sun = np.sin(canvas.yaw - np.arctan2(light.towards[1], light.towards[0]))
        sunny = 1 + 0.5 * np.clip(slope * to_sun, -0.8, 0.8) * float(light.sun.any())
        own = _cover_of(canvas, r, y0, y1, top, place, np.random.default_rng(noise))
        own = own * (e * sunny[:, None]).astype(np.float32)[None]
        clear = transmittance(r.distance, light.visibility).astype(np.float32)
        canvas.blend(0, y0, own * clear + light.air[None].astype(np.float32) * (1 - clear), cover)

    return [(r.distance, paint)]


def paint_water(
    canvas: FarCanvas, place: Scenery, light: FarLight, shore: tuple[float, float], *, rng: np.random.Generator
) -> None:
    """A lake on the side that the house looks at: the sky and the far shore, mirrored in small waves."""
    turn = np.abs(np.angle(np.exp(1j * (canvas.yaw - place.outlook))))
    near = shore[0] * (1 + 0.25 * (_wave(canvas.w, 14, rng=rng) - 0.5))
    near = near / np.maximum(np.cos(np.minimum(turn, 1.45)), 0.12)
    near = np.where(np.cos(turn) > DRY, near, np.inf)
    first = int(np.searchsorted(-canvas.elevation, canvas.eye / shore[1]))
    last = int(np.searchsorted(-canvas.elevation, canvas.eye / (0.8 * shore[0])))
    down = -canvas.elevation[first:last]
    away = canvas.eye / np.tan(down)
    step = away**2 / canvas.eye * np.pi / 1800
    cover = np.clip((away[:, None] - near[None]) / step[:, None] + 0.5, 0, 1).astype(np.float32)[..., None]
    waves = rng.standard_normal((last - first, canvas.w // 24)).astype(np.float32)
    waves = cv2.resize(waves, (canvas.w, last - first), interpolation=cv2.INTER_CUBIC)
    tilt = 0.012 + 0.03 * np.clip(40 / away, 0, 1)[:, None]
    mirrored = canvas.rows(down[:, None] + np.abs(0.006 + tilt * waves)).astype(np.float32)
    across = np.tile(np.arange(canvas.w, dtype=np.float32), (last - first, 1))
    seen = cv2.remap(canvas.picture, across, mirrored, cv2.INTER_LINEAR)
    fresnel = (0.02 + 0.98 * (1 - np.sin(down + 0.09)) ** 5).astype(np.float32)[:, None, None]
    level = light.ambient + light.sun * max(light.towards[2], 0.0)
    deep = (np.array([0.012, 0.03, 0.032]) * level).astype(np.float32)
    clear = transmittance(away, light.visibility).astype(np.float32)[:, None]
    own = (seen * fresnel + deep * (1 - fresnel)) * clear + light.air[None].astype(np.float32) * (1 - clear)
    canvas.blend(0, first, own, cover)


@functools.cache
def _grain(seed: int, cells: int, side: int = 512) -> np.ndarray:
    """(side, side) float32 smooth noise of mean 0 that repeats."""
    rng = np.random.default_rng(seed)
    grid = np.pad(rng.standard_normal((cells, cells)).astype(np.float32), 4, mode="wrap")
    wide = cv2.resize(grid, None, fx=side / cells, fy=side / cells, interpolation=cv2.INTER_CUBIC)
    edge = round(4 * side / cells)
    return np.ascontiguousarray(wide[edge : edge + side, edge : edge + side])


def _over_ground(tile: np.ndarray, size: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A tile of `size` metres laid over points x, y (float32) of the ground."""
    n = tile.shape[0]
    u, v = np.mod(x * np.float32(n / size), n - 1), np.mod(y * np.float32(n / size), n - 1)
    return cv2.remap(tile, u, v, cv2.INTER_LINEAR)


def _field_tile(place: Scenery, *, rng: np.random.Generator, side: int = 256) -> np.ndarray:
    """(side, side, 3) float32: fields of many colours between hedges."""
    points = rng.random((46, 2)) * side
    every = np.concatenate([points + [i * side, j * side] for i in (-1, 0, 1) for j in (-1, 0, 1)])
    y, x = np.mgrid[:side, :side]
    stretch = np.array([1.0, 1.7])
    near, which = cKDTree(every * stretch).query(np.column_stack([x.ravel(), y.ravel()]) * stretch, k=2)
    colours = np.array(place.colours.fields)[rng.integers(5, size=len(points))]
    colours = colours * rng.uniform(0.85, 1.15, (len(points), 1))
    angle = rng.uniform(0, np.pi, len(points))
    field = which[:, 0] % len(points)
    rows = 1 + 0.05 * np.sin((x.ravel() * np.cos(angle[field]) + y.ravel() * np.sin(angle[field])) * 2.2)
    tile = colours[field] * rows[:, None]
    hedge = (near[:, 1] - near[:, 0] < 0.9) & (rng.random(len(points))[field] < 0.8)
    tile[hedge] = np.array(place.colours.leaves[2]) * 0.8
    return tile.reshape(side, side, 3).astype(np.float32)


def _wave(n: int, grain: int, *, rng: np.random.Generator) -> np.ndarray:
    """(n,) smooth line in [0, 1] that closes, with finer waves on the coarse ones."""
    out, weight = np.zeros(n), 0.0
    for k in range(4):
        knots = rng.random(grain * 2**k)
        at = np.arange(n) / n * len(knots)
        i, t = at.astype(int), at % 1
        t = t * t * (3 - 2 * t)
        out += (knots[i] * (1 - t) + knots[(i + 1) % len(knots)] * t) * 0.45**k
        weight += 0.45**k
    return np.clip((out / weight - 0.5) * 1.7 + 0.5, 0, 1)


def _cover_of(
    canvas: FarCanvas, r: Ridge, y0: int, y1: int, top: np.ndarray, place: Scenery, rng: np.random.Generator
) -> np.ndarray:
    """(rows, w, 3) reflectances of a ridge's face."""
    h, w = y1 - y0, canvas.w
    leaf = np.mean(place.colours.leaves[:3], axis=0) * (1 - place.table.firs) + np.array(FIR) * place.table.firs
    crowns = cv2.resize(rng.random((max(h // 2, 1), w // 3)).astype(np.float32), (w, h), interpolation=cv2.INTER_LINEAR)
    patches = cv2.resize(
        rng.random((max(h // 12, 2), w // 60)).astype(np.float32), (w, h), interpolation=cv2.INTER_CUBIC
    )
    if r.cover == "fields":
        reach = r.distance * np.pi / 180 / 10  # metres to a row
        x = np.tile((canvas.yaw * r.distance).astype(np.float32), (h, 1))
        down = (np.arange(y0, y1)[:, None] - top[None]).astype(np.float32)
        return _over_ground(_field_tile(place, rng=rng), 2600.0, x, down * np.float32(reach * 9)) * (
            0.92 + 0.16 * crowns[..., None]
        )
    if r.cover == "rock":
        rock = np.array([0.17, 0.165, 0.17], np.float32) * (0.6 + 0.7 * crowns[..., None])
        line = (np.arange(y0, y1)[:, None] - top[None]) / max(float(np.ptp(top)), 1.0) - 0.18 + 0.25 * (patches - 0.5)
        low = {"winter": 1.0, "spring": 0.45, "summer": 0.12, "autumn": 0.2}[place.season]
        snow = np.clip((low - line) * 6, 0, 1)[..., None] * (0.45 + 0.55 * crowns[..., None])
        wood = np.clip((line - 0.55) * 5, 0, 1)[..., None] * (1 - snow)
        rock = rock + (np.array(SNOW, np.float32) - rock) * snow
        return (rock + (leaf.astype(np.float32) - rock) * wood).astype(np.float32)
    own = leaf.astype(np.float32) * ((0.62 + 0.55 * crowns) * (0.75 + 0.5 * patches))[..., None]
    if r.distance > 3000 and not place.snow:  # meadows between the woods
        own += (np.array(place.colours.grass, np.float32) - own) * np.clip((patches - 0.62) * 6, 0, 0.8)[..., None]
    if place.snow:
        share = np.clip(0.3 + (patches - 0.55) * 3, 0.22, 0.9)[..., None]
        own += (np.array(SNOW, np.float32) - own) * share
    return own.astype(np.float32)


def _trees_of(
    canvas: FarCanvas, r: Ridge, height: np.ndarray, place: Scenery, light: FarLight, *, rng: np.random.Generator
) -> DrawList:
    """A wood's edge or a row of trees as single trees over undergrowth."""
    low = Ridge(r.distance, 0.42 * r.height, 0.25 * r.rough, "wood", 3 * r.grain)
    things = ridge(canvas, low, place, light, rng=rng) if r.height - r.rough > 0 else []
    count = int(2 * np.pi * r.distance / max(0.42 * r.height + 1.2, 3.0))
    for k in range(min(count, 420)):
        yaw = float((k + rng.random()) / min(count, 420) * 2 * np.pi - np.pi)
        tall = float(height[int(canvas.columns(yaw)) % canvas.w]) * rng.uniform(0.75, 1.25)
        away = r.distance * rng.uniform(0.94, 1.1)
        if tall > 2.5:
            things.append((away, tree(canvas, away, yaw, place, light, tall, rng=rng)))
    return things
