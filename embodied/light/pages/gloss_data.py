"""The gloss of a baked house, for pictures that reflect."""

from __future__ import annotations

import functools

import numpy as np

from embodied.light.pages.colours import linear
from embodied.light.pages.files import Bake
from embodied.render.gloss import GlossData


def gloss_data_of(bake: Bake) -> GlossData:
    """Gloss of a bake's house; colours of metal faces from the middle of each face."""
    own, lit = bake.manifest["own_pages"], bake.lit
    faces = [g if m.page < own else None for g, m in zip(bake.gloss, lit.meshes, strict=True)]
    gloss, detail = ([None if f is None else f[:, k] for f in faces] for k in (slice(3), 3))
    tint: list[np.ndarray | None] = []
    glow = [bake.glow(page) if page < own else None for page in range(len(lit.pages))]
    albedo = functools.cache(bake.albedo)
    for mesh, shine in zip(lit.meshes, gloss, strict=True):
        if shine is None or not shine[:, 2].any():
            tint.append(None)
            continue
        picture = albedo(mesh.page)
        h, w = picture.shape[:2]
        at = mesh.uv[mesh.faces].mean(1)
        x, y = (np.clip(at[:, k] * n, 0, n - 1).astype(int) for k, n in ((0, w), (1, h)))
        tint.append(linear(picture[y, x] / 255.0))
    exposure = bake.exposure
    outdoors = exposure.outdoors.astype(np.float32)
    return GlossData(gloss, tint, glow, exposure.near, outdoors, float(np.median(exposure.gains)), detail)
