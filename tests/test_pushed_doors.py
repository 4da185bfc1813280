"""Doors that bodies meet: a shut one bars the way, one that stands ajar gives way, as on the graph."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, furnished

from embodied.house.moment import Moment
from embodied.navigation.floor_ways import FloorWays
from embodied.navigation.graph import build_graph

HOUSE = furnished(two_rooms())


def at(openness):
    return Moment(openness={"door_1": openness}).applied(HOUSE)


@pytest.mark.parametrize("openness", [0.0, 0.1, 0.5, 1.0])
def test_floors_and_graphs_agree_about_what_is_shut_fast_and_what_is_open(openness):
    house = at(openness)
    rooms = set(FloorWays(house).room_of_cell[::3])
    assert ({"bedroom_1", "living_room_1"} <= rooms) == (openness > 0.005), "what stands ajar gives way"
    assert build_graph(house).closed == ({"door_1"} if openness < 0.5 else set())


@pytest.mark.parametrize("openness", [0.0, 0.2, 1.0])
def test_wheels_push_a_door_that_is_ajar_and_do_not_pass_one_that_is_shut(openness):
    driven = pytest.importorskip("embodied.envs.driven", exc_type=ImportError)
    driver = driven.Driver(at(openness), HandCatalogue())
    driver.place(np.array([4.2, 1.05, 1.5]), 0.0)  # before the door, which opens away from it
    driver.roll(0.6, 0.0, 250)
    assert (driver.position[0] > 5.3) == (openness > 0), driver.position
    if openness == 0.2:
        from embodied.scene.doors import openness as measured

        assert measured(driver.model, driver.data)["door_1"] > 0.5
    assert math.isfinite(driver.yaw)
