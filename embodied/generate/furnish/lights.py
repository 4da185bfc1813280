"""Lights: one for every lamp that found its place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from embodied.generate.furnish.stock import Stock
from embodied.house.house import Light, Placement, rounded

WARM, NEUTRAL = (1.0, 0.72, 0.44), (1.0, 0.9, 0.78)
"""Linear colours of about 2700 K and 4000 K."""


def lights(placements: Sequence[Placement], stock: Stock, *, rng: np.random.Generator) -> tuple[Light, ...]:
    """One light per lamp, at its bulb; some table lamps are off."""
    shining: list[Light] = []
    share = 0.35 * (1 - stock.style.warmth)
    red, green, blue = (round((1 - share) * w + share * n, 3) for w, n in zip(WARM, NEUTRAL))
    for p in placements:
        lumens = stock.tables.lumens.get(p.object_class)
        if lumens is None:
            continue
        x, y, z = p.position
        main = p.object_class in stock.tables.alike["main lamps"]
        hanging = main or p.object_class == "ceiling fan"
        bulb = z + (0.35 * p.size[2] if hanging else 0.78 * p.size[2])
        cool = p.object_class == "fluorescent lamp"
        on = True if main else bool(rng.random() < 0.7)
        scale = min(max(p.size[0] / 0.5, 0.6), 1.6) if hanging else 1.0
        shining.append(
            Light(
                id=f"light_{len(shining) + 1}",
                room=p.room,
                placement=p.id,
                position=rounded((x, y, bulb)),
                color=NEUTRAL if cool else (red, green, blue),
                power=round(lumens * scale, 0),
                on=on,
            )
        )
    return tuple(shining)
