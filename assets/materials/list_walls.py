"""The materials of walls, ceilings and worktops."""

from __future__ import annotations

from functools import partial

from assets.materials import mineral, surface
from assets.materials import surface as w
from assets.materials.material import Material

PAINTS = (
    ("white", (0.90, 0.895, 0.88)),
    ("warm white", (0.89, 0.87, 0.83)),
    ("ivory", (0.88, 0.85, 0.77)),
    ("pale grey", (0.80, 0.80, 0.79)),
    ("greige", (0.76, 0.73, 0.68)),
    ("beige", (0.80, 0.74, 0.65)),
    ("taupe", (0.62, 0.57, 0.52)),
    ("sage green", (0.66, 0.70, 0.61)),
    ("mint", (0.78, 0.85, 0.79)),
    ("olive", (0.47, 0.48, 0.36)),
    ("pale blue", (0.74, 0.80, 0.84)),
    ("dusty blue", (0.51, 0.60, 0.66)),
    ("navy blue", (0.16, 0.22, 0.31)),
    ("teal", (0.22, 0.40, 0.42)),
    ("butter yellow", (0.90, 0.84, 0.64)),
    ("ochre", (0.76, 0.59, 0.33)),
    ("terracotta", (0.71, 0.45, 0.34)),
    ("blush pink", (0.86, 0.75, 0.71)),
    ("lavender", (0.75, 0.72, 0.80)),
    ("aubergine", (0.30, 0.20, 0.26)),
    ("charcoal", (0.24, 0.25, 0.26)),
    ("forest green", (0.18, 0.28, 0.23)),
    ("sand", (0.84, 0.79, 0.70)),
    ("peach", (0.89, 0.77, 0.67)),
)
"""Wall colours, sRGB; the first three also for ceilings."""


def wall_materials() -> list[Material]:
    return [*_paints(), *_wallpapers(), *_stones()]


def _paints() -> list[Material]:
    made = []
    for name, c in PAINTS:
        light = sum(c) / 3 > 0.68
        roles = (("wall_paint",) if light else ("accent_paint",)) + (
            ("ceiling",) if name in ("white", "warm white", "ivory") else ()
        )
        if name in ("white", "warm white", "charcoal", "sage green", "pale grey", "ivory", "dusty blue"):
            roles += ("door",)
        made.append(
            Material(
                f"paint_{name.replace(' ', '_')}/0",
                "paint",
                roles,
                f"{name} paint",
                (name.split()[-1],),
                ("paint",),
                1.0,
                512,
                partial(surface.paint, color=c),
                0.3,
            )
        )
    for name, c in (
        ("white", (0.90, 0.89, 0.87)),
        ("cream", (0.87, 0.83, 0.74)),
        ("grey", (0.56, 0.57, 0.58)),
        ("sage green", (0.55, 0.61, 0.53)),
        ("navy blue", (0.15, 0.21, 0.30)),
        ("black", (0.08, 0.08, 0.085)),
        ("red", (0.55, 0.13, 0.12)),
        ("anthracite", (0.21, 0.22, 0.23)),
    ):
        made.append(
            Material(
                f"lacquer_{name.replace(' ', '_')}/0",
                "paint",
                ("cabinet", "door"),
                f"{name} lacquer",
                (name.split()[-1],),
                ("lacquer", "wood"),
                1.0,
                512,
                partial(surface.gloss_paint, color=c),
            )
        )
    for i, (name, c, relief) in enumerate(
        (
            ("white", (0.88, 0.87, 0.85), 1.0),
            ("ochre", (0.80, 0.69, 0.53), 1.0),
            ("grey", (0.66, 0.65, 0.63), 0.7),
            ("rose", (0.80, 0.67, 0.60), 0.8),
        )
    ):
        made.append(
            Material(
                f"plaster_{name}/{0}",
                "plaster",
                ("plaster",) + (("ceiling", "wall_paint") if i == 0 else ("accent_paint",)),
                f"{name} plaster",
                (name,),
                ("plaster",),
                1.5,
                1024,
                partial(surface.plaster, color=c, relief=relief),
                0.25,
            )
        )
    for i, (name, c) in enumerate(
        (("white", (0.86, 0.85, 0.82)), ("cream", (0.83, 0.77, 0.66)), ("grey", (0.68, 0.68, 0.67)))
    ):
        made.append(
            Material(
                f"render_white/{i}",
                "plaster",
                ("facade",),
                f"{name} render",
                (name,),
                ("plaster",),
                2.0,
                1024,
                partial(surface.plaster, color=c, relief=2.5, mottle=0.012),
                0.2,
            )
        )
    return made


def _wallpapers() -> list[Material]:
    table = [
        (
            "striped",
            "stripes",
            [
                ((0.88, 0.86, 0.80), [(0.75, 0.78, 0.75), (0.62, 0.64, 0.60)], w.stripes(8, 0.5, True), "green"),
                ((0.90, 0.88, 0.85), [(0.80, 0.70, 0.68), (0.66, 0.54, 0.52)], w.stripes(6, 0.45, True), "pink"),
                ((0.86, 0.87, 0.88), [(0.70, 0.74, 0.79)], w.stripes(10, 0.5), "blue"),
                ((0.82, 0.78, 0.70), [(0.75, 0.70, 0.61)], w.stripes(12, 0.35), "beige"),
            ],
        ),
        (
            "floral",
            "floral",
            [
                (
                    (0.92, 0.89, 0.82),
                    [(0.55, 0.62, 0.50), (0.78, 0.55, 0.50), (0.85, 0.70, 0.40)],
                    w.floral(6),
                    "cream",
                ),
                (
                    (0.24, 0.32, 0.36),
                    [(0.38, 0.47, 0.42), (0.80, 0.68, 0.60), (0.75, 0.56, 0.30)],
                    w.floral(6, 1.25),
                    "blue",
                ),
                (
                    (0.86, 0.88, 0.89),
                    [(0.62, 0.69, 0.70), (0.70, 0.72, 0.80), (0.90, 0.84, 0.62)],
                    w.floral(7, 0.9),
                    "pale blue",
                ),
            ],
        ),
        (
            "damask",
            "damask",
            [
                ((0.36, 0.42, 0.40), [(0.43, 0.49, 0.46)], w.damask(), "green"),
                ((0.83, 0.79, 0.71), [(0.89, 0.86, 0.79)], w.damask(), "cream"),
                ((0.42, 0.20, 0.22), [(0.50, 0.27, 0.28)], w.damask(), "red"),
                ((0.74, 0.76, 0.78), [(0.81, 0.83, 0.85)], w.damask(2), "grey"),
            ],
        ),
        (
            "geometric",
            "trellis",
            [
                ((0.87, 0.87, 0.84), [(0.66, 0.71, 0.73)], w.trellis(), "grey"),
                ((0.22, 0.30, 0.30), [(0.62, 0.56, 0.42)], w.trellis(8), "dark green"),
                ((0.85, 0.77, 0.66), [(0.94, 0.91, 0.84)], w.trellis(5, 0.14), "beige"),
            ],
        ),
        (
            "scalloped",
            "scallops",
            [
                ((0.15, 0.22, 0.28), [(0.70, 0.59, 0.39)], w.scallops(), "blue"),
                ((0.90, 0.87, 0.82), [(0.75, 0.66, 0.55)], w.scallops(6), "cream"),
                ((0.76, 0.82, 0.79), [(0.93, 0.94, 0.91)], w.scallops(7), "mint"),
            ],
        ),
        (
            "leafy",
            "leaves",
            [
                ((0.93, 0.92, 0.88), [(0.68, 0.74, 0.66), (0.42, 0.52, 0.44)], w.leaves(49), "white"),
                ((0.20, 0.27, 0.24), [(0.34, 0.44, 0.36), (0.50, 0.57, 0.44)], w.leaves(64), "green"),
                ((0.89, 0.86, 0.82), [(0.80, 0.73, 0.66), (0.71, 0.62, 0.54)], w.leaves(36), "beige"),
            ],
        ),
    ]
    made = []
    for name, stem, variants in table:
        for i, (ground, inks, motif, colour) in enumerate(variants):
            made.append(
                Material(
                    f"wallpaper_{stem}/{i}",
                    "wallpaper",
                    ("wallpaper",),
                    f"{colour} {name} wallpaper",
                    (colour.split()[-1],),
                    ("paper",),
                    1.06,
                    1024,
                    partial(w.wallpaper, ground=ground, inks=inks, motif=motif),
                    0.25,
                )
            )
    for i, (colour, c) in enumerate(
        (
            ("straw", (0.76, 0.70, 0.58)),
            ("grey", (0.62, 0.62, 0.59)),
            ("blue", (0.40, 0.47, 0.53)),
            ("ivory", (0.85, 0.82, 0.75)),
        )
    ):
        made.append(
            Material(
                f"grasscloth/{i}",
                "wallpaper",
                ("wallpaper",),
                f"{colour} grasscloth",
                (colour,),
                ("paper", "grass"),
                1.0,
                1024,
                partial(w.grasscloth, color=c),
                0.1,
            )
        )
    return made


def _stones() -> list[Material]:
    m = mineral
    made = []
    for i, (name, c, mortar, painted) in enumerate(
        (
            ("red", (0.57, 0.33, 0.25), (0.70, 0.67, 0.62), False),
            ("brown", (0.46, 0.33, 0.26), (0.62, 0.59, 0.54), False),
            ("yellow", (0.74, 0.63, 0.46), (0.74, 0.71, 0.65), False),
            ("white", (0.90, 0.89, 0.87), (0.9, 0.9, 0.9), True),
        )
    ):
        roles = ("brick", "accent_paint") if painted else ("brick", "facade") if name != "brown" else ("brick",)
        made.append(
            Material(
                f"brick_{name}/0",
                "brick",
                roles,
                f"{name} brick",
                (name,),
                ("brick",),
                1.5,
                1024,
                partial(m.brick, columns=6, rows=20, color=c, mortar=mortar, painted=painted),
                0.2,
            )
        )
    for i, (name, c) in enumerate((("grey", (0.56, 0.54, 0.51)), ("honey", (0.68, 0.59, 0.46)))):
        made.append(
            Material(
                f"rubble/{i}",
                "stone",
                ("stone", "facade"),
                f"{name} stone wall",
                (name,),
                ("stone",),
                2.2,
                1024,
                partial(m.rubble, base=c, across=6),
                0.2,
            )
        )
    for i, (name, c, gloss) in enumerate(
        (
            ("grey", (0.60, 0.59, 0.57), 0.72),
            ("dark", (0.40, 0.40, 0.40), 0.55),
            ("pale", (0.74, 0.73, 0.70), 0.6),
            ("warm", (0.66, 0.62, 0.56), 0.5),
        )
    ):
        made.append(
            Material(
                f"concrete/{i}",
                "concrete",
                ("concrete", "floor_tile") if i else ("concrete",),
                f"{name} concrete",
                (name.replace("pale", "white").replace("warm", "beige").replace("dark", "grey"),),
                ("concrete",),
                2.4,
                1024,
                partial(m.concrete, base=c, gloss=gloss),
            )
        )
    for i, (name, base, vein) in enumerate(
        (
            ("white", (0.92, 0.91, 0.90), (0.54, 0.54, 0.56)),
            ("black", (0.08, 0.08, 0.09), (0.66, 0.64, 0.62)),
            ("green", (0.16, 0.25, 0.21), (0.62, 0.68, 0.63)),
            ("cream", (0.86, 0.80, 0.71), (0.72, 0.61, 0.49)),
        )
    ):
        made.append(
            Material(
                f"marble/{i}",
                "stone",
                ("worktop", "stone"),
                f"{name} marble",
                (name,),
                ("marble", "stone"),
                1.8,
                1024,
                _slab(m.marble(base, vein), 0.10),
            )
        )
    for i, (name, colors, weights) in enumerate(
        (
            ("black", [(0.06, 0.06, 0.065), (0.20, 0.20, 0.20), (0.46, 0.45, 0.43)], [0.8, 0.0, -0.9]),
            (
                "grey",
                [(0.58, 0.57, 0.55), (0.36, 0.36, 0.36), (0.12, 0.12, 0.12), (0.78, 0.77, 0.74)],
                [0.4, 0.1, -0.7, -0.2],
            ),
            ("brown", [(0.45, 0.32, 0.24), (0.20, 0.15, 0.13), (0.62, 0.50, 0.40)], [0.4, 0.1, -0.3]),
        )
    ):
        made.append(
            Material(
                f"granite/{i}",
                "stone",
                ("worktop", "stone"),
                f"{name} granite",
                (name,),
                ("granite", "stone"),
                0.8,
                1024,
                partial(m.granite, colors=colors, weights=weights),
            )
        )
    for i, (name, colors, weights) in enumerate(
        (
            ("white", [(0.88, 0.875, 0.86), (0.80, 0.79, 0.78), (0.66, 0.65, 0.64)], [1.2, -0.2, -1.0]),
            ("grey", [(0.50, 0.50, 0.50), (0.58, 0.58, 0.57), (0.38, 0.38, 0.38)], [1.0, -0.2, -0.8]),
            ("sand", [(0.77, 0.71, 0.62), (0.70, 0.63, 0.54), (0.84, 0.80, 0.73)], [1.0, -0.3, -0.6]),
        )
    ):
        made.append(
            Material(
                f"quartz/{i}",
                "stone",
                ("worktop",),
                f"{name} quartz",
                (name,),
                ("quartz", "stone"),
                0.6,
                1024,
                partial(m.granite, colors=colors, weights=weights, grain=0.0022, gloss=0.14),
            )
        )
    for i, (name, base, chips) in enumerate(
        (
            (
                "white",
                (0.85, 0.83, 0.80),
                [(0.50, 0.45, 0.40), (0.32, 0.32, 0.32), (0.74, 0.60, 0.50), (0.94, 0.93, 0.90)],
            ),
            ("grey", (0.56, 0.56, 0.55), [(0.30, 0.30, 0.30), (0.80, 0.79, 0.76), (0.68, 0.64, 0.58)]),
            ("green", (0.60, 0.66, 0.60), [(0.86, 0.85, 0.80), (0.34, 0.42, 0.36), (0.70, 0.60, 0.48)]),
        )
    ):
        made.append(
            Material(
                f"terrazzo/{i}",
                "stone",
                ("floor_tile", "worktop"),
                f"{name} terrazzo",
                (name,),
                ("terrazzo", "stone"),
                1.2,
                1024,
                partial(m.terrazzo, base=base, chips=chips),
            )
        )
    return made


def _slab(face, gloss: float):
    return partial(mineral.slab, surface=face, gloss=gloss)
