"""Reflections of a lit house, for pictures that are drawn elsewhere: first hits of rays among its bare triangles, with
NumPy's arrays in and out, and its gloss."""

from __future__ import annotations

import functools
import importlib.util
from typing import TYPE_CHECKING

import numpy as np

from embodied.light.backend import dr, mi, scene_of, vector
from embodied.light.pages.colours import linear
from embodied.light.pages.files import Bake
from embodied.render.gloss import GlossData, texels_at

if TYPE_CHECKING:
    from embodied.render.gloss import Rays


def rays_among(corners: np.ndarray) -> Rays:
    """Rays among triangles (m, 3, 3): Embree's, and Mitsuba's on the machines that have no wheels of it.

    Mitsuba is as quick, but its threads wait awake for more work, a third of the processor time of a picture.
    """
    return embree(corners) or mitsuba_among(corners)


def embree(corners: np.ndarray) -> Rays | None:
    """Embree's rays among triangles (m, 3, 3), on the thread that asks; None where it is not installed."""
    if importlib.util.find_spec("embreex") is None:
        return None
    from embreex import mesh_construction, rtcore_scene  # late: not for every machine

    scene = rtcore_scene.EmbreeScene()
    mesh_construction.TriangleMesh(scene, np.ascontiguousarray(corners, np.float32))

    def first(start: np.ndarray, onward: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        single = (np.ascontiguousarray(a, np.float32) for a in (start, onward))
        hit = scene.run(*single, dists=None, output=1)
        return hit["primID"], hit["tfar"], hit["u"], hit["v"]

    return first


def mitsuba_among(corners: np.ndarray) -> Rays:
    """Rays among triangles by what bakes the light, on all cores."""
    scene = scene_of(corners)

    def first(start: np.ndarray, onward: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        if not len(start):
            none = np.zeros(0, np.float32)
            return np.zeros(0, np.int32), none, none, none
        hit = scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(vector(start)), vector(onward)))
        face, far, uv = hit.prim_index, hit.t, hit.prim_uv
        dr.eval(face, far, uv)
        far = np.array(far)
        return np.where(np.isfinite(far), np.array(face).astype(np.int32), -1), far, np.array(uv.x), np.array(uv.y)

    return first


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
        tint.append(linear(texels_at(albedo(mesh.page), mesh.uv[mesh.faces].mean(1)) / 255.0))
    exposure = bake.exposure
    outdoors = exposure.outdoors.astype(np.float32)
    return GlossData(gloss, tint, glow, exposure.near, outdoors, float(np.median(exposure.gains)), detail)
