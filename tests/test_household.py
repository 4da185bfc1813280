"""Households follow from the seed and leave what they should, where they should."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
import pytest
import shapely

from embodied.assets.catalogue import load_catalogue
from embodied.generate import HouseConfig, generate_house
from embodied.generate.furnish import groups, likes
from embodied.generate.furnish.context import Context, Stock
from embodied.generate.furnish.smalls import CarrierSurface, SurfaceOccupancy
from embodied.generate.furnish.space import Thing, overlap, room_space
from embodied.generate.furnish.tables import AT, LIKES, tables
from embodied.geometry import rectangle
from embodied.house.house import House
from embodied.house.household import HABITS, Household, draw_household, household_of

UNITS = ("base cabinet", "drawer cabinet", "kitchen sink", "cooker", "corner base cabinet", "tall cabinet")
FEW = 2
"""Of the houses that are looked at in the whole suite, those that `-m "not slow"` looks at, too."""
SEEDS = tuple(range(6000, 6010))


@functools.cache
def catalogue():
    return load_catalogue()


@functools.cache
def lived_in(seed: int, disorder: float | None = None) -> House:
    return generate_house(seed, HouseConfig(area=(75.0, 130.0), storeys=1, disorder=disorder), catalogue())


def of_class(house: House, *names: str) -> int:
    return sum(p.object_class in names for p in house.placements)


def test_a_household_follows_from_seed_and_rooms_and_can_be_said():
    house = lived_in(SEEDS[0])
    assert household_of(house) == household_of(dataclasses.replace(house, placements=()))
    assert str(Household(2, (8, 2), frozenset({"reads", "cooks"}))) == "2 adults, children of 8 and 2; cooks, reads"
    assert str(Household(1, (3,), frozenset())) == "1 adult, a child of 3; no habits"


def test_households_fit_their_rooms():
    drawn = [draw_household(["main_bedroom", "kids_room", "study"], rng=np.random.default_rng(k)) for k in range(200)]
    assert all(h.children and all(2 <= age < 12 for age in h.children) for h in drawn)
    assert all("works at home" in h.habits and h.habits <= set(HABITS) for h in drawn)
    assert 0.6 < np.mean([h.adults == 2 for h in drawn]) < 0.9
    alone = [draw_household(["living_room", "bathroom"], rng=np.random.default_rng(k)) for k in range(50)]
    assert not any(h.children for h in alone)


def test_who_uses_a_room():
    family = Household(2, (9, 4, 3), frozenset())
    assert family.residents("main_bedroom") == 2
    assert family.residents("kids_room", 2) == 1.5
    assert family.residents("kitchen") == 5
    assert family.residents("guest_room") == 0


def test_every_small_thing_and_every_part_of_a_group_is_something_that_the_catalogue_has():
    stock = Stock(catalogue(), tables().style("warm", 0.4, rng=np.random.default_rng(0)), tables())
    known = tables()
    smalls = [*known.hung, *(s for some in known.smalls.values() for s in some)]
    assert all(stock.of_role(s.put) and s.habit in ("", *HABITS) for s in smalls)
    assert all(stock.of_role(r) for some in known.shelves.values() for r in some)
    assert all(stock.of_role(p.role) for g in known.groups.values() for p in g.parts if p.role)
    assert set(likes.LIKES) == {*LIKES, "ahead"} and {"wall", *groups.AROUND} == set(AT)
    rules = [w for p in known.rooms.values() for w in (*p.rules, *p.extras, *p.fillers)]
    assert all(stock.of_role(r) for w in rules for r in (w.role, *w.roles) if r)


def test_a_board_is_filled_without_overlaps_until_nothing_fits():
    house = lived_in(SEEDS[0])
    room = next(r for r in house.rooms if r.kind == "living_room")
    table = next(a for a in catalogue().of_class("dining table") if a.surfaces and a.size[0] < 1.7)
    mug = catalogue().of_class("mug")[0]
    space = room_space(house, room)
    x, y = space.polygon.centroid.coords[0]
    carrier = Thing(table, x, y, space.bottom, 0.0, table.size)
    stock = Stock(catalogue(), tables().style("warm", 0.4, rng=np.random.default_rng(0)), tables())
    full = space.holding([carrier], [carrier.box])
    occupancy = SurfaceOccupancy(Context(full, stock, np.random.default_rng(3), ("living_room",), household_of(house)))
    board = CarrierSurface(carrier, max(table.surfaces, key=lambda s: (s.x1 - s.x0) * (s.y1 - s.y0)))
    laid = []
    while (thing := occupancy.put(mug, board, "any", 3.2)) is not None:
        laid.append(thing)
        assert len(laid) < 500
    assert len(laid) > 20
    assert not any(overlap(p.box, q.box) for i, p in enumerate(laid) for q in laid[:i])
    x0, x1, y0, y1 = occupancy.area(board)
    assert all(x0 - 1e-6 <= t.x - x <= x1 + 1e-6 and y0 - 1e-6 <= t.y - y <= y1 + 1e-6 for t in laid)


@pytest.mark.slow
def test_untidy_houses_show_it():
    mess = ("heap of clothes", "duvet", "mug", "glass", "plate", "slippers", "building blocks")
    tidy, untidy = (sum(of_class(lived_in(s, d), *mess) for s in SEEDS[:3]) for d in (0.02, 0.95))
    assert untidy > 1.5 * tidy


@pytest.mark.slow
def test_children_leave_toys_and_drawings():
    theirs = ("child's drawing", "building blocks", "toy car", "toy train", "crayons", "board game", "teddy bear")
    for seed in SEEDS:
        house = lived_in(seed)
        if any(r.kind == "kids_room" for r in house.rooms):
            assert of_class(house, *theirs) >= 2, seed
        if not household_of(house).children:
            assert not of_class(house, "building blocks", "child's drawing"), seed


@pytest.mark.slow
def test_houses_are_lived_in():
    """Objects per square metre, all and what lies on something, as the mean of some houses (docs/houses.md)."""
    houses = [lived_in(s) for s in SEEDS]
    area = sum(shapely.Polygon(r.polygon).area for h in houses for r in h.rooms)
    assert sum(len(h.placements) for h in houses) / area > 3.0
    assert sum(p.parent is not None for h in houses for p in h.placements) / area > 1.4


def test_coats_hang_and_shoes_stand_in_the_halls_of_most_houses():
    seeds = SEEDS[:6]
    shoes = ("shoes", "sneakers", "high heels", "loafers", "ankle boots")
    assert sum(of_class(lived_in(s), "hanging coat", "coat hooks") > 0 for s in seeds) >= 5
    assert sum(of_class(lived_in(s), *shoes) > 0 for s in seeds) >= 5


@pytest.mark.parametrize("seeds", [SEEDS[:FEW], pytest.param(SEEDS[FEW:], marks=pytest.mark.slow)])
def test_fridges_are_as_tall_as_people_and_most_stand_in_the_line(seeds):
    apart = []
    for seed in seeds:
        house = lived_in(seed)
        for p in house.placements:
            if p.object_class == "fridge" and house.room_by_id[p.room].kind == "kitchen":
                assert p.size[2] > 1.5
                units = [q for q in house.placements if q.room == p.room and q.object_class in UNITS]
                apart.append(min(floor_of(p).distance(floor_of(q)) for q in units))
    assert len(apart) >= len(seeds)
    assert sum(d > 0.06 for d in apart) <= math.ceil(0.15 * len(apart))


def floor_of(p) -> shapely.Polygon:
    return shapely.Polygon(rectangle(*p.position[:2], p.size[0], p.size[1], p.yaw))
