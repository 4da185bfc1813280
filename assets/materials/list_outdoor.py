"""What is seen through the windows: grass, leaves, roofs, gravel."""

from __future__ import annotations

from functools import partial

from assets.materials import maps, mineral, textile
from assets.materials.material import Material


def outdoor_materials() -> list[Material]:
    pile = textile.pile
    made = [
        Material(
            "lawn/0",
            "plant",
            ("outdoor",),
            "lawn",
            ("green",),
            ("grass",),
            3.0,
            1024,
            partial(pile, color=(0.33, 0.42, 0.19), second=(0.25, 0.34, 0.13), loop=0.012, depth=0.30, tracks=0.05),
            0.05,
        ),
        Material(
            "lawn/1",
            "plant",
            ("outdoor",),
            "dry lawn",
            ("green", "yellow"),
            ("grass",),
            3.0,
            1024,
            partial(pile, color=(0.47, 0.46, 0.24), second=(0.33, 0.39, 0.18), loop=0.012, depth=0.28, tracks=0.06),
            0.05,
        ),
        Material(
            "foliage/0",
            "plant",
            ("outdoor",),
            "leaves",
            ("green",),
            ("plant",),
            1.6,
            512,
            partial(pile, color=(0.28, 0.38, 0.15), second=(0.13, 0.21, 0.08), loop=0.030, depth=0.55, tracks=0.08),
            0.1,
        ),
        Material(
            "foliage/1",
            "plant",
            ("outdoor",),
            "dark leaves",
            ("green",),
            ("plant",),
            1.6,
            512,
            partial(pile, color=(0.18, 0.28, 0.14), second=(0.08, 0.14, 0.07), loop=0.026, depth=0.55, tracks=0.08),
            0.1,
        ),
        Material(
            "gravel/0",
            "stone",
            ("outdoor", "outdoor_floor"),
            "gravel",
            ("grey",),
            ("stone",),
            1.5,
            1024,
            partial(
                mineral.granite,
                colors=[(0.60, 0.57, 0.52), (0.48, 0.46, 0.43), (0.70, 0.66, 0.60)],
                weights=[0.3, 0.2, 0.0],
                grain=0.016,
                gloss=0.9,
            ),
            0.2,
        ),
    ]
    for i, (name, base, pale) in enumerate(
        (("red", (0.55, 0.28, 0.20), (0.66, 0.38, 0.28)), ("grey", (0.28, 0.28, 0.29), (0.36, 0.36, 0.37)))
    ):
        made.append(
            Material(
                f"roof_tiles/{i}",
                "tile",
                ("outdoor",),
                f"{name} roof tiles",
                (name,),
                ("clay",),
                2.4,
                512,
                partial(
                    mineral.tiles,
                    layout=partial(maps.bricks, columns=10, rows=8, shift=0.5),
                    surface=mineral.terracotta(base, pale),
                    grout=(0.16, 0.13, 0.12),
                    joint=0.014,
                    tone=0.08,
                    gloss=0.8,
                ),
                0.2,
            )
        )
    return made
