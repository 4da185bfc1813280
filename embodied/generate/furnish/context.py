"""The one who furnishes a room: its space so far, assets by the role they play in a group, weighted by style, who lives
there, and a generator."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypedDict, Unpack

import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.assets.records import Asset, Size
from embodied.generate.furnish.arrange import Item, ScoredPose, pack
from embodied.generate.furnish.space import Box, Params, RoomSpace, Thing
from embodied.generate.furnish.tables import Style, Tables
from embodied.house.household import Household

SEEDS = 3
"""Few, because equal arguments share one mesh."""
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
            words = {*asset.colours, *asset.materials, *asset.tags, *asset.name.split()}
            good, bad = (sum(w in words for w in some) for some in (self.style.favours, self.style.shuns))
            self._style_scores[asset.key] = float(2.2 ** min(good, 2) * 0.35 ** min(bad, 2))  # 1 is indifferent
        room = 0.15 + asset.rooms.get(kind, 0.0) if kind is not None and asset.rooms else 1.0
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


@dataclass
class Context:
    """One room being furnished: `space` is replaced by the room with more in it whenever something finds its place."""

    space: RoomSpace
    stock: Stock
    rng: np.random.Generator
    kinds: tuple[str, ...]
    """Those of all rooms of the house, so that a living room knows whether there is a dining room."""
    household: Household
    """Who lives in the house."""
    attempt: int = 0
    """How often this room has been tried before; later attempts ask for less."""
    used: Counter[str] = field(default_factory=Counter)
    """How often the house has each asset."""
    _groups: Counter[str] = field(default_factory=Counter)

    @property
    def kind(self) -> str:
        """Of the room."""
        return self.space.kind

    @property
    def tables(self) -> Tables:
        return self.stock.tables

    @property
    def things(self) -> tuple[Thing, ...]:
        """All that has found its place."""
        return self.space.things

    def has(self, what: str) -> bool:
        """True in the kinds of room that have something by the tables: "curtains", "radiators", ..."""
        return self.kind in self.tables.kinds[what]

    def fits(self, asset: Asset, word: str) -> bool:
        """True for assets of the classes that a word of the tables fits: "shelves", "cut to size", ..."""
        return asset.object_class in self.tables.alike[word]

    def chance(self, probability: float) -> bool:
        """True with this probability; draws one number."""
        return bool(self.rng.random() < probability)

    def pick(self, role: str, **limits: Unpack[AssetLimits]) -> Asset | None:
        """An asset for `role` that is not in the room yet, if there is one (see Stock.pick)."""
        limits.setdefault("avoid", tuple(t.asset.key for t in self.things))
        return self.stock.pick(role, used=self.used, rng=self.rng, kind=self.kind, **limits)

    def looks(self, asset: Asset) -> Params:
        """Parameters for the maker of `asset`; empty for models of the packs."""
        if not asset.key.startswith("built/"):
            return ()
        if asset.object_class == "fridge":  # what a household keeps under magnets on its door: more with children
            notes = int(self.rng.poisson(0.7 + 1.3 * len(self.household.children)))
            return (("notes", float(min(notes, 6))), ("seed", float(self.rng.integers(SEEDS)))) if notes else ()
        return (("seed", float(self.rng.integers(SEEDS))),) if self.fits(asset, "varied") else ()

    def put(self, items: Sequence[Item], poses: Iterable[ScoredPose], group: str, tries: int = 40) -> tuple[Thing, ...]:
        """The things of an arrangement, placed; nothing if it found none."""
        before = len(self.things)
        space = pack(self.space, items, poses, f"{group}_{self._groups[group] + 1}", tries)
        if space is None:
            return ()
        self._groups[group] += 1
        self.space = space
        self.used.update(t.asset.key for t in self.things[before:])
        return self.things[before:]

    def add(self, thing: Thing, solid: Box, walk: np.ndarray | None = None) -> Thing:
        """Put one thing where it fits."""
        self.space = self.space.holding([thing], [solid], walk=walk)
        self.used[thing.asset.key] += 1
        return thing

    def called(self, *names: str) -> list[Thing]:
        """Things in the room of one of these names, classes or roles."""
        known = {*names, *(c for name in names for c in self.tables.classes(name))}
        return [t for t in self.things if t.role in known or t.asset.object_class in known]

    def roles(self, *names: str) -> list[Thing]:
        """Things in the room that a group placed under one of these names."""
        return [t for t in self.things if t.role in names]
