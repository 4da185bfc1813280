"""Truths about the House record: it survives JSON, and nonsense is refused with a message that helps."""

from __future__ import annotations

import dataclasses
import json
import math

import hypothesis
import hypothesis.strategies as st
import pytest
from conftest import two_rooms

from embodied.house import House
from embodied.house.house import HouseError, Light, Placement, Sky, Stair, Storey, check


def with_opening(number: int, **changes) -> House:
    house = two_rooms()
    openings = list(house.openings)
    openings[number] = dataclasses.replace(openings[number], **changes)
    return dataclasses.replace(house, openings=tuple(openings))


def with_thing(**changes) -> House:
    house = two_rooms()
    return dataclasses.replace(house, placements=(dataclasses.replace(house.placements[0], **changes),))


def with_light(**changes) -> House:
    light = Light("light_1", "bedroom_1", None, (6.0, 1.0, 2.0), (1.0, 1.0, 1.0), 800.0)
    return dataclasses.replace(two_rooms(), lights=(dataclasses.replace(light, **changes),))


def test_a_house_survives_a_file(tmp_path):
    house = with_thing(params=(("finish", "oak/1"), ("open", 0.5), ("turned", 0.0)))
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
    "below or above its room": lambda h: with_thing(position=(2.5, 2.0, 50.0)),
    "at most 30": lambda h: with_thing(size=(1e6, 1.0, 1.0)),
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
    "storeys .1. have no room": lambda h: dataclasses.replace(h, storeys=(*h.storeys, Storey(3.0, 2.5))),
    "below the ceiling of storey 0": lambda h: dataclasses.replace(h, storeys=(*h.storeys, Storey(2.0, 2.5))),
    "does not fit into its room 'living_room_1'": lambda h: with_thing(size=(30.0, 30.0, 30.0)),
    "at least 0.0001": lambda h: with_thing(size=(1e-9, 1e-9, 1e-9)),
    "shines at .* outside its room": lambda h: with_light(position=(-9.0, 1.0, 2.0)),
    "of 1.8 to 20 m": lambda h: dataclasses.replace(h, storeys=(dataclasses.replace(h.storeys[0], height=1.0),)),
    "unknown object 'ghost'": lambda h: with_light(placement="ghost"),
    "stair 's'": lambda h: dataclasses.replace(h, stairs=(Stair("s", ("a", "b"), (), 1.0, 3),)),
    "weather": lambda h: dataclasses.replace(h, sky=Sky(weather="hail")),
    "names the unknown room": lambda h: with_light(room="attic_1"),
}


@pytest.mark.parametrize("message", NONSENSE)
def test_nonsense_is_refused_with_its_reason(message):
    house = two_rooms()
    check(house)
    with pytest.raises(HouseError, match=message):
        check(NONSENSE[message](house))


BROKEN = {
    "expected a house as JSON": lambda text: text[:-40],
    "no 'schema'": lambda text: "[]",
    "unknown fields": lambda text: text.replace('"seed":', '"sed":'),
    "lacks the fields": lambda text: json.dumps({k: v for k, v in json.loads(text).items() if k != "rooms"}),
    "NaN is no JSON": lambda text: text.replace('"outer_wall":0.32', '"outer_wall":NaN'),
    "1e999 is too large": lambda text: text.replace('"outer_wall":0.32', '"outer_wall":1e999'),
    "should be a finite number": lambda text: text.replace('"outer_wall":0.32', '"outer_wall":1e300'),
    "should be a text": lambda text: text.replace('"kind":"bedroom"', '"kind":7'),
    "should be a list": lambda text: text.replace('"lights":[]', '"lights":{}'),
    r"placements\[0\] \('rug_1'\).yaw should be a number, got 'north'": lambda text: text.replace(
        '"yaw":0.0', '"yaw":"north"'
    ),
    "this version reads 1": lambda text: text.replace('"schema":1', '"schema":99'),
    "unknown kind 'dungeon'": lambda text: text.replace('"kind":"bedroom"', '"kind":"dungeon"'),
    "an id is made of": lambda text: text.replace('"bedroom_1"', '"../up"'),
    "its walls are 0 to 3": lambda text: text.replace('"accent_wall":null', '"accent_wall":9'),
    "401 digits": lambda text: text.replace('"outer_wall":0.32', f'"outer_wall":{10**400}'),
    "disorder": lambda text: text.replace('"disorder":', '"disorder":7'),
    "'seed' stands there twice": lambda text: text.replace('"seed":0', '"seed":0,"seed":1'),
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


# What Hypothesis thinks of ----------------------------------------------------------------------

NUMBERS = st.floats(-2.0, 2.0, allow_subnormal=False)
NAMES = st.text("abcdefghijklmnopqrstuvwxyz_'.-", min_size=1, max_size=12)
PARAMS = st.lists(st.tuples(NAMES, st.one_of(st.text(max_size=20), NUMBERS)), max_size=3).map(tuple)
RUGS = st.builds(
    Placement,
    id=NAMES,
    asset=st.text(max_size=20),
    object_class=st.text(max_size=20),
    room=st.just("living_room_1"),
    position=st.tuples(st.floats(0.1, 4.9), st.floats(0.1, 3.9), st.floats(0.0, 2.5)),
    yaw=st.floats(-4.0, 4.0),
    size=st.tuples(*[st.floats(0.01, 2.5)] * 3),
    params=PARAMS,
    group=st.none() | st.text(max_size=10),
)
LAMPS = st.builds(
    Light,
    id=NAMES,
    room=st.just("bedroom_1"),
    placement=st.none(),
    position=st.tuples(st.floats(5.1, 8.9), st.floats(0.1, 3.9), st.floats(0.0, 2.5)),
    color=st.tuples(*[st.floats(0.0, 1.0)] * 3),
    power=st.floats(0.0, 5000.0),
    on=st.booleans(),
)
SKIES = st.builds(
    Sky, hour=st.floats(0.0, 23.9), weather=st.sampled_from(["clear", "hazy", "overcast"]), north=st.floats(-4.0, 4.0)
)


SLOW = hypothesis.HealthCheck.too_slow
"""Speaks of the machine's load and not of what is tested."""


@pytest.mark.slow
@hypothesis.settings(derandomize=True, deadline=None, suppress_health_check=[SLOW])
@hypothesis.given(
    rugs=st.lists(RUGS, max_size=3, unique_by=lambda p: p.id),
    lamps=st.lists(LAMPS, max_size=3, unique_by=lambda x: x.id),
    sky=SKIES,
    seed=st.integers(),
    name=st.text(max_size=30),
)
def test_any_house_that_passes_the_check_survives_json(rugs, lamps, sky, seed, name):
    house = dataclasses.replace(two_rooms(), placements=tuple(rugs), lights=tuple(lamps), sky=sky, seed=seed, name=name)
    check(house)
    again = House.from_json(house.to_json())
    assert again == house and again.digest == house.digest


JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from([1e-9, 30.0, 1e300, -1, "north", "living_room_1"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


def places(value: object, path: tuple = ()) -> list[tuple]:
    """The way to every value inside a JSON value."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(p for k, v in inner for p in places(v, (*path, k)))]


@pytest.mark.slow
@hypothesis.settings(max_examples=300, derandomize=True, deadline=None, suppress_health_check=[SLOW])
@hypothesis.given(data=st.data())
def test_a_house_file_with_any_value_changed_is_refused_with_a_reason_or_is_a_house(data):
    body = json.loads(with_light().to_json())
    *way, last = data.draw(st.sampled_from([p for p in places(body) if p]))
    inside = body
    for key in way:
        inside = inside[key]
    if data.draw(st.booleans()):
        inside[last] = data.draw(JSON)
    else:
        del inside[last]
    try:
        house = House.from_json(json.dumps(body))
    except HouseError as error:
        assert len(str(error)) > 20 and "NaN to" not in str(error)
    else:
        assert House.from_json(house.to_json()) == house
