"""A user's own models: a folder of .glb, .obj or .sh3f files with a small catalogue.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

import numpy as np
import trimesh

from assets.cache import digest
from assets.importing.importer import RawPart, Recipe, cached, import_model, read_obj
from assets.importing.meshing import face_normals
from assets.importing.obj import MeshError
from assets.importing.sh3f import MAX_ENTRY, PackError, open_pack
from assets.records import Asset, Finish
from assets.rows import CatalogueError, check_classes, read_json, read_models

KINDS = (".glb", ".obj", ".sh3f")


@dataclass(frozen=True)
class OwnModel:
    """Where a user's model lies."""

    file: Path
    entry: str = ""
    """For a .sh3f file: the model's key in it, '<folder>/<model>'."""


def read_own(
    folder: Path, classes: Mapping[str, dict]
) -> tuple[dict[str, Asset], dict[str, Recipe], dict[str, OwnModel]]:
    """The assets of a user's folder, with their recipes and files by key; docs/assets.md has the format.

    Args:
      classes: the object classes that exist; the folder may add its own.

    Raises:
      CatalogueError: no catalogue.json, wrong fields, a file that is missing or outside the folder.
    """
    path = folder / "catalogue.json"
    body = read_json(path)
    if unknown := sorted(set(body) - {"pack", "licence", "creator", "classes", "models"}):
        raise CatalogueError(f"{path} has the unknown fields {unknown}; docs/assets.md lists what it may hold")
    added, models = body.get("classes", {}), body.get("models", {})
    check_classes(str(path), added)
    pack = str(body.get("pack", folder.name))
    rows, own = {}, {}
    for name, row in models.items():
        key, row = f"{pack}/{name}", dict(row)
        if row.get("of") in models:
            base = models[row["of"]]
            row = {"file": base.get("file"), "model": base.get("model", ""), **row, "of": f"{pack}/{row['of']}"}
        own[key] = _model(folder, str(path), name, row.pop("file", None), row.pop("model", ""))
        row.setdefault("creator", body.get("creator", ""))
        if own[key].entry and "size" not in row:
            row["size"] = list(open_pack(own[key].file).entries[own[key].entry].size)
        rows[key] = row
    assets, recipes = read_models(str(path), rows, {**classes, **added}, {pack: {"licence": body.get("licence", "")}})
    return assets, recipes, own


def import_own(model: OwnModel, recipe: Recipe, cache: Path):
    """The finished parts of a user's model, cached like those of a pack."""
    if model.entry:
        pack = open_pack(model.file)
        entry = pack.entries[model.entry]
        return import_model(pack, replace(recipe, rotation=entry.rotation), cache, entry.model)
    read = read_glb if model.file.suffix == ".glb" else _read_obj_file
    return cached(recipe, digest(model.file), cache, lambda: read(model.file))


def read_glb(path: Path) -> tuple[RawPart, ...]:
    """The parts of a binary glTF file, one for each of its meshes, y up.

    Raises:
      MeshError: not a .glb file, empty, too large, or not finite.
    """
    if path.stat().st_size > MAX_ENTRY:
        raise MeshError(f"{path} is larger than {MAX_ENTRY} bytes; simplify the model")
    try:
        scene = trimesh.load_scene(path, file_type="glb")
        meshes = [m for m in scene.dump() if isinstance(m, trimesh.Trimesh) and len(m.faces)]
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, NotImplementedError, OSError) as e:
        raise MeshError(f"{path} cannot be read as .glb ({e}); export it again as binary glTF 2.0") from e
    if not meshes:
        raise MeshError(f"{path} has no triangles; the model is empty")
    return tuple(_glb_part(path, i, m) for i, m in enumerate(meshes))


def _glb_part(path: Path, i: int, mesh: trimesh.Trimesh) -> RawPart:
    vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
    if not np.isfinite(vertices).all() or not np.abs(face_normals(vertices, faces)).max() > 0:
        raise MeshError(f"{path}: mesh {i} has vertices that are not finite, or no area; the model is damaged")
    material = getattr(mesh.visual, "material", None)
    name = str(getattr(material, "name", None) or f"mesh_{i}")
    factor = getattr(material, "baseColorFactor", None)
    color = np.array([204, 204, 204, 255] if factor is None else factor, dtype=float) / 255.0
    image = getattr(material, "baseColorTexture", None)
    uv = getattr(mesh.visual, "uv", None)
    if image is not None and uv is not None and len(uv) == len(vertices):
        image = image.convert("RGBA" if "A" in image.getbands() else "RGB")
        image.thumbnail((512, 512))
        corner_uv = np.asarray(uv, dtype=np.float64)[faces]
    else:
        image, corner_uv = None, None
    rough, metal = (getattr(material, f, None) for f in ("roughnessFactor", "metallicFactor"))
    finish = Finish(
        tuple(round(float(c), 4) for c in color),
        roughness=0.7 if rough is None else float(rough),
        metallic=0.0 if metal is None else float(metal),
    )
    return RawPart(name, vertices, faces, corner_uv, finish, image)


def _read_obj_file(path: Path) -> tuple[RawPart, ...]:
    def read(name: str) -> bytes:
        file = _inside(path.parent, name)
        if file is None or not file.is_file():
            raise FileNotFoundError(name)
        if file.stat().st_size > MAX_ENTRY:
            raise PackError(f"{file} is larger than {MAX_ENTRY} bytes; simplify it")
        return file.read_bytes()

    return read_obj(read, path.name, str(path))


def _model(folder: Path, where: str, name: str, file: object, entry: str) -> OwnModel:
    path = _inside(folder, str(file)) if file else None
    if path is None or path.suffix.lower() not in KINDS:
        raise CatalogueError(f"{where}: model {name!r} should name a file {KINDS} inside {folder}, got {file!r}")
    if not path.is_file():
        raise CatalogueError(f"{where}: model {name!r} names {file!r}, which is not in {folder}")
    if path.suffix.lower() == ".sh3f":
        entries = open_pack(path).entries
        if entry not in entries:
            raise CatalogueError(
                f'{where}: model {name!r} should have a "model" out of {sorted(entries)}, got {entry!r}'
            )
        return OwnModel(path, entry)
    return OwnModel(path)


def _inside(folder: Path, name: str) -> Path | None:
    """`folder`/`name`, or None if that leaves the folder."""
    if name.startswith("/") or "\\" in name or ".." in PurePosixPath(name).parts:
        return None
    path = folder / name
    return path if path.resolve().is_relative_to(folder.resolve()) else None
