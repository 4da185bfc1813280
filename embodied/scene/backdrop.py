"""The far landscape, painted once around a house: ground, hills, woods, towns and water, paler with distance.

The picture goes all round (columns) and from zenith to nadir (rows); see far_canvas.
"""

import functools
from pathlib import Path

import cv2
import numpy as np

from embodied.assets.cache import digest, write_bytes
from embodied.assets.closure import code_digest
from embodied.assets.decoding import read_picture
from embodied.scene.buildings import EVENING, LIT, PANE, ROOF, WALL, Building, Faces, faces_of
from embodied.scene.far_canvas import EYE, SNOW, DrawList, FarCanvas, FarLight, elevations, transmittance, tree
from embodied.scene.far_land import DRY, paint_ground, paint_water, ridge
from embodied.scene.landscapes import Ridge, Scenery, Town
from embodied.seeds import stream

VARIANTS = 8
"""Of every landscape; houses whose seeds differ by so many share one."""


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


GLOW = np.array([1.0, 0.62, 0.26]) * 0.15
"""Radiance of a lit window, 100 cd/m2."""
WALLS = (
    (0.62, 0.58, 0.50), (0.68, 0.66, 0.61), (0.36, 0.17, 0.11), (0.55, 0.44, 0.28), (0.50, 0.47, 0.43),
    (0.60, 0.40, 0.30), (0.44, 0.26, 0.18), (0.70, 0.64, 0.52),
)  # fmt: skip
PAINTS = np.array([(0.6,) * 3, (0.2,) * 3, (0.6,) * 3, (0.1,) * 3, (0.045,) * 3, (0.045,) * 3])
"""Of what buildings are made of; walls and roofs have several."""
TILES = ((0.24, 0.095, 0.060), (0.19, 0.080, 0.055), (0.085, 0.085, 0.090), (0.27, 0.12, 0.075), (0.12, 0.10, 0.09))
_C = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
BARE_BUILDING = np.array(
    [[(*_C[i], 0), (*_C[(i + 1) % 4], 0), (*_C[(i + 1) % 4], 1), (*_C[i], 1)] for i in range(4)]
    + [[(-1, -1, 1), (1, -1, 1), (1, 0, 1), (-1, 0, 1)], [(1, 1, 1), (-1, 1, 1), (-1, 0, 1), (1, 0, 1)]]
    + [[(1, -1, 1), (1, 1, 1), (1, 0.1, 1), (1, -0.1, 1)], [(-1, 1, 1), (-1, -1, 1), (-1, -0.1, 1), (-1, 0.1, 1)]],
    float,
)
"""(8, 4, 3) corners of walls, roof and gables of a house of half-size 1."""
RIDGE = np.zeros((8, 4, 3))
"""1 where a corner is on the ridge."""
RIDGE[4:, 2:, 2] = 1


def town(canvas: FarCanvas, t: Town, place: Scenery, light: FarLight, *, rng: np.random.Generator) -> DrawList:
    """A town's buildings, each painted later."""
    spots = _scattered(t, rng=rng) if t.count else _streets(t, rng=rng)
    things: DrawList = []
    for x, y, yaw, wide in spots:
        storeys, flat = int(rng.integers(t.storeys[0], t.storeys[1] + 1)), rng.random() < t.flat
        tower = t.storeys[1] > 3 and rng.random() < 0.006 and np.hypot(x, y) > 250
        storeys, flat, wide = (int(rng.integers(9, 17)), True, 22.0) if tower else (storeys, flat, wide)
        deep, ridge = float(rng.uniform(8.0, 11.0)), 0.0 if flat else float(rng.uniform(2.6, 4.2))
        paint, tiles = int(rng.integers(100)), int(rng.integers(100))
        b = Building((x, y), yaw, wide, deep, 2.9 * storeys + 0.3, ridge, paint, tiles)
        own = np.random.default_rng(int(rng.integers(1 << 30)))
        things.append((float(np.hypot(x, y)), functools.partial(_paint_building, canvas, b, place, light, own)))
    return things


def street_lamps(canvas: FarCanvas, light: FarLight, *, rng: np.random.Generator) -> None:
    """Points of light among the houses."""
    for _ in range(700):
        away, yaw = 45 * (60 ** rng.random()), rng.uniform(-np.pi, np.pi)
        x, y = int(canvas.columns(yaw)) % canvas.w, int(round(float(canvas.rows(np.arctan2(7.0 - canvas.eye, away)))))
        size = 2 if away < 250 else 1
        colour = np.array([1.0, 0.68, 0.36]) if rng.random() < 0.7 else np.array([0.9, 0.95, 1.0])
        shine = colour * transmittance(away, light.visibility) * light.lamps * min(2.5, 160 / away)
        canvas.picture[y : y + size, x : x + size] += shine.astype(np.float32)


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
            wide = float(rng.uniform(10, 20)) * (1 + away / 2500)
            out.append((float(d * np.cos(a)), float(d * np.sin(a)), turn, wide))
    return out


def _paint_building(canvas: FarCanvas, b: Building, place: Scenery, light: FarLight, rng: np.random.Generator) -> None:
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
    clear = transmittance(away, light.visibility)
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
    low, high = BARE_BUILDING * [x, y, z], RIDGE * [x, y, b.ridge]
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
        window = np.array([at(u, v), at(u + 0.12, v), at(u + 0.12, v + 0.1), at(u, v + 0.1)])
        corners = np.concatenate([corners, window[None]])
        made = np.append(made, LIT)
    return Faces(corners, made)
