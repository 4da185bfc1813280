"""The light that arrives at places of a lit house: what its pages send, and the sky, gathered by rays; and that of
lamps that are carried through it: their own, past all that stands in its way, and what the room sends back of it.

Source: final gathering: M. Reichert, A two-pass radiosity method driven by lights and viewer position (1992).
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np

from embodied.geometry import r2
from embodied.house.house import House
from embodied.house.moment import Moment, RigidPose
from embodied.light.movers import RAY_LIFT, Cloud, Placed, cosine_directions, discs_of, hiding
from embodied.light.tracing.emitters import GLAZING, Lamp
from embodied.render.gloss import Rays, texels_at
from embodied.scene.lit_pages import LitMesh

GATHER_RAYS = 96
"""Rays of a place."""
MOSTLY = (0.15, 0.5)
"""Share of what a place sees, hidden by a thing, up to which its light is corrected and from which on it is gathered
anew."""


@dataclass(frozen=True, eq=False)
class LitRays:
    """Rays through a house, and the radiance of what they meet."""

    first: Rays
    """Among the faces of `page`, `uv`."""
    page: np.ndarray
    """(m,) number of each face's page."""
    uv: np.ndarray
    """(m, 3, 2) float32 of each face's corners."""
    radiance: Mapping[int, np.ndarray]
    """(h, w, 3) float32 by page: what it sends, but for the glow of lamps."""
    sky: np.ndarray
    """(h, 2h, 3) as Outdoors.picture: what is met by rays that leave the house."""

    @classmethod
    def among(cls, first: Rays, meshes: Sequence[LitMesh], radiance: Mapping[int, np.ndarray], sky: np.ndarray) -> Self:
        """Those among the faces of meshes, in order."""
        page = np.repeat([m.page for m in meshes], [len(m.faces) for m in meshes])
        return cls(first, page, np.concatenate([m.uv[m.faces] for m in meshes]), radiance, sky)

    def along(self, start: np.ndarray, ahead: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Radiance (n, 3) met by rays, and how far away, (n,) metres; infinite for the sky."""
        face, far, u, v = self.first(start, ahead)
        h, w = self.sky.shape[:2]
        column = ((np.pi - np.arctan2(ahead[:, 1], ahead[:, 0])) / (2 * np.pi) * w).astype(int) % w
        row = np.minimum((np.arccos(np.clip(ahead[:, 2], -1, 1)) / np.pi * h).astype(int), h - 1)
        out = self.sky[row, column] * np.float32(GLAZING)
        which = np.flatnonzero(face >= 0)
        at = np.einsum("nk,nkc->nc", np.stack([1 - u - v, u, v], axis=1)[which], self.uv[face[which]])
        pages = self.page[face[which]]
        for number in np.unique(pages):
            own = pages == number
            out[which[own]] = texels_at(self.radiance[int(number)], at[own])
        return out, np.where(face >= 0, far, np.inf)


def behind(
    air: LitRays, thing: Placed, cloud: Cloud, position: np.ndarray, normal: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Light at points of a house in which a thing stood when it was lit.

    Args:
      air: rays past the thing.
      cloud: the thing's discs.
      position, normal: (n, 3) float32, world.

    Returns:
      (n, 3) e that arrives there without the thing, lamps' own light not included; (n, 3) how much more that is than
      with the thing there; and (n,) the share of what is seen that the thing hid.
    """
    turn = thing.pose.rotation.astype(np.float32)
    start, whole, more = (position + normal * RAY_LIFT).astype(np.float32), *np.zeros((2, len(position), 3), np.float32)
    local, hid = (start - np.asarray(thing.pose.position, np.float32)) @ turn, np.zeros(len(position), np.float32)
    shift = np.stack(r2(np.arange(len(position)) * 7.0), axis=1)
    for k in range(GATHER_RAYS):
        ahead = cosine_directions(normal, (shift + np.array(r2(k + 1.0))) % 1.0).astype(np.float32)
        light, far = air.along(start, ahead)
        hit, met, _, _ = thing.surface.first_hit(local, ahead @ turn)
        which = np.flatnonzero((hit >= 0) & (met < far))
        there = start[which] + ahead[which] * met[which, None]
        nearest = ((there[:, None] - cloud.position) ** 2).sum(2).argmin(1)
        whole += light
        more[which] += light[which] - cloud.sent[nearest]
        hid[which] += 1
    return whole / GATHER_RAYS, more / GATHER_RAYS, hid / GATHER_RAYS


def without(old: np.ndarray, whole: np.ndarray, more: np.ndarray, hid: np.ndarray) -> np.ndarray:
    """(n, 3) light of points without a thing: the light that they had, (n, 3), corrected where the thing hid little,
    all light gathered anew where it hid most."""
    t = np.clip((hid - MOSTLY[0]) / (MOSTLY[1] - MOSTLY[0]), 0, 1)[:, None]
    out: np.ndarray = np.maximum((1 - t) * (old + more) + t * whole, 0)
    return out


LAMP_RAYS = 24
"""Rays of a place to a lamp."""
BULB = 0.06
"""Metres before a bare bulb at which rays end, and square metres of the least squared distance from it."""

Blocked: TypeAlias = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""From starts (n, 3), unit directions (n, 3) and metres (n,): (n,) bool, something is met nearer than that."""


def carried_lamps(house: House, moment: Moment) -> dict[str, str]:
    """Id of the moved placement that carries it, by id of every light that is on and not where it was at rest."""
    out = {}
    for light in moment.switched(house).lights:
        p = house.placement_by_id.get(light.placement or "")
        if light.on and light.power > 0 and p is not None and (root := moment.carrier(house, p)) is not None:
            out[light.id] = root
    return out


def lamp_at(lamp: Lamp, rest: RigidPose, pose: RigidPose) -> Lamp:
    """A lamp that was baked where its carrier had the pose `rest`, now that it has another."""
    normals = lamp.normals @ rest.rotation @ pose.rotation.T
    return dataclasses.replace(lamp, points=pose.points(rest.local(lamp.points)), normals=normals)


def fitting_of(lamp: Lamp, position: np.ndarray, normal: np.ndarray, sent: np.ndarray, area: float) -> Lamp:
    """The lamp that a lamp's own shade and foot are, by the light of it that they reflect.

    Args:
      position, normal: (n, 3) of luxels of the lamp, world, of one size.
      sent: (n, 3) radiosity.
      area: square metres of all.
    """
    cut = np.cumsum(sent.sum(1) + 1e-9)
    pick = np.searchsorted(cut, (np.arange(count := len(lamp.points)) + 0.5) / count * cut[-1])
    return dataclasses.replace(
        lamp, points=position[pick], normals=normal[pick], radiance=sent.mean(0), area=area, weights=np.ones(count)
    )


def direct(lamp: Lamp, position: np.ndarray, normal: np.ndarray, thin: np.ndarray, blocked: Blocked) -> np.ndarray:
    """(n, 3) float32 e from a lamp, as embodied.light.tracing.radiosity.lamp_light has it.

    Args:
      position, normal: (n, 3) float32, world.
      thin: (n,) bool: takes half from each side.
    """
    bare = not lamp.normals.any()
    total = np.zeros(len(position), np.float32)
    for i in (2 * np.arange(LAMP_RAYS) + 1) * len(lamp.points) // (2 * LAMP_RAYS):  # the same for all: no specks
        way = lamp.points[i] - position
        far = np.linalg.norm(way, axis=1)
        ahead = way / np.maximum(far, 1e-6)[:, None]
        cos = np.einsum("nk,nk->n", normal, ahead)
        side = np.where(thin & (cos < 0), -1.0, 1.0)
        cos = np.where(thin, np.abs(cos) / 2, cos)
        leaving = 1.0 if bare else -ahead @ lamp.normals[i]
        g = np.maximum(cos, 0) * np.maximum(leaving, 0) / np.maximum(far**2, BULB if bare else 1e-4) * lamp.weights[i]
        which = np.flatnonzero(g > 0)
        start = position[which] + (normal[which] * side[which, None]) * RAY_LIFT
        reach = far[which] - (BULB if bare else 2 * RAY_LIFT)
        free = ~blocked(start.astype(np.float32), ahead[which].astype(np.float32), reach)
        total[which] += np.minimum(g[which] * free * (lamp.area / np.pi), 400.0 if bare else 4.0)
    total /= LAMP_RAYS
    return (total if bare else np.minimum(total, 1.0))[:, None] * lamp.radiance.astype(np.float32)


@dataclass(frozen=True, eq=False)
class SentBack:
    """The room as it sends a lamp's light back."""

    cloud: Cloud
    """Its surfaces, by the light that they reflect first."""
    rest: np.ndarray
    """(3,) e of all later reflections, everywhere in the room: as in an integrating sphere."""

    def e(self, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """(n, 3) e at points of the room, (n, 3) float32 each; what stands between is not asked for."""
        out: np.ndarray = hiding(self.cloud, position, normal)[2] + self.rest
        return out


def sent_back(
    e: np.ndarray, albedo: np.ndarray, position: np.ndarray, normal: np.ndarray, area: np.ndarray
) -> SentBack:
    """The light that a room sends back, from a lamp's light `e` on pieces of it, (n, 3) each, of areas (n,)."""
    power = albedo * e * area[:, None]
    d = discs_of(position, normal, np.zeros(len(area), bool), power.sum(1) + 1e-9)
    areas = np.add.reduceat(area[d.luxels], d.first)
    sent = np.add.reduceat(power[d.luxels], d.first) / areas[:, None]
    cloud = Cloud(d.position, d.normal, d.thin, areas.astype(np.float32), sent.astype(np.float32))
    first = hiding(cloud, position, normal)[2]
    share = area / area.sum()
    return SentBack(cloud, share @ (first * albedo) / np.maximum(1 - share @ albedo, 0.1))
