"""Cloth, carpets, leather, wicker and metals."""

from __future__ import annotations

from functools import partial

from assets.materials import surface, textile
from assets.materials.maps import Maps
from assets.materials.material import Material


def cloth_materials() -> list[Material]:
    return [*_textiles(), *_metals()]


def _textiles() -> list[Material]:
    t = textile
    made = []
    shades = (
        ("natural", (0.76, 0.71, 0.63)),
        ("white", (0.88, 0.87, 0.84)),
        ("grey", (0.52, 0.52, 0.52)),
        ("charcoal", (0.25, 0.26, 0.27)),
        ("navy blue", (0.16, 0.22, 0.33)),
        ("sage green", (0.52, 0.58, 0.49)),
        ("rust", (0.62, 0.34, 0.22)),
        ("mustard", (0.74, 0.57, 0.24)),
        ("blush", (0.80, 0.65, 0.60)),
        ("teal", (0.18, 0.38, 0.40)),
        ("brown", (0.40, 0.31, 0.25)),
        ("beige", (0.72, 0.64, 0.53)),
    )
    for i, (name, c) in enumerate(shades):
        pale = tuple(0.5 * x + 0.5 * min(1.0, x * 1.12 + 0.02) for x in c)
        made.append(
            Material(
                f"linen/{i}",
                "fabric",
                ("fabric", "upholstery", "curtain"),
                f"{name} linen",
                (name.split()[-1],),
                ("linen", "fabric"),
                0.15,
                512,
                partial(t.weave, warp=c, weft=pale, threads=128),
                0.1,
            )
        )
    for i, (name, c) in enumerate(
        (
            ("white", (0.90, 0.89, 0.87)),
            ("cream", (0.87, 0.83, 0.75)),
            ("light grey", (0.72, 0.72, 0.72)),
            ("blue", (0.36, 0.47, 0.62)),
            ("pink", (0.84, 0.68, 0.68)),
            ("green", (0.46, 0.58, 0.46)),
            ("yellow", (0.88, 0.78, 0.46)),
            ("red", (0.60, 0.16, 0.16)),
        )
    ):
        made.append(
            Material(
                f"cotton/{i}",
                "fabric",
                ("fabric", "curtain"),
                f"{name} cotton",
                (name.split()[-1],),
                ("cotton", "fabric"),
                0.12,
                512,
                partial(t.weave, warp=c, weft=c, threads=160, irregular=0.025, slubs=0.12),
                0.1,
            )
        )
    for i, (name, a, b) in enumerate(
        (
            ("grey", ((0.25, 0.24, 0.23), (0.50, 0.47, 0.42)), ((0.35, 0.33, 0.30), (0.60, 0.56, 0.50))),
            ("brown", ((0.34, 0.25, 0.18), (0.55, 0.43, 0.31)), ((0.42, 0.32, 0.22), (0.63, 0.53, 0.40))),
            ("blue", ((0.20, 0.26, 0.36), (0.42, 0.48, 0.56)), ((0.28, 0.34, 0.44), (0.56, 0.60, 0.64))),
        )
    ):
        made.append(
            Material(
                f"tweed/{i}",
                "fabric",
                ("fabric", "upholstery"),
                f"{name} tweed",
                (name,),
                ("tweed", "wool", "fabric"),
                0.18,
                512,
                partial(t.weave, warp=a, weft=b, threads=96, over=2),
                0.08,
            )
        )
    for i, (name, a) in enumerate((("blue", (0.16, 0.23, 0.38)), ("grey", (0.30, 0.31, 0.33)))):
        made.append(
            Material(
                f"denim/{i}",
                "fabric",
                ("fabric",),
                f"{name} denim",
                (name,),
                ("denim", "cotton"),
                0.12,
                512,
                partial(t.weave, warp=a, weft=(0.58, 0.62, 0.68), threads=120, over=3),
                0.08,
            )
        )
    for i, (name, c) in enumerate(
        (
            ("teal", (0.11, 0.30, 0.31)),
            ("emerald", (0.08, 0.29, 0.20)),
            ("navy blue", (0.11, 0.15, 0.28)),
            ("burgundy", (0.34, 0.08, 0.12)),
            ("mustard", (0.66, 0.48, 0.15)),
            ("grey", (0.40, 0.40, 0.41)),
            ("rose", (0.68, 0.44, 0.43)),
        )
    ):
        made.append(
            Material(
                f"velvet/{i}",
                "fabric",
                ("fabric", "upholstery", "curtain"),
                f"{name} velvet",
                (name.split()[-1],),
                ("velvet", "fabric"),
                0.40,
                512,
                partial(t.felt, color=c),
                0.15,
            )
        )
    for i, (name, c) in enumerate(
        (
            ("white", (0.90, 0.89, 0.87)),
            ("grey", (0.58, 0.58, 0.58)),
            ("blue", (0.35, 0.46, 0.56)),
            ("sand", (0.78, 0.70, 0.58)),
            ("green", (0.48, 0.57, 0.48)),
            ("pink", (0.82, 0.66, 0.64)),
            ("navy blue", (0.16, 0.20, 0.30)),
        )
    ):
        made.append(
            Material(
                f"terry/{i}",
                "fabric",
                ("fabric",),
                f"{name} terry",
                (name.split()[-1],),
                ("terry", "cotton"),
                0.25,
                512,
                partial(t.pile, color=c, loop=0.0016, depth=0.10, tracks=0.01),
                0.05,
            )
        )
    cloth = partial(t.weave, warp=(0.90, 0.89, 0.86), weft=(0.90, 0.89, 0.86), threads=128, irregular=0.03, slubs=0.15)
    prints = [
        (
            "blue checked cotton",
            "blue",
            partial(_printed, cloth=cloth, motif=lambda n: t.check_motif(n, 8), color=(0.30, 0.40, 0.60)),
        ),
        (
            "red checked cotton",
            "red",
            partial(_printed, cloth=cloth, motif=lambda n: t.check_motif(n, 8), color=(0.62, 0.18, 0.16)),
        ),
        (
            "blue striped cotton",
            "blue",
            partial(_printed, cloth=cloth, motif=lambda n: t.stripes_motif(n, 6, 0.4), color=(0.24, 0.34, 0.50)),
        ),
        (
            "grey striped cotton",
            "grey",
            partial(_printed, cloth=cloth, motif=lambda n: t.stripes_motif(n, 10, 0.3), color=(0.45, 0.45, 0.45)),
        ),
    ]
    for i, (name, colour, recipe) in enumerate(prints):
        made.append(
            Material(
                f"printed_cotton/{i}",
                "fabric",
                ("fabric", "curtain"),
                name,
                (colour, "white"),
                ("cotton", "fabric"),
                0.24,
                512,
                recipe,
                0.1,
            )
        )
    for i, (name, c, d) in enumerate(
        (
            ("beige", (0.66, 0.61, 0.54), (0.58, 0.53, 0.46)),
            ("grey", (0.50, 0.50, 0.50), (0.42, 0.42, 0.43)),
            ("cream", (0.80, 0.76, 0.69), None),
            ("charcoal", (0.24, 0.24, 0.26), (0.32, 0.32, 0.33)),
            ("blue", (0.28, 0.36, 0.46), (0.36, 0.43, 0.52)),
            ("burgundy", (0.36, 0.13, 0.16), None),
            ("green", (0.33, 0.39, 0.32), None),
            ("brown", (0.42, 0.33, 0.26), (0.34, 0.26, 0.20)),
        )
    ):
        made.append(
            Material(
                f"carpet/{i}",
                "carpet",
                ("carpet", "rug"),
                f"{name} carpet",
                (name,),
                ("wool", "carpet"),
                1.0,
                1024,
                partial(t.pile, color=c, second=d),
                0.05,
            )
        )
    for i, (name, c) in enumerate((("ivory", (0.84, 0.81, 0.74)), ("grey", (0.62, 0.61, 0.60)))):
        made.append(
            Material(
                f"shag/{i}",
                "carpet",
                ("rug",),
                f"{name} shag",
                (name,),
                ("wool",),
                0.8,
                1024,
                partial(t.pile, color=c, loop=0.009, depth=0.22),
                0.05,
            )
        )
    for i, (name, c) in enumerate((("natural", (0.70, 0.61, 0.47)), ("grey", (0.52, 0.50, 0.46)))):
        made.append(
            Material(
                f"sisal/{i}",
                "carpet",
                ("carpet", "rug"),
                f"{name} sisal",
                (name,),
                ("sisal",),
                0.5,
                1024,
                partial(t.sisal, color=c),
                0.1,
            )
        )
    for i, (name, c) in enumerate(
        (
            ("brown", (0.33, 0.20, 0.13)),
            ("black", (0.07, 0.065, 0.065)),
            ("tan", (0.58, 0.37, 0.21)),
            ("cream", (0.80, 0.74, 0.64)),
            ("red", (0.40, 0.10, 0.09)),
        )
    ):
        made.append(
            Material(
                f"leather/{i}",
                "leather",
                ("leather", "upholstery"),
                f"{name} leather",
                (name,),
                ("leather",),
                0.3,
                512,
                partial(t.leather, color=c),
            )
        )
    return made


def _printed(n: int, tile: float, cloth, motif, color, *, rng) -> Maps:
    return textile.printed(cloth(n, tile, rng=rng), motif(n), color)


def _metals() -> list[Material]:
    made = []
    for name, c, rough, brushed, stain in (
        ("brushed_steel", (0.74, 0.74, 0.73), 0.28, 1.0, 0.0),
        ("chrome", (0.86, 0.86, 0.86), 0.06, 0.1, 0.0),
        ("black_steel", (0.07, 0.07, 0.075), 0.45, 0.3, 0.0),
        ("brass", (0.80, 0.65, 0.38), 0.24, 0.6, 0.0),
        ("copper", (0.78, 0.51, 0.39), 0.24, 0.6, 0.15),
        ("bronze", (0.40, 0.30, 0.22), 0.35, 0.5, 0.3),
        ("white_steel", (0.88, 0.88, 0.87), 0.35, 0.1, 0.0),
    ):
        painted = name in ("black_steel", "white_steel")
        made.append(
            Material(
                f"{name}/0",
                "metal",
                ("metal",),
                name.replace("_", " "),
                (
                    name.split("_")[0]
                    if painted
                    else {"brass": "gold", "copper": "orange", "bronze": "brown"}.get(name, "silver"),
                ),
                ("metal",),
                0.5,
                512,
                partial(surface.metal, color=c, rough=rough, brushed=brushed, stain=stain),
                0.5,
                0.0 if painted else 1.0,
            )
        )
    for i, (name, c) in enumerate(
        (("natural", (0.68, 0.53, 0.35)), ("dark", (0.36, 0.25, 0.17)), ("white", (0.84, 0.82, 0.77)))
    ):
        made.append(
            Material(
                f"wicker/{i}",
                "wicker",
                ("wicker",),
                f"{name} wicker",
                (name,),
                ("wicker",),
                0.30,
                512,
                partial(surface.wicker, color=c),
                0.3,
            )
        )
    return made
