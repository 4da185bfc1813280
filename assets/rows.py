"""Catalogue files: reviewed JSON rows to Assets and import Recipes, with clear errors."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from assets.importing.importer import Recipe
from assets.records import ROOM_KINDS, SUPPORTS, Asset, SupportSurface

CLASS_FIELDS = ("support", "rooms", "synonyms", "on", "clearance", "tags")
MODEL_FIELDS = (
    "class",
    "name",
    "size",
    "support",
    "rooms",
    "synonyms",
    "on",
    "clearance",
    "tags",
    "elevation",
    "colours",
    "materials",
    "surfaces",
    "emits",
    "yaw",
    "creator",
    "licence",
    "lamp",
    "glow",
    "two_sided",
    "flipped",
    "dropped",
    "looks",
    "faces",
    "of",
)
"""What a line of catalogue.json may hold; the last row and `yaw` go into the importer's Recipe."""


class CatalogueError(ValueError):
    """A catalogue that cannot be read: says what was expected, what came and what to do."""


def read_json(path: Path) -> dict:
    """The JSON object in `path`.

    Raises:
      CatalogueError: missing, not JSON, or not an object.
    """
    try:
        body = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as e:
        raise CatalogueError(f"{path} does not exist; docs/assets.md shows what it should hold") from e
    except (UnicodeDecodeError, json.JSONDecodeError) as e:
        raise CatalogueError(f"{path} is not JSON ({e})") from e
    if not isinstance(body, dict):
        raise CatalogueError(f"{path} should hold a JSON object, got {type(body).__name__}")
    return body


def check_classes(where: str, classes: Mapping[str, dict]) -> None:
    """Refuse shared fields of object classes that make no sense; `where` names their file."""
    for name, row in classes.items():
        _check_row(f"{where}: class {name!r}", row, CLASS_FIELDS)


def read_models(
    where: str, rows: Mapping[str, dict], classes: Mapping[str, dict], packs: Mapping[str, dict]
) -> tuple[dict[str, Asset], dict[str, Recipe]]:
    """The assets of catalogue rows by key over the classes they name, and how to import each.

    Args:
      where: name of the file, for error messages.
      packs: pack name to its 'licence'.
    """
    file, assets, recipes = where, {}, {}
    for key, row in rows.items():
        where = f"{file}: model {key!r}"
        _check_row(where, row, MODEL_FIELDS)
        if "of" in row:
            row = _variant(where, row, rows)
        if row.get("class") not in classes:
            raise CatalogueError(f"{where} has the unknown class {row.get('class')!r}; use one of data/classes.json")
        pack = packs.get(key.split("/")[0], {})
        assets[key] = _asset(where, key, classes[row["class"]] | row, classes[row["class"]], pack)
        recipes[key] = _recipe(assets[key], row)
    return assets, recipes


def _variant(where: str, row: Mapping, rows: Mapping[str, dict]) -> dict:
    """`row` filled up from the model it is a variant of; surfaces and lamp follow its size."""
    base = rows.get(row["of"])
    if base is None or "of" in base:
        raise CatalogueError(f"{where} should be a variant `of` a model in the same file, got {row['of']!r}")
    _check_row(where, base, MODEL_FIELDS)
    merged = {**base, **row, "looks": {**base.get("looks", {}), **row.get("looks", {})}}
    x, y, z = (n / o for n, o in zip(_size(where, merged), _size(where, base)))
    merged["surfaces"] = row.get("surfaces") or [
        [s[0], *(round(v * f, 4) for v, f in zip(s[1:6], (z, x, y, x, y))), s[6] if s[6] >= 9 else round(s[6] * z, 4)]
        for s in base.get("surfaces", ())
    ]
    if base.get("lamp"):
        merged["lamp"] = row.get("lamp") or [v * f for v, f in zip(base["lamp"], (x, y, z))]
    return merged


def _recipe(asset: Asset, row: Mapping) -> Recipe:
    lists = {name: tuple(row.get(name, ())) for name in ("two_sided", "flipped", "glow", "dropped")}
    return Recipe(
        asset.key,
        asset.size,
        yaw=float(row.get("yaw", 0.0)),
        emits=asset.emits,
        faces=int(row.get("faces", 0)),
        looks=tuple(sorted(row.get("looks", {}).items())),
        model=row.get("of", ""),
        **lists,
    )


def _asset(where: str, key: str, row: Mapping, shared: Mapping, pack: Mapping) -> Asset:
    return Asset(
        key=key,
        object_class=row["class"],
        name=row.get("name", row["class"]),
        size=_size(where, row),
        support=row["support"],
        rooms=MappingProxyType({k: float(row["rooms"][k]) for k in ROOM_KINDS if k in row.get("rooms", {})}),
        synonyms=tuple(row.get("synonyms", ())),
        colours=tuple(row.get("colours", ())),
        materials=tuple(row.get("materials", ())),
        on=tuple(row.get("on", ())),
        elevation=float(row.get("elevation", 0.0)),
        clearance=float(row.get("clearance", 0.0)),
        surfaces=tuple(SupportSurface(str(s[0]), *(float(v) for v in s[1:])) for s in row.get("surfaces", ())),
        tags=tuple(dict.fromkeys((*shared.get("tags", ()), *row.get("tags", ())))),
        emits=tuple(row["emits"]) if row.get("emits") else None,
        lamp=tuple(row["lamp"]) if row.get("lamp") else None,
        pack=key.split("/")[0],
        creator=row.get("creator", ""),
        licence=row.get("licence", pack.get("licence", "")),
    )


def _size(where: str, row: Mapping) -> tuple[float, float, float]:
    size = row.get("size")
    if (
        not isinstance(size, list)
        or len(size) != 3
        or not all(isinstance(s, (int, float)) and math.isfinite(s) and 0 < s < 30 for s in size)
    ):
        raise CatalogueError(f"{where} should have a size of three lengths in metres, got {size!r}")
    return float(size[0]), float(size[1]), float(size[2])


def _check_row(where: str, row: object, fields: tuple[str, ...]) -> None:
    if not isinstance(row, dict):
        raise CatalogueError(f"{where} should be an object, got {row!r}")
    if unknown := sorted(set(row) - set(fields)):
        raise CatalogueError(f"{where} has the unknown fields {unknown}; it may hold {list(fields)}")
    if row.get("support", "floor") not in SUPPORTS:
        raise CatalogueError(f"{where} has the unknown support {row['support']!r}; use one of {SUPPORTS}")
    if unknown := sorted(set(row.get("rooms", {})) - set(ROOM_KINDS)):
        raise CatalogueError(f"{where} names the unknown room kinds {unknown}; use {ROOM_KINDS}")
