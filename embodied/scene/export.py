"""Writing a house for other programs: a self-contained MJCF folder, and GLB for Blender and the web."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import mujoco
import numpy as np
import PIL.Image
import shapely

from assets.cache import write_bytes
from assets.records import Finish
from embodied.house.house import House
from embodied.house.shapes import footprint
from embodied.scene.glb import GlbWriter, turned
from embodied.scene.house_meshes import Part, house_parts
from embodied.scene.lit_pages import LitPages
from embodied.scene.model import UNDERFOOT, build_spec, compile_spec, load_texture

if TYPE_CHECKING:
    from assets.catalogue import Catalogue

EYE = 1.5
"""Height of cameras above the floor, metres."""
MESHES, TEXTURES = "meshes", "textures"
"""Folders beside house.xml."""


def export_mjcf(
    house: House, catalogue: Catalogue, folder: Path, *, free: frozenset[str] = frozenset(), lit: LitPages | None = None
) -> Path:
    """Write `folder`/house.xml with its meshes and textures; opens in MuJoCo's own viewer and in dm_control as it is.

    Names have dots where owners have slashes, which dm_control keeps for itself. Every room has a camera of its name,
    at eye height where most floor is free.

    Args:
      free: placements that physics may move, see embodied.scene.model.loose.
      lit: write the house with its baked light instead of its materials.

    Returns:
      The path of house.xml.
    """
    folder = Path(folder)
    spec = build_spec(house, catalogue, free=free, lit=lit)
    _add_cameras(spec, house)
    for element in (*spec.geoms, *spec.bodies, *spec.joints, *spec.cameras):
        element.name = element.name.replace("/", ".")
    compile_spec(spec)
    (folder / "house.xml").unlink(missing_ok=True)  # written last: where it is, its files are whole
    for name in (MESHES, TEXTURES):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for name, data in spec.assets.items():
        (folder / MESHES / name).write_bytes(data)
    for texture in spec.textures:
        if texture.data:
            image = np.frombuffer(bytes(texture.data), np.uint8).reshape(
                texture.height, texture.width, texture.nchannel
            )
            (folder / TEXTURES / f"{texture.name}.png").write_bytes(_png(image))
            texture.data = b""
            texture.file = f"{texture.name}.png"
    spec.modelfiledir, spec.meshdir, spec.texturedir = str(folder), MESHES, TEXTURES
    # MuJoCo writes this one as a word, which dm_control takes for a number.
    xml = re.sub(r'(<headlight[^>]* active=)"(true|false)"', lambda m: f'{m[1]}"{int(m[2] == "true")}"', spec.to_xml())
    write_bytes(folder / "house.xml", xml.encode())
    return folder / "house.xml"


def _add_cameras(spec: mujoco.MjSpec, house: House) -> None:
    for room in house.rooms:
        things = [footprint(p) for p in house.placements if p.room == room.id and p.size[2] > UNDERFOOT]
        floor = shapely.Polygon(room.polygon)
        free = floor.difference(shapely.union_all(things))
        x, y = shapely.maximum_inscribed_circle(free if free.area > 0 else floor).coords[0]
        away = np.array(shapely.Polygon(room.polygon).exterior.coords) - (x, y)
        yaw = math.atan2(*away[np.argmax(np.linalg.norm(away, axis=1))][::-1])
        axes = np.array([[math.sin(yaw), 0, -math.cos(yaw)], [-math.cos(yaw), 0, -math.sin(yaw)], [0, 1, 0]])
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, axes.reshape(-1))
        spec.worldbody.add_camera(
            name=room.id, pos=[x, y, house.storey_of(room).elevation + EYE], quat=quat.tolist(), fovy=75
        )


def _png(image: np.ndarray) -> bytes:
    order = cv2.COLOR_RGBA2BGRA if image.shape[2] == 4 else cv2.COLOR_RGB2BGR
    return cv2.imencode(".png", cv2.cvtColor(image, order))[1].tobytes()


def export_glb(house: House, catalogue: Catalogue, path: Path, *, ceilings: bool = True) -> Path:
    """Write the house as one binary glTF file with its textures; y is up there, as the format asks.

    Every node is named after its owner: a placement id, or '<room>/floor' and the like.

    Args:
      ceilings: False leaves ceilings and roof out, for a look from above.
    """
    parts = house_parts(house, catalogue)
    if not ceilings:
        parts = tuple(p for p in parts if p.kind != "ceiling" and p.owner != "outdoor/roof")
    write_bytes(Path(path), glb_of(parts))
    return Path(path)


def glb_of(parts: Sequence[Part]) -> bytes:
    """The parts as binary glTF; equal mesh keys share one mesh, equal finishes one material."""
    glb = GlbWriter()
    count: dict[str, int] = {}
    for part in parts:
        if not len(part.mesh.faces):
            continue
        k = count[part.owner] = count.get(part.owner, -1) + 1
        mesh = glb.number("meshes", part.mesh_key)
        if mesh is None:
            held, uv = part.mesh, part.mesh.uv
            down = np.column_stack([uv[:, 0], 1 - uv[:, 1]])
            material = glb.number("materials", held.finish)
            if material is None:
                material = glb.add("materials", held.finish, _material(glb, held.finish))
            mesh = glb.mesh(part.mesh_key, material, held.vertices, held.faces, NORMAL=held.normals, TEXCOORD_0=down)
        glb.node(part.owner if k == 0 else f"{part.owner}#{k}", mesh, turned(part.position, part.yaw))
    return glb.data()


def _material(glb: GlbWriter, finish: Finish) -> dict[str, Any]:
    """`finish` in glTF's metallic-roughness model; textures as JPEG unless they have holes."""
    surface: dict[str, Any] = {"roughnessFactor": finish.roughness, "metallicFactor": finish.metallic}
    alpha, has_holes = finish.color[3], False
    if finish.texture is None:
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in finish.color[:3]]
        surface["baseColorFactor"] = [*linear, alpha]
    else:
        image = PIL.Image.fromarray(load_texture(finish.texture))
        has_holes = image.mode == "RGBA"
        texture = glb.number("textures", finish.texture)
        if texture is None:
            texture = glb.texture(finish.texture, _picture(image))
        surface |= {"baseColorTexture": {"index": texture}, "baseColorFactor": [1.0, 1.0, 1.0, alpha]}
    material = {
        "pbrMetallicRoughness": surface,
        "doubleSided": True,
        "alphaMode": "MASK" if has_holes else "BLEND" if alpha < 1 else "OPAQUE",
    }
    return material | ({"emissiveFactor": [min(1.0, e) for e in finish.emission]} if finish.emission else {})


def _picture(image: PIL.Image.Image) -> bytes:
    buffer = io.BytesIO()
    if image.mode == "RGBA":
        image.save(buffer, "PNG")
    else:
        image.save(buffer, "JPEG", quality=90)
    return buffer.getvalue()
