"""A user's own models: a folder of .glb, .obj or .sh3f files with a small catalogue.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from embodied.assets import rows
from embodied.assets.cache import digest
from embodied.assets.importing.glb import read_glb
from embodied.assets.importing.importer import Reader, cached, obj_files, read_if_there, read_obj
from embodied.assets.importing.mtl_finish import corrected
from embodied.assets.importing.obj import MeshError
from embodied.assets.importing.sh3f import MAX_ENTRY, open_pack
from embodied.assets.records import Asset, Finish, ImportRecipe, MeshPart
from embodied.assets.rows import CatalogueError, Field, Row

MODEL_SUFFIXES = (".glb", ".obj", ".sh3f")
OWN_FIELDS = {
    "pack": Field("a word without '/'", lambda v: rows.WORD.holds(v) and "/" not in v and "\\" not in v),
    "licence": rows.LINE_OF_TEXT,
    "creator": rows.LINE_OF_TEXT,
    "classes": Field("an object of classes", lambda v: isinstance(v, dict)),
    "models": Field("an object of models", lambda v: isinstance(v, dict)),
}
"""Fields of a user's catalogue.json."""
ROW_FIELDS = rows.FIELDS | {"file": rows.LINE_OF_TEXT, "model": rows.LINE_OF_TEXT}
"""Fields of a model in it."""


@dataclass(frozen=True)
class OwnModel:
    """The file of a user's model."""

    file: Path
    entry: str = ""
    """For a .sh3f file: the model's key in it (embodied.assets.importing.sh3f.Entry)."""


def read_own(
    folder: Path, classes: Mapping[str, Row]
) -> tuple[dict[str, Asset], dict[str, ImportRecipe], dict[str, OwnModel]]:
    """The assets of a user's folder, with their recipes and files by key; docs/assets.md has the format.

    Args:
      classes: the object classes that exist; the folder may add its own.

    Raises:
      CatalogueError: no catalogue.json, wrong fields, a file that is missing or outside the folder.
    """
    path = folder / "catalogue.json"
    body = rows.check_row(str(path), rows.read_json(path), OWN_FIELDS)
    added = rows.check_classes(str(path), body.get("classes", {}))
    models = rows.objects(str(path), "models", body.get("models", {}))
    pack = body.get("pack", folder.name)
    rows_by_key, own = {}, {}
    for name, given in models.items():
        where = f"{path}: model {name!r}"
        key, row = f"{pack}/{name}", dict(rows.check_row(where, given, ROW_FIELDS))
        if row.get("of") in models:
            base = rows.check_row(where, models[row["of"]], ROW_FIELDS)
            row = {"file": base.get("file"), "model": base.get("model", ""), **row, "of": f"{pack}/{row['of']}"}
        own[key] = _model(folder, where, row.pop("file", None), row.pop("model", ""))
        row.setdefault("creator", body.get("creator", ""))
        if own[key].entry and "size" not in row:
            row["size"] = list(open_pack(own[key].file).entries[own[key].entry].size)
        rows_by_key[key] = row
    assets, recipes = rows.read_models(str(path), rows_by_key, {**classes, **added}, {pack: body.get("licence", "")})
    for recipe in recipes.values():
        for material, words in recipe.looks:
            try:
                corrected(Finish(), words)
            except ValueError as e:
                where = f"{path}: model {recipe.key.removeprefix(f'{pack}/')!r}"
                raise CatalogueError(f"{where}: the looks of material {material!r}: {e}") from e
    return assets, recipes, own


def import_own(model: OwnModel, recipe: ImportRecipe, cache: Path) -> tuple[MeshPart, ...]:
    """The finished parts of a user's model, cached like those of a pack.

    Raises:
      MeshError: damaged, or gone since the catalogue was read.
    """
    file, remedy = model.file, "save it again as PNG, JPEG, BMP or TGA"
    if model.entry:
        pack = open_pack(file)
        entry = pack.entries[model.entry]
        recipe = replace(recipe, rotation=entry.rotation)
        read = lambda tell: read_obj(pack.read, entry.model, f"{file}: {entry.model}", remedy, tell)
    elif file.suffix.lower() == ".glb":
        read = lambda tell: read_glb(file, tell)
    else:
        read = lambda tell: read_obj(_reader(file), file.name, str(file), remedy, tell)
    return cached(recipe, source_digest(model), cache, read)


def source_digest(model: OwnModel) -> str:
    """Hex digest of all files that the model is made from: an .obj with its .mtl files and textures.

    Raises:
      MeshError: gone since the catalogue was read, or not readable.
    """
    if model.entry:
        return digest(open_pack(model.file).digest, model.entry)
    try:
        if model.file.suffix.lower() != ".obj":
            return digest(model.file)
        read = _reader(model.file)
        files = {name: read_if_there(read, name) for name in obj_files(read, model.file.name)}
        return digest(model.file, [(name, None if data is None else digest(data)) for name, data in files.items()])
    except OSError as e:
        raise MeshError(f"{model.file} cannot be read ({e.strerror or e}); put it back, or correct its rights") from e


def _reader(path: Path) -> Reader:
    """Reads files named relative to `path`, none outside its folder. A file of another folder, or of a name in other
    capitals, is looked for beside `path`: models are moved, and made where capitals do not count."""

    def read(name: str) -> bytes:
        file = _inside(path.parent, name)
        if file is None or not file.is_file():
            last = PurePosixPath(name).name.lower()
            beside = [p.name for p in sorted(path.parent.iterdir()) if p.name.lower() == last]
            file = _inside(path.parent, beside[0]) if beside else None
        if file is None or not file.is_file():
            raise FileNotFoundError(name)
        if file.stat().st_size > MAX_ENTRY:
            raise MeshError(f"{file} is larger than {MAX_ENTRY} bytes; simplify it")
        return file.read_bytes()

    return read


def _model(folder: Path, where: str, file: str | None, entry: str) -> OwnModel:
    path = _inside(folder, file) if file else None
    if path is None or path.suffix.lower() not in MODEL_SUFFIXES:
        raise CatalogueError(f"{where} should name a file {MODEL_SUFFIXES} inside {folder}, got {rows.shown(file)}")
    if not path.is_file():
        raise CatalogueError(f"{where} names {file!r}, which is not in {folder}")
    if path.suffix.lower() == ".sh3f":
        entries = open_pack(path).entries
        if entry not in entries:
            raise CatalogueError(f'{where} should have a "model" out of {sorted(entries)}, got {entry!r}')
        return OwnModel(path, entry)
    return OwnModel(path)


def _inside(folder: Path, name: str) -> Path | None:
    """`folder`/`name`, or None if that leaves the folder or is no name at all."""
    if name.startswith("/") or "\\" in name or "\0" in name or ".." in PurePosixPath(name).parts:
        return None
    path = folder / name
    try:
        return path if path.resolve().is_relative_to(folder.resolve()) else None
    except (OSError, RuntimeError):  # too long a name; a symbolic link to itself
        return None
