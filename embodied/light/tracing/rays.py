"""What rays meet first among bare triangles, with NumPy's arrays in and out: for pictures that are drawn elsewhere."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

import numpy as np

from embodied.light.backend import drjit, mitsuba, scene_of, vector

if TYPE_CHECKING:
    from embodied.render.gloss import Rays


def rays_among(corners: np.ndarray) -> Rays:
    """Rays among triangles (m, 3, 3): Embree's, and Mitsuba's on the machines that have no wheels of it.

    Mitsuba is as quick, but its threads wait awake for more work, a third of the processor time of a picture.
    """
    return embree_among(corners) if importlib.util.find_spec("embreex") else mitsuba_among(corners)


def embree_among(corners: np.ndarray) -> Rays:
    """Rays among triangles by Embree itself, on the thread that asks."""
    from embreex import mesh_construction, rtcore_scene  # late: not for every machine

    scene = rtcore_scene.EmbreeScene()
    mesh_construction.TriangleMesh(scene, np.ascontiguousarray(corners, np.float32))

    def first(start: np.ndarray, onward: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        found = scene.run(np.ascontiguousarray(start, np.float32), np.ascontiguousarray(onward, np.float32), output=1)
        return found["primID"], found["tfar"], found["u"], found["v"]

    return first


def mitsuba_among(corners: np.ndarray) -> Rays:
    """The same by what bakes the light, on all cores."""
    scene, mi, dr = scene_of(corners), mitsuba(), drjit()

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
