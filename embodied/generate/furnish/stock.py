"""What there is to choose from: assets by the role they play in a group, weighted by taste."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypedDict, Unpack

import numpy as np

from assets.catalogue import Catalogue
from assets.records import Asset
from embodied.generate.furnish.roles import ROLES
from embodied.generate.furnish.style import Style, liking

SMALLEST, LARGEST = (0.0, 0.0, 0.0), (99.0, 99.0, 99.0)
"""Bounds where no others are asked for, metres."""
CHILDREN = ("kids_room", "playroom", None)
"""Room kinds where anything made for children may stand."""
CHILDISH = ("high chair", "stroller", "kick scooter", "tricycle", "bicycle")
"""Things for children that are kept elsewhere too."""


Size = tuple[float, float, float]
"""Width, depth and height, metres."""


class AssetLimits(TypedDict, total=False):
    """What may be asked of an asset besides its role."""

    most: Size
    least: Size
    where: Callable[[Asset], bool] | None
    """A further condition."""
    avoid: Sequence[str]
    """Keys not to take unless nothing else is left."""


@dataclass
class Stock:
    """The catalogue through the eyes of one house: remembers what has been used how often."""

    catalogue: Catalogue
    style: Style
    used: Counter[str] = field(default_factory=Counter)
    _by_role: dict[str, tuple[Asset, ...]] = field(default_factory=dict)
    _liking: dict[str, float] = field(default_factory=dict)
    resting: dict[tuple[str, str], list[tuple[Asset, float]]] = field(default_factory=dict)
    """(object class, room kind) to the small things that lie there, filled on first use."""

    def of_role(self, role: str) -> tuple[Asset, ...]:
        """All assets that can play `role` (a key of ROLES, or an object class)."""
        if role not in self._by_role:
            found: dict[str, Asset] = {}
            for name in ROLES.get(role, (role,)):
                found.update({a.key: a for a in self.catalogue.of_class(name)})
            self._by_role[role] = tuple(found.values())
        return self._by_role[role]

    def pick(
        self, role: str, *, rng: np.random.Generator, kind: str | None = None, **limits: Unpack[AssetLimits]
    ) -> Asset | None:
        """An asset for `role` within the size limits, or None.

        Args:
          kind: room kind; assets that are rare there are rarely taken.
        """
        most, least = limits.get("most", LARGEST), limits.get("least", SMALLEST)
        where, avoid = limits.get("where"), limits.get("avoid", ())
        fit = [
            a
            for a in self.of_role(role)
            if all(lo <= s <= hi for lo, s, hi in zip(least, a.size, most)) and (where is None or where(a))
        ]
        if kind not in CHILDREN:
            fit = [a for a in fit if "child" not in a.tags or role in CHILDISH] or (fit if role in CHILDISH else [])
        fit = [a for a in fit if a.key not in avoid] or fit
        if not fit:
            return None
        weights = np.array([self._weight(a, kind) for a in fit])
        return fit[int(rng.choice(len(fit), p=weights / weights.sum()))]

    def _weight(self, asset: Asset, kind: str | None) -> float:
        if asset.key not in self._liking:
            self._liking[asset.key] = liking(self.style, asset)
        room = 1.0
        if kind is not None and asset.rooms:
            room = 0.15 + asset.rooms.get(kind, 0.0)
        return self._liking[asset.key] * room / (1.0 + 1.5 * self.used[asset.key])

    def note(self, assets: Sequence[Asset]) -> None:
        """Remember that these were used, so that the house varies."""
        self.used.update(a.key for a in assets)
