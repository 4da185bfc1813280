"""Light on what moves through a baked house, and what that hides from the rest.

A thing keeps for each of its luxels how much of the light from every direction gets there past the thing itself
(`Surface.transfer`); with the light around it, from the house's probes, that gives its light wherever it stands. Its
surface, cut into a few dozen small discs, takes light from floors and walls around it and sends some back; taken away
from where it was baked, it gives that light back to them.

Source: transfer in spherical harmonics: P.-P. Sloan, J. Kautz and J. Snyder, Precomputed radiance transfer (2002);
discs that occlude: M. Bunnell, Dynamic ambient occlusion and indirect lighting (GPU Gems 2, 2005).
"""

import dataclasses
import functools
import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np

from embodied.geometry import r2
from embodied.house.house import House
from embodied.house.moment import RigidPose
from embodied.light.pages.atlas import atlas_of, meshes_of, things_of
from embodied.light.pages.colours import ColourMaps, albedo
from embodied.light.pages.cover import cover, sources
from embodied.light.probes import CORNERS, LOBE, ORDERS, harmonics
from embodied.light.settings import LightSettings
from embodied.light.tracing.emitters import Lamp
from embodied.light.tracing.luxels import luxels_of, with_glow
from embodied.light.tracing.rays import rays_among
from embodied.render.gloss import Rays
from embodied.render.sampling import numba_kernels
from embodied.scene.lit_pages import LitMesh
from embodied.scene.part import Part

TRANSFER_RAYS = 48
"""Rays of a luxel that find where the thing hides the light from itself."""
DISCS = 48
"""Discs that stand for the whole of a thing's surface."""
RAY_LIFT = 2e-3
"""Metres by which rays start above their surface."""


@dataclass(frozen=True, eq=False)
class Discs:
    """Small discs that stand for a surface; k of them."""

    position: np.ndarray
    """(k, 3) float32 metres."""
    normal: np.ndarray
    """(k, 3) float32."""
    thin: np.ndarray
    """(k,) bool: seen from both sides."""
    area: np.ndarray
    """(k,) square metres."""
    luxels: np.ndarray
    """(n,) numbers of the luxels of `Surface`, those of one disc after those of another."""
    weight: np.ndarray
    """(n,) square metres of these."""
    first: np.ndarray
    """(k,) where each disc's begin."""


@dataclass(frozen=True, eq=False)
class SurfacePage:
    """One page of a thing that moves."""

    albedo: np.ndarray
    """(h, w, 3) float32 linear reflectance, in texels."""
    luxels: slice
    """Which of the luxels of `Surface` are its own."""
    shown_by: np.ndarray
    """(rows, columns) int: which of these each luxel of the page shows: its own or the nearest."""


@dataclass(frozen=True, eq=False)
class Surface:
    """All that light needs to know of a thing that moves, in its own frame; n luxels."""

    meshes: tuple[LitMesh, ...]
    """With the numbers of its own pages, from 0."""
    gloss: tuple[np.ndarray, ...]
    """Per mesh (m, 4) uint8, as Bake.gloss."""
    pages: tuple[SurfacePage, ...]
    position: np.ndarray
    normal: np.ndarray
    """(n, 3) float32 each."""
    thin: np.ndarray
    """(n,) bool."""
    albedo: np.ndarray
    """(n, 3) float32."""
    glow: np.ndarray
    """(n, 3) float32 radiance that it gives off."""
    of_lamps: np.ndarray
    """(n,) bool: that is the light of a lamp, which is asked for by itself."""
    transfer: np.ndarray
    """(n, 9) float32: with coefficients of the incoming radiance in this frame, the luxel's e."""
    corners: np.ndarray
    """(m, 3, 3) float32 opaque triangles."""
    discs: Discs

    @functools.cached_property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) lowest and highest corner."""
        points = np.concatenate([m.vertices for m in self.meshes])
        return points.min(0), points.max(0)

    @functools.cached_property
    def weights(self) -> np.ndarray:
        """(n, 8) float32 of the box's corners (`box_corners`) at the luxels: trilinear."""
        low, high = self.box
        return trilinear((self.position - low) / np.maximum(high - low, 1e-6))

    @functools.cached_property
    def box_corners(self) -> np.ndarray:
        """(8, 3) float32, in the order of CORNERS."""
        low, high = self.box
        return np.where(CORNERS > 0, high, low).astype(np.float32)

    @functools.cached_property
    def first_hit(self) -> Rays:
        """Rays among its opaque triangles (embodied.light.tracing.rays)."""
        return rays_among(self.corners)


def trilinear(t: np.ndarray) -> np.ndarray:
    """(n, 8) float32 weights of a box's CORNERS at places (n, 3) in it, 0 to 1 along each axis."""
    return np.stack([np.where(k > 0, t, 1 - t).prod(1) for k in CORNERS], axis=1).astype(np.float32)


def surface_of(
    parts: Sequence[Part], settings: LightSettings, cache: Path, house: House, lamps: Sequence[Lamp]
) -> Surface | None:
    """The surface of a thing; None where it has none to be seen.

    Args:
      parts: all of it, placed in its own frame; they keep their owners.
      settings: those of the house's bake.
      cache: the folder of its light, which keeps unwrapped furniture.
      lamps: the lamps of `house` that are on.
    """
    things = things_of([p for p in parts if len(p.mesh.faces)], settings, cache)
    if not things:
        return None
    atlas, maps = atlas_of(things), ColourMaps()
    lux = luxels_of(atlas, maps)
    meshes, gloss = meshes_of(atlas, 0)
    ends = np.cumsum([0, *(len(t.index) for t in lux.texels)])
    pages = []
    for k, (page, texels) in enumerate(zip(atlas.pages, lux.texels, strict=True)):
        fine = cover(page, page.fineness, lux.sheets[k])
        painted = albedo(page, fine, maps)[sources(fine.index, fine.shape)].reshape(*fine.shape, 3)
        shown_by = sources(texels.index, texels.shape).reshape(texels.shape)
        pages.append(SurfacePage(painted, slice(ends[k], ends[k + 1]), shown_by))
    opaque = [p for p in atlas.pages if not p.glass]
    corners = np.concatenate([np.zeros((0, 3, 3), np.float32), *(p.corners for p in opaque)])
    lux = with_glow(lux, house, atlas, lamps)
    plain = Surface(
        tuple(meshes),
        tuple(gloss),
        tuple(pages),
        lux.position,
        lux.normal,
        lux.thin,
        lux.albedo,
        lux.glow,
        lux.sampled,
        unhidden(lux.normal, lux.thin),
        corners,
        discs_of(lux.position, lux.face_normal, lux.thin, lux.area),
    )
    if not len(corners):
        return plain
    counts = [0 if p.glass else len(p.corners) for p in atlas.pages]
    firsts = np.where([p.glass for p in atlas.pages], 10**9, np.cumsum(counts) - counts).tolist()  # far away for glass
    face = np.concatenate([t.face + first for t, first in zip(lux.texels, firsts, strict=True)])
    transfer, open_ = _transfer(plain, lux.face_normal, face)
    discs = discs_of(lux.position, lux.face_normal, lux.thin, lux.area * open_)
    return dataclasses.replace(plain, transfer=transfer, discs=discs)


def unhidden(normal: np.ndarray, thin: np.ndarray) -> np.ndarray:
    """(n, 9) float32 transfer of points of which nothing hides any light; thin ones take half from each side."""
    out = harmonics(normal) * LOBE[ORDERS]
    out[thin] = (out[thin] + harmonics(-normal[thin]) * LOBE[ORDERS]) / 2
    return out.astype(np.float32)


def _transfer(s: Surface, face_normal: np.ndarray, face: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 9) transfer, and (n,) the share of the surroundings that each luxel sees past the thing itself.

    What the thing hides of the light from itself is taken off, and what it sends itself put in its place, by two rounds
    of its own reflection.

    Args:
      face: (n,) triangle of each luxel among `corners`.
    """
    n, k = len(s.position), np.arange(TRANSFER_RAYS)
    turn = np.stack(r2(np.arange(n) * 7.0), axis=1)
    hidden, met, of = [], [], []
    for i in k:
        u = (turn + np.array(r2(i + 1.0))) % 1.0
        side = np.where(s.thin & (i % 2 == 1), -1.0, 1.0)[:, None]
        ahead = cosine_directions(s.normal * side, u)
        out = face_normal * side
        rise = np.einsum("ij,ij->i", ahead, out)[:, None]
        ahead = np.where(rise < 0.01, ahead - out * (rise - 0.02), ahead).astype(np.float32)
        hit, far, _, _ = s.first_hit((s.position + out * RAY_LIFT).astype(np.float32), ahead)
        which = np.flatnonzero((hit >= 0) & (far > 0))
        hidden.append(harmonics(ahead[which]))
        met.append(hit[which])
        of.append(which)
    rows, faces, blocked = np.concatenate(of), np.concatenate(met), np.concatenate(hidden).astype(np.float32)
    first = s.transfer - _summed(rows, blocked, n) / TRANSFER_RAYS
    count = np.bincount(np.minimum(face, len(s.corners)), minlength=len(s.corners) + 1)[:-1]
    grey = s.albedo.mean(1)
    transfer = first
    for _ in range(2):
        sent = _summed(np.minimum(face, len(s.corners)), transfer * grey[:, None], len(s.corners) + 1)[:-1]
        sent /= np.maximum(count, 1)[:, None]
        transfer = first + _summed(rows, sent[faces], n) / TRANSFER_RAYS
    return transfer.astype(np.float32), np.maximum(first[:, 0] / s.transfer[:, 0], 1e-3)


def _summed(rows: np.ndarray, values: np.ndarray, n: int) -> np.ndarray:
    """(n, c) sums of values (k, c) by row."""
    return np.stack([np.bincount(rows, v, n) for v in values.T], axis=1).astype(np.float32)


def cosine_directions(normal: np.ndarray, u: np.ndarray) -> np.ndarray:
    """(n, 3) directions around normals, as likely as their cosine, for numbers (n, 2) in [0, 1)."""
    z = 1 - 2 * u[:, 0]
    across, turn = np.sqrt(np.maximum(1 - z * z, 0)), 2 * np.pi * u[:, 1]
    ahead = normal * (1 + 1e-4) + np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)


def discs_of(position: np.ndarray, normal: np.ndarray, thin: np.ndarray, area: np.ndarray) -> Discs:
    """Discs of one size at luxels, spread evenly over the area, neighbours in a row along x, y and z in turn."""
    low = position.min(0)
    cells = ((position - low) / max(float(np.ptp(position, axis=0).max()), 1e-6) * 1023).astype(np.int64)
    code = np.zeros(len(position), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    way = np.abs(normal).argmax(1) * 2 + (normal[np.arange(len(normal)), np.abs(normal).argmax(1)] > 0)
    order = np.lexsort((code, way))
    weight = area[order]
    cut = np.cumsum(weight)
    k = min(DISCS, len(position))
    first = np.unique(np.minimum(np.searchsorted(cut, np.arange(k) / k * cut[-1]), len(order) - 1))
    pick = order[(first + np.append(first[1:], len(order)) - 1) // 2]
    areas = np.add.reduceat(weight, first).astype(np.float32)
    return Discs(position[pick], normal[pick], thin[pick], areas, order, weight, first)


@dataclass(frozen=True, eq=False)
class Placed:
    """A thing where it is now, and the light on it."""

    surface: Surface
    pose: RigidPose
    lit_at: RigidPose
    """Pose at which its light was computed."""
    e: np.ndarray
    """(n, 3) light of its luxels."""

    @functools.cached_property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) lowest and highest corner, world."""
        corners = self.pose.points(self.surface.box_corners)
        return corners.min(0), corners.max(0)


@dataclass(frozen=True, eq=False)
class Cloud:
    """Discs of things where they are, and the light that they send; k of them."""

    position: np.ndarray
    normal: np.ndarray
    """(k, 3) float32 each, world."""
    thin: np.ndarray
    area: np.ndarray
    sent: np.ndarray
    """(k, 3) radiosity."""


def cloud_of(things: Sequence[Placed], most: int) -> Cloud:
    """The discs of things, at most so many of all together, but one of each."""
    step = max(1, -(-sum(len(t.surface.discs.area) for t in things) // most))
    rows = []
    for t in things:
        d, s = t.surface.discs, t.surface
        starts = d.first[::step]
        some = np.minimum(np.arange(len(starts)) * step + min(step, len(d.area)) // 2, len(d.area) - 1)
        area = np.add.reduceat(d.area, np.arange(0, len(d.area), step)).astype(np.float32)
        normal = d.normal[some] @ t.pose.rotation.T.astype(np.float32)
        radiosity = (s.albedo * t.e + s.glow * ~s.of_lamps[:, None])[d.luxels] * d.weight[:, None]
        sent = np.add.reduceat(radiosity, starts) / np.add.reduceat(d.weight, starts)[:, None]
        rows.append((t.pose.points(d.position[some]), normal, d.thin[some], area, sent))
    return Cloud(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def shading(s: Surface, turned: np.ndarray) -> np.ndarray:
    """(n, 3) e of the luxels by the incoming radiance (8, 9, 3) at the corners of the box, in the thing's frame."""
    by_corner = (s.transfer @ turned.transpose(1, 0, 2).reshape(9, 24)).reshape(-1, 8, 3)
    return np.maximum(np.einsum("nkc,nk->nc", by_corner, s.weights), 0.0)


def hiding(cloud: Cloud, position: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Part of what points could see that things hide, by their cosine.

    Args:
      position, normal: (n, 3) float32, world.

    Returns:
      (n,) share hidden, (n, 3) the mean direction of it, and (n, 3) e that they send from there.
    """
    if (compiled := kernels()) is not None:
        total, mean, light = np.empty(len(position), np.float32), *np.empty((2, len(position), 3), np.float32)
        both = [np.ascontiguousarray(a, np.float32) for a in (position, normal, cloud.position, cloud.normal)]
        compiled.hiding(*both, cloud.thin, cloud.area, np.ascontiguousarray(cloud.sent, np.float32), total, mean, light)
    else:
        total, mean, light = _hiding(cloud, position, normal)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-9)
    return total, mean, light


def kernels() -> ModuleType | None:
    """embodied.light.moving_kernels, if Numba is installed and works."""
    return importlib.import_module("embodied.light.moving_kernels") if numba_kernels() is not None else None


def _hiding(cloud: Cloud, position: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`hiding` without Numba, the mean direction not yet of unit length."""
    at, out = cloud.position, cloud.normal
    far2 = (position**2).sum(1)[:, None] + (at**2).sum(1) - 2 * position @ at.T
    far2 = np.maximum(far2, 1e-6)
    here = normal @ at.T - np.einsum("nc,nc->n", position, normal)[:, None]
    there = position @ out.T - np.einsum("kc,kc->k", at, out)
    there = np.where(cloud.thin, np.abs(there), there)
    share = np.maximum(here, 0) * np.maximum(there, 0) * cloud.area / (far2 * (np.pi * far2 + cloud.area))
    total = share.sum(1)
    share *= (np.minimum(total, 1) / np.maximum(total, 1e-9))[:, None]
    mean = share @ at - share.sum(1)[:, None] * position
    return np.minimum(total, 1), mean, (share @ cloud.sent).astype(np.float32)


def hidden_by(placed: Placed, start: np.ndarray, towards: np.ndarray, reach: np.ndarray | float = np.inf) -> np.ndarray:
    """(n,) bool: a thing stands between points and what they look at.

    Args:
      start: (n, 3) metres, world.
      towards: (3,) or (n, 3) unit.
      reach: (n,) metres up to which it may stand; without end for the sun.
    """
    turn = placed.pose.rotation.astype(np.float32)
    local = (start - np.asarray(placed.pose.position, np.float32)) @ turn
    ahead = np.broadcast_to((towards @ turn).astype(np.float32), local.shape)
    low, high = placed.surface.box
    with np.errstate(divide="ignore", invalid="ignore"):
        steep = 1 / ahead
        begin, end = (low - local) * steep, (high - local) * steep
    first, last = np.fmin(begin, end), np.fmax(begin, end)
    near = np.maximum(np.maximum(first[:, 0], first[:, 1]), first[:, 2])
    far = np.minimum(np.minimum(last[:, 0], last[:, 1]), last[:, 2])
    out: np.ndarray = (near <= far) & (far > 0) & (near < reach)
    which = np.flatnonzero(out)
    if len(which) and len(placed.surface.corners):
        hit, met, _, _ = placed.surface.first_hit(local[which], ahead[which])
        out[which] = (hit >= 0) & (met < np.broadcast_to(reach, len(out))[which])
    return out


def shadow_box(
    low: np.ndarray, high: np.ndarray, towards: np.ndarray, floor: float = 3.0
) -> tuple[np.ndarray, np.ndarray]:
    """A box that holds the shadow of what is in a box, as far as `floor` metres below it."""
    along = -towards * (min(high[2] - low[2] + floor, 8.0) / max(float(towards[2]), 0.15))
    return np.minimum(low, low + along), np.maximum(high, high + along)
