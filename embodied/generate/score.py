"""How well a plan would please an architect: one number from areas, proportions, daylight and neighbours."""

from __future__ import annotations

import math

from embodied.generate.access import SharedWall
from embodied.generate.footprint import Rect, shared_area
from embodied.generate.kinds import NEIGHBOUR_VALUES, ROOM_TABLE
from embodied.generate.modules import Cell

WET = ("bathroom", "toilet", "laundry_room", "kitchen")


def score(cells: list[Cell], walls: dict[tuple[int, int], SharedWall]) -> float:
    """Higher is better; entrances are judged by access.connect."""
    inner = [0] * len(cells)
    value = 0.0
    joined: dict[int, float] = {}
    for (i, j), (_, _, low, high) in walls.items():
        n = high - low
        inner[i] += n
        inner[j] += n
        a, b = cells[i].kind, cells[j].kind
        worth = NEIGHBOUR_VALUES.get(frozenset((a, b)))
        if worth and n >= 12:
            value += worth
        if a in WET and b in WET:
            joined[i] = joined[j] = 0.3
    value += sum(joined.values())
    total = moving = 0.0
    for i, c in enumerate(cells):
        x0, y0, x1, y1 = c.rect
        w, h = x1 - x0, y1 - y0
        area = w * h / 100
        total += area
        short, long = min(w, h), max(w, h)
        outer = 2 * (w + h) - inner[i]
        if c.kind == "corridor":
            moving += area
            value -= 0.07 * max(0, long - 80) + 0.15 * (long / 10 > 3)
            continue
        kind = ROOM_TABLE[c.kind]
        least, most = kind.area
        if c.kind in ("hall", "stairwell"):
            moving += 0.5 * area
        value -= 0.3 * max(0.0, kind.side * 10 - short) if c.kind != "hall" else 0.5 * max(0, 14 - short)
        if area < least:
            value -= (15.0 if kind.is_tight else 5.0) * math.log(least / area)
        elif area > most:
            value -= 5.0 * math.log(area / most)
        value -= 0.7 * abs(math.log(area / c.area))
        value -= (4.0 if area > 15 else 3.0) * max(0.0, long / short - kind.longest)
        if kind.needs_daylight and outer < max(16, (0.7 if c.kind == "sun_room" else 0.26) * (w + h)):
            value -= 12.0 if outer < 16 else 5.0
        if c.kind in ("hall", "garage") and outer < (13 if c.kind == "hall" else 26):
            value -= 12.0
        if c.kind == "garage" and outer > 0.45 * 2 * (w + h):
            value += 0.8
        if c.kind == "bathroom" and outer >= 10:
            value += 0.3
        if c.kind in ("living_room", "family_room", "sun_room"):
            value += 0.4 * min(outer / 60, 2.0)
    return value - 18.0 * max(0.0, moving / total - 0.1)


def worth_above(cells: list[Cell], wet: tuple[Rect, ...]) -> float:
    """Worth of the bathrooms that lie above rooms with water, whose pipes they share."""
    baths = [c.rect for c in cells if c.kind in ("bathroom", "toilet")] if wet else []
    return 1.5 * sum(any(shared_area(a, b) > 100 for b in wet) for a in baths)
