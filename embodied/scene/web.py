"""A lit house as binary glTF that any viewer shows as it is: its baked pages, unlit, with names and classes.

What a texel says is what a pixel shows, so materials carry KHR_materials_unlit (Khronos, ratified 2018). Viewers that
do not know the extension see the page as the base colour of a rough material. Every node is named after its owner (a
placement id, or '<room>/floor' and the like) and says in its extras what it is: `class`, `kind`, `room`, `room_kind`.
"""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import PIL.Image
import trimesh

from embodied.assets.cache import write_bytes
from embodied.house.house import House
from embodied.scene.lit_pages import LitMesh, LitPages

UNLIT = "KHR_materials_unlit"
JPEG_QUALITY = 92
ROOF, SKY = "outdoor/roof", "outdoor/sky"
VERTICES, INDICES = 34962, 34963
"""What a buffer view holds, in OpenGL's numbers."""
UPRIGHT = trimesh.transformations.rotation_matrix(-math.pi / 2, [1, 0, 0])
"""z up to y up, as the format asks."""


def export_lit_glb(house: House, lit: LitPages, path: Path, *, ceilings: bool = True, sky: bool = False) -> Path:
    """Write the house with its baked light as one binary glTF file.

    Args:
      ceilings: False leaves ceilings and roof out, for a look from above.
      sky: True keeps the dome of far scenery, for a look from inside; viewers frame all there is, and it is 140 m wide.
    """
    extras: dict[str, dict[str, str]] = {}
    scene = trimesh.Scene()
    materials = {}
    for k, mesh in enumerate(lit.meshes):
        if (not ceilings and (mesh.kind == "ceiling" or mesh.owner == ROOF)) or (not sky and mesh.owner == SKY):
            continue
        key = (mesh.page, mesh.alpha)
        if key not in materials:
            materials[key] = _material(lit, *key)
        node = mesh.owner if mesh.owner not in extras else f"{mesh.owner}#{k}"
        extras[node] = about(house, mesh)
        scene.add_geometry(_geometry(mesh, materials[key]), node_name=node, geom_name=f"mesh_{k}", transform=UPRIGHT)

    def finish(tree: dict) -> None:
        for material in tree["materials"]:
            material["extensions"] = {UNLIT: {}}
        tree["extensionsUsed"] = [UNLIT]
        _say_what_buffers_hold(tree)
        tree["asset"]["extras"] = {"house": house.name, "house_digest": house.digest, "light": lit.digest}
        for node in tree["nodes"]:
            if node.get("name") in extras:
                node["extras"] = extras[node["name"]]

    data = trimesh.exchange.gltf.export_glb(scene, include_normals=False, tree_postprocessor=finish)
    write_bytes(Path(path), data)
    return Path(path)


def _say_what_buffers_hold(tree: dict) -> None:
    """Mark buffer views as vertices or indices, which the format recommends and trimesh leaves out."""
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            for accessor, target in (
                (primitive["indices"], INDICES),
                *((a, VERTICES) for a in primitive["attributes"].values()),
            ):
                tree["bufferViews"][tree["accessors"][accessor]["bufferView"]]["target"] = target


def about(house: House, mesh: LitMesh) -> dict[str, str]:
    """What a mesh is: its class (for the house itself, its kind), its kind, its room and the room's kind."""
    placed = {p.id: p.object_class for p in house.placements}
    room = house.room_by_id.get(mesh.room)
    facts = {
        "class": placed.get(mesh.owner, mesh.kind),
        "kind": mesh.kind,
        "room": mesh.room,
        "room_kind": room.kind if room else "",
    }
    return {name: value for name, value in facts.items() if value}


def _geometry(mesh: LitMesh, material: trimesh.visual.material.PBRMaterial) -> trimesh.Trimesh:
    uv = np.column_stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]])  # trimesh counts v upwards
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    return trimesh.Trimesh(mesh.vertices, mesh.faces, visual=visual, process=False)


def _material(lit: LitPages, page: int, alpha: float) -> trimesh.visual.material.PBRMaterial:
    return trimesh.visual.material.PBRMaterial(
        name=f"page_{page}" if alpha == 1 else f"page_{page}_{alpha:g}",
        baseColorTexture=_picture(lit.pages[page]),
        baseColorFactor=[1.0, 1.0, 1.0, alpha],
        metallicFactor=0.0,
        roughnessFactor=1.0,
        alphaMode="OPAQUE" if alpha == 1 else "BLEND",
    )


def _picture(page: np.ndarray) -> PIL.Image.Image:
    """The page as JPEG, which the file embeds as it is."""
    buffer = io.BytesIO()
    PIL.Image.fromarray(page).save(buffer, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    return PIL.Image.open(buffer)
