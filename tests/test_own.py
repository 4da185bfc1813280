"""A user's own models: read at their size, imported again when a file of theirs changes, refused for a reason."""

from __future__ import annotations

import dataclasses
import pickle
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
import trimesh
from conftest import two_rooms
from handmade_models import CUBE, write_own, write_pack
from PIL import Image

from embodied.assets.catalogue import load_catalogue
from embodied.assets.importing import importer
from embodied.assets.importing.meshing import crease_normals
from embodied.assets.importing.obj import MAX_CORNERS, MeshError, parse_obj
from embodied.assets.importing.sh3f import PackError
from embodied.assets.json_file import RecordError
from embodied.assets.records import bounds
from embodied.house.house import Placement
from embodied.navigation.graph import graph_of
from embodied.world import open_world

pytestmark = pytest.mark.gl

MUG = {"class": "mug", "size": [0.1, 0.1, 0.1]}
FACE = re.compile(r"f (\d) (\d) (\d) (\d)")
PAINTED = "mtllib a.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl paint\n" + FACE.sub(r"f \1/1 \2/2 \3/3 \4/4", CUBE)


def painted(folder: Path, colour: str = "red") -> Path:
    """A folder with the cube `mine/box`, its .mtl and a texture of one colour."""
    own = write_own(folder, {"box": {"file": "a.obj", **MUG}})
    (own / "a.obj").write_text(PAINTED)
    (own / "a.mtl").write_text("newmtl paint\nKd 0.2 0.4 0.6\nmap_Kd a.png\n")
    Image.new("RGB", (8, 8), colour).save(own / "a.png")
    return own


@pytest.mark.slow
def test_own_models_of_all_three_kinds_come_out_at_their_size(tmp_path):
    row = {"class": "garden gnome", "size": [0.4, 0.3, 0.2]}
    models = {"a": {"file": "a.obj", **row}, "b": {"file": "b.glb", **row}}
    models["c"] = {"file": "c.sh3f", "model": "mine/box", "class": "garden gnome"}
    own = write_own(tmp_path / "own", models, {"garden gnome": {"support": "floor", "rooms": {"sun_room": 1.0}}})
    (own / "a.obj").write_text(CUBE)
    trimesh.creation.box((2, 2, 2)).export(own / "b.glb")
    write_pack(own / "c.sh3f", {"mine/box/box.obj": CUBE})
    catalogue = load_catalogue(tmp_path, own=[own])
    assert len(catalogue.of_class("garden gnome")) == 3
    for name in "abc":
        low, high = bounds(catalogue.mesh(f"mine/{name}"))
        np.testing.assert_allclose(high - low, (0.4, 0.3, 0.2), atol=1e-4)
    assert catalogue.assets["mine/a"].creator == "Me" and catalogue.assets["mine/a"].licence == "CC0-1.0"


def test_a_variant_has_another_colour_and_size_of_the_same_mesh(tmp_path):
    base = {"file": "a.obj", "class": "side table", "size": [0.4, 0.3, 0.2]}
    base["surfaces"] = [["top", 0.2, -0.2, -0.15, 0.2, 0.15, 9]]
    red = {"of": "a", "class": "coffee table", "size": [0.8, 0.3, 0.1], "looks": {"": "#ff0000"}}
    own = write_own(tmp_path / "own", {"a": base, "red": red})
    (own / "a.obj").write_text(CUBE)
    catalogue = load_catalogue(tmp_path, own=[own])
    (part,) = catalogue.mesh("mine/red")
    assert part.finish.color[:3] == (0.92, 0.0, 0.0) and catalogue.assets["mine/red"].object_class == "coffee table"
    np.testing.assert_allclose(np.ptp(part.vertices, axis=0), (0.8, 0.3, 0.1), atol=1e-5)
    (top,) = catalogue.assets["mine/red"].surfaces
    assert (top.x0, top.x1, top.z) == pytest.approx((-0.4, 0.4, 0.1))


# files that change


@pytest.mark.parametrize("name", ["a.obj", "a.mtl", "a.png"])
def test_a_model_is_imported_again_when_any_of_its_files_has_changed(tmp_path, name):
    own = painted(tmp_path / "own")

    def read() -> tuple:
        catalogue = load_catalogue(tmp_path / "cache", own=[own])
        (part,) = catalogue.mesh("mine/box")
        colour = None if part.finish.texture is None else Image.open(part.finish.texture).getpixel((0, 0))
        return catalogue.own_digests(["mine/box", "built/rug"]), colour, part.finish.color, len(part.faces)

    first, again = read(), read()
    assert first == again and set(first[0]) == {"mine/box"}
    if name == "a.obj":
        (own / name).write_text(PAINTED.rpartition("\n")[0])
    elif name == "a.mtl":
        (own / name).write_text("newmtl paint\nKd 0.9 0.1 0.1\n")
    else:
        Image.new("RGB", (8, 8), "blue").save(own / name)
    after = read()
    assert after[0] != first[0] and after[1:] != first[1:]
    if name != "a.obj":
        (own / name).unlink()
        assert read()[0] not in (first[0], after[0]), "a file that is gone is a change, too"


def test_a_model_that_is_gone_since_the_catalogue_was_read_is_named(tmp_path):
    own = painted(tmp_path / "own")
    catalogue = load_catalogue(tmp_path, own=[own])
    (own / "a.obj").unlink()
    with pytest.raises(MeshError, match=r"a\.obj cannot be read.*put it back"):
        catalogue.own_digests(["mine/box"])
    with pytest.raises(MeshError, match=r"a\.obj cannot be read.*put it back"):
        catalogue.mesh("mine/box")


@pytest.mark.slow
@pytest.mark.gl
def test_a_world_does_not_believe_what_was_seen_before_a_model_changed(tmp_path):
    own = painted(tmp_path / "own")
    thing = Placement("mug_1", "mine/box", "mug", "living_room_1", (2.5, 2.5, 0.0), 0.0, MUG["size"])
    house = dataclasses.replace(two_rooms(), placements=(thing,))
    graph = graph_of(np.array([[2.5, 2.6, 1.5]]), np.empty((0, 2), int), ("a",), ("living_room_1",))

    def path() -> Path:
        catalogue = load_catalogue(tmp_path / "cache", own=[own])
        with open_world(house, catalogue, tmp_path / "cache", graph=graph, size=64) as world:
            return world.path

    first = path()
    assert path() == first
    Image.new("RGB", (8, 8), "blue").save(own / "a.png")
    assert path() != first


# damaged and hostile files


@pytest.mark.parametrize("picture", [b"\x89PNG\r\n\x1a\nbroken", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 8 8\n"])
def test_a_damaged_texture_says_what_its_owner_can_do_and_of_a_pack_to_install_it_again(tmp_path, picture, monkeypatch):
    monkeypatch.setattr(subprocess, "Popen", lambda *a, **k: pytest.fail(f"another program was started: {a}"))
    own = painted(tmp_path / "own")
    (own / "a.png").write_bytes(picture)
    with pytest.raises(PackError, match="it is none of PNG, JPEG, BMP, TGA.*save it again"):
        load_catalogue(tmp_path, own=[own]).mesh("mine/box")
    files = {"a.obj": PAINTED.encode(), "a.mtl": b"newmtl paint\nmap_Kd a.png\n", "a.png": picture}
    with pytest.raises(PackError, match="install the pack again"):
        importer.read_obj(files.__getitem__, "a.obj", "a")


WRONG_ROWS = {
    '"file": "../box.obj"': "inside",
    '"file": "missing.obj"': "not in",
    '"class": "unicorn"': "unknown class",
    '"class": "mug", "class": "mug"': "'class' stands there twice",
    f'"size": [{"9" * 400}, 1, 1]': "a number of 400 digits",
    '"size": [1e-9, 1, 1]': "three lengths",
    '"of": "nothing"': "variant",
    '"wings": 2': "unknown field",
    '"support": "magic"': "support. should be one of",
    '"rooms": {"dungeon": 1}': "room kinds",
    '"looks": {"paint": "shiny"}': "unknown look 'shiny'",
    '"surfaces": [["top", 0, 1, 1, 0, 0, 9]]': "x0 < x1",
    '"elevation": NaN': "NaN is no JSON",
    '"synonyms": "cup"': "synonyms should be a list",
    '"yaw": "left"': "yaw should be a number",
    '"faces": 1.5': "should be an integer",
    '"faces": -1': "whole number",
    '"name": "\\ud800"': "surrogates not allowed",
}
WRONG_CATALOGUES = {
    '{"models": null}': "models should be an object",
    '{"models": {"box": 3}}': "should be an object",
    '{"classes": {"mug": {"on": 3}}}': "class 'mug'.on should be a list",
    '{"pack": "../up"}': "word without",
}


def wrong_row(row: str) -> str:
    """A catalogue of one model, of which `row` replaces what it names."""
    usual = ('"file": "a.obj"', '"class": "mug"', '"size": [1, 1, 1]')
    fields = ", ".join([row, *(w for w in usual if w[:6] not in row)])
    return f'{{"models": {{"box": {{{fields}}}}}}}'


@pytest.mark.parametrize(
    ("text", "match"), [*((wrong_row(row), why) for row, why in WRONG_ROWS.items()), *WRONG_CATALOGUES.items()], ids=str
)
def test_a_wrong_catalogue_says_what_it_should_hold(tmp_path, text, match):
    (tmp_path / "a.obj").write_text(CUBE)
    (tmp_path / "catalogue.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(RecordError, match=match) as caught:
        load_catalogue(tmp_path / "cache", own=[tmp_path])
    assert "catalogue.json" in str(caught.value) and len(str(caught.value)) < 1500


def test_a_correction_of_a_material_that_is_not_there_is_told(tmp_path, caplog):
    own = write_own(
        tmp_path / "own", {"box": {"file": "a.obj", **MUG, "looks": {"wood": "#ff0000"}, "two_sided": ["*"]}}
    )
    (own / "a.obj").write_text(PAINTED)
    load_catalogue(tmp_path, own=[own]).mesh("mine/box")
    assert "its row names the materials ['wood'], which it lacks; it has ['paint']" in caplog.text


def test_a_link_out_of_the_folder_is_not_followed(tmp_path):
    own = painted(tmp_path / "own")
    (tmp_path / "secret.mtl").write_text("newmtl paint\nKd 1 0 0\n")
    (own / "a.mtl").unlink()
    (own / "a.mtl").symlink_to(tmp_path / "secret.mtl")
    (part,) = load_catalogue(tmp_path, own=[own]).mesh("mine/box")
    assert part.finish.color[:3] == (0.8, 0.8, 0.8)


# large polygons


def star(corners: int) -> np.ndarray:
    """(corners, 2) a polygon of spikes, concave at every other corner."""
    angle = np.arange(corners) / corners * 2 * np.pi
    return np.stack([np.cos(angle), np.sin(angle)], 1) * np.random.default_rng(0).uniform(0.3, 1.0, (corners, 1))


def test_a_polygon_of_a_thousand_corners_is_filled_exactly():
    points = star(1000)
    text = "\n".join([*(f"v {x:.12f} 0 {-y:.12f}" for x, y in points), "f " + " ".join(map(str, range(1, 1001)))])
    (group,) = parse_obj(text.encode(), "star").groups
    a, b, c = points[group.corners].transpose(1, 0, 2)
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    x, y = points.T
    assert len(group.corners) == 998 and (area > -1e-9).all()
    assert area.sum() == pytest.approx((x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)


def test_a_polygon_of_more_corners_than_are_read_is_refused():
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf " + "1 2 3 " * (MAX_CORNERS // 3 + 1)
    with pytest.raises(MeshError, match=f"at most {MAX_CORNERS} are read"):
        parse_obj(text.encode(), "large")


def fan(faces: int) -> tuple[np.ndarray, np.ndarray]:
    """A cone of 45 degrees around one tip."""
    angle = np.arange(faces) / faces * 2 * np.pi
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(faces)], axis=1)
    k = np.arange(faces)
    return np.concatenate([[[0.0, 0.0, 1.0]], rim]), np.stack(
        [np.zeros(faces, int), 1 + k, 1 + (k + 1) % faces], axis=1
    )


def test_normals_at_the_tip_of_a_cone_do_not_depend_on_how_finely_it_is_cut():
    few, many = crease_normals(*fan(200))[:, 0], crease_normals(*fan(4000))[:, 0]
    assert np.abs(many[0] - few[0]).max() < 0.03 and np.abs(many[1000] - few[50]).max() < 0.03
    vertices, faces = fan(4000)
    assert np.allclose(crease_normals(vertices * [1.0, 1.0, 0.0], faces), [0.0, 0.0, 1.0])


def test_a_catalogue_can_be_sent_to_other_processes(tmp_path):
    catalogue = load_catalogue(tmp_path, own=[painted(tmp_path / "own")])
    copy = pickle.loads(pickle.dumps(catalogue))
    assert dict(copy.assets) == dict(catalogue.assets) and copy.cache == catalogue.cache
    for key in ("mine/box", "built/vase_white"):
        np.testing.assert_array_equal(bounds(copy.mesh(key)), bounds(catalogue.mesh(key)))
