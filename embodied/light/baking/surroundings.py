"""The view through windows: a dome with the painted outdoors, and the house's own outer parts in daylight."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from embodied.house.house import House
from embodied.light.backend import RayScene, dr, floats, mi, opaque_float, scene_of, vector
from embodied.light.baking.compose import spread
from embodied.light.pages.atlas import Atlas, atlas_of, things_of
from embodied.light.pages.colours import ColourMaps, albedo
from embodied.light.pages.cover import Cover, Texels, cover, rasterise, sheets_of
from embodied.light.pages.tone import Exposure, display
from embodied.light.pages.unwrap import SPARSEST, areas_of
from embodied.light.settings import LightSettings
from embodied.light.tracing import radiosity
from embodied.light.tracing.radiosity import LIFT, Together, points_of, small_sky
from embodied.light.tracing.sky import Outdoors
from embodied.scene.backdrop import GLOW
from embodied.scene.far_canvas import DOME, dome
from embodied.scene.lit_pages import LitMesh
from embodied.scene.part import Part

BEYOND_THE_PLOT = ("outdoor/neighbours", "outdoor/windows", "outdoor/street")
COARSER = 0.8
"""Owners of what stands beyond the plot, and how many luxels it gets along a metre against the rest."""
LIT_WINDOWS = "outdoor/windows"
"""Owner of the panes that glow in the evening."""
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
    parts: Sequence[Part], indoors: RayScene, cache: Path, maps: ColourMaps, sharpness: float = 1.0
) -> Outside | None:
    """Surfaces that light falls on outside; None for a house without outer parts.

    Args:
      parts: the house's parts of kind 'outdoor'.
      indoors: casts shadows.
      sharpness: as in `Settings`.
    """
    if not parts:
        return None
    far = [p for p in parts if p.owner in BEYOND_THE_PLOT]
    near = [p for p in parts if p.owner not in BEYOND_THE_PLOT]
    area = _area(near) + COARSER**2 * _area(far)
    density = float(min(14.0, np.sqrt(LUXELS * sharpness**2 / max(area, 1.0))))
    budget = round(min(1500.0, (density / SPARSEST) ** 2))  # of trees and hedges, no finer than the rest
    unfold = lambda some, much: things_of([_flat(p) for p in some], LightSettings(density=much, budget=budget), cache)
    things = unfold(near, density) + unfold(far, COARSER * density)
    atlas = atlas_of([dataclasses.replace(t, fineness=min(t.fineness, 2)) for t in things])
    sheets = sheets_of(atlas.pages)
    covers = tuple(cover(p, p.fineness, s) for p, s in zip(atlas.pages, sheets))
    return Outside(
        atlas,
        covers,
        tuple(rasterise(p, 1, s) for p, s in zip(atlas.pages, sheets)),
        tuple(albedo(p, c, maps) for p, c in zip(atlas.pages, covers)),
        Together((indoors, scene_of(np.concatenate([p.corners for p in atlas.pages if not p.glass])))),
    )


def _area(parts: Sequence[Part]) -> float:
    """Of all faces, square metres."""
    return sum(float(areas_of(p.mesh.vertices[p.mesh.faces]).sum()) for p in parts)


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
            shown = colour * light
            if outdoors.lamps > 0 and LIT_WINDOWS in outside.atlas.owners:
                lit = page.owner[c.face] == outside.atlas.owners.index(LIT_WINDOWS)
                shown[lit] += (GLOW * outdoors.lamps).astype(np.float32) * _evenings(page.corners[c.face[lit]])
            pages.append(spread(c.index, display(shown, gain), c.shape))
    return [*pages, display(outdoors.fine, gain)]


def _evenings(corners: np.ndarray) -> np.ndarray:
    """(n, 1) brightness of the windows that triangles (n, 3, 3) belong to, from 0.4 to 1.2."""
    metres = np.floor((corners.min(1) + corners.max(1)) * [0.45, 0.45, 0.2]) @ [12.9898, 78.233, 37.719]
    return (0.4 + 0.8 * np.mod(np.sin(metres) * 43758.5453, 1.0))[:, None].astype(np.float32)


def _flat(part: Part) -> Part:
    """Outdoor parts that are flat; each unfolds like the walls inside: all but hedges and trees."""
    flat = part.owner not in ("outdoor/hedge", "outdoor/trees")
    return dataclasses.replace(part, kind="wall") if flat else part


def _daylight(scene: RayScene, outdoors: Outdoors, texels: Texels, thin: np.ndarray, rays: int) -> np.ndarray:
    """(n, 3) e from open sky and sun; what is hidden by other things counts as a third as bright as the mean."""
    p = points_of(texels.position, texels.normal, texels.face_normal, thin)
    small = small_sky(outdoors.picture).astype(np.float32)
    hidden = mi.Color3f(*(opaque_float(float(x) / 3) for x in small.mean((0, 1))))
    e = radiosity.open_sky(scene, floats(small), p, rays, hidden)
    if outdoors.sun.any():
        cos, side, active = radiosity.facing(p, vector(np.tile(outdoors.sun_direction, (1, 1))))
        ray = mi.Ray3f(p.position + p.face_normal * side * LIFT, vector(np.tile(outdoors.sun_direction, (p.n, 1))))
        lit = dr.select(active & ~scene.ray_test(ray, active), cos, 0.0)
        e += np.asarray(lit)[:, None] * outdoors.sun.astype(np.float32)
    return e


def dome_mesh(house: House, page: int) -> LitMesh:
    """The dome that wears the picture of the outdoors."""
    vertices, faces, uv = dome(house)
    return LitMesh(DOME, "outdoor", "", page, vertices, faces, uv)
