"""People stand or sit beside the starts of their routes, and are in nobody's way."""

from __future__ import annotations

import dataclasses
import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from conftest import two_rooms
from hand_worlds import grid_world, thing

from embodied.assets.records import Asset, SupportSurface
from embodied.assistants.route_system import route_paths
from embodied.generate.people import (
    BACK,
    CLASS,
    FARTHEST_PERSON,
    LAP,
    NEAREST_PERSON,
    PERSONAL_SPACE,
    POLITE,
    add_people,
    place_people,
    rearranged,
    sits,
    stands,
)
from embodied.geometry import facing_of, wrap
from embodied.house.house import House, Opening, Placement, check
from embodied.house.household import household_of, residents
from embodied.house.shapes import footprint
from embodied.navigation.free_space import leaves
from embodied.navigation.graph import AGENT_RADIUS, NavGraph, graph_of, unreachable_rooms
from embodied.tasks.goals import find_instances

FIGURE = Asset("hand/figure", CLASS, "a person", (0.5, 0.3, 1.7), "floor")
SLIM = Asset("hand/slim", CLASS, "a slim person", (0.3, 0.3, 1.7), "floor")
SITTER = Asset("hand/sitter", CLASS, "somebody at rest", (0.5, 0.7, 1.3), "floor", tags=("sitting",))
SEAT = SupportSurface("seat", LAP + 0.02, -0.15, -0.15, 0.15, 0.1, 9.0)
CHAIR = Asset("hand/chair", "dining chair", "a chair", (0.4, 0.4, 0.9), "floor", surfaces=(SEAT,))


def catalogue(*figures: Asset) -> SimpleNamespace:
    return SimpleNamespace(
        of_class=lambda name: figures if name == CLASS else (), assets={a.key: a for a in (*figures, CHAIR)}
    )


def populated(starts=(0, 14, 14, 30), world=None, figures=(FIGURE,), seed=1) -> tuple[House, object]:
    world = world or grid_world(6, spacing=2.2)
    return add_people(
        world.house, place_people(world.house, world.graph, catalogue(*figures), seed=seed), starts
    ), world


def people_of(house: House) -> list[Placement]:
    return [p for p in house.placements if p.object_class == CLASS]


def seated(world, node: int, dx: float, dy: float, yaw: float = 0.0):
    """The world with a chair beside a node, and whoever is met there."""
    x, y, _ = world.graph.positions[node]
    room = world.graph.room_of_node[node]
    chair = Placement("dining_chair_1", CHAIR.key, CHAIR.object_class, room, (x + dx, y + dy, 0.0), yaw, CHAIR.size)
    house = dataclasses.replace(world.house, placements=(chair,))
    return chair, place_people(house, world.graph, catalogue(SITTER), seed=1)


def test_one_person_per_start_looking_at_it_or_at_a_start_nearby():
    house, world = populated()
    people, nodes = people_of(house), world.graph.positions[:, :2]
    assert 1 <= len(people) <= 3 and [p.id for p in people] == [f"person_{i + 1}" for i in range(len(people))]
    for node in (0, 14, 30):
        here = [math.dist(p.position[:2], nodes[node]) for p in people if p.room == world.graph.room_of_node[node]]
        assert any(NEAREST_PERSON - 1e-3 <= far <= FARTHEST_PERSON + 1e-3 for far in here)
    for p in people:
        near = [n - p.position[:2] for n in nodes if math.dist(n, p.position[:2]) <= FARTHEST_PERSON + 1e-3]
        assert any(abs(wrap(facing_of(p.yaw) - math.atan2(y, x))) < 1e-3 for x, y in near)


def test_nobody_blocks_an_edge_or_stands_in_furniture():
    house, world = populated(range(36))
    ways = shapely.MultiLineString([world.graph.positions[list(e), :2].tolist() for e in world.graph.edges])
    people = [shapely.Point(p.position[:2]) for p in people_of(house)]
    assert len(people) > 12
    assert all(ways.distance(p) >= AGENT_RADIUS + max(FIGURE.size[:2]) / 2 - 0.02 for p in people)
    apart = [a.distance(b) for a, b in itertools.combinations(people, 2)]
    assert min(apart) >= PERSONAL_SPACE / 2 + max(FIGURE.size[:2]) / 2 - 0.02
    check(house)


def test_nobody_stands_in_the_open_leaf_of_a_door():
    world = grid_world(6, spacing=3.0)
    wide = [dataclasses.replace(o, b=_farther(o, 2.0), angle=1.4) for o in world.house.openings]
    house = dataclasses.replace(world.house, openings=tuple(wide))
    open_leaves = shapely.union_all([leaf for o in wide for leaf in leaves(house, o)])
    apart = []
    for seed in range(8):
        met = place_people(house, world.graph, catalogue(FIGURE), seed=seed)
        apart += [open_leaves.distance(shapely.Point(p.position[:2])) for p in met.values()]
    assert min(apart) >= max(FIGURE.size[:2]) / 2 - 0.02


def _farther(o: Opening, width: float) -> tuple[float, float]:
    """The other end of an opening that is so wide."""
    along = np.subtract(o.b, o.a) / math.dist(o.a, o.b)
    x, y = np.add(o.a, width * along)
    return float(x), float(y)


def test_people_keep_a_metre_from_where_they_are_met_if_there_is_room():
    for seed in range(8):
        house, world = populated((14,), seed=seed)
        far = [math.dist(p.position[:2], world.graph.positions[14, :2]) for p in people_of(house)]
        assert min(far) >= POLITE - 1e-3


def test_somebody_sits_on_a_chair_with_the_back_at_its_back():
    world = grid_world(6, spacing=2.2)
    chair, met = seated(world, 7, 1.1, 1.1)
    assert met[7].asset == SITTER.key and met[7].yaw == chair.yaw
    assert met[7].position[2] == pytest.approx(0.02)  # the seat's height above what the figure was modelled on
    assert met[7].position[0] == pytest.approx(chair.position[0], abs=1e-3)
    assert met[7].position[1] + SITTER.size[1] / 2 == pytest.approx(
        chair.position[1] + CHAIR.surfaces[0].y1 + BACK, abs=1e-3
    )


HIGH = dataclasses.replace(CHAIR, surfaces=(dataclasses.replace(SEAT, z=0.75),))


@pytest.mark.parametrize(
    ("place", "chair", "box"), [((0.0, 0.5), CHAIR, False), ((1.1, 1.1), CHAIR, True), ((1.1, 1.1), HIGH, False)]
)
def test_nobody_sits_in_the_way_of_walkers_or_on_something_or_on_a_bar_stool(place, chair, box, monkeypatch):
    monkeypatch.setattr("test_people.CHAIR", chair)
    world = grid_world(6, spacing=2.2)
    seat, met = seated(world, 7, *place)
    if box:
        x, y, _ = seat.position
        on = dataclasses.replace(thing("box", 1, seat.room, x, y), position=(x, y, 0.47), size=(0.3, 0.3, 0.3))
        house = dataclasses.replace(world.house, placements=(seat, on))
        met = place_people(house, world.graph, catalogue(SITTER), seed=1)
    assert not met


def test_routes_begin_where_somebody_is_met():
    world = grid_world(6, spacing=2.2)
    met = place_people(world.house, world.graph, catalogue(FIGURE), seed=1)
    some = dict(list(met.items())[:5])
    paths = route_paths(world.graph, "grid", seed=0, house_split="test", starts=some)
    assert paths and {p[0] for p in paths} <= set(some)
    assert route_paths(world.graph, "grid", seed=0, house_split="test", starts={}) == route_paths(
        world.graph, "grid", seed=0, house_split="test"
    )


def nook_before_a_door() -> tuple[House, NavGraph]:
    """Two rooms; whoever is met at the eastern node stands in a nook 0.7 m wide that leads to the bedroom's door."""
    blocks = (((3.2, 1.1), (2.0, 2.0)), ((3.0, 3.5), (3.9, 0.8)))  # middle and size of what fills the rest
    things = tuple(
        dataclasses.replace(thing("cupboard", k + 1, "living_room_1", *at), size=(*size, 1.0))
        for k, (at, size) in enumerate(blocks)
    )
    graph = graph_of(
        np.array([[1.2, 2.6, 0.0], [4.0, 2.6, 0.0]]), np.array([[0, 1]]), ("a", "b"), ("living_room_1",) * 2
    )
    return dataclasses.replace(two_rooms(), placements=things), graph


@pytest.mark.parametrize("seed", range(3))
def test_whoever_shuts_a_room_steps_aside_alone(seed):
    house, graph = nook_before_a_door()
    assert unreachable_rooms(house) == ()
    met = place_people(house, graph, catalogue(FIGURE), seed=seed)
    assert set(met) == {0} and unreachable_rooms(add_people(house, met, (0,))) == ()
    # in a house whose bedroom has a door of its own to the garden, the same two people stay
    garden = dataclasses.replace(
        house.openings[0], id="back_door_1", kind="back_door", rooms=("bedroom_1", None), a=(9.0, 1.0), b=(9.0, 2.0)
    )
    shut_anyway = dataclasses.replace(house, openings=(garden, *house.openings[1:]))
    both = place_people(shut_anyway, graph, catalogue(FIGURE), seed=seed)
    assert set(both) == {0, 1} and both[0] == met[0] and both[1].position[0] > 4.2


@pytest.mark.slow
def test_where_the_first_figure_does_not_fit_a_slimmer_one_stands():
    world = grid_world(6, spacing=2.2)
    x, y, _ = world.graph.positions[7]
    wide = dataclasses.replace(FIGURE, key="hand/wide", size=(0.89, 0.8, 1.8))
    beds = [
        dataclasses.replace(thing("bed", i + 1, "kitchen_1", x + dx, y + dy), size=(1.0, 1.0, 0.7))
        for i, (dx, dy) in enumerate((a, b) for a in (-1.2, 1.2) for b in (-1.2, 1.2))
    ]
    full = dataclasses.replace(world, house=dataclasses.replace(world.house, placements=tuple(beds)))
    who = [p.asset for seed in range(8) for p in people_of(populated((7,), full, (wide, SLIM), seed)[0])]
    assert who and set(who) == {SLIM.key}


def test_only_those_who_stand_are_taken():
    assert stands(FIGURE)
    for size in ((0.6, 0.8, 0.76), (0.7, 1.9, 0.57), (1.2, 0.5, 1.7)):
        assert not stands(dataclasses.replace(FIGURE, size=size))
    assert sits(SITTER) and not stands(SITTER) and not sits(FIGURE)


def test_people_are_not_objects_to_look_for():
    house, world = populated()
    there = dataclasses.replace(world, house=house)
    assert CLASS not in {x.object_class for x in find_instances(there, 3.0)}


def test_on_another_day_people_are_elsewhere_and_small_things_moved_but_the_furniture_stays():
    chair = Placement("dining_chair_1", CHAIR.key, CHAIR.object_class, "r0", (1.0, 1.0, 0.0), 0.0, CHAIR.size)
    mugs = tuple(
        Placement(f"mug_{k + 90}", "hand/mug", "mug", "r0", (0.9 + 0.06 * k, 0.97, LAP + 0.02), 0.0, (0.03, 0.03, 0.1))
        for k in range(4)
    )
    mugs = tuple(dataclasses.replace(m, parent=chair.id, surface="seat") for m in mugs)
    house, world = populated(figures=(FIGURE, SLIM))
    house = dataclasses.replace(house, placements=(chair, *mugs, *house.placements))
    days = [
        rearranged(house, world.graph, catalogue(FIGURE, SLIM), (0, 14, 14, 30), day=day) for day in (0, 1, 1, 2, 3)
    ]
    assert days[0] is house and days[1].digest == days[2].digest, "a day is the same whenever it is looked at"
    things = [{p.id: p for p in d.placements if p.object_class != CLASS} for d in days]
    small = {m.id for m in mugs}
    furniture = [{i: p for i, p in t.items() if i not in small} for t in things]
    assert all(f == furniture[0] for f in furniture) and all(set(t) <= set(things[0]) for t in things)
    assert len({len(t) for t in things}) > 1, "something is put away on some day"
    seat = shapely.box(0.85, 0.85, 1.15, 1.1)
    for there in things[1:]:
        bases = [footprint(p) for p in there.values() if p.id in small]
        assert all(seat.contains(b) for b in bases)
        assert not any(a.intersects(b) for a, b in itertools.combinations(bases, 2))
    assert any(there[i].position != things[0][i].position for there in things[1:] for i in there)
    met = [{p.position for p in people_of(d)} for d in days]
    assert met[0] and all(met[0] != m for m in met[1:])


@pytest.mark.parametrize("seed", range(5))
def test_a_family_lives_in_a_house_as_its_household_says(seed):
    kinds = ("living_room", "main_bedroom", "kids_room")
    room = two_rooms().rooms[0]
    house = dataclasses.replace(
        two_rooms(), seed=seed, rooms=tuple(dataclasses.replace(room, id=k, kind=k) for k in kinds)
    )
    here, household = residents(house), household_of(house)
    assert len({p.family for p in here}) == 1 and len({p.id for p in here}) == len(here)
    assert sum(p.age >= 18 for p in here) == household.adults and any(p.age < 18 for p in here)
