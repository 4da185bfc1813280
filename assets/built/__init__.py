"""Things built in code: furniture and small objects that the asset packs lack.

What is built, in which sizes and looks, is a table: assets/data/built.json. How it is built is the code of this folder.
BUILT_ASSETS holds them by key, 'built/<name>', and what stands for a pack's poor model under that model's key;
`BUILT_ASSETS[key].make(size, params, finish)` gives the meshes.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping
from types import MappingProxyType

from embodied.assets import rows
from embodied.assets.built import basics, bath, decor, entry, everyday, kitchen, lamps, papers, soft, storage, tableware
from embodied.assets.built.parametric import LIGHTS, Build, ParametricAsset, built_parts, surface
from embodied.assets.json_file import RecordError, from_plain
from embodied.assets.materials import MATERIALS
from embodied.assets.records import Asset, SupportSurface
from embodied.assets.rows import DATA, Row, check_classes, read_json, read_models

BUILDS: Mapping[str, Build] = rows.made_in(
    *(basics, bath, decor, entry, everyday, kitchen, lamps, papers, soft, storage, tableware)
)
"""Every builder by '<module>.<function>'."""
SURFACES: Mapping[str, Callable[..., tuple[SupportSurface, ...]]] = MappingProxyType(
    {"shelves": storage.shelf_surfaces, "top": storage.top_surface}
)
"""Support surfaces that follow from size and look."""
BUILT_FIELDS = {"class", "build", "after", "set", "look"} | (rows.ASSET_FIELDS - {"creator", "licence"})


def read_built_assets(where: str, table: Row) -> Mapping[str, ParametricAsset]:
    """The assets of a table {"sets": {...}, "groups": [...]} by key 'built/<name>', keys sorted.

    Raises:
      RecordError: a field that is unknown or holds what it should not, a key twice.
    """
    assets_by_key: dict[str, ParametricAsset] = {}
    for group in table["groups"]:
        shared = {name: value for name, value in group.items() if name != "rows"}
        for name, row in group["rows"].items():
            thing, key = f"{where}: {name!r}", f"built/{name}"
            if key in assets_by_key:
                raise RecordError(f"{thing} stands there twice; give one of them another name")
            assets_by_key[key] = _parametric_asset(thing, key, _whole(thing, shared, row, table["sets"]))
    return MappingProxyType(dict(sorted(assets_by_key.items())))


def remade(where: str, table: Mapping[str, Row], assets: Mapping[str, Asset]) -> Mapping[str, ParametricAsset]:
    """The assets of those rows of the packs' catalogue that name a builder, by key.

    Such a thing keeps its key, words, size and surfaces, so that houses stay as they are; its mesh is built.

    Args:
      assets: of these rows.

    Raises:
      RecordError: a builder that does not exist.
    """
    assets_by_key = {}
    for key, given in table.items():
        row = rows.merged(table[given["of"]], given, deep=("look",)) if "of" in given else given
        if "build" in row:
            assets_by_key[key] = _parametric(f"{where}: model {key!r}", assets[key], row)
    return assets_by_key


def _whole(where: str, shared: Row, row: Row, sets: Mapping[str, Row]) -> Row:
    """A row over its set over what its group shares, with the words of the material it is made after."""
    chosen = dict(sets[rows.one_of(where, "set", row["set"], sets)]) if "set" in row else {}
    word = chosen.pop("word", "")
    out = rows.merged(shared, chosen, row, deep=("look",))
    if "after" in out:
        key = out.get("look", {}).get(out["after"])
        if key not in MATERIALS:
            raise RecordError(f"{where}: the look's {out['after']!r} should be a material's key, got {key!r}")
        made_of = MATERIALS[key]
        word = made_of.name
        out = rows.merged({"colours": list(made_of.colours), "materials": list(made_of.materials)}, out)
    out["name"] = str(out.get("name", out["class"])).replace("{}", word)
    return rows.only(where, out, BUILT_FIELDS)


def _parametric_asset(where: str, key: str, row: Row) -> ParametricAsset:
    plain = {name: value for name, value in row.items() if name not in ("surfaces", "emits")}
    asset = rows.asset_of(where, key, plain | {"licence": rows.REMADE_LICENCE})
    given = row.get("surfaces", [])
    if isinstance(given, str):
        surfaces = SURFACES[rows.one_of(where, "surfaces", given, SURFACES)](asset.size, row.get("look", {}))
    else:
        surfaces = tuple(surface(**s) for s in given)
    emits = LIGHTS[rows.one_of(where, "emits", row["emits"], LIGHTS)] if "emits" in row else None
    return _parametric(where, dataclasses.replace(asset, surfaces=surfaces, emits=emits), row)


def _parametric(where: str, asset: Asset, row: Row) -> ParametricAsset:
    build = BUILDS[rows.one_of(where, "build", row["build"], BUILDS)]
    params = from_plain(dict[str, str | int | float], row.get("look", {}), f"{where}: 'look'")
    return ParametricAsset(asset, functools.partial(built_parts, asset.key, build, params), {"seed": 0.0, **params})


__all__ = ["BASICS", "BUILT_ASSETS", "ParametricAsset"]


_CLASSES = check_classes("classes.json", read_json(DATA / "classes.json"))
_MODELS, _TABLE = read_json(DATA / "catalogue.json"), read_json(DATA / "basics.json")
_BASIC = read_built_assets("basics.json", _TABLE | {"groups": [_CLASSES[g["class"]] | g for g in _TABLE["groups"]]})
_REMADE = remade("catalogue.json", _MODELS, read_models("catalogue.json", _MODELS, _CLASSES, {})[0])
BASICS = frozenset(_BASIC)
"""Keys of the simple furniture that houses get only where no furniture models are installed."""
_ALL = {**read_built_assets("built.json", read_json(DATA / "built.json")), **_BASIC, **_REMADE}
BUILT_ASSETS: Mapping[str, ParametricAsset] = MappingProxyType(dict(sorted(_ALL.items())))
"""Every one by key, keys sorted."""
