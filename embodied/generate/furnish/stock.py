"""Assets to choose from, by the role they play in a group, weighted by style."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypedDict, Unpack

import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.assets.records import Asset, Size
from embodied.generate.furnish.style import Style, style_score
from embodied.generate.furnish.tables import Tables

NO_LEAST_SIZE, NO_MOST_SIZE = (0.0, 0.0, 0.0), (99.0, 99.0, 99.0)
"""Bounds where no others are asked for, metres."""


class AssetLimits(TypedDict, total=False):
    """Limits on an asset besides its role."""

    most: Size
    least: Size
    where: Callable[[Asset], bool] | None
    """A further condition."""
    avoid: Sequence[str]
    """Keys not to take unless nothing else is left."""


@dataclass(frozen=True)
class Stock:
    """The catalogue through the eyes of one house."""

    catalogue: Catalogue
    style: Style
    tables: Tables
    _by_role: dict[str, tuple[Asset, ...]] = field(default_factory=dict)
    _style_scores: dict[str, float] = field(default_factory=dict)
    _resting: dict[tuple[str, str], list[tuple[Asset, float]]] = field(default_factory=dict)

    def of_role(self, role: str) -> tuple[Asset, ...]:
        """All assets that can play `role`."""
        if role not in self._by_role:
            assets = {a.key: a for name in self.tables.classes(role) for a in self.catalogue.of_class(name)}
            self._by_role[role] = tuple(assets.values())
        return self._by_role[role]

    def pick(
        self,
        role: str,
        *,
        used: Counter[str],
        rng: np.random.Generator,
        kind: str | None = None,
        **limits: Unpack[AssetLimits],
    ) -> Asset | None:
        """An asset for `role` within the size limits, or None.

        Args:
          used: how often the house has each asset: what it has often is taken rarely.
          kind: room kind; assets that are rare there are rarely taken.
        """
        most, least = limits.get("most", NO_MOST_SIZE), limits.get("least", NO_LEAST_SIZE)
        where, avoid = limits.get("where"), limits.get("avoid", ())
        fit = [
            a
            for a in self.of_role(role)
            if all(lo <= s <= hi for lo, s, hi in zip(least, a.size, most)) and (where is None or where(a))
        ]
        if kind is not None and kind not in self.tables.kinds["children"] and role not in self.tables.alike["childish"]:
            fit = [a for a in fit if "child" not in a.tags]
        fit = [a for a in fit if a.key not in avoid] or fit
        if not fit:
            return None
        weights = np.array([self._weight(a, kind) / (1.0 + 1.5 * used[a.key]) for a in fit])
        return fit[int(rng.choice(len(fit), p=weights / weights.sum()))]

    def _weight(self, asset: Asset, kind: str | None) -> float:
        if asset.key not in self._style_scores:
            self._style_scores[asset.key] = style_score(self.style, asset)
        room = 1.0
        if kind is not None and asset.rooms:
            room = 0.15 + asset.rooms.get(kind, 0.0)
        return self._style_scores[asset.key] * room

    def resting_on(self, object_class: str, kind: str) -> list[tuple[Asset, float]]:
        """Small assets that rest on this class, with their weight in this kind of room."""
        key = (object_class, kind)
        if key not in self._resting:
            self._resting[key] = [
                (a, a.rooms[kind])
                for a in self.catalogue.assets.values()
                if object_class in a.on and a.rooms.get(kind, 0.0) > 0 and max(a.size[:2]) < 0.6 and a.size[2] < 0.6
            ]
        return self._resting[key]
