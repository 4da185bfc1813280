"""What each style of a house chooses its floors, walls, doors and papers from.

Names of materials only ('oak_planks/0'); assets.materials makes them. The table is tastes.toml beside this module.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from embodied.assets.json_file import from_plain, read_toml


@dataclass(frozen=True)
class Taste:
    """What a style chooses from: material keys."""

    woods: tuple[str, ...]
    stones: tuple[str, ...]
    """Tile and stone floors of hall, kitchen and sun room."""
    carpets: tuple[str, ...]
    walls: tuple[str, ...]
    """Light colours; a house takes three."""
    accents: tuple[str, ...]
    papers: tuple[str, ...]
    wet_floors: tuple[str, ...]
    wet_walls: tuple[str, ...]
    doors: tuple[str, ...]
    front_doors: tuple[str, ...]
    frames: tuple[str, ...] = ("paint_white/0",)
    ceilings: tuple[str, ...] = ("paint_white/0", "paint_white/0", "plaster_white/0")


@dataclass(frozen=True)
class Tastes:
    """What is in tastes.toml."""

    styles: Mapping[str, Taste]
    """By the names of embodied.house.validation.STYLES."""
    rough: tuple[str, ...]
    """Floors of garages and workshops, whatever the style."""
    kids: tuple[str, ...]
    """Walls of children's rooms, whatever the style."""
    kids_papers: tuple[str, ...]
    """Their accents."""


TABLE = from_plain(Tastes, read_toml(Path(__file__).with_name("tastes.toml")))
TASTES = TABLE.styles
