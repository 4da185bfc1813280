"""Truths about the floor-plan picture."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from conftest import two_rooms

from embodied.house.floor_plan import INK, ROOM_COLOURS, paint_plan, save_plan
from embodied.house.house import Placement
from embodied.navigation.graph import build_graph

SCALE = 60.0


def colour_at(image, house, x: float, y: float) -> np.ndarray:
    """The colour at a point of the house; the sheet ends 0.9 m beyond the outer walls, 1.9 m below."""
    margin = house.outer_wall + 0.9
    return np.asarray(image)[round((4.0 + margin - y) * SCALE), round((x + margin) * SCALE)].astype(int)


def test_walls_are_dark_rooms_have_their_colour_and_openings_break_the_walls():
    house = dataclasses.replace(two_rooms(), placements=())
    image = paint_plan(house, pixels_per_metre=SCALE)
    assert np.abs(colour_at(image, house, 5.0, 3.0) - INK).max() < 12
    assert np.abs(colour_at(image, house, 9.1, 2.0) - INK).max() < 12
    assert np.abs(colour_at(image, house, 6.0, 0.5) - ROOM_COLOURS["bedroom"]).max() < 12
    assert np.abs(colour_at(image, house, 4.5, 3.6) - ROOM_COLOURS["living_room"]).max() < 12
    assert colour_at(image, house, 5.0, 1.3).sum() > 600  # the door
    assert colour_at(image, house, 2.5, -0.18).sum() > 400  # a window


def test_furniture_and_graph_change_the_picture_where_they_are():
    house = two_rooms()
    bare = paint_plan(dataclasses.replace(house, placements=()), pixels_per_metre=SCALE)
    full = paint_plan(house, pixels_per_metre=SCALE)
    graph = build_graph(house)
    walked = paint_plan(house, pixels_per_metre=SCALE, graph=graph, path=graph.path(0, len(graph.ids) - 1))
    assert (colour_at(bare, house, 1.7, 1.5) != colour_at(full, house, 1.7, 1.5)).any()
    assert (np.asarray(full) != np.asarray(walked)).any()
    assert bare.size == full.size == walked.size


def test_people_and_the_walker_are_seen_from_above():
    house = two_rooms()
    person = Placement("person_1", "hand/person", "person", house.rooms[0].id, (2.5, 3.0, 0.0), 0.0, (0.5, 0.4, 1.7))
    inhabited = dataclasses.replace(house, placements=(*house.placements, person))
    assert (
        np.abs(colour_at(paint_plan(inhabited, pixels_per_metre=SCALE), house, 2.68, 3.0) - (233, 138, 60)).max() < 30
    )  # a shoulder
    graph = build_graph(house)
    walked = [paint_plan(house, pixels_per_metre=SCALE, graph=graph, path=(0,), facing=f) for f in (None, 0.0, math.pi)]
    x, y = graph.positions[0][:2]
    blue = [colour_at(image, house, x + 0.2, y)[2] > colour_at(image, house, x + 0.2, y)[0] + 100 for image in walked]
    assert blue == [False, True, False]


def test_a_plan_is_the_same_every_time_and_saves_as_png(tmp_path):
    house = two_rooms()
    save_plan(house, tmp_path / "plan.png", pixels_per_metre=30.0)
    first = (tmp_path / "plan.png").read_bytes()
    save_plan(house, tmp_path / "plan.png", pixels_per_metre=30.0)
    assert first[:4] == b"\x89PNG" and first == (tmp_path / "plan.png").read_bytes()


def test_a_storey_that_is_not_there_is_refused():
    with pytest.raises(ValueError, match="no rooms on storey 3"):
        paint_plan(two_rooms(), storey=3)
