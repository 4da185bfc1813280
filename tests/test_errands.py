"""Errands of people: nobody walks through anything."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import shapely

from embodied.assets.people import joint_positions, people
from embodied.generate import HouseConfig, generate_house
from embodied.house.moment import WIDEST, Moment
from embodied.navigation.floor_ways import FloorWays
from embodied.navigation.free_space import free_floor, opened, room_doors
from embodied.navigation.graph import AGENT_RADIUS
from embodied.people.day import errand
from embodied.people.errands import Walks

SOMEBODY = people()["mei"]


def walks(seed: int, count: int):
    """A small house with its doors closed, and errands between its rooms."""
    house = generate_house(seed, HouseConfig(area=(38, 46)))
    doors = {o.id for o in room_doors(house)}
    shut = [dataclasses.replace(o, angle=0.0) if o.id in doors else o for o in house.openings]
    house, rng = dataclasses.replace(house, openings=tuple(shut)), np.random.default_rng(seed)
    ways = FloorWays(opened(house, doors), stairs=False)
    rooms = sorted({*ways.room_of_cell} - {""})
    for k in range(count):
        a, b = (rng.choice(np.flatnonzero(ways.room_of_cell == rooms[i % len(rooms)])) for i in (k, k + 1))
        yield house, errand(house, SOMEBODY, ways.xy[a], ways.xy[b])


def seconds(going) -> float:
    return going.pieces[SOMEBODY.id][-1].begin


def bodies_through_something(house, going) -> list[float]:
    """Seconds of an errand at which the body is not on the free floor, doors as they are then."""
    floors, wrong = {}, []
    for t in np.arange(0, seconds(going), 0.2):
        moment = going.at(float(t))
        key = tuple(moment.openness.items())
        if key not in floors:
            openings = Moment(openness=moment.openness).applied(house).openings
            floors[key] = free_floor(dataclasses.replace(house, openings=openings), 0).buffer(1e-4)
        at = shapely.Point(moment.people[SOMEBODY.id].place.position[:2])
        if not floors[key].covers(at.buffer(AGENT_RADIUS - 0.01)):
            wrong.append(float(t))
    return wrong


@pytest.mark.parametrize("seed", [7, 11])
def test_nobody_walks_through_walls_furniture_or_doors_and_doors_are_closed_behind(seed):
    opened_doors = 0
    for house, going in walks(seed, 3):
        assert bodies_through_something(house, going) == []
        opened_doors += len(going.doors)
        assert not going.at(seconds(going) + 9).openness
        for _, opens, closes in going.doors:
            assert max(going.at(opens + 1.5).openness.values()) == 1.0 and closes > opens
    assert opened_doors


def test_who_opens_a_door_reaches_its_handle_where_it_is_near_and_who_sits_down_ends_on_the_seat():
    house, going = next((h, e) for h, e in walks(7, 5) if e.doors)
    legs = [p.leg for p in going.pieces[SOMEBODY.id] if p.leg]
    assert any(x.door is not None for x in legs)
    start = legs[-1].course.line[-1, 1:3]
    seat = (float(start[0]) - 0.4, float(start[1]), 0.45, 0.0)
    there = errand(house, SOMEBODY, legs[0].course.line[0, 1:3], start, seat)
    last = there.at(seconds(there)).people[SOMEBODY.id]
    pelvis = last.place.points(joint_positions(SOMEBODY, last.pose)["pelvis"][None])[0]
    np.testing.assert_allclose(pelvis, [*seat[:2], 0.45 + SOMEBODY.seat], atol=1e-6)
    assert math.isclose(there.doors[0][1], going.doors[0][1]) and WIDEST > 1


def test_errands_lead_over_stairs_where_feet_stand_on_treads():
    house = generate_house(0, HouseConfig(area=(90, 120), storeys=2))
    walks = Walks(house)
    low, high = (walks.ground.xyz[walks.clear][k].tolist() for k in (0, -1))
    heights = np.array([z for climb in walks.climbs for *_, z in climb])
    for begin, end in ((low, high), (high, low)):
        going = errand(house, SOMEBODY, begin, end)
        legs = [p.leg for p in going.pieces[SOMEBODY.id] if p.leg]
        assert going.at(seconds(going)).people[SOMEBODY.id].place.position[2] == pytest.approx(end[2])
        stair = next(x for x in legs if np.ptp(x.course.plants[:, 1]) > 2)
        ankle, stood = stair.course.limbs.ankle, set[float]()
        for t in np.arange(0, stair.course.seconds, 0.1):
            flat = [f[2] - ankle for f in stair.course.at(t).feet if f[4] == 0]
            stood |= {float(z) for z in heights for x in flat if abs(x - z) < 1e-3}
        assert stood == {float(z) for z in heights}
