"""Emitters of light: portals (the sky through windows), lamps, and the sun.

All intensities are radiosities or radiances in units of 100 cd/m2 (see sky.py).
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from embodied.assets.cache import write_bytes
from embodied.assets.decoding import open_arrays, packed
from embodied.geometry import r2
from embodied.house.house import GLAZED, House, Opening
from embodied.house.shapes import ROOF, inward, slope_over
from embodied.light.backend import Array, RayScene, accumulate, dr, fraction, mi, opaque_float, vector
from embodied.light.pages.atlas import Atlas
from embodied.light.pages.unwrap import areas_of, face_normals

GLAZING = 0.88
"""Share of light that clean double glazing lets through."""
UNIT = 100.0
"""cd/m2 per unit of radiance."""


@dataclass(frozen=True, eq=False)
class Portal:
    """A rectangle in an outer wall through which the outdoors shines in."""

    id: str
    room: str
    corner: np.ndarray
    along: np.ndarray
    up: np.ndarray
    """(3,) each: a corner and the two edges, metres; along x up points into the house."""

    @property
    def normal(self) -> np.ndarray:
        n = np.cross(self.along, self.up)
        return n / np.linalg.norm(n)

    @property
    def area(self) -> float:
        return float(np.linalg.norm(np.cross(self.along, self.up)))


@dataclass(frozen=True, eq=False)
class Lamp:
    """Points on glowing surfaces, all of one strength."""

    id: str
    room: str
    points: np.ndarray
    """(k, 3) metres, world; spread evenly over the glowing area."""
    normals: np.ndarray
    """(k, 3) unit; zero where the lamp shines the same in all directions (a bare bulb)."""
    radiance: np.ndarray
    """(3,) of its surface; for a bare bulb the intensity in 100 cd."""
    area: float
    """Glowing square metres; 1 for a bare bulb."""
    owner: str | None
    """Placement whose own faces do not stand in a bare bulb's way."""
    weights: np.ndarray
    """(k,) how many times its even share of the surface each point stands for; 1 where points are spread evenly."""


def portals_of(house: House) -> tuple[Portal, ...]:
    """One portal per glazed or open hole to the outdoors, in the plane of the outer face of wall or roof."""
    lets_in = lambda o: o.kind in GLAZED or o.kind == "passage" or o.angle > 0.05
    return tuple(_portal(house, o) for o in house.openings if None in o.rooms and lets_in(o))


def _portal(house: House, o: Opening) -> Portal:
    a, b = np.array(o.a), np.array(o.b)
    d = (b - a) / np.linalg.norm(b - a)
    left = np.array([-d[1], d[0]])
    if left @ inward(house, o) < 0:
        a, b, left = b, a, -left
    room = house.room_by_id[o.rooms[0]]
    z = house.storey_of(room).elevation
    if o.kind == "roof_window":
        _, way, knee = slope_over(room, o)
        corner = np.array([*(a + (o.sill - knee - ROOF / 2) * way), z + o.sill + ROOF / 2])
        return Portal(o.id, room.id, corner, np.array([*(b - a), 0.0]), np.array([*way, 1.0]) * (o.head - o.sill))
    # the facade stands outer_wall beyond the inner face, which lies half an inner wall inside the centre line
    out = left * -(house.outer_wall - house.inner_wall / 2)
    corner = np.array([*(a + out), z + o.sill])
    along, up = np.array([*(b - a), 0.0]), np.array([0.0, 0.0, o.head - o.sill])
    if np.cross(along, up)[:2] @ left < 0:
        corner, along = corner + along, -along
    return Portal(o.id, o.rooms[0], corner, along, up)


def lamps_of(house: House, atlas: Atlas, *, points: int = 256) -> tuple[Lamp, ...]:
    """The lamps that are on: glowing faces of their placement where it has any, else bare bulbs."""
    glow = glowing_faces(atlas)
    lamps = []
    for light in house.lights:
        if not light.on or light.power <= 0:
            continue
        color = np.asarray(light.color, float)
        corners = glow.get(light.placement or "", np.zeros((0, 3, 3)))
        near = [x for x in house.lights if x.on and x.placement == light.placement]
        if light.placement is not None and len(corners):
            if light is not near[0]:  # several bulbs in one fitting share its glowing faces
                continue
            area = areas_of(corners)
            total = float(area.sum())
            radiance = color * light.power / _luminance(color) / (np.pi * total) / UNIT * len(near)
            at, n = _spread(corners, area, points)
            lamps.append(Lamp(light.id, light.room, at, n, radiance, total, None, np.ones(points)))
        else:
            intensity = color * light.power / _luminance(color) / (4 * np.pi) / UNIT
            shell = np.array([_ball(k, 24) for k in range(24)]) * 0.05 + np.asarray(light.position)
            lamps.append(
                Lamp(light.id, light.room, shell, np.zeros((24, 3)), intensity, 1.0, light.placement, np.ones(24))
            )
    return tuple(lamps)


def in_the_open(lamp: Lamp, scene: RayScene, *, rays: int = 48, reach: float = 0.4) -> Lamp:
    """The same lamp with its points drawn by how freely they shine out of their fitting.

    Most of a shaded lamp's surface is hidden by the shade; points spread evenly would leave each
    luxel with one lucky ray in ten and speckle the walls. The mean stays what it was.
    """
    if not lamp.normals.any():
        return lamp
    n = vector(lamp.normals)
    origin, frame = mi.Point3f(vector(lamp.points) + n * 2e-3), mi.Frame3f(n)

    def one(k: Array) -> tuple[Array, ...]:
        d = frame.to_world(mi.warp.square_to_cosine_hemisphere(fraction(mi.Point2f(*r2(mi.Float(k) + 1)))))
        return (dr.select(scene.ray_test(mi.Ray3f(origin, d, opaque_float(reach), 0.0, [])), 0.0, 1.0),)

    share = np.asarray(accumulate(rays, one, dr.zeros(mi.Float, len(lamp.points)))[0]) / rays
    if not share.any():
        return lamp
    chance = np.where(share > 0, np.maximum(share, 0.1), 0.0)
    chance /= chance.sum()
    count = len(share)
    pick = np.minimum(np.searchsorted(np.cumsum(chance), (np.arange(count) + 0.5) / count), count - 1)
    return dataclasses.replace(
        lamp, points=lamp.points[pick], normals=lamp.normals[pick], weights=1 / (count * chance[pick])
    )


def glowing_faces(atlas: Atlas) -> dict[str, np.ndarray]:
    """Owner to the triangles (m, 3, 3) whose finish emits."""
    triangles: dict[str, list[np.ndarray]] = {}
    for page in atlas.pages:
        emits = np.array([f.emission is not None for f in page.finishes])[page.finish]
        for o in np.unique(page.owner[emits]):
            triangles.setdefault(atlas.owners[o], []).append(page.corners[emits & (page.owner == o)])
    return {o: np.concatenate(c).astype(np.float64) for o, c in triangles.items()}


def _luminance(color: np.ndarray) -> float:
    return max(float(color @ [0.2126, 0.7152, 0.0722]), 1e-3)


def _spread(corners: np.ndarray, area: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """n points evenly over triangles by area, and their normals."""
    cut = np.cumsum(area) / area.sum()
    k = np.arange(n)
    face = np.minimum(np.searchsorted(cut, (k + 0.5) / n), len(area) - 1)
    a, b = r2(k)
    u, v = np.sqrt((a + 0.5) % 1), (b + 0.5) % 1
    w = np.stack([1 - u, u * (1 - v), u * v], axis=1)
    return np.einsum("nk,nkc->nc", w, corners[face]), face_normals(corners)[face]


def _ball(k: int, n: int) -> np.ndarray:
    """Point k of n spread evenly over the unit sphere (Fibonacci lattice)."""
    z = 1 - 2 * (k + 0.5) / n
    return np.array([np.sqrt(1 - z * z) * np.cos(2.399963 * k), np.sqrt(1 - z * z) * np.sin(2.399963 * k), z])


LAMP_ARRAYS = ("points", "normals", "radiance", "area", "weights")


def write_lamps(path: Path, lamps: Sequence[Lamp]) -> None:
    """The surfaces that glow, lamp after lamp."""
    arrays = {f"{k}{i}": np.asarray(getattr(x, k)) for i, x in enumerate(lamps) for k in LAMP_ARRAYS}
    write_bytes(path, packed(arrays))


def read_lamps(path: Path, rows: Sequence[Mapping[str, Any]]) -> tuple[Lamp, ...]:
    """Lamps that `write_lamps` wrote. `rows`: id, room and owner of each."""
    with open_arrays(path) as z:
        arrays = [{k: z[f"{k}{i}"] for k in LAMP_ARRAYS} for i in range(len(rows))]
    stored = zip(rows, arrays, strict=True)
    return tuple(Lamp(**{**row, **held, "area": float(held["area"])}) for row, held in stored)
