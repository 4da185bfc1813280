"""Contact sheets: every model of the catalogue from its front and its back, with name and size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from embodied import gl

gl.prepare()

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from tqdm import tqdm

from embodied.assets.cache import atomic_path
from embodied.scene import model as scene
from embodied.scene.part import Part

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.assets.records import Asset

COLUMNS, ROWS = 6, 4
TILE, LABEL, INSET = 300, 44, 104
"""Pixels: side of a picture, height of its caption, side of the view from behind."""
SPACING = 40.0
"""Metres between models, so that none is in another's picture."""
FRONT, BACK, ELEVATION = 62.0, 242.0, -24.0
"""Azimuths and elevation of the cameras, degrees: three quarters from the front, and from behind."""


def draw_sheets(catalogue: Catalogue, keys: Sequence[str], out: Path) -> tuple[Path, ...]:
    """Write PNGs of 24 models each to the folder `out`, in the order of `keys`.

    A red arrow on the floor points where the front looks; the grid has 10 cm squares for small
    things and 50 cm squares for large ones, beside which a figure of 1.7 m stands.
    """
    per_sheet = COLUMNS * ROWS
    groups = [keys[i : i + per_sheet] for i in range(0, len(keys), per_sheet)]
    paths = []
    for i, group in enumerate(tqdm(groups, desc="drawing sheets", unit="sheet")):
        path = Path(out) / f"sheet_{i:02d}.png"
        with atomic_path(path) as temporary:
            sheet(catalogue, group).save(temporary, format="PNG")
        paths.append(path)
    return tuple(paths)


def sheet(catalogue: Catalogue, keys: Sequence[str]) -> Image.Image:
    """One picture of up to 24 models."""
    model = _model(catalogue, keys)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    page = Image.new("RGB", (COLUMNS * TILE, math.ceil(len(keys) / COLUMNS) * (TILE + LABEL)), "white")
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(size=13)
    renderer = mujoco.Renderer(model, TILE, TILE)
    try:
        for i, key in enumerate(keys):
            asset = catalogue.assets[key]
            left, top = i % COLUMNS * TILE, i // COLUMNS * (TILE + LABEL)
            page.paste(_picture(renderer, data, i, asset, FRONT), (left, top + LABEL))
            behind = _picture(renderer, data, i, asset, BACK).resize((INSET, INSET))
            page.paste(behind, (left + TILE - INSET, top + LABEL + TILE - INSET))
            draw.text((left + 4, top + 2), key, fill="black", font=font)
            draw.text((left + 4, top + 16), f"{asset.object_class}: {asset.name}"[:46], fill=(150, 0, 0), font=font)
            size = " x ".join(f"{100 * s:.0f}" for s in asset.size)
            note = f"{size} cm  {asset.support} {asset.elevation or ''}  {' '.join(asset.tags)}"
            draw.text((left + 4, top + 30), note[:48], fill=(0, 0, 150), font=font)
    finally:
        renderer.close()
    return page


def _model(catalogue: Catalogue, keys: Sequence[str]) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth = spec.visual.global_.offheight = TILE
    spec.visual.quality.shadowsize = 0
    spec.visual.quality.offsamples = 4
    spec.stat.extent, spec.stat.center = 1.0, [0, 0, 0]
    spec.visual.map.znear, spec.visual.map.zfar = 0.005, 60.0
    scene._light(spec)
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=[0.80, 0.86, 0.92],
        rgb2=[0.80, 0.86, 0.92],
        width=32,
        height=32,
    )
    parts = []
    for i, key in enumerate(keys):
        for j, mesh in enumerate(catalogue.mesh(key)):
            parts.append(Part(key, "object", "", mesh, f"{i}_{j}", (SPACING * i, 0.0, 0.0), 0.0))
        _measure(spec, catalogue.assets[key], SPACING * i)
    scene._add_parts(spec, parts, {})
    return spec.compile()


def _measure(spec: mujoco.MjSpec, asset: Asset, x: float) -> None:
    """Grid, arrow and figure beside a model at `x`."""
    width, depth, _ = asset.size
    large = max(asset.size) > 0.6
    step, thin = (0.5, 0.004) if large else (0.1, 0.0008)
    nx, ny = math.ceil(width / 2 / step) + 1, math.ceil(depth / 2 / step) + 1

    def box(pos: Sequence[float], half: Sequence[float], rgba: Sequence[float]) -> None:
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=pos, size=half, rgba=rgba, contype=0, conaffinity=0)

    for k in range(-nx, nx + 1):
        box([x + k * step, 0, -2 * thin], [thin, ny * step, thin], [0.55, 0.6, 0.65, 1])
    for k in range(-ny, ny + 1):
        box([x, k * step, -2 * thin], [nx * step, thin, thin], [0.55, 0.6, 0.65, 1])
    box([x, -depth / 2 - step / 2, 0], [4 * thin, step / 2, thin], [0.9, 0.1, 0.1, 1])
    box([x, -depth / 2 - step, 0], [12 * thin, 4 * thin, thin], [0.9, 0.1, 0.1, 1])
    if large:
        figure = [x + width / 2 + 0.3, depth / 2, 0.0]
        box([figure[0], figure[1], 0.72], [0.17, 0.01, 0.72], [0.35, 0.45, 0.6, 1])
        box([figure[0], figure[1], 1.58], [0.09, 0.01, 0.12], [0.35, 0.45, 0.6, 1])


def _picture(renderer: mujoco.Renderer, data: mujoco.MjData, i: int, asset: Asset, azimuth: float) -> Image.Image:
    camera = mujoco.MjvCamera()
    camera.lookat = [SPACING * i, 0.0, asset.size[2] / 2]
    camera.distance = 1.32 * float(np.linalg.norm(asset.size)) + 0.02
    camera.azimuth, camera.elevation = azimuth, ELEVATION
    renderer.update_scene(data, camera)
    return Image.fromarray(renderer.render())
