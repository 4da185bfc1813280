"""What `import embodied` offers, and floor plans of people's own."""

from __future__ import annotations

import doctest
import functools
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely
from hand_data import built, drawn_house

import embodied
from embodied.assets.built import BASICS
from embodied.datasets import build as building
from embodied.generate import HouseConfig, stages
from embodied.generate.config import DeadEndError
from embodied.generate.plan_file import house_of_plan, load_plan
from embodied.house.house import HouseError

ROOMS = [
    {"kind": "hall", "polygon": [[0, 0], [1.8, 0], [1.8, 7], [0, 7]]},
    {"kind": "living_room", "polygon": [[1.8, 0], [7, 0], [7, 4], [1.8, 4]]},
    {"kind": "kitchen", "polygon": [[1.8, 4], [4.8, 4], [4.8, 7], [1.8, 7]]},
    {"kind": "main_bedroom", "polygon": [[-3.6, 0], [0, 0], [0, 4], [-3.6, 4]]},
    {"kind": "bathroom", "polygon": [[-3.6, 4], [0, 4], [0, 7], [-3.6, 7]]},
]


MADE = """load_catalogue HouseConfig generate_house House load_house load_plan house_of_plan open_world open_folder
build_graph DatasetConfig build_dataset draw_panoramas Dataset baseline play evaluate Observation Move Stop"""
"""Names whose examples make what those of other names use, in this order."""


def written(tmp_path, rooms):
    path = tmp_path / "plan.json"
    path.write_text(json.dumps({"rooms": rooms}))
    return path


def test_import_embodied_and_help_load_nothing_heavy_and_names_are_completed():
    heavy = {"numpy", "shapely", "mujoco", "torch", "gymnasium", "embodied.cli.house"}
    code = "import sys, embodied, embodied.cli as c\ntry: c.main(['--help'])\nexcept SystemExit: print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600, check=True)
    assert not heavy & set(done.stdout.splitlines()[-1].split())
    assert set(dir(embodied)) == set(embodied.__all__)
    missing = [name for name in embodied.__all__ if name not in embodied.__doc__ and name != "__version__"]
    assert set(missing) == {"Renderer", "build_graph"}, "help(embodied) names all but two"
    assert embodied.__version__.split(".")[0].isdigit()
    with pytest.raises(AttributeError, match="it offers"):
        embodied.nothing  # noqa: B018  the access is the test


@pytest.mark.slow
def test_the_example_of_every_public_name_runs(tmp_path, monkeypatch):
    built(tmp_path / "data" / "hanna", make_house=drawn_house)
    written(tmp_path, ROOMS[:1])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(building, "load_catalogue", functools.cache(building.load_catalogue))
    names = {"embodied": embodied, "Path": Path}
    runner, finder = doctest.DocTestRunner(), doctest.DocTestFinder(recurse=False)
    for name in [*MADE.split(), *(n for n in embodied.__all__ if n not in MADE.split() and n != "__version__")]:
        (example,) = finder.find(getattr(embodied, name), name, module=False, globs=names)
        assert example.examples, f"{name} has no example"
        example.globs = names
        assert runner.run(example, clear_globs=False).failed == 0, name
    names["world"].close()


def test_a_floor_plan_from_a_file_becomes_a_furnished_house_with_these_very_rooms(tmp_path):
    house = house_of_plan(load_plan(written(tmp_path, ROOMS)), seed=0)
    made = {room.kind: shapely.Polygon(room.polygon) for room in house.rooms}
    assert all(made[room["kind"]].equals(shapely.Polygon(room["polygon"])) for room in ROOMS)
    assert {p.room.rsplit("_", 1)[0] for p in house.placements} == set(made)
    assert not {p.asset for p in house.placements} & BASICS, "installed furniture stands in for simple one"
    assert len(repr(house)) < 100


def test_a_room_that_stays_closed_has_doors_and_furniture_drawn_anew(tmp_path, monkeypatch):
    plan, asked = load_plan(written(tmp_path, ROOMS)), []

    def closed_at_first(house):
        asked.append(house)
        if len(asked) == 1:
            raise DeadEndError("room 'kitchen_1' cannot be entered on foot")
        return house

    monkeypatch.setattr(stages, "remove_blocking_objects", closed_at_first)
    house = house_of_plan(plan, seed=0)
    assert house.placements and house.openings != asked[0].openings
    assert [r.polygon for r in house.rooms] == [r.polygon for r in asked[0].rooms]


@pytest.mark.parametrize("setting", [{"area": (40, 60)}, {"rooms": 3}, {"shape": "L"}])
def test_settings_that_a_plan_decides_are_refused(tmp_path, setting):
    with pytest.raises(HouseError, match=f"leave out {next(iter(setting))}"):
        house_of_plan(load_plan(written(tmp_path, ROOMS)), 0, HouseConfig(**setting))


def on_corners(change):
    return [dict(room, polygon=change([list(map(float, c)) for c in room["polygon"]])) for room in ROOMS]


def scaled(times, shift=0.0):
    return on_corners(lambda corners: [[x * times + shift, y * times] for x, y in corners])


@pytest.mark.parametrize(
    "rooms",
    [
        on_corners(lambda c: [*c, c[0]]),
        on_corners(lambda c: [c[0], *c]),
        on_corners(lambda c: [c[0], [(c[0][0] + c[1][0]) / 2, (c[0][1] + c[1][1]) / 2], *c[1:]]),
        on_corners(lambda c: [[float(np.float32(x)) + 1e-7, y] for x, y in c]),
        on_corners(lambda c: c[::-1]),
    ],
    ids=["closed", "corner_twice", "point_on_an_edge", "noise", "clockwise"],
)
def test_a_plan_may_be_written_as_other_programs_write_it(tmp_path, rooms):
    assert load_plan(written(tmp_path, rooms)) == load_plan(written(tmp_path, ROOMS))


@pytest.mark.parametrize(
    ("rooms", "complaint"),
    [
        (ROOMS[1:], "needs a room of kind 'hall'"),
        ([*ROOMS, {"kind": "study", "polygon": [[6, 3], [9, 3], [9, 6], [6, 6]]}], "overlap"),
        ([*ROOMS, {"kind": "study", "polygon": [[9, 0], [12, 0], [12, 3], [9, 3]]}], "cannot be entered"),
        ([{"kind": "hall", "polygon": [[0, 0], [3, 0], [0, 3]]}], "room 0 .hall. should be a rectangle"),
        ([{"kind": "hall", "polygon": [[0, 0], [3.05, 0], [3.05, 3], [0, 3]]}], "grid of 0.1 m"),
        ([{"kind": "hll", "polygon": []}], "has the kind 'hll'; use one of living_room"),
        ([{"kind": "hall"}], "polygon.*a plan is"),
        ([{**ROOMS[0], "name": "x"}], "name.*a plan is"),
        ([{"kind": "attic", "polygon": []}], "has the kind 'attic'"),
        (scaled(100), "look like centimetres: multiply all numbers by 0.01"),
        (scaled(1000), "look like millimetres"),
        (scaled(1 / 0.3048), "look like feet"),
        (scaled(1, 5e5), "within 1000 m"),
        ([*ROOMS, {"kind": "garage", "polygon": [[20, 0], [60, 0], [60, 40], [20, 40]]}], "may have 1500 m2"),
    ],
)
def test_a_plan_that_cannot_be_built_is_refused_with_what_to_do(tmp_path, rooms, complaint):
    with pytest.raises(HouseError, match=complaint):
        load_plan(written(tmp_path, rooms))
