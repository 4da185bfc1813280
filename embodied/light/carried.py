"""Light of lamps that are carried through a house: their own, past all that stands in its way, and what the room sends
back of it.

The rest of the light is that of the house with these lamps off.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from embodied.house.house import House
from embodied.house.moment import Moment, RigidPose
from embodied.light.movers import RAY_LIFT, Cloud, discs_of, hiding
from embodied.light.tracing.emitters import Lamp

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


def by_carrier(lamps: Mapping[str, Lamp], carriers: Mapping[str, str]) -> dict[str, list[Lamp]]:
    """Lamps by what carries them."""
    out: dict[str, list[Lamp]] = {}
    for name, root in carriers.items():
        if name in lamps:
            out.setdefault(root, []).append(lamps[name])
    return out
