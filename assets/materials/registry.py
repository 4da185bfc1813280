"""The table of materials, assets/data/materials.json, read into MATERIALS. docs/assets.md says what a row may hold."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from embodied.assets import rows
from embodied.assets.materials import art, maps, mineral, surface, textile, wood
from embodied.assets.materials.maps import Canvas, Maps
from embodied.assets.materials.material import ROLES, Material
from embodied.assets.rows import CatalogueError, Field, Row

PAINTERS = rows.made_in(art, maps, mineral, surface, textile, wood)
"""Painters that a row may name with "by", as '<module>.<name>': recipes, and layouts, motifs and cloths for them."""
MATERIAL_FIELDS = {
    "family": rows.WORD,
    "name": rows.WORD,
    "roles": Field(
        f"a list of roles out of {', '.join(ROLES)}", lambda v: rows.is_list(v, lambda r: r in ROLES) and bool(v)
    ),
    "colours": rows.WORD_LIST,
    "materials": rows.WORD_LIST,
    "tile": Field("a length from 0.01 to 10 metres", lambda v: rows.is_number(v, 0.01, 10.0)),
    "pixels": Field("a whole number from 64 to 4096", lambda v: isinstance(v, int) and 64 <= v <= 4096),
    "specular": Field("a number from 0 to 1", lambda v: rows.is_number(v, 0.0, 1.0)),
    "metallic": Field("a number from 0 to 1", lambda v: rows.is_number(v, 0.0, 1.0)),
    "maps": Field('an object with "by" and what that is told', lambda v: isinstance(v, dict)),
}


def read_materials(where: str, table: Row) -> Mapping[str, Material]:
    """The materials of a table {"groups": [...]} by key, keys sorted.

    Args:
      where: name of the file, for error messages.

    Raises:
      CatalogueError: a field that is unknown, missing, or holds what it should not; a key twice.
    """
    materials: dict[str, Material] = {}
    for group in table["groups"]:
        shared = {name: value for name, value in group.items() if name != "rows"}
        for key, row in group["rows"].items():
            if key in materials:
                raise CatalogueError(f"{where}: {key!r} stands there twice; give one of them another key")
            materials[key] = _material(f"{where}: {key!r}", key, rows.merged(shared, row, deep=("maps",)))
    return MappingProxyType(dict(sorted(materials.items())))


def _material(where: str, key: str, row: Row) -> Material:
    rows.check_row(where, row, MATERIAL_FIELDS)
    if missing := sorted(set(MATERIAL_FIELDS) - {"specular", "metallic"} - set(row)):
        raise CatalogueError(f"{where} should also say {missing}, itself or its group")
    return Material(
        key=key,
        family=row["family"],
        roles=tuple(row["roles"]),
        name=row["name"],
        colours=tuple(row["colours"]),
        materials=tuple(row["materials"]),
        tile=float(row["tile"]),
        pixels=row["pixels"],
        recipe=functools.partial(_drawn, recipe_of(where, row["maps"])),
        told=row["maps"],
        specular=float(row.get("specular", 0.5)),
        metallic=float(row.get("metallic", 0.0)),
    )


def recipe_of(where: str, described: Row) -> Callable[..., Any]:
    """The meaning of {"by": painter, argument: value, ...}: a function that knows these arguments, or the record of
    a class; values may be such objects themselves, lists become tuples.

    Raises:
      CatalogueError: an unknown painter, an argument it does not take.
    """
    arguments = dict(described)
    name = arguments.pop("by", None)
    if name not in PAINTERS:
        raise CatalogueError(f'{where} should have a "by" out of {", ".join(sorted(PAINTERS))}, got {name!r}')
    painter = PAINTERS[name]
    taken = [p.name for p in inspect.signature(painter).parameters.values()]
    if unknown := sorted(set(arguments) - set(taken)):
        raise CatalogueError(f"{where}: {name} does not take {unknown}; it takes {taken}")
    values = {argument: _value(where, value) for argument, value in arguments.items()}
    return painter(**values) if isinstance(painter, type) else functools.partial(painter, **values)


def _drawn(painter: Callable[[Canvas], Maps], n: int, tile: float, *, rng: np.random.Generator) -> Maps:
    return painter(Canvas(n, tile, rng))


def painters_of(recipe: object) -> set[str]:
    """Every painter that a recipe of the table names."""
    if isinstance(recipe, dict):
        return {recipe["by"]}.union(*(painters_of(value) for value in recipe.values()))
    return set()


def _value(where: str, value: Any) -> Any:
    if isinstance(value, dict):
        return recipe_of(where, value)
    return tuple(_value(where, v) for v in value) if isinstance(value, list) else value


MATERIALS: Mapping[str, Material] = read_materials("materials.json", rows.read_json(rows.DATA / "materials.json"))
"""Every material by key, keys sorted."""
