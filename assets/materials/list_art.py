"""Wall art, rug patterns and other pictures that are used once instead of tiled."""

from __future__ import annotations

from functools import partial

from assets.materials import art
from assets.materials.material import Material


def art_materials() -> list[Material]:
    return [*_art(), *_rugs(), *_labels()]


def _list(stem: str, family: str, role: str, pixels: int, specular: float, rows) -> list[Material]:
    return [
        Material(f"{stem}/{i}", family, (role,), name, colours, words, 1.0, pixels, recipe, specular)
        for i, (name, colours, words, recipe) in enumerate(rows)
    ]


def _art() -> list[Material]:
    muted = ((0.78, 0.45, 0.32), (0.25, 0.36, 0.38), (0.86, 0.69, 0.42), (0.62, 0.66, 0.58))
    blues = ((0.16, 0.28, 0.42), (0.45, 0.58, 0.66), (0.84, 0.72, 0.50), (0.78, 0.80, 0.80))
    soft = ((0.82, 0.66, 0.62), (0.58, 0.62, 0.55), (0.44, 0.36, 0.36), (0.90, 0.80, 0.66))
    p, paper = partial, ("paper",)
    return [
        *_list(
            "art_shapes",
            "art",
            "art",
            768,
            0.2,
            [
                (
                    "abstract print of rounded shapes",
                    ("orange", "green"),
                    paper,
                    p(art.shapes, ground=(0.92, 0.89, 0.83), colors=muted),
                ),
                (
                    "blue abstract print",
                    ("blue", "yellow"),
                    paper,
                    p(art.shapes, ground=(0.90, 0.89, 0.86), colors=blues),
                ),
                (
                    "pink abstract print",
                    ("pink", "green"),
                    paper,
                    p(art.shapes, ground=(0.93, 0.91, 0.88), colors=soft),
                ),
            ],
        ),
        *_list(
            "art_fields",
            "art",
            "art",
            768,
            0.3,
            [
                (
                    "red colour field painting",
                    ("red", "orange"),
                    ("canvas",),
                    p(art.fields, colors=((0.42, 0.13, 0.11), (0.68, 0.22, 0.13), (0.80, 0.42, 0.18))),
                ),
                (
                    "blue colour field painting",
                    ("blue",),
                    ("canvas",),
                    p(
                        art.fields,
                        colors=((0.10, 0.15, 0.24), (0.16, 0.26, 0.42), (0.36, 0.45, 0.52), (0.10, 0.14, 0.2)),
                    ),
                ),
                (
                    "beige colour field painting",
                    ("beige", "white"),
                    ("canvas",),
                    p(art.fields, colors=((0.80, 0.74, 0.66), (0.90, 0.87, 0.82), (0.66, 0.57, 0.48))),
                ),
            ],
        ),
        *_list(
            "art_hills",
            "art",
            "art",
            768,
            0.3,
            [
                (
                    "photograph of misty mountains",
                    ("blue", "grey"),
                    paper,
                    p(
                        art.hills,
                        sky=((0.62, 0.70, 0.78), (0.90, 0.86, 0.80)),
                        far=(0.66, 0.72, 0.77),
                        near=(0.10, 0.16, 0.18),
                    ),
                ),
                (
                    "picture of hills at sunset",
                    ("orange", "purple"),
                    paper,
                    p(
                        art.hills,
                        sky=((0.42, 0.36, 0.48), (0.95, 0.66, 0.42)),
                        far=(0.78, 0.52, 0.46),
                        near=(0.16, 0.11, 0.16),
                    ),
                ),
                (
                    "landscape of green hills",
                    ("green", "blue"),
                    ("canvas",),
                    p(
                        art.hills,
                        sky=((0.46, 0.62, 0.78), (0.84, 0.88, 0.88)),
                        far=(0.60, 0.70, 0.68),
                        near=(0.22, 0.32, 0.14),
                        sun=False,
                    ),
                ),
                (
                    "black and white photograph of mountains",
                    ("black", "white"),
                    paper,
                    p(
                        art.hills,
                        sky=((0.60, 0.60, 0.60), (0.88, 0.88, 0.88)),
                        far=(0.72, 0.72, 0.72),
                        near=(0.08, 0.08, 0.08),
                        sun=False,
                        layers=5,
                    ),
                ),
            ],
        ),
        *_list(
            "art_sea",
            "art",
            "art",
            768,
            0.3,
            [
                (
                    "photograph of the sea",
                    ("blue",),
                    paper,
                    p(
                        art.sea,
                        sky=((0.40, 0.58, 0.76), (0.84, 0.88, 0.90)),
                        water=((0.36, 0.52, 0.60), (0.08, 0.22, 0.32)),
                    ),
                ),
                (
                    "picture of the sea at dusk",
                    ("purple", "orange"),
                    ("canvas",),
                    p(
                        art.sea,
                        sky=((0.30, 0.30, 0.44), (0.94, 0.70, 0.52)),
                        water=((0.66, 0.50, 0.46), (0.14, 0.15, 0.24)),
                    ),
                ),
            ],
        ),
        *_list(
            "art_botanical",
            "art",
            "art",
            768,
            0.2,
            [
                (
                    "botanical drawing of a fern",
                    ("green", "white"),
                    paper,
                    p(art.botanical, ground=(0.92, 0.90, 0.84), ink=(0.24, 0.34, 0.22)),
                ),
                (
                    "botanical print of a leafy branch",
                    ("green", "beige"),
                    paper,
                    p(art.botanical, ground=(0.93, 0.92, 0.88), ink=(0.30, 0.42, 0.32), fern=False),
                ),
                (
                    "line drawing of a plant",
                    ("black", "white"),
                    paper,
                    p(art.botanical, ground=(0.93, 0.93, 0.92), ink=(0.16, 0.16, 0.17), fern=False),
                ),
                (
                    "pressed fern on dark paper",
                    ("black", "green"),
                    paper,
                    p(art.botanical, ground=(0.13, 0.15, 0.15), ink=(0.62, 0.68, 0.55)),
                ),
            ],
        ),
        *_list(
            "art_brushwork",
            "art",
            "art",
            768,
            0.4,
            [
                (
                    "abstract painting in blue and gold",
                    ("blue", "yellow"),
                    ("canvas",),
                    p(
                        art.brushwork,
                        ground=(0.88, 0.87, 0.84),
                        colors=((0.14, 0.24, 0.38), (0.36, 0.52, 0.60), (0.80, 0.64, 0.30), (0.92, 0.91, 0.88)),
                    ),
                ),
                (
                    "abstract painting in earth colours",
                    ("brown", "orange"),
                    ("canvas",),
                    p(
                        art.brushwork,
                        ground=(0.82, 0.76, 0.68),
                        colors=((0.62, 0.33, 0.20), (0.34, 0.24, 0.18), (0.86, 0.78, 0.66), (0.74, 0.56, 0.32)),
                    ),
                ),
                (
                    "black and white abstract painting",
                    ("black", "white"),
                    ("canvas",),
                    p(
                        art.brushwork,
                        ground=(0.91, 0.90, 0.88),
                        colors=((0.07, 0.07, 0.08), (0.88, 0.87, 0.85), (0.42, 0.42, 0.43)),
                    ),
                ),
                (
                    "colourful abstract painting",
                    ("red", "green", "blue"),
                    ("canvas",),
                    p(
                        art.brushwork,
                        ground=(0.90, 0.86, 0.78),
                        colors=((0.75, 0.24, 0.20), (0.20, 0.42, 0.40), (0.88, 0.70, 0.28), (0.26, 0.33, 0.52)),
                    ),
                ),
            ],
        ),
        *_list(
            "art_still_life",
            "art",
            "art",
            768,
            0.5,
            [
                (
                    "still life with fruit",
                    ("brown", "orange"),
                    ("canvas",),
                    p(
                        art.still_life,
                        ground=(0.16, 0.12, 0.09),
                        table=(0.42, 0.27, 0.16),
                        fruit=((0.74, 0.30, 0.14), (0.80, 0.62, 0.22), (0.52, 0.16, 0.12)),
                    ),
                ),
                (
                    "still life with green apples",
                    ("green",),
                    ("canvas",),
                    p(
                        art.still_life,
                        ground=(0.30, 0.33, 0.33),
                        table=(0.72, 0.68, 0.60),
                        fruit=((0.55, 0.62, 0.24), (0.66, 0.70, 0.36), (0.44, 0.52, 0.20)),
                    ),
                ),
            ],
        ),
        *_list(
            "art_poster",
            "art",
            "art",
            768,
            0.3,
            [
                (
                    "red and cream poster",
                    ("red", "cream"),
                    paper,
                    p(art.poster, ground=(0.91, 0.87, 0.78), ink=(0.13, 0.13, 0.14), accent=(0.74, 0.22, 0.16)),
                ),
                (
                    "yellow poster",
                    ("yellow", "black"),
                    paper,
                    p(art.poster, ground=(0.88, 0.70, 0.26), ink=(0.12, 0.12, 0.12), accent=(0.93, 0.90, 0.84)),
                ),
                (
                    "blue and white poster",
                    ("blue", "white"),
                    paper,
                    p(art.poster, ground=(0.90, 0.90, 0.89), ink=(0.12, 0.20, 0.36), accent=(0.42, 0.60, 0.70)),
                ),
                (
                    "green poster",
                    ("green",),
                    paper,
                    p(art.poster, ground=(0.20, 0.32, 0.28), ink=(0.90, 0.86, 0.76), accent=(0.80, 0.52, 0.32)),
                ),
            ],
        ),
    ]


def _rugs() -> list[Material]:
    p, wool = partial, ("wool",)
    return [
        *_list(
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
        *_list(
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
        *_list(
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
        *_list(
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
        *_list(
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
        *_list(
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
        *_list(
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
        *_list(
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
        *_list(
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
