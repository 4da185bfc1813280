"""World: panoramas drawn when asked and kept, sightings that agree with them, caches that are not believed blindly."""

from __future__ import annotations

import dataclasses
import logging
import math
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, furnished

from embodied.cli import main
from embodied.house.house import HouseError
from embodied.navigation.graph import graph_of
from embodied.render.panorama_file import PanoramaFile
from embodied.world import World, open_folder, open_world

pytestmark = pytest.mark.gl

NODES = np.array([[2.5, 2.6, 1.5], [4.6, 1.05, 1.5], [6.5, 1.05, 1.5]])


@pytest.fixture(scope="module")
def house():
    return furnished(two_rooms())


@pytest.fixture
def world(house, tmp_path):
    with make(house, tmp_path) as w:
        yield w


def make(house, cache, **options) -> World:
    graph = graph_of(
        NODES, np.array([[0, 1], [1, 2]]), ("a", "b", "c"), ("living_room_1", "living_room_1", "bedroom_1")
    )
    return open_world(house, HandCatalogue(), cache, graph=graph, size=options.pop("size", 64), **options)


def test_nothing_is_drawn_until_asked(world, tmp_path):
    assert world._renderer is None and list(tmp_path.iterdir()) == []
    world.panorama(0)
    assert world._renderer is not None


def test_a_panorama_from_the_file_is_the_one_that_was_drawn(world):
    drawn = world.panorama(1)
    path = world.render_all()
    world.close()
    kept = world.panorama(1)
    assert path.exists() and world._renderer is None, "read, not drawn again"
    assert np.array_equal(kept.ids, drawn.ids)
    assert np.abs(kept.depth - drawn.depth).max() <= 0.0005 + 1e-6
    error = np.abs(kept.rgb.astype(int) - drawn.rgb)
    assert error.mean() < 1.25 and np.square(error).mean() < 255**2 / 10**4, "40 dB; files are JPEG of quality 90"


def test_a_camera_at_a_node_sees_a_face_of_its_panorama(world):
    face, size = world.panorama(0), (world.pictures.size,) * 2
    view = world.camera(world.graph.positions[0], math.pi / 2, 0.0, math.pi / 2, size)
    np.testing.assert_array_equal(view.ids, face.ids[1])
    np.testing.assert_array_equal(view.depth, face.depth[1])
    assert np.abs(view.rgb.astype(int) - face.rgb[1]).max() <= 2


def test_sightings_agree_with_the_panorama(world, house):
    seen = {s.placement: s for s in world.sightings(0)}
    assert {"red_box_1", "flag_1", "table_1", "mug_1"} <= set(seen)
    assert "red_box_2" not in seen, "it stands in the bedroom's far corner"
    for name in ("red_box_1", "flag_1", "table_1"):
        thing = house.placement_by_id[name]
        x, y, z = np.add(thing.position, (0, 0, thing.size[2] / 2)) - NODES[0]
        assert abs((seen[name].yaw - math.atan2(y, x) + math.pi) % (2 * math.pi) - math.pi) < 0.15, name
        assert abs(seen[name].pitch - math.atan2(z, math.hypot(x, y))) < 0.2, name
        assert seen[name].distance == pytest.approx(math.sqrt(x * x + y * y + z * z), abs=0.6), name
    sizes = [s.pixels for s in world.sightings(0)]
    assert sizes == sorted(sizes, reverse=True)
    ids = world.panorama(0).ids
    assert {world.owners[i - 1] for i in np.unique(ids[ids > 0])} & set(house.placement_by_id) == set(seen)


def test_sightings_are_kept_and_a_damaged_file_is_made_again(house, tmp_path):
    with make(house, tmp_path) as w:
        first = w.sightings(2)
    (file,) = (tmp_path / "sightings").iterdir()
    with make(house, tmp_path) as w:
        assert w.sightings(2) == first and w._renderer is None
    file.write_bytes(file.read_bytes()[:100])
    with make(house, tmp_path) as w:
        assert w.sightings(2) == first


def test_another_house_is_another_file(house, tmp_path):
    emptier = dataclasses.replace(house, placements=house.placements[:1])
    assert make(house, tmp_path).path != make(emptier, tmp_path).path
    assert make(house, tmp_path).path != make(house, tmp_path, size=32).path


def test_a_truncated_panorama_file_is_reported_and_drawn_again(world, caplog):
    path = world.render_all()
    world.close()
    path.write_bytes(path.read_bytes()[:-7])
    with caplog.at_level(logging.WARNING):
        world.render_all()
    assert "no complete panorama file" in caplog.text
    with PanoramaFile(path) as file:
        assert len(file) == 3


@pytest.mark.slow
def test_a_house_edited_after_its_panoramas_gets_new_ones(house, tmp_path, caplog):
    house.save(tmp_path / "house.json")
    w = open_folder(tmp_path, HandCatalogue(), tmp_path / "cache", size=16)
    path = w.render_all()
    w.close()
    edited = dataclasses.replace(house, placements=house.placements[:1])
    edited.save(tmp_path / "house.json")
    again = open_folder(tmp_path, HandCatalogue(), tmp_path / "cache", size=16)
    with caplog.at_level(logging.WARNING):
        again.render_all()
    again.close()
    assert path == again.path == tmp_path / "panoramas.pano"
    with PanoramaFile(path) as file:
        assert file.meta["house"] == edited.digest


def test_light_is_kept_beside_the_house_and_shown_by_its_folder(two_room_house, tmp_path, monkeypatch, caplog):
    (folder := tmp_path / "home").mkdir()
    house = two_room_house
    house.save(folder / "house.json")
    before = (folder / "house.json").read_bytes()
    manifest = {"key": "k", "total_seconds": 1, "processor_seconds": 1, "check": {}}
    baked = SimpleNamespace(manifest=manifest)
    monkeypatch.setattr("embodied.light.bake_all", lambda lightings, *_, **__: [baked for _ in lightings])
    monkeypatch.setattr("embodied.light.backend.device", lambda: "llvm")
    light = ["light", str(folder), "--cache", str(tmp_path)]
    assert main([*light, "--hour", "dusk"]) == main([*light, "--weather", "overcast", "--lights", "2"]) == 0
    assert (folder / "house.json").read_bytes() == before, "features belong to it"
    shown = open_folder(folder, cache=tmp_path).house
    assert (shown.sky.hour, shown.sky.weather) == (19.2, "overcast") and shown.placements == house.placements
    dataclasses.replace(house, seed=99).save(folder / "house.json")
    assert open_folder(folder, cache=tmp_path).house.sky == house.sky and "another house" in caplog.text
    (folder / "house.json").write_bytes(before)
    lights = folder / "lights.json"
    lights.write_text(lights.read_text().replace("overcast", "tea"))
    with pytest.raises(HouseError, match=r"lights\.json.*weather"):
        open_folder(folder, cache=tmp_path)


def test_unknown_nodes_folders_and_settings_are_refused_at_once(world, house, tmp_path):
    with pytest.raises(IndexError, match="0 to 2"):
        world.panorama(3)
    with pytest.raises(FileNotFoundError, match=r"house\.json"):
        open_folder(tmp_path, HandCatalogue(), tmp_path)
    with pytest.raises(TypeError, match="qualitty"):
        make(house, tmp_path, qualitty="unlit")
    with pytest.raises(ValueError, match="pretty"):
        make(house, tmp_path, pictures="pretty")


def test_every_instance_id_has_a_class_walls_and_doors_too(world):
    view = world.renderer.view((1.0, 1.05, 1.5), 0.0, vfov=1.2, size=(48, 64))
    shown = set(np.array(world.classes)[view.ids].ravel())
    assert {"wall", "floor", "door"} <= shown and len(world.classes) == len(world.owners) + 1
    for name, owner in zip(world.classes[1:], world.owners, strict=True):
        placed = world.house.placement_by_id.get(owner)
        assert name and (placed is None or name == placed.object_class)


def test_random_poses_are_free_and_spread_over_the_floor(world):
    rng = np.random.default_rng(0)
    poses = [world.random_pose(rng=rng) for _ in range(200)]
    rooms = ["bedroom_1" if eye[0] > 5 else "living_room_1" for eye, _ in poses]
    assert all(world.is_free(eye) and world.is_free(eye[:2]) and eye[2] == 1.5 for eye, _ in poses)
    assert 0.2 < np.mean([r == "bedroom_1" for r in rooms]) < 0.8 and np.ptp([yaw for _, yaw in poses]) > 5
    assert not world.is_free((1.2, 0.9)), "a table stands there"
    assert not world.is_free((0.05, 2.0)) and not world.is_free((-5.0, 2.0, 1.5)) and not world.is_free((2.5, 2.6, -3))
    with pytest.raises(ValueError, match="finite"):
        world.is_free((float("nan"), 0.0))
    view = world.renderer.view(*poses[0], size=(16, 16))
    assert view.rgb.shape == (16, 16, 3)
