"""Truths about the House record: it survives JSON, and nonsense is refused with a message that helps."""

from __future__ import annotations

import dataclasses
import json
import math

import pytest
from conftest import two_rooms

from embodied.house.house import House, HouseError, Light, Placement, Sky, check


def with_opening(number: int, **changes) -> House:
    house = two_rooms()
    openings = list(house.openings)
    openings[number] = dataclasses.replace(openings[number], **changes)
    return dataclasses.replace(house, openings=tuple(openings))


def with_thing(**changes) -> House:
    house = two_rooms()
    return dataclasses.replace(house, placements=(dataclasses.replace(house.placements[0], **changes),))


def test_a_house_survives_json_and_a_file(tmp_path):
    house = two_rooms()
    assert House.from_json(house.to_json()) == house
    house.save(tmp_path / "house.json")
    assert House.load(tmp_path / "house.json").digest == house.digest


def test_any_change_changes_the_digest():
    house = two_rooms()
    moved = with_thing(position=(2.5, 2.0, 0.0001))
    assert len({house.digest, moved.digest, dataclasses.replace(house, sky=Sky(hour=12.0)).digest}) == 3


def test_floors_are_rooms_less_half_a_wall():
    house = two_rooms()
    assert house.floor(house.rooms[0]).area == pytest.approx((5 - 0.12) * (4 - 0.12))
    assert house.area == pytest.approx(36.0)


NONSENSE = {
    "no door": lambda h: dataclasses.replace(h, openings=h.openings[1:]),
    "overlap": lambda h: dataclasses.replace(
        h, rooms=(h.rooms[0], dataclasses.replace(h.rooms[1], polygon=((4.0, 0.0), (9.0, 0.0), (9.0, 4.0), (4.0, 4.0))))
    ),
    "clockwise|counter-clockwise": lambda h: dataclasses.replace(
        h, rooms=(dataclasses.replace(h.rooms[0], polygon=h.rooms[0].polygon[::-1]), h.rooms[1])
    ),
    "share the ids": lambda h: dataclasses.replace(h, rooms=(h.rooms[0], h.rooms[0])),
    "unknown room": lambda h: dataclasses.replace(
        h, placements=(dataclasses.replace(h.placements[0], room="attic_1"),)
    ),
    "outside its room": lambda h: with_thing(position=(20.0, 2.0, 0.0)),
    "not finite": lambda h: with_thing(yaw=math.nan),
    "must be positive": lambda h: with_thing(size=(1.0, 0.0, 1.0)),
    "rests on the unknown": lambda h: with_thing(parent="table_9"),
    "rests on itself": lambda h: with_thing(parent="rug_1"),
    "does not lie on a wall": lambda h: with_opening(2, a=(1.5, 1.0), b=(3.5, 1.0)),
    "behind its wall lies room": lambda h: with_opening(2, a=(5.0, 3.0), b=(5.0, 2.0)),
    "should lead outdoors": lambda h: with_opening(2, rooms=("living_room_1", "bedroom_1"), a=(5.0, 3.0), b=(5.0, 2.0)),
    "overlap; move one": lambda h: with_opening(2, a=(0.0, 2.5), b=(0.0, 1.2)),
    "sill < head": lambda h: with_opening(2, sill=2.5),
    "its storey is": lambda h: with_opening(2, head=3.1),
    "hinge": lambda h: with_opening(0, hinge="left"),
    "wide": lambda h: with_opening(2, a=(1.5, 0.0), b=(1.6, 0.0)),
    "cannot be reached": lambda h: dataclasses.replace(
        h,
        openings=(
            dataclasses.replace(h.openings[0], kind="back_door", rooms=("bedroom_1", None), a=(9.0, 1.0), b=(9.0, 2.0)),
            *h.openings[1:],
        ),
    ),
    "storeys": lambda h: dataclasses.replace(h, storeys=(dataclasses.replace(h.storeys[0], height=1.0),)),
    "weather": lambda h: dataclasses.replace(h, sky=Sky(weather="hail")),
    "names the unknown room": lambda h: dataclasses.replace(
        h, lights=(Light("light_1", "attic_1", None, (1.0, 1.0, 2.0), (1.0, 1.0, 1.0), 800.0),)
    ),
}


@pytest.mark.parametrize("message", NONSENSE)
def test_nonsense_is_refused_with_its_reason(message):
    house = two_rooms()
    check(house)
    with pytest.raises(HouseError, match=message):
        check(NONSENSE[message](house))


BROKEN = {
    "not JSON": lambda text: text[:-40],
    "schema 99": lambda text: text.replace('"schema":1', '"schema":99'),
    "no 'schema'": lambda text: "[]",
    "unknown fields": lambda text: text.replace('"seed":', '"sed":'),
    "lacks the fields": lambda text: json.dumps({k: v for k, v in json.loads(text).items() if k != "rooms"}),
    "should be a finite number": lambda text: text.replace('"outer_wall":0.32', '"outer_wall":NaN'),
    "should be str": lambda text: text.replace('"kind":"bedroom"', '"kind":7'),
    "should be a list": lambda text: text.replace('"lights":[]', '"lights":{}'),
}


@pytest.mark.parametrize("message", BROKEN)
def test_a_damaged_file_is_refused_and_named(message, tmp_path):
    text = two_rooms().to_json()
    broken = BROKEN[message](text)
    assert broken != text
    (tmp_path / "house.json").write_text(broken)
    with pytest.raises(HouseError, match=message) as error:
        House.load(tmp_path / "house.json")
    assert "house.json" in str(error.value)


def test_objects_may_touch_the_wall_they_hang_on():
    house = two_rooms()
    clock = Placement("clock_1", "hand/clock", "clock", "living_room_1", (2.5, 0.06, 1.8), math.pi, (0.3, 0.05, 0.3))
    check(dataclasses.replace(house, placements=(*house.placements, clock)))
