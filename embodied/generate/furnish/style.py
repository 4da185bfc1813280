"""The style of one house: which woods, colours and periods its owner prefers, how tidy it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from embodied.assets.records import Asset
from embodied.house.house import HouseError


@dataclass(frozen=True)
class Style:
    """One house's style; words are matched against an asset's colours, materials, name and tags."""

    name: str
    favours: tuple[str, ...]
    shuns: tuple[str, ...]
    tidiness: float = 0.6
    """0 is lived in, 1 is a show flat; scales how many small things lie about."""
    warmth: float = 0.5
    """Colour of its lamps: 0 neutral white, 1 warm white."""


PREFERENCES: Mapping[str, Style] = {
    name: Style(name, tuple(favours.split()), tuple(shuns.split()))
    for name, favours, shuns in (
        (
            "light",
            "white beige cream light pine birch grey scandinavian modern",
            "black dark antique red gothic ornate",
        ),
        ("warm", "brown wood wooden oak beige leather orange rustic", "black metal glass plastic purple"),
        ("dark", "black grey dark leather glass metal walnut modern", "pine pink rustic beige"),
        (
            "classic",
            "brown dark antique classic ornate red wood oriental chesterfield",
            "plastic modern white glass metal",
        ),
        ("colourful", "blue green red yellow orange white modern", "brown dark antique black"),
    )
}
"""Name of a style to what its owner prefers; the names are those of embodied.house.validation.STYLES."""


def house_style(name: str, disorder: float, *, rng: np.random.Generator) -> Style:
    """The style called `name` (House.style), for one house of that disorder.

    Raises:
      HouseError: an unknown style.
    """
    if name not in PREFERENCES:
        raise HouseError(f"the house has the unknown style {name!r}; use one of {tuple(PREFERENCES)}")
    return replace(PREFERENCES[name], tidiness=1.0 - disorder, warmth=float(rng.uniform(0.2, 1.0)))


def style_score(style: Style, asset: Asset) -> float:
    """Factor of the weight of an asset in this style; 1 is indifferent."""
    words = {*asset.colours, *asset.materials, *asset.tags, *asset.name.split()}
    good = sum(w in words for w in style.favours)
    bad = sum(w in words for w in style.shuns)
    return float(2.2 ** min(good, 2) * 0.35 ** min(bad, 2))
