"""A lit house as USDZ: its baked pages as what each surface gives off, with names, classes and rooms.

Needs OpenUSD (`pip install embodied-houses[usd]`). There is no maintained converter from glTF to USD for Python, so
the stage is written by OpenUSD's own library. z is up and the unit the metre, as USD allows; custom data of each mesh
says what it is, as the extras of the glTF do (embodied.scene.glb).
"""

from __future__ import annotations

import functools
import importlib.util
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image

from embodied.assets.cache import atomic_path
from embodied.errors import UnableError
from embodied.house.house import House
from embodied.scene.glb import PAGE_QUALITY, about
from embodied.scene.lit_pages import LitMesh, LitPages


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
