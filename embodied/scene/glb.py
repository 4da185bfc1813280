"""Writing a house as binary glTF, for Blender and the web."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import PIL.Image
import trimesh

from embodied.assets.cache import write_bytes
from embodied.assets.records import Finish
from embodied.house.house import House
from embodied.scene.house_meshes import Part, house_parts
from embodied.scene.model import load_texture

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue


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
        m = part.mesh
        mesh = trimesh.Trimesh(m.vertices, m.faces, vertex_normals=m.normals, visual=visual, process=False)
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
