"""Rows of the tables in assets/data and of users' catalogue.json: read, checked, made Assets and Recipes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

from embodied.assets import json_file
from embodied.assets.json_file import RecordError
from embodied.assets.records import ROOM_KINDS, SUPPORTS, Asset, ImportRecipe, SupportSurface

Row = dict[str, Any]
"""One JSON object of a table."""

DATA = Path(__file__).parent / "data"
SIZES = (0.001, 30.0)
"""Shortest and longest side of a thing, metres."""


class CatalogueError(RecordError):
    """A catalogue that cannot be read: says what was expected, what came and what to do."""


@dataclass(frozen=True)
class Field:
    """A field of a row, and the values that it may have."""

    what: str
    """In words, for the error message."""
    holds: Callable[[Any], bool]


def is_number(value: object, low: float = -1e6, high: float = 1e6) -> bool:
    """True if a JSON value is a number from `low` to `high`; neither NaN nor true nor 400 digits long."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and low <= value <= high


def is_text(value: object, most: int = 200) -> bool:
    """True if a JSON value is one line of text that can be printed and encoded."""
    return isinstance(value, str) and value.isprintable() and len(value) <= most


def is_list(value: object, holds: Callable[[Any], bool], count: int | None = None) -> bool:
    """True if a JSON value is a list (of `count` entries, if given) of values that `holds` accepts."""
    return isinstance(value, list) and count in (None, len(value)) and all(holds(v) for v in value)


def _is_surface(value: object) -> bool:
    if not (isinstance(value, list) and len(value) == 7 and is_text(value[0])):
        return False
    _, z, x0, y0, x1, y1, headroom = value
    return all(is_number(v, -30.0, 30.0) for v in value[1:]) and x0 < x1 and y0 < y1 and headroom > 0


def _is_object(value: object, holds: Callable[[Any, Any], bool]) -> bool:
    return isinstance(value, dict) and all(holds(k, v) for k, v in value.items())


LINE_OF_TEXT = Field("one line of text of at most 200 characters", is_text)
WORD = Field("a word or more", lambda v: is_text(v) and bool(v.strip()))
WORD_LIST = Field("a list of words", lambda v: is_list(v, is_text))
LENGTH = Field("a length from 0 to 30 metres", lambda v: is_number(v, 0.0, 30.0))
SIZE_FIELD = Field(
    f"a size of three lengths in metres, each from {SIZES[0]:g} to {SIZES[1]:g}",
    lambda v: is_list(v, lambda s: is_number(s, *SIZES), 3),
)
LOOK = Field("an object of words and numbers", lambda v: _is_object(v, lambda _, x: is_text(x) or is_number(x)))
WEIGHTS = Field(
    f"room kinds with weights from 0 up; the room kinds are {', '.join(ROOM_KINDS)}",
    lambda v: _is_object(v, lambda kind, weight: kind in ROOM_KINDS and is_number(weight, 0.0)),
)
SUPPORT = Field(f"one of {', '.join(SUPPORTS)}", lambda v: v in SUPPORTS)
FIELDS = {
    "class": WORD,
    "name": WORD,
    "size": SIZE_FIELD,
    "support": SUPPORT,
    "rooms": WEIGHTS,
    "synonyms": WORD_LIST,
    "on": WORD_LIST,
    "clearance": LENGTH,
    "tags": WORD_LIST,
    "elevation": LENGTH,
    "colours": WORD_LIST,
    "materials": WORD_LIST,
    "surfaces": Field(
        "a list of [name, z, x0, y0, x1, y1, headroom], metres, x0 < x1 and y0 < y1", lambda v: is_list(v, _is_surface)
    ),
    "emits": Field(
        "three numbers from 0 up, or null", lambda v: v is None or is_list(v, lambda x: is_number(x, 0.0), 3)
    ),
    "creator": LINE_OF_TEXT,
    "licence": LINE_OF_TEXT,
    "lamp": Field("a point of three numbers, or null", lambda v: v is None or is_list(v, is_number, 3)),
    "yaw": Field("a number of degrees", is_number),
    "glow": WORD_LIST,
    "two_sided": WORD_LIST,
    "flipped": WORD_LIST,
    "dropped": WORD_LIST,
    "looks": Field(
        "an object of material names and words", lambda v: _is_object(v, lambda k, x: is_text(k) and is_text(x))
    ),
    "faces": Field("a whole number from 0 up", lambda v: is_number(v, 0) and v == int(v)),
    "of": WORD,
}
"""Fields of a line of a catalogue; from `yaw` on it tells the importer."""
REMADE_FIELDS = {"build": WORD, "look": LOOK}
"""Further fields of a line of data/catalogue.json, where code builds what the pack's model is too poor for."""
REMADE_LICENCE = "Apache-2.0"
"""Of meshes that code builds."""
CLASS_FIELDS = ("support", "rooms", "synonyms", "on", "clearance", "tags")


def read_json(path: Path) -> Row:
    """The JSON object in `path`.

    Raises:
      CatalogueError: missing, not readable, not JSON, or not an object.
    """
    try:
        return json_file.read_json(path)
    except FileNotFoundError as e:
        raise CatalogueError(f"{path} does not exist; docs/assets.md shows what it should hold") from e
    except OSError as e:  # a folder, no permission, a symbolic link to itself
        raise CatalogueError(f"{path} cannot be read ({e.strerror or e}); it should be a file of JSON") from e
    except RecordError as e:
        raise CatalogueError(str(e)) from e


def check_row(where: str, row: object, fields: Mapping[str, Field]) -> Row:
    """`row` itself if it is an object whose fields are all known and hold what they should.

    Args:
      where: what the row is called in error messages.

    Raises:
      CatalogueError: says which field is wrong, and what it should hold.
    """
    if not isinstance(row, dict):
        raise CatalogueError(f"{where} should be an object, got {shown(row)}")
    if unknown := sorted(set(row) - set(fields)):
        raise CatalogueError(f"{where} has the unknown fields {unknown}; it may hold {list(fields)}")
    for name, value in row.items():
        if not fields[name].holds(value):
            raise CatalogueError(f"{where}: {name!r} should be {fields[name].what}, got {shown(value)}")
    return row


def shown(value: object) -> str:
    """`value` as an error message may show it: short, whatever somebody put into a file."""
    if isinstance(value, int) and abs(value) > 10**18:
        return "a number of more than 18 digits"
    text = repr(value) if not isinstance(value, (list, dict)) or len(value) < 20 else type(value).__name__
    return text if len(text) <= 120 else text[:117] + "..."


def check_classes(where: str, classes: object) -> Mapping[str, Row]:
    """The shared fields of object classes, if they make sense; `where` names their file."""
    for name, row in objects(where, "classes", classes).items():
        check_row(f"{where}: class {name!r}", row, {f: FIELDS[f] for f in CLASS_FIELDS})
    return objects(where, "classes", classes)


def objects(where: str, name: str, value: object) -> Mapping[str, Row]:
    """`value` if it is an object of named objects."""
    if not isinstance(value, dict) or not all(is_text(k, 80) and k.strip() for k in value):
        raise CatalogueError(f"{where}: {name!r} should be an object of named rows, got {shown(value)}")
    for key, row in value.items():
        if not isinstance(row, dict):
            raise CatalogueError(f"{where}: {name!r}: {key!r} should be an object, got {shown(row)}")
    return value


def read_models(
    where: str, rows: Mapping[str, Row], classes: Mapping[str, Row], licences: Mapping[str, str]
) -> tuple[dict[str, Asset], dict[str, ImportRecipe]]:
    """The assets of catalogue rows by key over the classes they name, and how to import each that is not built.

    Args:
      where: name of the file, for error messages.
      licences: by pack, for models that do not state their own.
    """
    assets, recipes = {}, {}
    for key, given in rows.items():
        model = f"{where}: model {key!r}"
        row = check_row(model, given, FIELDS | REMADE_FIELDS)
        if "of" in row:
            row = variant(model, row, rows)
        if row.get("class") not in classes:
            raise CatalogueError(f"{model} has the unknown class {row.get('class')!r}; use one of data/classes.json")
        shared = classes[row["class"]]
        tags = list(dict.fromkeys((*shared.get("tags", ()), *row.get("tags", ()))))
        licence = REMADE_LICENCE if "build" in row else licences.get(key.split("/")[0], "")
        assets[key] = asset_of(model, key, {"licence": licence} | shared | row | {"tags": tags})
        if "build" not in row:
            recipes[key] = _recipe(assets[key], row)
    return assets, recipes


def asset_of(where: str, key: str, row: Mapping[str, Any]) -> Asset:
    """The asset that a checked row describes, on its own."""
    for name in ("size", "support"):
        if name not in row:
            raise CatalogueError(f"{where} should have {FIELDS[name].what} as its {name!r}, got none")
    x, y, z = row["size"]
    return Asset(
        key=key,
        object_class=row["class"],
        name=row.get("name", row["class"]),
        size=(float(x), float(y), float(z)),
        support=row["support"],
        rooms={k: float(row["rooms"][k]) for k in ROOM_KINDS if k in row.get("rooms", {})},
        synonyms=tuple(row.get("synonyms", ())),
        colours=tuple(row.get("colours", ())),
        materials=tuple(row.get("materials", ())),
        on=tuple(row.get("on", ())),
        elevation=float(row.get("elevation", 0.0)),
        clearance=float(row.get("clearance", 0.0)),
        surfaces=tuple(SupportSurface(str(s[0]), *(float(v) for v in s[1:])) for s in row.get("surfaces", ())),
        tags=tuple(row.get("tags", ())),
        emits=_three(row.get("emits")),
        lamp=_three(row.get("lamp")),
        pack=key.split("/")[0],
        creator=row.get("creator", ""),
        licence=row.get("licence", ""),
    )


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
    """`row` filled up from the model it is a variant of; surfaces and lamp follow its size."""
    base = rows.get(row["of"])
    if base is None or "of" in base:
        raise CatalogueError(f"{where} should be a variant `of` a model in the same file, got {row['of']!r}")
    check_row(where, base, FIELDS | REMADE_FIELDS)
    if "size" not in base:
        raise CatalogueError(f"{where} is a variant of {row['of']!r}, which should have {SIZE_FIELD.what}, got none")
    out = merged(base, row, deep=("look", "looks"))
    x, y, z = (n / o for n, o in zip(out["size"], base["size"]))
    out["surfaces"] = row.get("surfaces") or [
        [s[0], *(round(v * f, 4) for v, f in zip(s[1:6], (z, x, y, x, y))), s[6] if s[6] >= 9 else round(s[6] * z, 4)]
        for s in base.get("surfaces", ())
    ]
    if base.get("lamp"):
        out["lamp"] = row.get("lamp") or [v * f for v, f in zip(base["lamp"], (x, y, z))]
    return out


def _recipe(asset: Asset, row: Row) -> ImportRecipe:
    return ImportRecipe(
        asset.key,
        asset.size,
        yaw=float(row.get("yaw", 0.0)),
        two_sided=tuple(row.get("two_sided", ())),
        flipped=tuple(row.get("flipped", ())),
        glow=tuple(row.get("glow", ())),
        emits=asset.emits,
        dropped=tuple(row.get("dropped", ())),
        looks=tuple(sorted(row.get("looks", {}).items())),
        faces=int(row.get("faces", 0)),
        model=row.get("of", ""),
    )


def _three(values: list[float] | None) -> tuple[float, float, float] | None:
    return (values[0], values[1], values[2]) if values else None
