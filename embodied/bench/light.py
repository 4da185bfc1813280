"""All ways of drawing the same views, against the path tracer: quality and milliseconds."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from embodied import gl
from embodied.assets.cache import write_json
from embodied.bench import timing
from embodied.generate import HouseConfig, generate_house
from embodied.house.house import House
from embodied.light.backend import device
from embodied.light.baking.house import bake
from embodied.light.pages.files import Bake
from embodied.light.tracing.reference import Tracer
from embodied.navigation.graph import build_graph
from embodied.render.camera import camera_at
from embodied.render.classic import Renderer
from embodied.world import gloss_of

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue

LIGHT_HOUSES, ROOMS_SHOWN = 4, 3
"""How many houses are compared, and rooms of each."""
VIEW_SIZE = (160, 240)
"""Height and width of the pictures."""
RAYS = 64
"""Per pixel of the path-traced ways."""
FLAT_AREA = (35.0, 70.0)
"""Square metres of the bench's flats, each of which is baked and path-traced."""
BAKES = ("fast", "normal")
"""Light qualities that are compared; what is traced reads the last one."""
WAYS_DRAWN = ("unlit", *BAKES, "gloss")
"""Ways by a Renderer: 'gloss' over the last bake, all others matte."""
WAYS = (*WAYS_DRAWN, "glossy", "diffuse", "reference")
TIMES = ((10.5, "clear"), (13.0, "overcast"), (18.6, "clear"), (22.0, "clear"))
"""Morning sun, grey noon, dusk, night; the views are dealt out over them."""
VIEW_ANGLE = math.radians(65.0)
SHOWN = 0.005
"""Share of a view's pixels that mirrors and metals have to fill before they are judged by themselves."""


@dataclass(frozen=True, eq=False)
class Shot:
    """One view by one way."""

    room: str
    hour: float
    way: str
    rgb: np.ndarray
    ms: float
    plain: np.ndarray | None = None
    """(h, w) bool, what is neither mirror nor metal; with way 'diffuse' only."""


def compare(
    catalogue: Catalogue, cache: Path, out: Path, *, seed: int = 1, progress: Callable[[str], None] = lambda text: None
) -> dict:
    """Draw ROOMS_SHOWN rooms of each of LIGHT_HOUSES houses in every way, measure, and write light.json to `out`.

    Args:
      seed: of the first house; the others have the next ones, each at another time of day.
    """
    shots: list[Shot] = []
    kinds: list[str] = []
    for k in range(LIGHT_HOUSES):
        hour, weather = TIMES[k % len(TIMES)]
        house = generate_house(seed + k, HouseConfig(area=FLAT_AREA, hour=hour, weather=weather), catalogue=catalogue)
        counted = f"{len(house.rooms)} rooms, {len(house.placements)} objects"
        progress(f"house {seed + k} at {hour:g} h, {weather}: {counted}")
        bakes = {quality: bake(house, catalogue, cache, quality) for quality in BAKES}
        chosen = viewpoints(house, kinds)
        kinds += [house.room_by_id[room].kind for room, _, _ in chosen]
        shots += draw(house, catalogue, bakes, chosen)
    facts = measure(shots)
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    write_json(out / "light.json", facts, indent=1)
    return facts


def viewpoints(house: House, shown: Sequence[str] = ()) -> list[tuple[str, np.ndarray, float]]:
    """ROOMS_SHOWN rooms of different kinds: id, eye, and the yaw with the longest view.

    Args:
      shown: kinds of rooms that other houses have shown, each as often as it was; the rarest come first, then the
        largest.
    """
    graph = build_graph(house)
    area = {r.id: abs(float(np.ptp(np.array(r.polygon), axis=0).prod())) for r in house.rooms}
    viewpoints_by_room: list[tuple[str, np.ndarray, float]] = []
    kinds: set[str] = set()
    for room in sorted(house.rooms, key=lambda r: (shown.count(r.kind), -area[r.id])):
        nodes = [i for i, r in enumerate(graph.room_of_node) if r == room.id]
        if not nodes or room.kind in kinds or len(viewpoints_by_room) == ROOMS_SHOWN:
            continue
        kinds.add(room.kind)
        corner = np.array(max(room.polygon, key=lambda c: min(np.hypot(*(graph.positions[i][:2] - c)) for i in nodes)))
        eye = max((graph.positions[i] for i in nodes), key=lambda p: float(np.hypot(*(p[:2] - corner))))
        viewpoints_by_room.append((room.id, eye, math.atan2(*(corner - eye[:2])[::-1])))
    return viewpoints_by_room


def draw(
    house: House, catalogue: Catalogue, baked: Mapping[str, Bake], views: Sequence[tuple[str, np.ndarray, float]]
) -> list[Shot]:
    """Every view in every way; the milliseconds of the renderers are medians of five 256 x 256 cube faces."""
    shots, best, hour = [], baked[BAKES[-1]], house.sky.hour
    for way in WAYS:
        if way in WAYS_DRAWN:
            lit = None if way == "unlit" else baked.get(way, best).lit
            overlay = gloss_of(best, detail=False) if way == "gloss" else None
            with Renderer(house, catalogue, lit=lit, overlay=overlay) as r:
                for room, eye, yaw in views:
                    face = functools.partial(r.rgb, camera_at(eye, yaw), (256, 256))
                    rgb = r.view(eye, yaw, -0.1, VIEW_ANGLE, VIEW_SIZE).rgb
                    shots.append(Shot(room, hour, way, rgb, timing.measure("", face, repeats=5).value))
        else:
            tracer = Tracer(best, house, quality=way, rays=16 if way == "glossy" else RAYS)
            shots += [_traced(tracer, way, v, hour) for v in views]
    return shots


def _traced(t: Tracer, way: str, view: tuple[str, np.ndarray, float], hour: float) -> Shot:
    room, eye, yaw = view
    camera = camera_at(eye, yaw, -0.1, VIEW_ANGLE)
    start = time.perf_counter()
    rgb, _, _ = t.picture(eye, camera.forward, camera.up, VIEW_ANGLE, VIEW_SIZE)
    ms = 1e3 * (time.perf_counter() - start) * 256 * 256 / (VIEW_SIZE[0] * VIEW_SIZE[1])
    plain = t.plain(eye, camera.forward, camera.up, VIEW_ANGLE, VIEW_SIZE) if way == "diffuse" else None
    return Shot(room, hour, way, rgb, ms, plain)


def measure(shots: Sequence[Shot]) -> dict:
    """Medians over all views per way.

    Against the diffuse reference only diffuse surfaces count: a page cannot follow the eye as mirrors
    and metals do. The full reference is compared whole, and mirrors and metals alone with it as 'psnr_shiny' (in the
    median over the views that show at least SHOWN of them).
    """
    by = {(s.room, s.hour, s.way): s for s in shots}
    views = sorted({(s.room, s.hour) for s in shots})
    rows = []
    for way in WAYS:
        row: dict = {"way": way, "ms_256": float(np.median([by[*v, way].ms for v in views]))}
        for truth in ("reference", "diffuse"):
            parts = [by[*v, "diffuse"].plain if truth == "diffuse" else None for v in views]
            pairs = [(by[*v, way].rgb, by[*v, truth].rgb, part) for v, part in zip(views, parts, strict=True)]
            for name, of in (("psnr", psnr), ("ssim", ssim)):
                row[f"{name}_{truth}"] = None if way == truth else float(np.median([of(*p) for p in pairs]))
        shiny = [(v, ~plain) for v in views if (plain := by[*v, "diffuse"].plain) is not None]
        alone = [psnr(by[*v, way].rgb, by[*v, "reference"].rgb, m) for v, m in shiny if m.mean() >= SHOWN]
        row["psnr_shiny"] = None if way == "reference" or not alone else float(np.median(alone))
        rows.append(row)
    return {"rows": rows, "views": [list(v) for v in views], "device": device(), "renderer": str(gl.info())}


def table(facts: dict) -> str:
    """The measures as Markdown."""
    number = lambda x, form: "" if x is None else format(x, form)
    lines = [
        "| way | ms per 256 × 256 | PSNR / SSIM to reference | mirrors and metal alone | to diffuse reference |",
        "|---|---|---|---|---|",
    ]
    for r in facts["rows"]:
        whole, diffuse = (
            f"{number(r[f'psnr_{t}'], '.1f')} / {number(r[f'ssim_{t}'], '.3f')}" for t in ("reference", "diffuse")
        )
        lines.append(f"| {r['way']} | {r['ms_256']:.0f} | {whole} | {number(r['psnr_shiny'], '.1f')} | {diffuse} |")
    about = f"{facts['renderer']}, light by {facts['device']}."
    return "\n".join([*lines, f"\nMedians of {len(facts['views'])} views of one run; {about}"])


def psnr(a: np.ndarray, b: np.ndarray, where: np.ndarray | None = None) -> float:
    """Peak signal to noise ratio in dB of uint8 pictures, both blurred by one pixel against path-tracing noise.

    Args:
      where: (h, w) bool, pixels that count; all if None.
    """
    a, b = (gaussian_filter(x.astype(float), (1, 1, 0)) for x in (a, b))
    off = np.mean((a - b) ** 2, axis=-1)
    return float(10 * np.log10(255**2 / max(float(np.mean(off if where is None else off[where])), 1e-9)))


def ssim(a: np.ndarray, b: np.ndarray, where: np.ndarray | None = None) -> float:
    """Mean structural similarity of the luma (Wang et al. 2004, eq. 13, Gaussian window of 1.5 pixels)."""
    a, b = (cv2.cvtColor(x, cv2.COLOR_RGB2GRAY).astype(float) for x in (a, b))
    mean = lambda x: gaussian_filter(x, 1.5)
    ma, mb = mean(a), mean(b)
    va, vb, cov = mean(a * a) - ma**2, mean(b * b) - mb**2, mean(a * b) - ma * mb
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    alike = (2 * ma * mb + c1) * (2 * cov + c2) / ((ma**2 + mb**2 + c1) * (va + vb + c2))
    return float(np.mean(alike if where is None else alike[where]))
