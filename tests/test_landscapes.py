"""What is seen through windows: landscapes, seasons, neighbours, haze, lit windows."""

from __future__ import annotations

import dataclasses
import itertools
import json
import os
import subprocess
import sys

import mujoco
import numpy as np
import pytest
import shapely

from embodied.assets.catalogue import load_catalogue
from embodied.generate import HouseConfig
from embodied.house.house import LANDSCAPES, SEASONS, House, HouseError, Sky
from embodied.light.tracing.sky import paint
from embodied.scene import far_canvas
from embodied.scene.landscapes import TABLE, Scenery, near_buildings, scenery_of
from embodied.scene.model import build_spec, compile_scene, owner_of_name
from embodied.scene.outdoors import PIECES, footprint, outdoor_parts


def at(house: House, landscape: str | None, season: str | None = None, seed: int = 0) -> House:
    return dataclasses.replace(house, seed=seed, sky=Sky(landscape=landscape, season=season))


LOOK = """
import dataclasses, hashlib, conftest
from embodied.scene.landscapes import near_buildings, scenery_of
from embodied.scene.backdrop import plain_picture
h = [dataclasses.replace(conftest.two_rooms(), seed=s) for s in range(12)]
print([scenery_of(x) for x in h], near_buildings(h[0], scenery_of(h[0])))
print(hashlib.sha256(plain_picture(scenery_of(h[3]), 3, 64).tobytes()).hexdigest())
"""


def test_the_same_seed_gives_the_same_landscape_in_another_process():
    def look(hash_seed: str) -> bytes:
        env = {**os.environ, "PYTHONHASHSEED": hash_seed}
        return subprocess.run(
            [sys.executable, "-c", LOOK], capture_output=True, check=True, cwd="tests", env=env
        ).stdout

    assert look("1") == look("2") != b""


def test_every_landscape_and_season_is_drawn_and_what_the_sky_names_is_kept(two_room_house):
    drawn = [scenery_of(dataclasses.replace(two_room_house, seed=s)) for s in range(300)]
    assert {p.landscape for p in drawn} == set(LANDSCAPES) == set(TABLE) and {p.season for p in drawn} == set(SEASONS)
    assert all(scenery_of(at(two_room_house, "lake", "winter", s)).landscape == "lake" for s in range(5))
    seasons = [scenery_of(at(two_room_house, "lake", None, s)).season for s in range(40)]
    assert seasons == [p.season for p in drawn[:40]], "a landscape that is given draws no other season"


def test_a_house_with_a_garage_stands_on_the_ground(two_room_house):
    door = dataclasses.replace(two_room_house.openings[1], kind="garage_door")
    house = dataclasses.replace(two_room_house, openings=(two_room_house.openings[0], door))
    assert all(scenery_of(dataclasses.replace(house, seed=s)).height < 1 for s in range(100))


def test_an_unknown_landscape_or_season_is_refused_by_name(two_room_house):
    with pytest.raises(HouseError, match=r"landscape should be one of .*'lake'.*got 'moon'"):
        HouseConfig(landscape="moon")
    with pytest.raises(HouseError, match=r"season should be one of .*got 'monsoon'"):
        HouseConfig(season="monsoon")
    body = json.loads(two_room_house.to_json())
    assert "landscape" not in body["sky"], "older versions read it, and its digest is what it was"
    body["sky"]["landscape"] = "moon"
    with pytest.raises(HouseError, match="landscape"):
        House.from_json(json.dumps(body))
    body["sky"]["landscape"] = "lake"
    assert House.from_json(json.dumps(body)).sky.landscape == "lake"


@pytest.mark.parametrize("landscape", LANDSCAPES)
def test_each_landscape_compiles_and_stands_outside_the_house(two_room_house, landscape):
    catalogue = load_catalogue()
    season = SEASONS[LANDSCAPES.index(landscape) % 4]
    house = at(two_room_house, landscape, season, seed=2)
    inner = footprint(house, 0)
    for p in outdoor_parts(house, catalogue.finish):
        assert p.owner.removeprefix("outdoor/") in PIECES
        c, s = np.cos(p.yaw), np.sin(p.yaw)
        xy = p.mesh.vertices[:, :2] @ np.array([[c, s], [-s, c]]) + p.position[:2]
        assert np.abs(xy).max() < 0.8 * far_canvas.DOME_RADIUS
        if p.owner in ("outdoor/trees", "outdoor/neighbours", "outdoor/windows", "outdoor/street", "outdoor/border"):
            assert not shapely.contains_xy(inner.buffer(1.0), xy).any(), p.mesh_key
    model = build_spec(house, catalogue, collisions=False).compile()
    assert np.isfinite(model.geom_aabb).all()


def test_the_dome_has_no_id_and_a_ray_out_of_the_window_ends_on_it(two_room_house):
    scene = compile_scene(at(two_room_house, "lake"), load_catalogue(), collisions=False)
    dome = [g for g in range(scene.model.ngeom) if owner_of_name(scene.model.geom(g).name) == far_canvas.DOME]
    assert len(dome) == 1 and scene.owner_of_geom[dome[0]] == 0 and scene.room_of_geom[dome[0]] == ""
    data, hit = mujoco.MjData(scene.model), np.zeros(1, np.int32)
    mujoco.mj_forward(scene.model, data)
    away = mujoco.mj_ray(scene.model, data, np.array([2.5, -30.0, 2.0]), np.array([0.0, -1.0, 0.0]), None, 1, -1, hit)
    assert hit[0] == dome[0] and 0.9 * far_canvas.DOME_RADIUS - 32 < away < far_canvas.DOME_RADIUS


def test_neighbours_do_not_overlap_the_plot_and_only_three_landscapes_have_them(two_room_house):
    for name in LANDSCAPES:
        house = at(two_room_house, name, seed=4)
        near = near_buildings(house, scenery_of(house))
        assert bool(near) == (name in ("suburb", "village", "street"))
        assert all(footprint(house, 0).distance(shapely.Point(b.at)) > 15 for b in near)


def test_what_is_left_of_contrast_falls_with_distance_to_a_fiftieth_at_the_visibility():
    left = far_canvas.transmittance(np.array([0.0, 10.0, 400.0, 3e3, 12e3]), 12e3)
    assert np.allclose(left[0], 1) and left[-1, 1] == pytest.approx(0.02, rel=0.01)
    assert all((a > b).all() for a, b in itertools.pairwise(left)) and (left[-1, 2] < left[-1, 0]), "hills turn blue"


@pytest.mark.parametrize("landscape", ["street", "roofs"])
def test_windows_are_lit_at_night_and_not_by_day(landscape):
    place = Scenery(landscape, "summer", TABLE[landscape].heights[-1], 0.0)
    night, noon = paint(Sky(23.0), 1, place, 256), paint(Sky(12.0), 1, place, 256)
    assert night.lamps == 1 and noon.lamps == 0
    warm = lambda o: (o.fine[..., 0] > 1.5 * o.fine[..., 2]) & (o.fine[..., 0] > 20 * np.median(o.fine[..., 0]))
    assert warm(night).sum() > 100 and warm(noon).sum() == 0
