"""A house as binary glTF, for Blender and the web: its materials, or its baked light, which any viewer shows as it is;
and a lit house as USDZ.

Every node is named after its owner (a placement id, or '<room>/floor' and the like) and says in its extras what it is:
`class`, `kind`, `room`, `room_kind`. What a texel of a lit page says is what a pixel shows, so their materials carry
KHR_materials_unlit (Khronos, ratified 2018); viewers without it see the page as the base colour of a rough material.

USD needs OpenUSD (`pip install embodied-houses[usd]`). There is no maintained converter from glTF to USD for Python, so
the stage is written by OpenUSD's own library: its baked pages are what each surface gives off. z is up and the unit the
metre, as USD allows; custom data of each mesh says what it is, as the extras of the glTF do.
"""

from __future__ import annotations

import functools
import importlib.util
import io
import math
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import PIL.Image
import trimesh
from trimesh.visual.material import PBRMaterial

from embodied.assets.cache import atomic_path, write_bytes
from embodied.assets.records import Finish
from embodied.errors import UnableError
from embodied.house.house import House
from embodied.scene.house_meshes import Part, house_parts
from embodied.scene.lit_pages import LitMesh, LitPages
from embodied.scene.model import load_texture

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue

UNLIT = "KHR_materials_unlit"
PAGE_QUALITY = 92
"""JPEG quality of lit pages."""
ROOF, SKY = "outdoor/roof", "outdoor/sky"
UPRIGHT = trimesh.transformations.rotation_matrix(-math.pi / 2, [1, 0, 0])
"""z up to y up, as the format asks."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """One node of the file."""

    about: Part | LitMesh
    geometry: str
    """Pieces of equal names share their geometry."""
    pose: np.ndarray
    """(4, 4), z up."""
    mesh: Callable[[], trimesh.Trimesh]


def export_glb(
    house: House,
    catalogue: Catalogue,
    path: Path,
    *,
    lit: LitPages | None = None,
    ceilings: bool = True,
    sky: bool = False,
) -> Path:
    """Write the house as one binary glTF file with its textures.

    Args:
      lit: write the house with its baked light instead of its materials.
      ceilings: False leaves ceilings and roof out, for a look from above.
      sky: True keeps the dome of far scenery that is lit, for a look from inside; viewers frame all there is, and it is
        140 m wide.
    """
    scene, extras, count = trimesh.Scene(), {}, Counter[str]()
    for piece in _unlit_pieces(house_parts(house, catalogue)) if lit is None else _lit_pieces(lit):
        owner, kind = piece.about.owner, piece.about.kind
        if (not ceilings and (kind == "ceiling" or owner == ROOF)) or (not sky and owner == SKY):
            continue
        node = f"{owner}#{count[owner]}" if count[owner] else owner
        count[owner] += 1
        extras[node], pose = about(house, piece.about), UPRIGHT @ piece.pose
        if piece.geometry in scene.geometry:
            scene.graph.update(frame_to=node, matrix=pose, geometry=piece.geometry)
        else:
            scene.add_geometry(piece.mesh(), node_name=node, geom_name=piece.geometry, transform=pose)

    def finish(tree: dict) -> None:
        if lit is not None:
            for material in tree["materials"]:
                material["extensions"] = {UNLIT: {}}
            tree["extensionsUsed"] = [UNLIT]
        tree["asset"]["extras"] = {"house": house.name, "house_digest": house.digest}
        tree["asset"]["extras"] |= {"light": lit.digest} if lit is not None else {}
        for node in tree["nodes"]:
            if node.get("name") in extras:
                node["extras"] = extras[node["name"]]

    data = trimesh.exchange.gltf.export_glb(scene, include_normals=lit is None, tree_postprocessor=finish)
    write_bytes(Path(path), data)
    return Path(path)


def about(house: House, mesh: Part | LitMesh) -> dict[str, str]:
    """The facts about a mesh: its class (for the house itself, its kind), its kind, its room and the room's kind."""
    placed = {p.id: p.object_class for p in house.placements}
    room = house.room_by_id.get(mesh.room)
    facts = {
        "class": placed.get(mesh.owner, mesh.kind),
        "kind": mesh.kind,
        "room": mesh.room,
        "room_kind": room.kind if room else "",
    }
    return {name: value for name, value in facts.items() if value}


def _unlit_pieces(parts: tuple[Part, ...]) -> Iterator[_Piece]:
    material = functools.cache(pbr_material)

    def made(part: Part) -> trimesh.Trimesh:
        m = part.mesh
        visual = trimesh.visual.TextureVisuals(uv=m.uv, material=material(m.finish))
        return trimesh.Trimesh(m.vertices, m.faces, vertex_normals=m.normals, visual=visual, process=False)

    for part in parts:
        if len(part.mesh.faces):
            pose = trimesh.transformations.rotation_matrix(part.yaw, [0, 0, 1])
            pose[:3, 3] = part.position
            yield _Piece(part, part.mesh_key, pose, functools.partial(made, part))


def _lit_pieces(lit: LitPages) -> Iterator[_Piece]:
    material = functools.cache(functools.partial(_page_material, lit))

    def made(mesh: LitMesh) -> trimesh.Trimesh:
        uv = np.column_stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]])  # trimesh counts v upwards
        visual = trimesh.visual.TextureVisuals(uv=uv, material=material(mesh.page, mesh.alpha))
        return trimesh.Trimesh(mesh.vertices, mesh.faces, visual=visual, process=False)

    for k, mesh in enumerate(lit.meshes):
        yield _Piece(mesh, f"mesh_{k}", np.eye(4), functools.partial(made, mesh))


def pbr_material(finish: Finish) -> PBRMaterial:
    """`finish` in glTF's metallic-roughness model; textures as JPEG unless they have holes."""
    image = None if finish.texture is None else PIL.Image.fromarray(load_texture(finish.texture))
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in finish.color[:3]]
    has_holes = image is not None and image.mode == "RGBA"
    return PBRMaterial(
        baseColorTexture=image and (_encoded(image, "PNG") if has_holes else _encoded(image, "JPEG", quality=90)),
        baseColorFactor=[1.0, 1.0, 1.0, finish.color[3]] if image else [*linear, finish.color[3]],
        roughnessFactor=finish.roughness,
        metallicFactor=finish.metallic,
        doubleSided=True,
        alphaMode="MASK" if has_holes else "BLEND" if finish.color[3] < 1 else "OPAQUE",
        emissiveFactor=[min(1.0, e) for e in finish.emission] if finish.emission else None,
    )


def _page_material(lit: LitPages, page: int, alpha: float) -> PBRMaterial:
    return PBRMaterial(
        name=f"page_{page}" if alpha == 1 else f"page_{page}_{alpha:g}",
        baseColorTexture=_encoded(PIL.Image.fromarray(lit.pages[page]), "JPEG", quality=PAGE_QUALITY, subsampling=0),
        baseColorFactor=[1.0, 1.0, 1.0, alpha],
        metallicFactor=0.0,
        roughnessFactor=1.0,
        alphaMode="OPAQUE" if alpha == 1 else "BLEND",
    )


def _encoded(image: PIL.Image.Image, kind: str, **how: int) -> PIL.Image.Image:
    """The picture as PNG or JPEG, which the file embeds as it is."""
    buffer = io.BytesIO()
    image.save(buffer, kind, **how)
    return PIL.Image.open(buffer)


def check_usd(path: Path) -> None:
    """See that USD can be written to `path`, before a house is lit for it.

    Raises:
      UnableError: OpenUSD is not installed.
      ValueError: the name does not end in .usdz.
    """
    if Path(path).suffix != ".usdz":
        raise ValueError(f"{path} should end in .usdz: the house and its pages are one file")
    if importlib.util.find_spec("pxr") is None:
        raise UnableError("USD needs OpenUSD; install it with: pip install 'embodied-houses[usd]'")


def export_usd(house: House, lit: LitPages, path: Path) -> Path:
    """Write the house with its baked light as one USDZ file.

    Raises:
      UnableError, ValueError: as `check_usd`.
    """
    check_usd(path)
    from pxr import Sdf, Usd, UsdGeom, UsdUtils

    with tempfile.TemporaryDirectory() as folder:
        stage = Usd.Stage.CreateNew(str(Path(folder) / "house.usdc"))
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        root = UsdGeom.Xform.Define(stage, "/house")
        stage.SetDefaultPrim(root.GetPrim())
        root.GetPrim().SetCustomData({"house": house.name, "house_digest": house.digest, "light": lit.digest})
        for k, page in enumerate(lit.pages):
            PIL.Image.fromarray(page).save(Path(folder) / f"page_{k}.jpg", quality=PAGE_QUALITY, subsampling=0)
        material = functools.cache(functools.partial(_material, stage))
        for k, mesh in enumerate(lit.meshes):
            path_of_mesh = f"/house/{prim_name(mesh.owner)}_{k}"
            _mesh(stage, path_of_mesh, mesh, about(house, mesh), material(mesh.page, mesh.alpha))
        stage.GetRootLayer().Save()
        with atomic_path(Path(path)) as temporary:
            packed = Path(folder) / "house.usdz"
            if not UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(Path(folder) / "house.usdc")), str(packed)):
                raise UnableError("OpenUSD could not pack the house; is the temporary folder full?")
            temporary.write_bytes(packed.read_bytes())
    return Path(path)


def prim_name(owner: str) -> str:
    """An owner as USD may name it: letters, digits and underscores."""
    name = re.sub(r"\W", "_", owner, flags=re.ASCII)
    return name if name and not name[0].isdigit() else f"_{name}"


def _mesh(stage: Any, path: str, mesh: LitMesh, facts: dict[str, str], material: Any) -> None:
    from pxr import Sdf, UsdGeom, UsdShade, Vt

    prim = UsdGeom.Mesh.Define(stage, path)
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(mesh.vertices, np.float32)))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(mesh.faces.reshape(-1), np.int32)))
    prim.CreateExtentAttr(
        Vt.Vec3fArray.FromNumpy(np.stack([mesh.vertices.min(0), mesh.vertices.max(0)]).astype(np.float32))
    )
    prim.CreateSubdivisionSchemeAttr("none")
    uv = np.column_stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]]).astype(np.float32)  # v counts upwards there
    primvars = UsdGeom.PrimvarsAPI(prim)
    primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex").Set(Vt.Vec2fArray.FromNumpy(uv))
    prim.GetPrim().SetCustomData({"owner": mesh.owner, **facts})
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)


def _material(stage: Any, page: int, alpha: float) -> Any:
    """A UsdPreviewSurface that gives off its page and reflects nothing."""
    from pxr import Sdf, UsdShade

    path = f"/house/page_{page}_{round(alpha * 100)}"
    material = UsdShade.Material.Define(stage, path)
    reader = UsdShade.Shader.Define(stage, f"{path}/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    picture = UsdShade.Shader.Define(stage, f"{path}/picture")
    picture.CreateIdAttr("UsdUVTexture")
    picture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./page_{page}.jpg")
    picture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
    st = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    picture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(st)
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set((0, 0, 0))
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
    surface.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(float(alpha))
    given_off = picture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    surface.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(given_off)
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    return material
