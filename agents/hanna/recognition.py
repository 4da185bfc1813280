"""Place recognition: the map of places that an agent draws from what it saw, and where a picture was taken.

Nothing here knows which place is which: two panoramas are of one place if their features match. Features less the mean
of what was seen of the house are compared by the cosine of their 36 views, at the best of 12 rotations, since a picture
does not tell which way is north.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from embodied.agents.hanna.inputs import HEADINGS, VIEWS

SAME_PLACE, SAME_PICTURE = 0.55, 0.42
"""Least matches, cosines, at which two panoramas are of one place: of the agent's own, whose headings it knows, and of
another day and hour, through a noisy camera. They suit the shipped encoder: the second has nearly the best F1 in
validation houses, the first is above its best, 0.44, so that places are not merged; `encoder_compact` wants 0.68 and
0.58."""


@dataclass(frozen=True, eq=False)
class PlaceMap:
    """The places that one episode has seen so far, numbered as they were met, and the pictures it was shown."""

    panoramas: np.ndarray = field(default_factory=lambda: np.zeros((0, VIEWS, 1), np.float32))
    """(k, 36, D) features of each place, as first seen."""
    pictures: np.ndarray = field(default_factory=lambda: np.zeros((0, VIEWS, 1), np.float32))
    """(p, 36, D) features of each picture, rows that it does not show are zero."""

    @property
    def mean(self) -> np.ndarray:
        """(D,) of all that was seen of the house: what its places have in common does not tell them apart."""
        return self.panoramas.mean((0, 1))

    def seen(self, panorama: np.ndarray) -> tuple[PlaceMap, int]:
        """The map with the place of a panorama (36, D), and its number."""
        wider = dataclasses.replace(self, panoramas=_append(self.panoramas, panorama))
        known = wider._known(self.panoramas, panorama, turned=False)
        return (wider, len(self.panoramas)) if known is None else (self, known)

    def shown(self, picture: np.ndarray) -> tuple[PlaceMap, int]:
        """The map with a picture (36, D), and its number; one that shows the same as another is that one."""
        known = self._known(self.pictures, picture, turned=True)
        if known is not None:
            return self, known
        return dataclasses.replace(self, pictures=_append(self.pictures, picture)), len(self.pictures)

    def find(self, picture: int) -> tuple[int | None, np.ndarray]:
        """The place where a picture was taken, None where it is not on the map, and the match (k,) of every place."""
        scores = matches(self.pictures[picture], self.panoramas, self.mean)
        best = int(scores.argmax())
        return (best if scores[best] >= SAME_PICTURE else None), scores

    def _known(self, among: np.ndarray, one: np.ndarray, *, turned: bool) -> int | None:
        if not len(among):
            return None
        scores = matches(one, among, self.mean, turned=turned)
        best = int(scores.argmax())
        return best if scores[best] >= SAME_PLACE else None


def matches(picture: np.ndarray, panoramas: np.ndarray, mean: np.ndarray, *, turned: bool = True) -> np.ndarray:
    """(k,) how well a picture matches each of several panoramas: the mean cosine of the views that it shows.

    Args:
      picture: (36, D); views that it does not show are zero.
      panoramas: (k, 36, D).
      mean: (D,) taken from all that is not zero.
      turned: at the best of 12 rotations; else as it is, between panoramas whose headings are known.
    """
    shown = np.flatnonzero(picture.any(-1))
    if not len(shown):
        return np.zeros(len(panoramas), np.float32)
    cosines = _unit(picture[shown], mean) @ _unit(panoramas, mean).transpose(0, 2, 1)  # (k, shown, 36)
    turns = np.arange(HEADINGS if turned else 1)[:, None]
    columns = shown // HEADINGS * HEADINGS + (shown + turns) % HEADINGS  # (12, shown)
    return cosines[:, np.arange(len(shown)), columns].mean(-1).max(-1)


def _unit(features: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Features less the mean, of length one; zeros stay zero."""
    centred = (features - mean) * features.any(-1, keepdims=True)
    return centred / np.maximum(np.linalg.norm(centred, axis=-1, keepdims=True), 1e-6)


def _append(features: np.ndarray, one: np.ndarray) -> np.ndarray:
    return np.concatenate([features, one[None]]) if len(features) else one[None]
