"""The style of one house: which woods, colours and periods its owner prefers, how tidy it is."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.assets.records import Asset


@dataclass(frozen=True)
class Style:
    """One house's style; words are matched against an asset's colours, materials, name and tags."""

    favours: tuple[str, ...]
    shuns: tuple[str, ...]
    tidiness: float = 0.6
    """0 is lived in, 1 is a show flat; scales how many small things lie about."""
    warmth: float = 0.5
    """Colour of its lamps: 0 neutral white, 1 warm white."""


def style_score(style: Style, asset: Asset) -> float:
    """Factor of the weight of an asset in this style; 1 is indifferent."""
    words = {*asset.colours, *asset.materials, *asset.tags, *asset.name.split()}
    good = sum(w in words for w in style.favours)
    bad = sum(w in words for w in style.shuns)
    return float(2.2 ** min(good, 2) * 0.35 ** min(bad, 2))
