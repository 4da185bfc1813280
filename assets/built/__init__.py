"""Things built in code: furniture and small objects that the asset packs lack.

What is built, in which sizes and looks, is a table: assets/data/built.json. How it is built is the code of this folder.
BUILT_ASSETS holds them by key, 'built/<name>', and what stands for a pack's poor model under that model's key;
`BUILT_ASSETS[key].make(size, params, finish)` gives the meshes.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from embodied.assets.built.parametric import ParametricAsset
from embodied.assets.built.table import read_built_assets, remade
from embodied.assets.rows import DATA, check_classes, read_json, read_models

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
