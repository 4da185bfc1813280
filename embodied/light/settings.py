"""How finely and how long a house is lit."""

from __future__ import annotations

from dataclasses import dataclass

VERSION = 14
"""Counts up whenever a bake would come out differently; older bakes are then made anew."""


@dataclass(frozen=True)
class Settings:
    """Everything a bake depends on besides the house."""

    density: float = 40.0
    """Luxels per metre on walls, floors and ceilings."""
    budget: float = 6000.0
    """Luxels per piece of furniture."""
    sky_rays: int = 24
    """Rays per luxel and window."""
    lamp_rays: int = 24
    sun_rays: int = 12
    """Rays over the sun's disc per texel near a shadow's edge."""
    patches: int = 64
    """Small lights that stand for the sun's patches in one room."""
    bounces: tuple[int, ...] = (6, 6, 8, 12, 64)
    """Rays per luxel in each round of gathering; the last is what is seen."""
    jpeg: int = 92
    """Quality of the picture pages on disk."""
    texels: float = 29e6
    """Of all pages together, before packing; patterns of large houses are drawn coarser to keep to it (`atlas.coarsened`)."""


QUALITIES = {
    "draft": Settings(24.0, 1800.0, 16, 20, 6, 32, (4, 4, 4, 4, 6, 40), 90),
    "normal": Settings(),
    "high": Settings(56.0, 14000.0, 48, 24, 16, 96, (8, 8, 12, 16, 128), 94, 120e6),
}
"""Named settings."""


def settings_of(quality: str) -> Settings:
    """Settings by name.

    Raises:
      ValueError: no such quality.
    """
    if quality not in QUALITIES:
        raise ValueError(f"light quality {quality!r} is unknown; use one of {sorted(QUALITIES)}")
    return QUALITIES[quality]
