"""The table of built things, assets/data/built.json, read into assets. docs/assets.md says what a row may hold."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping
from types import MappingProxyType

from embodied.assets import rows
from embodied.assets.built import (
    appliances,
    basics,
    bath,
    decor,
    entry,
    everyday,
    fittings,
    kitchen,
    lamps,
    luggage,
    papers,
    plants,
    soft,
    storage,
    tableware,
)
from embodied.assets.built.parametric import LIGHTS, Build, ParametricAsset, ParamValues, built_parts, surface
from embodied.assets.materials import MATERIALS
from embodied.assets.records import Asset, SupportSurface
from embodied.assets.rows import CatalogueError, Field, Row

BUILDS: Mapping[str, Build] = rows.made_in(
    *(appliances, basics, bath, decor, entry, everyday, fittings, kitchen),
    *(lamps, luggage, papers, plants, soft, storage, tableware),
)
"""Every builder by '<module>.<function>'."""
SURFACES: Mapping[str, Callable[..., tuple[SupportSurface, ...]]] = MappingProxyType(
    {"shelves": storage.shelf_surfaces, "top": storage.top_surface}
)
"""Support surfaces that follow from size and look."""
SURFACE_NUMBERS = {"z", "width", "depth", "headroom", "margin", "x", "y"}


def _is_surfaces(value: object) -> bool:
    if isinstance(value, str):
        return value in SURFACES
    return isinstance(value, list) and all(
        isinstance(s, dict)
        and rows.is_text(s.get("name"))
        and {"z", "width", "depth"} <= set(s)
        and set(s) <= {"name", *SURFACE_NUMBERS}
        and all(rows.is_number(s[n]) for n in set(s) & SURFACE_NUMBERS)
        for s in value
    )


BUILT_FIELDS = {
    **{
        name: rows.FIELDS[name]
        for name in ("class", "name", "size", "support", "on", "elevation", "clearance", "rooms")
        + ("synonyms", "colours", "materials", "tags")
    },
    "build": Field(f"one of {', '.join(sorted(BUILDS))}", lambda v: v in BUILDS),
    "surfaces": Field(
        f"a list of {{name, z, width, depth, headroom, margin, x, y}}, or one of {sorted(SURFACES)}", _is_surfaces
    ),
    "emits": Field(f"one of {sorted(LIGHTS)}", lambda v: v in LIGHTS),
    "after": rows.WORD,
    "set": rows.WORD,
    "look": rows.LOOK,
}
SET_FIELDS = {name: BUILT_FIELDS[name] for name in ("colours", "materials", "tags", "look")} | {"word": rows.WORD}


def read_built_assets(where: str, table: Row) -> Mapping[str, ParametricAsset]:
    """The assets of a table {"sets": {...}, "groups": [...]} by key 'built/<name>', keys sorted.

    Args:
      where: name of the file, for error messages.

    Raises:
      CatalogueError: a field that is unknown or holds what it should not, a key twice.
    """
    sets = {name: rows.check_row(f"{where}: set {name!r}", row, SET_FIELDS) for name, row in table["sets"].items()}
    assets_by_key: dict[str, ParametricAsset] = {}
    for group in table["groups"]:
        shared = {name: value for name, value in group.items() if name != "rows"}
        for name, row in group["rows"].items():
            thing, key = f"{where}: {name!r}", f"built/{name}"
            if key in assets_by_key:
                raise CatalogueError(f"{thing} stands there twice; give one of them another name")
            assets_by_key[key] = _parametric_asset(thing, key, _whole(thing, shared, row, sets))
    return MappingProxyType(dict(sorted(assets_by_key.items())))


def remade(where: str, table: Mapping[str, Row], assets: Mapping[str, Asset]) -> Mapping[str, ParametricAsset]:
    """The assets of those rows of the packs' catalogue that name a builder, by key.

    Such a thing keeps its key, words, size and surfaces, so that houses stay as they are; its mesh is built.

    Args:
      where: name of the file, for error messages.
      assets: of these rows.

    Raises:
      CatalogueError: a builder that does not exist.
    """
    assets_by_key = {}
    for key, given in table.items():
        row = rows.variant(f"{where}: model {key!r}", given, table) if "of" in given else given
        if "build" in row:
            rows.check_row(f"{where}: model {key!r}", {"build": row["build"]}, {"build": BUILT_FIELDS["build"]})
            params: ParamValues = row.get("look", {})
            make = functools.partial(built_parts, key, BUILDS[row["build"]], params)
            assets_by_key[key] = ParametricAsset(assets[key], make, {"seed": 0.0, **params})
    return assets_by_key


def _whole(where: str, shared: Row, row: Row, sets: Mapping[str, Row]) -> Row:
    """A row over its set over what its group shares, with the words of the material it is made after."""
    rows.check_row(where, {**shared, **row}, BUILT_FIELDS)
    chosen: Row = {}
    word = ""
    if "set" in row:
        if row["set"] not in sets:
            raise CatalogueError(f"{where} names the unknown set {row['set']!r}; use one of {sorted(sets)}")
        chosen = {name: value for name, value in sets[row["set"]].items() if name != "word"}
        word = sets[row["set"]]["word"]
    out = rows.merged(shared, chosen, row, deep=("look",))
    if "after" in out:
        key = out.get("look", {}).get(out["after"])
        if key not in MATERIALS:
            raise CatalogueError(f"{where}: the look's {out['after']!r} should be a material's key, got {key!r}")
        made_of = MATERIALS[key]
        word = made_of.name
        out = rows.merged({"colours": list(made_of.colours), "materials": list(made_of.materials)}, out)
    out["name"] = str(out.get("name", out["class"])).replace("{}", word)
    return out


def _parametric_asset(where: str, key: str, row: Row) -> ParametricAsset:
    params: ParamValues = row.get("look", {})
    plain = {name: value for name, value in row.items() if name not in ("surfaces", "emits")}
    asset = rows.asset_of(where, key, plain | {"licence": rows.REMADE_LICENCE})
    given = row.get("surfaces", [])
    surfaces = SURFACES[given](asset.size, params) if isinstance(given, str) else tuple(surface(**s) for s in given)
    asset = dataclasses.replace(asset, surfaces=surfaces, emits=LIGHTS[row["emits"]] if "emits" in row else None)
    return ParametricAsset(
        asset, functools.partial(built_parts, key, BUILDS[row["build"]], params), {"seed": 0.0, **params}
    )
