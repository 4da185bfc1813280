"""One palette per house, and what each room wears of it: floors, walls, doors, an accent wall here and there.

Names of materials only ('oak_planks/0'); assets.materials makes them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import shapely

from embodied.generate.kinds import BEDROOMS
from embodied.house.house import House, HouseError, Room
from embodied.house.validation import STYLES

WET = ("bathroom", "toilet", "laundry_room")
TALK = ("living_room", "dining_room", "family_room", "hall", "corridor", "library", "study")


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
KIDS = (
    "paint_mint/0",
    "paint_pale_blue/0",
    "paint_butter_yellow/0",
    "paint_blush_pink/0",
    "paint_lavender/0",
    "paint_peach/0",
)
KIDS_PAPERS = (*_all("wallpaper_scallops", 3), "wallpaper_stripes/1", "wallpaper_stripes/2", "wallpaper_leaves/0")


@dataclass(frozen=True)
class Palette:
    """Material keys of a whole house."""

    style: str
    floor: str
    """Of the rooms one talks in."""
    hall_floor: str
    kitchen_floor: str
    private_floor: str
    wet_floors: tuple[str, ...]
    rough_floor: str
    walls: tuple[str, ...]
    wet_walls: tuple[str, ...]
    accents: tuple[str, ...]
    papers: tuple[str, ...]
    ceiling: str
    skirting: str
    door: str
    front_door: str
    frame: str
    boldness: float
    """How often a room has an accent wall."""


def draw_palette(style: str | None, *, rng: np.random.Generator) -> Palette:
    """The palette of one house in `style`, or in a style drawn.

    Raises:
      HouseError: an unknown style.
    """
    if style is not None and style not in STYLES:
        raise HouseError(f"style should be one of {STYLES}, got {style!r}")
    name = style or str(rng.choice(STYLES))
    taste = TASTES[name]
    floor, stone = _one(taste.woods, rng), _one(taste.stones, rng)
    if rng.random() < 0.1:
        floor = stone
    soft = float(rng.random())
    private = floor if soft < 0.5 else _one(taste.carpets, rng) if soft < 0.75 else _one(taste.woods, rng)
    kitchen = floor if rng.random() < 0.45 else stone
    hall = floor if rng.random() < 0.6 else stone
    door = _one(taste.doors, rng)
    frame = _one(taste.frames, rng)
    return Palette(
        style=name,
        floor=floor,
        hall_floor=hall,
        kitchen_floor=kitchen,
        private_floor=private,
        wet_floors=_some(taste.wet_floors, 2, rng),
        rough_floor=_one(ROUGH, rng),
        walls=_some(taste.walls, 3, rng),
        wet_walls=_some(taste.wet_walls, 2, rng),
        accents=_some(taste.accents, 2, rng),
        papers=_some(taste.papers, 2, rng),
        ceiling=_one(taste.ceilings, rng),
        skirting="paint_white/0" if "paint" in door or rng.random() < 0.5 else door,
        door=door,
        front_door=_one(taste.front_doors, rng),
        frame=frame,
        boldness=float(rng.uniform(0.1, 0.6)),
    )


def dressed(house: House, palette: Palette, *, rng: np.random.Generator) -> House:
    """The house with every room's finishes."""
    rooms = []
    nth: dict[str, int] = {}
    for room in house.rooms:
        nth[room.kind] = nth.get(room.kind, -1) + 1
        floor, wall = _floor(room, house, palette), _wall(room, palette, nth[room.kind], rng)
        accent, accent_finish = _accent(room, house, palette, rng)
        skirting = palette.skirting if room.kind not in (*WET, "garage") else floor
        ceiling = "paint_white/0" if room.kind in (*WET, "garage") else palette.ceiling
        rooms.append(
            dataclasses.replace(
                room,
                floor_finish=floor,
                wall_finish=wall,
                ceiling_finish=ceiling,
                skirting_finish=skirting,
                accent_wall=accent,
                accent_finish=accent_finish,
            )
        )
    return dataclasses.replace(house, rooms=tuple(rooms))


def _one(keys: tuple[str, ...], rng: np.random.Generator) -> str:
    return keys[int(rng.integers(len(keys)))]


def _some(keys: tuple[str, ...], count: int, rng: np.random.Generator) -> tuple[str, ...]:
    return tuple(keys[k] for k in rng.permutation(len(keys))[:count])


def _floor(room: Room, house: House, palette: Palette) -> str:
    kind = room.kind
    if kind in WET:
        return palette.wet_floors[0 if kind != "laundry_room" else -1]
    if kind in ("garage", "workshop"):
        return palette.rough_floor
    if kind in ("kitchen", "pantry"):
        return palette.kitchen_floor
    if kind in ("hall", "corridor"):
        return palette.hall_floor
    if kind == "sun_room":
        return palette.kitchen_floor
    if kind == "closet":
        inside = next(
            (
                o.rooms[1] if o.rooms[0] == room.id else o.rooms[0]
                for o in house.openings
                if room.id in o.rooms and o.rooms[1] is not None
            ),
            None,
        )
        other = house.room_by_id[inside].kind if inside else "corridor"
        return (
            palette.private_floor
            if other in BEDROOMS
            else palette.hall_floor
            if other in ("hall", "corridor")
            else (palette.floor)
        )
    return palette.private_floor if kind in (*BEDROOMS, "playroom", "gym") else palette.floor


def _wall(room: Room, palette: Palette, nth: int, rng: np.random.Generator) -> str:
    kind = room.kind
    if kind in ("bathroom", "toilet"):
        return palette.wet_walls[nth % len(palette.wet_walls)]
    if kind in ("garage", "workshop", "laundry_room", "pantry", "closet"):
        return "paint_white/0"
    if kind == "kids_room":
        return _one(KIDS, rng)
    if kind in TALK or kind in ("kitchen", "sun_room"):
        return palette.walls[0]
    if palette.style == "classic" and kind in BEDROOMS and rng.random() < 0.3:
        return _one(palette.papers, rng)
    return palette.walls[1 + nth % (len(palette.walls) - 1)]


def _accent(room: Room, house: House, palette: Palette, rng: np.random.Generator) -> tuple[int | None, str | None]:
    """An edge without doors or windows, not a short one, and what it wears; (None, None) in most rooms."""
    kinds = (*BEDROOMS, "living_room", "dining_room", "family_room", "study", "library", "playroom")
    chance, pick, paper = (float(x) for x in rng.random(3))
    if room.kind not in kinds or chance > palette.boldness:
        return None, None
    corners = [*room.polygon, room.polygon[0]]
    openings = [shapely.LineString([o.a, o.b]) for o in house.openings if room.id in o.rooms]
    walls = []
    for k in range(len(room.polygon)):
        edge = shapely.LineString(corners[k : k + 2]).buffer(1e-3)
        if not any(edge.covers(o) for o in openings) and math.dist(corners[k], corners[k + 1]) > 2.2:
            walls.append(k)
    if not walls:
        return None, None
    if room.kind == "kids_room":
        return walls[int(pick * len(walls))], KIDS_PAPERS[int(paper * len(KIDS_PAPERS))]
    choice = palette.papers if paper < 0.4 and room.kind in BEDROOMS else palette.accents
    return walls[int(pick * len(walls))], choice[int(pick * 997) % len(choice)]
