"""The landscapes that a house may stand in, the seasons, and the neighbours near by: tables, and what is drawn from a
house's seed."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from embodied.assets.json_file import from_plain, read_toml
from embodied.assets.records import Color
from embodied.house.house import LANDSCAPES, SEASONS, House
from embodied.house.shapes import room_union
from embodied.scene.buildings import Building
from embodied.seeds import stream

GROUND_DROP = 0.15
"""How far the ground lies below the ground floor, metres."""
GARDEN = 11.0
"""From the house to the edge of its plot, metres."""


@dataclass(frozen=True)
class Ridge:
    """A line of hills, or a wood, all round the horizon."""

    distance: float
    """Metres."""
    height: float
    """Mean height above the ground, metres."""
    rough: float
    """By how much the height varies, metres."""
    cover: str
    """'wood', 'trees' (their crowns are seen), 'fields' or 'rock'."""
    grain: int = 9
    """Hills around the horizon."""


@dataclass(frozen=True)
class Town:
    """Houses between two distances: scattered, or in streets that thin out with distance."""

    nearest: float
    farthest: float
    count: int
    """Of scattered houses; 0 for streets."""
    storeys: tuple[int, int]
    flat: float = 0.0
    """Share of flat roofs."""


@dataclass(frozen=True)
class Landscape:
    """A landscape around a house."""

    likely: float
    """How often it is drawn, against the others."""
    border: str
    """Of the plot: 'hedge', 'wall', 'fence', or 'none'."""
    trees: tuple[int, int]
    """Leafy trees and firs near the house."""
    ground: str
    """Beyond the plot: 'meadow', 'fields', 'town' or 'woodland'."""
    far: tuple[Ridge | Town, ...]
    """Painted layers, farthest first."""
    scatter: tuple[int, float, float] = (0, 50.0, 400.0)
    """Single trees painted: how many, nearest and farthest, metres."""
    firs: float = 0.15
    """Share of firs among the trees that are painted."""
    neighbours: str = ""
    """Near buildings: '' for none, 'villas' all around, 'cottages' or 'terrace' across a street."""
    water: tuple[float, float] | None = None
    """Nearest and farthest shore, metres."""
    heights: tuple[float, ...] = (GROUND_DROP,)
    """Of the lowest floor above the ground, metres; one is drawn."""


@dataclass(frozen=True)
class SeasonColours:
    """Colours of what grows, linear reflectances."""

    grass: Color
    fields: tuple[Color, ...]
    """Five of them."""
    leaves: tuple[Color, ...]
    """Of four kinds of tree."""


@dataclass(frozen=True)
class LandscapeTable:
    """The content of landscapes.toml."""

    landscapes: Mapping[str, Landscape]
    """By the names in `embodied.house.house.LANDSCAPES`."""
    seasons: Mapping[str, SeasonColours]


_READ = from_plain(LandscapeTable, read_toml(Path(__file__).with_name("landscapes.toml")))
TABLE, SEASON_COLOURS = _READ.landscapes, _READ.seasons
LIKELY_SEASONS = (0.3, 0.35, 0.2, 0.15)
"""Of spring, summer, autumn and winter."""


@dataclass(frozen=True)
class Scenery:
    """Surroundings of a house."""

    landscape: str
    season: str
    height: float
    """Of the lowest floor above the ground, metres."""
    outlook: float
    """World direction of the street or the lake: what the house looks at, radians."""

    @property
    def table(self) -> Landscape:
        """Pieces of its landscape."""
        return TABLE[self.landscape]

    @property
    def colours(self) -> SeasonColours:
        """Of what grows in its season."""
        return SEASON_COLOURS[self.season]

    @property
    def snow(self) -> bool:
        """True if snow lies."""
        return self.season == "winter"

    @property
    def reach(self) -> float:
        """From the edge of the plot to the face of the nearest building, metres."""
        return BUILDING_SETBACK[self.table.neighbours]


def scenery_of(house: House) -> Scenery:
    """Scenery that the house's sky names, the rest drawn from its seed; the same in every process.

    High floors are drawn only for houses that could be flats: of one storey, without a garage.
    """
    rng = stream(house.seed, "outdoors", "landscape")
    flat = len(house.storeys) == 1 and not any(o.kind == "garage_door" for o in house.openings)
    chances = np.array([TABLE[n].likely * (flat or n != "roofs") for n in LANDSCAPES])
    drawn = LANDSCAPES[int(rng.choice(len(LANDSCAPES), p=chances / chances.sum()))]
    season = SEASONS[int(rng.choice(len(SEASONS), p=LIKELY_SEASONS))]
    name, up = house.sky.landscape or drawn, rng.random()
    heights = TABLE[name].heights
    height = heights[int(up * len(heights))] if flat else heights[0]
    return Scenery(name, house.sky.season or season, height, _outlook(house))


def _outlook(house: House) -> float:
    """Outward direction with the most glass, to a quarter turn."""
    area = np.zeros(4)
    union = room_union(house, 0)
    for o in house.openings:
        if o.rooms[1] is not None or o.kind not in ("window", "french_window"):
            continue
        (x0, y0), (x1, y1) = o.a, o.b
        n = np.array([y1 - y0, x0 - x1])
        n /= max(float(np.hypot(*n)), 1e-9)
        if union.contains(shapely.Point((x0 + x1) / 2 + 0.4 * n[0], (y0 + y1) / 2 + 0.4 * n[1])):
            n = -n
        area[round(math.atan2(n[1], n[0]) / (math.pi / 2)) % 4] += math.dist(o.a, o.b) * (o.head - o.sill)
    return float(area.argmax() * math.pi / 2)


def plot(house: House) -> tuple[float, float, float, float]:
    """x0, y0, x1, y1 of the garden, metres, world."""
    grown = house.outer_wall - house.inner_wall / 2 + GARDEN
    x0, y0, x1, y1 = room_union(house, 0).bounds
    return x0 - grown, y0 - grown, x1 + grown, y1 + grown


def side_frame(
    bounds: tuple[float, float, float, float], yaw: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Of the plot's side towards `yaw` (a quarter turn): its middle, the way along it, the way out, half its length."""
    x0, y0, x1, y1 = bounds
    out = np.round([math.cos(yaw), math.sin(yaw)])
    half = np.array([x1 - x0, y1 - y0]) / 2
    along = np.array([-out[1], out[0]])
    return np.array([x0 + x1, y0 + y1]) / 2 + out * half, along, out, float(abs(along @ half))


STREET = (1.6, 5.6)
"""Beginning and end of the carriageway beyond the edge of the plot, metres."""
BUILDING_SETBACK = {"villas": 7.5, "cottages": 8.2, "terrace": 8.6}
"""From the edge of the plot to the face of the nearest building, metres."""


def near_buildings(house: House, place: Scenery) -> list[Building]:
    """The neighbours that stand near enough to be seen from two sides as one walks."""
    rng = stream(house.seed, "outdoors", "neighbours")
    kind = place.table.neighbours
    if not kind:
        return []
    out: list[Building] = []
    for k in range(4):
        yaw = place.outlook + k * math.pi / 2
        middle, along, away, half = side_frame(plot(house), yaw)
        t = -half - 2.0
        while t < half + 2.0:
            b, gap = _neighbour(kind, k == 0, rng=rng)
            stray = rng.uniform(0.0, 4.0) if kind == "villas" else rng.uniform(0.0, 0.8) * (kind == "cottages")
            reach = place.reach + stray
            if kind != "villas" and k:
                reach += 3.0 + 7.0 * (kind == "cottages")
            at = middle + along * (t + b.wide / 2) + away * (reach + b.deep / 2)
            turn = yaw + math.pi + math.pi / 2 + (rng.normal(0, 0.12) if kind == "villas" else 0.0)
            if kind == "terrace" or rng.random() < (0.85 if k == 0 else 0.6 if kind == "villas" else 0.4):
                out.append(dataclasses.replace(b, at=(float(at[0]), float(at[1])), yaw=float(turn)))
            t += b.wide + gap
    return out


def _neighbour(kind: str, front: bool, *, rng: np.random.Generator) -> tuple[Building, float]:
    """A building somewhere, and the gap to the next."""
    paint, tiles = int(rng.integers(100)), int(rng.integers(100))
    if kind == "terrace":
        storeys = int(rng.integers(3, 5)) if front else int(rng.integers(2, 4))
        size, ridge, storey, gap = (rng.uniform(9.0, 14.0), 10.0), rng.uniform(2.2, 3.2), rng.uniform(3.0, 3.4), 0.0
    elif kind == "cottages":
        storeys = 1 if rng.random() < 0.35 else 2
        size, ridge, storey, gap = (rng.uniform(8.0, 11.5), 7.0), rng.uniform(2.8, 3.6), 2.6, rng.uniform(1.5, 6.0)
    else:
        storeys = 1 if rng.random() < 0.3 else 2
        size, ridge, storey, gap = (rng.uniform(9.5, 13.0), 8.5), rng.uniform(2.4, 4.0), 2.75, rng.uniform(7.0, 12.0)
    wide, deep, eaves = float(size[0]), size[1], float(storeys * storey + 0.25)
    return Building((0, 0), 0.0, wide, deep, eaves, float(ridge), paint, tiles, float(storey)), float(gap)
