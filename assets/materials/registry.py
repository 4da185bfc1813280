"""The table of materials, assets/data/materials.json, read into MATERIALS. docs/assets.md says what a row may hold."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from embodied.assets import rows
from embodied.assets.json_file import RecordError, from_plain
from embodied.assets.materials import art, maps, mineral, surface, textile, wood
from embodied.assets.materials.maps import Canvas, Maps
from embodied.assets.records import DETAILS
from embodied.assets.rows import Row

PAINTERS = rows.made_in(art, maps, mineral, surface, textile, wood)
"""Painters that a row may name with "by", as '<module>.<name>': recipes, and layouts, motifs and cloths for them."""


@dataclass(frozen=True, eq=False)
class Material:
    """A procedural material."""

    key: str
    """'<maker>/<variant>'."""
    family: str
    """Its matter: 'wood', 'tile', 'carpet', 'paint', 'wallpaper', 'stone', 'fabric', 'metal', ..."""
    name: str
    """'oak planks', 'sage green paint'."""
    colours: tuple[str, ...]
    materials: tuple[str, ...]
    tile: float
    """Side of the square the maps cover, metres."""
    pixels: int
    """Side of the maps."""
    maps: Mapping[str, Any]
    """Description of what draws them: {"by": painter, argument: value, ...}."""
    specular: float = 0.5
    metallic: float = 0.0
    detail: str | None = None
    """The detail that it shows from nearby, one of embodied.assets.records.DETAILS; None for what is smooth."""

    def __post_init__(self) -> None:
        rules = {
            "'tile' should be a length from 0.01 to 10 metres": 0.01 <= self.tile <= 10,
            "'pixels' should be a whole number from 64 to 4096": 64 <= self.pixels <= 4096,
            f"'detail' should be one of {DETAILS}": self.detail in (None, *DETAILS),
            "'specular' and 'metallic' should be numbers from 0 to 1": min(self.specular, self.metallic) >= 0
            and max(self.specular, self.metallic) <= 1,
        }
        recipe_of(self.maps)
        if wrong := [rule for rule, holds in rules.items() if not holds]:
            raise ValueError(wrong[0])

    @functools.cached_property
    def _painter(self) -> Callable[[Canvas], Maps]:
        return recipe_of(self.maps)

    def draw(self, n: int, *, rng: np.random.Generator) -> Maps:
        """The maps, n pixels wide."""
        return self._painter(Canvas(n, self.tile, rng))


def read_materials(where: str, table: Row) -> Mapping[str, Material]:
    """The materials of a table {"groups": [...]} by key, keys sorted.

    Args:
      where: name of the file, for error messages.

    Raises:
      RecordError: a field that is unknown, missing, or holds what it should not; a key twice.
    """
    materials: dict[str, Material] = {}
    for group in table["groups"]:
        shared = {name: value for name, value in group.items() if name != "rows"}
        for key, row in group["rows"].items():
            if key in materials:
                raise RecordError(f"{where}: {key!r} stands there twice; give one of them another key")
            whole = {"key": key} | rows.merged(shared, row, deep=("maps",))
            materials[key] = from_plain(Material, whole, f"{where}: {key!r}")
    return MappingProxyType(dict(sorted(materials.items())))


def recipe_of(described: Mapping[str, Any]) -> Callable[..., Any]:
    """The meaning of {"by": painter, argument: value, ...}: a function that knows these arguments, or the record of
    a class; values may be such objects themselves, lists become tuples.

    Raises:
      ValueError: an unknown painter, an argument it does not take.
    """
    arguments = dict(described)
    name = arguments.pop("by", None)
    if name not in PAINTERS:
        raise ValueError(f'its maps should have a "by" out of {", ".join(sorted(PAINTERS))}, got {name!r}')
    painter = PAINTERS[name]
    taken = [p.name for p in inspect.signature(painter).parameters.values()]
    if unknown := sorted(set(arguments) - set(taken)):
        raise ValueError(f"{name} does not take {unknown}; it takes {taken}")
    values = {argument: _value(value) for argument, value in arguments.items()}
    return painter(**values) if isinstance(painter, type) else functools.partial(painter, **values)


def painters_of(recipe: object) -> set[str]:
    """Every painter that a recipe of the table names."""
    if isinstance(recipe, dict):
        return {recipe["by"]}.union(*(painters_of(value) for value in recipe.values()))
    return set()


def _value(value: Any) -> Any:
    if isinstance(value, dict):
        return recipe_of(value)
    return tuple(_value(v) for v in value) if isinstance(value, list) else value


MATERIALS: Mapping[str, Material] = read_materials("materials.json", rows.read_json(rows.DATA / "materials.json"))
"""Every material by key, keys sorted."""
