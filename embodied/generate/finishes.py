"""One palette per house, and the materials each room has of it: floors, walls, doors, an accent wall here and there.

Names of materials only ('oak_planks/0'); embodied.assets.materials makes them.
"""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import shapely

from embodied.generate.access import MOVING
from embodied.generate.novelty import FINISH_TABLE, finishes_of, styles_of
from embodied.generate.program import BEDROOMS
from embodied.house.house import House, Room

WET = ("bathroom", "toilet", "laundry_room")
TALK = ("living_room", "dining_room", "family_room", *MOVING, "library", "study")


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


def draw_palette(style: str | None, novelty: str | None = None, *, rng: np.random.Generator) -> Palette:
    """The palette of one house in `style`, or in a style drawn from those of its novelty."""
    name = style or str(rng.choice(styles_of(novelty)))
    finishes = finishes_of(name, novelty)
    floor, stone = _one(finishes.woods, rng), _one(finishes.stones, rng)
    if rng.random() < 0.1:
        floor = stone
    soft = float(rng.random())
    return Palette(  # drawn in this order
        style=name,
        floor=floor,
        private_floor=floor
        if soft < 0.5
        else _one(finishes.carpets, rng)
        if soft < 0.75
        else _one(finishes.woods, rng),
        kitchen_floor=floor if rng.random() < 0.45 else stone,
        hall_floor=floor if rng.random() < 0.6 else stone,
        door=(door := _one(finishes.doors, rng)),
        frame=_one(finishes.frames, rng),
        wet_floors=_some(finishes.wet_floors, 2, rng),
        rough_floor=_one(FINISH_TABLE.rough, rng),
        walls=_some(finishes.walls, 3, rng),
        wet_walls=_some(finishes.wet_walls, 2, rng),
        accents=_some(finishes.accents, 2, rng),
        papers=_some(finishes.papers, 2, rng),
        ceiling=_one(finishes.ceilings, rng),
        skirting="paint_white/0" if "paint" in door or rng.random() < 0.5 else door,
        front_door=_one(finishes.front_doors, rng),
        boldness=float(rng.uniform(0.1, 0.6)),
    )


def assign_materials(house: House, palette: Palette, *, rng: np.random.Generator) -> House:
    """The house with every room's finishes."""
    rooms = []
    nth: dict[str, int] = {}
    for room in house.rooms:
        nth[room.kind] = nth.get(room.kind, -1) + 1
        plain, floor = room.kind in (*WET, "garage"), _floor(room, house, palette)
        wall = _wall(room, palette, nth[room.kind], rng)
        accent, accent_finish = _accent(room, house, palette, rng)
        rooms.append(
            dataclasses.replace(
                room,
                floor_finish=floor,
                wall_finish=wall,
                ceiling_finish="paint_white/0" if plain else palette.ceiling,
                skirting_finish=floor if plain else palette.skirting,
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
    if kind in ("kitchen", "pantry", "sun_room"):
        return palette.kitchen_floor
    if kind in MOVING:
        return palette.hall_floor
    if kind == "closet":
        beside = next(
            (r for o in house.openings if room.id in o.rooms for r in o.rooms if r not in (room.id, None)), None
        )
        other = house.room_by_id[beside].kind if beside else "corridor"
        return palette.private_floor if other in BEDROOMS else palette.hall_floor if other in MOVING else palette.floor
    return palette.private_floor if kind in (*BEDROOMS, "playroom", "gym") else palette.floor


def _wall(room: Room, palette: Palette, nth: int, rng: np.random.Generator) -> str:
    kind = room.kind
    if kind in ("bathroom", "toilet"):
        return palette.wet_walls[nth % len(palette.wet_walls)]
    if kind in ("garage", "workshop", "laundry_room", "pantry", "closet"):
        return "paint_white/0"
    if kind == "kids_room":
        return _one(FINISH_TABLE.kids, rng)
    if kind in TALK or kind in ("kitchen", "sun_room"):
        return palette.walls[0]
    if palette.style == "classic" and kind in BEDROOMS and rng.random() < 0.3:
        return _one(palette.papers, rng)
    return palette.walls[1 + nth % (len(palette.walls) - 1)]


def _accent(room: Room, house: House, palette: Palette, rng: np.random.Generator) -> tuple[int | None, str | None]:
    """An edge without doors or windows, not a short one, and its material; (None, None) in most rooms."""
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
        return walls[int(pick * len(walls))], FINISH_TABLE.kids_papers[int(paper * len(FINISH_TABLE.kids_papers))]
    choice = palette.papers if paper < 0.4 and room.kind in BEDROOMS else palette.accents
    return walls[int(pick * len(walls))], choice[int(pick * 997) % len(choice)]
