"""Exports: the MJCF folder opens alone and is the same house; the GLB holds every owner."""

from __future__ import annotations

import dataclasses
import shutil
import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest
import shapely
import trimesh
from conftest import two_rooms
from dm_control import mjcf as dm_mjcf
from handmade import HandCatalogue, furnished

from embodied.house.shapes import footprint
from embodied.scene.export import export_mjcf
from embodied.scene.glb import export_glb
from embodied.scene.house_meshes import house_parts
from embodied.scene.lit_pages import LitMesh, LitPages
from embodied.scene.model import compile_scene, loose


@pytest.fixture(scope="module")
def house():
    return furnished(two_rooms())


def test_the_mjcf_folder_is_the_same_house_and_needs_nothing_else(house, tmp_path):
    written = export_mjcf(house, HandCatalogue(), tmp_path / "made")
    moved = shutil.move(written.parent, tmp_path / "elsewhere")
    again = mujoco.MjModel.from_xml_path(str(moved / "house.xml"))
    original = compile_scene(house, HandCatalogue()).model
    assert again.ngeom == original.ngeom and again.nmesh == original.nmesh and again.nmat == original.nmat
    for g in range(again.ngeom):
        assert again.geom(g).name == original.geom(g).name.replace("/", ".")
    assert np.allclose(again.geom_pos, original.geom_pos, atol=1e-5)
    assert np.allclose(again.geom_rgba, original.geom_rgba, atol=1e-5)
    assert np.array_equal(again.mesh_vert, original.mesh_vert)


@pytest.mark.parametrize("free", [False, True])
def test_the_mjcf_opens_in_dm_control_and_is_whole_there(house, tmp_path, free):
    odd = dataclasses.replace(house.placements[0], id="bed/sofa_1")
    house = dataclasses.replace(house, placements=(odd, *house.placements[1:]))
    chosen = loose(house, HandCatalogue()) if free else frozenset()
    path = export_mjcf(house, HandCatalogue(), tmp_path, free=chosen)
    root = dm_mjcf.from_path(str(path))
    again = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    model = mujoco.MjModel.from_xml_path(str(path))
    assert (again.ngeom, again.njnt, again.ncam) == (model.ngeom, len(chosen), len(house.rooms))
    assert {model.joint(j).name for j in range(model.njnt)} == {name.replace("/", ".") for name in chosen}
    assert {again.geom(g).name for g in range(again.ngeom)} == {model.geom(g).name for g in range(model.ngeom)}
    assert root.find("camera", "living_room_1") is not None


def test_the_cameras_of_the_mjcf_stand_in_their_rooms_and_look_along_them(house, tmp_path):
    model = mujoco.MjModel.from_xml_path(str(export_mjcf(house, HandCatalogue(), tmp_path)))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for k in range(model.ncam):
        x, y, z = data.cam_xpos[k]
        ahead, up = -data.cam_xmat[k].reshape(3, 3)[:, 2], data.cam_xmat[k].reshape(3, 3)[:, 1]
        room = house.room_by_id[model.camera(k).name]
        polygon = shapely.Polygon(room.polygon)
        assert z == pytest.approx(1.5) and np.allclose(up, [0, 0, 1], atol=1e-6)
        assert polygon.contains(shapely.Point(x, y)) and polygon.contains(shapely.Point(x + ahead[0], y + ahead[1]))
        assert not any(footprint(p).contains(shapely.Point(x, y)) for p in house.placements if p.size[2] > 0.03)


HOSTILE = '"><!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><include file="/etc/passwd"/>&e;'


def test_names_that_are_xml_stay_names_in_mjcf(house, tmp_path):
    box = next(p for p in house.placements if p.asset == "hand/red_box")
    odd = dataclasses.replace(house, name=HOSTILE, placements=(dataclasses.replace(box, id=HOSTILE),))
    path = export_mjcf(odd, HandCatalogue(), tmp_path, free=frozenset([HOSTILE]))
    root = ET.fromstring(path.read_text())
    assert "<!" not in path.read_text() and root.find(".//include") is None
    names = [b.get("name") for b in root.iter("body")]
    assert names == [HOSTILE.replace("/", ".")]
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.body(1).name == HOSTILE.replace("/", ".")


OWN = """<mujoco>{}<option timestep="0.001" integrator="RK4" cone="pyramidal"/>
  <default><default class="mine"><geom density="7"/></default></default>
  <asset><mesh name="ball" file="ball.obj"/></asset>
  <worldbody><body name="bot" pos="1 1 1"><joint type="hinge" range="-90 90"/>
    <geom size=".1" mass="1" group="2"/><geom size=".02" mass=".1" group="3"/>
    <geom size=".1" pos="1 0 0" class="mine"/><geom type="mesh" mesh="ball" pos="2 0 0" density="1"/></body></worldbody>
</mujoco>"""
BALL = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.mark.filterwarnings("ignore:Attach conflict")  # of options, of which MuJoCo keeps the parent's
@pytest.mark.parametrize("free", [False, True])
def test_what_a_user_adds_to_an_exported_house_keeps_its_own_masses_angles_options_and_files(house, tmp_path, free):
    path = export_mjcf(house, HandCatalogue(), tmp_path, free=loose(house, HandCatalogue()) if free else frozenset())
    (tmp_path / "ball.obj").write_text(BALL)
    (tmp_path / "own.xml").write_text(OWN.format(""))
    (tmp_path / "beside.xml").write_text(OWN.format('<include file="house.xml"/>'))
    own, beside = (mujoco.MjModel.from_xml_path(str(tmp_path / name)) for name in ("own.xml", "beside.xml"))
    assert (beside.opt.timestep, beside.opt.integrator, beside.opt.cone) == (0.001, own.opt.integrator, own.opt.cone)
    attached = mujoco.MjSpec.from_file(str(path))
    robot = mujoco.MjSpec.from_file(str(tmp_path / "own.xml"))
    attached.attach(robot, frame=attached.worldbody.add_frame(), prefix="my/")
    attached.worldbody.add_body(name="added").add_geom(size=[0.1, 0, 0], mass=1.0)
    attached = attached.compile()
    assert attached.body("added").mass == 1.0
    for body, model in ((beside.body("bot"), beside), (attached.body("my/bot"), attached)):
        assert np.allclose(body.mass, own.body("bot").mass) and np.allclose(body.inertia, own.body("bot").inertia)
        assert np.allclose(model.jnt_range[model.body_jntadr[body.id]], [-np.pi / 2, np.pi / 2])


def test_textures_travel_with_the_folder(house, tmp_path):
    page = np.random.default_rng(0).integers(0, 255, (16, 32, 3), dtype=np.uint8)
    corners = np.array([[0, 0, 1], [1, 0, 1], [1, 1, 1]], np.float32)
    faces, uv = np.array([[0, 1, 2]], np.int32), np.zeros((3, 2), np.float32)
    mesh = LitMesh("rug_1", "object", "living_room_1", 0, corners, faces, uv)
    lit = LitPages((mesh,), (page,), "x")
    model = mujoco.MjModel.from_xml_path(str(export_mjcf(house, HandCatalogue(), tmp_path, lit=lit)))
    texture = model.texture("page_0")
    start = int(texture.adr[0])
    assert np.array_equal(model.tex_data[start : start + page.size].reshape(page.shape), page)


def test_the_glb_holds_every_owner_upright(house, tmp_path):
    catalogue = HandCatalogue()
    loaded = trimesh.load_scene(export_glb(house, catalogue, tmp_path / "house.glb"))
    nodes = set(loaded.graph.nodes_geometry)
    assert {p.owner for p in house_parts(house, catalogue)} <= nodes
    transform, name = loaded.graph["living_room_1/ceiling"]
    ceiling = loaded.geometry[name].copy().apply_transform(transform)
    assert np.allclose(ceiling.bounds[:, 1], 2.6, atol=0.01), "glTF is y up: the ceiling hangs at y = 2.6 m"
    transform, name = loaded.graph["red_box_1"]
    box = loaded.geometry[name].copy().apply_transform(transform)
    assert np.allclose(box.bounds, [[4.15, 0, -2.85], [4.65, 0.8, -2.35]], atol=1e-4)
    nodes = set(
        trimesh.load_scene(export_glb(house, catalogue, tmp_path / "h.glb", ceilings=False)).graph.nodes_geometry
    )
    assert not any(n.endswith("/ceiling") for n in nodes) and "outdoor/roof" not in nodes, "one looks in from above"
