"""embodied.viz.described: what HARI's assistant spoke of, where it is."""

import numpy as np
import pytest
from hand_worlds import HandWorld, hand_graph, room, thing

from embodied.assistants.descriptions import Describer, spoken_of
from embodied.house.house import House, Opening, Storey
from embodied.interface import Feature, Pose
from embodied.viz.described import label, middle, panorama_pixels


@pytest.fixture
def hall() -> HandWorld:
    """A viewpoint in the middle of a hall with a mug to the east, one to the north and a book to the west."""
    here = room("hall_1", "hall", 0, 0, 10, 10)
    door = Opening("front_door_1", "front_door", ("hall_1", None), (0, 1.5), (0, 0.5), 0.0, 2.1)
    things = (thing("mug", 1, "hall_1", 8, 5), thing("mug", 2, "hall_1", 5, 8), thing("book", 1, "hall_1", 2, 5))
    graph = hand_graph([[5, 5, 1.5], [9, 5, 1.5]], [[0, 1]], ["hall_1"] * 2)
    return HandWorld(House(0, "hall", (Storey(0.0, 2.6),), (here,), (door,), things, ()), graph)


def test_marks_are_on_what_was_said_and_on_nothing_else(hall):
    say = Describer(("mug",))
    assert [p.id for _, p in spoken_of(hall, 0, say.sparse(hall, 0))] == ["mug_1", "mug_2"]
    assert {p.id for _, p in spoken_of(hall, 0, say.dense(hall, 0))} == {"mug_1", "mug_2", "book_1"}
    east = [f for f in say.sparse(hall, 0) if f.horizontal == 0]
    assert [p.id for _, p in spoken_of(hall, 0, tuple(east))] == ["mug_1"], "not the other mug"


@pytest.mark.parametrize(("turn", "columns"), [(0, [256, 128, 0]), (3, [384, 256, 128])])
def test_names_stand_where_the_panorama_shows_the_thing(hall, turn, columns):
    """512 pixels round, the gaze in the middle; a quarter to the left is 128 pixels to the left."""
    things = sorted(hall.house.placements, key=lambda p: ["mug_1", "mug_2", "book_1"].index(p.id))
    at = panorama_pixels(hall, Pose(0, turn), things, 256)
    assert at[:, 0] == pytest.approx(columns)
    drop = np.degrees(np.arctan2(1.5 - middle(things[0])[2], 3.0))
    assert at[0, 1] == pytest.approx(128 + drop * 256 / 180)


def test_a_label_names_the_thing_and_how_far_it_is():
    assert label(Feature("object", "floor_lamp", 1, 0, 2)) == "floor lamp (2 m)"
