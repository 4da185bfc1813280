"""Lights: one for every lamp that found its place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from embodied.generate.furnish.style import Style
from embodied.house.house import Light, Placement, rounded

LUMENS: dict[str, float] = {
    "ceiling lamp": 1500.0,
    "pendant lamp": 1300.0,
    "chandelier": 2600.0,
    "fluorescent lamp": 2800.0,
    "track light": 1600.0,
    "ceiling fan": 900.0,
    "floor lamp": 900.0,
    "table lamp": 450.0,
    "desk lamp": 420.0,
    "wall lamp": 380.0,
    "picture light": 200.0,
    "spotlight": 350.0,
}
"""Object class to the flux of its bulbs."""
ALWAYS = ("ceiling lamp", "pendant lamp", "chandelier", "fluorescent lamp", "track light")

WARM, NEUTRAL = (1.0, 0.72, 0.44), (1.0, 0.9, 0.78)
"""Linear colours of about 2700 K and 4000 K."""


def lights(placements: Sequence[Placement], style: Style, *, rng: np.random.Generator) -> tuple[Light, ...]:
    """One light per lamp, at its bulb; some table lamps are off."""
    shining: list[Light] = []
    share = 0.35 * (1 - style.warmth)
    red, green, blue = (round((1 - share) * w + share * n, 3) for w, n in zip(WARM, NEUTRAL))
    for p in placements:
        lumens = LUMENS.get(p.object_class)
        if lumens is None:
            continue
        x, y, z = p.position
        hanging = p.object_class in ALWAYS or p.object_class == "ceiling fan"
        bulb = z + (0.35 * p.size[2] if hanging else 0.78 * p.size[2])
        cool = p.object_class == "fluorescent lamp"
        on = True if p.object_class in ALWAYS else bool(rng.random() < 0.7)
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
