"""Rows of the tables in assets/data and of users' catalogue.json: laid over one another, made Assets and Recipes."""

import dataclasses
from collections.abc import Collection, Mapping
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

from embodied.assets import json_file
from embodied.assets.json_file import RECORD_RULES, RecordError, from_plain, shown
from embodied.assets.records import ROOM_KINDS, SUPPORTS, Asset, ImportRecipe, SupportSurface

Row = dict[str, Any]
"""One JSON object of a table."""

DATA = Path(__file__).parent / "data"
SIZES = (0.001, 30.0)
"""Shortest and longest side of a thing, metres."""
LONGEST_TEXT = 200
CLASS_FIELDS = ("support", "rooms", "synonyms", "on", "clearance", "tags")
ASSET_FIELDS = {f.name for f in dataclasses.fields(Asset)} - {"key", "object_class", "pack"}
"""Fields of a row that are the asset's own; its 'class' is the `object_class`."""
RECIPE_FIELDS = {"yaw", "two_sided", "flipped", "glow", "dropped", "looks", "faces"}
"""Fields of a row that tell the importer."""
REMADE_FIELDS = {"build", "look"}
"""Further fields of a line of data/catalogue.json, where code builds what the pack's model is too poor for."""
REMADE_LICENCE = "Apache-2.0"
"""Of meshes that code builds."""


def read_json(path: Path) -> Row:
    """The JSON object in `path`.

    Raises:
      RecordError: missing, not readable, not JSON, or not an object.
    """
    try:
        return json_file.read_json(path)
    except OSError as e:  # a folder, no permission, a symbolic link to itself
        raise RecordError(f"{path} cannot be read ({e.strerror or e}); docs/assets.md shows what it should hold") from e


def one_of(where: str, name: str, value: object, choices: Collection[str]) -> Any:
    """`value`, if it is one of `choices`; raises RecordError with what the row at `where` should say."""
    if not isinstance(value, str) or value not in choices:
        raise RecordError(f"{where} should have a {name!r} out of {', '.join(sorted(choices))}, got {shown(value)}")
    return value


def only(where: str, row: Row, names: Collection[str]) -> Row:
    """`row`, if it has these fields and no others; raises RecordError."""
    if unknown := sorted(set(row) - set(names)):
        raise RecordError(f"{where} has the unknown fields {unknown}; it may hold {sorted(names)}")
    return row


def _wrong_asset(asset: Asset) -> str | None:
    words = (*asset.synonyms, *asset.colours, *asset.materials, *asset.on, *asset.tags, asset.creator, asset.licence)
    names = (asset.key, asset.object_class, asset.name)
    rules = {
        f"'size' should be three lengths in metres, each from {SIZES[0]:g} to {SIZES[1]:g}": all(
            SIZES[0] <= s <= SIZES[1] for s in asset.size
        ),
        f"'support' should be one of {', '.join(SUPPORTS)}": asset.support in SUPPORTS,
        f"'rooms' should be room kinds with weights from 0 up; the room kinds are {', '.join(ROOM_KINDS)}": all(
            kind in ROOM_KINDS and weight >= 0 for kind, weight in asset.rooms.items()
        ),
        "'elevation' and 'clearance' should be lengths from 0 to 30 metres": all(
            0 <= length <= 30 for length in (asset.elevation, asset.clearance)
        ),
        "'surfaces' should be lists [name, z, x0, y0, x1, y1, headroom], x0 < x1 and y0 < y1": all(
            s.x0 < s.x1 and s.y0 < s.y1 and s.headroom > 0 for s in asset.surfaces
        ),
        "'emits' should be three numbers from 0 up": min(asset.emits or (0.0,)) >= 0,
        f"words should be lines of at most {LONGEST_TEXT} characters, and names not be empty": all(
            word.isprintable() and len(word) <= LONGEST_TEXT for word in (*words, *names)
        )
        and all(name.strip() for name in names),
    }
    return next((rule for rule, holds in rules.items() if not holds), None)


RECORD_RULES[Asset] = _wrong_asset
RECORD_RULES[ImportRecipe] = lambda recipe: None if recipe.faces >= 0 else "'faces' should be a whole number from 0 up"


def check_classes(where: str, classes: Mapping[str, Row]) -> Mapping[str, Row]:
    """The shared fields of object classes, if things may have them; `where` names their file."""
    for name, row in classes.items():
        thing = f"{where}: class {name!r}"
        asset_of(thing, name, {"class": name, "size": [1, 1, 1], "support": "floor"} | only(thing, row, CLASS_FIELDS))
    return classes


def read_models(
    where: str, rows: Mapping[str, Row], classes: Mapping[str, Row], licences: Mapping[str, str]
) -> tuple[dict[str, Asset], dict[str, ImportRecipe]]:
    """The assets of catalogue rows by key over the classes they name, and how to import each that is not built.

    Args:
      licences: by pack, for models that do not state their own.
    """
    assets, recipes = {}, {}
    for key, given in rows.items():
        model = f"{where}: model {key!r}"
        row = only(model, given, {"class", "of"} | ASSET_FIELDS | RECIPE_FIELDS | REMADE_FIELDS)
        if "of" in row:
            row = variant(model, row, rows)
        shared = classes.get(str(row.get("class")))
        if shared is None:
            raise RecordError(f"{model} has the unknown class {shown(row.get('class'))}; use one of data/classes.json")
        licence = REMADE_LICENCE if "build" in row else licences.get(key.split("/")[0], "")
        asset = asset_of(model, key, {"licence": licence} | shared | row)
        tags = dict.fromkeys((*shared.get("tags", ()), *asset.tags))
        assets[key] = dataclasses.replace(asset, tags=tuple(tags))
        if "build" not in row:
            fields = {name: value for name, value in row.items() if name in RECIPE_FIELDS}
            looks = from_plain(dict[str, str], fields.pop("looks", {}), f"{model}: 'looks'")
            fields |= {"key": key, "size": list(asset.size), "model": row.get("of", "")}
            recipe = from_plain(ImportRecipe, fields, model)
            recipes[key] = dataclasses.replace(recipe, emits=asset.emits, looks=tuple(sorted(looks.items())))
    return assets, recipes


def asset_of(where: str, key: str, row: Mapping[str, Any]) -> Asset:
    """The asset that a row describes, on its own.

    Raises:
      RecordError: says which field is wrong, and what it should hold.
    """
    fields = {name: value for name, value in row.items() if name in ASSET_FIELDS}
    names = [f.name for f in dataclasses.fields(SupportSurface)]
    if isinstance(surfaces := row.get("surfaces"), list):
        fields["surfaces"] = [dict(zip(names, s)) if isinstance(s, list) else s for s in surfaces]
    usual = {"key": key, "pack": key.split("/")[0], "object_class": row["class"], "name": row["class"]}
    return from_plain(Asset, usual | fields, where)


def made_in(*modules: ModuleType) -> Mapping[str, Any]:
    """Objects of modules that rows may name, as '<module>.<name>': their public functions and classes."""
    return MappingProxyType(
        {
            f"{module.__name__.rpartition('.')[2]}.{name}": maker
            for module in modules
            for name, maker in vars(module).items()
            if callable(maker) and getattr(maker, "__module__", "") == module.__name__ and not name.startswith("_")
        }
    )


def merged(*rows: Mapping[str, Any], deep: Collection[str] = ()) -> Row:
    """Rows laid over one another, later ones on top; the objects in the fields `deep` field by field."""
    out: Row = {}
    for row in rows:
        for name, value in row.items():
            both = name in deep and isinstance(value, dict) and isinstance(out.get(name), dict)
            out[name] = merged(out[name], value, deep={*out[name], *value}) if both else value
    return out


def variant(where: str, row: Row, rows: Mapping[str, Row]) -> Row:
    """`row` filled up from the model it is a variant of; its surfaces follow its size."""
    base_row = rows.get(str(row["of"]), {"of": ""})
    if "of" in base_row:
        raise RecordError(f"{where} should be a variant `of` a model in the same file, got {shown(row['of'])}")
    base = asset_of(where, row["of"], {"class": "thing", "support": "floor"} | base_row)
    out = merged(base_row, row, deep=("look", "looks"))
    size = from_plain(tuple[float, float, float], out["size"], f"{where}: 'size'")
    x, y, z = (n / o for n, o in zip(size, base.size))
    out["surfaces"] = row.get("surfaces") or [
        [
            s.name,
            *(round(v * f, 4) for v, f in zip((s.z, s.x0, s.y0, s.x1, s.y1), (z, x, y, x, y))),
            s.headroom if s.headroom >= 9 else round(s.headroom * z, 4),
        ]
        for s in base.surfaces
    ]
    return out
