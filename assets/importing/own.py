"""A user's own models: a folder of .glb, .obj or .sh3f files with a small catalogue.json."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any

from embodied.assets import rows
from embodied.assets.cache import digest
from embodied.assets.importing.glb import read_glb
from embodied.assets.importing.importer import Reader, cached, obj_files, read_if_there, read_obj
from embodied.assets.importing.looks import corrected
from embodied.assets.importing.obj import MeshError
from embodied.assets.importing.sh3f import MAX_ENTRY, open_pack
from embodied.assets.json_file import RecordError, from_plain, shown
from embodied.assets.records import Asset, Finish, ImportRecipe, MeshPart
from embodied.assets.rows import Row

MODEL_SUFFIXES = (".glb", ".obj", ".sh3f")
OWN_FIELDS = {"class", "of", "file", "model"} | rows.ASSET_FIELDS | rows.RECIPE_FIELDS
"""Fields of a model in a user's catalogue.json."""


@dataclass(frozen=True)
class _OwnCatalogue:
    """The content of a user's catalogue.json."""

    pack: str = ""
    licence: str = ""
    creator: str = ""
    classes: dict[str, dict[str, Any]] = field(default_factory=dict)
    models: dict[str, dict[str, Any]] = field(default_factory=dict)


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
      RecordError: no catalogue.json, wrong fields, a file that is missing or outside the folder.
    """
    path = folder / "catalogue.json"
    body = from_plain(_OwnCatalogue, rows.read_json(path), str(path))
    added = rows.check_classes(str(path), body.classes)
    pack = body.pack or folder.name
    if "/" in pack or "\\" in pack:
        raise RecordError(f"{path}: 'pack' should be a word without '/', got {shown(pack)}")
    rows_by_key, own = {}, {}
    for name, given in body.models.items():
        where = f"{path}: model {name!r}"
        key, row = f"{pack}/{name}", rows.only(where, dict(given), OWN_FIELDS)
        if base := body.models.get(str(row.get("of"))):
            row = {"file": base.get("file"), "model": base.get("model", ""), **row, "of": f"{pack}/{row['of']}"}
        own[key] = _model(folder, where, row.pop("file", None), str(row.pop("model", "")))
        row.setdefault("creator", body.creator)
        if own[key].entry and "size" not in row:
            row["size"] = list(open_pack(own[key].file).entries[own[key].entry].size)
        rows_by_key[key] = row
    assets, recipes = rows.read_models(str(path), rows_by_key, {**classes, **added}, {pack: body.licence})
    for recipe in recipes.values():
        for material, words in recipe.looks:
            try:
                corrected(Finish(), words)
            except ValueError as e:
                where = f"{path}: model {recipe.key.removeprefix(f'{pack}/')!r}"
                raise RecordError(f"{where}: the looks of material {material!r}: {e}") from e
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


def _model(folder: Path, where: str, file: object, entry: str) -> OwnModel:
    path = _inside(folder, file) if isinstance(file, str) and file else None
    if path is None or path.suffix.lower() not in MODEL_SUFFIXES:
        raise RecordError(f"{where} should name a file {MODEL_SUFFIXES} inside {folder}, got {shown(file)}")
    if not path.is_file():
        raise RecordError(f"{where} names {file!r}, which is not in {folder}")
    if path.suffix.lower() == ".sh3f":
        return OwnModel(path, rows.one_of(where, "model", entry, open_pack(path).entries))
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
