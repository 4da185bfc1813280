"""A user's own classes stand in generated houses, or it is said that they cannot."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from conftest import two_rooms
from handmade_models import CUBE, write_own, write_pack

from embodied.assets.catalogue import load_catalogue
from embodied.assets.json_file import RecordError
from embodied.generate import STAGES, HouseConfig, generate_house
from embodied.generate.furnish import furnish
from embodied.house.house import House
from embodied.house.validation import check_known
from embodied.navigation.graph import unreachable_rooms
from embodied.seeds import stream

DOCS = Path(__file__).parents[1] / "docs" / "assets.md"


def own_of(folder: Path, support: str, rooms: dict, **row) -> Path:
    own = write_own(
        folder,
        {"thing": {"file": "a.obj", "class": "gizmo", "size": [0.3, 0.2, 0.4], **row}},
        {"gizmo": {"support": support, "rooms": rooms}},
    )
    (own / "a.obj").write_text(CUBE)
    return own


@pytest.mark.parametrize(
    ("support", "row"),
    [
        ("floor", {}),
        ("against_wall", {}),
        ("corner", {}),
        ("wall", {"elevation": 1.4, "size": [0.4, 0.05, 0.4]}),
        ("ceiling", {"elevation": 0.1}),
    ],
)
def test_an_own_class_is_placed_however_it_is_held_up(tmp_path, support, row):
    own = own_of(tmp_path / "own", support, {"living_room": 1, "bedroom": 1}, **row)
    catalogue = load_catalogue(tmp_path, own=[own])
    assert catalogue.own_classes == ("gizmo",)
    found = [p for seed in range(4) for p in furnish(two_rooms(), catalogue, seed=seed).placements]
    mine = [p for p in found if p.object_class == "gizmo"]
    assert len(mine) >= 6
    for p in mine:
        height = {"wall": 1.4, "ceiling": 2.6 - 0.1 - 0.4}.get(support, 0.0)
        assert p.position[2] == pytest.approx(height, abs=0.02) and p.parent is None


def test_weights_say_how_often_and_where(tmp_path):
    catalogue = load_catalogue(tmp_path, own=[own_of(tmp_path / "own", "floor", {"living_room": 0.5})])
    houses = [furnish(two_rooms(), catalogue, seed=seed) for seed in range(12)]
    rooms = [p.room for h in houses for p in h.placements if p.object_class == "gizmo"]
    assert 2 <= len(rooms) <= 10 and set(rooms) == {"living_room_1"}


def test_houses_are_the_same_with_own_models_of_known_kinds_of_things_left_out(tmp_path):
    plain = load_catalogue(tmp_path)
    unplaced = load_catalogue(tmp_path, own=[own_of(tmp_path / "own", "floor", {"garage": 1})])
    assert furnish(two_rooms(), plain, seed=3).placements == furnish(two_rooms(), unplaced, seed=3).placements


@pytest.mark.parametrize(
    ("support", "rooms", "why"),
    [("floor", {}, '"rooms"'), ("surface", {"hall": 1}, '"on"'), ("wall", {"hall": 0}, '"rooms"')],
)
def test_a_class_that_no_house_can_hold_is_named_at_once(tmp_path, caplog, support, rooms, why):
    load_catalogue(tmp_path, own=[own_of(tmp_path / "own", support, rooms)])
    assert "'gizmo' is placed in no house" in caplog.text and why in caplog.text


def test_seeds_are_whole_numbers_of_any_kind(tmp_path):
    bare = {name: stage for name, stage in STAGES.items() if name != "furnish"}
    house = generate_house(np.int64(3), stages=bare)
    house.save(tmp_path / "house.json")
    assert House.load(tmp_path / "house.json").digest == generate_house(3, stages=bare).digest
    for seed in (3.0, "3", None, np.float32(3)):
        with pytest.raises(TypeError, match="a seed should be an integer, got"):
            generate_house(seed, stages=bare)
        with pytest.raises(TypeError, match="a seed should be an integer, got"):
            stream(seed, "name")


@pytest.mark.slow
def test_the_example_of_the_docs_places_its_gnomes(tmp_path):
    body = json.loads(re.search(r"```json\n(\{\n  \"pack\": \"mine\".*?)```", DOCS.read_text(), re.DOTALL)[1])
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "catalogue.json").write_text(json.dumps(body))
    for name in ("gnome.glb", "sofa.obj"):
        (tmp_path / "own" / name).write_text(CUBE)
    write_pack(tmp_path / "own" / "things.sh3f", {"things/box/box.obj": CUBE}, "things/box/box.obj")
    catalogue = load_catalogue(tmp_path, own=[tmp_path / "own"])
    houses = [generate_house(seed, HouseConfig(area=(60, 90)), catalogue=catalogue) for seed in range(8)]
    gnomes = [p for h in houses for p in h.placements if p.object_class == "garden gnome"]
    suitable = [r for h in houses for r in h.rooms if r.kind in ("sun_room", "hall")]
    assert suitable and gnomes
    for house in houses:
        check_known(house, catalogue)
        assert unreachable_rooms(house) == ()


def test_the_groups_of_the_docs_stand_in_living_rooms_as_they_are_arranged(tmp_path):
    (tmp_path / "groups.toml").write_text(re.search(r"```toml\n(.*?)```", DOCS.read_text(), re.DOTALL)[1])
    catalogue = load_catalogue(own=tmp_path)
    houses = [furnish(two_rooms(), catalogue, seed=seed) for seed in range(6)]
    pianos = [(h, p) for h in houses for p in h.placements if p.object_class == "upright piano"]
    mine = [(h, p) for h, p in pianos if "music_corner" in p.group]
    assert len(mine) >= 2
    for house, piano in mine:
        others = [p for p in house.placements if p.group == piano.group and p.parent is None]
        stool = next(p for p in others if p.object_class == "stool")
        front = np.subtract(stool.position[:2], piano.position[:2])
        assert front @ (math.sin(piano.yaw), -math.cos(piano.yaw)) > 0.2  # before it
        assert math.cos(stool.yaw - piano.yaw) < -0.9  # and looking at it


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[groups.a]\nparts = [{ role = 'sofa', at = 'nowhere' }]", "at should be one of"),
        ("[groups.a]\nparts = [{ role = 'sofa' }, { role = 'rug', of = 'chair' }]", "'chair'"),
        ("[groups.a]\nparts = [{ role = 'sofer' }]", "sofa"),
        ("[groups.a]\nparts = [{ role = 'sofa' }]\nlikes = { sun = 1 }", "likes should be one of"),
        ("[groups.a]\nlike = 'a'", "like 'a'"),
        ("[rooms.hall]\nrules = [{ group = 'none' }]", "rooms.hall"),
        ("[rooms.hall]\nrules = [{ group = 'plant', sized = 3 }]", "sized"),
        ("[choices.a]\nfirst = [{ group = 'a' }]", "back to itself"),
        ("[choices.sofa_group]\nfirst = [{ group = 'plant' }]", "both groups and choices"),
        ("groups = 3", "object"),
        ("[groups.a\nx", "groups.toml"),
    ],
)
def test_a_mistake_in_a_file_of_groups_is_named(tmp_path, text, why):
    (tmp_path / "groups.toml").write_text(text)
    with pytest.raises(RecordError, match=why) as e:
        furnish(two_rooms(), load_catalogue(own=tmp_path), seed=0)
    assert "groups.toml" in str(e.value)
