"""Binary glTF 2.0 files: looked through before a library parses them, then read as RawParts."""

from __future__ import annotations

import base64
import binascii
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from assets.importing.importer import MAX_PIXELS, MAX_TEXTURE, RawPart
from assets.importing.meshing import face_normals
from assets.importing.obj import FARTHEST, MAX_FACES, MeshError
from assets.importing.sh3f import MAX_ENTRY
from assets.records import Finish

JSON_CHUNK = 0x4E4F534A
PICTURES = ("PNG", "JPEG")
"""The two kinds of picture that glTF 2.0 knows (section 3.8.3)."""


def read_glb(path: Path) -> tuple[RawPart, ...]:
    """The parts of a binary glTF file, one for each of its meshes, y up.

    Raises:
      MeshError: not a .glb file, empty, too large, damaged, or not finite.
    """
    if path.stat().st_size > MAX_ENTRY:
        raise MeshError(f"{path} is larger than {MAX_ENTRY} bytes; simplify the model")
    data = path.read_bytes()
    try:
        _look_through(data)
        # From bytes, so that nothing beside the file itself can be opened.
        scene = trimesh.load_scene(io.BytesIO(data), file_type="glb")
        meshes = [m for m in scene.dump() if isinstance(m, trimesh.Trimesh) and len(m.faces)]
        parts = tuple(_part(i, m) for i, m in enumerate(meshes))
    except Exception as e:
        why = f"{e}" or type(e).__name__
        raise MeshError(f"{path} cannot be read as .glb ({why[:200]}); export it again as binary glTF 2.0") from e
    if not parts:
        raise MeshError(f"{path} has no triangles; the model is empty")
    return parts


def _look_through(data: bytes) -> None:
    """Refuse what a parser should not be given.

    Raises:
      ValueError: no JSON chunk, pictures that are not PNG or JPEG inside the file, accessors beyond any model.
    """
    magic, version, _ = struct.unpack_from("<4sII", data)
    length, kind = struct.unpack_from("<II", data, 12)
    if magic != b"glTF" or version != 2 or kind != JSON_CHUNK or 20 + length > len(data):
        raise ValueError("the file does not begin as glTF 2.0 does")
    header = json.loads(data[20 : 20 + length].decode("utf-8"))
    counts = [a["count"] for a in header.get("accessors", [])]
    if not all(isinstance(n, int) and 0 <= n <= 3 * MAX_FACES for n in counts) or sum(counts) > 20 * MAX_FACES:
        raise ValueError(f"an accessor's count is impossible, or the model has more than {MAX_FACES} triangles")
    start = 20 + length + (-length) % 4 + 8
    for image in header.get("images", []):
        try:
            with Image.open(io.BytesIO(_picture(image, header, data[start:])), formats=PICTURES) as opened:
                opened.verify()
        except (OSError, SyntaxError) as e:  # the parser would open anything, and leave out what it cannot open
            raise ValueError(f"its pictures should be whole {' or '.join(PICTURES)} files stored in it") from e


def _picture(image: dict[str, Any], header: dict[str, Any], body: bytes) -> bytes:
    """The bytes of a picture of the file, from its binary chunk `body` or written out as base64."""
    if "bufferView" not in image:
        _, comma, text = str(image.get("uri", "")).partition("base64,")
        try:
            return base64.b64decode(text, validate=True) if comma else b""
        except binascii.Error:
            return b""
    view = header["bufferViews"][image["bufferView"]]
    first = view.get("byteOffset", 0)
    return body[first : first + view["byteLength"]] if first >= 0 else b""


def _part(i: int, mesh: trimesh.Trimesh) -> RawPart:
    vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
    if not (np.abs(vertices) <= FARTHEST).all() or not np.abs(face_normals(vertices, faces)).max() > 0:
        raise ValueError(f"mesh {i} has vertices that are not finite, or no area")
    material = getattr(mesh.visual, "material", None)
    name = str(getattr(material, "name", None) or f"mesh_{i}")
    factor = getattr(material, "baseColorFactor", None)
    color = np.array([204, 204, 204, 255] if factor is None else factor, dtype=float) / 255.0
    red, green, blue, alpha = (round(float(c), 4) for c in color)
    rough, metal = (getattr(material, f, None) for f in ("roughnessFactor", "metallicFactor"))
    finish = Finish(
        (red, green, blue, alpha),
        roughness=0.7 if rough is None else float(rough),
        metallic=0.0 if metal is None else float(metal),
    )
    picture, uv = getattr(material, "baseColorTexture", None), getattr(mesh.visual, "uv", None)
    if picture is None or uv is None or len(uv) != len(vertices):
        return RawPart(name, vertices, faces, None, finish)
    coords = np.asarray(uv, dtype=np.float64)
    if not (np.abs(coords) <= FARTHEST).all():
        raise ValueError(f"mesh {i} has texture coordinates that are not finite")
    return RawPart(name, vertices, faces, coords[faces], finish, _shrunk(picture))


def _shrunk(picture: Image.Image) -> Image.Image:
    if picture.width * picture.height > MAX_PIXELS:
        raise ValueError(f"a picture has {picture.width} x {picture.height} pixels, at most {MAX_PIXELS} are read")
    picture = picture.convert("RGBA" if "A" in picture.getbands() else "RGB")
    picture.thumbnail((MAX_TEXTURE, MAX_TEXTURE))
    return picture
