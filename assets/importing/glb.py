"""Binary glTF 2.0 files as RawParts: triangles, colours and pictures as the format means them.

Why not trimesh's loader, nor Assimp's: the one drops what it does not know without a word (second texture coordinates,
texture transforms, skins), the other reads files beside the model, in C++, unchecked; and what a file requires must be
read here all the same, to refuse it by name.
"""

import base64
import io
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from embodied.assets.importing.importer import MAX_PIXELS, MAX_TEXTURE, RawPart, Tell
from embodied.assets.importing.meshing import face_normals
from embodied.assets.importing.obj import FARTHEST_VERTEX, MAX_FACES, MeshError
from embodied.assets.importing.sh3f import MAX_ENTRY
from embodied.assets.importing.textures import mirrored, palette, sampled, shrunk, tinted, to_linear, to_srgb
from embodied.assets.json_file import shown
from embodied.assets.records import Finish

JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
PICTURES = ("PNG", "JPEG")
"""The two kinds of picture that glTF 2.0 knows (section 3.8.3)."""
FOREIGN = ("image/webp", "image/ktx2", "image/avif", "image/vnd-ms.dds")
"""Kinds of pictures of extensions, beside which files may hold the others."""
HONOURED = ("KHR_texture_transform", "KHR_mesh_quantization", "KHR_materials_pbrSpecularGlossiness")
DRACO = "KHR_draco_mesh_compression"
REFUSED = {
    DRACO: "its mesh is compressed by Draco; export it again with compression switched off",
    "EXT_meshopt_compression": "it is compressed by meshopt; export it again, or copy it with gltfpack without -c",
    "KHR_texture_basisu": "its textures are KTX2 (Basis Universal); export it again with PNG or JPEG textures",
    "EXT_texture_webp": "its textures are WebP; export it again with PNG or JPEG textures",
    "EXT_texture_avif": "its textures are AVIF; export it again with PNG or JPEG textures",
    "EXT_mesh_gpu_instancing": "it repeats its meshes by instancing; export it again with instances made real",
}
"""Extensions whose data are not read, and what to do."""
LOOK_EXTENSIONS = "KHR_materials_"
"""Beginning of extensions that refine a look; without them the material is drawn as the core of the format says."""
COMPONENT_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
MAX_NODES = 20_000
CLAMPED, MIRRORED = 33071, 33648
"""CLAMP_TO_EDGE and MIRRORED_REPEAT."""
FADED = 0.1
"""Opacity below which blended texels are cut away."""
METAL_FROM = 0.5
"""Metalness from which a face is drawn as metal."""
ANEW = "copy the file again, or open it in Blender and export it from there as binary glTF 2.0"
"""The remedy for a damaged file: whoever exports it again as before gets the same."""


class RefusedError(ValueError):
    """A file is not read; the message has the remedy."""


def read_glb(path: Path, tell: Tell) -> tuple[RawPart, ...]:
    """The parts of a binary glTF file, y up: one for each of its materials, or of its meshes without one.

    Args:
      tell: is told what the file asks for and does not get.

    Raises:
      MeshError: not a .glb file, empty, too large, damaged, not finite, or in need of an extension that is not read.
    """
    if path.stat().st_size > MAX_ENTRY:
        raise MeshError(f"{path} is larger than {MAX_ENTRY} bytes; give it fewer triangles or smaller textures")
    try:
        reader = _Reader(*_chunks(path.read_bytes()), tell)
        parts = reader.parts()
    except RefusedError as e:
        raise MeshError(f"{path} cannot be read: {e}") from e
    except Exception as e:
        why = f"{e}" or type(e).__name__
        raise MeshError(f"{path} cannot be read as .glb ({why[:200]}); {ANEW}") from e
    if not parts:
        why = "; ".join(reader.left_out[:3]) or "its scene shows no mesh"
        raise MeshError(f"{path} has nothing to draw: {why}; export the model with faces that can be seen")
    return parts


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    """The JSON of a file, as leniently as viewers read it, and its binary chunk."""
    if data[:4] != b"glTF" or data[4:8] != struct.pack("<I", 2):
        raise RefusedError(f"it begins with {data[:8]!r}, a .glb with b'glTF' and a 2; export it as binary glTF 2.0")
    length, kind = struct.unpack_from("<II", data, 12)
    if kind != JSON_CHUNK or 20 + length > len(data):
        raise ValueError("its header is cut off, or no JSON")
    header = json.loads(data[20 : 20 + length].rstrip(b"\0"))  # gltf-rs before 0.11.3 padded it with zeros
    if not isinstance(header, dict):
        raise ValueError(f"its header should be an object, got {shown(header)}")
    start = 20 + length + (-length) % 4
    if start + 8 > len(data):
        return header, b""
    size, kind = struct.unpack_from("<II", data, start)
    return header, data[start + 8 : start + 8 + size] if kind == BINARY_CHUNK else b""


@dataclass(frozen=True)
class _Texture:
    picture: Image.Image
    coordinates: int
    """Which TEXCOORD_n."""
    turn: np.ndarray
    """(2, 2), and..."""
    shift: np.ndarray
    """(2,): what becomes of those, v down."""
    clamped: tuple[bool, bool]


@dataclass(frozen=True)
class _Surface:
    """The material of a primitive."""

    name: str | None
    factor: np.ndarray
    """(4,) linear rgb and opacity."""
    picture: _Texture | None
    roughness: float
    metallic: float
    both: _Texture | None
    """Roughness in green, metalness in blue; multiplied by the two numbers."""
    two_sided: bool
    least: float | None
    """Opacity below which a texel is cut away; None for all of them being there."""
    blended: bool


class _Reader:
    """One file while it is read: what it holds by number."""

    def __init__(self, header: dict[str, Any], body: bytes, tell: Tell) -> None:
        self.header, self.body, self.tell = header, body, tell
        self.left_out: list[str] = []
        """Parts of the scene that are not drawn, in words."""
        self._check_extensions()
        self._pictures: dict[int, Image.Image] = {}
        self._surfaces: dict[int, _Surface] = {}

    def _leave_out(self, words: str) -> None:
        self.left_out.append(words)
        self.tell(words)

    def _check_extensions(self) -> None:
        """Refuse what the file cannot be read without; tell what it can do without."""
        required = self.header.get("extensionsRequired", [])
        for name in required:
            if name in REFUSED:
                raise RefusedError(f"{REFUSED[name]} ({name})")
            if name not in HONOURED and not name.startswith(LOOK_EXTENSIONS):
                raise RefusedError(f"it requires the extension {name}, which is not read; export it again without it")
        for name in self.header.get("extensionsUsed", []):
            if name not in HONOURED and name not in required:
                self.tell(f"its extension {name} is not drawn")
        if self.header.get("animations"):
            self.tell("its animations are not played: it stands as it is saved")

    def _picture(self, number: int) -> Image.Image:
        """A picture of the file, opened when a surface that is drawn asks for it."""
        if number not in self._pictures:
            self._pictures[number] = self._opened(self.header["images"][number])
        return self._pictures[number]

    def _opened(self, image: dict[str, Any]) -> Image.Image:
        try:
            data = self._view(image["bufferView"]).tobytes() if "bufferView" in image else _inline(image.get("uri", ""))
            with Image.open(io.BytesIO(data), formats=PICTURES) as opened:
                if opened.width * opened.height > MAX_PIXELS:
                    size = f"{opened.width} x {opened.height}"
                    raise RefusedError(f"a picture has {size} pixels, at most {MAX_PIXELS} are read; make it smaller")
                return shrunk(opened, MAX_TEXTURE)
        except (OSError, SyntaxError) as e:
            name = shown(image.get("name") or image.get("mimeType") or "without a name")
            raise RefusedError(
                f"its pictures should be whole {' or '.join(PICTURES)} files stored in it, picture {name} is none; "
                "save that texture again as PNG and export the model with it"
            ) from e

    def _view(self, number: int) -> memoryview:
        """The bytes of a buffer view."""
        view = self.header["bufferViews"][number]
        if "EXT_meshopt_compression" in view.get("extensions", {}):
            raise RefusedError(f"{REFUSED['EXT_meshopt_compression']} (EXT_meshopt_compression)")
        buffer = self.header["buffers"][view["buffer"]]
        data = _inline(buffer["uri"]) if "uri" in buffer else self.body
        first, size = view.get("byteOffset", 0), view["byteLength"]
        if number < 0 or first < 0 or first + size > len(data):
            raise ValueError(f"buffer view {number} lies outside the file, of which an end is missing")
        return memoryview(data)[first : first + size]

    def _accessor(self, number: int, width: int) -> np.ndarray:
        """(n, width) float64, normalised where it says so."""
        accessor = self.header["accessors"][number]
        kind, held = np.dtype(COMPONENT_TYPES[accessor["componentType"]]), WIDTHS[accessor["type"]]
        if number < 0 or held != width:
            raise ValueError(f"accessor {number} should hold {width} numbers each")
        if "sparse" in accessor:
            raise RefusedError("its numbers are sparse accessors; open it in Blender and export it again")
        count = self._count(accessor)
        if "bufferView" in accessor:
            view = self.header["bufferViews"][accessor["bufferView"]]
            steps = view.get("byteStride") or kind.itemsize * width, kind.itemsize
            data, first = self._view(accessor["bufferView"]), accessor.get("byteOffset", 0)
            out = np.ndarray((count, width), kind, data, first, steps).astype(np.float64)
        else:
            out = np.zeros((count, width))  # as section 3.6.2.3 asks
        return np.maximum(out / np.iinfo(kind).max, -1.0) if accessor.get("normalized") and kind.kind in "iu" else out

    def _count(self, accessor: dict[str, Any]) -> int:
        count = accessor["count"]
        if not isinstance(count, int) or not 0 <= count <= 3 * MAX_FACES:
            raise ValueError(f"an accessor should count 0 to {3 * MAX_FACES} elements, got {shown(count)}")
        return count

    def parts(self) -> tuple[RawPart, ...]:
        """All triangles of the scene, gathered by what they look like."""
        gathered: dict[object, list[RawPart]] = {}
        faces = 0
        for number, (node, matrix) in enumerate(self._nodes()):
            for primitive in self.header["meshes"][node["mesh"]].get("primitives") or [{"attributes": {}}]:
                for part in self._primitive(node, primitive, matrix, number):
                    faces += len(part.faces)
                    if faces > MAX_FACES:
                        raise RefusedError(f"it has more than {MAX_FACES} triangles; simplify the model")
                    key = (part.name, part.finish, id(part.image), part.two_sided, part.least, part.uv is None)
                    gathered.setdefault(key, []).append(part)
        if unused := sorted(set(range(len(self.header.get("images", [])))) - self._pictures.keys()):
            self.tell(f"its pictures {unused} are not drawn: no surface shows them")
        return tuple(_joined(parts) for parts in gathered.values())

    def _nodes(self) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
        """The nodes of the scene that have a mesh, with their (4, 4) matrices."""
        nodes = self.header.get("nodes", [])
        children = {c for n in nodes for c in n.get("children", ())}
        roots, scenes = sorted({*range(len(nodes))} - children), self.header.get("scenes")
        if scenes:
            roots = scenes[self.header.get("scene", 0)].get("nodes", [])
        if scenes and len(scenes) > 1:
            self.tell(f"it has {len(scenes)} scenes, of which one is read")
        ways = [(root, np.eye(4)) for root in reversed(roots)]
        meshes, seen = [], 0
        while ways:
            number, above = ways.pop()
            seen += 1
            if seen > MAX_NODES:
                raise ValueError(f"it has more than {MAX_NODES} nodes, or one below itself")
            node = nodes[number]
            matrix = above @ _matrix(node)
            if "mesh" in node:
                meshes.append((node, matrix))
            ways += [(child, matrix) for child in reversed(node.get("children", ()))]
        yield from meshes

    def _primitive(
        self, node: dict[str, Any], primitive: dict[str, Any], matrix: np.ndarray, number: int
    ) -> Iterator[RawPart]:
        attributes = primitive["attributes"]
        name = f"a part of {shown(node['name'])}" if "name" in node else f"a part of mesh {node['mesh']}"
        faces = self._faces(primitive) if "POSITION" in attributes else np.empty((0, 3), np.int64)
        if not len(faces):
            self._leave_out(f"{name} is left out: it has no triangles")
            return
        vertices = self._accessor(attributes["POSITION"], 3)
        weights = node.get("weights") or self.header["meshes"][node["mesh"]].get("weights") or ()
        if "skin" in node or (any(weights) and "targets" in primitive):
            raise RefusedError(f"{name} is posed by a skeleton or shape keys; apply them and export the model again")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError(f"a face of node {number} names a vertex that is not there")
        with np.errstate(over="ignore", invalid="ignore"):
            vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
            if np.linalg.det(matrix[:3, :3]) < 0:
                faces = faces[:, ::-1]
        there = (np.abs(vertices) <= FARTHEST_VERTEX).all(axis=1)
        if not there.all():
            faces, whole = faces[there[faces].all(axis=1)], len(faces)
            vertices = np.where(there[:, None], vertices, 0.0)
            if len(faces) < whole:
                lost = f"{whole - len(faces)} of {whole} triangles"
                self._leave_out(f"{lost} of {name} are left out: their vertices are not finite")
        if not face_normals(vertices, faces).any():
            if len(faces):
                self._leave_out(f"{name} is left out: it has no area")
            return
        surface = self._surface(primitive.get("material"), "COLOR_0" in attributes)
        colours = np.ones((len(vertices), 4))
        if "COLOR_0" in attributes:
            given = self.header["accessors"][attributes["COLOR_0"]]
            read = self._accessor(attributes["COLOR_0"], WIDTHS[given["type"]])
            colours[:, : read.shape[1]] = np.nan_to_num(read, nan=1.0)
        yield from self._dressed(surface, f"mesh_{number}", vertices, faces, attributes, colours)

    def _faces(self, primitive: dict[str, Any]) -> np.ndarray:
        """(m, 3) int64; none for points and lines, which are told."""
        mode, positions = primitive.get("mode", 4), self.header["accessors"][primitive["attributes"]["POSITION"]]
        if "bufferView" not in positions and DRACO in primitive.get("extensions", {}):
            raise RefusedError(f"{REFUSED[DRACO]} ({DRACO})")
        corners = np.arange(self._count(positions))
        if "indices" in primitive:
            corners = self._accessor(primitive["indices"], 1)[:, 0].astype(np.int64)
        if mode in (5, 6):
            raise RefusedError("its triangles are strips or fans; open it in Blender and export it again")
        if mode != 4:
            self._leave_out("its points and lines are left out: they have no surface")
            corners = corners[:0]
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)

    def _surface(self, number: int | None, coloured: bool) -> _Surface:
        if number is None:  # nobody said what it is: neither the format's bare metal, nor brighter than paper
            grey = np.array([1.0, 1, 1, 1]) if coloured else np.array([*[0.6038] * 3, 1.0])
            return _Surface(None, grey, None, 0.7, 0.0, None, False, None, False)
        if number not in self._surfaces:
            self._surfaces[number] = self._read_surface(self.header["materials"][number])
        return self._surfaces[number]

    def _read_surface(self, material: dict[str, Any]) -> _Surface:
        core, more = material.get("pbrMetallicRoughness", {}), material.get("extensions", {})
        factor, picture = core.get("baseColorFactor", [1, 1, 1, 1]), core.get("baseColorTexture")
        roughness, metallic = self._share(core, "roughnessFactor", 1.0), self._share(core, "metallicFactor", 1.0)
        both = core.get("metallicRoughnessTexture")
        name = str(material["name"]) if material.get("name") else None
        if older := more.get("KHR_materials_pbrSpecularGlossiness"):
            factor, picture = older.get("diffuseFactor", [1, 1, 1, 1]), older.get("diffuseTexture")
            roughness, metallic, both = 1 - self._share(older, "glossinessFactor", 1.0), 0.0, None
        called = f"material {name!r}"
        if metallic == 1.0 and both is None and "metallicFactor" not in core:
            self.tell(f"{called} says nothing of metal, which makes it metal in glTF; give it a metallicFactor")
        for field in ("normalTexture", "emissiveTexture"):
            if field in material:
                self.tell(f"the {field} of {called} is not drawn")
        if any(material.get("emissiveFactor", ())):
            self.tell(f"{called} does not glow by its emissiveFactor; name it in 'glow', and its light in 'emits'")
        factor = np.array([float(x) for x in factor])
        if factor.shape != (4,) or not (np.abs(factor) <= 1e6).all():
            raise ValueError(f"{called} should have a colour of four numbers")
        mode = material.get("alphaMode", "OPAQUE")
        if clear := self._share(more.get("KHR_materials_transmission", {}), "transmissionFactor", 0.0):
            factor[3] = min(factor[3] if mode == "BLEND" else 1.0, 1 - 0.9 * clear)
            mode = "BLEND"
        least = {"MASK": self._share(material, "alphaCutoff", 0.5), "BLEND": FADED}.get(mode)
        return _Surface(
            name,
            factor,
            self._texture(picture, called),
            roughness,
            metallic,
            self._texture(both, called),
            bool(material.get("doubleSided", False)),
            least,
            mode == "BLEND",
        )

    def _share(self, fields: dict[str, Any], name: str, usual: float) -> float:
        """A number from 0 to 1; `usual`, and told, where it is none."""
        value = float(fields.get(name, usual))
        if not np.isfinite(value):
            self.tell(f"a {name} is not finite; {usual} is taken instead")
            value = usual
        return min(1.0, max(0.0, value))

    def _texture(self, info: dict[str, Any] | None, called: str) -> _Texture | None:
        if info is None:
            return None
        texture = self.header["textures"][info["index"]]
        if "source" not in texture:
            known = (f"{REFUSED[n]} ({n})" for n in sorted(texture.get("extensions", ())) if n in REFUSED)
            raise RefusedError(next(known, f"a texture of {called} has no picture; give it one, or none at all"))
        sampler = self.header["samplers"][texture["sampler"]] if "sampler" in texture else {}
        wraps = sampler.get("wrapS"), sampler.get("wrapT")
        if self.header["images"][texture["source"]].get("mimeType") in FOREIGN:
            raise RefusedError(f"a texture of {called} is neither PNG nor JPEG; export it again with such textures")
        picture = self._picture(texture["source"])
        mirror = wraps[0] == MIRRORED, wraps[1] == MIRRORED
        change = info.get("extensions", {}).get("KHR_texture_transform", {})
        c, s = np.cos(float(change.get("rotation", 0.0))), np.sin(float(change.get("rotation", 0.0)))
        turn = np.array([[c, s], [-s, c]]) * np.array(change.get("scale", [1.0, 1.0]), float)
        return _Texture(
            mirrored(picture, *mirror) if any(mirror) else picture,
            int(change.get("texCoord", info.get("texCoord", 0))),
            turn / (1.0 + np.array(mirror))[:, None],
            np.array(change.get("offset", [0.0, 0.0]), float) / (1.0 + np.array(mirror)),
            (wraps[0] == CLAMPED, wraps[1] == CLAMPED),
        )

    def _coordinates(self, texture: _Texture, attributes: dict[str, int], faces: np.ndarray) -> np.ndarray | None:
        """(m, 3, 2) uv of the corners, v up; None, and told, where the mesh has none."""
        name = f"TEXCOORD_{texture.coordinates}"
        if name not in attributes:
            self.tell(f"a mesh has a texture and no {name}; it is drawn in the texture's mean colour")
            return None
        uv = self._accessor(attributes[name], 2) @ texture.turn.T + texture.shift
        lost = ~(np.abs(uv) <= FARTHEST_VERTEX).all(axis=1)
        if lost[faces].any():
            self.tell(f"some values of {name} are not finite; those corners show the texture's beginning")
        uv[lost] = 0.0
        half = 0.5 / np.array(texture.picture.size)
        uv = np.where(texture.clamped, np.clip(uv, half, 1 - half), uv)
        return (uv * [1, -1] + [0, 1])[faces]

    def _dressed(
        self,
        surface: _Surface,
        mesh: str,
        vertices: np.ndarray,
        faces: np.ndarray,
        attributes: dict[str, int],
        colours: np.ndarray,
    ) -> Iterator[RawPart]:
        """The faces with their colours; metal ones apart from others, where a texture says which are."""
        image = uv = None
        tint = colours[faces].mean(axis=1) * surface.factor  # (m, 4) linear
        if surface.picture is not None:
            uv = self._coordinates(surface.picture, attributes, faces)
            image = surface.picture.picture
            if uv is None:
                mean = np.asarray(image.convert("RGB"), float).reshape(-1, 3).mean(0) / 255
                tint[:, :3] *= to_linear(mean)
                image = None
        opacity = float(np.clip(tint[:, 3].mean(), 0, 1)) if surface.blended else 1.0
        least = surface.least
        if image is not None:
            even = tint[:, :3].mean(0)
            if np.ptp(tint[:, :3], axis=0).max() > 0.02:
                self.tell(f"the colours of the vertices of {mesh} are averaged over its texture")
            image = self._tinted(image, even)
            if least is not None and image.mode == "RGBA":
                least = min(1.0, least / max(float(tint[:, 3].mean()), 1e-6)) if not surface.blended else least
            elif image.mode == "RGBA":
                image = self._tinted(image.convert("RGB"), np.ones(3))
        elif surface.least is not None and not surface.blended and tint[:, 3].mean() < surface.least:
            self._leave_out(f"{mesh} is left out: its opacity is below its alphaCutoff")
            return
        if surface.blended and not tint[:, 3].max() > 0:
            self._leave_out(f"{mesh} is left out: its opacity is 0")
            return
        shades = to_srgb(tint[:, :3])
        flat = shades.mean(0)
        if image is None and np.ptp(shades, axis=0).max() > 1 / 255:
            image, uv = palette(shades)
        red, green, blue = (round(float(c), 4) for c in flat)
        rough, metal = np.full(len(faces), surface.roughness), np.full(len(faces), surface.metallic)
        if surface.both is not None and (at := self._coordinates(surface.both, attributes, faces)) is not None:
            values = sampled(surface.both.picture.convert("RGB"), at.mean(axis=1))
            rough, metal = rough * values[:, 1], metal * values[:, 2]
        area = np.linalg.norm(face_normals(vertices, faces), axis=1) + 1e-30
        for chosen in (metal >= METAL_FROM, metal < METAL_FROM):
            if chosen.any():
                finish = Finish(
                    (red, green, blue, round(opacity, 4)),
                    roughness=round(float(np.average(rough[chosen], weights=area[chosen])), 3),
                    metallic=round(float(np.average(metal[chosen], weights=area[chosen])), 3),
                )
                yield RawPart(
                    surface.name or mesh,
                    vertices,
                    faces[chosen],
                    None if uv is None else uv[chosen],
                    finish,
                    image,
                    two_sided=surface.two_sided,
                    least=least if image is not None and image.mode == "RGBA" else None,
                )

    def _tinted(self, image: Image.Image, factor: np.ndarray) -> Image.Image:
        """The picture times a colour, each made once, so that parts that share it are told to look alike."""
        key = (id(image), tuple(np.round(factor, 4)), image.mode)
        held = self.__dict__.setdefault("_made", {})
        if key not in held:
            held[key] = (tinted(image, factor, linear=True), image)
        return held[key][0]


def _inline(uri: str) -> bytes:
    """The bytes that a data: URI spells out in base64.

    Raises:
      RefusedError: it is none: nothing beside the file itself is opened.
    """
    _, comma, text = str(uri).partition("base64,")
    if not (comma and str(uri).startswith("data:")):
        raise RefusedError(f"it names the file {shown(uri)}; export it as one .glb that holds its buffers and pictures")
    return base64.b64decode(text, validate=True)


def _matrix(node: dict[str, Any]) -> np.ndarray:
    """(4, 4) of a node relative to its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    out = np.eye(4)
    turn = Rotation.from_quat(node.get("rotation", [0, 0, 0, 1])).as_matrix()
    out[:3, :3] = turn * np.array(node.get("scale", [1, 1, 1]), float)
    out[:3, 3] = node.get("translation", [0, 0, 0])
    return out


def _joined(parts: list[RawPart]) -> RawPart:
    """Parts that look alike as one."""
    first = np.cumsum([0, *(len(p.vertices) for p in parts)])
    return replace(
        parts[0],
        vertices=np.concatenate([p.vertices for p in parts]),
        faces=np.concatenate([p.faces + k for p, k in zip(parts, first)]),
        uv=None if parts[0].uv is None else np.concatenate([p.uv for p in parts if p.uv is not None]),
    )
