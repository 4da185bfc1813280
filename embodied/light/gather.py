"""The light that arrives at places of a lit house, gathered by rays: what its pages send, and the sky.

Source: final gathering: M. Reichert, A two-pass radiosity method driven by lights and viewer position (1992).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from embodied.geometry import r2
from embodied.light.movers import RAY_LIFT, Cloud, Placed, cosine_directions
from embodied.light.tracing.emitters import GLAZING
from embodied.render.gloss import Rays
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

    @staticmethod
    def among(first: Rays, meshes: Sequence[LitMesh], radiance: Mapping[int, np.ndarray], sky: np.ndarray) -> LitRays:
        """Those among the faces of meshes, in order."""
        page = np.repeat([m.page for m in meshes], [len(m.faces) for m in meshes])
        return LitRays(first, page, np.concatenate([m.uv[m.faces] for m in meshes]), radiance, sky)

    def along(self, start: np.ndarray, ahead: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Radiance (n, 3) met by rays, and how far away, (n,) metres; infinite for the sky."""
        face, far, u, v = self.first(start, ahead)
        out = self._of_sky(ahead)
        which = np.flatnonzero(face >= 0)
        weights = np.stack([1 - u - v, u, v], axis=1)[which]
        at = np.einsum("nk,nkc->nc", weights, self.uv[face[which]])
        pages = self.page[face[which]]
        for number in np.unique(pages):
            own, sent = pages == number, self.radiance[int(number)]
            h, w = sent.shape[:2]
            column, row = (np.clip(at[own, k] * n, 0, n - 1).astype(int) for k, n in ((0, w), (1, h)))
            out[which[own]] = sent[row, column]
        return out, np.where(face >= 0, far, np.inf)

    def _of_sky(self, ahead: np.ndarray) -> np.ndarray:
        h, w = self.sky.shape[:2]
        column = ((np.pi - np.arctan2(ahead[:, 1], ahead[:, 0])) / (2 * np.pi) * w).astype(int) % w
        row = np.minimum((np.arccos(np.clip(ahead[:, 2], -1, 1)) / np.pi * h).astype(int), h - 1)
        return self.sky[row, column] * np.float32(GLAZING)


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
