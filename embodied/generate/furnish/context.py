"""The one who furnishes a room: its space so far, what there is to choose from, who lives there, and a generator."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Unpack

import numpy as np

from embodied.assets.records import Asset
from embodied.generate.furnish.arrange import Item, ScoredPose, pack
from embodied.generate.furnish.space import Box, Params, RoomSpace, Thing
from embodied.generate.furnish.stock import AssetLimits, Stock
from embodied.generate.furnish.tables import Tables
from embodied.generate.household import Household

SEEDS = 3
"""Few, because equal arguments share one mesh."""


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
