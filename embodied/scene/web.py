"""A lit house as binary glTF that any viewer shows as it is: its baked pages, unlit, with names and classes.

What a texel says is what a pixel shows, so materials carry KHR_materials_unlit (Khronos, ratified 2018). Viewers that
do not know the extension see the page as the base colour of a rough material. Every node is named after its owner (a
placement id, or '<room>/floor' and the like) and says in its extras what it is: `class`, `kind`, `room`, `room_kind`.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image

from assets.cache import write_bytes
from embodied.house.house import House
from embodied.scene.glb import GlbWriter
from embodied.scene.lit_pages import LitMesh, LitPages

UNLIT = "KHR_materials_unlit"
JPEG_QUALITY = 92
ROOF, SKY = "outdoor/roof", "outdoor/sky"


def export_lit_glb(house: House, lit: LitPages, path: Path, *, ceilings: bool = True, sky: bool = False) -> Path:
    """Write the house with its baked light as one binary glTF file.

    Args:
      ceilings: False leaves ceilings and roof out, for a look from above.
      sky: True keeps the dome of far scenery, for a look from inside; viewers frame all there is, and it is 140 m wide.
    """
    glb = GlbWriter()
    for k, mesh in enumerate(lit.meshes):
        if (not ceilings and (mesh.kind == "ceiling" or mesh.owner == ROOF)) or (not sky and mesh.owner == SKY):
            continue
        material = glb.number("materials", (mesh.page, mesh.alpha))
        if material is None:
            material = glb.add("materials", (mesh.page, mesh.alpha), _material(glb, lit, mesh.page, mesh.alpha))
        number = glb.mesh(k, material, mesh.vertices, mesh.faces, TEXCOORD_0=mesh.uv)
        node = mesh.owner if glb.number("nodes", mesh.owner) is None else f"{mesh.owner}#{k}"
        glb.node(node, number, np.eye(4), about(house, mesh))
    glb.tree["extensionsUsed"] = [UNLIT]
    glb.tree["asset"]["extras"] = {"house": house.name, "house_digest": house.digest, "light": lit.digest}
    write_bytes(Path(path), glb.data())
    return Path(path)


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


def _material(glb: GlbWriter, lit: LitPages, page: int, alpha: float) -> dict[str, Any]:
    texture = glb.number("textures", page)
    if texture is None:
        texture = glb.texture(page, _jpeg(lit.pages[page]))
    return {
        "name": f"page_{page}" if alpha == 1 else f"page_{page}_{alpha:g}",
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": texture},
            "baseColorFactor": [1.0, 1.0, 1.0, alpha],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        },
        "alphaMode": "OPAQUE" if alpha == 1 else "BLEND",
        "extensions": {UNLIT: {}},
    }


def _jpeg(page: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    PIL.Image.fromarray(page).save(buffer, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    return buffer.getvalue()
