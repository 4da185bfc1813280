"""What windows show: a dome with the painted outdoors, and the house's own outer parts in daylight."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from embodied.geometry import r2
from embodied.house.house import House
from embodied.light import radiosity
from embodied.light.arrays import Array, RayScene
from embodied.light.atlas import Atlas, atlas_of, things_of
from embodied.light.backend import added_up, array, constant, drjit, floats, fraction, mitsuba, scene_of, vector
from embodied.light.colours import ColourMaps, albedo
from embodied.light.compose import spread
from embodied.light.cover import Cover, Texels, cover, rasterise, sheets_of
from embodied.light.radiosity import ENV_ROWS, LIFT, points_of, sky_alone
from embodied.light.sky import Outdoors
from embodied.light.tone import Exposure, display
from embodied.light.unwrap import SPARSEST, face_normals
from embodied.scene.lit_pages import LitMesh
from embodied.scene.part import Part

RADIUS = 70.0
"""Metres to the dome."""
DOME = "outdoor/sky"
"""Owner of the dome; no instance id belongs to it."""
LUXELS = 110_000
"""Luxels for all outer parts together, at most."""


@dataclass(frozen=True, eq=False)
class Outside:
    """The outer parts of a house, at any hour."""

    atlas: Atlas
    covers: tuple[Cover, ...]
    luxels: tuple[Texels, ...]
    albedo: tuple[np.ndarray, ...]
    """(n, 3) float32 of the covered texels; each of these by page."""
    blockers: RayScene


def outside_of(
    parts: Sequence[Part], indoors: Atlas, cache: Path, maps: ColourMaps, sharpness: float = 1.0
) -> Outside | None:
    """What light falls on outside; None for a house without outer parts.

    Args:
      parts: the house's parts of kind 'outdoor'.
      indoors: casts shadows.
      sharpness: as in `Settings`.
    """
    if not parts:
        return None
    area = sum(
        float(np.linalg.norm(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]), axis=1).sum()) / 2
        for c in (p.mesh.vertices[p.mesh.faces] for p in parts)
    )
    density = float(min(14.0, np.sqrt(LUXELS * sharpness**2 / max(area, 1.0))))
    budget = round(min(1500.0, (density / SPARSEST) ** 2))  # of trees and hedges, no finer than the rest
    atlas = atlas_of(things_of([_flat(p) for p in parts], density=density, budget=budget, cache=cache, finest=2))
    sheets = sheets_of(atlas.pages)
    covers = tuple(cover(p, p.fineness, s) for p, s in zip(atlas.pages, sheets))
    return Outside(
        atlas,
        covers,
        tuple(rasterise(p, 1, s) for p, s in zip(atlas.pages, sheets)),
        tuple(albedo(p, c, maps) for p, c in zip(atlas.pages, covers)),
        scene_of(np.concatenate([p.corners for a in (indoors, atlas) for p in a.pages if not p.glass])),
    )


def daylit(outside: Outside | None, outdoors: Outdoors, exposure: Exposure, rays: int) -> list[np.ndarray]:
    """The pages of the outer parts in the light of sun and sky, and the dome's; (h, w, 3) uint8 each.

    Args:
      rays: to the sky, for each luxel.
    """
    gain, pages = exposure.outdoors.astype(np.float32), []
    if outside is not None:
        for page, c, coarse, colour in zip(outside.atlas.pages, outside.covers, outside.luxels, outside.albedo):
            e = _daylight(outside.blockers, outdoors, coarse, page.thin[coarse.face], rays)
            field = spread(coarse.index, e, coarse.shape)
            rows, columns = np.divmod(c.index, c.shape[1])
            light = field[rows // page.fineness, columns // page.fineness]
            pages.append(spread(c.index, display(colour * light, gain), c.shape))
    return [*pages, display(outdoors.picture, gain)]


def _flat(part: Part) -> Part:
    """Walls, roofs and lawns of the outdoors unfold like those inside."""
    flat = part.owner in ("outdoor/facade", "outdoor/roof", "outdoor/ground", "outdoor/terrace")
    return dataclasses.replace(part, kind="wall") if flat else part


def _daylight(scene: RayScene, outdoors: Outdoors, texels: Texels, thin: np.ndarray, rays: int) -> np.ndarray:
    """(n, 3) e from open sky and sun; what is hidden by other things counts as a third as bright as the mean."""
    mi, dr = mitsuba(), drjit()
    p = points_of(texels.position, texels.normal, texels.face_normal, thin)
    rows = outdoors.picture.shape[0] // ENV_ROWS
    small = outdoors.picture.reshape(ENV_ROWS, rows, 2 * ENV_ROWS, rows, 3).mean((1, 3)).astype(np.float32)
    space = sky_alone(scene, floats(small))
    hidden = mi.Color3f(*(constant(float(x) / 3) for x in small.mean((0, 1))))

    def one(k: Array) -> tuple[Array, ...]:
        a, b = r2(mi.Float(k) + 1)
        u = fraction(mi.Point2f(p.turn0 + a, p.turn1 + b))
        d = mi.Frame3f(p.normal).to_world(mi.warp.square_to_cosine_hemisphere(u))
        free = ~scene.ray_test(mi.Ray3f(p.position + p.face_normal * LIFT, d))
        return (dr.select(free, radiosity.env_lookup(space, d, free), hidden),)

    e = array(added_up(rays, one, dr.zeros(mi.Color3f, p.n))[0]) / rays
    if outdoors.sun.any():
        cos, side, active = radiosity.facing(p, vector(np.tile(outdoors.sun_direction, (1, 1))))
        ray = mi.Ray3f(p.position + p.face_normal * side * LIFT, vector(np.tile(outdoors.sun_direction, (p.n, 1))))
        lit = dr.select(active & ~scene.ray_test(ray, active), cos, 0.0)
        e += np.asarray(lit)[:, None] * outdoors.sun.astype(np.float32)
    return e


def dome_mesh(house: House, page: int, rows: int = 24) -> LitMesh:
    """A sphere around the house that wears the picture of the outdoors on its inside."""
    corners = np.array([c for r in house.rooms for c in r.polygon])
    centre = np.array([*(corners.min(0) + corners.max(0)) / 2, 1.6])
    v, u = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, 2 * rows + 1), indexing="ij")
    elevation, yaw = (0.5 - v) * np.pi, np.pi * (1 - 2 * u)
    d = np.stack([np.cos(elevation) * np.cos(yaw), np.cos(elevation) * np.sin(yaw), np.sin(elevation)], axis=-1)
    i = np.arange(rows)[:, None] * (2 * rows + 1) + np.arange(2 * rows)[None]
    a, b, c, e = i, i + 1, i + 2 * rows + 2, i + 2 * rows + 1
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, e], -1).reshape(-1, 3)])
    vertices = (centre + RADIUS * d).reshape(-1, 3).astype(np.float32)
    inward = (face_normals(vertices[faces].astype(float)) * (centre - vertices[faces].mean(1))).sum(1)
    faces = np.where((inward < 0)[:, None], faces[:, ::-1], faces)
    size = vertices[faces]
    real = np.linalg.norm(np.cross(size[:, 1] - size[:, 0], size[:, 2] - size[:, 0]), axis=1) > 1e-4
    uv = np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32)
    return LitMesh(DOME, "outdoor", "", page, vertices, faces[real].astype(np.int32), uv)
