"""A lit house for others: glTF that shows its pages as they are and says what is what; USD alike."""

from __future__ import annotations

import dataclasses
import json
import struct

import numpy as np
import pytest
import trimesh
from conftest import two_rooms
from handmade import HandCatalogue

from embodied.errors import UnableError
from embodied.scene.glb import export_glb, export_usd
from embodied.scene.lit_pages import LitMesh, LitPages


def lit_pages() -> LitPages:
    """Two pages, red above blue; the rug in two meshes, a window pane, a ceiling."""
    page = np.zeros((16, 16, 3), np.uint8)
    page[:8, :, 0], page[8:, :, 2] = 255, 255
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    faces, uv = np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.array([[0, 0], [1, 0], [1, 0.4], [0, 0.4]], np.float32)
    meshes = (
        LitMesh("rug_1", "object", "living_room_1", 0, square, faces, uv),
        LitMesh("rug_1", "object", "living_room_1", 1, square + np.float32([0, 0, 1]), faces, uv),
        LitMesh("window_1/glass", "glass", "living_room_1", 0, square, faces, uv, alpha=0.25),
        LitMesh("living_room_1/ceiling", "ceiling", "living_room_1", 1, square, faces, uv),
    )
    return LitPages(meshes, (page, page[::-1].copy()), "light")


def tree(path):
    data = path.read_bytes()
    assert data[:4] == b"glTF" and struct.unpack("<I", data[8:12])[0] == len(data)
    return json.loads(data[20 : 20 + struct.unpack("<I", data[12:16])[0]])


def test_pages_are_shown_unlit_and_every_node_says_what_it_is(tmp_path):
    house = two_rooms()
    made = tree(export_glb(house, HandCatalogue(), tmp_path / "house.glb", lit=lit_pages()))
    assert made["extensionsUsed"] == ["KHR_materials_unlit"]
    assert all(m["extensions"] == {"KHR_materials_unlit": {}} for m in made["materials"])
    assert sorted(m.get("alphaMode", "OPAQUE") for m in made["materials"]) == ["BLEND", "OPAQUE", "OPAQUE"]
    assert len({i["bufferView"] for i in made["images"]}) == 2, "a page is embedded once"
    extras = {n["name"]: n["extras"] for n in made["nodes"] if "extras" in n}
    assert len(extras) == 4 and "rug_1" in extras
    assert extras["rug_1"] == {"class": "rug", "kind": "object", "room": "living_room_1", "room_kind": "living_room"}
    assert extras["window_1/glass"]["class"] == "glass"
    assert made["asset"]["extras"]["house_digest"] == house.digest


def test_the_upper_part_of_a_page_stays_the_upper_part_and_z_becomes_y(tmp_path):
    path = export_glb(two_rooms(), HandCatalogue(), tmp_path / "house.glb", lit=lit_pages())
    scene = trimesh.load_scene(path)
    rug = scene.geometry[scene.graph["rug_1"][1]]
    picture = np.asarray(rug.visual.material.baseColorTexture.convert("RGB"))
    u, v = rug.visual.uv.mean(0)
    colour = picture[int((1 - v) * 16), int(u * 16)]
    assert colour[0] > 200 and colour[2] < 60, "the rug's texels are red"
    names = ("rug_1", next(n for n in scene.graph.nodes_geometry if n.startswith("rug_1#")))
    bounds = [scene.geometry[scene.graph[n][1]].bounds for n in names]
    world = [trimesh.transform_points(b, scene.graph[n][0])[:, 1] for b, n in zip(bounds, names, strict=True)]
    assert np.allclose(world[0], 0, atol=1e-6) and np.allclose(world[1], 1, atol=1e-6)


def test_ceilings_can_be_left_out_and_far_scenery_is_there_when_asked_for_only(tmp_path):
    lit = lit_pages()
    dome = dataclasses.replace(lit.meshes[0], owner="outdoor/sky", kind="outdoor", room="")
    lit = dataclasses.replace(lit, meshes=(*lit.meshes, dome))
    for there in (False, True):
        path = export_glb(two_rooms(), HandCatalogue(), tmp_path / "house.glb", lit=lit, sky=there, ceilings=there)
        names = [n.get("name", "") for n in tree(path)["nodes"]]
        assert ("outdoor/sky" in names) == any("ceiling" in n for n in names) == there


def test_usd_names_the_remedy_where_openusd_is_missing_and_holds_all_meshes_where_it_is_there(tmp_path):
    try:
        from pxr import Usd, UsdGeom
    except ImportError:
        with pytest.raises(UnableError, match="pip install 'embodied-houses\\[usd\\]'"):
            export_usd(two_rooms(), lit_pages(), tmp_path / "house.usdz")
        return
    with pytest.raises(ValueError, match=r"\.usdz"):
        export_usd(two_rooms(), lit_pages(), tmp_path / "house.usda")
    stage = Usd.Stage.Open(str(export_usd(two_rooms(), lit_pages(), tmp_path / "house.usdz")))
    meshes = [p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)]
    assert [p.GetCustomDataByKey("owner") for p in meshes] == [m.owner for m in lit_pages().meshes]
    assert meshes[0].GetCustomDataByKey("class") == "rug" and UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
    assert np.allclose(UsdGeom.Mesh(meshes[1]).GetPointsAttr().Get(), lit_pages().meshes[1].vertices)
