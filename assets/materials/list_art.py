"""Wall art."""

from __future__ import annotations

from functools import partial

from assets.materials import art
from assets.materials.list_prints import PRINTS
from assets.materials.material import Material, listed


def art_materials() -> list[Material]:
    return _art()


def _art() -> list[Material]:
    muted = ((0.78, 0.45, 0.32), (0.25, 0.36, 0.38), (0.86, 0.69, 0.42), (0.62, 0.66, 0.58))
    blues = ((0.16, 0.28, 0.42), (0.45, 0.58, 0.66), (0.84, 0.72, 0.50), (0.78, 0.80, 0.80))
    soft = ((0.82, 0.66, 0.62), (0.58, 0.62, 0.55), (0.44, 0.36, 0.36), (0.90, 0.80, 0.66))
    p, paper = partial, ("paper",)
    return [
        *listed(
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
                *PRINTS["art_shapes"],
            ],
        ),
        *listed(
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
                *PRINTS["art_fields"],
            ],
        ),
        *listed(
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
                *PRINTS["art_hills"],
            ],
        ),
        *listed(
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
                *PRINTS["art_sea"],
            ],
        ),
        *listed(
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
                *PRINTS["art_botanical"],
            ],
        ),
        *listed(
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
                *PRINTS["art_brushwork"],
            ],
        ),
        *listed(
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
                *PRINTS["art_still_life"],
            ],
        ),
        *listed(
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
                *PRINTS["art_poster"],
            ],
        ),
    ]
