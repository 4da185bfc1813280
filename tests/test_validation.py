"""Truths about house files against the catalogue: what nobody has heard of is refused by name, with a remedy."""

from __future__ import annotations

import dataclasses
import functools

import pytest
from hand_worlds import generated

from embodied.assets.catalogue import Catalogue, load_catalogue
from embodied.assets.json_file import RecordError
from embodied.assets.records import ROOM_KINDS
from embodied.generate import HouseConfig, generate_house
from embodied.generate.furnish.tables import tables
from embodied.house.floor_plan import ROOM_COLOURS
from embodied.house.house import House, HouseError, Placement
from embodied.house.validation import check_known, load_house
from embodied.language.lexicon import ROOM_NOUNS
from embodied.mattersim.pictures import REGIONS


@functools.cache
def catalogue() -> Catalogue:
    return load_catalogue()


@functools.cache
def flat() -> House:
    return generate_house(3, HouseConfig(area=(45.0, 55.0)), catalogue())


def edited(wanted, **changes) -> House:
    """The flat with its first placement that is `wanted` changed."""
    number = next(i for i, p in enumerate(flat().placements) if wanted(p))
    things = list(flat().placements)
    things[number] = dataclasses.replace(things[number], **changes)
    return dataclasses.replace(flat(), placements=tuple(things))


def anything(p: Placement) -> bool:
    return p.parent is None


def painted(**changes) -> House:
    return dataclasses.replace(flat(), rooms=(dataclasses.replace(flat().rooms[0], **changes), *flat().rooms[1:]))


def leafed(key: str) -> House:
    first = dataclasses.replace(flat().openings[0], leaf_finish=key)
    return dataclasses.replace(flat(), openings=(first, *flat().openings[1:]))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 104))
def test_what_the_generator_makes_is_known(seed):
    check_known(generated(seed), catalogue())


NONSENSE = {
    "unknown style 'rococo'": lambda: dataclasses.replace(flat(), style="rococo"),
    "unknown asset 'built/throne'": lambda: edited(anything, asset="built/throne"),
    "is called a 'dragon'": lambda: edited(anything, object_class="dragon"),
    "unknown parameter 'colour'; .* takes": lambda: edited(anything, params=(("colour", "red"),)),
    "seed='many'; a value like 0.0": lambda: edited(lambda p: p.asset.startswith("built/"), params=(("seed", "many"),)),
    "unknown surface 'roof' of": lambda: edited(lambda p: p.surface is not None, surface="roof"),
    "unknown surface 'top' of None": lambda: edited(anything, surface="top"),
    "has the unknown material 'gold/7'": lambda: painted(floor_finish="gold/7"),
    "unknown material 'cheese'": lambda: painted(accent_finish="cheese", accent_wall=0),
    "opening .* unknown material 'tin'": lambda: leafed("tin"),
}


@pytest.mark.slow
@pytest.mark.parametrize("message", NONSENSE)
def test_what_nobody_knows_is_refused(message):
    with pytest.raises(HouseError, match=message):
        check_known(NONSENSE[message](), catalogue())


@pytest.mark.slow
def test_a_slip_of_the_pen_gets_a_suggestion():
    key = next(r.floor_finish for r in flat().rooms)
    with pytest.raises(HouseError, match=f"did you mean .*{key}"):
        check_known(painted(floor_finish=key.replace("_", "-", 1) + "x"), catalogue())


@pytest.mark.slow
def test_a_file_is_named_with_what_is_wrong_in_it(tmp_path):
    path = tmp_path / "house.json"
    flat().save(path)
    assert load_house(path, catalogue()) == flat()
    NONSENSE["is called a 'dragon'"]().save(path)
    with pytest.raises(HouseError, match=r"house\.json: .*'dragon'"):
        load_house(path, catalogue())


def test_parameters_are_those_of_the_maker():
    built = catalogue().parameters("built/art_shapes_0")
    assert built["seed"] == 0.0 and built["art"] == "art_shapes/0"
    model = next(k for k in catalogue().assets if not k.startswith("built/"))
    assert catalogue().parameters(model) == {}
    with pytest.raises(RecordError, match="no asset"):
        catalogue().parameters("built/throne")


TABLES_OF_ROOM_KINDS = {
    "generate/furnish/rooms.toml": tables().rooms,
    "language/words.toml": ROOM_NOUNS,
    "house/floor_plan.toml": ROOM_COLOURS,
    "mattersim/pictures.py": REGIONS,
}


@pytest.mark.parametrize("table", TABLES_OF_ROOM_KINDS.values(), ids=TABLES_OF_ROOM_KINDS)
def test_every_kind_of_room_stands_in_every_table_of_kinds(table):
    """docs/houses.md, A new kind of room: what was forgotten is named."""
    assert set(table) >= set(ROOM_KINDS)


def test_something_is_at_home_in_every_kind_of_room():
    things = [a for name in catalogue().classes for a in catalogue().of_class(name)]
    assert {kind for a in things for kind in a.rooms} >= set(ROOM_KINDS)
