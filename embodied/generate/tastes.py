"""What each style of a house chooses its floors, walls, doors and papers from.

Names of materials only ('oak_planks/0'); assets.materials makes them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Taste:
    """What a style chooses from: material keys."""

    woods: tuple[str, ...]
    stones: tuple[str, ...]
    """Tile and stone floors of hall, kitchen and sun room."""
    carpets: tuple[str, ...]
    walls: tuple[str, ...]
    """Light colours; a house takes three."""
    accents: tuple[str, ...]
    papers: tuple[str, ...]
    wet_floors: tuple[str, ...]
    wet_walls: tuple[str, ...]
    doors: tuple[str, ...]
    front_doors: tuple[str, ...]
    frames: tuple[str, ...] = ("paint_white/0",)
    ceilings: tuple[str, ...] = ("paint_white/0", "paint_white/0", "plaster_white/0")


def _all(stem: str, count: int) -> tuple[str, ...]:
    return tuple(f"{stem}/{k}" for k in range(count))


TASTES: Mapping[str, Taste] = {
    "light": Taste(
        woods=(
            "light_oak_planks/0",
            "ash_planks/0",
            "light_oak_herringbone/0",
            "maple_planks/0",
            "ash_chevron/0",
            "beech_strips/0",
            "light_oak_laminate/0",
        ),
        stones=("stoneware_tiles/3", "stoneware_tiles/0", "terrazzo/0", "long_stoneware_tiles/3"),
        carpets=("carpet/0", "carpet/2", "sisal/0"),
        walls=(
            "paint_white/0",
            "paint_warm_white/0",
            "paint_pale_grey/0",
            "paint_ivory/0",
            "paint_pale_blue/0",
            "paint_mint/0",
        ),
        accents=("paint_dusty_blue/0", "paint_sage_green/0", "paint_blush_pink/0", "paint_taupe/0", "brick_white/0"),
        papers=("grasscloth/1", "wallpaper_leaves/0", "wallpaper_scallops/2", "wallpaper_stripes/2"),
        wet_floors=("stoneware_tiles/3", "hex_tiles/1", "hex_tiles/0", "terrazzo/0", "marble_tiles/0"),
        wet_walls=("metro_tiles/0", "square_tiles/0", "mosaic_tiles/1", "long_stoneware_tiles/3", "square_tiles/2"),
        doors=("paint_white/0", "paint_white/0", "ash/0", "light_oak/0", "beech/0"),
        front_doors=("paint_dusty_blue/0", "paint_sage_green/0", "light_oak/0", "paint_charcoal/0"),
    ),
    "warm": Taste(
        woods=(
            "oak_planks/0",
            "oak_planks/1",
            "oak_herringbone/0",
            "pine_planks/0",
            "cherry_planks/0",
            "oak_strips/0",
            "oak_mosaic_parquet/0",
        ),
        stones=("terracotta_tiles/0", "terracotta_tiles/1", "travertine_tiles/0", "stoneware_tiles/1", "slate_tiles/0"),
        carpets=("carpet/0", "carpet/7", "sisal/0"),
        walls=(
            "paint_warm_white/0",
            "paint_ivory/0",
            "paint_sand/0",
            "paint_beige/0",
            "paint_peach/0",
            "plaster_white/0",
            "paint_butter_yellow/0",
        ),
        accents=(
            "paint_terracotta/0",
            "paint_olive/0",
            "plaster_ochre/0",
            "brick_red/0",
            "paint_ochre/0",
            "plaster_rose/0",
        ),
        papers=("wallpaper_leaves/2", "grasscloth/0", "wallpaper_trellis/2", "wallpaper_floral/0"),
        wet_floors=("travertine_tiles/0", "stoneware_tiles/1", "hex_tiles/2", "terracotta_tiles/0"),
        wet_walls=("square_tiles/1", "travertine_tiles/0", "metro_tiles/0", "long_stoneware_tiles/1", "metro_tiles/1"),
        doors=("oak/0", "pine/0", "paint_ivory/0", "paint_warm_white/0", "beech/0"),
        front_doors=("oak/0", "paint_sage_green/0", "mahogany/0", "cherry/0"),
        frames=("paint_white/0", "oak/0", "paint_ivory/0"),
    ),
    "dark": Taste(
        woods=(
            "walnut_planks/0",
            "smoked_oak_planks/0",
            "walnut_chevron/0",
            "smoked_oak_herringbone/0",
            "grey_oak_planks/0",
            "wenge_planks/0",
            "grey_oak_chevron/0",
        ),
        stones=("concrete/1", "stoneware_tiles/2", "slate_tiles/0", "marble_tiles/2", "long_stoneware_tiles/2"),
        carpets=("carpet/1", "carpet/3", "sisal/1"),
        walls=("paint_white/0", "paint_pale_grey/0", "paint_greige/0", "plaster_white/0", "paint_warm_white/0"),
        accents=(
            "paint_charcoal/0",
            "paint_navy_blue/0",
            "paint_forest_green/0",
            "plaster_grey/0",
            "paint_aubergine/0",
            "brick_brown/0",
        ),
        papers=("grasscloth/2", "wallpaper_damask/3", "wallpaper_trellis/0", "wallpaper_scallops/0"),
        wet_floors=("stoneware_tiles/2", "slate_tiles/0", "marble_tiles/2", "concrete/1", "hex_tiles/0"),
        wet_walls=("marble_tiles/2", "long_stoneware_tiles/0", "metro_tiles/4", "metro_tiles/0", "mosaic_tiles/2"),
        doors=("paint_white/0", "walnut/0", "smoked_oak/0", "paint_charcoal/0", "grey_oak/0"),
        front_doors=("paint_charcoal/0", "walnut/0", "lacquer_black/0"),
        frames=("paint_white/0", "lacquer_anthracite/0"),
    ),
    "classic": Taste(
        woods=(
            "oak_herringbone/0",
            "oak_basket/0",
            "walnut_herringbone/0",
            "mahogany_basket/0",
            "oak_chevron/0",
            "cherry_planks/0",
        ),
        stones=("marble_tiles/1", "checker_tiles/0", "marble_tiles/0", "travertine_tiles/0"),
        carpets=("carpet/2", "carpet/5", "carpet/6", "carpet/4"),
        walls=("paint_ivory/0", "paint_warm_white/0", "paint_beige/0", "paint_greige/0", "paint_sand/0"),
        accents=(
            "wallpaper_damask/0",
            "wallpaper_damask/1",
            "wallpaper_stripes/3",
            "paint_forest_green/0",
            "paint_navy_blue/0",
        ),
        papers=(
            "wallpaper_damask/1",
            "wallpaper_stripes/0",
            "wallpaper_stripes/3",
            "wallpaper_floral/1",
            "wallpaper_trellis/1",
            "wallpaper_damask/2",
        ),
        wet_floors=("marble_tiles/0", "marble_tiles/1", "checker_tiles/0", "hex_tiles/1"),
        wet_walls=("marble_tiles/0", "square_tiles/0", "metro_tiles/0", "square_tiles/1", "marble_tiles/1"),
        doors=("paint_white/0", "paint_ivory/0", "mahogany/0", "oak/0"),
        front_doors=("mahogany/0", "lacquer_black/0", "paint_dusty_blue/0", "oak/0"),
    ),
    "colourful": Taste(
        woods=(
            "oak_planks/2",
            "maple_strips/0",
            "teak_narrow_planks/0",
            "beech_narrow_planks/0",
            "teak_mosaic_parquet/0",
            "pine_narrow_planks/0",
            "oak_small_herringbone/0",
        ),
        stones=("terrazzo/2", "hex_tiles/3", "terrazzo/1", "checker_tiles/0", "stoneware_tiles/3"),
        carpets=("carpet/4", "carpet/6", "carpet/1"),
        walls=(
            "paint_white/0",
            "paint_warm_white/0",
            "paint_mint/0",
            "paint_blush_pink/0",
            "paint_pale_blue/0",
            "paint_butter_yellow/0",
            "paint_lavender/0",
            "paint_peach/0",
        ),
        accents=(
            "paint_teal/0",
            "paint_ochre/0",
            "paint_terracotta/0",
            "paint_dusty_blue/0",
            "paint_aubergine/0",
            "paint_olive/0",
        ),
        papers=(
            "wallpaper_scallops/0",
            "wallpaper_floral/2",
            "wallpaper_leaves/1",
            "wallpaper_stripes/1",
            "wallpaper_scallops/1",
        ),
        wet_floors=("hex_tiles/3", "terrazzo/2", "terrazzo/0", "hex_tiles/1", "stoneware_tiles/0"),
        wet_walls=(
            "metro_tiles/1",
            "metro_tiles/2",
            "metro_tiles/3",
            "mosaic_tiles/0",
            "square_tiles/3",
            "mosaic_tiles/3",
        ),
        doors=("paint_white/0", "maple/0", "paint_sage_green/0", "paint_dusty_blue/0"),
        front_doors=("lacquer_red/0", "lacquer_navy_blue/0", "paint_sage_green/0", "teak/0"),
    ),
}
"""Style name to taste; the names are those of embodied.house.validation.STYLES."""
ROUGH = ("concrete/0", "concrete/1", "concrete/3")
"""Floors of garages and workshops, whatever the style."""
KIDS = (
    "paint_mint/0",
    "paint_pale_blue/0",
    "paint_butter_yellow/0",
    "paint_blush_pink/0",
    "paint_lavender/0",
    "paint_peach/0",
)
KIDS_PAPERS = (*_all("wallpaper_scallops", 3), "wallpaper_stripes/1", "wallpaper_stripes/2", "wallpaper_leaves/0")
"""Walls of children's rooms and their accents, whatever the style."""
