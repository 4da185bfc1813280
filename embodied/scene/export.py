"""Writing a house for other programs: a self-contained MJCF folder, and GLB for Blender and the web."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import mujoco
import numpy as np
import PIL.Image
import shapely
import trimesh

from assets.cache import write_bytes
from assets.records import Finish
from embodied.house.house import House
from embodied.house.shapes import footprint
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
    scene = glb_scene(parts)
    write_bytes(Path(path), scene.export(file_type="glb"))
    return Path(path)


def glb_scene(parts: Sequence[Part]) -> trimesh.Scene:
    """The parts as a trimesh scene, y up; equal mesh keys share one geometry."""
    scene = trimesh.Scene()
    upright = trimesh.transformations.rotation_matrix(-math.pi / 2, [1, 0, 0])
    materials: dict[Finish, trimesh.visual.material.PBRMaterial] = {}
    count: dict[str, int] = {}
    for part in parts:
        if not len(part.mesh.faces):
            continue
        pose = trimesh.transformations.rotation_matrix(part.yaw, [0, 0, 1])
        pose[:3, 3] = part.position
        k = count[part.owner] = count.get(part.owner, -1) + 1
        node = part.owner if k == 0 else f"{part.owner}#{k}"
        if part.mesh_key in scene.geometry:
            scene.graph.update(frame_to=node, matrix=upright @ pose, geometry=part.mesh_key)
            continue
        finish = part.mesh.finish
        if finish not in materials:
            materials[finish] = pbr_material(finish)
        visual = trimesh.visual.TextureVisuals(uv=part.mesh.uv, material=materials[finish])
        mesh = trimesh.Trimesh(
            part.mesh.vertices, part.mesh.faces, vertex_normals=part.mesh.normals, visual=visual, process=False
        )
        scene.add_geometry(mesh, node_name=node, geom_name=part.mesh_key, transform=upright @ pose)
    return scene


def pbr_material(finish: Finish) -> trimesh.visual.material.PBRMaterial:
    """`finish` in glTF's metallic-roughness model; textures as JPEG unless they have holes."""
    image = None if finish.texture is None else _picture(finish.texture)
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in finish.color[:3]]
    has_holes = image is not None and image.mode == "RGBA"
    return trimesh.visual.material.PBRMaterial(
        baseColorTexture=image,
        baseColorFactor=[1.0, 1.0, 1.0, finish.color[3]] if image else [*linear, finish.color[3]],
        roughnessFactor=finish.roughness,
        metallicFactor=finish.metallic,
        doubleSided=True,
        alphaMode="MASK" if has_holes else "BLEND" if finish.color[3] < 1 else "OPAQUE",
        emissiveFactor=[min(1.0, e) for e in finish.emission] if finish.emission else None,
    )


def _picture(path: str) -> PIL.Image.Image:
    image = PIL.Image.fromarray(load_texture(path))
    buffer = io.BytesIO()
    if image.mode == "RGBA":
        image.save(buffer, "PNG")
    else:
        image.save(buffer, "JPEG", quality=90)
    return PIL.Image.open(buffer)
