"""What glTF, OBJ and MTL say of a user's own model is drawn, told of in vain, or refused by name: a table for each."""

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
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


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


# glTF


def all_normals(parts) -> np.ndarray:
    return np.concatenate([face_normals(p.vertices, p.faces) for p in parts])


def looks_like(parts, colours) -> bool:
    """True where every face has one of the colours, and each colour is that of a face."""
    apart = np.linalg.norm(np.concatenate([seen(p) for p in parts])[:, None] - np.atleast_2d(colours), axis=-1)
    return bool((apart.min(0) < 0.02).all() and (apart.min(1) < 0.02).all())


def leaf(size: int = 32, faint: int = 0) -> Image.Image:
    """Green in the upper left and the lower right quarter of the picture; the rest transparent."""
    pixels = np.zeros((size, size, 4), np.uint8)
    pixels[...] = (255, 0, 255, faint)
    half = size // 2
    pixels[:half, :half] = pixels[half:, half:] = (0, 200, 0, 255)
    return Image.fromarray(pixels)


def halves() -> Image.Image:
    """Red on the left, blue on the right."""
    picture = Image.new("RGB", (16, 16), "red")
    picture.paste("blue", (8, 0, 16, 16))
    return picture


def data_uri(*arrays: np.ndarray) -> str:
    return "data:x;base64," + base64.b64encode(b"".join(a.tobytes() for a in arrays)).decode()


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


def with_colours(kind: str) -> bytes:
    """A square whose corners are red but for one that is blue, of a material that halves red."""
    colours = np.array([[1, 0, 0, 1], [1, 0, 0, 1], [1, 0, 0, 1], [0, 0, 1, 1]], float)
    held = colours.astype("<f4") if kind == "f4" else (colours * np.iinfo(kind).max).astype(f"<{kind}")
    data = model(pbr(baseColorFactor=[0.5, 1, 1, 1]), arrays={"COLOR_0": held})
    return changed(data, lambda h: h["accessors"][2].update(normalized=kind != "f4"))


def mapped(uv: np.ndarray, info=None, arrays=None, **more) -> bytes:
    """A square that shows the halves at `uv`, as `info` says of its texture."""
    material = pbr(baseColorTexture={"index": 0, **(info or {})})
    return model(material, [halves()], arrays={"TEXCOORD_0": uv.astype("<f4"), **(arrays or {})}, **more)


def transformed(**fields) -> dict:
    return {"extensions": {"KHR_texture_transform": fields}}


def wrapped(how: int) -> dict:
    return {"samplers": [{"wrapS": how}], "textures": [{"source": 0, "sampler": 0}]}


def beginning(begin: bytes) -> bytes:
    """A file whose header begins otherwise, and ends in zeros where the format asks for blanks."""
    data = model(scene=0)
    length = struct.unpack_from("<I", data, 12)[0]
    text = begin + data[21 : 20 + length] + b"\0" * 8
    text = text[: len(text) // 4 * 4]
    return data[:12] + struct.pack("<I", len(text)) + data[16:20] + text + data[20 + length :]


def sparse(header: dict) -> None:
    header["accessors"][0]["sparse"] = {"count": 1, "indices": {}, "values": {}}


RED, BLUE, GREEN, PLAIN = (1, 0, 0), (0, 0, 1), (0, 0.784, 0), (0.8, 0.8, 0.8)
CARD = pbr(baseColorTexture={"index": 0})
LEFT, LOW, BEYOND = UV * [0.4, 1] + [0.05, 0], UV * [1, 0.4] + [0, 0.55], UV * 0.3 + [1.05, 0]
GREY = Image.new("RGB", (8, 8), (188, 188, 188))  # 0.5 linear
THREE_TIMES = {"TEXCOORD_0": (UV * 3).astype("<f4")}
DRAWN = {
    "a linear colour": (model(pbr(baseColorFactor=[0.214, 0.0331, 1, 1])), 1, [(0.5, 0.2, 1)]),
    "a texture": (
        model(pbr(baseColorFactor=[1, 0.5, 0, 1], baseColorTexture={"index": 0}), [GREY]),
        1,
        [(0.737, 0.537, 0)],
    ),
    "colours alone": (model(arrays={"COLOR_0": np.tile(np.array([0, 1, 0], "<f4"), (4, 1))}), 1, [(0, 1, 0)]),
    **{f"colours {k}": (with_colours(k), 1, [(0.735, 0, 0), (0.612, 0, 0.612)]) for k in CODES},
    "coordinates": (mapped(LEFT), 1, [RED]),
    "second coordinates": (mapped(LEFT, {"texCoord": 1}, {"TEXCOORD_1": (LEFT + [0.5, 0]).astype("<f4")}), 1, [BLUE]),
    "moved coordinates": (mapped(LEFT, transformed(offset=[0.5, 0])), 1, [BLUE]),
    "scaled coordinates": (mapped(LEFT, transformed(scale=[-1, 1])), 1, [BLUE]),
    "turned coordinates": (mapped(LOW, transformed(rotation=np.pi / 2)), 1, [BLUE]),
    "a repeated texture": (mapped(BEYOND), 1, [RED]),
    "a clamped texture": (mapped(BEYOND, **wrapped(33071)), 1, [BLUE]),
    "a mirrored texture": (mapped(BEYOND, **wrapped(33648)), 1, [BLUE]),
    "a leaf with a mask": (model(CARD | {"alphaMode": "MASK"}, [leaf()]), 0.5, [GREEN]),
    "a leaf that is blended": (model(CARD | {"alphaMode": "BLEND"}, [leaf()]), 0.5, [GREEN]),
    "leaves that repeat": (model(CARD | {"alphaMode": "MASK"}, [leaf()], arrays=THREE_TIMES), 0.5, [GREEN]),
    "a leaf that is opaque": (model(CARD, [leaf()]), 1, [GREEN]),
    "a mirrored node": (model(nodes=[{"mesh": 0, "scale": [-1, 1, 1]}]), 1, [PLAIN]),
    "numbers that are none": (beginning(b'{"extras": {"a": NaN, "b": 1e999}, '), 1, [PLAIN]),
    "nested extras": (beginning(b'{"extras": ' + b"[" * 60 + b"]" * 60 + b", "), 1, [PLAIN]),
    "a mark of byte order": (beginning(b"\xef\xbb\xbf{"), 1, [PLAIN]),
}
"""Binary glTF, the area drawn of it in a cube of one metre, and its colours; all of it faces the front."""


@pytest.mark.parametrize(("data", "size", "colours"), DRAWN.values(), ids=DRAWN)
def test_gltf_is_drawn_as_the_format_says(tmp_path, data, size, colours):
    parts = imported(tmp_path, data)
    assert area(parts) == pytest.approx(size, abs=0.05) and (all_normals(parts)[:, 1] < 0).all()
    assert looks_like(parts, colours)


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


def test_a_two_sided_sheet_is_seen_from_behind_and_a_two_sided_box_is_turned_not_doubled(tmp_path):
    sheet = imported(tmp_path / "a", model(pbr() | {"doubleSided": True}))
    box = trimesh.creation.box()
    box.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(doubleSided=True))
    box.invert()
    (solid,) = imported(tmp_path / "b", box.export(file_type="glb"))
    assert area(sheet) == pytest.approx(2, rel=0.01) and abs(all_normals(sheet).sum(0)).max() < 1e-6
    outward = solid.vertices[solid.faces].mean(1) - [0, 0, 0.5]
    assert area([solid]) == pytest.approx(6, rel=0.02) and (all_normals([solid]) * outward).sum(1).min() > 0


def test_glass_stays_glass(tmp_path):
    clear = imported(tmp_path / "a", model(pbr(baseColorFactor=[1, 1, 1, 0.3]) | {"alphaMode": "BLEND"}))
    opaque = imported(tmp_path / "b", model(pbr(baseColorFactor=[1, 1, 1, 0.3])))
    pane = Image.new("RGBA", (8, 8), (200, 220, 255, 102))
    picture = imported(tmp_path / "c", model(pbr(baseColorTexture={"index": 0}) | {"alphaMode": "BLEND"}, [pane]))
    assert [p.finish.color[3] for (p,) in (clear, opaque, picture)] == pytest.approx([0.3, 1.0, 0.4], abs=0.01)
    assert area(picture) == pytest.approx(1)


def test_what_a_metalness_map_calls_wood_is_no_metal(tmp_path):
    mixed = Image.new("RGB", (8, 8), (0, 128, 0))  # green is roughness, blue is metalness
    mixed.paste((0, 51, 255), (4, 0, 8, 8))
    material = {"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}, "roughnessFactor": 0.5}}
    strip = np.concatenate([QUAD, QUAD + [1, 0, 0]]).astype("<f4")
    uv = np.concatenate([UV * [0.4, 1], UV * [0.4, 1] + [0.6, 0]]).astype("<f4")
    both = np.concatenate([ROUND, ROUND + 4]).astype("<u2")
    parts = imported(tmp_path, model(material, [mixed], arrays={"POSITION": strip, "TEXCOORD_0": uv}, indices=both))
    assert sorted((p.finish.metallic, p.finish.roughness) for p in parts) == [(0.0, 0.251), (1.0, 0.1)]


def test_a_house_exported_as_glb_comes_back_in_its_own_colours(tmp_path):
    colour = (0.5, 0.25, 0.8, 1.0)
    box = trimesh.creation.box()
    uv = np.zeros((len(box.vertices), 2))
    box.visual = trimesh.visual.TextureVisuals(uv=uv, material=pbr_material(Finish(colour)))
    (part,) = imported(tmp_path, box.export(file_type="glb"))
    np.testing.assert_allclose(part.finish.color, colour, atol=5e-3)


CORNER = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
NAN = float("nan")
LOST_UV = {"TEXCOORD_0": np.where([[0], [0], [1], [0]], NAN, UV).astype("<f4")}
TOLD = {
    "lines": (changed(model(), primitive(mode=1, POSITION=0)), "points and lines are left out"),
    "no triangles": (changed(model(), primitive()), "a part of mesh 0 is left out: it has no triangles"),
    "no primitive": (changed(model(), another([])), "a part of 'other' is left out: it has no triangles"),
    "no area": (changed(model(), another(CORNER, scale=[0, 0, 0])), "a part of 'other' is left out: it has no area"),
    "points": (changed(model(), another([[0, 0, 0], [1e-20, 0, 0], [0, 1e-20, 0]])), "are points or lines"),
    "a corner nowhere": (
        changed(model(), another([*CORNER[:2], [NAN, 0, 0]])),
        "1 of 1 triangles of a part of 'other'",
    ),
    "a lost picture": (changed(model(), lambda h: h.update(images=[{"uri": "lost.png"}])), "[0] are not drawn"),
    "roughness": (model(pbr(roughnessFactor=NAN)), "roughnessFactor is not finite"),
    "coordinates nowhere": (model(CARD, [halves()], arrays=LOST_UV), "TEXCOORD_0 are not finite"),
    "no coordinates": (model(pbr(baseColorTexture={"index": 0, "texCoord": 3}), [halves()]), "no TEXCOORD_3"),
    "normals": (model(pbr() | {"normalTexture": {"index": 0}}), "normalTexture"),
    "metal": (model({"name": "paint", "pbrMetallicRoughness": {}}), "give it a metallicFactor"),
    "light": (model(pbr() | {"emissiveFactor": [1, 1, 0]}), "'glow'"),
    "sheen": (model(pbr(), extensionsUsed=["KHR_materials_sheen"]), "KHR_materials_sheen"),
    "animations": (model(pbr(), animations=[{}]), "animations are not played"),
    "scenes": (model(pbr(), scenes=[{"nodes": [0]}, {"nodes": []}]), "2 scenes"),
}


@pytest.mark.parametrize(("data", "words"), TOLD.values(), ids=TOLD)
def test_what_a_gltf_file_asks_for_in_vain_is_told_every_time(tmp_path, caplog, data, words):
    for _ in range(2):
        caplog.clear()
        parts = imported(tmp_path, data)
        assert words in caplog.text and "mine/box" in caplog.text
        assert all(r.levelno == logging.WARNING for r in caplog.records)
    assert all(np.isfinite(p.uv).all() and np.isfinite(p.vertices).all() for p in parts)


def required(name: str) -> bytes:
    return model(extensionsRequired=[name], extensionsUsed=[name])


def with_picture(image: dict, **texture) -> bytes:
    return changed(model(CARD), lambda h: h.update(images=[image], textures=[texture]))


CLEAR = Image.new("RGBA", (8, 8), (128, 128, 128, 0))
COMPRESSED = model(primitive={"extensions": {"KHR_draco_mesh_compression": {"bufferView": 0}}})
WEBP = {"mimeType": "image/webp", "bufferView": 0}, {"extensions": {"EXT_texture_webp": {"source": 0}}}
EPS = png(Image.new("RGB", (8, 8), "red"), "EPS")
ANEW = "export it from there as binary glTF 2.0"
REFUSED = {
    "Draco": (required("KHR_draco_mesh_compression"), "compression switched off .KHR_draco"),
    "Draco untold": (changed(COMPRESSED, lambda h: h["accessors"][0].pop("bufferView")), "compression switched off"),
    "meshopt": (required("EXT_meshopt_compression"), "export it again.*EXT_meshopt"),
    "Basis": (required("KHR_texture_basisu"), "PNG or JPEG"),
    "WebP": (with_picture(WEBP[0], **WEBP[1]), "PNG or JPEG.*EXT_texture_webp"),
    "an extension of somebody's own": (required("ACME_holograms"), "ACME_holograms.* export it again without it"),
    "no area": (model(nodes=[{"mesh": 0, "scale": [0, 0, 0]}]), "nothing to draw: a part of mesh 0 is left out"),
    "clear": (model(CARD | {"alphaMode": "MASK"}, [CLEAR]), "'paint' is left out: its texture is transparent"),
    "a view beyond the end": (changed(model(), lambda h: h["bufferViews"][0].update(byteLength=10**6)), ANEW),
    "a negative count": (changed(model(), lambda h: h["accessors"][0].update(count=-3)), ANEW),
    "no meshes": (changed(model(), lambda h: h.update(meshes=[[]])), ANEW),
    "a circle": (changed(model(), lambda h: h["nodes"][0].update(children=[0])), ANEW),
    "sparse corners": (changed(model(), sparse), "sparse accessors; .*export it again"),
    "a fan": (model(mode=6), "strips or fans; .*export it again"),
    "a skeleton": (model(nodes=[{"mesh": 0, "skin": 0}]), "by a skeleton or shape keys; apply them"),
    "another kind": (b"version https://git-lfs.github.com/spec/v1", "it begins with b'.*export it as binary glTF 2.0"),
    "another version": (b"glTF" + b"\1" * 40, "it begins with b'"),
    "a file beside": (changed(model(), lambda h: h.update(buffers=[{"uri": "../passwd"}])), "export it as one .glb"),
    "PostScript": (with_picture(EPS, source=0), "whole PNG or JPEG files"),
}
"""For what else is damaged see test_damaged_files.py."""


@pytest.mark.parametrize(("data", "why"), REFUSED.values(), ids=REFUSED)
def test_gltf_that_cannot_be_drawn_is_refused_with_the_remedy_and_starts_no_program(tmp_path, monkeypatch, data, why):
    for name in ("check_call", "Popen"):
        monkeypatch.setattr(subprocess, name, lambda *a, **k: pytest.fail(f"another program was started: {a}"))
    with pytest.raises(MeshError, match=why):
        imported(tmp_path, data)


def test_a_webp_picture_beside_a_png_does_no_harm(tmp_path):
    images = [WEBP[0], png(Image.new("RGB", (4, 4), "red"))]
    textures = [{"source": 1, **WEBP[1]}]
    assert looks_like(
        imported(tmp_path, changed(model(CARD), lambda h: h.update(images=images, textures=textures))), [RED]
    )


# OBJ and MTL

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FACE = "usemtl paint\nf 1/1 2/2 3/3 4/4\n"
PAINTED = f"mtllib a.mtl\n{SQUARE}{FACE}"


def picture(image: Image.Image) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, "PNG")
    return buffer.getvalue()


def obj(tmp_path, text: str, mtl: str | None = "", **pictures):
    """The parts of a.obj beside a.mtl, which says `mtl` of 'paint', and pictures by their names without .png."""
    files = {f"{name}.png": data for name, data in pictures.items()}
    if mtl is not None:
        files["a.mtl"] = f"newmtl paint\n{mtl}\n".encode()
    return imported(tmp_path, text.encode(), "a.obj", files=files)


@pytest.mark.parametrize(
    ("statements", "alpha", "told"),
    [("Tr 1.0", 1.0, True), ("Tr 0.4", 0.6, False), ("d 0.5\nTr 1.0", 0.5, False), ("Tr 0.9\nd 1", 1.0, False)],
)
def test_transparency_of_one_is_opaque_and_d_wins(tmp_path, caplog, statements, alpha, told):
    (part,) = obj(tmp_path, PAINTED, f"Kd 0.5 0.5 0.5\n{statements}")
    assert part.finish.color[3] == pytest.approx(alpha) and ("Tr 1" in caplog.text) == told


@pytest.mark.parametrize(
    ("statement", "name"),
    [
        ("mtllib b.mtl a.mtl", "a.mtl"),
        ("mtllib b.mtl\nmtllib a.mtl", "a.mtl"),
        ("mtllib .\\a.mtl", "a.mtl"),
        ("mtllib C:\\models\\A.MTL", "a.mtl"),
        ("mtllib\t./a.mtl", "a.mtl"),
        ("mtllib Stühle.mtl", "Stühle.mtl"),
        ("mtllib my chair.mtl", "my chair.mtl"),
    ],
)
def test_a_library_is_found_however_it_is_named(tmp_path, caplog, statement, name):
    files = {name: "newmtl 椅子\nKd 0.9 0 0\n".encode(), "b.mtl": b"newmtl other\n"}
    text = f"{statement}\n{SQUARE}{FACE.replace('paint', '椅子')}"
    (part,) = imported(tmp_path, text.encode(), "a.obj", files=files)
    assert part.finish.color[:3] == (0.9, 0, 0) and not caplog.text


HALF = PAINTED.replace("vt 1", "vt 0.45")
RED_CORNERS = SQUARE.replace(" 0\nv", " 0 0.9 0 0\nv").replace("v 0 1 0\n", "v 0 1 0 0.9 0 0\n") + "f 1 2 3 4\n"
BACKWARDS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nv 0 0 0\nv 1 1 0\nf -1 -3 -2\n"
TABBED = PAINTED.replace("v ", "v\t").replace("3/3", "\\\n 3/3").replace("4/4", "4/4 # a square").replace("\n", "\r\n")
STRETCHED = f"mtllib a.mtl\n{SQUARE}v 2 0 0\nv 2 1 0\n{FACE}f 2 5 6 3\n"
DRAWN_OBJ = {
    "a tinted texture": (PAINTED, "Kd 0.5 1 0\nmap_Kd grey.png", 1, (0.369, 0.737, 0)),
    "a texture under black": (PAINTED, "Kd 0 0 0\nmap_Kd grey.png", 1, (0.737,) * 3),
    "a texture": (HALF, "Kd 1 1 1\nmap_Kd halves.png", 1, RED),
    "a moved texture": (HALF, "Kd 1 1 1\nmap_Kd -o 0.5 0 0 halves.png", 1, BLUE),
    "a scaled texture": (HALF, "Kd 1 1 1\nmap_Kd -s 2 1 1 -o 0.3 halves.png", 1, BLUE),
    "options to no effect": (HALF, "Kd 1 1 1\nmap_Kd -blendu off -mm 0 1 -o 0.5 halves.png", 1, BLUE),
    "a clamped texture": (HALF, "Kd 1 1 1\nmap_Kd -clamp on -o 5 halves.png", 1, BLUE),
    "a leaf": (PAINTED, "Kd 1 1 1\nmap_Kd leaf.png", 0.5, GREEN),
    "a leaf whose mask lies apart": (PAINTED, "Kd 1 1 1\nmap_Kd grey.png\nmap_d mask.png", 0.5, (0.737,) * 3),
    "a texture that is clear": (PAINTED, "Kd 1 1 1\nd 1\nmap_Kd clear.png", 1, (0.502,) * 3),
    "colours of corners": (RED_CORNERS, "", 1, (0.9, 0, 0)),
    "colours in bytes": (RED_CORNERS.replace("0.9 0 0", "230 0 0"), "", 1, (0.902, 0, 0)),
    "indices from the end": (BACKWARDS, "", 1, PLAIN),
    "a face without coordinates": (STRETCHED, "Kd 1 1 1\nmap_Kd red.png", 1, [RED, (0.92, 0, 0)]),
    "tabs, comments, continued lines": (TABBED, "Kd\t0.1 \\\r\n 0.2 0.3", 1, (0.1, 0.2, 0.3)),
}


@pytest.mark.parametrize(("text", "mtl", "size", "colour"), DRAWN_OBJ.values(), ids=DRAWN_OBJ)
def test_obj_is_drawn_as_exporters_mean_it(tmp_path, text, mtl, size, colour):
    red, mask = Image.new("RGB", (4, 4), "red"), leaf().getchannel("A")
    pictures = {"grey": GREY, "halves": halves(), "leaf": leaf(), "mask": mask, "clear": CLEAR, "red": red}
    parts = obj(tmp_path, text, mtl, **{name: picture(image) for name, image in pictures.items()})
    assert area(parts) == pytest.approx(size, abs=0.03) and looks_like(parts, colour)


def test_roughness_and_metal_of_an_mtl_are_taken(tmp_path):
    (part,) = obj(tmp_path, PAINTED, "Pr 0.33\nPm 1")
    assert (part.finish.roughness, part.finish.metallic) == (0.33, 1.0)


ODD = "l 1 2\ncurv 0 1 1 2\nv 0 0 nan\nvt nan 0\nf 1 2 5\nf 1 2\nf 1 1 1\nusemtl point\nf 1 1 1\n"
ODD_WORDS = ("its lines are left out", "its curves are left out", "some faces are left out", "the Kd of", "the Ns of")
TOLD_OF_OBJ = {
    "a lost library": (f"mtllib lost.mtl\n{SQUARE}{FACE}", "", ("'lost.mtl' is not there", "'paint'")),
    "lost pictures": (PAINTED, "map_Kd lost.png\nmap_Bump x.png\nKe 1 1 1", ("'lost.png' is", "map_Bump", "'glow'")),
    "a clear texture": (
        PAINTED,
        "Kd 1 1 1\nd 1\nmap_Kd clear.png",
        ("'clear.png' is 0 everywhere; it is drawn opaque",),
    ),
    "odd lines": (
        PAINTED + ODD,
        "Kd red\nNs nan\nmap_Kd -s 1.2.3 a.png",
        (*ODD_WORDS, "'point' is left out: its faces"),
    ),
}


@pytest.mark.parametrize(("text", "mtl", "told"), TOLD_OF_OBJ.values(), ids=TOLD_OF_OBJ)
def test_what_is_not_drawn_of_an_obj_file_is_told(tmp_path, caplog, text, mtl, told):
    assert area(obj(tmp_path, text, mtl, clear=picture(CLEAR))) == pytest.approx(1)
    assert [words for words in told if words not in caplog.text] == []


def test_an_obj_file_without_faces_that_can_be_drawn_is_refused(tmp_path):
    with pytest.raises(MeshError, match=r"no faces that can be drawn \(some faces are left out: .* not finite\)"):
        obj(tmp_path, "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3", None)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("f 0 1 2", "a bad index in 'f 0 1 2' (index 0 of 5)"),
        ("f 1 2 9 # none", "a bad index in 'f 1 2 9 ' (index 9 of 5)"),
        ("f 1/0 2/1 3/2", "a bad index in 'f 1/0 2/1 3/2' (index 0 of 4)"),
        ("f 1 2 x", "a bad index in 'f 1 2 x'"),
        ("v 1 2 three", "'v' should have 3 numbers, got '1 2 three'"),
        ("vt a b", "'vt' should have 2 numbers, got 'a b'"),
    ],
)
def test_a_line_that_cannot_be_read_is_named_with_what_to_do(tmp_path, line, words):
    with pytest.raises(MeshError) as caught:
        obj(tmp_path, f"# a comment \\\r\n of two lines\r\n{SQUARE}{line}\nv 5 5 5\n", None)
    assert f"a.obj, line 11: {words}" in str(caught.value) and "correct that line" in str(caught.value)


@pytest.mark.parametrize("yaw", [0, 30, 90, 137.5, -45])
def test_a_model_has_its_size_however_it_is_turned(tmp_path, yaw):
    box = trimesh.creation.box((1, 2, 3)).export(file_type="glb")
    size = (0.6, 0.5, 0.9)
    low, high = bounds(imported(tmp_path, box, row={"yaw": yaw, "size": list(size)}))
    np.testing.assert_allclose(high - low, size, atol=1e-4)
    np.testing.assert_allclose((low + high)[:2], 0, atol=1e-4)
