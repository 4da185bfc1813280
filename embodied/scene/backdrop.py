"""The far landscape, painted once around a house: ground, hills, woods, towns and water, paler with distance.

The picture goes all round (columns) and from zenith to nadir (rows); rows lie closest around the horizon, where things
are (`elevations`). Colours are radiance in the units of whoever gives the light.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial import cKDTree

from assets.archives import read_picture
from assets.cache import digest, write_bytes
from assets.closure import code_digest
from embodied.house.house import House
from embodied.scene.buildings import EVENING, LIT, PANE, ROOF, WALL, Building, Faces, faces_of
from embodied.scene.landscapes import Ridge, Scenery, Town
from embodied.seeds import stream

KNOTS = (np.radians([90.0, 25.0, -40.0, -90.0]), np.array([0.0, 0.2, 0.86, 1.0]))
"""Elevations, and how far down the picture they are."""
Things = list[tuple[float, Callable[[], None]]]
"""How far something is, metres, and what paints it."""
DOME = "outdoor/sky"
"""Owner of the dome; no instance id belongs to it."""
RADIUS = 90.0
"""Metres to the dome that wears the picture."""
EYE = 1.6
"""Above the floor, metres."""
AIR = np.array([0.85, 1.0, 1.3])
"""How much faster than green light red and blue light fade: hills turn blue."""
GLOW = np.array([1.0, 0.62, 0.26]) * 0.15
"""Radiance of a lit window, 100 cd/m2."""

LEAVES = {
    "spring": ((0.085, 0.140, 0.030), (0.110, 0.150, 0.045), (0.060, 0.105, 0.025), (0.300, 0.230, 0.220)),
    "summer": ((0.050, 0.085, 0.025), (0.062, 0.095, 0.028), (0.042, 0.072, 0.024), (0.070, 0.090, 0.030)),
    "autumn": ((0.300, 0.120, 0.020), (0.330, 0.205, 0.035), (0.170, 0.095, 0.030), (0.095, 0.100, 0.030)),
    "winter": ((0.120, 0.100, 0.085), (0.105, 0.085, 0.070), (0.120, 0.100, 0.085), (0.105, 0.085, 0.070)),
}
"""Linear reflectances, as everything here."""
FIR = (0.024, 0.045, 0.024)
BARK = np.array([0.075, 0.058, 0.045])
GRASS = {
    "spring": (0.070, 0.105, 0.028), "summer": (0.095, 0.105, 0.040), "autumn": (0.092, 0.092, 0.036),
    "winter": (0.760, 0.780, 0.820),
}  # fmt: skip
FIELDS = {
    "spring": ((0.07, 0.12, 0.025), (0.10, 0.14, 0.03), (0.15, 0.105, 0.07), (0.45, 0.36, 0.03), (0.06, 0.10, 0.03)),
    "summer": ((0.38, 0.29, 0.12), (0.30, 0.24, 0.09), (0.08, 0.11, 0.03), (0.12, 0.13, 0.04), (0.07, 0.09, 0.03)),
    "autumn": ((0.27, 0.20, 0.11), (0.11, 0.075, 0.05), (0.14, 0.095, 0.06), (0.08, 0.10, 0.03), (0.20, 0.16, 0.08)),
    "winter": ((0.74, 0.76, 0.80), (0.66, 0.68, 0.72), (0.78, 0.80, 0.84), (0.56, 0.55, 0.55), (0.70, 0.72, 0.76)),
}  # fmt: skip
WALLS = (
    (0.62, 0.58, 0.50), (0.68, 0.66, 0.61), (0.36, 0.17, 0.11), (0.55, 0.44, 0.28), (0.50, 0.47, 0.43),
    (0.60, 0.40, 0.30), (0.44, 0.26, 0.18), (0.70, 0.64, 0.52),
)  # fmt: skip
PAINTS = np.array([(0.6,) * 3, (0.2,) * 3, (0.6,) * 3, (0.1,) * 3, (0.045,) * 3, (0.045,) * 3])
"""Of what buildings are made of; walls and roofs have several."""
DRY = 0.2
"""Cosine of the angle from the outlook beyond which a lake has land."""
TILES = ((0.24, 0.095, 0.060), (0.19, 0.080, 0.055), (0.085, 0.085, 0.090), (0.27, 0.12, 0.075), (0.12, 0.10, 0.09))
SNOW = (0.76, 0.78, 0.82)


_C = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
PLAIN = np.array(
    [[(*_C[i], 0), (*_C[(i + 1) % 4], 0), (*_C[(i + 1) % 4], 1), (*_C[i], 1)] for i in range(4)]
    + [[(-1, -1, 1), (1, -1, 1), (1, 0, 1), (-1, 0, 1)], [(1, 1, 1), (-1, 1, 1), (-1, 0, 1), (1, 0, 1)]]
    + [[(1, -1, 1), (1, 1, 1), (1, 0.1, 1), (1, -0.1, 1)], [(-1, 1, 1), (-1, -1, 1), (-1, -0.1, 1), (-1, 0.1, 1)]],
    float,
)
"""(8, 4, 3) corners of walls, roof and gables of a house of half-size 1."""
RIDGE = np.zeros((8, 4, 3))
"""1 where a corner is on the ridge."""
RIDGE[4:, 2:, 2] = 1


@dataclass(frozen=True, eq=False)
class FarLight:
    """What shines on far things."""

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


def clearness(distance: float | np.ndarray, visibility: float) -> np.ndarray:
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
    """A sphere around the house that wears a picture on its inside: vertices (n, 3), faces (m, 3), uv (n, 2) from the
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
    vertices = (centre + RADIUS * d).reshape(-1, 3)
    p = vertices[faces]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    outward = (normal * (p.mean(1) - centre)).sum(1) > 0
    faces = np.where(outward[:, None], faces[:, ::-1], faces)
    real = np.linalg.norm(normal, axis=1) > 1e-4
    uv = np.stack([u, v], axis=-1).reshape(-1, 2)
    return vertices.astype(np.float32), faces[real].astype(np.int32), uv.astype(np.float32)


class Canvas:
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


VARIANTS = 8
"""Of every landscape; houses whose seeds differ by so many share one."""


def land_rng(seed: int) -> np.random.Generator:
    """What the far landscape of a house is drawn from."""
    return stream(seed % VARIANTS, "outdoors", "land")


def kept_picture(place: Scenery, seed: int, cache: Path | None) -> np.ndarray:
    """`plain_picture`, kept in `cache` where one is given."""
    if cache is None:
        return plain_picture(place, seed)
    told = (place.landscape, place.season, place.height, place.outlook if place.table.water else 0.0, seed % VARIANTS)
    file = Path(cache) / "landscapes" / f"{digest(code_digest(__name__), *told)[:24]}.png"
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
    paint_land(Canvas(picture, place.height + EYE), place, light, rng=land_rng(seed))
    return (255 * np.clip(picture, 0, 1) ** (1 / 2.2) + 0.5).astype(np.uint8)


def paint_land(canvas: Canvas, place: Scenery, light: FarLight, *, rng: np.random.Generator) -> None:
    """Everything between the plot and the sky, into `canvas`."""
    _paint_ground(canvas, place, light, rng=rng)
    things: Things = []
    for far in place.table.far:
        things += (
            _ridge(canvas, far, place, light, rng=rng)
            if isinstance(far, Ridge)
            else _town(canvas, far, place, light, rng=rng)
        )
    shore = place.table.water
    count, nearest, farthest = place.table.scatter
    for _ in range(count):
        even = place.landscape == "forest"
        t = rng.random()
        away = float(
            np.sqrt(nearest**2 + t * (farthest**2 - nearest**2)) if even else nearest * (farthest / nearest) ** t
        )
        yaw = float(rng.uniform(-np.pi, np.pi))
        tree = _tree(canvas, away, yaw, place, light, rng=rng)
        if shore is None or np.cos(yaw - place.outlook) < DRY:
            things.append((away, tree))
    if shore is not None:
        things.append((shore[1] - 60, functools.partial(_paint_water, canvas, place, light, shore, rng=rng)))
    for _, paint in sorted(things, key=lambda t: -t[0]):
        paint()
    if light.lamps > 0 and place.table.ground == "town":
        _street_lamps(canvas, light, rng=rng)


# ------------------------------------------------------------------ ground


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


def _paint_ground(canvas: Canvas, place: Scenery, light: FarLight, *, rng: np.random.Generator) -> None:
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
        paved, green = np.array([0.16, 0.155, 0.15], np.float32), np.array(GRASS[place.season], np.float32)
        share = np.clip(0.35 + 0.6 * _over_ground(_grain(3, 40), 600.0, x, y), 0, 0.75)[..., None]
        own = (paved + (green - paved) * share) * vary[..., None]
    else:
        colour = np.array(GRASS[place.season], np.float32)
        if kind == "woodland" and not place.snow:
            colour = np.array([0.075, 0.060, 0.030], np.float32)
        own = colour * vary[..., None]
    e = (light.ambient + light.sun * max(light.towards[2], 0.0)).astype(np.float32)
    clear = clearness(away, light.visibility).astype(np.float32)[:, None]
    canvas.picture[first:] = own * e * clear + light.air[None].astype(np.float32) * (1 - clear)


def _field_tile(place: Scenery, *, rng: np.random.Generator, side: int = 256) -> np.ndarray:
    """(side, side, 3) float32: fields of many colours between hedges."""
    points = rng.random((46, 2)) * side
    every = np.concatenate([points + [i * side, j * side] for i in (-1, 0, 1) for j in (-1, 0, 1)])
    y, x = np.mgrid[:side, :side]
    stretch = np.array([1.0, 1.7])
    near, which = cKDTree(every * stretch).query(np.column_stack([x.ravel(), y.ravel()]) * stretch, k=2)
    colours = np.array(FIELDS[place.season])[rng.integers(5, size=len(points))] * rng.uniform(
        0.85, 1.15, (len(points), 1)
    )
    angle = rng.uniform(0, np.pi, len(points))
    mine = which[:, 0] % len(points)
    rows = 1 + 0.05 * np.sin((x.ravel() * np.cos(angle[mine]) + y.ravel() * np.sin(angle[mine])) * 2.2)
    tile = colours[mine] * rows[:, None]
    hedge = (near[:, 1] - near[:, 0] < 0.9) & (rng.random(len(points))[mine] < 0.8)
    tile[hedge] = np.array(LEAVES[place.season][2]) * 0.8
    return tile.reshape(side, side, 3).astype(np.float32)


# ------------------------------------------------------------------ hills and woods


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


def _ridge(canvas: Canvas, r: Ridge, place: Scenery, light: FarLight, *, rng: np.random.Generator) -> Things:
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
        sunny = 1 + 0.5 * np.clip(
            slope * np.sin(canvas.yaw - np.arctan2(light.towards[1], light.towards[0])), -0.8, 0.8
        ) * float(light.sun.any())
        own = (
            _cover_of(canvas, r, y0, y1, top, place, np.random.default_rng(noise))
            * (e * sunny[:, None]).astype(np.float32)[None]
        )
        clear = clearness(r.distance, light.visibility).astype(np.float32)
        canvas.blend(0, y0, own * clear + light.air[None].astype(np.float32) * (1 - clear), cover)

    return [(r.distance, paint)]


def _cover_of(
    canvas: Canvas, r: Ridge, y0: int, y1: int, top: np.ndarray, place: Scenery, rng: np.random.Generator
) -> np.ndarray:
    """(rows, w, 3) reflectances of a ridge's face."""
    h, w = y1 - y0, canvas.w
    leaf = np.mean(LEAVES[place.season][:3], axis=0) * (1 - place.table.firs) + np.array(FIR) * place.table.firs
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
        own += (np.array(GRASS[place.season], np.float32) - own) * np.clip((patches - 0.62) * 6, 0, 0.8)[..., None]
    if place.snow:
        share = np.clip(0.3 + (patches - 0.55) * 3, 0.22, 0.9)[..., None]
        own += (np.array(SNOW, np.float32) - own) * share
    return own.astype(np.float32)


def _trees_of(
    canvas: Canvas, r: Ridge, height: np.ndarray, place: Scenery, light: FarLight, *, rng: np.random.Generator
) -> Things:
    """A wood's edge or a row of trees as single trees over undergrowth."""
    low = Ridge(r.distance, 0.42 * r.height, 0.25 * r.rough, "wood", 3 * r.grain)
    things = _ridge(canvas, low, place, light, rng=rng) if r.height - r.rough > 0 else []
    count = int(2 * np.pi * r.distance / max(0.42 * r.height + 1.2, 3.0))
    for k in range(min(count, 420)):
        yaw = float((k + rng.random()) / min(count, 420) * 2 * np.pi - np.pi)
        tall = float(height[int(canvas.columns(yaw)) % canvas.w]) * rng.uniform(0.75, 1.25)
        away = r.distance * rng.uniform(0.94, 1.1)
        if tall > 2.5:
            things.append((away, _tree(canvas, away, yaw, place, light, tall, rng=rng)))
    return things


def _tree(
    canvas: Canvas,
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
        small = cv2.resize(
            sprite, (wide, high), interpolation=cv2.INTER_AREA if high < sprite.shape[0] else cv2.INTER_LINEAR
        )
        small = small[:, ::-1] if flip else small
        x0, y0 = int(canvas.columns(yaw) - wide / 2), int(round(tip))
        small = small[max(-y0, 0) : canvas.h - y0]
        cover = small[..., 3:]
        clear = clearness(away, light.visibility)
        air = light.air[int(canvas.columns(yaw)) % canvas.w] * (1 - clear)
        own = small[..., :3] / np.maximum(cover, 1e-3)
        canvas.blend(
            x0,
            max(y0, 0),
            (own * (light.on_leaves(np.array(yaw)) * hue * clear).astype(np.float32) + air.astype(np.float32)),
            cover,
        )

    return paint


@functools.cache
def _sprite(kind: str, season: str, which: int) -> np.ndarray:
    """(n, m, 4) float32 of a tree seen from the side: reflectance times cover, and cover."""
    rng = np.random.default_rng([which, len(kind), len(season), ord(season[0])])
    brush = _Brush(320, 320 if kind == "leafy" else 320 * 6 // 10, rng)
    if kind == "fir":
        _fir(brush, season)
    else:
        _leafy(brush, np.array(LEAVES[season][which % 4]), bare=season == "winter")
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
                t = rng.uniform(0.45, 1.0)
                self.branch(
                    x + t * (x1 - x),
                    y + t * (y1 - y),
                    angle * 0.8 + rng.normal(0, 0.55),
                    length * rng.uniform(0.5, 0.78),
                    max(width * 0.58, 1.1),
                    level - 1,
                )


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
        shape = np.column_stack(
            [x + np.cos(turn) * s * rng.uniform(0.5, 1.2, 5), y + np.sin(turn) * s * rng.uniform(0.5, 1.1, 5)]
        )
        brush.draw(shape, leaf * max(0.25, shade + rng.normal(0, 0.16)) * rng.uniform(0.9, 1.1, 3))


# ------------------------------------------------------------------ towns


def _town(canvas: Canvas, t: Town, place: Scenery, light: FarLight, *, rng: np.random.Generator) -> Things:
    spots = _scattered(t, rng=rng) if t.count else _streets(t, rng=rng)
    things: Things = []
    for x, y, yaw, wide in spots:
        storeys, flat = int(rng.integers(t.storeys[0], t.storeys[1] + 1)), rng.random() < t.flat
        tower = t.storeys[1] > 3 and rng.random() < 0.006 and np.hypot(x, y) > 250
        storeys, flat, wide = (int(rng.integers(9, 17)), True, 22.0) if tower else (storeys, flat, wide)
        b = Building(
            (x, y),
            yaw,
            wide,
            float(rng.uniform(8.0, 11.0)),
            2.9 * storeys + 0.3,
            0.0 if flat else float(rng.uniform(2.6, 4.2)),
            int(rng.integers(100)),
            int(rng.integers(100)),
        )
        things.append(
            (
                float(np.hypot(x, y)),
                functools.partial(
                    _paint_building, canvas, b, place, light, np.random.default_rng(int(rng.integers(1 << 30)))
                ),
            )
        )
    return things


def _scattered(t: Town, *, rng: np.random.Generator) -> list[tuple[float, float, float, float]]:
    out: list[tuple[float, float, float, float]] = []
    for _ in range(6 * t.count):
        away, a = t.nearest * (t.farthest / t.nearest) ** rng.random(), rng.uniform(-np.pi, np.pi)
        x, y = float(away * np.cos(a)), float(away * np.sin(a))
        if len(out) < t.count and all((x - p[0]) ** 2 + (y - p[1]) ** 2 > 17**2 for p in out):
            out.append((x, y, float(rng.integers(4) * np.pi / 2 + rng.normal(0, 0.2)), float(rng.uniform(8.5, 13))))
    return out


def _streets(t: Town, *, rng: np.random.Generator) -> list[tuple[float, float, float, float]]:
    """Rows of houses along straight streets near by, thinner and thinner rings of houses behind."""
    out, grid = [], float(rng.uniform(0, np.pi))
    c, s = np.cos(grid), np.sin(grid)
    close = min(t.farthest, 210.0)
    for row in np.arange(-close, close, 36.0):
        for side in (-1, 1):
            u = -close + float(rng.uniform(0, 12))
            while u < close:
                wide, v = float(rng.uniform(8.5, 15.0)), row + side * 10.0 + rng.normal(0, 0.6)
                x, y = c * (u + wide / 2) - s * v, s * (u + wide / 2) + c * v
                if t.nearest + 6 < np.hypot(x, y) < close and rng.random() < 0.9 and abs((u + 45) % 90 - 45) > 7:
                    out.append((float(x), float(y), grid + (0.0 if side > 0 else np.pi), wide))
                u += wide + (0.0 if rng.random() < 0.8 else float(rng.uniform(3, 14)))
    away = close
    while away < t.farthest:
        away *= 1.11
        for a in np.arange(0, 2 * np.pi, 0.1 if away < 1200 else 0.14).tolist():
            a += rng.uniform(0, 0.09)
            d = away * rng.uniform(0.97, 1.04)
            turn = grid + 0.5 * np.sin(3 * a) + float(rng.integers(4)) * np.pi / 2
            out.append(
                (float(d * np.cos(a)), float(d * np.sin(a)), turn, float(rng.uniform(10, 20)) * (1 + away / 2500))
            )
    return out


def _paint_building(canvas: Canvas, b: Building, place: Scenery, light: FarLight, rng: np.random.Generator) -> None:
    """Walls, then the roof, then windows, of the sides that face the eye."""
    away = float(np.hypot(*b.at))
    faces = faces_of(b, -canvas.eye, detail=False, rng=rng) if away < 190 else _plain(b, -canvas.eye, rng=rng)
    corners, made = faces.corners, faces.made_of
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    ok = (normal * corners[:, 0]).sum(1) < 0
    corners, made, normal = corners[ok], made[ok], normal[ok]
    normal /= np.sqrt((normal * normal).sum(1, keepdims=True))
    xy = canvas.project(corners)
    column = int(canvas.columns(np.arctan2(b.at[1], b.at[0]))) % canvas.w
    clear = clearness(away, light.visibility)
    air = light.air[column]
    own = PAINTS[made]
    own[made == WALL] = WALLS[b.paint % len(WALLS)]
    own[made == ROOF] = SNOW if place.snow else TILES[b.tiles % len(TILES)]
    own = own * light.on(normal)
    glass = (made == PANE) | (made == LIT)
    own[glass] += air * 0.12
    own[made == LIT] += GLOW * light.lamps * rng.uniform(0.5, 1.2)
    own = own * clear + air * (1 - clear)
    order = np.argsort(glass, kind="stable")
    canvas.fill(xy[order], own[order])


def _plain(b: Building, base: float, *, rng: np.random.Generator) -> Faces:
    """A far building: walls and roof, and one lit window in the evening."""
    x, y, z = b.wide / 2, b.deep / 2, b.eaves
    low, high = PLAIN * [x, y, z], RIDGE * [x, y, b.ridge]
    c, s = np.cos(b.yaw), np.sin(b.yaw)
    corners = (low + high) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]]) + [*b.at, base]
    made = np.array([WALL, WALL, WALL, WALL, ROOF, ROOF, WALL, WALL])
    if b.ridge <= 0:
        lid = corners[:4, 3][::-1][None]
        corners, made = np.concatenate([corners[:4], lid[:, ::-1]]), made[:5]
    if rng.random() < EVENING:
        side = corners[int(rng.integers(4))]
        u, v = rng.uniform(0.1, 0.8), rng.uniform(0.3, 0.8)
        at = lambda u, v: side[0] + u * (side[1] - side[0]) + v * (side[3] - side[0])
        corners = np.concatenate(
            [corners, np.array([at(u, v), at(u + 0.12, v), at(u + 0.12, v + 0.1), at(u, v + 0.1)])[None]]
        )
        made = np.append(made, LIT)
    return Faces(corners, made)


def _street_lamps(canvas: Canvas, light: FarLight, *, rng: np.random.Generator) -> None:
    """Points of light among the houses."""
    for _ in range(700):
        away, yaw = 45 * (60 ** rng.random()), rng.uniform(-np.pi, np.pi)
        x, y = int(canvas.columns(yaw)) % canvas.w, int(round(float(canvas.rows(np.arctan2(7.0 - canvas.eye, away)))))
        size = 2 if away < 250 else 1
        colour = np.array([1.0, 0.68, 0.36]) if rng.random() < 0.7 else np.array([0.9, 0.95, 1.0])
        left = clearness(away, light.visibility)
        canvas.picture[y : y + size, x : x + size] += (colour * left * light.lamps * min(2.5, 160 / away)).astype(
            np.float32
        )


# ------------------------------------------------------------------ water


def _paint_water(
    canvas: Canvas, place: Scenery, light: FarLight, shore: tuple[float, float], *, rng: np.random.Generator
) -> None:
    """A lake on the side that the house looks at: the sky and the far shore, mirrored in small waves."""
    turn = np.abs(np.angle(np.exp(1j * (canvas.yaw - place.outlook))))
    near = (
        shore[0] * (1 + 0.25 * (_wave(canvas.w, 14, rng=rng) - 0.5)) / np.maximum(np.cos(np.minimum(turn, 1.45)), 0.12)
    )
    near = np.where(np.cos(turn) > DRY, near, np.inf)
    first = int(np.searchsorted(-canvas.elevation, canvas.eye / shore[1]))
    last = int(np.searchsorted(-canvas.elevation, canvas.eye / (0.8 * shore[0])))
    down = -canvas.elevation[first:last]
    away = canvas.eye / np.tan(down)
    step = away**2 / canvas.eye * np.pi / 1800
    cover = np.clip((away[:, None] - near[None]) / step[:, None] + 0.5, 0, 1).astype(np.float32)[..., None]
    waves = cv2.resize(
        rng.standard_normal((last - first, canvas.w // 24)).astype(np.float32),
        (canvas.w, last - first),
        interpolation=cv2.INTER_CUBIC,
    )
    tilt = 0.012 + 0.03 * np.clip(40 / away, 0, 1)[:, None]
    mirrored = canvas.rows(down[:, None] + np.abs(0.006 + tilt * waves)).astype(np.float32)
    across = np.tile(np.arange(canvas.w, dtype=np.float32), (last - first, 1))
    seen = cv2.remap(canvas.picture, across, mirrored, cv2.INTER_LINEAR)
    fresnel = (0.02 + 0.98 * (1 - np.sin(down + 0.09)) ** 5).astype(np.float32)[:, None, None]
    deep = (np.array([0.012, 0.03, 0.032]) * (light.ambient + light.sun * max(light.towards[2], 0.0))).astype(
        np.float32
    )
    clear = clearness(away, light.visibility).astype(np.float32)[:, None]
    own = (seen * fresnel + deep * (1 - fresnel)) * clear + light.air[None].astype(np.float32) * (1 - clear)
    canvas.blend(0, first, own, cover)
