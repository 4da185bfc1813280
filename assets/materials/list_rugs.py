"""Rug patterns, clock faces and magazine covers."""

from __future__ import annotations

from functools import partial

from assets.materials import art
from assets.materials.material import Material, listed


def rug_materials() -> list[Material]:
    return [*_rugs(), *_labels()]


def _rugs() -> list[Material]:
    p, wool = partial, ("wool",)
    return [
        *listed(
            "rug_oriental",
            "rug",
            "rug_pattern",
            1024,
            0.05,
            [
                (
                    "red oriental rug",
                    ("red", "blue"),
                    wool,
                    p(art.oriental, field=(0.47, 0.13, 0.11), border=(0.12, 0.16, 0.27), accent=(0.66, 0.43, 0.24)),
                ),
                (
                    "blue oriental rug",
                    ("blue", "red"),
                    wool,
                    p(art.oriental, field=(0.17, 0.23, 0.35), border=(0.46, 0.15, 0.13), accent=(0.70, 0.55, 0.36)),
                ),
                (
                    "beige oriental rug",
                    ("beige", "brown"),
                    wool,
                    p(
                        art.oriental,
                        field=(0.74, 0.66, 0.53),
                        border=(0.38, 0.30, 0.25),
                        accent=(0.50, 0.32, 0.22),
                        line=(0.24, 0.20, 0.18),
                    ),
                ),
                (
                    "faded oriental rug",
                    ("grey", "pink"),
                    wool,
                    p(
                        art.oriental,
                        field=(0.62, 0.52, 0.49),
                        border=(0.46, 0.50, 0.53),
                        accent=(0.74, 0.66, 0.57),
                        line=(0.40, 0.37, 0.36),
                    ),
                ),
            ],
        ),
        *listed(
            "rug_kilim",
            "rug",
            "rug_pattern",
            1024,
            0.05,
            [
                (
                    "red kilim",
                    ("red", "orange"),
                    wool,
                    p(
                        art.kilim,
                        colors=((0.54, 0.17, 0.13), (0.82, 0.75, 0.62), (0.16, 0.24, 0.30), (0.78, 0.50, 0.24)),
                    ),
                ),
                (
                    "grey kilim",
                    ("grey", "white"),
                    wool,
                    p(
                        art.kilim,
                        colors=((0.80, 0.78, 0.74), (0.36, 0.37, 0.39), (0.60, 0.58, 0.55), (0.72, 0.62, 0.50)),
                    ),
                ),
            ],
        ),
        *listed(
            "rug_berber",
            "rug",
            "rug_pattern",
            1024,
            0.05,
            [
                (
                    "white rug with a dark lattice",
                    ("white", "black"),
                    wool,
                    p(art.berber, ground=(0.85, 0.82, 0.76), line=(0.17, 0.16, 0.15)),
                ),
                (
                    "grey rug with a light lattice",
                    ("grey", "white"),
                    wool,
                    p(art.berber, ground=(0.46, 0.47, 0.48), line=(0.82, 0.80, 0.76), diamonds=4),
                ),
            ],
        ),
        *listed(
            "rug_bordered",
            "rug",
            "rug_pattern",
            1024,
            0.05,
            [
                (
                    "beige rug with a border",
                    ("beige", "brown"),
                    wool,
                    p(art.bordered, field=(0.73, 0.66, 0.56), border=(0.44, 0.34, 0.26)),
                ),
                (
                    "grey rug with a double border",
                    ("grey", "white"),
                    wool,
                    p(
                        art.bordered,
                        field=(0.55, 0.56, 0.57),
                        border=(0.80, 0.79, 0.77),
                        bands=((0.05, 0.07), (0.09, 0.10)),
                    ),
                ),
                (
                    "navy blue rug with a border",
                    ("blue", "white"),
                    wool,
                    p(art.bordered, field=(0.15, 0.20, 0.31), border=(0.82, 0.80, 0.75), bands=((0.05, 0.075),)),
                ),
                (
                    "green rug with a border",
                    ("green",),
                    wool,
                    p(art.bordered, field=(0.34, 0.42, 0.35), border=(0.70, 0.68, 0.58), bands=((0.0, 0.05),)),
                ),
            ],
        ),
        *listed(
            "rug_modern",
            "rug",
            "rug_pattern",
            1024,
            0.05,
            [
                (
                    "abstract rug in earth colours",
                    ("orange", "beige"),
                    wool,
                    p(
                        art.modern,
                        colors=(
                            (0.80, 0.74, 0.65),
                            (0.68, 0.42, 0.30),
                            (0.46, 0.42, 0.36),
                            (0.86, 0.80, 0.70),
                            (0.76, 0.62, 0.42),
                        ),
                    ),
                ),
                (
                    "abstract blue rug",
                    ("blue", "grey"),
                    wool,
                    p(
                        art.modern,
                        colors=((0.74, 0.76, 0.77), (0.28, 0.38, 0.48), (0.54, 0.62, 0.66), (0.85, 0.84, 0.80)),
                    ),
                ),
            ],
        ),
        *listed(
            "rug_striped",
            "rug",
            "rug_pattern",
            1024,
            0.05,
            [
                (
                    "striped blue rug",
                    ("blue", "white"),
                    ("cotton",),
                    p(art.striped, colors=((0.84, 0.82, 0.78), (0.30, 0.40, 0.52), (0.62, 0.68, 0.72))),
                ),
                (
                    "striped colourful rug",
                    ("red", "yellow", "blue"),
                    ("cotton",),
                    p(
                        art.striped,
                        colors=(
                            (0.72, 0.30, 0.24),
                            (0.84, 0.74, 0.50),
                            (0.30, 0.42, 0.46),
                            (0.80, 0.56, 0.30),
                            (0.84, 0.82, 0.76),
                        ),
                        count=22,
                    ),
                ),
            ],
        ),
        *listed(
            "rug_rings",
            "rug",
            "rug_pattern",
            1024,
            0.05,
            [
                (
                    "round braided rug",
                    ("beige", "brown"),
                    ("jute",),
                    p(art.rings, colors=((0.70, 0.61, 0.47), (0.66, 0.56, 0.42)), count=16),
                ),
                (
                    "round blue rug",
                    ("blue", "white"),
                    ("cotton",),
                    p(art.rings, colors=((0.30, 0.42, 0.54), (0.82, 0.81, 0.78), (0.52, 0.62, 0.70)), count=9),
                ),
                (
                    "round colourful rug",
                    ("red", "yellow"),
                    ("cotton",),
                    p(
                        art.rings,
                        colors=((0.74, 0.36, 0.30), (0.86, 0.74, 0.46), (0.40, 0.54, 0.52), (0.86, 0.82, 0.74)),
                        count=8,
                    ),
                ),
            ],
        ),
    ]


def _labels() -> list[Material]:
    p = partial
    return [
        *listed(
            "clock_face",
            "label",
            "label",
            256,
            0.4,
            [
                (
                    "white clock face",
                    ("white",),
                    ("plastic",),
                    p(art.dial, face=(0.91, 0.91, 0.89), ink=(0.08, 0.08, 0.09)),
                ),
                (
                    "black clock face",
                    ("black",),
                    ("plastic",),
                    p(art.dial, face=(0.09, 0.09, 0.10), ink=(0.88, 0.86, 0.80), numerals=False),
                ),
                (
                    "cream clock face",
                    ("cream",),
                    ("paper",),
                    p(art.dial, face=(0.88, 0.83, 0.71), ink=(0.20, 0.15, 0.10), hour=4.6),
                ),
            ],
        ),
        *listed(
            "magazine_cover",
            "label",
            "label",
            256,
            0.5,
            [
                (
                    "blue magazine",
                    ("blue",),
                    ("paper",),
                    p(art.cover, ground=(0.84, 0.70, 0.58), ink=(0.95, 0.95, 0.93), picture=(0.30, 0.44, 0.58)),
                ),
                (
                    "red magazine",
                    ("red",),
                    ("paper",),
                    p(art.cover, ground=(0.30, 0.26, 0.26), ink=(0.96, 0.93, 0.85), picture=(0.70, 0.28, 0.24)),
                ),
                (
                    "green magazine",
                    ("green",),
                    ("paper",),
                    p(art.cover, ground=(0.90, 0.86, 0.74), ink=(0.12, 0.13, 0.12), picture=(0.52, 0.62, 0.48)),
                ),
            ],
        ),
    ]
