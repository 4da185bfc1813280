"""Materials of floors, walls, doors and papers that each style of a house chooses from.

Names of materials only ('oak_planks/0'); assets.materials makes them. The table is style_finishes.toml beside this
module.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from embodied.assets.json_file import from_plain, read_toml


@dataclass(frozen=True)
class StyleFinishes:
    """Material keys that a style chooses from."""

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
class FinishTable:
    """The content of style_finishes.toml."""

    styles: Mapping[str, StyleFinishes]
    """By the names of embodied.house.validation.STYLES."""
    rough: tuple[str, ...]
    """Floors of garages and workshops, whatever the style."""
    kids: tuple[str, ...]
    """Walls of children's rooms, whatever the style."""
    kids_papers: tuple[str, ...]
    """Their accents."""


FINISH_TABLE = from_plain(FinishTable, read_toml(Path(__file__).with_name("style_finishes.toml")))
STYLE_FINISHES = FINISH_TABLE.styles
