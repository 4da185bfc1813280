"""The materials of floors and tiled walls, and wood for things."""

from __future__ import annotations

from functools import partial

import numpy as np

from assets.materials import maps, mineral, wood
from assets.materials.maps import Maps
from assets.materials.material import Material


def floor_materials() -> list[Material]:
    return [*_floors_wood(), *_tiles(), *_woods()]


def _floors_wood() -> list[Material]:
    plank = partial(maps.planks, rows=14, per_row=1.2)
    wide = partial(maps.planks, rows=13, per_row=1.0)
    strip = partial(maps.planks, rows=30, per_row=3.5)
    bone, small_bone = partial(maps.herringbone, ratio=6, repeats=3), partial(maps.herringbone, ratio=5, repeats=5)
    chevron = partial(maps.chevron, columns=4, boards=18)
    basket, fingers = partial(maps.basket, squares=8, strips=5), partial(maps.basket, squares=14, strips=5)
    tints = {
        "oak": "brown",
        "light oak": "beige",
        "grey oak": "grey",
        "smoked oak": "dark brown",
        "walnut": "dark brown",
        "maple": "beige",
        "ash": "beige",
        "pine": "yellow",
        "wenge": "black",
        "beech": "light brown",
        "cherry": "reddish brown",
        "teak": "brown",
        "mahogany": "reddish brown",
    }
    table = [
        (
            "planks",
            wide,
            2.4,
            ("oak", "light oak", "grey oak", "walnut", "maple", "ash", "pine", "wenge", "smoked oak", "cherry"),
            0.40,
        ),
        ("narrow_planks", plank, 1.9, ("oak", "maple", "teak", "pine", "beech"), 0.36),
        ("strips", strip, 2.1, ("oak", "beech", "maple", "ash"), 0.32),
        ("herringbone", bone, 1.87, ("oak", "light oak", "walnut", "smoked oak"), 0.36),
        ("small_herringbone", small_bone, 1.8, ("oak", "ash", "wenge"), 0.34),
        ("chevron", chevron, 2.2, ("oak", "grey oak", "ash", "walnut"), 0.38),
        ("basket", basket, 2.4, ("oak", "mahogany"), 0.35),
        ("mosaic_parquet", fingers, 1.68, ("oak", "teak"), 0.33),
        (
            "laminate",
            partial(maps.planks, rows=12, per_row=1.6, regular=True),
            2.3,
            ("light oak", "grey oak", "oak"),
            0.45,
        ),
    ]
    made = []
    for pattern, layout, tile, species, gloss in table:
        for k in species:
            stem = k.replace(" ", "_")
            gap = 0.0006 if pattern in ("laminate", "strips", "herringbone", "chevron") else 0.0012
            made.append(
                Material(
                    f"{stem}_{pattern}/0",
                    "wood",
                    ("floor_wood",),
                    f"{k} {pattern.replace('_', ' ')}",
                    (tints[k],),
                    ("wood", k.split()[-1]),
                    tile,
                    1024,
                    partial(wood.floor, layout=layout, species=k, gloss=gloss, groove=gap),
                )
            )
    made.append(
        Material(
            "oak_planks/1",
            "wood",
            ("floor_wood",),
            "honey oak planks",
            ("brown",),
            ("wood", "oak"),
            2.0,
            1024,
            partial(wood.floor, layout=partial(maps.planks, rows=12, per_row=1.1), species="oak", gloss=0.34),
        )
    )
    made.append(
        Material(
            "oak_planks/2",
            "wood",
            ("floor_wood",),
            "wide oak planks",
            ("brown",),
            ("wood", "oak"),
            2.6,
            1024,
            partial(wood.floor, layout=partial(maps.planks, rows=12, per_row=0.9), species="oak", gloss=0.42),
        )
    )
    return made


def _woods() -> list[Material]:
    tints = {
        "oak": "brown",
        "light oak": "beige",
        "smoked oak": "dark brown",
        "walnut": "dark brown",
        "maple": "beige",
        "ash": "beige",
        "pine": "yellow",
        "wenge": "black",
        "beech": "light brown",
        "cherry": "reddish brown",
        "teak": "brown",
        "mahogany": "reddish brown",
        "grey oak": "grey",
    }
    made = []
    for k, tint in tints.items():
        roles = ("wood", "door", "cabinet") if k not in ("wenge", "teak") else ("wood",)
        made.append(
            Material(
                f"{k.replace(' ', '_')}/0",
                "wood",
                roles,
                k,
                (tint,),
                ("wood", k.split()[-1]),
                1.0,
                1024,
                partial(wood.furniture, species=k),
            )
        )
    for k in ("oak", "walnut", "beech"):
        made.append(
            Material(
                f"{k}_worktop/0",
                "wood",
                ("worktop",),
                f"{k} worktop",
                (tints[k],),
                ("wood", k),
                1.2,
                1024,
                partial(wood.furniture, species=k, strips=24, gloss=0.36),
            )
        )
    return made


def _tiles() -> list[Material]:
    grid = maps.bricks

    def tile(key, name, colours, words, size, layout, face, roles, pixels=1024, **how):
        return Material(
            key,
            "tile",
            roles,
            name,
            colours,
            words,
            size,
            pixels,
            partial(mineral.tiles, layout=layout, surface=face, **how),
        )

    both, wall, ground = ("floor_tile", "wall_tile"), ("wall_tile",), ("floor_tile",)
    white, cream, grey = (0.90, 0.90, 0.88), (0.87, 0.83, 0.74), (0.66, 0.66, 0.65)
    made = []
    for i, (name, c) in enumerate(
        (("white", white), ("cream", cream), ("light grey", (0.76, 0.76, 0.75)), ("pale blue", (0.72, 0.79, 0.82)))
    ):
        made.append(
            tile(
                f"square_tiles/{i}",
                f"{name} square tiles",
                (name.split()[-1],),
                ("ceramic",),
                1.2,
                partial(grid, columns=6, rows=6),
                mineral.glaze(c),
                wall,
                gloss=0.12,
                joint=0.0025,
            )
        )
    for i, (name, c) in enumerate(
        (
            ("grey", grey),
            ("beige", (0.75, 0.70, 0.62)),
            ("anthracite", (0.29, 0.29, 0.30)),
            ("white", (0.84, 0.83, 0.81)),
        )
    ):
        made.append(
            tile(
                f"stoneware_tiles/{i}",
                f"{name} stoneware tiles",
                (name,),
                ("stoneware",),
                2.4,
                partial(grid, columns=4, rows=4),
                mineral.matt(c),
                both,
                gloss=0.38,
                grout=tuple(0.85 * x for x in c),
            )
        )
        made.append(
            tile(
                f"long_stoneware_tiles/{i}",
                f"{name} rectangular tiles",
                (name,),
                ("stoneware",),
                2.4,
                partial(grid, columns=2, rows=4, shift=0.5),
                mineral.matt(c),
                both,
                gloss=0.42,
                joint=0.002,
                grout=tuple(0.8 * x for x in c),
            )
        )
    for i, (name, c) in enumerate(
        (
            ("white", (0.92, 0.92, 0.90)),
            ("sage green", (0.55, 0.62, 0.54)),
            ("navy blue", (0.13, 0.20, 0.30)),
            ("blush", (0.82, 0.68, 0.63)),
            ("black", (0.10, 0.10, 0.11)),
        )
    ):
        made.append(
            tile(
                f"metro_tiles/{i}",
                f"{name} metro tiles",
                (name.split()[-1],),
                ("ceramic",),
                0.9,
                partial(grid, columns=6, rows=12, shift=0.5),
                mineral.glaze(c, 0.02),
                wall,
                gloss=0.07,
                bevel=0.006,
                tone=0.018,
                waviness=1.5e-4,
            )
        )
    for i, (name, c) in enumerate(
        (
            ("grey", (0.68, 0.67, 0.65)),
            ("white", (0.88, 0.87, 0.85)),
            ("sand", (0.77, 0.70, 0.60)),
            ("teal", (0.24, 0.42, 0.43)),
        )
    ):
        made.append(
            tile(
                f"hex_tiles/{i}",
                f"{name} hexagonal tiles",
                (name,),
                ("cement",),
                1.26,
                partial(maps.hexagons, columns=7),
                mineral.matt(c),
                both,
                gloss=0.45,
                tone=0.03,
            )
        )
    for i, (name, c) in enumerate(
        (
            ("turquoise", (0.52, 0.68, 0.69)),
            ("white", (0.88, 0.89, 0.88)),
            ("grey", (0.52, 0.53, 0.54)),
            ("green", (0.40, 0.52, 0.42)),
        )
    ):
        made.append(
            tile(
                f"mosaic_tiles/{i}",
                f"{name} mosaic",
                (name,),
                ("glass",),
                0.6,
                partial(grid, columns=24, rows=24),
                mineral.glaze(c, 0.03),
                wall,
                pixels=1024,
                gloss=0.08,
                joint=0.002,
                tone=0.08,
            )
        )
    for i, (name, base, vein) in enumerate(
        (
            ("white", (0.92, 0.91, 0.90), (0.52, 0.52, 0.54)),
            ("cream", (0.87, 0.81, 0.72), (0.74, 0.64, 0.52)),
            ("grey", (0.60, 0.60, 0.60), (0.86, 0.86, 0.85)),
            ("black", (0.09, 0.09, 0.10), (0.70, 0.68, 0.66)),
        )
    ):
        made.append(
            tile(
                f"marble_tiles/{i}",
                f"{name} marble tiles",
                (name,),
                ("marble", "stone"),
                2.4,
                partial(grid, columns=4, rows=4),
                mineral.marble(base, vein),
                both,
                gloss=0.12,
                joint=0.0015,
                tone=0.02,
                grout=tuple(0.88 * x for x in base),
            )
        )
    made.append(
        tile(
            "terracotta_tiles/0",
            "terracotta tiles",
            ("orange",),
            ("terracotta",),
            1.5,
            partial(grid, columns=5, rows=5),
            mineral.terracotta(),
            ("floor_tile", "outdoor_floor"),
            gloss=0.68,
            joint=0.008,
            tone=0.05,
        )
    )
    made.append(
        tile(
            "terracotta_tiles/1",
            "terracotta hexagons",
            ("orange",),
            ("terracotta",),
            1.4,
            partial(maps.hexagons, columns=7),
            mineral.terracotta((0.66, 0.40, 0.28), (0.76, 0.54, 0.40)),
            ground,
            gloss=0.65,
            joint=0.006,
            tone=0.06,
        )
    )
    made.append(
        tile(
            "slate_tiles/0",
            "slate tiles",
            ("dark grey",),
            ("slate", "stone"),
            1.8,
            partial(grid, columns=3, rows=6, shift=0.5),
            mineral.slate((0.27, 0.29, 0.31)),
            ("floor_tile", "wall_tile", "outdoor_floor"),
            gloss=0.58,
            joint=0.005,
            tone=0.07,
            grout=(0.38, 0.38, 0.37),
        )
    )
    made.append(
        tile(
            "slate_tiles/1",
            "green slate tiles",
            ("green",),
            ("slate", "stone"),
            2.4,
            partial(grid, columns=6, rows=6),
            mineral.slate((0.32, 0.36, 0.33)),
            ground,
            gloss=0.55,
            joint=0.005,
            tone=0.045,
            grout=(0.45, 0.45, 0.42),
        )
    )
    made.append(
        tile(
            "travertine_tiles/0",
            "travertine tiles",
            ("beige",),
            ("travertine", "stone"),
            1.8,
            partial(grid, columns=3, rows=4, shift=0.5),
            mineral.travertine(),
            both,
            gloss=0.35,
            joint=0.003,
            tone=0.03,
            grout=(0.74, 0.68, 0.58),
        )
    )
    made.append(
        tile(
            "paving/0",
            "concrete paving",
            ("grey",),
            ("concrete",),
            2.0,
            partial(grid, columns=4, rows=4),
            mineral.matt((0.60, 0.59, 0.57), 0.05, 0.03),
            ("outdoor_floor",),
            gloss=0.85,
            joint=0.006,
            tone=0.04,
            grout=(0.42, 0.41, 0.38),
        )
    )
    made.append(
        Material(
            "checker_tiles/0",
            "tile",
            both,
            "black and white tiles",
            ("black", "white"),
            ("ceramic",),
            1.2,
            1024,
            _checker,
        )
    )
    return made


def _checker(n: int, tile: float, *, rng) -> Maps:
    """Black and white squares, 0.2 m."""
    layout = partial(maps.bricks, columns=6, rows=6)
    made = mineral.tiles(n, tile, layout, mineral.glaze((0.86, 0.85, 0.82), 0.015), tone=0.015, gloss=0.2, rng=rng)
    u, v = maps.coordinates(n, tile)
    black = ((u // (tile / 6) + v // (tile / 6)) % 2 == 1)[..., None]
    joint = (layout(n, tile).edge < 0.0015)[..., None]
    color = made.color.copy()
    dark = color * [0.10, 0.10, 0.105] + 0.01
    return Maps(np.where(black & ~joint, dark, color).astype("float32"), made.height, made.roughness)
