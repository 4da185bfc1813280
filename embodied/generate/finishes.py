"""One palette per house, drawn from the materials by role, and what each room wears of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PLAIN = "paint_white/0"


@dataclass(frozen=True)
class Palette:
    """Material keys of a whole house."""

    living_floor: str = "oak_planks/0"
    private_floor: str = "oak_planks/0"
    wet_floor: str = "oak_planks/0"
    service_floor: str = "oak_planks/0"
    walls: tuple[str, ...] = (PLAIN,)
    wet_wall: str = PLAIN
    accents: tuple[str, ...] = ()
    ceiling: str = PLAIN
    skirting: str = PLAIN
    door: str = PLAIN
    front_door: str = PLAIN
    frame: str = PLAIN


def draw_palette(style: str | None, *, rng: np.random.Generator) -> Palette:
    """The palette of one house."""
    return Palette()
