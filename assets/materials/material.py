"""Material: what a procedural material is called, where it belongs and how it is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from assets.materials.maps import Maps

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
"""What a material may be used for."""


@dataclass(frozen=True, eq=False)
class Material:
    key: str
    """'<maker>/<variant>'."""
    family: str
    """What it is: 'wood', 'tile', 'carpet', 'paint', 'wallpaper', 'stone', 'fabric', 'metal', ..."""
    roles: tuple[str, ...]
    """Where it belongs, from ROLES."""
    name: str
    """'oak planks', 'sage green paint'."""
    colours: tuple[str, ...]
    materials: tuple[str, ...]
    tile: float
    """Side of the square the maps cover, metres."""
    pixels: int
    recipe: Callable[..., Maps]
    """recipe(pixels, tile, rng=...)."""
    specular: float = 0.5
    metallic: float = 0.0


def listed(stem: str, family: str, role: str, pixels: int, specular: float, rows) -> list[Material]:
    """Materials '<stem>/0', '<stem>/1', ... of rows (name, colours, material words, recipe), 1 m a tile."""
    return [
        Material(f"{stem}/{i}", family, (role,), name, colours, words, 1.0, pixels, recipe, specular)
        for i, (name, colours, words, recipe) in enumerate(rows)
    ]
