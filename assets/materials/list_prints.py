"""Further wall art, so that a large house need not hang the same picture twice: rows for assets.materials.list_art."""

from __future__ import annotations

from functools import partial as p

from assets.materials import art

PAPER, CANVAS = ("paper",), ("canvas",)
WHITE, CREAM, BLACK = (0.92, 0.91, 0.89), (0.91, 0.87, 0.79), (0.11, 0.11, 0.12)

PRINTS: dict[str, list[tuple]] = {
    "art_shapes": [
        ("yellow abstract print", ("yellow", "grey"), PAPER,
         p(art.shapes, ground=WHITE, colors=((0.85, 0.66, 0.18), (0.35, 0.36, 0.38), (0.72, 0.72, 0.70)))),
        ("green abstract print", ("green", "beige"), PAPER,
         p(art.shapes, ground=CREAM, colors=((0.18, 0.30, 0.22), (0.46, 0.56, 0.40), (0.80, 0.72, 0.56), (0.68, 0.42, 0.28)))),
        ("black and white abstract print", ("black", "white"), PAPER,
         p(art.shapes, ground=WHITE, colors=(BLACK, (0.45, 0.45, 0.45), (0.76, 0.76, 0.75)))),
        ("terracotta abstract print", ("orange", "brown"), PAPER,
         p(art.shapes, ground=(0.94, 0.90, 0.84), colors=((0.70, 0.34, 0.22), (0.86, 0.62, 0.46), (0.38, 0.24, 0.18)))),
        ("abstract print on dark paper", ("blue", "orange"), PAPER,
         p(art.shapes, ground=(0.12, 0.16, 0.22), colors=((0.82, 0.52, 0.26), (0.88, 0.82, 0.70), (0.30, 0.44, 0.52)))),
    ],
    "art_fields": [
        ("yellow colour field painting", ("yellow", "orange"), CANVAS,
         p(art.fields, colors=((0.86, 0.66, 0.20), (0.92, 0.80, 0.42), (0.80, 0.50, 0.20)))),
        ("green colour field painting", ("green",), CANVAS,
         p(art.fields, colors=((0.12, 0.22, 0.18), (0.24, 0.40, 0.30), (0.52, 0.60, 0.42)))),
        ("purple colour field painting", ("purple", "pink"), CANVAS,
         p(art.fields, colors=((0.24, 0.14, 0.26), (0.48, 0.26, 0.40), (0.74, 0.48, 0.50)))),
        ("black and grey colour field painting", ("black", "grey"), CANVAS,
         p(art.fields, colors=((0.10, 0.10, 0.11), (0.30, 0.30, 0.31), (0.62, 0.61, 0.59)))),
        ("turquoise colour field painting", ("blue", "green"), CANVAS,
         p(art.fields, colors=((0.10, 0.34, 0.38), (0.34, 0.58, 0.58), (0.86, 0.84, 0.72)))),
    ],
    "art_hills": [
        ("photograph of hills in autumn", ("brown", "orange"), PAPER,
         p(art.hills, sky=((0.70, 0.74, 0.76), (0.93, 0.88, 0.76)), far=(0.78, 0.66, 0.50), near=(0.30, 0.14, 0.06), sun=False)),
        ("picture of mountains in the snow", ("white", "blue"), PAPER,
         p(art.hills, sky=((0.30, 0.50, 0.76), (0.80, 0.88, 0.94)), far=(0.84, 0.88, 0.92), near=(0.42, 0.50, 0.60), sun=False)),
        ("painting of a desert", ("orange", "red"), CANVAS,
         p(art.hills, sky=((0.34, 0.52, 0.68), (0.96, 0.82, 0.62)), far=(0.88, 0.64, 0.42), near=(0.50, 0.20, 0.10), layers=4)),
        ("painting of hills at night", ("blue", "black"), CANVAS,
         p(art.hills, sky=((0.05, 0.08, 0.18), (0.22, 0.30, 0.46)), far=(0.16, 0.22, 0.34), near=(0.03, 0.04, 0.08))),
        ("picture of pink hills", ("pink", "purple"), PAPER,
         p(art.hills, sky=((0.86, 0.74, 0.80), (0.97, 0.90, 0.84)), far=(0.88, 0.66, 0.68), near=(0.40, 0.22, 0.36), layers=5)),
    ],
    "art_sea": [
        ("photograph of a grey sea", ("grey",), PAPER,
         p(art.sea, sky=((0.56, 0.58, 0.60), (0.84, 0.84, 0.84)), water=((0.56, 0.58, 0.60), (0.20, 0.22, 0.24)))),
        ("picture of a turquoise sea", ("blue", "green"), PAPER,
         p(art.sea, sky=((0.30, 0.60, 0.86), (0.86, 0.93, 0.95)), water=((0.44, 0.78, 0.76), (0.06, 0.40, 0.48)))),
        ("painting of the sea at sunrise", ("yellow", "blue"), CANVAS,
         p(art.sea, sky=((0.52, 0.66, 0.80), (0.98, 0.84, 0.56)), water=((0.80, 0.72, 0.54), (0.18, 0.32, 0.42)))),
        ("photograph of the sea by night", ("blue", "black"), PAPER,
         p(art.sea, sky=((0.04, 0.06, 0.14), (0.22, 0.28, 0.40)), water=((0.20, 0.26, 0.36), (0.02, 0.04, 0.09)))),
    ],
    "art_botanical": [
        ("botanical print of a blue branch", ("blue", "white"), PAPER,
         p(art.botanical, ground=WHITE, ink=(0.20, 0.32, 0.50), fern=False)),
        ("botanical print of a red branch", ("red", "cream"), PAPER, p(art.botanical, ground=CREAM, ink=(0.56, 0.22, 0.16), fern=False)),
        ("cyanotype of a fern", ("blue",), PAPER, p(art.botanical, ground=(0.10, 0.22, 0.44), ink=(0.84, 0.89, 0.93))),
        ("drawing of a brown fern", ("brown", "beige"), PAPER, p(art.botanical, ground=(0.88, 0.82, 0.70), ink=(0.36, 0.24, 0.14))),
        ("pressed branch on green paper", ("green", "yellow"), PAPER,
         p(art.botanical, ground=(0.22, 0.32, 0.26), ink=(0.86, 0.78, 0.50), fern=False)),
    ],
    "art_brushwork": [
        ("abstract painting in green", ("green", "white"), CANVAS,
         p(art.brushwork, ground=WHITE, colors=((0.16, 0.30, 0.22), (0.42, 0.55, 0.38), (0.74, 0.78, 0.62), WHITE))),
        ("abstract painting in pink and red", ("pink", "red"), CANVAS,
         p(art.brushwork, ground=CREAM, colors=((0.78, 0.36, 0.38), (0.90, 0.68, 0.66), (0.52, 0.16, 0.20), WHITE))),
        ("dark abstract painting", ("black", "yellow"), CANVAS,
         p(art.brushwork, ground=BLACK, colors=((0.20, 0.20, 0.22), (0.78, 0.62, 0.26), (0.34, 0.32, 0.30), BLACK))),
        ("abstract painting in turquoise", ("blue", "green"), CANVAS,
         p(art.brushwork, ground=WHITE, colors=((0.12, 0.42, 0.46), (0.48, 0.70, 0.68), (0.90, 0.84, 0.70), (0.20, 0.26, 0.34)))),
        ("abstract painting in violet", ("purple", "grey"), CANVAS,
         p(art.brushwork, ground=(0.84, 0.83, 0.85), colors=((0.36, 0.26, 0.46), (0.62, 0.54, 0.70), (0.86, 0.84, 0.80), (0.24, 0.24, 0.28)))),
    ],
    "art_still_life": [
        ("still life with lemons", ("yellow", "blue"), CANVAS,
         p(art.still_life, ground=(0.14, 0.22, 0.32), table=(0.78, 0.76, 0.72),
           fruit=((0.90, 0.76, 0.22), (0.84, 0.68, 0.18), (0.93, 0.84, 0.40)))),
        ("still life with plums", ("purple", "brown"), CANVAS,
         p(art.still_life, ground=(0.42, 0.36, 0.28), table=(0.28, 0.18, 0.12),
           fruit=((0.28, 0.14, 0.26), (0.40, 0.18, 0.30), (0.20, 0.12, 0.24)))),
    ],
    "art_poster": [
        ("blue poster", ("blue", "orange"), PAPER, p(art.poster, ground=(0.16, 0.28, 0.44), ink=CREAM, accent=(0.88, 0.54, 0.24))),
        ("pink poster", ("pink", "red"), PAPER, p(art.poster, ground=(0.90, 0.70, 0.68), ink=(0.30, 0.10, 0.14), accent=(0.78, 0.26, 0.26))),
        ("black poster", ("black", "white"), PAPER, p(art.poster, ground=BLACK, ink=WHITE, accent=(0.62, 0.62, 0.61))),
        ("orange poster", ("orange", "cream"), PAPER, p(art.poster, ground=(0.82, 0.42, 0.18), ink=CREAM, accent=(0.30, 0.16, 0.12))),
        ("white poster", ("white", "green"), PAPER, p(art.poster, ground=WHITE, ink=BLACK, accent=(0.26, 0.50, 0.38))),
    ],
}
"""Stem of the material key to (name, colours, material words, recipe)."""
