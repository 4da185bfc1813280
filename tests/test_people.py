"""People stand beside the starts of their routes, look at them, and are in nobody's way."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import shapely
from hand_worlds import grid_world, thing

from assets.records import Asset
from embodied.geometry import facing_of, wrap
from embodied.house import House, check
from embodied.navgraph import RADIUS
from embodied.people import APART, CLASS, FARTHEST, NEAREST, add_people, stands
from embodied.tasks.goals import find_instances

FIGURE = Asset("hand/figure", CLASS, "a person", (0.5, 0.3, 1.7), "floor")
SLIM = Asset("hand/slim", CLASS, "a slim person", (0.3, 0.3, 1.7), "floor")
CATALOGUE = SimpleNamespace(of_class=lambda name: (FIGURE,) if name == CLASS else ())


def populated(starts=(0, 14, 14, 30), world=None) -> tuple[House, object]:
    world = world or grid_world(6, spacing=2.2)
    return add_people(world.house, world.graph, starts, CATALOGUE, seed=1), world


def test_one_person_per_start_looking_at_it():
    house, world = populated()
    people = [p for p in house.placements if p.object_class == CLASS]
    assert len(people) == 3
    for p, node in zip(people, (0, 14, 30), strict=True):
        offset = world.graph.positions[node, :2] - p.position[:2]
        assert NEAREST - 1e-3 <= np.hypot(*offset) <= FARTHEST + 1e-3 and p.room == world.graph.room_of_node[node]
        assert abs(wrap(facing_of(p.yaw) - math.atan2(offset[1], offset[0]))) < 1e-3


def test_nobody_blocks_an_edge_or_stands_in_furniture():
    house, world = populated(range(36))
    ways = shapely.MultiLineString([world.graph.positions[list(e), :2].tolist() for e in world.graph.edges])
    people = [shapely.Point(p.position[:2]) for p in house.placements if p.object_class == CLASS]
    assert len(people) > 20
    assert all(ways.distance(p) >= RADIUS + max(FIGURE.size[:2]) / 2 - 0.02 for p in people)
    assert all(a.distance(b) >= APART / 2 + max(FIGURE.size[:2]) / 2 - 0.02 for i, a in enumerate(people) for b in people[:i])
    check(house)


def test_where_the_first_figure_does_not_fit_a_slimmer_one_stands():
    world = grid_world(6, spacing=2.2)
    x, y, _ = world.graph.positions[7]
    wide = dataclasses.replace(FIGURE, key="hand/wide", size=(0.89, 0.8, 1.8))
    beds = [dataclasses.replace(thing("bed", i + 1, "kitchen_1", x + dx, y + dy), size=(1.0, 1.0, 0.7))
            for i, (dx, dy) in enumerate((a, b) for a in (-1.2, 1.2) for b in (-1.2, 1.2))]
    full = dataclasses.replace(world, house=dataclasses.replace(world.house, placements=tuple(beds)))
    who = [p.asset for seed in range(8) for p in add_people(
        full.house, world.graph, (7,), SimpleNamespace(of_class=lambda name: (wide, SLIM)), seed=seed).placements if p.object_class == CLASS]
    assert who and set(who) == {SLIM.key}


def test_a_crowded_start_goes_without():
    world = grid_world(6, spacing=2.2)
    x, y, _ = world.graph.positions[0]
    table = dataclasses.replace(thing("table", 1, "kitchen_1", x, y), size=(4.6, 4.6, 0.7))
    full = dataclasses.replace(world, house=dataclasses.replace(world.house, placements=(table,)))
    assert not [p for p in populated((0,), full)[0].placements if p.object_class == CLASS]


def test_only_those_who_stand_are_taken():
    assert stands(FIGURE)
    for size in ((0.6, 0.8, 0.76), (0.7, 1.9, 0.57), (1.2, 0.5, 1.7)):
        assert not stands(dataclasses.replace(FIGURE, size=size))


def test_people_are_not_objects_to_look_for():
    house, world = populated()
    there = dataclasses.replace(world, house=house)
    assert CLASS not in {x.object_class for x in find_instances(there, 3.0)}


def test_the_same_seed_gives_the_same_people():
    assert populated()[0] == populated()[0]
