"""What glTF, OBJ and MTL say of a user's own model is drawn, refused by name, or told."""

from __future__ import annotations

import base64
import dataclasses
import io
import json
import logging
import struct
import subprocess

import numpy as np
import pytest
import trimesh
from conftest import two_rooms
from handmade import HandCatalogue
from handmade_models import write_own
from PIL import Image

from embodied.assets.catalogue import load_catalogue
from embodied.assets.importing.meshing import face_normals
from embodied.assets.importing.obj import MeshError
from embodied.assets.records import Finish, MeshPart, bounds
from embodied.house.house import Placement
from embodied.render.classic import Renderer
from embodied.scene.glb import export_glb, pbr_material

THING = {"class": "mug", "size": [1.0, 1.0, 1.0]}
QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")
UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], "<f4")  # glTF's v counts downwards
ROUND = np.array([0, 1, 2, 0, 2, 3], "<u2")
CODES = {"f4": 5126, "u2": 5123, "u1": 5121}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def png(picture: Image.Image, kind: str = "PNG") -> dict:
    """A glTF image that is spelled out in the header."""
    buffer = io.BytesIO()
    picture.save(buffer, kind)
    return {"uri": "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()}


def glb(header: dict, body: bytes = b"") -> bytes:
    """A binary glTF file of a header and a binary chunk."""
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    body += b"\0" * (-len(body) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(body), 0x004E4942) + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def model(
    material: dict | None = None, images=(), *, indices=ROUND, mode=4, primitive=None, arrays=None, **more
) -> bytes:
    """A square of one material as .glb; `arrays` are its attributes, `more` goes into the header."""
    attributes = {"POSITION": QUAD, "TEXCOORD_0": UV, **(arrays or {})}
    views, accessors, body = [], [], b""
    for a in [*attributes.values(), *([indices] if indices is not None else [])]:
        a = np.atleast_2d(a.T).T
        views.append({"buffer": 0, "byteOffset": len(body), "byteLength": a.nbytes})
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": CODES[a.dtype.str[1:]], "count": len(a)}
            | {"type": TYPES[a.shape[1]]}
        )
        body += a.tobytes() + b"\0" * (-a.nbytes % 4)
    shape = {"attributes": {k: i for i, k in enumerate(attributes)}, "mode": mode, **(primitive or {})}
    if indices is not None:
        shape["indices"] = len(attributes)
    if material is not None:
        shape["material"] = 0
    header = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [shape]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(body)}],
        "materials": [material] if material is not None else [],
        "images": [png(i) for i in images],
        "textures": [{"source": i} for i in range(len(images))],
    }
    return glb(header | more, body)


def changed(data: bytes, change) -> bytes:
    """A .glb after `change` of its header."""
    length = struct.unpack_from("<I", data, 12)[0]
    header = json.loads(data[20 : 20 + length])
    change(header)
    return glb(header, data[28 + length :])


def pbr(**fields) -> dict:
    return {"name": "paint", "pbrMetallicRoughness": {"metallicFactor": 0.0, **fields}}


def imported(tmp_path, data: bytes, name: str = "a.glb", row=None, files=None) -> tuple[MeshPart, ...]:
    tmp_path.mkdir(exist_ok=True)
    own = write_own(tmp_path / "own", {"box": {"file": name, **THING, **(row or {})}})
    (own / name).write_bytes(data)
    for file, content in (files or {}).items():
        (own / file).write_bytes(content)
    return load_catalogue(tmp_path / "cache", own=[own]).mesh("mine/box")


def pixels(part: MeshPart) -> np.ndarray:
    assert part.finish.texture is not None
    return np.asarray(Image.open(part.finish.texture).convert("RGBA"))


def seen(part: MeshPart) -> np.ndarray:
    """(m, 3) sRGB in [0, 1] at the middle of each face: the texture's, or the finish's."""
    if part.finish.texture is None:
        return np.tile(part.finish.color[:3], (len(part.faces), 1))
    texels, uv = pixels(part), part.uv[part.faces].mean(1) % 1
    h, w = texels.shape[:2]
    return texels[((1 - uv[:, 1]) * h).astype(int) % h, (uv[:, 0] * w).astype(int) % w, :3] / 255


def area(parts) -> float:
    return sum(np.linalg.norm(face_normals(p.vertices, p.faces), axis=1).sum() / 2 for p in parts)


# glTF: colours


def test_a_base_colour_of_gltf_is_linear(tmp_path):
    (part,) = imported(tmp_path, model(pbr(baseColorFactor=[0.214, 0.0331, 1, 1])))
    np.testing.assert_allclose(part.finish.color[:3], (0.5, 0.2, 1.0), atol=2e-3)


def test_a_house_exported_as_glb_comes_back_in_its_own_colours(tmp_path):
    colour = (0.5, 0.25, 0.8, 1.0)
    box = trimesh.creation.box()
    uv = np.zeros((len(box.vertices), 2))
    box.visual = trimesh.visual.TextureVisuals(uv=uv, material=pbr_material(Finish(colour)))
    (part,) = imported(tmp_path, box.export(file_type="glb"))
    np.testing.assert_allclose(part.finish.color, colour, atol=5e-3)


@pytest.mark.parametrize("kind", ["f4", "u1", "u2"])
def test_colours_of_vertices_are_drawn_times_the_materials(tmp_path, kind):
    colours = np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 1]], float)
    held = colours.astype("<f4") if kind == "f4" else (colours * np.iinfo(kind).max).astype(f"<{kind}")
    data = model(
        pbr(baseColorFactor=[0.5, 1, 1, 1]),
        arrays={"COLOR_0": np.pad(held, ((0, 0), (0, 1)), constant_values=held.max())},
    )
    data = changed(data, lambda h: h["accessors"][2].update(normalized=kind != "f4"))
    (part,) = imported(tmp_path, data)
    first, second = seen(part)[np.argsort(-seen(part)[:, 0])]
    np.testing.assert_allclose(first, (0.735, 0, 0), atol=5e-3)  # 0.5 linear
    np.testing.assert_allclose(second, (0.612, 0, 0.612), atol=5e-3)  # thirds of it, linear


def test_colours_of_vertices_without_a_material_are_drawn(tmp_path):
    green = np.tile(np.array([0, 1, 0], "<f4"), (4, 1))
    (part,) = imported(tmp_path, model(arrays={"COLOR_0": green}))
    np.testing.assert_allclose(part.finish.color, (0, 1, 0, 1), atol=1e-3)


def test_a_texture_is_multiplied_by_the_base_colour(tmp_path):
    grey = Image.new("RGB", (8, 8), (188, 188, 188))  # 0.5 linear
    (part,) = imported(tmp_path, model(pbr(baseColorFactor=[1, 0.5, 0, 1], baseColorTexture={"index": 0}), [grey]))
    np.testing.assert_allclose(pixels(part)[4, 4, :3], (188, 137, 0), atol=1)


def test_a_texture_without_coordinates_gives_its_mean_colour_and_says_so(tmp_path, caplog):
    material = pbr(baseColorTexture={"index": 0, "texCoord": 3})
    (part,) = imported(tmp_path, model(material, [Image.new("RGB", (8, 8), (255, 0, 0))]))
    np.testing.assert_allclose(part.finish.color[:3], (1, 0, 0), atol=1e-3)
    assert "TEXCOORD_3" in caplog.text and "mine/box" in caplog.text


def test_what_a_metalness_map_calls_wood_is_no_metal(tmp_path):
    mixed = Image.new("RGB", (8, 8), (0, 128, 0))  # green is roughness, blue is metalness
    mixed.paste((0, 51, 255), (4, 0, 8, 8))
    material = {"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}, "roughnessFactor": 0.5}}
    strip = np.concatenate([QUAD, QUAD + [1, 0, 0]]).astype("<f4")
    uv = np.concatenate([UV * [0.4, 1], UV * [0.4, 1] + [0.6, 0]]).astype("<f4")
    both = np.concatenate([ROUND, ROUND + 4]).astype("<u2")
    parts = imported(tmp_path, model(material, [mixed], arrays={"POSITION": strip, "TEXCOORD_0": uv}, indices=both))
    assert sorted((p.finish.metallic, p.finish.roughness) for p in parts) == [(0.0, 0.251), (1.0, 0.1)]


# glTF: seen from behind, and through holes


def test_a_two_sided_sheet_is_seen_from_behind_and_a_two_sided_box_is_not_doubled(tmp_path):
    sheet = imported(tmp_path / "a", model(pbr() | {"doubleSided": True}))
    box = trimesh.creation.box()
    box.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(doubleSided=True))
    box.invert()
    solid = imported(tmp_path / "b", box.export(file_type="glb"))
    normals = np.concatenate([face_normals(p.vertices, p.faces) for p in sheet])
    assert area(sheet) == pytest.approx(2, rel=0.01) and abs(normals.sum(0)).max() < 1e-6
    assert area(solid) == pytest.approx(6, rel=0.02)
    (part,) = solid
    outward = np.einsum(
        "ij,ij->i", face_normals(part.vertices, part.faces), part.vertices[part.faces].mean(1) - [0, 0, 0.5]
    )
    assert (outward > 0).all(), "a closed piece that is wound inside out is turned"


def leaf(size: int = 32, faint: int = 0) -> Image.Image:
    """Green in the upper left and the lower right quarter of the picture; the rest transparent."""
    pixels = np.zeros((size, size, 4), np.uint8)
    pixels[...] = (255, 0, 255, faint)
    half = size // 2
    pixels[:half, :half] = pixels[half:, half:] = (0, 200, 0, 255)
    return Image.fromarray(pixels)


@pytest.mark.parametrize(
    ("mode", "share"),
    [({"alphaMode": "MASK"}, 0.5), ({"alphaMode": "BLEND"}, 0.5), ({}, 1.0)],
    ids=["mask", "blend", "opaque"],
)
def test_a_leaf_card_is_cut_along_its_leaf(tmp_path, mode, share):
    parts = imported(tmp_path, model(pbr(baseColorTexture={"index": 0}) | mode, [leaf()]))
    (part,) = parts
    assert area(parts) == pytest.approx(share, abs=0.03)
    assert pixels(part)[..., 3].min() == 255, "no other program cuts again, by another rule"
    if share < 1:
        middles = part.vertices[part.faces].mean(1)
        middles = middles[np.abs(middles[:, 0]) > 0.1]
        assert ((middles[:, 0] < 0) == (middles[:, 2] > 0.5)).all(), "upper left and lower right are there"
        np.testing.assert_allclose(seen(part), np.tile([0, 200 / 255, 0], (len(part.faces), 1)), atol=0.02)


@pytest.mark.gl
def test_a_leaf_card_cuts_in_pictures_as_in_the_exported_glb(tmp_path):
    masked = pbr(baseColorTexture={"index": 0}) | {"alphaMode": "MASK", "doubleSided": True}
    card = imported(tmp_path, model(masked, [leaf()]))

    class Catalogue(HandCatalogue):
        def mesh(self, key, size, params=()):
            return card

    thing = Placement("card", "hand/red_box", "mug", "living_room_1", (3.0, 2.0, 0.5), np.pi / 2, (1.0, 1.0, 1.0))
    house = dataclasses.replace(two_rooms(), placements=(thing,))
    with Renderer(house, Catalogue(), size=64) as renderer:
        ids = renderer.view((1.0, 2.0, 1.0), 0.0, vfov=np.radians(30), size=(64, 64)).ids
    shown = ids == 1 + renderer.owners.index("card")
    quarters = [shown[y : y + 20, x : x + 20].mean() for y in (8, 36) for x in (8, 36)]
    assert sorted(quarters) == pytest.approx([0, 0, 1, 1], abs=0.05)
    scene = trimesh.load_scene(export_glb(house, Catalogue(), tmp_path / "house.glb"))
    meshes = [scene.geometry[scene.graph[n][1]] for n in scene.graph.nodes_geometry if n.startswith("card")]
    assert sum(m.area for m in meshes) == pytest.approx(1.0, abs=0.06), "both sides of the two quarters"


def test_holes_repeat_with_the_texture(tmp_path):
    uv = (UV * 3).astype("<f4")
    parts = imported(
        tmp_path, model(pbr(baseColorTexture={"index": 0}) | {"alphaMode": "MASK"}, [leaf()], arrays={"TEXCOORD_0": uv})
    )
    assert area(parts) == pytest.approx(0.5, abs=0.05) and sum(len(p.faces) for p in parts) > 9


def test_glass_stays_glass(tmp_path):
    clear = imported(tmp_path / "a", model(pbr(baseColorFactor=[1, 1, 1, 0.3]) | {"alphaMode": "BLEND"}))
    opaque = imported(tmp_path / "b", model(pbr(baseColorFactor=[1, 1, 1, 0.3])))
    pane = Image.new("RGBA", (8, 8), (200, 220, 255, 102))
    picture = imported(tmp_path / "c", model(pbr(baseColorTexture={"index": 0}) | {"alphaMode": "BLEND"}, [pane]))
    assert [p.finish.color[3] for (p,) in (clear, opaque, picture)] == pytest.approx([0.3, 1.0, 0.4], abs=0.01)
    assert area(picture) == pytest.approx(1)


# glTF: texture coordinates


def halves() -> Image.Image:
    """Red on the left, blue on the right."""
    picture = Image.new("RGB", (16, 16), "red")
    picture.paste("blue", (8, 0, 16, 16))
    return picture


def colours_at(tmp_path, info: dict, uv: np.ndarray, **more) -> np.ndarray:
    material = pbr(baseColorTexture={"index": 0, **info})
    (part,) = imported(
        tmp_path, model(material, [halves()], arrays={"TEXCOORD_0": uv.astype("<f4"), **more.pop("arrays", {})}, **more)
    )
    return seen(part)


RED, BLUE = (1, 0, 0), (0, 0, 1)


def test_texture_transforms_and_second_coordinates_are_followed(tmp_path):
    left = UV * [0.4, 1] + [0.05, 0]
    shift = {"extensions": {"KHR_texture_transform": {"offset": [0.5, 0]}}}
    scale = {"extensions": {"KHR_texture_transform": {"scale": [-1, 1]}}}
    # a quarter turn takes (u, v) to (v, -u): rows become columns
    turn = {"extensions": {"KHR_texture_transform": {"rotation": np.pi / 2}}}
    low = UV * [1, 0.4] + [0, 0.55]
    np.testing.assert_allclose(colours_at(tmp_path / "0", {}, left), [RED] * 2)
    np.testing.assert_allclose(colours_at(tmp_path / "1", shift, left), [BLUE] * 2)
    np.testing.assert_allclose(colours_at(tmp_path / "2", scale, left), [BLUE] * 2)
    np.testing.assert_allclose(colours_at(tmp_path / "3", turn, low), [BLUE] * 2)
    second = {"arrays": {"TEXCOORD_1": (left + [0.5, 0]).astype("<f4")}}
    np.testing.assert_allclose(colours_at(tmp_path / "4", {"texCoord": 1}, left, **second), [BLUE] * 2)


def test_textures_that_are_clamped_or_mirrored_do_not_repeat(tmp_path):
    beyond = UV * 0.3 + [1.05, 0]
    wrapped = {"textures": [{"source": 0, "sampler": 0}]}
    np.testing.assert_allclose(colours_at(tmp_path / "0", {}, beyond), [RED] * 2)
    for name, wrap in (("1", 33071), ("2", 33648)):
        samplers = {"samplers": [{"wrapS": wrap}], **wrapped}
        np.testing.assert_allclose(colours_at(tmp_path / name, {}, beyond, **samplers), [BLUE] * 2)


# glTF: geometry


@pytest.mark.parametrize(("mode", "order"), [(5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])], ids=["strip", "fan"])
def test_strips_and_fans_are_filled_the_right_way_round(tmp_path, mode, order):
    for indices in (np.array(order, "<u2"), None):
        arrays = None if indices is not None else {"POSITION": QUAD[order], "TEXCOORD_0": UV[order]}
        parts = imported(tmp_path / str(indices is None), model(indices=indices, mode=mode, arrays=arrays))
        assert area(parts) == pytest.approx(1)
        normals = np.concatenate([face_normals(p.vertices, p.faces) for p in parts])
        assert (normals[:, 1] < 0).all(), "all of it faces the front"


def primitive(mode=4, **attributes):
    """A change that puts another part into the mesh."""
    return lambda header: header["meshes"][0]["primitives"].append({"attributes": attributes, "mode": mode})


def another(points, **node):
    """A change that puts another mesh into the scene: what a triangle of `points` is, in a node of its own."""

    def change(header: dict) -> None:
        header["buffers"].append({"uri": data_uri(np.array(points, "<f4"))})
        header["bufferViews"].append({"buffer": 1, "byteLength": 36})
        view, accessor = len(header["bufferViews"]) - 1, len(header["accessors"])
        header["accessors"].append({"bufferView": view, "componentType": 5126, "type": "VEC3", "count": len(points)})
        header["meshes"].append({"primitives": [{"attributes": {"POSITION": accessor}}] if points else []})
        header["nodes"].append({"mesh": 1, "name": "other", **node})
        header["scenes"][0]["nodes"].append(1)

    return change


CORNER = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
NAN = float("nan")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (primitive(mode=1, POSITION=0), "points and lines are left out"),
        (primitive(), "a part of mesh 0 is left out: it has no triangles"),
        (another([]), "a part of 'other' is left out: it has no triangles"),
        (another(CORNER[:2]), "a part of 'other' is left out: it has no triangles"),
        (another(CORNER, scale=[0, 0, 0], translation=[9, 9, 9]), "a part of 'other' is left out: it has no area"),
        (another([[0, 0, 0], [1, 0, 0], [9, 0, 0]]), "a part of 'other' is left out: it has no area"),
        (another([[0, 0, 0], [0, 0, 1], [0, 1, 0]], scale=[0, 1, 1], translation=[0.5, 0, 0]), ""),
        (another([[0, 0, 0], [1e-20, 0, 0], [0, 1e-20, 0]]), "are points or lines"),
        (another([*CORNER[:2], [NAN, 0, 0]]), "1 of 1 triangles of a part of 'other' are left out"),
        (lambda h: h.update(images=[{"uri": "lost.png"}]), "its pictures [0] are not drawn"),
    ],
    ids=range(10),
)
def test_a_part_with_nothing_to_draw_is_left_out_and_told(tmp_path, caplog, change, words):
    parts = imported(tmp_path, changed(model(), change))
    assert area(parts) == pytest.approx(1 if words else 1.5, abs=0.06) and words in caplog.text
    assert bool(words) == bool(caplog.text)


def test_a_model_with_nothing_to_draw_says_why(tmp_path):
    with pytest.raises(MeshError, match="nothing to draw: a part of mesh 0 is left out: it has no area"):
        imported(tmp_path, model(nodes=[{"mesh": 0, "scale": [0, 0, 0]}]))


@pytest.mark.parametrize(
    "begin",
    [
        b'{"extras": {"a": NaN, "b": 1e999}, ',
        b'{"extras": ' + b"[" * 60 + b"]" * 60 + b", ",
        b'{"scene": 1, ',
        b"\xef\xbb\xbf{",
    ],
    ids=["nan", "deep", "twice", "mark"],
)
def test_a_header_is_read_as_leniently_as_by_viewers(tmp_path, begin):
    data = model(scene=0)
    length = struct.unpack_from("<I", data, 12)[0]
    text = begin + data[21 : 20 + length] + b"\0" * 8  # zeros, where the format asks for blanks
    text = text[: len(text) // 4 * 4]
    file = data[:12] + struct.pack("<I", len(text)) + data[16:20] + text + data[20 + length :]
    assert area(imported(tmp_path, file)) == pytest.approx(1)


def test_numbers_that_are_none_are_replaced_and_told(tmp_path, caplog):
    uv = UV.copy()
    uv[2] = NAN
    data = model(pbr(roughnessFactor=NAN, baseColorTexture={"index": 0}), [halves()], arrays={"TEXCOORD_0": uv})
    (part,) = imported(tmp_path, changed(data, lambda header: header["materials"][0].update(name=7.5)))
    assert part.finish.roughness == 1.0 and np.isfinite(part.uv).all()
    assert "roughnessFactor is not finite" in caplog.text and "TEXCOORD_0 are not finite" in caplog.text


CLEAR = Image.new("RGBA", (8, 8), (128, 128, 128, 0))


def test_a_texture_that_is_transparent_everywhere_is_told(tmp_path, caplog):
    mtl = "newmtl paint\nKd 1 1 1\nd 1\nmap_Kd a.png\n"
    (part,) = obj(tmp_path / "a", f"mtllib a.mtl\n{SQUARE}{FACE}", mtl, a__png=picture(CLEAR))
    assert pixels(part)[4, 4].tolist() == [128, 128, 128, 255]
    assert "alpha channel of texture 'a.png' is 0 everywhere; it is drawn opaque" in caplog.text
    with pytest.raises(MeshError, match="material 'paint' is left out: its texture is transparent everywhere"):
        imported(tmp_path / "b", model(pbr(baseColorTexture={"index": 0}) | {"alphaMode": "MASK"}, [CLEAR]))


def data_uri(*arrays: np.ndarray) -> str:
    return "data:x;base64," + base64.b64encode(b"".join(a.tobytes() for a in arrays)).decode()


def test_sparse_accessors_move_the_vertices_they_name(tmp_path):
    def change(header: dict) -> None:
        header["buffers"].append({"uri": data_uri(np.array([2, 0], "<u2"), np.array([3, 1, 0], "<f4"))})
        header["bufferViews"] += [{"buffer": 1, "byteLength": 2}, {"buffer": 1, "byteOffset": 4, "byteLength": 12}]
        indices, values = {"bufferView": 3, "componentType": 5123}, {"bufferView": 4}
        header["accessors"][0]["sparse"] = {"count": 1, "indices": indices, "values": values}

    (part,) = imported(tmp_path, changed(model(), change), row={"size": [3.0, 0.1, 1.0]})
    assert area([part]) == pytest.approx(2.0), "one corner is drawn out to three metres"


def test_a_skin_stands_in_the_pose_it_is_saved_in_and_says_so(tmp_path, caplog):
    joints = np.zeros((4, 4), "u1")
    joints[2:, 0] = 1
    weights = np.tile(np.array([1, 0, 0, 0], "<f4"), (4, 1))
    data = model(
        arrays={"JOINTS_0": joints, "WEIGHTS_0": weights},
        nodes=[{"mesh": 0, "skin": 0, "translation": [9, 9, 9]}, {"children": [2]}, {"translation": [0, 2, 0]}],
        scenes=[{"nodes": [0, 1]}],
        skins=[{"joints": [1, 2]}],
    )
    (part,) = imported(tmp_path, data, row={"size": [1.0, 0.1, 3.0]})
    assert area([part]) == pytest.approx(3.0), "the upper edge follows its joint two metres up"
    assert "pose that it is saved in" in caplog.text


def test_a_mirrored_node_is_not_turned_inside_out(tmp_path):
    def mirror(header: dict) -> None:
        header["nodes"][-1].pop("matrix", None)
        header["nodes"][-1]["scale"] = [-1, 1, 1]

    (part,) = imported(tmp_path, changed(trimesh.creation.box().export(file_type="glb"), mirror))
    outward = np.einsum(
        "ij,ij->i", face_normals(part.vertices, part.faces), part.vertices[part.faces].mean(1) - [0, 0, 0.5]
    )
    assert (outward > 0).all()


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("KHR_draco_mesh_compression", "compression switched off"),
        ("EXT_meshopt_compression", "export it again"),
        ("KHR_texture_basisu", "PNG or JPEG"),
        ("EXT_texture_webp", "PNG or JPEG"),
        ("ACME_holograms", "export it again without it"),
    ],
)
def test_a_file_that_requires_what_is_not_read_is_refused_by_name(tmp_path, name, remedy):
    with pytest.raises(MeshError, match=name) as caught:
        imported(tmp_path, model(extensionsRequired=[name], extensionsUsed=[name]))
    assert remedy in str(caught.value) and "binary glTF 2.0" not in str(caught.value)


def with_pictures(material, images, textures) -> bytes:
    return changed(model(material), lambda header: header.update(images=images, textures=textures))


def test_a_webp_picture_beside_a_png_does_no_harm_and_alone_is_refused_by_name(tmp_path):
    webp = {"mimeType": "image/webp", "bufferView": 0}
    textures = [{"source": 1, "extensions": {"EXT_texture_webp": {"source": 0}}}]
    material = pbr(baseColorTexture={"index": 0})
    images = [webp, png(Image.new("RGB", (4, 4), "red"))]
    (part,) = imported(tmp_path, with_pictures(material, images, textures))
    np.testing.assert_allclose(seen(part), [RED] * 2)
    del textures[0]["source"]
    with pytest.raises(MeshError, match="EXT_texture_webp"):
        imported(tmp_path, with_pictures(material, images, textures))


def test_draco_that_nothing_is_told_of_is_refused_by_name_too(tmp_path):
    data = model(primitive={"extensions": {"KHR_draco_mesh_compression": {"bufferView": 0}}})
    with pytest.raises(MeshError, match="compression switched off"):
        imported(tmp_path, changed(data, lambda header: header["accessors"][0].pop("bufferView")))


@pytest.mark.parametrize(
    ("material", "more", "words"),
    [
        (pbr() | {"normalTexture": {"index": 0}}, {}, "normalTexture"),
        ({"name": "paint", "pbrMetallicRoughness": {}}, {}, "give it a metallicFactor"),
        (pbr() | {"emissiveFactor": [1, 1, 0]}, {}, "'glow'"),
        (pbr(), {"extensionsUsed": ["KHR_materials_sheen"]}, "KHR_materials_sheen"),
        (pbr(), {"animations": [{}]}, "animations are not played"),
        (pbr(), {"scenes": [{"nodes": [0]}, {"nodes": []}]}, "2 scenes"),
    ],
)
def test_what_a_gltf_file_asks_for_in_vain_is_told_every_time(tmp_path, caplog, material, more, words):
    for _ in range(2):
        caplog.clear()
        imported(tmp_path, model(material, [halves()], **more))
        assert words in caplog.text and all(r.levelno == logging.WARNING for r in caplog.records)


@pytest.mark.parametrize(
    "change",
    [
        lambda h: h["bufferViews"][0].update(byteLength=10**6),
        lambda h: h["bufferViews"][0].update(byteLength="many"),
        lambda h: h["accessors"][0].update(bufferView=7),
        lambda h: h["accessors"][0].update(count=10**15),
        lambda h: h["accessors"][0].update(count=-3),
        lambda h: h["accessors"][0].update(type="X"),
        lambda h: h.update(accessors=None),
        lambda h: h.update(meshes=[[]]),
        lambda h: h["nodes"][0].update(children=[0]),
        lambda h: h.update(nodes=[{"children": [1]}, {"mesh": 0, "children": [0]}]),
    ],
    ids=range(10),
)
def test_an_impossible_header_is_refused(tmp_path, change):
    with pytest.raises(MeshError, match="export it from there as binary glTF 2.0"):
        imported(tmp_path, changed(model(), change))


@pytest.mark.parametrize("data", [b"glTF" + b"\1" * 40, b"version https://git-lfs.github.com/spec/v1", b""])
def test_a_file_of_another_kind_is_refused_with_its_first_bytes(tmp_path, data):
    with pytest.raises(MeshError, match="it begins with b'.*export it as binary glTF 2.0"):
        imported(tmp_path, data)


def test_nothing_beside_a_file_is_opened_and_no_other_program_started(tmp_path, monkeypatch):
    for name in ("check_call", "Popen"):
        monkeypatch.setattr(subprocess, name, lambda *a, **k: pytest.fail(f"another program was started: {a}"))
    with pytest.raises(MeshError, match="export it as one .glb"):
        imported(tmp_path, changed(model(), lambda h: h.update(buffers=[{"uri": "../../etc/passwd"}])))
    postscript = png(Image.new("RGB", (8, 8), "red"), "EPS")
    with pytest.raises(MeshError, match="whole PNG or JPEG files"):
        imported(tmp_path, with_pictures(pbr(baseColorTexture={"index": 0}), [postscript], [{"source": 0}]))


# OBJ and MTL

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FACE = "usemtl paint\nf 1/1 2/2 3/3 4/4\n"


def obj(tmp_path, text: str, mtl: str | bytes | None = "newmtl paint\n", row=None, **files):
    named = {k.replace("__", "."): v for k, v in files.items()}
    if mtl is not None:
        named["a.mtl"] = mtl.encode() if isinstance(mtl, str) else mtl
    return imported(tmp_path, text.encode(), "a.obj", row, named)


def picture(image: Image.Image) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, "PNG")
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("statements", "alpha", "told"),
    [("Tr 1.0", 1.0, True), ("Tr 0.4", 0.6, False), ("d 0.5\nTr 1.0", 0.5, False), ("Tr 0.9\nd 1", 1.0, False)],
)
def test_transparency_of_one_is_opaque_and_d_wins(tmp_path, caplog, statements, alpha, told):
    (part,) = obj(tmp_path, "mtllib a.mtl\n" + SQUARE + FACE, f"newmtl paint\nKd 0.5 0.5 0.5\n{statements}\n")
    assert part.finish.color[3] == pytest.approx(alpha) and ("Tr 1" in caplog.text) == told


@pytest.mark.parametrize(
    "statement",
    [
        "mtllib b.mtl a.mtl",
        "mtllib b.mtl\nmtllib a.mtl",
        "mtllib .\\a.mtl",
        "mtllib C:\\models\\A.MTL",
        "mtllib\t./a.mtl",
    ],
)
def test_a_library_is_found_however_it_is_named(tmp_path, caplog, statement):
    (part,) = obj(tmp_path, f"{statement}\n{SQUARE}{FACE}", "newmtl paint\nKd 0.9 0 0\n", b__mtl=b"newmtl other\n")
    assert part.finish.color[:3] == (0.9, 0, 0) and not caplog.text


@pytest.mark.parametrize("name", ["Stühle.mtl", "椅子.mtl", "my chair.mtl"])
def test_names_need_not_be_latin(tmp_path, name):
    material = name.removesuffix(".mtl")
    files = {name: f"newmtl {material}\nKd 0 0.9 0\n".encode()}
    text = f"mtllib {name}\n{SQUARE}usemtl {material}\nf 1 2 3 4\n".encode()
    (part,) = imported(tmp_path, text, "a.obj", {"looks": {}}, files)
    assert part.finish.color[:3] == (0, 0.9, 0)


def test_lost_libraries_materials_and_pictures_are_told(tmp_path, caplog):
    obj(tmp_path / "a", f"mtllib lost.mtl\n{SQUARE}{FACE}", None)
    assert "'lost.mtl' is not there" in caplog.text and "'paint'" in caplog.text
    obj(tmp_path / "b", f"mtllib a.mtl\n{SQUARE}{FACE}", "newmtl paint\nmap_Kd lost.png\nmap_Bump x.png\nKe 1 1 1\n")
    for words in ("'lost.png' is not there", "map_Bump", "'glow'"):
        assert words in caplog.text


def test_the_diffuse_colour_tints_the_texture_unless_it_is_black(tmp_path):
    grey = picture(Image.new("RGB", (8, 8), (200, 200, 200)))
    for kd, colour in (("0.5 1 0", (100, 200, 0)), ("0 0 0", (200, 200, 200)), ("1 1 1", (200, 200, 200))):
        mtl = f"newmtl paint\nKd {kd}\nmap_Kd a.png\n"
        (part,) = obj(tmp_path / kd[:3], f"mtllib a.mtl\n{SQUARE}{FACE}", mtl, a__png=grey)
        np.testing.assert_allclose(pixels(part)[4, 4, :3], colour, atol=1)


def test_one_face_without_texture_coordinates_leaves_the_others_theirs(tmp_path, caplog):
    text = f"mtllib a.mtl\n{SQUARE}v 2 0 0\nv 2 1 0\n{FACE}f 2 5 6 3\n"
    parts = obj(
        tmp_path, text, "newmtl paint\nKd 1 1 1\nmap_Kd a.png\n", a__png=picture(Image.new("RGB", (4, 4), "red"))
    )
    assert sorted(p.finish.texture is None for p in parts) == [False, True]
    assert "no texture coordinates" in caplog.text
    np.testing.assert_allclose(
        next(p for p in parts if p.finish.texture is None).finish.color[:3], (0.92, 0, 0), atol=0.01
    )


def test_options_of_a_map_are_followed(tmp_path):
    for name, option, colour in (
        ("0", "", RED),
        ("1", "-o 0.5 0 0", BLUE),
        ("2", "-s 2 1 1 -o 0.3", BLUE),
        ("3", "-blendu off -mm 0 1 -o 0.5", BLUE),
        ("4", "-clamp on -o 5", BLUE),
    ):
        text = "mtllib a.mtl\n" + SQUARE.replace("vt 1", "vt 0.45") + FACE
        mtl = f"newmtl paint\nKd 1 1 1\nmap_Kd {option} my wood.png\n"
        (part,) = obj(tmp_path / name, text, mtl, **{"my wood__png": picture(halves())})
        middle = part.uv.mean(0) % 1
        shown = pixels(part)[8, int(middle[0] * 16) % 16, :3] / 255
        np.testing.assert_allclose(shown, colour, err_msg=option)


def test_a_leaf_card_of_obj_is_cut(tmp_path):
    inside = obj(
        tmp_path / "a", f"mtllib a.mtl\n{SQUARE}{FACE}", "newmtl paint\nmap_Kd a.png\n", a__png=picture(leaf())
    )
    mask = leaf().getchannel("A")
    mtl = "newmtl paint\nKd 1 1 1\nmap_Kd a.png\nmap_d b.png\n"
    apart = obj(
        tmp_path / "b",
        f"mtllib a.mtl\n{SQUARE}{FACE}",
        mtl,
        a__png=picture(Image.new("RGB", (8, 8), "green")),
        b__png=picture(mask),
    )
    assert area(inside) == pytest.approx(0.5, abs=0.03) and area(apart) == pytest.approx(0.5, abs=0.03)


def test_colours_of_obj_vertices_are_drawn(tmp_path):
    red = SQUARE.replace(" 0\nv", " 0 0.9 0 0\nv").replace("v 0 1 0\n", "v 0 1 0 0.9 0 0\n")
    (part,) = obj(tmp_path / "a", red + "f 1 2 3 4\n", None)
    np.testing.assert_allclose(part.finish.color[:3], (0.9, 0, 0), atol=1e-3)
    (part,) = obj(tmp_path / "b", red.replace("0.9 0 0", "230 0 0") + "f 1 2 3 4\n", None)
    np.testing.assert_allclose(part.finish.color[:3], (0.902, 0, 0), atol=1e-3)


def test_tabs_comments_and_continued_lines_are_read(tmp_path):
    text = "mtllib\ta.mtl\r\n" + SQUARE.replace("v ", "v\t").replace("\n", "\r\n")
    text += "usemtl\tpaint\r\nf 1/1\t2/2 \\\r\n 3/3 4/4 # a square\r\n"
    (part,) = obj(tmp_path, text, "newmtl\tpaint\r\nKd\t0.1 \\\r\n 0.2 0.3\r\n")
    assert area([part]) == pytest.approx(1) and part.finish.color[:3] == (0.1, 0.2, 0.3)


def test_negative_indices_count_back_from_their_own_line(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nv 0 0 0\nv 1 1 0\nf -1 -3 -2\n"
    parts = obj(tmp_path, text, None)
    assert area(parts) == pytest.approx(1)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("f 0 1 2", "a bad index in 'f 0 1 2' (index 0 of 5)"),
        ("f 1 2 9 # none", "a bad index in 'f 1 2 9 ' (index 9 of 5)"),
        ("f -1 -2 -9", "a bad index in 'f -1 -2 -9' (index -9 of 5)"),
        ("f 1/0 2/1 3/2", "a bad index in 'f 1/0 2/1 3/2' (index 0 of 4)"),
        ("f 1 2 x", "a bad index in 'f 1 2 x'"),
        ("v 1 2", "'v' should have 3 numbers, got '1 2'"),
        ("v 1 2 three", "'v' should have 3 numbers, got '1 2 three'"),
        ("vt a b", "'vt' should have 2 numbers, got 'a b'"),
    ],
)
def test_a_line_that_cannot_be_read_is_named_with_what_to_do(tmp_path, line, words):
    with pytest.raises(MeshError) as caught:
        obj(tmp_path, f"# a comment \\\r\n of two lines\r\n{SQUARE}{line}\nv 5 5 5\n", None)
    assert f"a.obj, line 11: {words}" in str(caught.value) and "correct that line" in str(caught.value)


def test_what_is_not_drawn_of_an_obj_file_is_told(tmp_path, caplog):
    text = SQUARE + FACE + "l 1 2\ncurv 0 1 1 2\nv 0 0 nan\nvt nan 0\nf 1 2 5\nf 1 2\nf 1 1 1\nusemtl point\nf 1 1 1\n"
    mtl = "newmtl paint\nKd red\nNs nan\nmap_Kd -s 1.2.3 a.png\n"
    parts = obj(tmp_path, f"mtllib a.mtl\n{text}", mtl)
    assert area(parts) == pytest.approx(1)
    for words in (
        "its lines are left out",
        "its curves are left out",
        "some faces are left out",
        "the Kd of",
        "the Ns of",
    ):
        assert words in caplog.text
    assert "'point' is left out: its faces have no area" in caplog.text
    with pytest.raises(MeshError, match=r"no faces that can be drawn \(some faces are left out: .* not finite\)"):
        obj(tmp_path / "b", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3", None)


def test_roughness_and_metal_of_an_mtl_are_taken(tmp_path):
    (part,) = obj(tmp_path, f"mtllib a.mtl\n{SQUARE}{FACE}", "newmtl paint\nPr 0.33\nPm 1\n")
    assert (part.finish.roughness, part.finish.metallic) == (0.33, 1.0)


@pytest.mark.parametrize("yaw", [0, 30, 90, 137.5, -45])
def test_a_model_has_its_size_however_it_is_turned(tmp_path, yaw):
    box = trimesh.creation.box((1, 2, 3)).export(file_type="glb")
    size = (0.6, 0.5, 0.9)
    low, high = bounds(imported(tmp_path, box, row={"yaw": yaw, "size": list(size)}))
    np.testing.assert_allclose(high - low, size, atol=1e-4)
    np.testing.assert_allclose((low + high)[:2], 0, atol=1e-4)
