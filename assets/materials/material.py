"""Material: what a procedural material is called, where it belongs and how it is made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from embodied.assets.materials.maps import Maps

ROLES = (
    "floor_wood",
    "floor_tile",
    "carpet",
    "wall_paint",
    "accent_paint",
    "wallpaper",
    "wall_tile",
    "ceiling",
    "brick",
    "stone",
    "concrete",
    "fabric",
    "upholstery",
    "curtain",
    "leather",
    "wood",
    "door",
    "metal",
    "worktop",
    "cabinet",
    "facade",
    "outdoor_floor",
    "wicker",
    "plaster",
    "rug",
    "art",
    "rug_pattern",
    "label",
    "outdoor",
)
"""Uses of a material."""


DETAIL_OF_FAMILY = {
    "fabric": "weave",
    "wallpaper": "stipple",
    "carpet": "nap",
    "rug": "nap",
    "wood": "pores",
    "leather": "pebbles",
    "plaster": "plaster",
    "concrete": "plaster",
    "brick": "plaster",
    "paint": "stipple",
}
"""Detail of the materials of a family; others are smooth."""


DETAIL_OF_PAINTER = {"textile.felt": "nap", "textile.Pile": "nap"}
"""Detail of cloth without threads, whatever its family."""


class Recipe(Protocol):
    """Draws the maps of a material: n pixels wide, over a square of `tile` metres."""

    def __call__(self, n: int, tile: float, *, rng: np.random.Generator) -> Maps: ...


@dataclass(frozen=True, eq=False)
class Material:
    """A procedural material."""

    key: str
    """'<maker>/<variant>'."""
    family: str
    """Its matter: 'wood', 'tile', 'carpet', 'paint', 'wallpaper', 'stone', 'fabric', 'metal', ..."""
    roles: tuple[str, ...]
    """Its uses, from ROLES."""
    name: str
    """'oak planks', 'sage green paint'."""
    colours: tuple[str, ...]
    materials: tuple[str, ...]
    tile: float
    """Side of the square the maps cover, metres."""
    pixels: int
    recipe: Recipe
    """Draws the maps."""
    told: Mapping[str, Any]
    """The row of the table that the recipe was made from: {"by": painter, argument: value, ...}."""
    specular: float = 0.5
    metallic: float = 0.0


def detail_of(material: Material) -> str | None:
    """The detail that a material shows from nearby, one of embodied.assets.records.DETAILS."""
    return DETAIL_OF_PAINTER.get(material.told["by"], DETAIL_OF_FAMILY.get(material.family))
